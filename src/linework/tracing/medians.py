"""The other rail of a median: from a guardrail or barrier to what stands parallel to it on the same strip.

Separate from `rails`, which finds the line at a place: this goes from one line to those beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import FloatArray, distance_along, offsets_of
from linework.lines.along import PLACE_STEP_M, LinePlaces, places_along
from linework.lines.companions import MEDIAN_KINDS
from linework.model.lines import LineSet
from linework.surface.cells import MAX_PATH_STEP_M
from linework.tracing.rails import CORE_M, RailPieces

#: Farthest that the rails of one median stand apart. Between two rails no lane has room: the narrowest, of roadworks, is
#: 2.6 m wide and 0.5 m clear of what stands on either side. [m]
MOST_APART_M = 3.5
#: Nearer than this to a line is the line itself: beams back to back are 0.25 m apart or more. [m]
SAME_RAIL_M = 0.15
#: Shortest length over which two rails run side by side. [m]
LEAST_BESIDE_M = 4.0
#: Most that two parallel lines of a median draw together, along their length: the taper of a safety barrier. [m/m]
MOST_TAPER = 1.0 / 20.0
#: Lines of one rail stand at one distance, within this. [m]
_IN_LINE_M = 0.5
#: The tiles about places this far apart along a line hold all of what stands beside it.
_SEARCHED_M = 0.25 * CORE_M


def partners_of(pieces: RailPieces, line: FloatArray, path: FloatArray | None) -> LineSet:
    """Return the lines of the rail or barrier that shares a median with a line; empty where none does.

    Parameters
    ----------
    line
        (n, 3) vertices of a guardrail or barrier. [m, world]
    path
        (k, 2) or (k, 3) positions of the van [m, world]: what it drove between is no median. None: not known.

    Notes
    -----
    It is the nearest that runs along the line, on either side; lines at the same distance before or behind it are of the
    same rail. A second beam beside the nearest is not.
    """
    along = distance_along(line[:, :2])
    at = np.linspace(0.0, along[-1], max(int(np.ceil(along[-1] / _SEARCHED_M)), 1) + 1)
    about = pieces.lines_about(np.stack([np.interp(at, along, column) for column in line[:, :2].T], axis=1))
    return partners_among(about, line, path)


def partners_among(lines: LineSet, line: FloatArray, path: FloatArray | None) -> LineSet:
    """Return of some lines those of the rail or barrier that shares a median with a line; see `partners_of`."""
    found: list[_Partner] = []
    axis = places_along(LineSet.from_lines([line], kind=["guardrail"]))
    driven = None if path is None else _beside(axis, _path_places(path))
    for k in np.flatnonzero(np.isin(lines.kind, MEDIAN_KINDS)).tolist():
        along_m, off_m = _beside(axis, places_along(lines.take([k])).xyz[:, :2])
        if len(off_m) < 2 or np.ptp(along_m) < LEAST_BESIDE_M:
            continue
        one = _Partner(float(np.median(off_m)), float(along_m.min()), float(along_m.max()), k)
        taper = abs(float(np.polyfit(along_m, off_m, 1)[0]))
        if not SAME_RAIL_M < abs(one.apart_m) <= MOST_APART_M or taper > MOST_TAPER:
            continue
        if driven is not None and _drove_between(driven, one):
            continue
        found.append(one)
    return lines.take(np.array(sorted(one.number for one in _of_one_rail(found)), dtype=np.int64))


class _Partner(NamedTuple):
    """A line beside another: how far to its left, from where to where along it [m], and its number."""

    apart_m: float
    start_m: float
    end_m: float
    number: int


def _of_one_rail(found: Sequence[_Partner]) -> list[_Partner]:
    """Return the nearest, and those in line with it that run beside none of the others."""
    rail: list[_Partner] = []
    for one in sorted(found, key=lambda one: (abs(one.apart_m), one)):
        is_in_line = not rail or abs(one.apart_m - rail[0].apart_m) <= _IN_LINE_M
        # Pieces of a rail may overlap where it was measured twice
        beside_m = (min(one.end_m, other.end_m) - max(one.start_m, other.start_m) for other in rail)
        if is_in_line and all(length_m < LEAST_BESIDE_M for length_m in beside_m):
            rail.append(one)
    return rail


def _path_places(path: FloatArray) -> FloatArray:
    """Return places (n, 2) along the van's path, also between its positions, but not over jumps."""
    xy = path[:, :2]
    step = np.hypot(*np.diff(xy, axis=0).T)
    parts = np.where(step <= MAX_PATH_STEP_M, np.ceil(step / PLACE_STEP_M), 1.0).astype(np.int64).clip(min=1)
    start = np.repeat(np.arange(len(parts)), parts)
    share = (np.arange(len(start)) - offsets_of(parts)[start]) / parts[start]
    return np.concatenate([xy[start] + share[:, None] * (xy[start + 1] - xy[start]), xy[-1:]])


def _drove_between(driven: tuple[FloatArray, FloatArray], beside: _Partner) -> bool:
    """Return whether the van drove between a line and another beside it: places along it [m], and how far to its left [m]."""
    at_m, left_m = driven
    there = (at_m >= beside.start_m) & (at_m <= beside.end_m)
    share = left_m[there] / beside.apart_m
    return bool(np.any((share > 0.0) & (share < 1.0)))


def _beside(axis: LinePlaces, places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return of places (k, 2) within reach beside a line, not beyond its ends, how far along it and to its left. [m]"""  # noqa: D400
    origin = axis.xyz[0, :2]
    away, k = cKDTree(axis.xyz[:, :2] - origin).query(
        places - origin, distance_upper_bound=MOST_APART_M + PLACE_STEP_M
    )
    near = np.isfinite(away)
    k, step = k[near], places[near] - axis.xyz[k[near], :2]
    forward = np.sum(step * axis.way[k], axis=1)
    left = axis.way[k, 0] * step[:, 1] - axis.way[k, 1] * step[:, 0]
    # Beyond an end the nearest place is the end itself, with the other ahead or behind of it
    is_beyond = ((k == 0) & (forward < 0.0)) | ((k == len(axis.way) - 1) & (forward > 0.0))
    is_beside = ~is_beyond & (np.abs(left) <= MOST_APART_M)
    return (axis.chainage_m[k] + forward)[is_beside], left[is_beside]
