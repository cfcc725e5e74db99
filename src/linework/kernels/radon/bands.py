"""Kernels that take a cross-section apart: the bands of heights that hold points, and where across their rows lie.

Sections are counts of points in cells, whole numbers: their sums are exact in whatever order they are made.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray

#: Deepest gap inside a band of few points, after densities are averaged over as much: the spacing of the rays on a face a
#: few metres off. [cells]
GAP_CELLS = 3
#: Points of the densest cells from which on a cell that holds a fifth of them is not one by chance: 3 of 15 expected.
DENSE_POINTS = 15.0
#: Bands end where their density falls below this share of the densest 8 cm.
BAND_SHARE = 0.2
#: Fewest points of a section: at fewer a band cannot be told from its gaps.
_LEAST_POINTS = 60
#: A band with a smaller share of the points is what stands behind: posts, twigs.
_LEAST_SHARE = 0.06


@njit(cache=True, nogil=True)
def bands_of_rows(counts: FloatArray, first: int) -> IntArray:
    """Return the bands of rows with points, (k, 2) int64 from the lowest up: first row, and the one after the last.

    Parameters
    ----------
    counts
        (heights, widths) points of a section, of at least 8 heights.
    first
        Rows before this one do not count: ground and grass.
    """
    n = len(counts)
    bands, number = np.empty((n, 2), np.int64), np.zeros(n)
    for r in range(first, n):
        number[r] = counts[r].sum()
    total = number.sum()
    if total < _LEAST_POINTS:
        return bands[:0]
    density, gap, reference = number, 1, _densest(number)
    if reference < DENSE_POINTS:
        # Too few for gaps to mean anything in one cell; averages reach one cell farther than the points
        density, gap = np.zeros(n), GAP_CELLS
        for r in range(n):
            for near in range(max(r - GAP_CELLS // 2, 0), min(r + GAP_CELLS // 2 + 1, n)):
                density[r] += number[near] * (1.0 / GAP_CELLS)
        reference = _densest(density)
    k, filled, last = 0, 0, 0
    for r in range(n + 1):
        is_dense = r < n and density[r] >= BAND_SHARE * reference and number[r] > 0.0
        if filled > 0 and (r == n or (is_dense and r - last > gap + 1)):
            bands[k, 1] = last + 1
            is_band = filled > 1 and number[bands[k, 0] : last + 1].sum() >= _LEAST_SHARE * total
            k, filled = k + int(is_band), 0
        if is_dense:
            if filled == 0:
                bands[k, 0] = r
            filled, last = filled + 1, r
    return bands[:k]


@njit(cache=True, nogil=True)
def _densest(density: FloatArray) -> float:
    """Return the mean of the eight densest rows (8 cm, of which the ropes of a cable barrier fill as many)."""
    v = np.sort(density)[-8:]
    # In numpy's order of sums
    total: float = ((v[0] + v[1]) + (v[2] + v[3])) + ((v[4] + v[5]) + (v[6] + v[7]))
    return total / 8.0


@njit(cache=True, nogil=True)
def fold_of_rows(counts: FloatArray, u: FloatArray, most: float) -> float:
    """Return the standard deviation of where rows of points lie across, less what the noise of their points makes. [m].

    Parameters
    ----------
    counts
        (heights, widths) points of a band.
    u
        (widths,) middle of each column. [m]
    most
        Points within this distance of the band's median across count. [m]
    """
    columns = np.zeros((1, len(u)))
    for row in counts:
        columns[0] += row
    near = np.abs(u - middles_of_rows(columns, u)[0]) <= most
    number, mean = np.zeros(len(counts)), np.zeros(len(counts))
    total, squares, k = 0.0, 0.0, 0
    within, about = 0.0, 0.0
    for r in range(len(counts)):
        first, second = 0.0, 0.0
        for c in range(len(u)):
            if near[c]:
                number[r] += counts[r, c]
                first += counts[r, c] * u[c]
                second += counts[r, c] * u[c] ** 2
        if number[r] > 0.0:
            mean[r] = first / number[r]
            within += second - number[r] * mean[r] ** 2
            about += number[r] * mean[r]
            total += number[r]
            k += 1
    if total <= k:
        return 0.0
    within /= total - k
    for r in range(len(counts)):
        squares += number[r] * (mean[r] - about / total) ** 2
    return math.sqrt(max((squares - (k - 1) * within) / total, 0.0))


@njit(cache=True, nogil=True)
def middles_of_rows(counts: FloatArray, u: FloatArray) -> FloatArray:
    """Return the median across (heights,) of the points (heights, widths) of each row; NaN where there are none. [m].

    `u` (widths,) are the middles of the columns. [m]
    """
    middles = np.full(len(counts), np.nan)
    for r in range(len(counts)):
        total = counts[r].sum()
        if total > 0.0:
            before, c = counts[r, 0], 0
            while before < 0.5 * total:
                c += 1
                before += counts[r, c]
            middles[r] = u[c]
    return middles


@njit(cache=True, nogil=True)
def number_near(counts: FloatArray, u: FloatArray, places: FloatArray, most: float) -> tuple[float, float]:
    """Return the number of points (heights, widths) within `most` [m] of the place (heights,) of their row, and of all.

    `u` (widths,) are the middles of the columns, in metres as the places are.
    """
    near, total = 0.0, 0.0
    for r in range(len(counts)):
        for c in range(len(u)):
            total += counts[r, c]
            if abs(u[c] - places[r]) <= most:
                near += counts[r, c]
    return near, total
