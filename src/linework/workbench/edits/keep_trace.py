"""Save a followed line among the others: those that it overlaps are joined with it.

Separate from `apply`, because it is the one edit that has to find other lines to join.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import BoolArray, FloatArray, IntArray, distance_along
from linework.editing.edits.attributes import with_review
from linework.editing.edits.continued import SAME_LINE_M, Gap, continue_lines
from linework.editing.edits.split_join import join_two_lines
from linework.editing.edits.vertices import trim_to_vertices
from linework.errors import UsageError
from linework.lines.along import line_stretch
from linework.lines.companions import COMPANION_BESIDE_M, companions_of
from linework.model.changes import Change
from linework.model.lines import LineSet

#: Lines are joined with a followed line where they overlap it; no gap is closed without being asked for.
_OVERLAPPING = Gap(longest_m=SAME_LINE_M, off_deg=5.0, turn_deg=20.0)
#: Distance within which two cables are the same: the wires of a power line hang farther apart. [m]
SAME_WIRE_M = 0.2
#: Share of a line on another one from which both are the same line: points and images differ here and there.
NEARLY_ALL = 0.9
#: Short pieces that are never joined.
_WHOLE_KINDS = ("lane_marking_dash",)
#: Share of a cable on another from which both are the same, and of a bar or arrow on a marking from which it is part
#: of it: most of it.
_MOST = 0.5


def kept_change(
    lines: LineSet, trace: LineSet, span: tuple[int, int], continues: LineSet | None = None
) -> Change:
    """Return the change that saves a followed line.

    Parameters
    ----------
    lines
        All lines.
    trace
        The followed line first, and then those beside it.
    span
        First and last of its vertices to keep.
    continues
        The line that it continues.

    Returns
    -------
    Change
        Lines of its kind that it overlaps are replaced by one line with it; so is `continues`, over a bridged gap, or
        without one where a wire was followed again instead of its continuation.
        Dashes and kerb tops beside what is kept are added where there are none yet.

    Raises
    ------
    UsageError
        It is of another kind than the line that it continues.
    """
    first, last = span
    one = trim_to_vertices(trace.take([0]), first, min(last, int(trace.offsets[1]) - 1)).with_columns(
        id=np.array([""])
    )
    gone: list[int] = []
    if continues is not None:
        if str(continues.kind[0]) != str(one.kind[0]):
            raise UsageError(
                f"a {one.kind[0]} does not continue a {continues.kind[0]}", where="keep",
                advice="follow the kind of the line",
            )  # fmt: skip
        gone += np.flatnonzero(lines.id == continues.id[0]).tolist()
        others = lines.take((lines.review != "rejected") & (lines.id != continues.id[0]))
        if str(one.kind[0]) == "cable" and _share_on(continues, one) > _MOST:
            parts = LineSet.concatenate([one, *_beyond(continues, one)])
            for k in range(1, len(parts)):
                one = join_two_lines(one, parts.take([k]), others)
            # No gap was between them: what was measured of each stays so at the joints
            _, of_part = cKDTree(parts.xyz).query(one.xyz)
            one = one.with_columns(id=continues.id, bridged=parts.bridged[of_part])
        else:
            one = join_two_lines(continues, one, others)
    if str(one.kind[0]) == "cable":
        absorbed = [k for k in same_wires(one, lines) if k not in gone and lines.review[k] != "rejected"]
    else:
        one, absorbed = grown_line(one, lines, gone)
    new = [one]
    gone += absorbed + _mistaken(one, lines)
    for kind in COMPANION_BESIDE_M:
        others = trace.take(trace.kind == kind)
        for k in companions_of(others, trace[0].xyz[first : last + 1], kind).tolist() if len(others) else []:
            companion = others.take([k]).with_columns(id=np.array([""]))
            if kind in _WHOLE_KINDS:
                new += [] if lines_touching(companion, lines, gone).size else [companion]
                continue
            companion, absorbed = grown_line(companion, lines, gone)
            new, gone = [*new, companion], gone + absorbed
    before = lines.take(np.array(gone, dtype=np.int64))
    return Change("keep", before, with_review(LineSet.concatenate(new), "drawn"))


def same_wires(one: LineSet, lines: LineSet) -> list[int]:
    """Return the indices of cables that are the same as one: within `SAME_WIRE_M` in space."""
    cables = np.flatnonzero(lines.kind == "cable").tolist()
    return [k for k in cables if _share_on(lines.take([k]), one) > _MOST]


def _share_on(wire: LineSet, one: LineSet) -> float:
    """Return the share of the vertices of a wire that lie on another."""
    away, _ = cKDTree(stations_of(one.xyz)).query(wire.xyz, distance_upper_bound=SAME_WIRE_M)
    return float(np.isfinite(away).mean())


def _beyond(wire: LineSet, one: LineSet) -> list[LineSet]:
    """Return what of a wire lies before and behind the part that another one follows."""
    places = stations_of(wire.xyz)
    away, _ = cKDTree(stations_of(one.xyz)).query(places, distance_upper_bound=SAME_WIRE_M)
    on = np.flatnonzero(np.isfinite(away))
    length_m = float(distance_along(wire.xyz[:, :2], in_space=True)[-1])
    first, last = (length_m * float(on[k]) / (len(places) - 1) for k in (0, -1))
    ends = ((0.0, first), (last, length_m))
    return [line_stretch(wire, a, b) for a, b in ends if b - a > 2.0 * SAME_WIRE_M]


def stations_of(xyz: FloatArray) -> FloatArray:
    """Return places (k, 3) along a line (n, 3), `SAME_WIRE_M` apart at most. [m]"""  # noqa: D400
    along = distance_along(xyz, in_space=True)
    at = np.linspace(0.0, along[-1], int(np.ceil(along[-1] / SAME_WIRE_M)) + 1)
    return np.stack([np.interp(at, along, column) for column in xyz.T], axis=1)


def _mistaken(one: LineSet, lines: LineSet) -> list[int]:
    """Return the indices of bars and arrows that are part of a marking."""
    if str(one.kind[0]) != "lane_marking":
        return []
    bars = lines_touching(one.with_columns(kind=np.array(["road_marking_other"])), lines, [])
    return [k for k in bars.tolist() if _is_on(lines[k].xyz[:, :2], one.xyz[:, :2]).mean() > _MOST]


def grown_line(one: LineSet, lines: LineSet, gone: list[int]) -> tuple[LineSet, list[int]]:
    """Return a line joined with those of its kind that it overlaps, not `gone` ones, and their indices."""
    absorbed: list[int] = []
    for k in lines_touching(one, lines, gone).tolist():
        other = lines.take([k])
        whole = continue_lines(one, other, _OVERLAPPING)
        if len(whole) > 1:
            whole = _longer(one, other)
        if len(whole) == 1:
            name = one.id if one.id[0] else other.id
            one = whole.with_columns(id=name)
            absorbed.append(k)
    return one, absorbed


def share_on_line(one: LineSet, other: LineSet) -> float:
    """Return the share of a line that lies within `SAME_LINE_M` of another in plan."""
    return float(_is_on(stations_of(one.xyz)[:, :2], other.xyz[:, :2]).mean())


def _longer(one: LineSet, other: LineSet) -> LineSet:
    """Return the longer of two lines if nearly all of one lies on the other, else both."""
    on_other, on_one = share_on_line(one, other), share_on_line(other, one)
    if max(on_other, on_one) < NEARLY_ALL:
        return LineSet.concatenate([one, other])
    return one if on_one >= on_other else other


def lines_touching(one: LineSet, lines: LineSet, gone: list[int]) -> IntArray:
    """Return the indices of lines of its kind, not rejected and not `gone`, that have a vertex on a line in plan."""
    xy = one.xyz[:, :2]
    low, high = xy.min(axis=0) - SAME_LINE_M, xy.max(axis=0) + SAME_LINE_M
    candidates = (lines.kind == one.kind[0]) & (lines.review != "rejected")
    candidates[gone] = False
    inside = np.all((lines.xyz[:, :2] >= low) & (lines.xyz[:, :2] <= high), axis=1)
    inside &= candidates[lines.line_of_vertex]
    near = np.flatnonzero(inside)[_is_on(lines.xyz[inside, :2], xy)]
    return np.unique(lines.line_of_vertex[near])


def _is_on(places: FloatArray, line: FloatArray) -> BoolArray:
    """Return which places (n, 2) lie within `SAME_LINE_M` of a line (k, 2)."""
    out = np.zeros(len(places), dtype=np.bool_)
    a, step = line[:-1], np.diff(line, axis=0)
    size2 = np.maximum(np.sum(step * step, axis=1), 1e-12)
    for i, place in enumerate(places):
        share = np.clip(np.sum((place - a) * step, axis=1) / size2, 0.0, 1.0)
        out[i] = float(np.hypot(*(place - a - share[:, None] * step).T).min()) <= SAME_LINE_M
    return out
