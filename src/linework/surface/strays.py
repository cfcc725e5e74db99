"""Cells of stray points: in a dense survey, single points or few that no cell around them continues.

Points anywhere in the air or below the ground, of rain, of birds, of a receiver that fires by itself, are the lowest of
cells beside the road, and there what is known of the ground.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array
from linework.kernels.cells import openings as kernels
from linework.surface.config import RoadConfig
from linework.surface.heights import CellHeights

#: How far a cell is looked for that continues a thin one. [m]
_REACH_M = 2.0
#: Points of a cell that may all be stray: two or three are near each other now and then. [points]
_THIN = 3
#: A survey is dense in which cells of a single lowest point hold at most this share of the points: one from the air with
#: 5 points a cell has a fifth there. [ratio]
_MOST_LONE = 0.05
#: Slope up to which cells continue each other, the steepest of banks, and how many continue a true one: a ring of a
#: turning lidar has more. [m/m], [cells]
_SLOPE, _LEAST = 0.67, 3


class LoneCells(NamedTuple):
    """Points of cells, and cells whose lowest layer is a single one; numbers of tiles add up."""

    n_points: int = 0
    n_lone: int = 0

    @classmethod
    def of(cls, heights: CellHeights) -> LoneCells:
        """Count in the cells of a window."""
        return cls(int(heights.count.sum()), int(np.count_nonzero(_is_lone(heights.height, heights.spread))))

    @classmethod
    def added(cls, parts: Iterable[LoneCells]) -> LoneCells:
        """Return the sums."""
        n_points, n_lone = np.array([(0, 0), *parts]).sum(axis=0).tolist()
        return cls(n_points, n_lone)

    @property
    def is_dense(self) -> bool:
        """Whether single points are so few that the survey is known without them: they may be stray."""
        return self.n_lone <= _MOST_LONE * self.n_points


def stray_halo(config: RoadConfig) -> int:
    """Return the width of the halo of cells around a window on which its strays depend. [cells]."""
    return max(round(_REACH_M / config.cell_m), 1)


def without_strays(
    height: Float32Array, spread: Float32Array, count: AnyArray, config: RoadConfig
) -> Float32Array:
    """Return the heights of the cells of a window, NaN where the lowest point is stray.

    Parameters
    ----------
    height, spread, count
        (n_rows + 2 h, n_cols + 2 h) float32 [m] and int32 points, with a halo of h = `stray_halo`; NaN in empty cells.
    """
    halo = stray_halo(config)
    is_kept: BoolArray = kernels.supported_cells(
        np.ascontiguousarray(height),
        _is_lone(height, spread) | (count <= _THIN),
        halo,
        _SLOPE * config.cell_m,
        config.layer_m,
        _LEAST,
    )
    inner = height[halo:-halo, halo:-halo]
    return np.where(is_kept, inner, np.float32(np.nan))


def _is_lone(height: Float32Array, spread: Float32Array) -> BoolArray:
    """Return which cells have a lowest layer of one point: it has a height, and no spread."""
    return np.asarray(np.isnan(spread) & ~np.isnan(height))
