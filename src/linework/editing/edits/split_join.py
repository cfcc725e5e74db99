"""Splitting a line in two, and joining two lines."""

from __future__ import annotations

from typing import Any

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.editing.edits.continued import SAME_LINE_M, Gap, continue_lines
from linework.editing.edits.new_lines import bridge_gap
from linework.editing.edits.vertices import ONE_PLACE_M, line_of_vertices, rebuild_line, reversed_line
from linework.errors import UsageError
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet

#: Widest gap that can be joined by hand: beyond it nobody sees that two ends are one line. [m]
LONGEST_JOINED_GAP_M = 200.0
#: Lines that overlap, or nearly meet in line, are joined as the tracker joins them.
_MEETING = Gap(longest_m=2.0, off_deg=30.0, turn_deg=60.0)


def split_line(line: LineSet, at: FloatArray) -> LineSet:
    """Return the two parts of a line, cut at its point nearest to a place.

    Parameters
    ----------
    line
        A single line.
    at
        (2,) [m, world].

    Returns
    -------
    LineSet
        Two lines, in the order of the line. The longer keeps the `id`, the other has none. Both end at the cut,
        where sigma is interpolated.

    Raises
    ------
    UsageError
        The nearest point is an end of the line.
    """
    before, share = _nearest(line.xyz[:, :2], np.asarray(at, dtype=np.float64)[:2])
    cut = {name: _between(getattr(line, name), before, share) for name in VERTEX_COLUMNS}
    # A segment is bridged if an end is: its halves are, too
    cut["bridged"] = line.bridged[before] | line.bridged[before + 1]
    place = line.xyz[before] + share * (line.xyz[before + 1] - line.xyz[before])
    whole = rebuild_line(
        line, np.insert(line.xyz, before + 1, place, axis=0),
        {name: np.insert(getattr(line, name), before + 1, cut[name]) for name in VERTEX_COLUMNS},
    )  # fmt: skip
    # Where the cut is at a vertex, that vertex is the end of both parts
    n = len(whole.xyz)
    first, second = np.arange(before + 2), np.arange(before + 1, n)
    parts = [
        _distinct(line_of_vertices(whole, first), keep_last=True),
        _distinct(line_of_vertices(whole, second)),
    ]
    if min(len(part.xyz) for part in parts) < 2:
        raise UsageError(
            "the line ends there: nothing to split off", where="split", advice="choose a place inside it"
        )
    longer = int(parts[1].length_m[0] > parts[0].length_m[0])
    parts[1 - longer] = parts[1 - longer].with_columns(id=np.array([""]))
    return LineSet.concatenate(parts)


def join_two_lines(one: LineSet, other: LineSet, others: LineSet | None = None) -> LineSet:
    """Return two lines joined at their nearest ends; the gap is bridged.

    Across the gap the line follows a neighbour among `others` (see `bridge_gap`). It has the direction of `one` and
    the `id` of the longer line. Numbers are means weighted by length; text is that of `one` unless empty.

    Raises
    ------
    UsageError
        They differ in kind, are too far apart, or would double back at the joint.
    """
    if str(one.kind[0]) != str(other.kind[0]):
        raise UsageError(
            f"a {one.kind[0]} and a {other.kind[0]} cannot be joined", where="join",
            advice="change the kind of one first",
        )  # fmt: skip
    columns = _merged_columns(one, other)
    along = continue_lines(one, other, _MEETING)
    whole = along if len(along) == 1 else _bridged(one, other, others or LineSet.empty(one.crs))
    if _runs_against(whole, one):
        whole = reversed_line(whole)
    return whole.with_columns(**columns)


