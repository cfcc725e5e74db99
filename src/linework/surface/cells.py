"""Cells of the surface: windows of one lattice for the whole world, and the cells below the driven path."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray
from linework.kernels.cells import regions as kernels
from linework.model.grid import Bounds, Grid
from linework.model.trajectory import Trajectory

#: Side of the blocks that separate recorded areas and hold coarse heights: those of the point store. [m]
SURFACE_BLOCK_M = 64.0


class CellWindow(NamedTuple):
    """A rectangle of cells. Cell (i, j) covers i cell <= east < (i + 1) cell, and north likewise.

    Parameters
    ----------
    west, south
        Cell numbers of the first column and of the last row: row 0 is north.
    """

    west: int
    south: int
    n_rows: int
    n_cols: int

    @classmethod
    def over(cls, bounds: Bounds, cell_m: float) -> CellWindow:
        """Return the cells that hold points of the bounds, edges included.

        >>> CellWindow.over(Bounds(0.1, -0.1, 1.0, 0.4), 0.5)
        CellWindow(west=0, south=-1, n_rows=2, n_cols=3)
        """
        west, south = math.floor(bounds.west / cell_m), math.floor(bounds.south / cell_m)
        east, north = math.floor(bounds.east / cell_m), math.floor(bounds.north / cell_m)
        return cls(west, south, north - south + 1, east - west + 1)

    @property
    def shape(self) -> tuple[int, int]:
        """(n_rows, n_cols)."""
        return self.n_rows, self.n_cols

    @property
    def north(self) -> int:
        """Cell number beyond the first row."""
        return self.south + self.n_rows

    @property
    def east(self) -> int:
        """Cell number beyond the last column."""
        return self.west + self.n_cols

    def grown(self, n: int) -> CellWindow:
        """Return the window with n cells more on every side."""
        return CellWindow(self.west - n, self.south - n, self.n_rows + 2 * n, self.n_cols + 2 * n)

    def common(self, other: CellWindow) -> CellWindow | None:
        """Return the cells of both windows, or None.

        >>> CellWindow(0, 0, 4, 4).common(CellWindow(2, 3, 4, 4))
        CellWindow(west=2, south=3, n_rows=1, n_cols=2)
        """
        west, south = max(self.west, other.west), max(self.south, other.south)
        east, north = min(self.east, other.east), min(self.north, other.north)
        return CellWindow(west, south, north - south, east - west) if west < east and south < north else None

    def part(self, inner: CellWindow) -> tuple[slice, slice]:
        """Return the slices of the cells of `inner` in an array of this window."""
        top, left = self.north - inner.north, inner.west - self.west
        return slice(top, top + inner.n_rows), slice(left, left + inner.n_cols)

    def bounds(self, cell_m: float) -> Bounds:
        """Return the rectangle that the cells cover [m, world]."""
        return Bounds(self.west * cell_m, self.south * cell_m, self.east * cell_m, self.north * cell_m)

    def grid(self, cell_m: float) -> Grid:
        """Return the cells as a grid."""
        return Grid(self.west * cell_m, self.north * cell_m, cell_m, cell_m, self.n_rows, self.n_cols)

    def blocks(self, cell_m: float) -> tuple[IntArray, IntArray]:
        """Return the blocks of the centres of rows (n_rows,) and of columns (n_cols,), int64."""
        rows = self.north - 1 - np.arange(self.n_rows)
        cols = self.west + np.arange(self.n_cols)
        return block_of(rows, cell_m), block_of(cols, cell_m)


def block_of(cells: IntArray, cell_m: float) -> IntArray:
    """Return the block along one axis that holds the centre of each cell, (n,) int64.

    >>> block_of(np.array([-1, 0, 127, 128]), 0.5).tolist()
    [-1, 0, 0, 1]
    """
    return np.asarray(np.floor((cells + 0.5) * cell_m / SURFACE_BLOCK_M), dtype=np.int64)


# Cells below the vehicle's path, where the road is certain

#: Distance in plan within which the road is below the path: half of the track of a van. [m]
NEAR_PATH_M = 1.0
#: Range of the heights of the path above the road: less than the height of any bridge. [m]
SAME_DROP_M = 1.0
#: Longest step of a path: recorded every second at 130 km/h it has 36 m; a longer one joins two drives. [m]
MAX_PATH_STEP_M = 50.0


def path_samples(trajectory: Trajectory | None, cell_m: float) -> FloatArray:
    """Return samples of the path, half a cell apart, (n, 3) [m, world]."""
    if trajectory is None or len(trajectory) == 0:
        return np.zeros((0, 3))
    step = np.hypot(*np.diff(trajectory.xyz[:, :2], axis=0).T)
    # Jumps have no length, so that they get no samples
    chainage = np.concatenate([[0.0], np.cumsum(np.where(step <= MAX_PATH_STEP_M, step, 0.0))])
    at = np.arange(0.0, chainage[-1] + cell_m, cell_m / 2)
    return np.stack([np.interp(at, chainage, trajectory.xyz[:, axis]) for axis in range(3)], axis=-1)


def drops_of_cells(
    path: FloatArray, window: CellWindow, height: Float32Array, smooth: BoolArray, z0_m: float, cell_m: float
) -> tuple[AnyArray, Float32Array]:
    """Return the smooth cells near the path, and their least and largest depths below it.

    A path may pass over a cell more than once, at different heights.

    Parameters
    ----------
    path
        (n, 3) samples. [m, world]
    height, smooth
        (n_rows, n_cols) float32 heights above z0_m [m] and bool, of the cells of `window`.

    Returns
    -------
    cells, drops
        (k,) int64 flat indices, and (k, 2) float32. [m]
    """
    if len(path) == 0:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 2), dtype=np.float32)
    reach = max(round(NEAR_PATH_M / cell_m), 1)
    least, most = kernels.drops_below(path, window.west, window.south, height, cell_m, z0_m, reach)
    cells = np.flatnonzero(smooth & ~np.isnan(least))
    return cells, np.stack([least.ravel()[cells], most.ravel()[cells]], axis=-1)


def under_the_wheels(drops: Float32Array) -> BoolArray:
    """Return which cells are road, (n,) bool, by their depths below the path (n, 2) [m].

    A path may be at the height of the antenna: the usual depth below it distinguishes the road from a bridge deck
    overhead, where that is all that was recorded.
    """
    if len(drops) == 0:
        return np.zeros(0, dtype=bool)
    usual = np.median(drops[:, 0])
    return np.asarray((np.abs(drops - usual) <= SAME_DROP_M).any(axis=1))
