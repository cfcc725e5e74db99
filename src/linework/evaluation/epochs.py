"""Changes between two surveys of one road: new, gone, moved and changed lines, and what was hidden.

The two surveys are registered first, from their own lines: navigation errs by centimetres that change slowly along the
road, and what all lines do is not a change of the road.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray, distance_along
from linework.crs import describe_crs, same_crs
from linework.errors import CrsError
from linework.lines.along import line_stretch, runs_of
from linework.lines.crosscuts import Axis, axis_along, cross_cuts
from linework.model.lines import LineSet

#: Lines of one kind nearer than this are the same line; a kerb that moves further is another one. [m]
SAME_M = 1.5
#: Length of a stretch over which differences are averaged and judged. [m]
_PIECE_M = 10.0
#: A change reaches as far as differences exceed two-sided 5 % of a normal distribution ...
_TWO_SIDED = 1.96
#: ... and is one where they somewhere exceed what chance gives this often in a kilometre of road.
_FALSE_PER_KM = 0.5
#: Length of road with one registration: navigation errors change over some 10 s of driving. [m]
_CELL_M = 100.0
#: What the two surveys may be apart: shift, and turn of a cell. [m, rad]
_PRIOR_SHIFT_M, _PRIOR_TURN = 0.3, 0.002
#: A line that turns more than 25 degrees from another is not the same.
_ALONG_COSINE = 0.9
#: A measured line of any kind this near says that the place was visible. [m]
_VISIBLE_M = 10.0
#: Kinds that are parts of others, and change with them.
_PARTS = ("lane_marking_dash",)
#: Least deviation of a position, where lines state none: the repeatability of good mobile mapping. [m]
_LEAST_SIGMA_M = 0.01


@dataclass(frozen=True, slots=True)
class EpochChange:
    """A change, or a stretch that was hidden.

    Parameters
    ----------
    status
        "new", "gone", "moved", "changed" or "not visible".
    line
        The stretch: of the new survey's line for "new", else of the old one's.
    length_m
        Its length. [m]
    across_m, up_m
        Mean difference new minus old after registration, positive to the left and up; NaN where there is none. [m]
    sigma_across_m, sigma_up_m
        Standard deviations of the differences, with that of the registration. [m]
    what
        What is different of a "changed" line.
    """

    status: str
    line: LineSet
    length_m: float
    across_m: float
    up_m: float
    sigma_across_m: float
    sigma_up_m: float
    what: str


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


@dataclass(frozen=True, slots=True)
class _Stations:
    """Stations of all lines of one survey, with the same line in the other."""

    line: IntArray
    along_m: FloatArray
    xyz: FloatArray
    left: FloatArray
    bridged: BoolArray
    partner: IntArray
    across_m: FloatArray
    up_m: FloatArray
    sigma_m: FloatArray
    partner_bridged: BoolArray
    visible: BoolArray


def compare_epochs(old: LineSet, new: LineSet) -> tuple[list[EpochChange], Registration]:
    """Return the changes from an old to a new survey of the same road, and their registration.

    Raises
    ------
    CrsError
        The two are in different CRSs.

    Notes
    -----
    Lines of one kind are compared at every metre across; differences are averaged over 10 m. Their deviation is
    sqrt(s_old^2 + s_new^2 + s_registration^2). A line has moved over stretches beyond 1.96 deviations, if at least one
    of them is beyond what chance gives once in 2 km with as many comparisons: 3 to 3.5 deviations.
    """
    if not same_crs(old.crs, new.crs):
        raise CrsError(f"two different CRSs: {describe_crs(old.crs)} and {describe_crs(new.crs)}",
                       where="the new lines", advice="convert one of them")  # fmt: skip
    old, new = (s.take(~np.isin(s.kind, _PARTS) & (s.length_m > 0)) for s in (old, new))
    there, back = _stations(old, new), _stations(new, old)
    registration = _registered(there)
    least = _least_deviations(there, registration)
    changes = [
        change for i in range(len(old)) for change in _of_line(old, new, there, i, registration, least)
    ]
    for i in range(len(new)):
        alone = (back.line == i) & (back.partner < 0) & ~back.bridged
        changes += _stretches(new, back, i, alone, "new")
    return changes, registration


def _stations(lines: LineSet, others: LineSet) -> _Stations:
    columns: list[tuple[AnyArray, ...]] = []
    for i in range(len(lines)):
        axis = axis_along("", lines[i].xyz)
        along = axis.station_m
        n = len(along)
        first, last = int(lines.offsets[i]), int(lines.offsets[i + 1])
        vertex_m = distance_along(lines[i].xyz)
        nearest = np.clip(np.searchsorted(vertex_m, along), 0, last - first - 1)
        sigma = np.column_stack(
            [np.interp(along, vertex_m, s[first:last]) for s in (lines.sigma_xy_m, lines.sigma_z_m)]
        )
        found = _partners(axis, str(lines.kind[i]), others)
        columns.append(
            (np.full(n, i), along, axis.xyz, axis.left, lines.bridged[first:last][nearest], *found, sigma)
        )
    if not columns:
        empty = np.zeros(0)
        return _Stations(
            empty.astype(np.int64), empty, np.zeros((0, 3)), np.zeros((0, 2)), empty.astype(bool), empty.astype(np.int64),
            empty, empty, np.zeros((0, 2)), empty.astype(bool), empty.astype(bool),
        )  # fmt: skip
    line, along, xyz, left, bridged, partner, across, up, other, hidden, visible, own = (
        np.concatenate(column) for column in zip(*columns, strict=True)
    )
    sigma_m = np.hypot(np.nan_to_num(own, nan=0.0), np.nan_to_num(other, nan=0.0)).clip(min=_LEAST_SIGMA_M)
    return _Stations(line, along, xyz, left, bridged, partner, across, up, sigma_m, hidden, visible)


def _partners(axis: Axis, kind: str, others: LineSet) -> tuple[AnyArray, ...]:
    """Return the nearest line of the same kind at each station, its differences, and whether the place was visible."""
    n = len(axis.station_m)
    partner, across, up = np.full(n, -1), np.full(n, np.nan), np.full(n, np.nan)
    sigma, hidden, visible = np.zeros((n, 2)), np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    cuts = cross_cuts(others, axis, reach_m=_VISIBLE_M)
    if len(cuts):
        visible[cuts.station[~cuts.bridged]] = True
        # Wires hang above each other: they are told apart in space
        above = cuts.up_m - axis.xyz[cuts.station, 2] if kind == "cable" else np.zeros(len(cuts))
        away = np.hypot(cuts.offset_m, above)
        is_same = (others.kind[cuts.line] == kind) & (np.abs(cuts.cosine) >= _ALONG_COSINE)
        same = np.flatnonzero(is_same & (away <= SAME_M))
        # From the farthest to the nearest: the last one written stays
        for row in same[np.argsort(-away[same], kind="stable")].tolist():
            k = int(cuts.station[row])
            partner[k], across[k] = cuts.line[row], cuts.offset_m[row]
            up[k] = cuts.up_m[row] - axis.xyz[k, 2]
            sigma[k] = cuts.sigma_xy_m[row], cuts.sigma_z_m[row]
            hidden[k] = cuts.bridged[row]
    return partner, across, up, sigma, hidden, visible


def _registered(stations: _Stations) -> Registration:
    """Return the shifts of cells from the lines that both surveys have, by least absolute deviations over lines."""
    good = np.flatnonzero((stations.partner >= 0) & ~stations.bridged & ~stations.partner_bridged)
    cell = np.floor(stations.xyz[good, :2] / _CELL_M).astype(np.int64)
    cells, index = (
        np.unique(cell, axis=0, return_inverse=True)
        if len(good)
        else (np.zeros((0, 2), dtype=np.int64), good)
    )
    rows = [_cell(stations, good[index.ravel() == k], (cells[k] + 0.5) * _CELL_M) for k in range(len(cells))]
    return Registration(
        cells, np.array([r[0] for r in rows]).reshape(-1, 3), np.array([r[1] for r in rows]),
        np.array([r[2] for r in rows]).reshape(-1, 2), np.array([r[3] for r in rows], dtype=np.int64),
    )  # fmt: skip


def _cell(
    stations: _Stations, rows: IntArray, middle: FloatArray
) -> tuple[FloatArray, float, FloatArray, int]:
    left, place = stations.left[rows], stations.xyz[rows, :2] - middle
    lever = left[:, 1] * place[:, 0] - left[:, 0] * place[:, 1]
    A = np.column_stack([left, lever])
    # A line counts as one, whatever its length: its errors are one
    number, inverse = np.unique(stations.line[rows], return_inverse=True)
    weight = 1.0 / np.bincount(inverse)[inverse]
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
    covariance = np.linalg.inv(A.T @ ((weight / sigma**2)[:, None] * A) + prior)
    across = float(np.sqrt(np.mean(np.einsum("ij,jk,ik->i", A, covariance, A))))
    means = [float(np.median(up[inverse == k])) for k in range(len(number))]
    rise = float(np.median(means))
    sigma_up = float(np.sqrt(np.mean(stations.sigma_m[rows, 1] ** 2))) * math.sqrt(math.pi / 2 / len(number))
    return np.array([found[0], found[1], rise]), float(found[2]), np.array([across, sigma_up]), len(number)


def _differences(
    stations: _Stations, rows: IntArray, registration: Registration
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return differences across and up after registration, and the registration's deviations, of stations."""
    lookup = {tuple(c): k for k, c in enumerate(registration.cells.tolist())}
    cell = np.floor(stations.xyz[rows, :2] / _CELL_M).astype(np.int64).tolist()
    k = np.array([lookup.get(tuple(c), -1) for c in cell], dtype=np.int64)
    shift, turn = registration.shift_m[k], registration.turn[k]
    place = stations.xyz[rows, :2] - (registration.cells[k] + 0.5) * _CELL_M
    left = stations.left[rows]
    moved = np.einsum("ij,ij->i", left, shift[:, :2]) + turn * (
        left[:, 1] * place[:, 0] - left[:, 0] * place[:, 1]
    )
    return stations.across_m[rows] - moved, stations.up_m[rows] - shift[:, 2], registration.sigma_m[k]


