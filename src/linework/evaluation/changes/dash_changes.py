"""Dashes that are gone or new between two surveys: paint that is worn away, or painted again.

Separate from `epochs`, which compares lines: dashes are counted, not followed.
"""

from __future__ import annotations

import numpy as np
import shapely
from scipy.spatial import cKDTree

from linework.arrays import BoolArray, FloatArray, distance_along
from linework.lines.along import runs_of
from linework.model.lines import LineSet

#: Dashes belong to the marking that runs this near. [m]
_ON_LINE_M = 0.5
#: A single dash may have been missed: changes are of at least two in a row.
_LEAST_IN_A_ROW = 2


def dash_runs(lines: LineSet, other: LineSet) -> list[tuple[int, float, float, int]]:
    """Return where dashes of one survey are missing in the other, although that has the marking and measured it there.

    Parameters
    ----------
    lines, other
        Markings with their dashes (`lane_marking`, `lane_marking_dash`), registered to each other within a metre.

    Returns
    -------
    list of (line, from_m, to_m, n)
        Index of the marking in `lines`, ends of the run along it [m], and number of dashes.
    """
    markings = np.flatnonzero(lines.kind == "lane_marking")
    own, others = (s.take(s.kind == "lane_marking_dash") for s in (lines, other))
    # What is solid in the other survey is another pattern, whose dashes are neither gone nor new
    may_have_dashes = (other.pattern == "") | (np.char.find(other.pattern.astype(str), "dashed") >= 0)
    has_marking = other.take((other.kind == "lane_marking") & may_have_dashes)
    if not len(own) or not len(markings) or not len(has_marking):
        return []
    middle, half = _middles(own)
    is_there = _covered(middle, half, others)
    is_measured = _measured_at(middle, has_marking)
    found = []
    for i in markings.tolist():
        along, away = _place_on(lines[i].xyz[:, :2], middle)
        order = np.flatnonzero(away <= _ON_LINE_M)
        order = order[np.argsort(along[order], kind="stable")]
        for a, b in runs_of(~is_there[order] & is_measured[order]):
            if b - a + 1 >= _LEAST_IN_A_ROW:
                first, last = order[a], order[b]
                found.append(
                    (
                        i,
                        max(float(along[first] - half[first]), 0.0),
                        float(along[last] + half[last]),
                        b - a + 1,
                    )
                )
    return found


def _middles(dashes: LineSet) -> tuple[FloatArray, FloatArray]:
    """Return the middles (n, 2) and half of the lengths (n,) of dashes [m]."""
    ends = np.array([line.xyz[[0, -1], :2] for line in dashes]).reshape(-1, 2, 2)
    return ends.mean(axis=1), 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)


def _covered(middle: FloatArray, half: FloatArray, others: LineSet) -> BoolArray:
    """Return whether a dash of the others overlaps with each, within the metre of an unknown registration."""
    if not len(others):
        return np.zeros(len(middle), dtype=bool)
    there, its_half = _middles(others)
    away, k = cKDTree(there - middle[0]).query(middle - middle[0])
    return np.asarray(away < half + its_half[k])


def _measured_at(middle: FloatArray, markings: LineSet) -> BoolArray:
    """Return whether a marking runs by each place and is not bridged there."""
    measured = np.zeros(len(middle), dtype=bool)
    for i in range(len(markings)):
        xy = markings[i].xyz[:, :2]
        bridged = markings.bridged[markings.offsets[i] : markings.offsets[i + 1]]
        along, away = _place_on(xy, middle)
        vertex = np.clip(np.searchsorted(distance_along(markings[i].xyz), along), 0, len(xy) - 1)
        measured |= (away <= _ON_LINE_M) & ~bridged[vertex]
    return measured


def _place_on(xy: FloatArray, place: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return distance along a line (n, 2) and distance from it of places (k, 2) [m]; infinite for those far off."""
    low, high = xy.min(axis=0) - 2.0 * _ON_LINE_M, xy.max(axis=0) + 2.0 * _ON_LINE_M
    near = np.flatnonzero(np.all((place >= low) & (place <= high), axis=1))
    line, points = shapely.linestrings(xy), shapely.points(place[near])
    away, along = np.full(len(place), np.inf), np.zeros(len(place))
    away[near], along[near] = shapely.distance(line, points), shapely.line_locate_point(line, points)
    return along, away
