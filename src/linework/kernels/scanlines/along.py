"""Places along scan lines: rank, arc length, direction and spacing of the points of each line."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import Float32Array, FloatArray, Int32Array, IntArray

#: A direction is measured over at least this number of points to either side.
_HALF_CHORD_POINTS = 2
#: Beyond the end of another line by more than this, its nearest point lies along a line, not across. [m]
_BEYOND_M = 0.5
#: A chord in plan that is shorter than this share of the chord in space is of a wall: it has no direction in plan.
_STEEP = 0.25


@njit(cache=True, nogil=True)
def place_along_lines(
    order: IntArray, start: IntArray, xyz: FloatArray, leap_m: float, half_chord_m: float
) -> tuple[Int32Array, Float32Array, Float32Array, Float32Array]:
    """Return rank, arc length [m], direction (n, 2) and spacing [m] of each point in its line.

    The direction is a unit vector in plan, forwards in time; NaN where the line stands upright, and at points without
    others near them in the line. The spacing is the distance to the nearer neighbour in the line, NaN without one.

    Parameters
    ----------
    order
        (n,) int64: points of the lines, one line after another, each in its order.
    start
        (m + 1,) int64: where each line begins in `order`.
    xyz
        (N, 3) float64 [m].
    leap_m
        A longer distance between two points of a line is a gap: directions do not reach across. [m]
    half_chord_m
        A direction is measured over this distance to either side, and two points at least. [m]
    """
    n_all = len(xyz)
    rank = np.full(n_all, -1, dtype=np.int32)
    arc = np.full(n_all, np.nan, dtype=np.float32)
    direction = np.full((n_all, 2), np.nan, dtype=np.float32)
    spacing = np.full(n_all, np.nan, dtype=np.float32)
    for line in range(len(start) - 1):
        first, end = start[line], start[line + 1]
        if end == first:
            continue
        travelled, gap = 0.0, np.inf
        run = run_end = first
        for at in range(first, end):
            p = order[at]
            following = np.inf
            if at + 1 < end:
                following = _distance(xyz, p, order[at + 1])
            rank[p] = at - first
            arc[p] = travelled
            nearer = min(gap, following)
            if nearer < np.inf:
                spacing[p] = nearer
            if at > run_end or at == first:
                run = run_end = at
                while run_end + 1 < end and _distance(xyz, order[run_end], order[run_end + 1]) <= leap_m:
                    run_end += 1
            u = order[at - _reach(xyz, order, at, -1, at - run, half_chord_m)]
            v = order[at + _reach(xyz, order, at, 1, run_end - at, half_chord_m)]
            dx, dy = xyz[v, 0] - xyz[u, 0], xyz[v, 1] - xyz[u, 1]
            if np.hypot(dx, dy) > _STEEP * _distance(xyz, u, v):
                direction[p, 0], direction[p, 1] = _unit(dx, dy)
            travelled += 0.0 if following == np.inf else following
            gap = following
    return rank, arc, direction, spacing


@njit(cache=True, nogil=True)
def spacing_to_next(
    order: IntArray,
    start: IntArray,
    xyz: FloatArray,
    time_s: FloatArray,
    direction: Float32Array,
    following: IntArray,
    delay_s: FloatArray,
) -> Float32Array:
    """Return the distance of each point from the next line, across its own line, (N,) float32 [m]; NaN without one.

    Parameters
    ----------
    order, start, xyz
        As in `place_along_lines`.
    direction
        (N, 2) float32: of the line at each point.
    following
        (m, k) int64: lines that may be next to each line; -1: none.
    delay_s
        (m, k) float64 [s]: how much later those lines pass by each point of the line; NaN: unknown.

    Notes
    -----
    The nearest point of the other line is looked for downhill, from the one at the expected time, or where that is not
    known from the one found for the point before: that is a few distances a point. Both directions are given the same distance, so that the first and the last line have one too.
    """
    spacing = np.full(len(xyz), np.nan, dtype=np.float32)
    for line in range(len(start) - 1):
        first, end = start[line], start[line + 1]
        for k in range(following.shape[1]):
            other = following[line, k]
            if other < 0 or start[other + 1] == start[other]:
                continue
            low, high = start[other], start[other + 1] - 1
            at, ahead_at, fresh = low, low, True
            for i in range(first, end):
                p = order[i]
                if delay_s[line, k] == delay_s[line, k]:
                    while ahead_at < high and time_s[order[ahead_at]] < time_s[p] + delay_s[line, k]:
                        ahead_at += 1
                    at = ahead_at
                elif fresh or i == first:
                    interval = max((high - low) // 16, 1)
                    best = np.inf
                    for j in range(low, high + 1, interval):
                        d = _distance(xyz, p, order[j])
                        if d < best:
                            best, at = d, j
                best = _distance(xyz, p, order[at])
                moved = True
                while moved:
                    moved = False
                    for ahead in (-3, -2, -1, 1, 2, 3):
                        j = at + ahead
                        if j < low or j > high:
                            continue
                        d = _distance(xyz, p, order[j])
                        if d < best:
                            best, at, moved = d, j, True
                            break
                q = order[at]
                # Beyond the other line's end the nearest point lies along, not across
                dx, dy = xyz[q, 0] - xyz[p, 0], xyz[q, 1] - xyz[p, 1]
                across = abs(-dx * direction[p, 1] + dy * direction[p, 0])
                along = abs(dx * direction[p, 0] + dy * direction[p, 1])
                fresh = along > 2.0 * across + _BEYOND_M
                if fresh or across != across:
                    continue
                across = np.hypot(across, xyz[q, 2] - xyz[p, 2])
                if not spacing[p] <= across:
                    spacing[p] = across
                if not spacing[q] <= across:
                    spacing[q] = across
    return spacing


@njit(cache=True, nogil=True)
def _reach(xyz: FloatArray, order: IntArray, at: int, sign: int, most: int, half_m: float) -> int:
    """Return how many points on a point at that distance lies, at most `most`; by doubling and halving."""
    n = min(_HALF_CHORD_POINTS, most)
    if n == 0 or _distance(xyz, order[at], order[at + sign * n]) >= half_m:
        return n
    near, far = n, 2 * n
    while far <= most and _distance(xyz, order[at], order[at + sign * far]) < half_m:
        near, far = far, 2 * far
    while far - near > 1:
        middle = (near + far) // 2
        if middle <= most and _distance(xyz, order[at], order[at + sign * middle]) < half_m:
            near = middle
        else:
            far = middle
    return min(far, most)


@njit(cache=True, nogil=True)
def _distance(xyz: FloatArray, i: int, j: int) -> float:
    dx, dy, dz = xyz[i, 0] - xyz[j, 0], xyz[i, 1] - xyz[j, 1], xyz[i, 2] - xyz[j, 2]
    return float(np.sqrt(dx * dx + dy * dy + dz * dz))


@njit(cache=True, nogil=True)
def _unit(x: float, y: float) -> tuple[float, float]:
    length = np.hypot(x, y)
    if length == 0.0:
        return np.nan, np.nan
    return x / length, y / length
