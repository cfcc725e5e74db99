"""Disparities of textured places in the lower part of a stereo pair, by matching small windows along the rows."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from linework.arrays import ByteArray, FloatArray

#: Half size of the windows that are compared: wide and flat, as the road is slanted. [pixels]
HALF_COLS, HALF_ROWS = 6, 2
#: The second best place, out of reach of the best, must differ so much more.
DISTINCT = 1.15


@njit(cache=True, nogil=True)
def cell_disparities(
    left: ByteArray, right: ByteArray, limits: FloatArray, cell: tuple[int, int], first_row: int
) -> FloatArray:
    """Return (n, 3): column, row and disparity of the most textured place of each cell, where it is distinct.

    Parameters
    ----------
    limits
        (height, 2) least and largest disparity looked at in each row [pixels].
    cell
        Columns and rows of a cell.
    first_row
        Cells above are left out.
    """
    height, width = left.shape
    n_cols, n_rows = cell
    out = np.empty(((width // n_cols + 1) * (height // n_rows + 1), 3))
    cost = np.empty(width, dtype=np.int64)
    n = 0
    for top in range(max(first_row, HALF_ROWS), height - HALF_ROWS - n_rows + 1, n_rows):
        for start in range(HALF_COLS + 1, width - HALF_COLS - n_cols - 1, n_cols):
            # The middle row of the cell, its steepest place
            row, col, steepest = top + n_rows // 2, -1, np.int64(4)
            for u in range(start, start + n_cols):
                step = abs(np.int64(left[row, u + 1]) - np.int64(left[row, u - 1]))
                if step > steepest:
                    col, steepest = u, step
            if col < 0:
                continue
            low = max(int(limits[row, 0]), 1)
            high = min(int(limits[row, 1]) + 1, col - HALF_COLS - 1)
            if high - low < 3:
                continue
            best = low
            for d in range(low, high + 1):
                total = np.int64(0)
                for r in range(row - HALF_ROWS, row + HALF_ROWS + 1):
                    for u in range(col - HALF_COLS, col + HALF_COLS + 1):
                        total += abs(np.int64(left[r, u]) - np.int64(right[r, u - d]))
                cost[d] = total
                if total < cost[best]:
                    best = d
            if best == low or best == high:
                continue
            second = np.int64(1 << 40)
            for d in range(low, high + 1):
                if abs(d - best) > 2 and cost[d] < second:
                    second = cost[d]
            if second < DISTINCT * cost[best]:
                continue
            before, here, behind = float(cost[best - 1]), float(cost[best]), float(cost[best + 1])
            # Sums of absolute differences are a V about their least value, not a parabola
            bend = max(before, behind) - here
            out[n, 0], out[n, 1] = col, row
            out[n, 2] = best + (0.5 * (before - behind) / bend if bend > 0.0 else 0.0)
            n += 1
    return out[:n]


@njit(cache=True, nogil=True)
def best_plane(
    places: FloatArray, picks: npt.NDArray[np.int64], limits: FloatArray, tolerance: float
) -> FloatArray:
    """Return the plane d = p0 + p1 u + p2 v that most places agree with, among those through three of them.

    Parameters
    ----------
    places
        (n, 4): u, v from the principal point, disparity [pixels], weight.
    picks
        (k, 3): the three places of each trial.
    limits
        (3, 2) least and largest |p1|-normalised slopes allowed: of p1/p2, of p0/p2, and of p2 itself.
    tolerance
        Residual at which a place stops to agree [pixels].

    Returns
    -------
    (4,) p0, p1, p2 and the weight that agrees; zeros if none is allowed.
    """
    best = np.zeros(4)
    for t in range(len(picks)):
        a, b, c = places[picks[t, 0]], places[picks[t, 1]], places[picks[t, 2]]
        u1, v1, d1 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        u2, v2, d2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        det = u1 * v2 - u2 * v1
        if abs(det) < 100.0:
            continue
        p1, p2 = (d1 * v2 - d2 * v1) / det, (u1 * d2 - u2 * d1) / det
        if p2 <= 0.0:
            continue
        p0 = a[2] - p1 * a[0] - p2 * a[1]
        allowed = limits[0, 0] <= p1 / p2 <= limits[0, 1] and limits[1, 0] <= p0 / p2 <= limits[1, 1]
        if not (allowed and limits[2, 0] <= p2 <= limits[2, 1]):
            continue
        total = 0.0
        for i in range(len(places)):
            r = (places[i, 2] - p0 - p1 * places[i, 0] - p2 * places[i, 1]) / tolerance
            if abs(r) < 1.0:
                total += places[i, 3] * (1.0 - r * r)
        if total > best[3]:
            best[0], best[1], best[2], best[3] = p0, p1, p2, total
    return best
