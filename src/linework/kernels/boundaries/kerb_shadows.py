"""Stretches of floor beyond a kerb that a scanner above it cannot reach: shadows of kerbs.

Separate from `kerb_steps`, which measures the step: this one looks for what is missing behind it.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.boundaries.profiles import CLIP_M, PLACE_R, PLACE_X, PLACE_Y, PROFILE_BIN_M

#: Bins of a profile in which a shadow is sought: those over the top, all, and how far from the step it may begin; fewest
#: that are a shadow, 10 cm (a scanner's lines may leave less between them); and points that are expected in it, exp(-10)
#: being the chance that none is there.
SHADOW_TOP_BINS, N_SHADOW_BINS, SHADOW_OFF_BINS, LEAST_SHADOW_BINS, POINTS_IN_SHADOW = 30, 75, 25, 5, 10.0
#: Directions tried about that of the step, from coarse to fine: any that passes through the shadow separates floor and top
#: as well, 20 degrees to either side of 0.4 m of shadow over a metre. [rad]
SHADOW_TURNS = (np.deg2rad(np.arange(-40.0, 41.0, 8.0)), np.deg2rad(np.arange(-6.0, 7.0, 1.5)))
#: Largest share of the expected points in 10 cm of a profile that may cross a shadow askew.
SPARSE = 0.6


@njit(cache=True, nogil=True)
def shadow_behind(
    work: FloatArray, n: int, frame: tuple[float, float], reach: tuple[float, float]
) -> tuple[float, float, float, float]:
    """Return the unit vector v across the shadow of the step at v = 0, its upper edge v, and its length [m]; 0: none.

    Seen from above a kerb, the floor at its foot has no points between the last ones of the top and the first ones
    beyond the shadow, which chance leaves where points are few. Seen from the floor there is no such stretch. The
    direction is the one in which it is longest.

    Parameters
    ----------
    work
        (n or more, 4): points, see `linework.kernels.boundaries.profiles.gather_at`.
    frame
        Unit vector v to begin with.
    reach
        Radius of the search area divided by the usual radius; half of the length along u that is used [m].
    """
    counts = np.zeros(N_SHADOW_BINS)
    _count_across(work, n, frame, reach, counts)
    if not _is_sparse(counts):
        return frame[0], frame[1], 0.0, 0.0
    vx, vy = frame
    edge, best = 0.0, 0
    for turns in SHADOW_TURNS:
        x0, y0, sum_x, sum_y, edges, found = vx, vy, 0.0, 0.0, 0.0, 0.0
        for turn in turns:
            x, y = x0 * np.cos(turn) - y0 * np.sin(turn), x0 * np.sin(turn) + y0 * np.cos(turn)
            _count_across(work, n, (x, y), reach, counts)
            first, length = _empty_bins(counts)
            if length > best:
                best, sum_x, sum_y, edges, found = length, x, y, first, 1.0
            elif length == best and length > 0:
                # The middle of the directions in which it is as long
                sum_x, sum_y, edges, found = sum_x + x, sum_y + y, edges + first, found + 1.0
        size = np.hypot(sum_x, sum_y)
        if found > 0.0 and size > 0.0:
            vx, vy, edge = sum_x / size, sum_y / size, edges / found
    if best < LEAST_SHADOW_BINS:
        return frame[0], frame[1], 0.0, 0.0
    step = PROFILE_BIN_M * reach[0]
    return vx, vy, (edge - SHADOW_TOP_BINS) * step, best * step


@njit(cache=True, nogil=True)
def _count_across(
    work: FloatArray, n: int, frame: tuple[float, float], reach: tuple[float, float], counts: FloatArray
) -> None:
    """Count the points in the bins of a profile; parameters as for `shadow_behind`, counts: (`N_SHADOW_BINS`,) output."""
    scale, half_u = reach
    vx, vy = frame
    step = PROFILE_BIN_M * scale
    counts[:] = 0.0
    for i in range(n):
        x, y = work[i, PLACE_X], work[i, PLACE_Y]
        v, u = x * vx + y * vy, x * vy - y * vx
        k = int(np.floor(v / step)) + SHADOW_TOP_BINS
        if 0 <= k < N_SHADOW_BINS and abs(u) <= half_u and abs(work[i, PLACE_R]) <= CLIP_M:
            counts[k] += 1.0


@njit(cache=True, nogil=True)
def _is_sparse(counts: FloatArray) -> bool:
    """Return whether 10 cm of a profile near the step hold fewer points than the rest, as where a shadow lies askew."""
    usual = np.median(counts)
    for k in range(SHADOW_TOP_BINS - SHADOW_OFF_BINS, SHADOW_TOP_BINS + SHADOW_OFF_BINS - LEAST_SHADOW_BINS):
        if np.mean(counts[k : k + LEAST_SHADOW_BINS]) <= SPARSE * usual:
            return True
    return False


@njit(cache=True, nogil=True)
def _empty_bins(counts: FloatArray) -> tuple[int, int]:
    """Return the first of the longest run of empty bins near the step, and how many; 0 where others explain them.

    Few points leave bins empty by chance, and scan lines along the kerb leave runs between them that are as long elsewhere.
    """
    low, high = 0, N_SHADOW_BINS
    while low < high and counts[low] == 0.0:
        low += 1
    while high > low and counts[high - 1] == 0.0:
        high -= 1
    first, length, run, other = 0, 0, 0, 0
    for k in range(low, high):
        run = run + 1 if counts[k] == 0.0 else 0
        if run > length and abs(k - run + 1 - SHADOW_TOP_BINS) <= SHADOW_OFF_BINS:
            first, length = k - run + 1, run
    beyond = first + length
    if length == 0 or first < LEAST_SHADOW_BINS or beyond + LEAST_SHADOW_BINS > N_SHADOW_BINS:
        return 0, 0
    for k in range(low, high):
        run = run + 1 if counts[k] == 0.0 and not first <= k < beyond else 0
        other = max(other, run)
    beside = min(
        np.mean(counts[beyond : beyond + LEAST_SHADOW_BINS]),
        np.mean(counts[first - LEAST_SHADOW_BINS : first]),
    )
    return (first, length) if length * beside >= POINTS_IN_SHADOW and 2 * other <= length else (0, 0)
