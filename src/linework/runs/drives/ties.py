"""Ties between drives: what two drives measured of one line, across it, in height, and along it at dashes.

Separate from `adjustment`, which makes a path of them: this looks at lines.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray, distance_along
from linework.lines.along import runs_of
from linework.lines.crosscuts import LinesToCut, axis_along, cross_cuts
from linework.model.columns import Columns, column
from linework.model.lines import STACKED_FORM, LineSet
from linework.runs.drives.adjustment import DriveTies, PathCorrection
from linework.runs.drives.separate import LEAST_SHARED_M, PASSED_M, SHARED_ROAD_M, DriveSpan

#: Kinds of line that tie drives: those that any drive measures at the same place. A fence or a hedge has no such place.
TIE_KINDS = ("lane_marking", "lane_marking_dash", "road_boundary", "kerb_top", "guardrail", "barrier")
#: The same in the order in which they are looked for, until ties hold all along the road that drives share: markings are
#: the sharpest for what they cost to be found.
TIE_KINDS_IN_TURN = (TIE_KINDS[:2], TIE_KINDS[2:4], TIE_KINDS[4:])
#: Kinds of which drives on either side measure different faces, and what that may make. [m]
_FACED, _FACE_M = ("guardrail", "barrier"), 0.02
#: Forms of rails whose upper edge moves by more than its standard deviation says (decision 66).
_INEXACT_FORMS = ("thrie_beam", "box_beam", "cable_barrier", "concrete")
#: Length over which the differences of two lines are one tie: errors of lines are related over some metres. [m]
_PIECE_M = 5.0
#: Reach of the first ties, less than half of the width of a lane, and of the last ones, less than the width of a stripe:
#: the lines of a double one are farther apart. [m]
FIRST_REACH_M, LAST_REACH_M = 1.0, 0.08
#: Least deviation of a line's position: its parts that two drives measure differ by the grain of the road. [m]
_LEAST_M = 0.005
#: A line that turns more than 15 degrees from another is not the same.
_PARALLEL = 0.966
#: Greatest difference of two dashes along the road, and least deviation of it, the distance of scan lines. [m]
_DASH_REACH_M, _LEAST_DASH_M = 1.0, 0.02


@dataclass(frozen=True, slots=True)
class MetLine(Columns):
    """Where the lines of another drive cross the perpendiculars of one line, by station of this.

    Parameters
    ----------
    station
        (n,) int64 number of the station.
    at_m
        (n,) its distance along the line. [m]
    time_s, other_s
        (n,) when the one drive and the other passed. [s]
    left
        (n, 2) unit vector to the left of the line.
    offset_m, rise_m
        (n,) position of the other line, to the left and above. [m]
    sigma_m
        (n, 2) standard deviations of that, for a tie of whole length. [m]
    other
        (n,) int64 number of the other line among those of its kind.
    is_stacked
        (n,) bool: both are pipes of a rail, one above another.
    """

    station: IntArray = column(np.int64)
    at_m: FloatArray = column()
    time_s: FloatArray = column()
    other_s: FloatArray = column()
    left: FloatArray = column(np.float64, 2)
    offset_m: FloatArray = column()
    rise_m: FloatArray = column()
    sigma_m: FloatArray = column(np.float64, 2)
    other: IntArray = column(np.int64)
    is_stacked: BoolArray = column(np.bool_)


#: What two drives have in common, by their numbers: of the first one's lines.
MetLines = Mapping[tuple[int, int], Sequence[MetLine]]


def meet_lines(
    drives: Sequence[DriveSpan], lines: Sequence[LineSet], untied_xy: FloatArray | None = None
) -> MetLines:
    """Return where the lines of every drive meet those of every other one: the same for every correction.

    Parameters
    ----------
    lines
        Of each drive, as it measured them.
    untied_xy
        (n, 2) places [m, world]: only lines within `PASSED_M` of one of them are compared; None: all are.
    """
    untied = None if untied_xy is None else cKDTree(untied_xy - drives[0].xy[0])

    def is_untied(xy: FloatArray) -> BoolArray:
        if untied is None:
            return np.ones(len(xy), dtype=np.bool_)
        return np.asarray(untied.query(xy - drives[0].xy[0])[0] <= PASSED_M)

    return {
        (a, b): _met_lines(drives[a], drives[b], lines[a], lines[b], is_untied)
        for a, b in permutations(range(len(drives)), 2)
    }


def tie_drives(
    drives: Sequence[DriveSpan],
    lines: Sequence[LineSet],
    met: MetLines,
    correction: PathCorrection | None,
    *,
    reach_m: float,
) -> DriveTies:
    """Return the ties between the lines of drives.

    Parameters
    ----------
    lines
        Of each drive, as it measured them.
    met
        Where they meet (`meet_lines`).
    correction
        Found so far: by it lines are brought together before the nearest is chosen.
    reach_m
        Greatest difference that is left. [m]

    Notes
    -----
    Of m drives over one place, m (m - 1) / 2 pairs are tied, of which m - 1 are independent: their deviations are enlarged
    so that together they weigh as much.
    """
    found = [DriveTies.empty()]
    for a, b in permutations(range(len(drives)), 2):
        one, other = drives[a], drives[b]
        if a < b:
            found.append(_of_dashes(one, other, lines[a], lines[b], correction, reach_m))
        # Of either drive's lines: each has half of the weight
        found.append(_of_lines(met[a, b], correction, reach_m))
    ties = DriveTies.concatenate(found)
    if len(drives) == 2 or not len(ties):
        return ties
    place = np.stack([np.interp(ties.time_s, *_joined(drives, k)) for k in (0, 1)], axis=1)
    n_here = sum(np.isfinite(drive.passing_s(place)).astype(np.int64) for drive in drives)
    return DriveTies(ties.time_s, ties.other_s, ties.normal, ties.apart_m,
                     ties.sigma_m * np.sqrt(np.maximum(n_here, 2) / 2.0))  # fmt: skip


def untied_places(drives: Sequence[DriveSpan], ties: DriveTies) -> FloatArray:
    """Return places every metre along road that drives share and that no line ties, (n, 2) [m, world].

    A stretch without a tie counts if it is as long as the shortest that counts as shared, from tie to tie or to where the
    drives part.
    """
    untied = [np.empty((0, 2))]
    driven = [np.concatenate([place for _, place in drive.stretches()]) for drive in drives]
    trees = [cKDTree(places - drives[0].xy[0]) for places in driven]
    for a, b in permutations(range(len(drives)), 2):
        one, other = drives[a], drives[b]
        tied = np.concatenate(
            [
                own[one.holds(own) & other.holds(others)]
                for own, others in ((ties.time_s, ties.other_s), (ties.other_s, ties.time_s))
            ]
        )
        for time, place in one.stretches():
            away, _ = trees[b].query(place - drives[0].xy[0])
            along = distance_along(place)
            tied_m = np.interp(tied[(tied >= time[0]) & (tied <= time[-1])], time, along)
            for first, last in runs_of(away <= SHARED_ROAD_M):
                own = slice(first, last + 1)
                ends = along[own][[0, -1]]
                inside = tied_m[(tied_m > ends[0]) & (tied_m < ends[1])]
                stops = np.sort(np.concatenate([ends, inside]))
                gap = np.clip(np.searchsorted(stops, along[own]), 1, len(stops) - 1)
                untied.append(place[own][stops[gap] - stops[gap - 1] >= LEAST_SHARED_M])
    return np.concatenate(untied)


def _joined(drives: Sequence[DriveSpan], axis: int) -> tuple[FloatArray, FloatArray]:
    return np.concatenate([d.time_s for d in drives]), np.concatenate([d.xy[:, axis] for d in drives])


def _moved(correction: PathCorrection | None, time_s: FloatArray, normal: FloatArray) -> FloatArray:
    """Return the correction along normals (n, 3) at times (n,), (n,) [m]."""
    if correction is None:
        return np.zeros(len(time_s))
    return np.asarray(np.sum(correction.at(time_s) * normal, axis=1))


def _met_lines(
    one: DriveSpan,
    other: DriveSpan,
    lines: LineSet,
    others: LineSet,
    is_untied: Callable[[FloatArray], BoolArray],
) -> list[MetLine]:
    """Return what each line of a drive has in common with the other drive's lines of its kind, at untied places."""
    met: list[MetLine] = []
    kinds = {kind: others.take(others.kind == kind) for kind in TIE_KINDS if kind != "lane_marking_dash"}
    to_cut = {kind: LinesToCut(own) for kind, own in kinds.items()}
    is_exact = ~np.isin(lines.form, _INEXACT_FORMS)
    for i in np.flatnonzero(
        np.isin(lines.kind, list(kinds)) & is_exact & (lines.length_m >= _PIECE_M)
    ).tolist():
        kind = str(lines.kind[i])
        axis = axis_along("", lines[i].xyz)
        time, other_s = one.passing_s(axis.xyz[:, :2]), other.passing_s(axis.xyz[:, :2])
        cuts = cross_cuts(to_cut[kind], axis, reach_m=2.0 * FIRST_REACH_M)
        same = (np.abs(cuts.cosine) >= _PARALLEL) & ~cuts.bridged
        same &= np.isfinite(time[cuts.station]) & np.isfinite(other_s[cuts.station])
        same &= is_untied(axis.xyz[:, :2])[cuts.station]
        own = cross_cuts(lines.take([i]), axis, reach_m=0.05)
        hidden = np.ones(len(axis.station_m), dtype=bool)
        hidden[own.station[~own.bridged]] = False
        same &= ~hidden[cuts.station]
        cuts = cuts.take(np.flatnonzero(same))
        if not len(cuts):
            continue
        k = cuts.station
        sigma = np.stack(
            [np.interp(axis.station_m[k], axis.station_m, s) for s in _sigmas(lines, i, axis.station_m)],
            axis=1,
        )
        both = np.hypot(sigma, np.column_stack([cuts.sigma_xy_m, cuts.sigma_z_m]))
        both = np.sqrt(2.0) * np.maximum(np.nan_to_num(both, nan=0.0), np.sqrt(2.0) * _LEAST_M)
        if kind in _FACED:
            both[:, 0] = np.hypot(both[:, 0], _FACE_M)
        met.append(
            MetLine(
                station=k, at_m=axis.station_m[k], time_s=time[k], other_s=other_s[k], left=axis.left[k],
                offset_m=cuts.offset_m, rise_m=cuts.up_m - axis.xyz[k, 2], sigma_m=both, other=cuts.line,
                is_stacked=(kinds[kind].form[cuts.line] == STACKED_FORM) & (lines.form[i] == STACKED_FORM),
            )
        )  # fmt: skip
    return met


