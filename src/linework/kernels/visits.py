"""Points of one place by the visits of the scanner: its passes and its heads see the same paint differently bright."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray

#: Points of a place that lie further apart in time are of two visits [s]: the turns of a scanner follow each other
#: by 0.1 s and less, the second head looks at a place 3 m beside the van about that much later.
APART_S = 0.3
MOST_VISITS = 8


@njit(cache=True, nogil=True)
def split_into_visits(times: FloatArray, n: int, visit: IntArray, spans: FloatArray) -> int:
    """Write the visit of each of n times, return how many there are.

    spans: (8, 2), takes the first and the last time of each. Visits beyond the eighth join the nearest.
    """
    m = 0
    for i in range(n):
        nearest, at = np.inf, -1
        for k in range(m):
            apart = max(spans[k, 0] - times[i], times[i] - spans[k, 1])
            if apart < nearest:
                nearest, at = apart, k
        if nearest > APART_S and m < MOST_VISITS:
            spans[m, 0], spans[m, 1] = times[i], times[i]
            m += 1
        elif at >= 0:
            spans[at, 0], spans[at, 1] = min(spans[at, 0], times[i]), max(spans[at, 1], times[i])
    # What was apart may have met
    k = 0
    while k < m:
        for j in range(k + 1, m):
            if spans[j, 0] - spans[k, 1] <= APART_S and spans[k, 0] - spans[j, 1] <= APART_S:
                spans[k, 0], spans[k, 1] = min(spans[j, 0], spans[k, 0]), max(spans[j, 1], spans[k, 1])
                spans[j, 0], spans[j, 1] = spans[m - 1, 0], spans[m - 1, 1]
                m -= 1
                k = -1
                break
        k += 1
    for i in range(n):
        visit[i] = visit_of(times[i], spans, m)
    return m


@njit(cache=True, nogil=True)
def visit_of(time: float, spans: FloatArray, m: int) -> int:
    """Return the visit whose span is nearest to a time."""
    nearest, at = np.inf, 0
    for k in range(m):
        apart = max(spans[k, 0] - time, time - spans[k, 1])
        if apart < nearest:
            nearest, at = apart, k
    return at


@njit(cache=True, nogil=True)
def dark_level(values: FloatArray) -> tuple[float, float]:
    """Return level and spread of the dark surface among n values, which are put into another order.

    They are those of the normal distribution with the same quantiles: 25 %, and 10 or 40 %, whichever is nearer.
    What is bright (paint, grass beside the road) may be half of the values and moves the level by one spread; what
    is very dark (seams, wet places) a fifth.
    """
    n = len(values)
    middle = smallest(values, int(0.40 * (n - 1) + 0.5))
    quartile = smallest(values, int(0.25 * (n - 1) + 0.5))
    low = smallest(values, int(0.10 * (n - 1) + 0.5))
    # They lie 0.2533, 0.6745 and 1.2816 spreads below the middle of the distribution
    spread = min((quartile - low) / 0.6071, (middle - quartile) / 0.4212)
    return quartile + 0.6745 * spread, spread


@njit(cache=True, nogil=True)
def smallest(values: FloatArray, k: int) -> float:
    """Return the k-th smallest value (from 0) by Hoare's selection; those before it come to stand before it."""
    low, high = 0, len(values) - 1
    while low < high:
        pivot = values[(low + high) >> 1]
        i, j = low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if k <= j:
            high = j
        elif k >= i:
            low = i
        else:
            break
    return float(values[k])
