"""Disparities of textured places on the road in a stereo pair, and the plane that most of them agree with."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from linework.arrays import ByteArray, FloatArray

#: Columns of matched places: column and row in the left image, disparity. [pixels]
MATCHED_COL, MATCHED_ROW, MATCHED_DISPARITY = range(3)
#: Columns of places that planes are fitted to: column and row from the principal point, disparity [pixels], weight.
PLANE_U, PLANE_V, PLANE_D, PLANE_WEIGHT = range(4)
#: Columns of a plane: d = p0 + p1 u + p2 v [pixels, 1, 1], and the weight of the places that agree.
PLANE_P0, PLANE_P1, PLANE_P2, PLANE_SUPPORT = range(4)
#: Half size of the windows that are compared: wide and low, because the road is slanted. [pixels]
HALF_COLS, HALF_ROWS = 6, 2
#: Smallest ratio of the second best sum of differences, out of reach of the best, to the best one. How it was chosen
#: is not recorded.
DISTINCT = 1.15
#: A textured place has a step over two pixels of more than this. [grey values] How it was chosen is not recorded.
LEAST_TEXTURE = 4
#: Smallest area of the triangle of three trial places, doubled: places nearly on a line do not fix a plane. [pixels^2]
LEAST_TRIANGLE_PX2 = 100.0


@njit(cache=True, nogil=True)
def cell_disparities(
    left: ByteArray, right: ByteArray, limits: FloatArray, cell: tuple[int, int], first_row: int
) -> FloatArray:
    """Return (n, 3) the most textured place of each cell that matches distinctly: columns `MATCHED_COL` onwards.

    Parameters
    ----------
    left, right
        (height, width) uint8, rectified.
    limits
        (height, 2) smallest and largest disparity searched in each row. [pixels]
    cell
        Columns and rows of a cell. [pixels]
    first_row
        Cells above it are left out.

    Notes
    -----
    Sums of absolute differences of windows, along the rows.
    """
    height, width = left.shape
    n_cols, n_rows = cell
    out = np.empty(((width // n_cols + 1) * (height // n_rows + 1), 3))
    cost = np.empty(width, dtype=np.int64)
    n = 0
    for top in range(max(first_row, HALF_ROWS), height - HALF_ROWS - n_rows + 1, n_rows):
        for start in range(HALF_COLS + 1, width - HALF_COLS - n_cols - 1, n_cols):
            # The steepest place of the cell's middle row
            row, col, steepest = top + n_rows // 2, -1, np.int64(LEAST_TEXTURE)
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
            out[n, MATCHED_COL], out[n, MATCHED_ROW] = col, row
            out[n, MATCHED_DISPARITY] = best + (0.5 * (before - behind) / bend if bend > 0.0 else 0.0)
            n += 1
    return out[:n]


@njit(cache=True, nogil=True)
def best_plane(
    places: FloatArray, picks: npt.NDArray[np.int64], limits: FloatArray, tolerance: float
) -> FloatArray:
    """Return (4,) the plane d = p0 + p1 u + p2 v that most places agree with, among those through three of them.

    Parameters
    ----------
    places
        (n, 4): columns `PLANE_U` to `PLANE_WEIGHT`.
    picks
        (k, 3) int64: the three places of each trial.
    limits
        (3, 2) smallest and largest p1/p2, p0/p2 [pixels] and p2 that are allowed.
    tolerance
        Residual from which a place no longer agrees. [pixels]

    Returns
    -------
    ndarray
        Columns `PLANE_P0` to `PLANE_SUPPORT`; zeros where no trial is allowed.
    """
    best = np.zeros(4)
    for t in range(len(picks)):
        a, b, c = places[picks[t, 0]], places[picks[t, 1]], places[picks[t, 2]]
        u1, v1, d1 = b[PLANE_U] - a[PLANE_U], b[PLANE_V] - a[PLANE_V], b[PLANE_D] - a[PLANE_D]
        u2, v2, d2 = c[PLANE_U] - a[PLANE_U], c[PLANE_V] - a[PLANE_V], c[PLANE_D] - a[PLANE_D]
        det = u1 * v2 - u2 * v1
        if abs(det) < LEAST_TRIANGLE_PX2:
            continue
        p1, p2 = (d1 * v2 - d2 * v1) / det, (u1 * d2 - u2 * d1) / det
        if p2 <= 0.0:
            continue
        p0 = a[PLANE_D] - p1 * a[PLANE_U] - p2 * a[PLANE_V]
        allowed = limits[0, 0] <= p1 / p2 <= limits[0, 1] and limits[1, 0] <= p0 / p2 <= limits[1, 1]
        if not (allowed and limits[2, 0] <= p2 <= limits[2, 1]):
            continue
        total = 0.0
        for i in range(len(places)):
            r = (places[i, PLANE_D] - p0 - p1 * places[i, PLANE_U] - p2 * places[i, PLANE_V]) / tolerance
            if abs(r) < 1.0:
                total += places[i, PLANE_WEIGHT] * (1.0 - r * r)
        if total > best[PLANE_SUPPORT]:
            best[PLANE_P0], best[PLANE_P1], best[PLANE_P2], best[PLANE_SUPPORT] = p0, p1, p2, total
    return best