def _least_deviations(stations: _Stations, registration: Registration) -> float:
    """Return the number of deviations that chance exceeds `_FALSE_PER_KM` times in a kilometre of road."""
    n_tests = 2 * max(np.count_nonzero(stations.partner >= 0) / _PIECE_M, 1.0)
    allowed = _FALSE_PER_KM * max(len(registration.cells), 1) * _CELL_M / 1000.0
    return NormalDist().inv_cdf(1.0 - min(allowed / n_tests, 0.05) / 2)


def _of_line(
    old: LineSet, new: LineSet, stations: _Stations, i: int, registration: Registration, least: float
) -> list[EpochChange]:
    """Return the changes of a line of the old survey."""
    own = stations.line == i
    lost = own & (stations.partner < 0) & ~stations.bridged
    hidden = own & (
        (stations.partner >= 0) & stations.partner_bridged & ~stations.bridged | lost & ~stations.visible
    )
    changes = _stretches(old, stations, i, lost & stations.visible, "gone")
    changes += _stretches(old, stations, i, hidden, "not visible")
    both = np.flatnonzero(own & (stations.partner >= 0) & ~stations.bridged & ~stations.partner_bridged)
    if not len(both):
        return changes
    across, up, s_reg = _differences(stations, both, registration)
    piece = np.floor(stations.along_m[both] / _PIECE_M).astype(np.int64)
    numbers, inverse = np.unique(piece, return_inverse=True)
    mean = np.stack([np.bincount(inverse, weights=v) / np.bincount(inverse) for v in (across, up)], axis=1)
    variance = stations.sigma_m[both] ** 2 + s_reg**2
    sigma = np.sqrt(
        np.stack([np.bincount(inverse, weights=v) / np.bincount(inverse) for v in variance.T], axis=1)
    )
    beyond = np.abs(mean) > _TWO_SIDED * sigma
    is_moved = np.zeros(len(numbers), dtype=bool)
    for axis in (0, 1):
        for sign in (1, -1):
            for a, b in runs_of(beyond[:, axis] & (np.sign(mean[:, axis]) == sign)):
                if np.abs(mean[a : b + 1, axis] / sigma[a : b + 1, axis]).max() > least:
                    is_moved[a : b + 1] = True
    mask = np.zeros(len(stations.line), dtype=bool)
    mask[both[is_moved[inverse]]] = True
    changes += _stretches(old, stations, i, mask, "moved", registration)
    return changes + _changed(old, new, stations, i, both)


