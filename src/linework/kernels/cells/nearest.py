"""Kernels that extend a surface: nearest known cell within a reach, filling, smoothing."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import BoolArray, Float32Array, Int32Array, IntArray


@njit(cache=True, nogil=True)
def nearest_known_squared(known: BoolArray, reach: int, margin: int) -> tuple[Int32Array, Int32Array]:
    """Return the nearest known cell of each cell and its squared distance, int32 (n_rows - 2 margin, ...) each.

    The first is a flat index into `known`, -1 where none is within reach; the second is in cells squared.

    Parameters
    ----------
    known
        (n_rows, n_cols) bool.
    reach
        Largest distance. Of several nearest cells the westernmost counts, then the northernmost. [cells]
    margin
        Only cells at least this far inside are computed. [cells]

    Notes
    -----
    Exact: first along columns, then the lower envelope of the columns' parabolas along rows (Meijster,
    Roerdink, Hesselink 2000, doi:10.1007/0-306-47025-X_36), here with columns beyond the reach left out, so
    that empty areas cost little, and with ties decided by position, so that a part of a survey gives the same
    result as the whole.
    """
    n_rows, n_cols = known.shape
    row_of = _nearest_in_columns(known, reach, margin)
    index = np.full((n_rows - 2 * margin, n_cols - 2 * margin), -1, dtype=np.int32)
    square = np.full((n_rows - 2 * margin, n_cols - 2 * margin), reach * reach + 1, dtype=np.int32)
    site = np.empty(n_cols, dtype=np.int32)  # columns of the envelope
    below = np.empty(n_cols, dtype=np.int32)  # their squared distances along the column
    begin = np.empty(n_cols, dtype=np.int32)  # first column at which each is the nearest
    inverse = 0.5 / np.maximum(np.arange(n_cols), 1)
    for r in range(n_rows - 2 * margin):
        n = 0
        for c in range(n_cols):
            if row_of[r, c] < 0:
                continue
            g = row_of[r, c] - (r + margin)
            g = g * g
            start = 0
            while n > 0:
                # First column at which this one is nearer than the last of the envelope; ties go to the west
                step = c - site[n - 1]
                num = step * (c + site[n - 1]) + (g - below[n - 1])
                start = int(num * inverse[step])
                rest = num - start * 2 * step  # correct the rounding of the quotient
                if rest < 0:
                    start -= 1
                elif rest >= 2 * step:
                    start += 1
                start += 1
                if start > begin[n - 1]:
                    break
                n -= 1
                start = 0
            if n == 0:
                start = 0
            if start < n_cols:
                site[n], below[n], begin[n] = c, g, max(start, 0)
                n += 1
        if n == 0:
            continue
        k = 0
        for c in range(margin, n_cols - margin):
            while k + 1 < n and begin[k + 1] <= c:
                k += 1
            d = (c - site[k]) * (c - site[k]) + below[k]
            if d <= reach * reach:
                square[r, c - margin] = d
                index[r, c - margin] = row_of[r, site[k]] * n_cols + site[k]
    return index, square


@njit(cache=True, nogil=True)
def _nearest_in_columns(known: BoolArray, reach: int, margin: int) -> Int32Array:
    """Return the row of the nearest known cell in the same column, for the inner rows; -1 beyond the reach."""
    n_rows, n_cols = known.shape
    far = -4 * (n_rows + reach)
    out = np.empty((n_rows - 2 * margin, n_cols), dtype=np.int32)
    last = np.full(n_cols, far, dtype=np.int32)
    for r in range(n_rows - margin):
        for c in range(n_cols):
            last[c] = r if known[r, c] else last[c]
        if r >= margin:
            for c in range(n_cols):
                out[r - margin, c] = last[c]
    last[:] = -far
    for r in range(n_rows - 1, margin - 1, -1):
        for c in range(n_cols):
            last[c] = r if known[r, c] else last[c]
        if r < n_rows - margin:
            for c in range(n_cols):
                above = out[r - margin, c]
                nearest = above if r - above <= last[c] - r else last[c]
                out[r - margin, c] = nearest if abs(nearest - r) <= reach else -1
    return out


@njit(cache=True, nogil=True)
def heights_by_index(height: Float32Array, index: Int32Array) -> Float32Array:
    """Return the heights (float32) at flat indices `index` (rows, cols) int32; NaN where it is negative."""
    flat = height.reshape(-1)
    out = np.full(index.shape, np.float32(np.nan), dtype=np.float32)
    for r in range(index.shape[0]):
        for c in range(index.shape[1]):
            if index[r, c] >= 0:
                out[r, c] = flat[index[r, c]]
    return out


@njit(cache=True, nogil=True)
def softened(values: Float32Array, square: Int32Array, half: int, cell: float, over: float) -> Float32Array:
    """Return the inner cells (n_rows, n_cols) float32, the smoother the farther their values are extrapolated.

    A value is blended with the mean of (2 half + 1)**2 cells about it, by its distance from where it was measured.

    Parameters
    ----------
    values, square
        (n_rows + 2 half, n_cols + 2 half) float32 heights [m], and int32 squared distances to the cells they were
        measured in [cells**2].
    cell
        Side of a cell. [m]
    over
        Distance at which the mean has replaced the value. [m]

    Notes
    -----
    Sums are added in the same order for every cell. A mean that would need a missing cell is not used.
    """
    n_rows, n_cols = values.shape[0] - 2 * half, values.shape[1] - 2 * half
    width = 2 * half + 1
    one, scale, size = np.float32(1.0), np.float32(cell / over), np.float32(width * width)
    out = np.empty((n_rows, n_cols), dtype=np.float32)
    column = np.empty(n_cols + 2 * half, dtype=np.float32)
    total = np.empty(n_cols, dtype=np.float32)
    for r in range(n_rows):
        column[:] = np.float32(0.0)
        for k in range(width):
            row = values[r + k]
            for c in range(n_cols + 2 * half):
                column[c] += row[c]
        total[:] = np.float32(0.0)
        for k in range(width):
            for c in range(n_cols):
                total[c] += column[c + k]
        row, away, to = values[r + half], square[r + half], out[r]
        for c in range(n_cols):
            value, mean = row[c + half], total[c] / size
            share = np.sqrt(np.float32(away[c + half])) * scale
            share = share if share < one else one
            soft = (one - share) * value + share * mean
            to[c] = soft if mean == mean else value
    return out


@njit(cache=True, nogil=True)
def blend_into_ground(
    road: Float32Array,
    square: Int32Array,
    ground: Float32Array,
    far: Float32Array,
    row_block: IntArray,
    col_block: IntArray,
    cell: float,
    carry: float,
) -> None:
    """Fill gaps of the ground from `far`, and blend the road into the ground away from its edge, in place.

    Parameters
    ----------
    road, ground
        (n_rows, n_cols) float32 heights, written. [m]
    square
        (n_rows, n_cols) int32 squared distances to the road. [cells**2]
    far
        (blocks, blocks) float32 heights by block; `row_block` (n_rows,) and `col_block` (n_cols,) int64 are the
        block of each row and column. [m]
    cell
        Side of a cell. [m]
    carry
        Distance up to which the road is kept; it is blended over the same distance again. [m]
    """
    one, size, begin = np.float32(1.0), np.float32(cell), np.float32(carry)
    scale = np.float32(1.0 / max(carry, cell))
    for r in range(road.shape[0]):
        row, away, base = road[r], square[r], ground[r]
        for c in range(road.shape[1]):
            if np.isnan(base[c]):
                base[c] = far[row_block[r], col_block[c]]
        for c in range(road.shape[1]):
            share = (np.sqrt(np.float32(away[c])) * size - begin) * scale
            share = share if share > np.float32(0.0) else np.float32(0.0)
            share = share if share < one else one
            mixed = (one - share) * row[c] + share * base[c]
            row[c] = mixed if mixed == mixed else base[c]


@njit(cache=True, nogil=True)
def block_sums(
    height: Float32Array,
    chosen: BoolArray,
    row_block: IntArray,
    col_block: IntArray,
    n_rows: int,
    n_cols: int,
    fixed: float,
) -> tuple[IntArray, IntArray]:
    """Return the sum of the chosen cells' heights, in steps of 1 / `fixed`, and their number, per block.

    Parameters
    ----------
    height, chosen
        (rows, cols) float32 heights [m] and bool.
    row_block, col_block
        (rows,) and (cols,) int64: the block of each row and column.
    n_rows, n_cols
        Numbers of blocks.
    fixed
        Steps per metre. [1/m]

    Returns
    -------
    total, number
        (n_rows, n_cols) int64 each.
    """
    total = np.zeros((n_rows, n_cols), dtype=np.int64)
    number = np.zeros((n_rows, n_cols), dtype=np.int64)
    for r in range(height.shape[0]):
        for c in range(height.shape[1]):
            if chosen[r, c]:
                total[row_block[r], col_block[c]] += int(np.rint(height[r, c] * fixed))
                number[row_block[r], col_block[c]] += 1
    return total, number
