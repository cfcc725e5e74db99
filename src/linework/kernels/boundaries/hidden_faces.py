"""Where floor and top of a step meet if no point lies on its face: too few points, or a shadow behind the top's edge.

Frame and points as in `linework.kernels.boundaries.profiles`; the carriageway is at positive v.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.boundaries.profiles import PLACE_R, PLACE_X, PLACE_Y

#: Where no face is visible, the change from floor to top is sought this far to either side [m], at this many places.
CHANGE_REACH_M, N_CHANGE = 0.08, 32
#: Seen from above, a step hides the floor behind it: a step of 15 cm over 0.6 m from 10 m away, 2.5 m up. As many places a
#: metre as above; the top shows over this many of them how far its points are apart. [m, -]
SHADOW_REACH_M, N_SHADOW, N_TOP_SEEN = 0.40, 160, 60
#: A stretch without points is a shadow if it is this many times as long as any on the top beside it, and at least this
#: many places long (2 cm). [-]
SHADOW_RUNS, LEAST_SHADOW = 2, 4
#: Slopes that are tried for the end of a surface, in a frame that the shadow leaves open; fewest points that show it; and
#: the width over which its points are counted [m].
LAST_SLOPES, LEAST_LAST, LAST_WIDTH_M = np.linspace(-0.56, 0.56, 57), 8, 0.30
#: By how many mean distances of its points the line of `last_points` lies inside of the end: 2.9 to 3.1 for 10 to 80
#: random points.
INSIDE = 3.0
#: Standard deviations of that line's v at u = 0, and of its slope for points up to 1 m along u, in such distances: 1.1 to
#: 1.8, and 6 to 10, for the same points.
END_SIGMA, SLOPE_SIGMA = 1.7, 5.0


@njit(cache=True, nogil=True)
def change_over(
    work: FloatArray,
    n: int,
    frame: tuple[float, float],
    floor: tuple[float, float, float],
    top: tuple[float, float],
    about: float,
    reach: tuple[float, float],
) -> tuple[float, float]:
    """Return the v that best separates points of the floor from points of the top, and their spacing there [m].

    frame: unit vector v. floor: height, slopes along u and v. top: height, slope along v. about: v to begin with.
    reach: `scale` and `half_u` of `best_step`.
    """
    scale, half_u = reach
    half = CHANGE_REACH_M * scale
    first, last, seen = _changes(work, n, frame, floor, top, (about, half, half_u), N_CHANGE)
    at = about - half + half * (first + last) / N_CHANGE
    return at, 2.0 * half / max(np.sum(seen), 2.0)


@njit(cache=True, nogil=True)
def end_of_top(
    work: FloatArray,
    n: int,
    frame: tuple[float, float],
    floor: tuple[float, float, float],
    top: tuple[float, float],
    about: float,
    reach: tuple[float, float],
) -> tuple[float, float, float]:
    """Return the v at which the top ends where it hides what is behind it, its slope v / u, and the points' spacing.

    Infinity and zeros where nothing is hidden [m]. Parameters as for `change_over`.
    """
    scale, half_u = reach
    half = SHADOW_REACH_M * scale
    vx, vy = frame
    points, m = np.empty((n, 2)), 0
    for i in range(n):
        x, y = work[i, PLACE_X], work[i, PLACE_Y]
        v, u = x * vx + y * vy, x * vy - y * vx
        if abs(v - about) > half or abs(u) > half_u:
            continue
        r = work[i, PLACE_R] - floor[1] * u
        if abs(r - top[0] - top[1] * v) < abs(r - floor[0] - floor[2] * v):
            points[m, 0], points[m, 1] = u, -v
            m += 1
    end, slope, spacing = last_points(points[:m])
    if m < LEAST_LAST:
        return np.inf, 0.0, 0.0
    # In the direction of that end: is there nothing behind it, over more than points of the top are apart?
    size = np.sqrt(1.0 + slope * slope)
    turned = (vx + slope * vy) / size, (vy - slope * vx) / size
    window = (-end / size, half, half_u)
    first, last, seen = _changes(work, n, turned, floor, top, window, N_SHADOW)
    # On rings and scan lines along it, they leave stretches bare as well
    run = longest = 0
    for k in range(max(first - N_TOP_SEEN, 0), first):
        run = run + 1 if seen[k] == 0.0 else 0
        longest = max(longest, run)
    if last - first < max(SHADOW_RUNS * longest, LEAST_SHADOW):
        return np.inf, 0.0, 0.0
    return -end, -slope, spacing


@njit(cache=True, nogil=True)
def last_points(points: FloatArray) -> tuple[float, float, float]:
    """Return where a surface ends at low v: v at u = 0, slope v / u and the mean distance of its points along v.

    Of the lines that leave but one point, a stray, below them, the end is the one that reaches farthest up, less by how far
    it lies inside (random points).

    Parameters
    ----------
    points
        (m, 2) u and v of its points [m]; fewer than `LEAST_LAST`: infinity and zeros.
    """
    m = len(points)
    if m < LEAST_LAST:
        return np.inf, 0.0, 0.0
    best, at = -np.inf, 0.0
    for slope in LAST_SLOPES:
        low = second = np.inf
        for i in range(m):
            v = points[i, 1] - slope * points[i, 0]
            if v < low:
                low, second = v, low
            elif v < second:
                second = v
        if second > best:
            best, at = second, slope
    count = 0.0
    for i in range(m):
        off = points[i, 1] - at * points[i, 0] - best
        if 0.0 <= off < LAST_WIDTH_M:
            count += 1.0
    spacing = LAST_WIDTH_M / max(count, 1.0)
    return best - INSIDE * spacing, at, spacing


@njit(cache=True, nogil=True)
def _changes(
    work: FloatArray,
    n: int,
    frame: tuple[float, float],
    floor: tuple[float, float, float],
    top: tuple[float, float],
    window: tuple[float, float, float],
    n_places: int,
) -> tuple[int, int, FloatArray]:
    """Return the first and last place that best separates points of the top from those of the floor, and all points.

    Parameters
    ----------
    frame, floor, top
        As for `change_over`.
    window
        v of the middle, reach to either side and along u. [m]
    n_places
        Number of places, from low v to high v.

    Returns
    -------
    first, last
        0 to `n_places`: points lie at the same side of all places from the first to the last.
    seen
        (n_places,) number of points between each place and the next.
    """
    about, half, half_u = window
    vx, vy = frame
    floor_a, floor_b, floor_c = floor
    top_a, top_c = top
    cost, seen = np.zeros(n_places + 1), np.zeros(n_places)
    for i in range(n):
        x, y = work[i, PLACE_X], work[i, PLACE_Y]
        v, u = x * vx + y * vy, x * vy - y * vx
        k = int(np.floor((v - about + half) / (2.0 * half) * n_places))
        if k < 0 or k >= n_places or abs(u) > half_u:
            continue
        r = work[i, PLACE_R] - floor_b * u
        low, high = r - floor_a - floor_c * v, r - top_a - top_c * v
        rise = low - high
        # A point below the floor or above the top shows only which side it is on
        low, high = min(max(low, -rise), 2.0 * rise), min(max(high, -2.0 * rise), rise)
        cost[k + 1] += high * high - low * low
        seen[k] += 1.0
    # Points with v below the change belong to the top: running cost of that, and all places of least cost
    best, first, last = 0.0, 0, 0
    for k in range(1, n_places + 1):
        cost[k] += cost[k - 1]
        if cost[k] < best:
            best, first, last = cost[k], k, k
        elif cost[k] == best and k == last + 1:
            last = k
    return first, last, seen
