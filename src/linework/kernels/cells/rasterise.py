"""Kernels that rasterise points in one pass; the only place that decides which cell a point belongs to."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import AnyArray

#: Steps of the fixed-point sums of heights: 1 micrometre. Integer sums do not depend on the order of the points;
#: float sums would, and with them every line extracted from them. [1/m]
HEIGHT_STEPS = 1048576.0
#: Heights beyond this are not heights on earth; eighty million points at this height fit the sum. [m]
TOO_HIGH = 100_000.0
#: Elements of the placement of a grid: corner east and north [m, world], cosine and sine of its rotation, cell width
#: and height [m], first column and northern edge of the first row on the lattice that grids share [cells].
GRID_EAST, GRID_NORTH, GRID_COS, GRID_SIN, GRID_WIDTH, GRID_HEIGHT, GRID_COL, GRID_ROW = range(8)


@njit(cache=True, nogil=True)
def cell_of(x: float, y: float, placement: AnyArray, n_rows: int, n_cols: int) -> int:
    """Return the flat index of the cell that holds (x, y), or -1 outside the grid (and for NaN).

    Cells are half open: west and north edge inside, before rotation. The index is counted on the lattice that
    grids share, so that a point on the edge of a cell falls into the same cell in every grid.

    Parameters
    ----------
    x, y
        Position. [m, world]
    placement
        (8,) elements `GRID_EAST` to `GRID_ROW`.
    """
    east = x - placement[GRID_EAST]
    north = y - placement[GRID_NORTH]
    along = east * placement[GRID_COS] + north * placement[GRID_SIN]
    up = north * placement[GRID_COS] - east * placement[GRID_SIN]
    col = math.floor(along / placement[GRID_WIDTH]) - placement[GRID_COL]
    row = placement[GRID_ROW] - math.ceil(up / placement[GRID_HEIGHT])
    if 0.0 <= col < n_cols and 0.0 <= row < n_rows:
        return int(row) * n_cols + int(col)
    return -1


@njit(cache=True, nogil=True)
def cells_of_coordinates(xyz: AnyArray, placement: AnyArray, n_rows: int, n_cols: int) -> AnyArray:
    """Return the flat cell index of each of (n, 3) points, (n,) int64; -1 outside.

    `placement` as for `cell_of`.
    """
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

    Points without a height (NaN, or beyond `TOO_HIGH`) are left out.

    Parameters
    ----------
    xyz, height
        (n, 3) points [m, world] and (n,) their heights [m].
    origin
        Subtracted from the heights, so that float32 holds them. [m]
    intensity
        (n,), or of length 0: none.
    placement
        (8,) as for `cell_of`.

    Returns
    -------
    density
        (n_cells,) uint32.
    maximum, minimum, mean, mean_intensity
        (n_cells,) float32 each, NaN in empty cells; the last of length 0 without intensities. [m]
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
    """Return the number of points with ``low <= height <= high`` per cell, (n_cells,) uint32.

    Parameters
    ----------
    xyz, height
        (n, 3) points [m, world] and (n,) their heights [m].
    placement
        (8,) as for `cell_of`.
    """
    count = np.zeros(n_rows * n_cols, np.uint32)
    for i in range(xyz.shape[0]):
        if low <= height[i] <= high:
            cell = cell_of(xyz[i, 0], xyz[i, 1], placement, n_rows, n_cols)
            if cell >= 0:
                count[cell] += np.uint32(1)
    return count
