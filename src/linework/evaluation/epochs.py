"""Changes between two surveys of one road: new, gone, moved and changed lines, and what was hidden.

The two surveys are registered first, from their own lines: navigation errs by centimetres that change slowly along the
road, and what all lines do is not a change of the road.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray, distance_along
from linework.crs import describe_crs, same_crs
from linework.errors import CrsError
from linework.evaluation.chainage.paint_changes import paint_changes
from linework.evaluation.chainage.paint_points import PaintPieces
from linework.evaluation.dash_changes import dash_runs
from linework.evaluation.shifts import (
    FALSE_PER_KM,
    chance_of,
    filters_of,
    least_deviations,
    related_of,
    scale_of,
    shifted_runs,
)
from linework.lines.along import line_stretch, runs_of
from linework.lines.crosscuts import Axis, axis_along, cross_cuts
from linework.model.lines import CANDIDATE, POLE, STACKED_FORM, LineSet

#: Lines of one kind nearer than this are the same line; a kerb that moves further is another one. [m]
SAME_M = 1.5
#: Length of a piece over which differences are averaged before they are judged. [m]
_PIECE_M = 5.0
#: Size of a cell with one registration, and the distance from its middle of the lines that it is from: navigation errors
#: change over some 10 s of driving, by a tenth of that within a cell. [m]
_CELL_M, _WINDOW_M = 25.0, 60.0
#: What the two surveys may be apart: shift, and turn of a cell. [m, rad]
_PRIOR_SHIFT_M, _PRIOR_TURN = 0.3, 0.002
#: A line that turns more than 25 degrees from another is not the same.
_ALONG_COSINE = 0.9
#: A measured line of any kind this near says that the place was visible. [m]
_VISIBLE_M = 10.0
#: Kinds that are not compared: dashes change with their markings; candidates were not taken; edges beside boundaries are
#: kept only where a boundary lies beside them, and come and go with it; poles have no length along the road.
_NOT_COMPARED = ("lane_marking_dash", CANDIDATE, "edge_other", POLE)
#: A height has changed beyond this many deviations: by chance one line in 370.
_HEIGHT_DEVIATIONS = 3.0
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
    from_m, to_m
        Distance of its ends from the start of that line. [m]
    across_m, up_m
        Mean difference new minus old after registration, positive to the left and up; NaN where there is none. [m]
    sigma_across_m, sigma_up_m
        Standard deviations of the differences, with that of the registration. [m]
    what
        What is different of a "changed" line; of dashes that are new, it is a stretch of the new survey's line.
    """

    status: str
    line: LineSet
    from_m: float
    to_m: float
    across_m: float
    up_m: float
    sigma_across_m: float
    sigma_up_m: float
    what: str

    @property
    def length_m(self) -> float:
        """Return its length [m]."""
        return self.to_m - self.from_m


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


def check_same_crs(old: LineSet, new: LineSet) -> None:
    """Raise a `CrsError` if the lines of two surveys are in different CRSs."""
    if not same_crs(old.crs, new.crs):
        raise CrsError(f"two different CRSs: {describe_crs(old.crs)} and {describe_crs(new.crs)}",
                       where="the new lines", advice="convert one of them")  # fmt: skip


