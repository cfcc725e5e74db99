"""Sums over a few stations about each, of many lines that lie one after the other."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray


@njit(cache=True, nogil=True)
def moving_sums(values: FloatArray, offsets: IntArray, half: int) -> FloatArray:
    """Return (n, m) the sums over the station itself and `half` on either side, line by line.

    Line i has the stations from offsets[i] to offsets[i + 1]; beyond its ends there is nothing. From
    cumulative sums along each line: counts add up exactly, whatever lies before them.
    """
    n, m = values.shape
    out, total = np.empty((n, m)), np.zeros((n + 1, m))
    for i in range(len(offsets) - 1):
        begin, stop = offsets[i], offsets[i + 1]
        length = stop - begin
        total[0] = 0.0
        for k in range(length):
            for j in range(m):
                total[k + 1, j] = total[k, j] + values[begin + k, j]
        for k in range(length):
            high, low = min(k + half + 1, length), max(k - half, 0)
            for j in range(m):
                out[begin + k, j] = max(total[high, j] - total[low, j], 0.0)
    return out
