"""Guardrails from laser points as published by Manandhar and Shibasaki (2002), section by section.

D. Manandhar, R. Shibasaki: Extraction of linear features from vehicle-borne laser data. `linework.methods.radon.method`
goes beyond it: bends, hedges and parked cars, heights of beams, sigmas. What the paper does not say is a setting here,
with the reason of its default.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import grey_dilation

from linework.arrays import BoolArray, FloatArray
from linework.model.grid import Bounds, holds
from linework.model.settings import Settings, setting


@dataclass(frozen=True, slots=True, kw_only=True)
class Radon2002Config(Settings):
    """Settings of the method as published."""

    image_m: float = setting(
        60.0, unit="m", reason="side of an image; not published; 300 cells of 20 cm", low=10, high=500
    )
    cell_m: float = setting(0.20, unit="m", reason="published", low=0.02, high=2)
    min_height_m: float = setting(0.2, unit="m", reason="published", low=-10, high=100)
    max_height_m: float = setting(1.2, unit="m", reason="published", low=-10, high=100)
    step_deg: float = setting(
        0.25, unit="deg", reason="not published; a cell at half an image's side", low=0.05, high=10
    )
    theta_element_deg: float = setting(
        6.0, unit="deg", reason="not published; the ridge of one rail is narrower", low=0, high=90
    )
    rho_element_m: float = setting(
        1.0, unit="m", reason="not published; two beams of a median are further apart", low=0, high=20
    )
    threshold_m: float = setting(
        8.0, unit="m", reason="not published; two bays of a guardrail", low=0, high=500
    )
    max_gap_m: float = setting(
        1.0, unit="m", reason="not published; four scan lines at the widest spacing", low=0, high=100
    )
    min_length_m: float = setting(4.0, unit="m", reason="not published; one bay", low=0, high=500)
    circle_spacing_m: float = setting(0.5, unit="m", reason="not published", low=0.05, high=10)
    circle_growth_m: float = setting(0.1, unit="m", reason="not published; half a cell", low=0.01, high=1)
    max_radius_m: float = setting(
        0.5, unit="m", reason="not published; a beam with its posts is 0.4 m deep", low=0.05, high=5
    )
    fit_m: float = setting(5.0, unit="m", reason="not published; length of a local fit", low=1, high=100)


# Image creation and analysis


@dataclass(frozen=True, slots=True)
class HeightImages:
    """Images (rows, cols) of points on a square grid; row 0 is the southernmost, NaN where a cell is empty.

    Parameters
    ----------
    density
        Number of points of each cell (figure 3).
    maximum, minimum, average
        Height above the road. [m] (figure 4)
    """

    density: FloatArray
    maximum: FloatArray
    minimum: FloatArray
    average: FloatArray


def height_images(xyh: FloatArray, corner: FloatArray, n_cells: int, cell_m: float) -> HeightImages:
    """Return the images of points (n, 3) [m]: east, north, and height above the road, which is 0.

    Parameters
    ----------
    corner
        (2,) south-west corner of the grid. [m]
    n_cells
        Cells of each side.

    Examples
    --------
    >>> points = np.array([[0.1, 0.1, 0.5], [0.15, 0.1, 0.7], [0.3, 0.1, 2.0]])
    >>> height_images(points, np.zeros(2), 2, 0.2).maximum.tolist()
    [[0.7, 2.0], [nan, nan]]
    """
    col, row = np.floor((xyh[:, :2] - corner) / cell_m).astype(np.int64).T
    inside = (col >= 0) & (col < n_cells) & (row >= 0) & (row < n_cells)
    cell, height = (row * n_cells + col)[inside], xyh[inside, 2]
    density = np.bincount(cell, minlength=n_cells**2).astype(np.float64)
    maximum, minimum = np.full(n_cells**2, -np.inf), np.full(n_cells**2, np.inf)
    np.maximum.at(maximum, cell, height)
    np.minimum.at(minimum, cell, height)
    with np.errstate(invalid="ignore"):
        average = np.bincount(cell, height, minlength=n_cells**2) / density
    images = [density, *(np.where(density > 0, v, np.nan) for v in (maximum, minimum, average))]
    return HeightImages(*(image.reshape(n_cells, n_cells) for image in images))


# Binary image creation


def binary_image(maximum: FloatArray, min_height_m: float, max_height_m: float) -> BoolArray:
    """Return (rows, cols) bool: cells whose maximum height is in the band (figure 5).

    The maximum tells houses from rails: a wall has points between 0.2 and 1.2 m too, but its cells reach the roof.

    >>> binary_image(np.array([[0.1, 0.7, 6.0, np.nan]]), 0.2, 1.2).tolist()
    [[False, True, False, False]]
    """
    return np.asarray((maximum >= min_height_m) & (maximum <= max_height_m))


# Line detection by Radon transformation


def radon_image(
    binary: BoolArray, cell_m: float, step_deg: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return R(theta, x'), theta [rad] and x' [m] of an image (equations 1 and 2, figure 6).

    Notes
    -----
    The line integral of f along y', at the angle theta: f is 1 in an occupied cell, so that each adds its area to the
    two bins of x' that its centre lies between. Along rows and columns the centres of cells lie in the middle of bins.

    Examples
    --------
    >>> image = np.zeros((50, 50), dtype=bool)
    >>> image[25] = True  # 10 m from west to east
    >>> values, theta, x = radon_image(image, 0.2, 1.0)
    >>> angle, place = np.unravel_index(np.argmax(values), values.shape)
    >>> float(np.degrees(theta[angle]).round(6)), float(x[place].round(3)), float(values.max().round(3))
    (90.0, 0.1, 10.0)
    """
    theta: FloatArray = np.radians(np.arange(0.0, 180.0 - 0.5 * step_deg, step_deg))
    n_half = math.ceil(0.5 * math.hypot(*binary.shape)) + 1
    row, col = np.nonzero(binary)
    x, y = col + 0.5 - 0.5 * binary.shape[1], row + 0.5 - 0.5 * binary.shape[0]
    # Centres of an even number of cells are halves from the middle
    aside = 0.5 if binary.shape[0] % 2 == 0 else 0.0
    values = np.zeros((len(theta), 2 * n_half + 1))
    for i, angle in enumerate(theta):
        x_turned = x * math.cos(angle) + y * math.sin(angle) + n_half - aside
        first = np.floor(x_turned).astype(np.int64)
        share = x_turned - first
        values[i] += np.bincount(first, 1.0 - share, minlength=values.shape[1])
        values[i] += np.bincount(first + 1, share, minlength=values.shape[1])
    return (
        cell_m * values,
        theta,
        cell_m * np.asarray(np.arange(-n_half, n_half + 1) + aside, dtype=np.float64),
    )


