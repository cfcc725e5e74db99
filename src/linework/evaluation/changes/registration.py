"""Registration of two surveys of one road by their own lines.

Separate from `epochs`: what all lines do is navigation, not a change.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from linework.arrays import FloatArray, IntArray
from linework.evaluation.changes.epoch_stations import EpochStations
from linework.lines.crosscuts import STATION_M

#: Size of a cell with one registration, and the distance from its middle of the lines that it is from: navigation errors
#: change over some 10 s of driving, by a tenth of that within a cell. [m]
_CELL_M, _WINDOW_M = 25.0, 60.0
#: What the two surveys may be apart: shift, and turn of a cell. [m, rad]
_PRIOR_SHIFT_M, _PRIOR_TURN = 0.3, 0.002


@dataclass(frozen=True, slots=True)
class Registration:
    """Shift of the new survey against the old one, by cells along the road.

    Parameters
    ----------
    cells
        (k, 2) int64: numbers of the cells in plan.
    shift_m
        (k, 3) float64: east, north, up, new minus old. [m]
    turn
        (k,) float64: about the middle of the cell. [rad]
    sigma_m
        (k, 2) float64: standard deviations in plan and in height. [m]
    n_lines
        (k,) int64: lines from which each comes.
    """

    cells: IntArray
    shift_m: FloatArray
    turn: FloatArray
    sigma_m: FloatArray
    n_lines: IntArray


def registered(stations: EpochStations) -> Registration:
    """Return the shifts of cells from the lines that both surveys have, by least absolute deviations over lines."""
    good = np.flatnonzero((stations.partner >= 0) & ~stations.bridged & ~stations.partner_bridged)
    place = stations.xyz[good, :2]
    cells = np.unique(np.floor(place / _CELL_M).astype(np.int64), axis=0)
    rows = []
    feature = _features(stations, good)
    if len(good):
        origin = place[0]
        middles = (cells + 0.5) * _CELL_M
        near = cKDTree(place - origin).query_ball_point(middles - origin, _WINDOW_M, return_sorted=True)
        rows = [
            _cell(stations, good[own], feature[own], middle)
            for own, middle in zip(near, middles, strict=True)
        ]
    return Registration(
        cells.reshape(-1, 2), np.array([r[0] for r in rows]).reshape(-1, 3), np.array([r[1] for r in rows]),
        np.array([r[2] for r in rows]).reshape(-1, 2), np.array([r[3] for r in rows], dtype=np.int64),
    )  # fmt: skip


def _features(stations: EpochStations, rows: IntArray) -> IntArray:
    """Return the number of the line of the road at stations: pieces of it that are one line in either survey are one.

    Markings that come together where lanes end have a line of the other survey in common for some metres, and stay lines of
    their own: it is one line where at least half of the shorter of both has the other.
    """
    line, partner = stations.line[rows], stations.partner[rows]
    n = int(line.max(initial=-1)) + 1
    both = np.stack([line, n + partner], axis=1)
    size = int(both.max(initial=-1)) + 1
    count = np.bincount(both.ravel(), minlength=size)
    links, shared = np.unique(both, axis=0, return_counts=True)
    links = links[2 * shared >= count[links].min(axis=1)]
    pairs = coo_array((np.ones(len(links), dtype=bool), (links[:, 0], links[:, 1])), shape=(size, size))
    return np.asarray(connected_components(pairs, directed=False)[1][line], dtype=np.int64)


def _cell(
    stations: EpochStations, rows: IntArray, feature: IntArray, middle: FloatArray
) -> tuple[FloatArray, float, FloatArray, int]:
    left, place = stations.left[rows], stations.xyz[rows, :2] - middle
    lever = left[:, 1] * place[:, 0] - left[:, 0] * place[:, 1]
    A = np.column_stack([left, lever])
    # A line counts as one, whatever its length: its errors are one. A piece shorter than a cell, which may well be
    # another edge, counts by its length
    number, inverse = np.unique(feature, return_inverse=True)
    count = np.bincount(inverse)
    share = np.minimum(STATION_M * count / _CELL_M, 1.0)
    weight = (share / count)[inverse]
    prior = np.diag(1.0 / np.array([_PRIOR_SHIFT_M, _PRIOR_SHIFT_M, _PRIOR_TURN]) ** 2)
    sigma = float(np.sqrt(np.mean(stations.sigma_m[rows, 0] ** 2)))
    d, up = stations.across_m[rows], stations.up_m[rows]
    found: FloatArray = np.zeros(3)
    factor: FloatArray = np.ones(len(rows))
    for _ in range(30):
        w = weight * factor / sigma**2
        found = np.asarray(np.linalg.solve(A.T @ (w[:, None] * A) + prior, A.T @ (w * d)), dtype=np.float64)
        # Least absolute deviations: a kerb that was moved does not pull
        factor = np.asarray(sigma / np.maximum(np.abs(d - A @ found), 0.2 * sigma), dtype=np.float64)
    # Lines that disagree more than they state know the shift as much less; few that were moved among many say nothing of it
    scale = _disagreement(np.bincount(inverse, weights=d - A @ found) / count, share, sigma)
    covariance = np.linalg.inv(A.T @ ((weight / (scale * sigma) ** 2)[:, None] * A) + prior)
    across = float(np.sqrt(np.mean(np.einsum("ij,jk,ik->i", A, covariance, A))))
    means = np.array([float(np.median(up[inverse == k])) for k in range(len(number))])
    rise = _weighted_median(means, share)
    sigma_z = float(np.sqrt(np.mean(stations.sigma_m[rows, 1] ** 2)))
    scale_z = _disagreement(means - rise, share, sigma_z)
    sigma_up = scale_z * sigma_z * math.sqrt(math.pi / 2 / float(share.sum()))
    return np.array([found[0], found[1], rise]), float(found[2]), np.array([across, sigma_up]), len(number)


def _disagreement(residual: FloatArray, share: FloatArray, sigma: float) -> float:
    """Return how many times their deviation lines (n,) are off, 1 at least: few that have moved among many count little."""
    return max(1.4826 * _weighted_median(np.abs(residual), share) / sigma, 1.0)


def _weighted_median(values: FloatArray, weight: FloatArray) -> float:
    """Return the median of values (n,) that count by weights, between two where it lies between them."""
    order = np.argsort(values, kind="stable")
    middle = (np.cumsum(weight[order]) - 0.5 * weight[order]) / weight.sum()
    return float(np.interp(0.5, middle, values[order]))


def differences_of(
    stations: EpochStations, rows: IntArray, registration: Registration
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return differences across and up after registration, and the registration's deviations, of stations."""
    left, place = stations.left[rows], stations.xyz[rows, :2]
    found = np.zeros((len(rows), 4))
    weight = np.zeros(len(rows))
    # From cell to cell the shift goes over evenly: a jump would look like a line that has moved
    corner = np.floor(place / _CELL_M - 0.5).astype(np.int64)
    lookup = {tuple(c): k for k, c in enumerate(registration.cells.tolist())}
    for step in ((0, 0), (0, 1), (1, 0), (1, 1)):
        cell = corner + step
        k = np.array([lookup.get(tuple(c), -1) for c in cell.tolist()], dtype=np.int64)
        off = place - (cell + 0.5) * _CELL_M
        share = np.where(k >= 0, np.prod(1.0 - np.abs(off) / _CELL_M, axis=1), 0.0)
        lever = left[:, 1] * off[:, 0] - left[:, 0] * off[:, 1]
        moved = np.einsum("ij,ij->i", left, registration.shift_m[k, :2]) + registration.turn[k] * lever
        found += share[:, None] * np.column_stack(
            [moved, registration.shift_m[k, 2], registration.sigma_m[k]]
        )
        weight += share
    across, up, *sigma = (found / weight[:, None]).T
    return stations.across_m[rows] - across, stations.up_m[rows] - up, np.stack(sigma, axis=1)


def placed(xy: FloatArray, registration: Registration) -> FloatArray:
    """Return where places (n, 2 or 3) of the old survey are in the new one, by the nearest cell."""
    if not len(registration.cells) or not len(xy):
        return xy
    if xy.shape[1] == 3:
        cell = cKDTree((registration.cells + 0.5) * _CELL_M - xy[0, :2]).query(xy[:, :2] - xy[0, :2])[1]
        return np.column_stack([placed(xy[:, :2], registration), xy[:, 2] + registration.shift_m[cell, 2]])
    middle = (registration.cells + 0.5) * _CELL_M
    cell = cKDTree(middle - xy[0]).query(xy - xy[0])[1]
    off = xy - middle[cell]
    turned = registration.turn[cell][:, None] * np.column_stack([-off[:, 1], off[:, 0]])
    return np.asarray(xy + registration.shift_m[cell, :2] + turned)
