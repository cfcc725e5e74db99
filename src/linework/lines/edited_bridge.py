"""The way of a line over a gap: beside a line that goes on there, or else as the ends lead."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.model.lines import LineSet

#: Places over a gap are so far apart; a shorter gap has none. [m]
STATION_M = 2.0
#: Lines of one road run beside one another within this. [m]
BESIDE_M = 15.0
#: A line is beside another where the distance changes by no more than this, and by so much of the gap.
DRIFT_M, DRIFT_SHARE = 0.20, 0.01
#: A line's direction is taken over this. [m]
_OVER_M = 5.0
#: Kinds that run along the road.
_ALONG = ("lane_marking", "road_boundary", "guardrail", "barrier")


def bridge(head: FloatArray, tail: FloatArray, others: LineSet) -> FloatArray:
    """Return places (k, 3) between the last vertex of a line and the first of the one that goes on there.

    Parameters
    ----------
    head, tail
        (n, 3) of the two lines, in one direction.
    others
        Lines of the same road: the one whose distance changes least from end to end is followed, since the lines of
        a road run beside one another. Without one, a curve of evenly changing direction leads from end to end.
    """
    gap_m = float(np.hypot(*(tail[0, :2] - head[-1, :2])))
    if gap_m < 1.5 * STATION_M:
        return np.zeros((0, 3))
    beside = [
        found
        for i in np.flatnonzero(np.isin(others.kind, _ALONG)).tolist()
        if (found := _beside(others.line(i), head[-1], tail[0], gap_m)) is not None
    ]
    if beside:
        return min(beside, key=lambda one: one[0])[1]
    return _curve(head, tail, gap_m)


def _beside(
    line: FloatArray, start: FloatArray, end: FloatArray, gap_m: float
) -> tuple[float, FloatArray] | None:
    """Return how much the distance to a line changes over a gap, and the places beside it; None where it is not there."""
    low, high = line[:, :2].min(axis=0) - BESIDE_M, line[:, :2].max(axis=0) + BESIDE_M
    if any(np.any(place[:2] < low) or np.any(place[:2] > high) for place in (start, end)):
        return None
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T))])
    a, b = (foot_along(line, along, place) for place in (start, end))
    if not (min(a, b) > 0.0 and max(a, b) < along[-1] and 0.7 * gap_m <= abs(b - a) <= 1.5 * gap_m):
        return None
    at = np.linspace(a, b, max(int(abs(b - a) / STATION_M), 2) + 1)
    foot, left = places_on(line, along, at)
    off = [float((place[:2] - foot[k, :2]) @ left[k]) for k, place in ((0, start), (-1, end))]
    drift = abs(off[1] - off[0])
    if max(abs(v) for v in off) > BESIDE_M or drift > DRIFT_M + DRIFT_SHARE * gap_m:
        return None
    share = np.linspace(0.0, 1.0, len(at))
    # What is left between line and place at both ends, across, along and up, goes over evenly from one to the other
    places = foot.copy()
    places[:, :2] += (off[0] + share * (off[1] - off[0]))[:, None] * left
    rest = np.stack([start - places[0], end - places[-1]])
    places += (1.0 - share)[:, None] * rest[0] + share[:, None] * rest[1]
    return drift, places[1:-1]


def foot_along(line: FloatArray, along: FloatArray, place: FloatArray) -> float:
    """Return how far along a line its point nearest to a place is."""
    a, way = line[:-1, :2], np.diff(line[:, :2], axis=0)
    size2 = np.maximum(np.sum(way * way, axis=1), 1e-12)
    share = np.clip(np.sum((place[:2] - a) * way, axis=1) / size2, 0.0, 1.0)
    i = int(np.argmin(np.hypot(*(a + share[:, None] * way - place[:2]).T)))
    return float(along[i] + share[i] * (along[i + 1] - along[i]))


def places_on(line: FloatArray, along: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return places (k, 3) on a line, and unit vectors (k, 2) to the left of where `at` leads."""
    place = np.stack([np.interp(at, along, column) for column in line.T], axis=1)
    sign = 1.0 if at[-1] >= at[0] else -1.0
    half = 0.5 * _OVER_M
    ends = [np.stack([np.interp(at + d, along, c) for c in line[:, :2].T], axis=1) for d in (-half, half)]
    way = sign * (ends[1] - ends[0])
    way /= np.maximum(np.hypot(*way.T), 1e-9)[:, None]
    return place, np.stack([-way[:, 1], way[:, 0]], axis=1)


def _curve(head: FloatArray, tail: FloatArray, gap_m: float) -> FloatArray:
    """Return places on the cubic curve (Hermite) that leaves one line and enters the other in their directions."""
    n = int(np.ceil(gap_m / STATION_M))
    t = (np.arange(1, n) / n)[:, None]
    start, end = head[-1], tail[0]
    out = gap_m * _way(head[::-1]) * -1.0
    into = gap_m * _way(tail)
    place = (2 * t**3 - 3 * t**2 + 1) * start + (3 * t**2 - 2 * t**3) * end
    place[:, :2] += (t**3 - 2 * t**2 + t) * out + (t**3 - t**2) * into
    return np.asarray(place)


def _way(xyz: FloatArray) -> FloatArray:
    """Return the direction (2,) of a line's first metres."""
    away = np.hypot(*(xyz[:, :2] - xyz[0, :2]).T)
    inner = int(np.argmax(away >= min(_OVER_M, float(away.max()))))
    return np.asarray((xyz[inner, :2] - xyz[0, :2]) / max(float(away[inner]), 1e-9))
