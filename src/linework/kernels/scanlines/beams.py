"""Sums of beams in cells, from which what each beam is off by is estimated."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray


@njit(cache=True, nogil=True)
def beam_means(
    cell: IntArray, beam: IntArray, value: FloatArray, n_beams: int, least: int
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Return cell, beam, mean and variance of the mean of each beam in each cell, (k,) each.

    Parameters
    ----------
    cell
        (n,) int64: ascending.
    beam
        (n,) int64: below `n_beams`.
    value
        (n,) float64: NaN does not count.
    least
        Fewest values of a beam in a cell.
    """
    n = len(cell)
    cells, beams = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    means, variances = np.empty(n), np.empty(n)
    found, first = 0, 0
    count, total, squares = np.zeros(n_beams, dtype=np.int64), np.zeros(n_beams), np.zeros(n_beams)
    while first < n:
        end = first
        while end < n and cell[end] == cell[first]:
            v = value[end]
            if v == v:
                # From the first value of the cell, so that squares keep their digits
                d = v - value[first] if value[first] == value[first] else v
                count[beam[end]] += 1
                total[beam[end]] += d
                squares[beam[end]] += d * d
            end += 1
        shift = value[first] if value[first] == value[first] else 0.0
        for i in range(first, end):
            b = beam[i]
            if count[b] >= least:
                mean = total[b] / count[b]
                cells[found], beams[found] = cell[first], b
                means[found] = mean + shift
                variances[found] = max(squares[b] / count[b] - mean * mean, 0.0) / count[b]
                found += 1
            count[b], total[b], squares[b] = 0, 0.0, 0.0
        first = end
    return cells[:found], beams[:found], means[:found], variances[:found]