def _changed(old: LineSet, new: LineSet, stations: _Stations, i: int, both: IntArray) -> list[EpochChange]:
    """Return where the pattern or the form of a line is another one."""
    found = []
    for name in ("pattern", "form"):
        before, after = str(getattr(old, name)[i]), getattr(new, name)[stations.partner[both]]
        other = (after != before) & (after != "") if before else np.zeros(len(both), dtype=bool)
        for value in sorted(set(after[other].tolist())):
            mask = np.zeros(len(stations.line), dtype=bool)
            mask[both[other & (after == value)]] = True
            found += _stretches(old, stations, i, mask, "changed", what=f"{name} {before} to {value}")
    return found


def _stretches(
    lines: LineSet, stations: _Stations, i: int, mask: BoolArray, status: str, registration: Registration | None = None,
    what: str = "",
) -> list[EpochChange]:  # fmt: skip
    """Return the stretches of a line whose stations are in the mask, those of 2 m and more."""
    own = np.flatnonzero(stations.line == i)
    found = []
    for a, b in runs_of(mask[own]):
        rows = own[a : b + 1]
        start, end = float(stations.along_m[rows[0]]), float(stations.along_m[rows[-1]])
        if end - start < 2.0:
            continue
        numbers = (math.nan, math.nan, math.nan, math.nan)
        if registration is not None:
            across, up, s_reg = _differences(stations, rows, registration)
            sigma = np.sqrt(np.mean(stations.sigma_m[rows] ** 2 + s_reg**2, axis=0))
            numbers = (float(across.mean()), float(up.mean()), float(sigma[0]), float(sigma[1]))
        piece = line_stretch(lines.take([i]), start, end)
        found.append(EpochChange(status, piece, end - start, *numbers, what))
    return found
