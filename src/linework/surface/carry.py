"""Extension of road and ground to every cell, from their nearest cells, blending the road into the ground."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray
from linework.kernels.cells import nearest as kernels
from linework.kernels.cells.surface import FIXED
from linework.surface.cells import CellWindow
from linework.surface.config import RoadConfig

#: Distance that the ground is extended from its nearest cell: most of what a van records beside and above a road lies
#: within it. Farther away it is the mean height of the nearest block that has ground. [m]
CARRY_REACH_M = 60.0
#: Distance over which an average replaces the value of the nearest cell, whose rays meet in creases. [m]
_SOFT_M = 2.0


def reach_cells(config: RoadConfig) -> int:
    """Return the distance that the ground is extended, at least that of the road. [cells]."""
    return math.ceil(max(CARRY_REACH_M, 2.0 * config.carry_m) / config.cell_m)


def halo_cells(config: RoadConfig) -> int:
    """Return the width of the halo around a window on which its surface depends. [cells]."""
    return reach_cells(config) + _soft_cells(config)


def _soft_cells(config: RoadConfig) -> int:
    return round(0.5 * _SOFT_M / config.cell_m)


@dataclass(frozen=True, slots=True)
class CoarseGround:
    """Mean height of the ground in blocks of 64 m.

    Parameters
    ----------
    blocks
        (n, 2) int64 numbers east and north, in order.
    total
        (n,) int64 sum of the heights of the ground cells of the block, in steps of 1 / `FIXED` m.
    cells
        (n,) int64 number of ground cells.
    """

    blocks: IntArray
    total: IntArray
    cells: IntArray

    @classmethod
    def of(
        cls, window: CellWindow, height: Float32Array, is_ground: BoolArray, cell_m: float
    ) -> CoarseGround:
        """Return the sums over the ground cells of one window."""
        rows, cols = window.blocks(cell_m)
        south, west = int(rows.min()), int(cols.min())
        shape = int(rows.max()) - south + 1, int(cols.max()) - west + 1
        total, cells = kernels.block_sums(height, is_ground, rows - south, cols - west, *shape, FIXED)
        r, c = np.nonzero(cells)
        return cls(np.stack([c + west, r + south], axis=-1), total[r, c], cells[r, c])

    @classmethod
    def added(cls, *parts: CoarseGround) -> CoarseGround:
        """Return the sums over several parts of a survey."""
        blocks = np.concatenate([np.zeros((0, 2), np.int64), *(p.blocks for p in parts)])
        blocks, index = np.unique(blocks, axis=0, return_inverse=True)
        total, cells = np.zeros(len(blocks), np.int64), np.zeros(len(blocks), np.int64)
        np.add.at(total, index.ravel(), np.concatenate([np.zeros(0, np.int64), *(p.total for p in parts)]))
        np.add.at(cells, index.ravel(), np.concatenate([np.zeros(0, np.int64), *(p.cells for p in parts)]))
        return cls(blocks, total, cells)

    def near(self, east: IntArray, north: IntArray) -> Float32Array:
        """Return the mean ground height of the nearest block to each, (len(north), len(east)) float32 [m]; NaN without any."""
        if len(self.blocks) == 0:
            return np.full((len(north), len(east)), np.nan, dtype=np.float32)
        # Slightly off centre, so that no two blocks are equally near
        places = np.stack(np.meshgrid(east + 1.2e-4, north + 3.1e-5), axis=-1).reshape(-1, 2)
        nearest = cKDTree(self.blocks).query(places)[1]
        mean: FloatArray = self.total / self.cells / FIXED
        return np.asarray(mean[nearest].reshape(len(north), len(east)), dtype=np.float32)

    def over(self, window: CellWindow, cell_m: float) -> tuple[Float32Array, IntArray, IntArray]:
        """Return the heights of the blocks about a window [m], and the block of each row and of each column."""
        rows, cols = window.blocks(cell_m)
        north, east = np.arange(rows.min(), rows.max() + 1), np.arange(cols.min(), cols.max() + 1)
        return self.near(east, north), rows - north[0], cols - east[0]


def extended_surface(
    window: CellWindow,
    height: Float32Array,
    is_road: BoolArray,
    is_ground: BoolArray,
    coarse: CoarseGround,
    config: RoadConfig,
) -> tuple[Float32Array, Float32Array]:
    """Return the heights of road and ground in every cell of a window, (n_rows, n_cols) float32 each [m].

    Parameters
    ----------
    height, is_road, is_ground
        (n_rows + 2 h, n_cols + 2 h) float32 [m] and bool, with a halo of h = `halo_cells`.
    coarse
        Mean heights of the ground farther away.

    Notes
    -----
    Nothing farther away has an influence, so that every window gives the same result, to the last bit.
    """
    half = _soft_cells(config)
    reach = reach_cells(config)
    ground, _ = _carried_on(height, is_ground, reach, reach, half, config.cell_m)
    # As far as the road is the reference, and a little farther for the averages
    near = min(math.ceil(2.0 * config.carry_m / config.cell_m) + half + 1, reach)
    road, square = _carried_on(height, is_road, near, reach, half, config.cell_m)
    far, rows, cols = coarse.over(window, config.cell_m)
    kernels.blend_into_ground(road, square, ground, far, rows, cols, config.cell_m, config.carry_m)
    return road, ground


def _carried_on(
    height: Float32Array, known: BoolArray, reach: int, margin: int, half: int, cell_m: float
) -> tuple[Float32Array, AnyArray]:
    """Return a surface filled from its nearest cells and smoothed, and the squared distance to them [cells**2]."""
    index, square = kernels.nearest_known_squared(known, reach, margin)
    values = kernels.softened(kernels.heights_by_index(height, index), square, half, cell_m, _SOFT_M)
    inner = slice(half, -half or None)
    return values, np.ascontiguousarray(square[inner, inner])
