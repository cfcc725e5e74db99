"""The bend of a kerb within a long window: how far its ends lie beside its middle, and the points unbent.

Separate from `steps`, which measures a straight step: round a corner of 10 m radius the ends of 4 m of kerb lie 20 cm
beside its middle, and a straight step lies a third of that beside it.

Frame and points as in `linework.kernels.boundaries.profiles`; the carriageway is at positive v.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.boundaries.kerbs.sides import measure_seen_step
from linework.kernels.boundaries.kerbs.steps import (
    CLEAREST_VX,
    CLEAREST_VY,
    STEP_FLOOR_A,
    STEP_FLOOR_B,
    STEP_FLOOR_C,
    STEP_FOOT,
    STEP_NOISE,
    STEP_NOISE_TOP,
    STEP_SIGMA_V,
    STEP_TOP,
    STEP_TOP_A,
    STEP_TOP_C,
    STEP_VX,
    STEP_VY,
)
from linework.kernels.boundaries.profiles import CLIP_M, PLACE_R, PLACE_X, PLACE_Y

#: Standard deviation of the curvature of kerbs: at corners of streets they have radii of 6 m and more, which are two of
#: it. [1/m]
CURVATURE_SIGMA = 1.0 / 12.0
#: Curvatures that are tried, in standard deviations.
BENDS_TRIED = np.arange(-2.5, 2.6, 0.25)
#: Share of windows in which a kerb is taken for straight before it is measured: as likely as not.
STRAIGHT_SHARE = 0.5
#: A point counts for floor or top by no more than this many noise variances: strays are neither.
MOST_DECIDED = 9.0
#: Places of the change from floor to top are tried this far to either side [m], at this many places.
BEND_REACH_M, N_BEND = 0.24, 48
#: Mean of (u / half length)^2 over a window.
MEAN_SQUARE = 1.0 / 3.0


@njit(cache=True, nogil=True)
def follow_bend(
    work: FloatArray, n: int, first: FloatArray, scale: float, half_u: float, step: FloatArray
) -> None:
    """Measure a step in a long window again with its bend taken out, and move it to where it is in the middle.

    The standard deviation of the foot takes in that of the bend. What cannot be measured once it is unbent stays straight.

    Parameters
    ----------
    work
        (n or more, 4): points, see `linework.kernels.boundaries.profiles.gather_at`; unbent by this.
    first, scale, half_u
        As for `linework.kernels.boundaries.kerbs.steps.measure_step`.
    step
        (19,) input and output: as measured straight, and again.
    """
    bend_m, sigma_m = bend_of(work, n, step, half_u)
    straight = step.copy()
    unbend(work, n, straight, bend_m, half_u)
    first[CLEAREST_VX], first[CLEAREST_VY] = step[STEP_VX], step[STEP_VY]
    if not measure_seen_step(work, n, first, scale, half_u, step):
        step[:] = straight
        bend_m, sigma_m = 0.0, np.hypot(sigma_m, bend_m)
    # In the middle of the window a bent kerb lies beside the mean of it
    step[STEP_FOOT] -= MEAN_SQUARE * bend_m
    step[STEP_TOP] -= MEAN_SQUARE * bend_m
    step[STEP_SIGMA_V] = np.hypot(step[STEP_SIGMA_V], MEAN_SQUARE * sigma_m)


@njit(cache=True, nogil=True)
def bend_of(work: FloatArray, n: int, step: FloatArray, half_u: float) -> tuple[float, float]:
    """Return how far the ends of a measured step lie beside its middle, along v, and the standard deviation of that [m].

    By the curvature that best separates points of the floor from points of the top: mean and standard deviation over
    the likelihoods of all that are tried.

    Parameters
    ----------
    work
        (n or more, 4): points, see `linework.kernels.boundaries.profiles.gather_at`.
    step
        (19,): see `linework.kernels.boundaries.kerbs.steps.measure_step`.
    half_u
        Half of the length of the window. [m]
    """
    vx, vy = step[STEP_VX], step[STEP_VY]
    about = 0.5 * (step[STEP_FOOT] + step[STEP_TOP])
    square = 0.5 * (step[STEP_NOISE] ** 2 + step[STEP_NOISE_TOP] ** 2)
    end_m = 0.5 * CURVATURE_SIGMA * half_u**2
    n_tried = len(BENDS_TRIED)
    cost = np.zeros((n_tried, N_BEND + 1))
    for i in range(n):
        x, y = work[i, PLACE_X], work[i, PLACE_Y]
        v, u = x * vx + y * vy, x * vy - y * vx
        if abs(u) > half_u or abs(work[i, PLACE_R]) > CLIP_M:
            continue
        r = work[i, PLACE_R] - step[STEP_FLOOR_B] * u
        low = r - step[STEP_FLOOR_A] - step[STEP_FLOOR_C] * v
        high = r - step[STEP_TOP_A] - step[STEP_TOP_C] * v
        rise = low - high
        low, high = min(max(low, -rise), 2.0 * rise), min(max(high, -2.0 * rise), rise)
        of_top = min(max((high * high - low * low) / square, -MOST_DECIDED), MOST_DECIDED)
        bent = (u / half_u) ** 2 - MEAN_SQUARE
        for j in range(n_tried):
            off = v - about - BENDS_TRIED[j] * end_m * bent
            k = int(np.floor((off + BEND_REACH_M) / (2.0 * BEND_REACH_M) * N_BEND)) + 1
            # Points beyond the places that are tried are on one side of all of them
            if k <= N_BEND:
                cost[j, max(k, 0)] += of_top
    least = np.empty(n_tried)
    for j in range(n_tried):
        best = total = cost[j, 0]
        for k in range(1, N_BEND + 1):
            total += cost[j, k]
            best = min(best, total)
        least[j] = best
    prior = np.exp(-0.5 * BENDS_TRIED**2)
    middle = n_tried // 2
    prior[middle] = 0.0
    prior *= (1.0 - STRAIGHT_SHARE) / np.sum(prior)
    prior[middle] = STRAIGHT_SHARE
    weight = prior * np.exp(-0.5 * (least - np.min(least)))
    weight /= np.sum(weight)
    mean = np.sum(weight * BENDS_TRIED)
    spread = np.sqrt(np.sum(weight * (BENDS_TRIED - mean) ** 2))
    return float(mean * end_m), float(spread * end_m)


@njit(cache=True, nogil=True)
def unbend(work: FloatArray, n: int, step: FloatArray, bend_m: float, half_u: float) -> None:
    """Move the points of a place along v so that a step with this bend is straight, at the mean of the bent one.

    Parameters as for `bend_of`; bend_m: see there.
    """
    vx, vy = step[STEP_VX], step[STEP_VY]
    for i in range(n):
        u = work[i, PLACE_X] * vy - work[i, PLACE_Y] * vx
        moved = bend_m * ((u / half_u) ** 2 - MEAN_SQUARE)
        work[i, PLACE_X] -= moved * vx
        work[i, PLACE_Y] -= moved * vy