def dilated(radon: FloatArray, n_theta: int, n_x: int) -> FloatArray:
    """Return a Radon image dilated by two line elements in turn, of `n_theta` and of `n_x` bins (figure 7).

    An image at theta + 180 degrees is that at theta, mirrored: so are the elements continued beyond its sides.
    """
    half = min(n_theta // 2, len(radon))
    around = np.concatenate([radon[len(radon) - half :, ::-1], radon, radon[:half, ::-1]])
    along_theta = grey_dilation(around, size=(2 * half + 1, 1))[half : half + len(radon)]
    both: FloatArray = grey_dilation(along_theta, size=(1, 2 * (n_x // 2) + 1), mode="constant", cval=-np.inf)
    return both


@dataclass(frozen=True, slots=True)
class Candidates:
    """Candidate straight lines ``x cos(theta) + y sin(theta) = rho`` about the middle of an image, the strongest first.

    theta_rad, rho_m, strength_m: (n,) angle [rad], distance from the middle [m], and occupied length [m].
    """

    theta_rad: FloatArray
    rho_m: FloatArray
    strength_m: FloatArray


def radon_peaks(radon: FloatArray, theta: FloatArray, x: FloatArray, config: Radon2002Config) -> Candidates:
    """Return the peaks of a Radon image: bins that equal its dilation and exceed the threshold."""
    step_m = float(x[1] - x[0])
    around = dilated(
        radon, round(config.theta_element_deg / config.step_deg), round(config.rho_element_m / step_m)
    )
    i, j = np.nonzero((radon >= around) & (radon > config.threshold_m))
    order = np.argsort(-radon[i, j], kind="stable")
    i, j = i[order], j[order]
    return Candidates(theta[i], x[j], radon[i, j])


# From seed lines to the lines on the image, and to the points


def segments(
    binary: BoolArray, theta: float, rho_m: float, config: Radon2002Config
) -> list[tuple[float, float, float]]:
    """Return the parts of a seed line that are on the image: start and end along it [m], and their occupied share.

    The Radon transform gives the direction only. A place is occupied if its cell is, or one beside it.
    """
    cell, middle = config.cell_m, 0.5 * binary.shape[0]
    along = np.arange(-0.71, 0.71, 0.5 / binary.shape[0]) * binary.shape[0] * cell
    cos, sin = math.cos(theta), math.sin(theta)
    is_there = np.zeros(len(along), dtype=np.bool_)
    for aside in (-cell, 0.0, cell):
        col = np.floor(((rho_m + aside) * cos - along * sin) / cell + middle).astype(np.int64)
        row = np.floor(((rho_m + aside) * sin + along * cos) / cell + middle).astype(np.int64)
        inside = (row >= 0) & (row < binary.shape[0]) & (col >= 0) & (col < binary.shape[1])
        is_there[inside] |= binary[row[inside], col[inside]]
    occupied = np.flatnonzero(is_there)
    if len(occupied) == 0:
        return []
    parts = np.split(occupied, np.flatnonzero(np.diff(along[occupied]) > config.max_gap_m) + 1)
    ends = [(float(along[p[0]]), float(along[p[-1]]), len(p) / float(p[-1] - p[0] + 1)) for p in parts]
    return [part for part in ends if part[1] - part[0] >= config.min_length_m]


def corrected_centres(
    xyh: FloatArray, start: FloatArray, end: FloatArray, config: Radon2002Config
) -> FloatArray:
    """Return the centres of circles along a segment, with the highest point in each, (k, 3) [m].

    Parameters
    ----------
    xyh
        (n, 3) points of the height band. [m]
    start, end
        (2,) of the segment. [m]

    Notes
    -----
    Each circle grows until it holds the feature's points: until it holds some, and the next one across the line no
    more. Its corrected centre is their mean. Circles without points are left out, and those whose centre is less than
    half an interval ahead of the last.
    """
    length = float(np.hypot(*(end - start)))
    way = (end - start) / length
    normal = np.array([-way[1], way[0]])
    near = np.abs((xyh[:, :2] - start) @ normal) <= config.max_radius_m
    band = xyh[near]
    band = band[np.argsort((band[:, :2] - start) @ way, kind="stable")]
    order = (band[:, :2] - start) @ way
    found, last = [], -math.inf
    for station in np.arange(0.0, length + 1e-9, config.circle_spacing_m):
        low, high = np.searchsorted(order, [station - config.max_radius_m, station + config.max_radius_m])
        around = band[low:high]
        apart = np.hypot(*(around[:, :2] - start - station * way).T)
        aside = np.abs((around[:, :2] - start) @ normal)
        for radius in np.arange(config.circle_growth_m, config.max_radius_m + 1e-9, config.circle_growth_m):
            held = around[apart <= radius]
            grows = np.any((aside > radius) & (aside <= radius + config.circle_growth_m))
            if len(held) and not grows:
                break
        if len(held):
            centre = held[:, :2].mean(axis=0)
            ahead = float((centre - start) @ way)
            if ahead >= last + 0.5 * config.circle_spacing_m:
                last = ahead
                found.append([*centre, held[:, 2].max()])
    return np.array(found).reshape(-1, 3)


def fitted_locally(centres: FloatArray, start: FloatArray, end: FloatArray, fit_m: float) -> FloatArray:
    """Return corrected centres (k, 3) [m] on straight lines fitted to those within half of `fit_m` of each."""
    way = (end - start) / np.hypot(*(end - start))
    normal = np.array([-way[1], way[0]])
    along, aside = (centres[:, :2] - start) @ way, (centres[:, :2] - start) @ normal
    lines = np.empty((len(centres), 3))
    for i, station in enumerate(along):
        near = np.abs(along - station) <= 0.5 * fit_m
        is_line = np.count_nonzero(near) > 2 and np.ptp(along[near]) > 0.0
        values = np.column_stack([aside[near], centres[near, 2]])
        offset, top = np.polyfit(along[near] - station, values, 1)[1] if is_line else values.mean(axis=0)
        lines[i] = [*(start + station * way + offset * normal), top]
    return lines


def image_corners(
    xy: FloatArray, core: Bounds, image_m: float, *, is_whole: bool = False
) -> list[FloatArray]:
    """Return the south-west corners (2,) [m, world] of the images of a core, in rows from the south.

    The images lie on one lattice, whatever the tiles; each belongs to the core that holds its southernmost point.

    Parameters
    ----------
    xy
        (n, 2) points of the core, and of a margin as wide as an image. [m, world]
    is_whole
        The core is the whole survey: all images are its own.
    """
    number = np.floor(xy / image_m).astype(np.int64)
    order = np.lexsort((xy[:, 0], xy[:, 1], number[:, 0], number[:, 1]))
    first = np.flatnonzero(np.append(True, np.any(np.diff(number[order], axis=0) != 0, axis=1)))[: len(xy)]
    southernmost = order[first]
    own = np.ones(len(first), dtype=np.bool_) if is_whole else holds(core, xy[southernmost])
    return [image_m * corner for corner in number[southernmost[own]].astype(np.float64)]


def ends_of(
    theta: float, rho_m: float, low_m: float, high_m: float, middle_m: float
) -> tuple[FloatArray, FloatArray]:
    """Return the ends (2,) [m] of a part of a line, from the corner of an image whose middle is at `middle_m`."""
    normal, way = np.array([math.cos(theta), math.sin(theta)]), np.array([-math.sin(theta), math.cos(theta)])
    foot = middle_m + rho_m * normal
    return foot + low_m * way, foot + high_m * way
