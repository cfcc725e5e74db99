"""Kernels that open heights of cells: lowest and highest values within square windows, and slopes from lower cells."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import BoolArray, Float32Array, IntArray

#: Known cells around one of which is said that it stands alone.
_LEAST_AROUND = 3


@njit(cache=True, nogil=True)
def opened(z: Float32Array, n: int) -> Float32Array:
    """Return the opening (n_rows, n_cols) by a window of 2 n + 1: nothing narrower than that stays.

    Windows about unknown cells, which are infinite, do not count.
    """
    inf = np.float32(np.inf)
    low = -_highest_within(-z, n)
    for r in range(z.shape[0]):
        for c in range(z.shape[1]):
            low[r, c] = low[r, c] if z[r, c] < inf else -inf
    high = _highest_within(low, n)
    for r in range(z.shape[0]):
        for c in range(z.shape[1]):
            high[r, c] = high[r, c] if high[r, c] > -inf else inf
    return high


@njit(cache=True, nogil=True)
def _highest_within(z: Float32Array, n: int) -> Float32Array:
    """Return the highest value within n rows and columns of each, in windows that double."""
    n_rows, n_cols = z.shape
    one, other = z.copy(), np.empty_like(z)
    done = 0
    while done < n:
        step = min(n - done, 2 * done + 1)
        for r in range(n_rows):
            here, to = one[r], other[r]
            above, below = one[max(r - step, 0)], one[min(r + step, n_rows - 1)]
            for c in range(n_cols):
                most = here[c] if here[c] > above[c] else above[c]
                to[c] = most if most > below[c] else below[c]
        one, other = other, one
        done += step
    done = 0
    while done < n:
        step = min(n - done, 2 * done + 1)
        for r in range(n_rows):
            here, to = one[r], other[r]
            for c in range(n_cols):
                to[c] = here[c]
            for c in range(n_cols - step):
                to[c] = to[c] if to[c] > here[c + step] else here[c + step]
            for c in range(step, n_cols):
                to[c] = to[c] if to[c] > here[c - step] else here[c - step]
        one, other = other, one
        done += step
    return one


@njit(cache=True, nogil=True)
def without_pits(z: Float32Array, depth: float) -> Float32Array:
    """Return heights (n_rows, n_cols) float32 in which no cell stands alone below the eight around it. [m].

    A cell that is more than `depth` [m] below all known ones around it but one, which differ by no more from each other,
    gets the height of the second lowest. With fewer than three around it, it stays. Empty cells are infinite.
    """
    n_rows, n_cols = z.shape
    out = z.copy()
    inf = np.float32(np.inf)
    for r in range(n_rows):
        for c in range(n_cols):
            here = z[r, c]
            if here == inf:
                continue
            first, second, highest = inf, inf, -inf
            n = 0
            for i in range(max(r - 1, 0), min(r + 2, n_rows)):
                for j in range(max(c - 1, 0), min(c + 2, n_cols)):
                    other = z[i, j]
                    if other == inf or (i == r and j == c):
                        continue
                    n += 1
                    highest = max(highest, other)
                    if other < first:
                        first, second = other, first
                    elif other < second:
                        second = other
            if n >= _LEAST_AROUND and second - here > depth and highest - second <= depth:
                out[r, c] = second
    return out


@njit(cache=True, nogil=True)
def supported_cells(
    height: Float32Array, is_thin: BoolArray, reach: int, rise: float, step: float, least: int
) -> BoolArray:
    """Return which cells are known and not thin, or thin and continued by those around.

    Parameters
    ----------
    height
        (n_rows + 2 r, n_cols + 2 r) float32, with a halo of r = `reach` cells; NaN in empty cells. [m]
    is_thin
        The same shape, bool: of a few points.
    reach, rise, step
        A cell continues another within so many rows and columns if it differs by at most `rise` for each cell between
        their middles, and a step. [cells], [m], [m]
    least
        Cells that continue a thin one.

    Returns
    -------
    is_supported
        (n_rows, n_cols) bool.
    """
    n_rows, n_cols = height.shape[0] - 2 * reach, height.shape[1] - 2 * reach
    out = np.zeros((n_rows, n_cols), dtype=np.bool_)
    for r in range(n_rows):
        for c in range(n_cols):
            here = height[r + reach, c + reach]
            if np.isnan(here) or not is_thin[r + reach, c + reach]:
                out[r, c] = not np.isnan(here)
                continue
            n = 0
            for i in range(-reach, reach + 1):
                for j in range(-reach, reach + 1):
                    other = height[r + reach + i, c + reach + j]
                    if (i != 0 or j != 0) and abs(other - here) <= rise * np.sqrt(i * i + j * j) + step:
                        n += 1
            out[r, c] = n >= least
    return out


@njit(cache=True, nogil=True)
def lowered_by_slope(z: Float32Array, reach: int, side: float, corner: float) -> Float32Array:
    """Return the lowest height that a slope allows each cell, (n_rows, n_cols) float32, given the cells within a reach.

    Parameters
    ----------
    z
        (n_rows, n_cols) float32; infinite in empty cells. [m]
    reach
        Steps from cell to cell. [cells]
    side, corner
        Rise of the slope to the next cell in a row or column, and to the one across the corner. [m]
    """
    n_rows, n_cols = z.shape
    inf, to_side, to_corner = np.float32(np.inf), np.float32(side), np.float32(corner)
    one, other = z.copy(), np.empty_like(z)
    nothing = np.full(n_cols, inf, dtype=np.float32)
    # Lowest of the cells above and below, with one more on either side
    beside = np.full(n_cols + 2, inf, dtype=np.float32)
    here = np.full(n_cols + 2, inf, dtype=np.float32)
    for _ in range(reach):
        for r in range(n_rows):
            above = one[r - 1] if r > 0 else nothing
            below = one[r + 1] if r + 1 < n_rows else nothing
            row, to = one[r], other[r]
            for c in range(n_cols):
                beside[c + 1] = above[c] if above[c] < below[c] else below[c]
                here[c + 1] = row[c]
            for c in range(n_cols):
                across = beside[c] if beside[c] < beside[c + 2] else beside[c + 2]
                next_to = here[c] if here[c] < here[c + 2] else here[c + 2]
                next_to = next_to if next_to < beside[c + 1] else beside[c + 1]
                lowest = next_to + to_side
                lowest = lowest if lowest < across + to_corner else across + to_corner
                to[c] = row[c] if row[c] < lowest else lowest
        one, other = other, one
    return one


@njit(cache=True, nogil=True)
def lower_limits(
    limit: Float32Array,
    level: Float32Array,
    rows: IntArray,
    cols: IntArray,
    slope: Float32Array,
    slope_rows: IntArray,
    slope_cols: IntArray,
    reach: float,
) -> None:
    """Lower the limit of each cell to the opened level of its block and what the terrain rises over a reach, in place.

    Parameters
    ----------
    limit
        (n_rows, n_cols) float32, written. [m]
    level, slope
        float32 values of blocks. [m], [m/m]
    rows, cols, slope_rows, slope_cols
        (n_rows,) and (n_cols,) int64: the blocks of each row and column.
    reach
        Half side of the opening's window. [m]
    """
    half = np.float32(reach)
    for r in range(limit.shape[0]):
        levels, slopes, to = level[rows[r]], slope[slope_rows[r]], limit[r]
        for c in range(limit.shape[1]):
            found = levels[cols[c]] + slopes[slope_cols[c]] * half
            to[c] = to[c] if to[c] < found else found
