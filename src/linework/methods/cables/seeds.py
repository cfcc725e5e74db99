"""Seed lines of wires in plan: peaks of Radon transforms of windows of the image of isolated points."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from linework.arrays import FloatArray, IntArray
from linework.methods.radon.peaks import PeakFinder, find_peaks, peaks_by
from linework.methods.radon.transform import evenly_spaced_angles, radon_of_cells, rho_bins

#: Step of the angles: half a step moves the end of a 24 m window by 8 cm, less than half a cell. [deg]
ANGLE_STEP_DEG = 0.75
#: Lengths of the dilating elements in theta [deg] and rho [m]: of two peaks within half of both only the higher is a
#: seed. Closer wires share a seed, whose slice is wide enough for both.
THETA_WINDOW_DEG, RHO_WINDOW_M = 6.0, 0.8
#: Least occupied length of a wire in a window: five cells of 0.2 m. Chance alignments have that, too; the slice
#: decides. [m]
LEAST_STRENGTH_M = 1.0
#: Half width of the neighbourhood in rho that a seed must exceed: leaves fill it, wires do not. [m]
SCATTER_M = 2.0
#: Deviations of a count by which a seed exceeds the mean of its neighbourhood.
SCATTER_SIGMAS = 4.0
#: Fewest occupied cells of a window with a seed.
LEAST_SEED_CELLS = 5


class Seed(NamedTuple):
    """A line in plan through (x, y) along the unit vector (ux, uy), within `half_m` of that point. [m]."""

    strength_m: float
    x: float
    y: float
    ux: float
    uy: float
    half_m: float


def find_cable_seeds(
    xy: FloatArray, *, window_m: float, cell_m: float, finder: PeakFinder | None = None
) -> list[Seed]:
    """Return the seed lines of all windows, the strongest first.

    Parameters
    ----------
    xy
        (n, 2) isolated points, from an origin that is a whole multiple of the windows' stride or shared by all
        tiles. [m]
    window_m
        Side of a square window; windows overlap by half. [m]
    cell_m
        Side of a cell of the binary image. [m]
    finder
        Own function that finds the peaks of each window's Radon image; None: `linework.methods.radon.peaks.find_peaks`.

    Notes
    -----
    Windows lie on a fixed lattice, the same in neighbouring tiles.
    """
    cells = np.unique(np.floor(xy / cell_m).astype(np.int64), axis=0)
    centres = np.asarray((cells + 0.5) * cell_m, dtype=np.float64)
    angles = evenly_spaced_angles(ANGLE_STEP_DEG)
    rho_max = window_m / math.sqrt(2.0)
    rho = rho_bins(rho_max, cell_m)
    seeds: list[Seed] = []
    for members, centre in _windows(centres, window_m):
        x, y = (np.ascontiguousarray(column) for column in (centres[members] - centre).T)
        values = radon_of_cells(
            x,
            y,
            np.ones(len(members)),
            cell_width_m=cell_m,
            cell_height_m=cell_m,
            angles_rad=angles,
            rho_step_m=cell_m,
            rho_max_m=rho_max,
        )
        seeds += _seeds_of(values, angles, rho, centre, window_m / 2.0, finder)
    return sorted(seeds, key=lambda seed: (-seed.strength_m, seed[1:]))


def _seeds_of(
    values: FloatArray,
    angles: FloatArray,
    rho: FloatArray,
    centre: FloatArray,
    half_m: float,
    finder: PeakFinder | None,
) -> list[Seed]:
    """Return the peaks of the Radon image of a window that exceed their neighbourhood."""
    windows = {"theta_window_rad": math.radians(THETA_WINDOW_DEG), "rho_window_m": RHO_WINDOW_M}
    if finder is None:
        peaks = find_peaks(values, angles, rho, threshold=LEAST_STRENGTH_M, **windows)
    else:
        peaks = peaks_by(finder, values, angles, rho, threshold=LEAST_STRENGTH_M, **windows)
    at_angle = np.minimum(np.searchsorted(angles, peaks.theta_rad), len(angles) - 1)
    at_rho = np.minimum(np.searchsorted(rho, peaks.rho_m), len(rho) - 1)
    scatter = _scatter(values, at_angle, at_rho, float(rho[1] - rho[0]))
    out = np.flatnonzero(peaks.strength_m > scatter)
    cos, sin = np.cos(peaks.theta_rad[out]), np.sin(peaks.theta_rad[out])
    x, y = centre[0] + peaks.rho_m[out] * cos, centre[1] + peaks.rho_m[out] * sin
    strength = peaks.strength_m[out]
    return [
        Seed(float(strength[i]), float(x[i]), float(y[i]), -float(sin[i]), float(cos[i]), half_m)
        for i in range(len(out))
    ]


def _scatter(values: FloatArray, at_angle: IntArray, at_rho: IntArray, cell_m: float) -> FloatArray:
    """Return the strength (k,) that scattered cells would reach at each peak: mean nearby in rho, and four deviations."""
    around = round(SCATTER_M / cell_m)
    padded = np.pad(values[at_angle], ((0, 0), (around, around)))
    nearby = at_rho[:, None] + np.arange(2 * around + 1)
    mean = np.take_along_axis(padded, nearby, axis=1).mean(axis=1)
    scatter: FloatArray = mean + SCATTER_SIGMAS * np.sqrt(np.maximum(mean, 0.0) * cell_m)
    return scatter


def _windows(centres: FloatArray, window_m: float) -> list[tuple[IntArray, FloatArray]]:
    """Return the members and the centre of each window that holds enough cells for a seed."""
    windows = []
    for shift in ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5)):
        number = np.floor(centres / window_m + shift).astype(np.int64)
        order = np.lexsort((number[:, 0], number[:, 1]))
        ordered = number[order]
        new = np.any(np.diff(ordered, axis=0, prepend=ordered[:1] - 1) != 0, axis=1)
        for members in np.split(order, np.flatnonzero(new)[1:]):
            if len(members) >= LEAST_SEED_CELLS:
                centre = (number[members[0]] + 0.5 - np.array(shift)) * window_m
                windows.append((members, centre))
    return windows
