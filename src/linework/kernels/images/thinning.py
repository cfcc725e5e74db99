"""Thinning of binary images to lines of one pixel, chains of pixels, and the corners of chains."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

#: Row and column steps to the eight neighbours, clockwise from north. [pixels]
_ROW = np.array([-1, -1, 0, 1, 1, 1, 0, -1])
_COL = np.array([0, 1, 1, 1, 0, -1, -1, -1])
#: Turns in which a chain looks for its next pixel, in eighths of a circle: straight ahead first, never backward.
_TURNS = np.array([0, 1, -1, 2, -2, 3, -3])


@njit(cache=True, nogil=True)
def thin_in_place(image: npt.NDArray[np.uint8]) -> None:
    """Remove boundary pixels in place until lines are one pixel wide.

    Parameters
    ----------
    image
        (rows, cols) uint8: 1 where white, 0 along its border. Changed.

    References
    ----------
    T. Y. Zhang, C. Y. Suen, "A fast parallel algorithm for thinning digital patterns", Communications of the
    ACM 27 (1984), doi:10.1145/357994.358023.
    """
    n_rows, n_cols = image.shape
    white = np.empty((image.size, 2), dtype=np.int64)
    n = 0
    for row in range(1, n_rows - 1):
        for col in range(1, n_cols - 1):
            if image[row, col]:
                white[n, 0], white[n, 1] = row, col
                n += 1
    gone = np.empty(max(n, 1), dtype=np.int64)
    p = np.empty(8, dtype=np.int64)
    changed = True
    while changed:
        changed = False
        for phase in range(2):
            n_gone = 0
            for i in range(n):
                row, col = white[i, 0], white[i, 1]
                total, rises = 0, 0
                for k in range(8):
                    p[k] = image[row + _ROW[k], col + _COL[k]]
                    total += p[k]
                for k in range(8):
                    rises += (p[k] == 0) and (p[(k + 1) % 8] == 1)
                if total < 2 or total > 6 or rises != 1:
                    continue
                # p[0] north, p[2] east, p[4] south, p[6] west
                if phase == 0:
                    is_kept = p[0] * p[2] * p[4] or p[2] * p[4] * p[6]
                else:
                    is_kept = p[0] * p[2] * p[6] or p[0] * p[4] * p[6]
                if not is_kept:
                    gone[n_gone] = i
                    n_gone += 1
            if n_gone:
                changed = True
                for g in range(n_gone):
                    image[white[gone[g], 0], white[gone[g], 1]] = 0
                left = 0
                for i in range(n):
                    if image[white[i, 0], white[i, 1]]:
                        white[left, 0], white[left, 1] = white[i, 0], white[i, 1]
                        left += 1
                n = left


@njit(cache=True, nogil=True)
def follow_chains(
    image: npt.NDArray[np.uint8], least_px: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Follow lines of white pixels, erasing each pixel as it is followed.

    Parameters
    ----------
    image
        (rows, cols) uint8: 1 where white, 0 along its border. Erased.
    least_px
        Shortest chain that is kept. [pixels]

    Returns
    -------
    pixels, offsets
        (n, 2) int64 row and column; chain i is ``pixels[offsets[i]:offsets[i + 1]]``, from its lowest end up.

    Notes
    -----
    A chain begins at the lowest white pixel that is left, leftmost first. At a crossing it continues in its own
    direction; the remaining branches become chains of their own.
    """
    n_rows, n_cols = image.shape
    pixels = np.empty((int(image.sum()), 2), dtype=np.int64)
    offsets = [0]
    n = 0
    for start_row in range(n_rows - 2, 0, -1):
        for start_col in range(1, n_cols - 1):
            if not image[start_row, start_col]:
                continue
            first, row, col, way = n, start_row, start_col, 0
            while True:
                image[row, col] = 0
                pixels[n, 0], pixels[n, 1] = row, col
                n += 1
                found = False
                for turn in _TURNS:
                    k = (way + turn) % 8
                    if image[row + _ROW[k], col + _COL[k]]:
                        row, col, way, found = row + _ROW[k], col + _COL[k], k, True
                        break
                if not found:
                    break
            if n - first < least_px:
                n = first
            else:
                offsets.append(n)
    return pixels[:n].copy(), np.array(offsets, dtype=np.int64)


@njit(cache=True, nogil=True)
def corners_of(pixels: npt.NDArray[np.int64], offsets: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Return (n,) bool: False for a pixel on a straight line with both its neighbours in the chain.

    Parameters
    ----------
    pixels, offsets
        (n, 2) and (m + 1,) int64, as `follow_chains` returns them.
    """
    kept = np.ones(len(pixels), dtype=np.bool_)
    for i in range(len(offsets) - 1):
        for k in range(offsets[i] + 1, offsets[i + 1] - 1):
            same_row = pixels[k, 0] - pixels[k - 1, 0] == pixels[k + 1, 0] - pixels[k, 0]
            same_col = pixels[k, 1] - pixels[k - 1, 1] == pixels[k + 1, 1] - pixels[k, 1]
            kept[k] = not (same_row and same_col)
    return kept
