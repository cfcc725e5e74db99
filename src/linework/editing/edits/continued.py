"""Joining a newly followed line to the existing line that it continues."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet

#: Lines of one kind this close to each other are the same line, followed from two picks. [m]
SAME_LINE_M = 0.15


@dataclass(frozen=True, slots=True)
class Gap:
    """Limits of the gap over which a line is continued.

    Parameters
    ----------
    longest_m
        Between the ends.
    off_deg
        The gap's chord is off the mean of both directions by no more than this.
    turn_deg
        The line may turn by this over the gap.
    """

    longest_m: float
    off_deg: float
    turn_deg: float


#: Limits where a person picked both lines as one.
PICKED_TWICE = Gap(longest_m=60.0, off_deg=5.0, turn_deg=60.0)
#: Length of a line's end that gives its direction. [m]
_END_M = 5.0


def continue_lines(there: LineSet, new: LineSet, gap: Gap = PICKED_TWICE) -> LineSet:
    """Return lines with new ones added; a new line that continues or overlaps an existing one is joined to it.

    The gap between two joined lines is bridged. Lines of other kinds are never joined.
    """
    if len(there) == 0:
        return new
    lines = there.with_columns(crs=new.crs)
    for i in range(len(new)):
        lines = _added(lines, new.take([i]), gap)
    return lines


def _added(lines: LineSet, one: LineSet, gap: Gap) -> LineSet:
    """Return the lines with one more, joined to the first line that it continues."""
    for i in np.flatnonzero(lines.kind == one.kind[0]).tolist():
        joined = _joined(lines.take([i]), one, gap)
        if joined is not None:
            rest = np.arange(len(lines)) != i
            return LineSet.concatenate([lines.take(rest), joined])
    return LineSet.concatenate([lines, one])


def _joined(a: LineSet, b: LineSet, over: Gap) -> LineSet | None:
    """Return two lines as one, or None where neither continues the other."""
    if _near(a.xyz, b.xyz).all():
        # One is part of the other
        return b.with_columns(**{name: getattr(a, name) for name in LINE_COLUMNS})
    for turned_a in (False, True):
        for turned_b in (False, True):
            first, second = _turned(a, turned=turned_a), _turned(b, turned=turned_b)
            beyond = _beyond(first.xyz, second.xyz, over)
            if beyond is None:
                continue
            keep = second.xyz[beyond:]
            if len(keep) == 0:
                return a  # all of it is there already
            columns = {
                name: np.concatenate([getattr(first, name), getattr(second, name)[beyond:]])
                for name in VERTEX_COLUMNS
            }
            if beyond == 0:
                columns["bridged"][len(first.xyz) - 1 : len(first.xyz) + 1] = True
            columns |= {name: getattr(a, name) for name in LINE_COLUMNS}
            return LineSet.from_lines([np.concatenate([first.xyz, keep])], crs=a.crs, **columns)
    return None


def _turned(line: LineSet, *, turned: bool) -> LineSet:
    if not turned:
        return line
    columns = {name: getattr(line, name)[::-1] for name in VERTEX_COLUMNS}
    return line.with_columns(xyz=line.xyz[::-1], **columns)


def _beyond(first: FloatArray, second: FloatArray, over: Gap) -> int | None:
    """Return the first vertex of `second` beyond the end of `first`, or None if it does not continue it."""
    near = _near(second, first)
    if near[0]:
        # They overlap: vertices after the last shared one are new, if both run in the same direction
        last = len(near) if near.all() else int(np.argmin(near))
        to_end = np.linalg.norm(second[[0, last - 1], :2] - first[-1, :2], axis=1)
        return last if to_end[1] < to_end[0] and not near[last:].any() else None
    if near.any():
        return None
    step = second[0, :2] - first[-1, :2]
    gap = float(np.linalg.norm(step))
    if gap > over.longest_m:
        return None
    here, there = -_direction(first[::-1]), _direction(second)
    # An arc leads from one end to the other: its chord halves the turn
    middle = (here + there) / max(float(np.linalg.norm(here + there)), 1e-9)
    turns = float(here @ there) < np.cos(np.radians(over.turn_deg))
    return None if turns or float(step @ middle) < gap * np.cos(np.radians(over.off_deg)) else 0


def _near(places: FloatArray, line: FloatArray) -> BoolArray:
    """Return which places (n, 3) lie within `SAME_LINE_M` of a line, in plan."""
    a, way = line[:-1, :2], np.diff(line[:, :2], axis=0)
    length2 = np.maximum(np.sum(way * way, axis=1), 1e-12)
    step = places[:, None, :2] - a
    share = np.clip(np.sum(step * way, axis=2) / length2, 0.0, 1.0)
    distance = np.linalg.norm(step - share[:, :, None] * way, axis=2)
    return np.asarray(distance.min(axis=1) <= SAME_LINE_M)


def _direction(line: FloatArray) -> FloatArray:
    """Return the direction of a line's first metres."""
    away = np.linalg.norm(line[:, :2] - line[0, :2], axis=1)
    inner = int(np.argmax(away >= min(_END_M, float(away.max()))))
    return (line[inner, :2] - line[0, :2]) / max(float(away[inner]), 1e-9)
