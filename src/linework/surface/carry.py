"""Extension of road and ground to every cell, from their nearest cells, blending the road into the ground."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray
from linework.kernels.cells import nearest as kernels
from linework.kernels.cells import planes
from linework.kernels.cells.surface import FIXED
from linework.surface.cells import CellWindow
from linework.surface.config import RoadConfig

#: Distance that the ground is extended from its nearest cell: most of what a van records beside and above a road lies
#: within it. Farther away it is the mean height of the nearest block that has ground. [m]
CARRY_REACH_M = 60.0
#: Distance over which an average replaces the value of the nearest cell, whose rays meet in creases. [m]
_SOFT_M = 2.0
#: Reach of the windows in which the ground is interpolated [m]: across a footway, a car, a lorry; the last one only
#: checks the one before. Least number of ground cells in each quarter of a window: one may be a bush.
_BETWEEN_M, _LEAST_IN_QUARTER = (1.0, 2.0, 4.0, 8.0, 16.0), 2
#: A height that is less sure is not known: half of what tells a kerb's top from the road, at one sigma. [m]
_MOST_SIGMA_M = 0.15


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
    spread: Float32Array,
    is_road: BoolArray,
    is_ground: BoolArray,
    coarse: CoarseGround,
    config: RoadConfig,
) -> tuple[Float32Array, Float32Array, Float32Array]:
    """Return the heights of road and ground in every cell of a window, and the sigma of the ground.

    Each is (n_rows, n_cols) float32 [m]. Between measured cells the ground is interpolated; beyond them it is extended
    from the nearest one, and its sigma is NaN: it is not known there.

    Parameters
    ----------
    height, is_road, is_ground
        (n_rows + 2 h, n_cols + 2 h) float32 [m] and bool, with a halo of h = `halo_cells`.
    spread
        (n_rows, n_cols) float32: of the lowest layer of each cell. [m]
    coarse
        Mean heights of the ground farther away.

    Notes
    -----
    Nothing farther away has an influence, so that every window gives the same result, to the last bit.
    """
    half = _soft_cells(config)
    reach = reach_cells(config)
    ground, gap = _carried_on(height, is_ground, reach, reach, half, config.cell_m)
    between, sigma = _interpolated(height, is_ground, gap, config)
    known = np.isfinite(sigma)
    ground[known] = between[known]
    measured = gap == 0
    sigma[measured] = np.where(np.isnan(spread), np.float32(config.layer_m / math.sqrt(12.0)), spread)[
        measured
    ]
    # As far as the road is the reference, and a little farther for the averages
    near = min(math.ceil(2.0 * config.carry_m / config.cell_m) + half + 1, reach)
    road, square = _carried_on(height, is_road, near, reach, half, config.cell_m)
    far, rows, cols = coarse.over(window, config.cell_m)
    kernels.blend_into_ground(road, square, ground, far, rows, cols, config.cell_m, config.carry_m)
    return road, ground, sigma


def _interpolated(
    height: Float32Array, is_ground: BoolArray, gap: AnyArray, config: RoadConfig
) -> tuple[Float32Array, Float32Array]:
    """Return the heights of cells between measured ones, and their sigma; NaN where they are not known.

    `gap` is the squared distance to the nearest ground in the inner cells, (n_rows, n_cols) [cells**2].
    """
    radii = np.array([max(round(m / config.cell_m), 1) for m in _BETWEEN_M], np.int64)
    halo = int(radii[-1])
    # Cells farther away have no ground in any window
    wanted = (gap > 0) & (gap <= 2 * int(radii[-2]) ** 2)
    cut = (height.shape[0] - gap.shape[0]) // 2 - halo
    near = np.s_[cut : height.shape[0] - cut, cut : height.shape[1] - cut]
    if not wanted.any():
        nothing = np.full(gap.shape, np.nan, np.float32)
        return nothing, nothing.copy()
    known = np.ascontiguousarray(is_ground[near])
    height = np.ascontiguousarray(height[near])
    base = math.floor(float(np.nanmean(height[known])))
    table = planes.summed_moments(height, known, base)
    return planes.interpolated(table, wanted, radii, _LEAST_IN_QUARTER, _MOST_SIGMA_M, halo, base)


def _carried_on(
    height: Float32Array, known: BoolArray, reach: int, margin: int, half: int, cell_m: float
) -> tuple[Float32Array, AnyArray]:
    """Return a surface filled from its nearest cells and smoothed, and the squared distance to them [cells**2]."""
    index, square = kernels.nearest_known_squared(known, reach, margin)
    values = kernels.softened(kernels.heights_by_index(height, index), square, half, cell_m, _SOFT_M)
    inner = slice(half, -half or None)
    return values, np.ascontiguousarray(square[inner, inner])