def _bridged(one: LineSet, other: LineSet, others: LineSet) -> LineSet:
    """Return two lines with the nearest of their ends joined by a bridged segment."""
    apart = np.linalg.norm(one.xyz[[0, -1], None, :2] - other.xyz[None, [0, -1], :2], axis=2)
    a, b = (int(v) for v in np.unravel_index(int(np.argmin(apart)), apart.shape))
    gap_m = float(apart[a, b])
    if gap_m > LONGEST_JOINED_GAP_M:
        raise UsageError(
            f"the lines are {gap_m:.0f} m apart; at most {LONGEST_JOINED_GAP_M:.0f} m can be bridged", where="join",
            advice="follow or draw what is between them",
        )  # fmt: skip
    head = one if a == 1 else reversed_line(one)
    tail = other if b == 0 else reversed_line(other)
    ahead, onward = _way(head.xyz[::-1]) * -1.0, _way(tail.xyz)
    step = tail.xyz[0, :2] - head.xyz[-1, :2]
    if float(ahead @ onward) < 0.0 or (gap_m > SAME_LINE_M and float(ahead @ step) < 0.0):
        raise UsageError(
            "the joined line would double back", where="join",
            advice="trim the line that runs past the other",
        )  # fmt: skip
    meets = float(np.linalg.norm(head.xyz[-1] - tail.xyz[0])) < ONE_PLACE_M
    kept = line_of_vertices(tail, np.arange(int(meets), len(tail.xyz)))
    between = np.zeros((0, 3)) if str(one.kind[0]) == "cable" else bridge_gap(head.xyz, tail.xyz, others)
    blank: dict[str, Any] = {"sigma_xy_m": np.nan, "sigma_z_m": np.nan, "bridged": True, "observed": True}
    columns = {
        name: np.concatenate([getattr(head, name), np.full(len(between), blank[name]), getattr(kept, name)])
        for name in VERTEX_COLUMNS
    }
    if gap_m > SAME_LINE_M and len(between) == 0:
        # A segment is bridged if an end is
        columns["bridged"][len(head.xyz) - 1 : len(head.xyz) + 1] = True
    return rebuild_line(one, np.concatenate([head.xyz, between, kept.xyz]), columns)


def _merged_columns(one: LineSet, other: LineSet) -> dict[str, AnyArray]:
    """Return the columns of two lines as one."""
    both = LineSet.concatenate([one, other])
    weights = np.maximum(both.length_m, 1e-9)
    longer = int(np.argmax(weights))
    merged: dict[str, AnyArray] = {}
    for name in LINE_COLUMNS:
        values = getattr(both, name)
        if values.dtype == np.float64:
            merged[name] = np.array([_merged(name, values, weights)])
        elif values.dtype == np.bool_:
            merged[name] = values[[longer]]
        else:
            merged[name] = values[[0 if values[0] else 1]]
    merged["id"] = both.id[[longer]]
    methods = "+".join(dict.fromkeys(m for text in both.method.tolist() for m in text.split("+") if m))
    merged["method"] = np.array([methods])
    merged["note"] = np.array(["; ".join(dict.fromkeys(note for note in both.note.tolist() if note))])
    return merged


def _merged(name: str, values: FloatArray, weights: FloatArray) -> float:
    known = ~np.isnan(values)
    if not known.any():
        return float("nan")
    if name in ("clearance_m", "time_start_s"):
        return float(values[known].min())
    if name == "time_end_s":
        return float(values[known].max())
    if name == "n_beams":
        # A number of things has no mean
        return float(values[known][np.argmax(weights[known])])
    if name.startswith("disagreement"):
        # The disagreement of one part, on one side of it, does not hold for the whole
        return float("nan")
    return float(np.average(values[known], weights=weights[known]))


def _nearest(line: FloatArray, xy: FloatArray) -> tuple[int, float]:
    """Return the segment of a line (n, 2) nearest to a place, and the share of it before the nearest point."""
    a, way = line[:-1], np.diff(line, axis=0)
    share = np.clip(np.sum((xy - a) * way, axis=1) / np.maximum(np.sum(way * way, axis=1), 1e-12), 0.0, 1.0)
    i = int(np.argmin(np.linalg.norm(a + share[:, None] * way - xy, axis=1)))
    return i, float(share[i])


def _between(values: AnyArray, before: int, share: float) -> Any:
    if values.dtype == np.bool_:
        return bool(values[before] & values[before + 1])
    return (1.0 - share) * values[before] + share * values[before + 1]


def _distinct(line: LineSet, *, keep_last: bool = False) -> LineSet:
    """Return a line without the vertex beside its cut end where both are one place."""
    at, beside = (len(line.xyz) - 1, len(line.xyz) - 2) if keep_last else (0, 1)
    if len(line.xyz) < 2 or float(np.linalg.norm(line.xyz[at] - line.xyz[beside])) >= ONE_PLACE_M:
        return line
    return line_of_vertices(line, np.delete(np.arange(len(line.xyz)), at))


def _way(xyz: FloatArray) -> FloatArray:
    """Return the direction (2,) of a line's first metres."""
    away = np.linalg.norm(xyz[:, :2] - xyz[0, :2], axis=1)
    inner = int(np.argmax(away >= min(3.0, float(away.max()))))
    return np.asarray((xyz[inner, :2] - xyz[0, :2]) / max(float(away[inner]), 1e-9))


def _runs_against(whole: LineSet, one: LineSet) -> bool:
    """Return whether a line that holds another runs against it."""
    at = [_nearest(whole.xyz[:, :2], place) for place in one.xyz[[0, -1], :2]]
    return at[0] > at[1]
