"""Kernel for the lowest heights of square blocks of cells."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import Float32Array, Int32Array


@njit(cache=True, nogil=True)
def lowest_of_blocks(
    height: Float32Array, above: int, left: int, size: int, n_rows: int, n_cols: int
) -> tuple[Float32Array, Int32Array]:
    """Return the lowest height of each block of cells, and how many of its cells have one.

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
        (n_rows, n_cols) float32; infinite where all cells are empty. [m]
    known
        (n_rows, n_cols) int32.
    """
    lowest = np.full((n_rows, n_cols), np.float32(np.inf), dtype=np.float32)
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
                if z < row[block]:
                    row[block] = z
    return lowest, known