def compare_epochs(
    old: LineSet, new: LineSet, paint: tuple[PaintPieces, PaintPieces] | None = None
) -> tuple[list[EpochChange], Registration]:
    """Return the changes from an old to a new survey of the same road, and their registration.

    Parameters
    ----------
    old, new
        Lines of both surveys.
    paint
        What the points of each show on its markings (`paint_pieces`): wear and renewed paint are changes too.

    Raises
    ------
    CrsError
        The two are in different CRSs.

    Notes
    -----
    Lines of one kind are compared at every metre across, in means over 5 m, after registration. Their deviation is
    sqrt(s_old^2 + s_new^2 + s_registration^2), times what differences of lines of that kind are found to be in the two
    surveys. A line has moved over stretches whose mean chance gives, with as many comparisons and as far as neighbouring
    differences are related, once in 2 km of road.
    """
    check_same_crs(old, new)
    of_paint = [
        _of_paint(lines, line, from_m, to_m, f"{n} dashes {what}")
        for lines, other, what in ((old, new, "gone"), (new, old, "new"))
        for line, from_m, to_m, n in dash_runs(lines, other)
    ]
    whole = old, new
    old, new = (s.take(~np.isin(s.kind, _NOT_COMPARED) & (s.length_m > 0)) for s in (old, new))
    there, back = _stations(old, new), _stations(new, old)
    registration = _registered(there)
    if paint is not None:
        for worn in paint_changes(*whole, *paint, _placed(paint[0].xy, registration)):
            what = f"remaining paint {worn.before:.0f} to {worn.after:.0f} %"
            of_paint.append(_of_paint(whole[0], worn.line, worn.from_m, worn.to_m, what))
    pieces = _moved_pieces(old, there, registration)
    changes = [
        change for i in range(len(old)) for change in _of_line(old, new, there, i, registration, pieces)
    ]
    for i in range(len(new)):
        alone = (back.line == i) & (back.partner < 0) & ~back.bridged
        changes += _stretches(new, back, i, alone & back.visible, "new")
        changes += _stretches(new, back, i, alone & ~back.visible, "not visible", what="in the old survey")
    return changes + of_paint, registration


def _placed(xy: FloatArray, registration: Registration) -> FloatArray:
    """Return where places (n, 2) of the old survey are in the new one, by the nearest cell."""
    if not len(registration.cells) or not len(xy):
        return xy
    middle = (registration.cells + 0.5) * _CELL_M
    cell = cKDTree(middle - xy[0]).query(xy - xy[0])[1]
    off = xy - middle[cell]
    turned = registration.turn[cell][:, None] * np.column_stack([-off[:, 1], off[:, 0]])
    return np.asarray(xy + registration.shift_m[cell, :2] + turned)


def _of_paint(lines: LineSet, line: int, from_m: float, to_m: float, what: str) -> EpochChange:
    piece = line_stretch(lines.take([line]), from_m, to_m)
    return EpochChange("changed", piece, from_m, to_m, math.nan, math.nan, math.nan, math.nan, what)


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
        found = _partners(axis, str(lines.kind[i]), str(lines.form[i]), others)
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


