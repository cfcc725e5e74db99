"""The next cells along stripes of paint, if their points on the stripe are brighter than those on both sides."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.kernels.paint.paint_points import POINT_INTENSITY, POINT_X, POINT_Y
from linework.kernels.paint.stripes import (
    STRIPE_HALF_V,
    STRIPE_T,
    STRIPE_UX,
    STRIPE_UY,
    STRIPE_X,
    STRIPE_Y,
)

#: Length of the window ahead of a cell in which paint is compared with the road [m]; its inner half-width is that of the
#: stripe less the blur of an edge; road beside it, from and to, beyond its edge [m]; fewest points of each. And how many times
#: larger windows are tried, until one has enough points: as large as search areas are, for points as sparse.
LENGTH_AHEAD_M, EDGE_BLUR_M, BOTH_SIDES_M, FEWEST_AHEAD = 1.0, 0.02, (0.03, 0.15), 4
SCALES_AHEAD = (1.0, 2.0, 4.0)


@njit(cache=True, nogil=True)
def cells_ahead(
    points: FloatArray,
    starts: IntArray,
    lattice: tuple[float, int, int, int, int],
    found: FloatArray,
    searched: BoolArray,
    least_t: float,
) -> tuple[IntArray, FloatArray, IntArray]:
    """Return the next cells along stripes that were not searched yet, with the places to search and the stripes' rows.

    Parameters
    ----------
    points, starts, lattice
        (n, 5), (n_cells + 1,): see `linework.kernels.paint.paint_points.sort_into_cells`.
    found
        (m, 24): stripes, see `linework.kernels.paint.stripes`.
    searched
        (n_cells,) bool: cells that need no further search: they have a sure stripe, or were entered.
    least_t
        Smallest t-value of the points ahead on the paint against those beside it.

    Returns
    -------
    (k,) int64 cells, ascending, (k, 2) where the stripe enters [m, from the local origin], (k,) int64 its row in `found`.
    """
    size, south, west, n_rows, n_cols = lattice
    by_cell = np.full(len(starts) - 1, -1, dtype=np.int64)
    sense = np.zeros(len(starts) - 1)
    for i in range(len(found)):
        for ahead in (1.0, -1.0):
            x = found[i, STRIPE_X] + ahead * size * found[i, STRIPE_UX]
            y = found[i, STRIPE_Y] + ahead * size * found[i, STRIPE_UY]
            row, col = int(np.floor(y / size)) - south, int(np.floor(x / size)) - west
            if row < 0 or row >= n_rows or col < 0 or col >= n_cols:
                continue
            cell = row * n_cols + col
            other = by_cell[cell]
            if searched[cell] or (other >= 0 and found[other, STRIPE_T] >= found[i, STRIPE_T]):
                continue
            t = math.nan
            for scale in SCALES_AHEAD:
                if math.isnan(t):
                    t = t_ahead(points, starts, lattice, found[i], ahead, scale)
            if t >= least_t:
                by_cell[cell], sense[cell] = i, ahead
    cells = np.flatnonzero(by_cell >= 0)
    rows = by_cell[cells]
    places = np.empty((len(cells), 2))
    for k in range(len(cells)):
        step = sense[cells[k]] * size
        places[k, 0] = found[rows[k], STRIPE_X] + step * found[rows[k], STRIPE_UX]
        places[k, 1] = found[rows[k], STRIPE_Y] + step * found[rows[k], STRIPE_UY]
    return cells, places, rows


@njit(cache=True, nogil=True)
def t_ahead(
    points: FloatArray,
    starts: IntArray,
    lattice: tuple[float, int, int, int, int],
    stripe: FloatArray,
    ahead: float,
    scale: float,
) -> float:
    """Return how far the points ahead of a stripe stand out from the mean of both sides, over its standard deviation.

    stripe: (24,); ahead: +1 along it, -1 against it; scale: of `SCALES_AHEAD`. NaN where there are too few points.
    """
    size, south, west, n_rows, n_cols = lattice
    x0 = stripe[STRIPE_X] + ahead * 0.5 * size * stripe[STRIPE_UX]
    y0 = stripe[STRIPE_Y] + ahead * 0.5 * size * stripe[STRIPE_UY]
    length = scale * LENGTH_AHEAD_M
    x1, y1 = x0 + ahead * length * stripe[STRIPE_UX], y0 + ahead * length * stripe[STRIPE_UY]
    half = stripe[STRIPE_HALF_V]
    near, far = half + scale * BOTH_SIDES_M[0], half + scale * BOTH_SIDES_M[1]
    inner = max(half - EDGE_BLUR_M, EDGE_BLUR_M)
    row0 = max(int(np.floor((min(y0, y1) - far) / size)) - south, 0)
    row1 = min(int(np.floor((max(y0, y1) + far) / size)) - south, n_rows - 1)
    col0 = max(int(np.floor((min(x0, x1) - far) / size)) - west, 0)
    col1 = min(int(np.floor((max(x0, x1) + far) / size)) - west, n_cols - 1)
    number, total, square = np.zeros(3), np.zeros(3), np.zeros(3)
    for row in range(row0, row1 + 1):
        for i in range(starts[row * n_cols + col0], starts[row * n_cols + max(col1, col0 - 1) + 1]):
            dx, dy = points[i, POINT_X] - x0, points[i, POINT_Y] - y0
            u = ahead * (dx * stripe[STRIPE_UX] + dy * stripe[STRIPE_UY])
            if u < 0.0 or u > length:
                continue
            v = dy * stripe[STRIPE_UX] - dx * stripe[STRIPE_UY]
            if abs(v) <= inner:
                part = 0
            elif abs(v) >= near and abs(v) <= far:
                part = 1 if v > 0.0 else 2
            else:
                continue
            number[part] += 1.0
            total[part] += points[i, POINT_INTENSITY]
            square[part] += points[i, POINT_INTENSITY] ** 2
    if number.min() < FEWEST_AHEAD:
        return math.nan
    mean = total / number
    variance = np.maximum(square / number - mean**2, 0.0) / number
    gain, square_sigma = mean[0] - 0.5 * (mean[1] + mean[2]), variance[0] + 0.25 * (variance[1] + variance[2])
    # Without noise (few grey levels) any difference is one
    if square_sigma == 0.0:
        return math.inf if gain > 0.0 else 0.0
    return float(gain / math.sqrt(square_sigma))
