"""Kernel for the lowest heights of square blocks of cells."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import Float32Array, Int32Array

#: Lowest cells kept per block: with two that support, up to three stray ones are passed over.
N_LOW = 6


@njit(cache=True, nogil=True)
def lowest_of_blocks(
    height: Float32Array, above: int, left: int, size: int, n_rows: int, n_cols: int
) -> tuple[Float32Array, Int32Array]:
    """Return the lowest heights of the cells of each block, and how many of its cells have one.

    Parameters
    ----------
    height
        (rows, cols) float32; NaN in empty cells. [m]
    above, left
        Cells of the first row and column of blocks that lie before those of `height`.
    size
        Side of a block. [cells]
    n_rows, n_cols
        Numbers of blocks.

    Returns
    -------
    lowest
        (n_rows, n_cols, 6) float32, ascending; infinite where there are no more cells. [m]
    known
        (n_rows, n_cols) int32.
    """
    lowest = np.full((n_rows, n_cols, N_LOW), np.float32(np.inf), dtype=np.float32)
    known = np.zeros((n_rows, n_cols), dtype=np.int32)
    for r in range(height.shape[0]):
        row, n_known = lowest[(r + above) // size], known[(r + above) // size]
        block, end = 0, size - left
        for c in range(height.shape[1]):
            if c == end:
                block += 1
                end += size
            z = height[r, c]
            if z == z:
                n_known[block] += 1
                kept = row[block]
                if z < kept[N_LOW - 1]:
                    for k in range(N_LOW):
                        if z < kept[k]:
                            z, kept[k] = kept[k], z
    return lowest, known


@njit(cache=True, nogil=True)
def supported_lowest(lowest: Float32Array, support: float, n_support: int) -> Float32Array:
    """Return the lowest height of each block that others support, (n_rows, n_cols) float32; infinite without any. [m].

    Parameters
    ----------
    lowest
        (n_rows, n_cols, 6) float32, as `lowest_of_blocks` returns them. [m]
    support, n_support
        A cell is passed over unless so many others are at most this much higher. [m]
    """
    out = lowest[:, :, 0].copy()
    for r in range(out.shape[0]):
        for c in range(out.shape[1]):
            low = lowest[r, c]
            for k in range(N_LOW - n_support):
                other = low[k + n_support]
                if other == np.float32(np.inf):
                    break
                out[r, c] = low[k]
                if other - low[k] <= support:
                    break
    return out