def _of_lines(met: Sequence[MetLine], correction: PathCorrection | None, reach_m: float) -> DriveTies:
    """Return the ties across and in height of the lines of a drive, every `_PIECE_M`."""
    parts = [DriveTies.empty()]
    for m in met:
        # By the correction lines may come nearer, but no farther off than the first ones are sought
        near = m.take(np.flatnonzero(np.abs(m.offset_m) <= FIRST_REACH_M + reach_m))
        if not len(near):
            continue
        k = near.station
        normal = np.column_stack([near.left, np.zeros(len(k))])
        up = np.broadcast_to([0.0, 0.0, 1.0], normal.shape)
        left, high = (
            apart + _moved(correction, near.other_s, along) - _moved(correction, near.time_s, along)
            for apart, along in ((near.offset_m, normal), (near.rise_m, up))
        )
        # The nearest of each station, and only where it is near
        order = np.lexsort((np.where(near.is_stacked, np.hypot(left, high), np.abs(left)), k))
        nearest = order[np.concatenate([[True], np.diff(k[order]) > 0])]
        nearest = nearest[(np.abs(left[nearest]) <= reach_m) & (np.abs(high[nearest]) <= reach_m)]
        where = near.at_m, near.time_s, near.other_s
        parts.append(_pieces(*where, normal, near.offset_m, near.sigma_m[:, 0], near.other, nearest))
        parts.append(_pieces(*where, up, near.rise_m, near.sigma_m[:, 1], near.other, nearest))
    return DriveTies.concatenate(parts)