def _partners(axis: Axis, kind: str, form: str, others: LineSet) -> tuple[AnyArray, ...]:
    """Return the nearest line of the same kind at each station, its differences, and whether the place was visible."""
    n = len(axis.station_m)
    partner, across, up = np.full(n, -1), np.full(n, np.nan), np.full(n, np.nan)
    sigma, hidden, visible = np.zeros((n, 2)), np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    cuts = cross_cuts(others, axis, reach_m=_VISIBLE_M)
    if len(cuts):
        visible[cuts.station[~cuts.bridged]] = True
        # Wires hang above each other, as do the pipes of a rail: they are told apart in space
        in_space = (others.form[cuts.line] == STACKED_FORM) & (form == STACKED_FORM) | (kind == "cable")
        away = np.hypot(cuts.offset_m, np.where(in_space, cuts.up_m - axis.xyz[cuts.station, 2], 0.0))
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
    place = stations.xyz[good, :2]
    cells = np.unique(np.floor(place / _CELL_M).astype(np.int64), axis=0)
    rows = []
    if len(good):
        origin = place[0]
        middles = (cells + 0.5) * _CELL_M
        near = cKDTree(place - origin).query_ball_point(middles - origin, _WINDOW_M, return_sorted=True)
        rows = [_cell(stations, good[own], middle) for own, middle in zip(near, middles, strict=True)]
    return Registration(
        cells.reshape(-1, 2), np.array([r[0] for r in rows]).reshape(-1, 3), np.array([r[1] for r in rows]),
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


@dataclass(frozen=True, slots=True)
class _Pieces:
    """Pieces of the lines of the old survey that both surveys measured.

    Parameters
    ----------
    line
        (k,) line of each.
    stations
        Stations of each piece.
    is_moved
        (k,) bool: more than chance.
    """

    line: IntArray
    stations: list[IntArray]
    is_moved: BoolArray


def _moved_pieces(old: LineSet, stations: _Stations, registration: Registration) -> _Pieces:
    """Return all pieces and which of them have moved.

    What chance does is taken from all lines of one kind: how large their differences are against the stated deviations, and
    over which distance they are related. Significance adds up over stretches of any length.
    """
    both = np.flatnonzero((stations.partner >= 0) & ~stations.bridged & ~stations.partner_bridged)
    if not len(both):
        return _Pieces(np.zeros(0, dtype=np.int64), [], np.zeros(0, dtype=bool))
    across, up, s_reg = _differences(stations, both, registration)
    sigma = np.sqrt(stations.sigma_m[both] ** 2 + s_reg**2)
    number = np.floor(stations.along_m[both] / _PIECE_M).astype(np.int64)
    pieces, index = np.unique(np.stack([stations.line[both], number], axis=1), axis=0, return_inverse=True)
    index = index.ravel()
    count = np.bincount(index)
    size = np.stack(
        [np.bincount(index, weights=v) / count for v in (across / sigma[:, 0], up / sigma[:, 1])], axis=1
    )
    kinds = old.kind[pieces[:, 0]]
    n_lines = float(registration.n_lines.mean())
    road_km = len(both) / max(n_lines, 1.0) / 1000.0
    is_moved = np.zeros(len(pieces), dtype=bool)
    rows_of = np.split(np.arange(len(pieces)), np.flatnonzero(np.diff(pieces[:, 0])) + 1)
    for axis in (0, 1):
        own = {
            kind: [size[rows, axis] for rows in rows_of if kinds[rows[0]] == kind]
            for kind in sorted(set(kinds.tolist()))
        }
        related = related_of([one / scale_of(listed) for listed in own.values() for one in listed])
        filters = filters_of(related, len(pieces))
        chances = {kind: chance_of(listed, filters) for kind, listed in own.items()}
        least = least_deviations(len(pieces), filters, 0.5 * FALSE_PER_KM * road_km)
        for rows in rows_of:
            for a, b in shifted_runs(size[rows, axis], chances[str(kinds[rows[0]])], least):
                is_moved[rows[a : b + 1]] = True
    order = np.argsort(index, kind="stable")
    return _Pieces(pieces[:, 0], np.split(both[order], np.cumsum(count)[:-1]), is_moved)


def _of_line(
    old: LineSet, new: LineSet, stations: _Stations, i: int, registration: Registration, pieces: _Pieces
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
    mask = np.zeros(len(stations.line), dtype=bool)
    for k in np.flatnonzero((pieces.line == i) & pieces.is_moved).tolist():
        mask[pieces.stations[k]] = True
    changes += _stretches(old, stations, i, mask, "moved", registration)
    return changes + _changed(old, new, stations, i, both)


def _changed(old: LineSet, new: LineSet, stations: _Stations, i: int, both: IntArray) -> list[EpochChange]:
    """Return where the pattern, the form or the height of a line is another one."""
    found = []
    for name in ("pattern", "form"):
        before, after = str(getattr(old, name)[i]), getattr(new, name)[stations.partner[both]]
        other = (after != before) & (after != "") if before else np.zeros(len(both), dtype=bool)
        for value in sorted(set(after[other].tolist())):
            mask = np.zeros(len(stations.line), dtype=bool)
            mask[both[other & (after == value)]] = True
            found += _stretches(old, stations, i, mask, "changed", what=f"{name} {before} to {value}")
    before_m, after_m = float(old.height_m[i]), new.height_m[stations.partner[both]]
    # A height is that of an upper edge above a lower one: each has the deviation of a height
    beyond = np.abs(after_m - before_m) > _HEIGHT_DEVIATIONS * math.sqrt(2.0) * stations.sigma_m[both, 1]
    for value_m in sorted(set(after_m[beyond].tolist())):
        rows = both[beyond & (after_m == value_m)]
        mask = np.zeros(len(stations.line), dtype=bool)
        # A line has one height, also where it is bridged
        mask[rows[0] : rows[-1] + 1] = True
        mask[both[~(beyond & (after_m == value_m))]] = False
        what = f"height {before_m:.2f} to {value_m:.2f} m"
        found += _stretches(old, stations, i, mask, "changed", what=what)
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
        found.append(EpochChange(status, piece, start, end, *numbers, what))
    return found
