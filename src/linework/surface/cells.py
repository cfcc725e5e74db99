"""The cells of the surface: one lattice for the whole world, looked at through windows."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray
from linework.kernels.cells import regions as kernels
from linework.model.grid import Bounds, Grid
from linework.model.trajectory import Trajectory

#: Blocks of the lattice that tells recorded places apart and holds coarse heights: the point store's. [m]
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
        """Return the cells that hold points of the bounds, their edges counted in.

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
        """Return the cells that both hold, or None.

        >>> CellWindow(0, 0, 4, 4).common(CellWindow(2, 3, 4, 4))
        CellWindow(west=2, south=3, n_rows=1, n_cols=2)
        """
        west, south = max(self.west, other.west), max(self.south, other.south)
        east, north = min(self.east, other.east), min(self.north, other.north)
        return CellWindow(west, south, north - south, east - west) if west < east and south < north else None

    def part(self, inner: CellWindow) -> tuple[slice, slice]:
        """Return where the cells of `inner` lie in an array of this window."""
        top, left = self.north - inner.north, inner.west - self.west
        return slice(top, top + inner.n_rows), slice(left, left + inner.n_cols)

    def bounds(self, cell_m: float) -> Bounds:
        """Return the rectangle that the cells cover. [m, world]"""  # noqa: D400
        return Bounds(self.west * cell_m, self.south * cell_m, self.east * cell_m, self.north * cell_m)

    def grid(self, cell_m: float) -> Grid:
        """Return the cells as a grid."""
        return Grid(self.west * cell_m, self.north * cell_m, cell_m, cell_m, self.n_rows, self.n_cols)

    def blocks(self, cell_m: float) -> tuple[IntArray, IntArray]:
        """Return the numbers of the blocks that the centres of rows (n_rows,) and columns (n_cols,) lie in."""
        rows = self.north - 1 - np.arange(self.n_rows)
        cols = self.west + np.arange(self.n_cols)
        return block_of(rows, cell_m), block_of(cols, cell_m)


def block_of(cells: IntArray, cell_m: float) -> IntArray:
    """Return the block, along one axis, that holds the centre of each cell.

    >>> block_of(np.array([-1, 0, 127, 128]), 0.5).tolist()
    [-1, 0, 0, 1]
    """
    return np.asarray(np.floor((cells + 0.5) * cell_m / SURFACE_BLOCK_M), dtype=np.int64)


# The vehicle's path over the cells: where the road is sure to be

#: The road is under the wheels: so far from the path in plan. [m]
NEAR_PATH_M = 1.0
#: Heights of the path over the road are alike within this: a metre less than any bridge is high. [m]
SAME_DROP_M = 1.0
#: A path recorded every second at 130 km/h has steps of 36 m; a longer one leads from one drive to the next. [m]
MAX_PATH_STEP_M = 50.0


def path_samples(trajectory: Trajectory | None, cell_m: float) -> FloatArray:
    """Return places (n, 3) on the path, half a cell apart. [m, world]"""  # noqa: D400
    if trajectory is None or len(trajectory) == 0:
        return np.zeros((0, 3))
    step = np.hypot(*np.diff(trajectory.xyz[:, :2], axis=0).T)
    # Jumps have no length, so there is no place on them
    chainage = np.concatenate([[0.0], np.cumsum(np.where(step <= MAX_PATH_STEP_M, step, 0.0))])
    at = np.arange(0.0, chainage[-1] + cell_m, cell_m / 2)
    return np.stack([np.interp(at, chainage, trajectory.xyz[:, axis]) for axis in range(3)], axis=-1)


def drops_of_cells(
    path: FloatArray, window: CellWindow, height: Float32Array, smooth: BoolArray, z0_m: float, cell_m: float
) -> tuple[AnyArray, Float32Array]:
    """Return the smooth cells (flat indices (n,)) near the path, and how far below it they are (n, 2) [m].

    Least and largest: a path may pass over a place more than once, at different heights.
    """
    if len(path) == 0:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 2), dtype=np.float32)
    reach = max(round(NEAR_PATH_M / cell_m), 1)
    least, most = kernels.drops_below(path, window.west, window.south, height, cell_m, z0_m, reach)
    cells = np.flatnonzero(smooth & ~np.isnan(least))
    return cells, np.stack([least.ravel()[cells], most.ravel()[cells]], axis=-1)


def under_the_wheels(drops: Float32Array) -> BoolArray:
    """Return which of the cells (n,) are road, by how far they lie below the path (n, 2).

    A path may be at the antenna's height: the usual distance below it tells the road from a bridge deck
    overhead, where that is all that was seen.
    """
    if len(drops) == 0:
        return np.zeros(0, dtype=bool)
    usual = np.median(drops[:, 0])
    return np.asarray((np.abs(drops - usual) <= SAME_DROP_M).any(axis=1))