def _sigmas(lines: LineSet, i: int, at_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the deviations of a line across and in height at distances along it."""
    along = distance_along(lines[i].xyz)
    first, last = int(lines.offsets[i]), int(lines.offsets[i + 1])
    return np.interp(at_m, along, lines.sigma_xy_m[first:last]), np.interp(
        at_m, along, lines.sigma_z_m[first:last]
    )


def _pieces(
    at_m: FloatArray, time_s: FloatArray, other_s: FloatArray, normal: FloatArray, apart_m: FloatArray, sigma_m: FloatArray,
    line: AnyArray, rows: AnyArray,
) -> DriveTies:  # fmt: skip
    """Return the means of rows over pieces of a line."""
    number = np.stack([line[rows], np.floor(at_m[rows] / _PIECE_M).astype(np.int64)], axis=1)
    _, index, count = np.unique(number, axis=0, return_inverse=True, return_counts=True)
    index = index.ravel()

    def mean(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(index, weights=values[rows]) / count)

    along = np.stack([mean(c) for c in normal.T], axis=1)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    # Pieces at the ends of lines are shorter, and weigh less
    sigma = mean(sigma_m) * np.sqrt(_PIECE_M / np.minimum(count, _PIECE_M))
    return DriveTies(mean(time_s), mean(other_s), along, mean(apart_m), sigma)


def _of_dashes(
    one: DriveSpan,
    other: DriveSpan,
    lines: LineSet,
    others: LineSet,
    correction: PathCorrection | None,
    reach_m: float,
) -> DriveTies:
    """Return the ties along the road: middles of dashes, whose ends are late and early by the same."""
    a, b = (_dashes(s.take(s.kind == "lane_marking_dash")) for s in (lines, others))
    if not len(a[0]) or not len(b[0]):
        return DriveTies.empty()
    origin = a[0][0]
    reach = min(_DASH_REACH_M, 2.0 * reach_m)
    away, k = cKDTree(b[0] - origin).query(a[0] - origin, distance_upper_bound=_DASH_REACH_M + reach)
    met = np.flatnonzero(np.isfinite(away))
    k = k[met]
    normal = np.column_stack([a[1][met], np.zeros(len(met))])
    step = b[0][k] - a[0][met]
    along = np.sum(step * a[1][met], axis=1)
    across = np.abs(a[1][met, 0] * step[:, 1] - a[1][met, 1] * step[:, 0])
    time, other_s = one.passing_s(a[0][met]), other.passing_s(b[0][k])
    there = np.isfinite(time) & np.isfinite(other_s)
    time, other_s = np.nan_to_num(time), np.nan_to_num(other_s)
    left = along + _moved(correction, other_s, normal) - _moved(correction, time, normal)
    fits = there & (np.abs(left) <= reach) & (across <= max(reach_m, 0.3))
    fits &= np.abs(np.sum(a[1][met] * b[1][k], axis=1)) >= _PARALLEL
    longer = b[2][k] - a[2][met]
    # Four ends make the difference of the lengths, and half of each makes that of the middles
    fits &= np.abs(longer) <= _DASH_REACH_M
    if not fits.any():
        return DriveTies.empty()
    sigma = max(0.5 * 1.4826 * float(np.median(np.abs(longer[fits]))), _LEAST_DASH_M)
    return DriveTies(time[fits], other_s[fits], normal[fits], along[fits], np.full(int(fits.sum()), sigma))


def _dashes(lines: LineSet) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return middles (n, 2), unit directions (n, 2) and lengths (n,) of dashes."""
    ends = np.array([[line.xyz[0, :2], line.xyz[-1, :2]] for line in lines]).reshape(-1, 2, 2)
    step = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(step, axis=1)
    return ends.mean(axis=1), step / np.maximum(length, 1e-9)[:, None], length
