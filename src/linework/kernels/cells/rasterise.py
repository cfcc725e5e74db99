"""Points to cells in one pass. Which cell a point belongs to is decided here and nowhere else."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import AnyArray

#: Steps of the fixed-point sums of heights [1/m]: 1 micrometre. Integer sums do not depend on the order of
#: the points; float sums would, and so would every line that is drawn from them.
HEIGHT_STEPS = 1048576.0
#: Heights beyond it are no heights on earth [m]; eighty million points so high fit the sum.
TOO_HIGH = 100_000.0


@njit(cache=True, nogil=True)
def cell_of(x: float, y: float, placement: AnyArray, n_rows: int, n_cols: int) -> int:
    """Return the flat index of the cell that holds (x, y), or -1 outside the grid (and for NaN).

    Cells are half open: west and north edge inside, before rotation. `placement` is
    (east, north, cos, sin, cell width, cell height, first column, north edge of the first row):
    with the last two the index is counted on the lattice that grids share, so that a point on a cell's
    edge falls into the same cell whatever grid it is seen through.
    """
    east = x - placement[0]
    north = y - placement[1]
    along = east * placement[2] + north * placement[3]
    up = north * placement[2] - east * placement[3]
    col = math.floor(along / placement[4]) - placement[6]
    row = placement[7] - math.ceil(up / placement[5])
    if 0.0 <= col < n_cols and 0.0 <= row < n_rows:
        return int(row) * n_cols + int(col)
    return -1


@njit(cache=True, nogil=True)
def cells_of_coordinates(xyz: AnyArray, placement: AnyArray, n_rows: int, n_cols: int) -> AnyArray:
    """Return the (n,) int64 flat cell index of each point; -1 outside."""
    cells = np.empty(xyz.shape[0], np.int64)
    for i in range(xyz.shape[0]):
        cells[i] = cell_of(xyz[i, 0], xyz[i, 1], placement, n_rows, n_cols)
    return cells


@njit(cache=True, nogil=True)
def rasterise_points(
    xyz: AnyArray,
    height: AnyArray,
    origin: float,
    intensity: AnyArray,
    placement: AnyArray,
    n_rows: int,
    n_cols: int,
) -> tuple[AnyArray, AnyArray, AnyArray, AnyArray, AnyArray]:
    """Return density, maximum, minimum and mean of ``height - origin``, and mean intensity, per cell.

    Points without a height (NaN, or beyond `TOO_HIGH`) are left out of everything. `intensity` of length 0: none, and so is
    its image.
    """
    n_cells = n_rows * n_cols
    with_intensity = intensity.size > 0
    density = np.zeros(n_cells, np.uint32)
    maximum = np.zeros(n_cells, np.float32)
    minimum = np.zeros(n_cells, np.float32)
    steps = np.zeros(n_cells, np.int64)
    bright = np.zeros(n_cells if with_intensity else 0, np.float64)
    for i in range(xyz.shape[0]):
        cell = cell_of(xyz[i, 0], xyz[i, 1], placement, n_rows, n_cols)
        h = np.float32(height[i] - origin)
        if cell < 0 or not abs(h) < TOO_HIGH:
            continue
        if density[cell] == 0:
            maximum[cell] = h
            minimum[cell] = h
        else:  # branch-free: twice as fast as two comparisons that store
            maximum[cell] = max(maximum[cell], h)
            minimum[cell] = min(minimum[cell], h)
        density[cell] += np.uint32(1)
        steps[cell] += np.int64(np.float64(h) * HEIGHT_STEPS)
        if with_intensity:
            bright[cell] += intensity[i]
    mean = np.full(n_cells, np.nan, np.float32)
    mean_intensity = np.full(bright.size, np.nan, np.float32)
    for cell in range(n_cells):
        n = density[cell]
        if n == 0:
            maximum[cell] = np.nan
            minimum[cell] = np.nan
            continue
        mean[cell] = steps[cell] / (HEIGHT_STEPS * n)
        if with_intensity:
            mean_intensity[cell] = bright[cell] / n
    return density, maximum, minimum, mean, mean_intensity


@njit(cache=True, nogil=True)
def count_in_band(
    xyz: AnyArray, height: AnyArray, low: float, high: float, placement: AnyArray, n_rows: int, n_cols: int
) -> AnyArray:
    """Return the (n_cells,) uint32 number of points with ``low <= height <= high`` per cell."""
    count = np.zeros(n_rows * n_cols, np.uint32)
    for i in range(xyz.shape[0]):
        if low <= height[i] <= high:
            cell = cell_of(xyz[i, 0], xyz[i, 1], placement, n_rows, n_cols)
            if cell >= 0:
                count[cell] += np.uint32(1)
    return count
