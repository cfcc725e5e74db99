"""Registration of two surveys of one road by their own lines.

Separate from `epochs`: what all lines do is navigation, not a change.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.sparse import block_diag, coo_array, kron
from scipy.sparse.csgraph import connected_components, laplacian
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from linework.arrays import FloatArray, IntArray
from linework.evaluation.changes.epoch_stations import EpochStations
from linework.lines.crosscuts import STATION_M

#: Size of a cell with one registration, and the distance from its middle of the lines that it is from: navigation errors
#: change over some 10 s of driving, by a tenth of that within a cell. [m]
_CELL_M, _WINDOW_M = 25.0, 60.0
#: What the two surveys may be apart: shift, and turn of a cell. [m, rad]
_PRIOR_SHIFT_M, _PRIOR_TURN = 0.3, 0.002
_PRIOR = np.diag(1.0 / np.array([_PRIOR_SHIFT_M, _PRIOR_SHIFT_M, _PRIOR_TURN]) ** 2)
#: By how much shifts of neighbouring cells differ: a tenth of what the surveys may be apart. [m]
_DRIFT_M = 0.03
#: Rounds until shifts stay as they are, and more until lines that disagree are left alone.
_ROUNDS, _LAST_ROUNDS = 30, 10
#: What lines usually differ by shows where they agree: half of a road may have changed. [share of cells]
_WHERE_LINES_AGREE = 0.25
#: Cells that touch, at corners, too. And lines that run within 25 degrees of each other. [cells, cosine]
_BESIDE_CELLS, _SAME_WAY = 1.5, 0.9
#: What a cell farther away knows, the drift has made as uncertain as half of what the surveys may be apart. [cells]
_KNOWN_CELLS = round((0.5 * _PRIOR_SHIFT_M / _DRIFT_M) ** 2)


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
    """Return the shifts of cells from the lines that both surveys have, by least absolute deviations over lines.

    They go over evenly from cell to cell, as errors of navigation do and changes of the road do not.
    """
    good = np.flatnonzero((stations.partner >= 0) & ~stations.bridged & ~stations.partner_bridged)
    place = stations.xyz[good, :2]
    cells = np.unique(np.floor(place / _CELL_M).astype(np.int64), axis=0)
    feature = _features(stations, good)
    listed, found, rest = list[_Cell](), np.zeros((0, 3)), list[tuple[float, FloatArray]]()
    if len(good):
        origin = place[0]
        middles = (cells + 0.5) * _CELL_M
        near = cKDTree(place - origin).query_ball_point(middles - origin, _WINDOW_M, return_sorted=True)
        listed = [
            _cell(stations, good[own], feature[own], middle)
            for own, middle in zip(near, middles, strict=True)
        ]
        found = _shifts_and_turns(listed, cells)
        rest = [_deviations(one, own) for one, own in zip(listed, found, strict=True)]
    rise = np.array([own for own, _ in rest])
    sigma_m = np.array([own for _, own in rest]).reshape(-1, 2)
    if len(cells):
        sigma_m[:, 0] = _known_from_beside(sigma_m[:, 0], cells, np.array([one.across for one in listed]))
    return Registration(
        cells.reshape(-1, 2), np.column_stack([found[:, :2], rise]), found[:, 2],
        sigma_m, np.array([len(one.share) for one in listed], dtype=np.int64),
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


@dataclass(frozen=True, slots=True)
class _Cell:
    """What both surveys have near one cell.

    Parameters
    ----------
    design
        (n, 3) what shift and turn do across at stations.
    across_m, up_m
        (n,) differences. [m]
    line, share
        (n,) number of the line, from 0 on, and for each how much it counts, 1 at most.
    sigma_m
        Deviations of a difference, in plan and in height. [m]
    """

    design: FloatArray
    across_m: FloatArray
    up_m: FloatArray
    line: IntArray
    share: FloatArray
    sigma_m: tuple[float, float]

    @property
    def weight(self) -> FloatArray:
        """Return how much each station counts."""
        return np.asarray((self.share / np.bincount(self.line))[self.line])

    @property
    def across(self) -> FloatArray:
        """Return the unit vector across most of its lines."""
        left = self.design[:, :2]
        return np.asarray(np.linalg.eigh(left.T @ (self.weight[:, None] * left))[1][:, -1])

    def off(self, found: FloatArray) -> FloatArray:
        """Return what lines are off by after registration, in stated deviations."""
        across = self.across_m - self.design @ found
        return np.asarray(np.bincount(self.line, weights=across) / np.bincount(self.line) / self.sigma_m[0])

    def normal_of(
        self, found: FloatArray, weigh: Callable[[FloatArray], FloatArray]
    ) -> tuple[FloatArray, FloatArray]:
        """Return the normal equations (3, 3), (3,) with stations weighed by what they are off by, in stated deviations."""
        sigma = self.sigma_m[0]
        w = self.weight / sigma**2 * weigh(np.abs(self.across_m - self.design @ found) / sigma)
        weighted = w[:, None] * self.design
        return self.design.T @ weighted, weighted.T @ self.across_m


def _cell(stations: EpochStations, rows: IntArray, feature: IntArray, middle: FloatArray) -> _Cell:
    left, place = stations.left[rows], stations.xyz[rows, :2] - middle
    lever = left[:, 1] * place[:, 0] - left[:, 0] * place[:, 1]
    # A line counts as one, whatever its length: its errors are one. A piece shorter than a cell, which may well be
    # another edge, counts by its length
    _, line = np.unique(feature, return_inverse=True)
    share = np.minimum(STATION_M * np.bincount(line) / _CELL_M, 1.0)
    sigma, sigma_z = (float(np.sqrt(np.mean(stations.sigma_m[rows, axis] ** 2))) for axis in (0, 1))
    return _Cell(
        np.column_stack([left, lever]), stations.across_m[rows], stations.up_m[rows], line, share, (sigma, sigma_z)
    )  # fmt: skip


def _shifts_and_turns(listed: list[_Cell], cells: IntArray) -> FloatArray:
    """Return shift and turn (k, 3) of all cells: least absolute deviations, and evenly from cell to cell.

    A kerb that was moved does not pull. Of two lines either may be the one that has moved, and any shift between both is as
    good: cells whose lines disagree leave it to those beside, and in the last rounds go on to the nearer line, as what is
    farther off than usual counts less and less (Cauchy's weights).
    """
    k = len(listed)
    links = _links_beside(cells) / _DRIFT_M**2
    even = kron(laplacian((links + links.T).tocsr()), np.diag([1.0, 1.0, 0.0]))
    found = np.zeros((k, 3))
    for n_done in range(_ROUNDS + _LAST_ROUNDS):
        apart = np.array(
            [_disagreement(one.off(own), one.share) for one, own in zip(listed, found, strict=True)]
        )
        usual, is_last = 2.0 * float(np.quantile(apart, _WHERE_LINES_AGREE)), n_done >= _ROUNDS
        weigh = partial(_cauchy, usual=usual) if is_last else _absolute
        left, right = zip(
            *(one.normal_of(own, weigh) for one, own in zip(listed, found, strict=True)), strict=True
        )
        known = np.ones(k) if is_last else apart**-2.0
        normal = block_diag(list(np.array(left) * known[:, None, None] + _PRIOR)) + even
        found = spsolve(normal.tocsc(), (np.array(right) * known[:, None]).ravel()).reshape(-1, 3)
    return found


def _links_beside(cells: IntArray) -> coo_array:
    """Return a matrix (k, k) with 1 for each pair of cells that touch, once."""
    beside = cKDTree(cells).query_pairs(_BESIDE_CELLS, output_type="ndarray")
    return coo_array((np.ones(len(beside)), (beside[:, 0], beside[:, 1])), shape=(len(cells), len(cells)))


def _absolute(off: FloatArray) -> FloatArray:
    """Return the weights by which least squares become least absolute deviations."""
    return np.asarray(1.0 / np.maximum(off, 0.2))


def _cauchy(off: FloatArray, usual: float) -> FloatArray:
    """Return weights that fall with the square beyond what is usual."""
    return np.asarray(1.0 / (1.0 + (off / usual) ** 2))


def _known_from_beside(sigma_m: FloatArray, cells: IntArray, across: FloatArray) -> FloatArray:
    """Return deviations of shifts in plan, (k,) [m]: what a cell nearby knows better is known here but for the drift between.

    Of cells that hang together, and whose lines run the same way: along its lines no cell knows a shift.

    Parameters
    ----------
    sigma_m, cells, across
        (k,) own deviations [m], (k, 2) cells, (k, 2) unit vectors across the lines of each.

    >>> three = np.array([[0, 0], [1, 0], [2, 0]])
    >>> north = np.tile([0.0, 1.0], (3, 1))
    >>> _known_from_beside(np.array([0.01, 0.2, 0.2]), three, north).round(3).tolist()
    [0.01, 0.032, 0.044]
    """
    tree = cKDTree(cells)
    part = connected_components(_links_beside(cells), directed=False)[1]
    known = sigma_m.copy()
    for i in range(len(cells)):
        own = np.array(tree.query_ball_point(cells[i], _KNOWN_CELLS))
        own = own[(part[own] == part[i]) & (np.abs(across[own] @ across[i]) >= _SAME_WAY)]
        apart = np.linalg.norm(cells[own] - cells[i], axis=1)
        known[i] = min(known[i], float(np.hypot(sigma_m[own], _DRIFT_M * np.sqrt(apart)).min()))
    return known


def _deviations(cell: _Cell, found: FloatArray) -> tuple[float, FloatArray]:
    """Return the rise of the new survey near a cell [m], and the deviations in plan and in height (2,) of its shift [m]."""
    A, share, (sigma, sigma_z) = cell.design, cell.share, cell.sigma_m
    # Lines that disagree more than they state know the shift as much less; few that were moved among many say nothing of it
    scale = _disagreement(cell.off(found), share)
    covariance = np.linalg.inv(A.T @ ((cell.weight / (scale * sigma) ** 2)[:, None] * A) + _PRIOR)
    across = float(np.sqrt(np.mean(np.einsum("ij,jk,ik->i", A, covariance, A))))
    means = np.array([float(np.median(cell.up_m[cell.line == k])) for k in range(len(share))])
    rise = _weighted_median(means, share)
    scale_z = _disagreement((means - rise) / sigma_z, share)
    return rise, np.array([across, scale_z * sigma_z * math.sqrt(math.pi / 2 / float(share.sum()))])


def _disagreement(off: FloatArray, share: FloatArray) -> float:
    """Return how many times their deviation lines (n,) are off, 1 at least: few that have moved among many count little."""
    return max(1.4826 * _weighted_median(np.abs(off), share), 1.0)


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
