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

#: Points of a cell that may all be stray: two or three are near each other now and then. [points]
_THIN = 3
#: A survey is dense in which cells of a single lowest point hold at most this share of the points: one from the air with
#: 5 points a cell has a fifth there. [ratio]
_MOST_LONE = 0.05
#: How far, and up to which slope, cells continue a thin one: near ones on the steepest banks, farther ones on level ground;
#: and how many continue a true one: a ring of a turning lidar has more. [m], [m/m], [cells]
_CONTINUED, _LEAST = ((2.0, 0.67), (4.0, 0.05)), 3


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
    return max(_cells_within(reach_m, config) for reach_m, _ in _CONTINUED)


def _cells_within(reach_m: float, config: RoadConfig) -> int:
    return max(round(reach_m / config.cell_m), 1)


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
    is_thin = _is_lone(height, spread) | (count <= _THIN)
    inner = height[halo:-halo, halo:-halo]
    is_kept = np.zeros(inner.shape, dtype=np.bool_)
    for reach_m, slope in _CONTINUED:
        reach = _cells_within(reach_m, config)
        part = np.s_[
            halo - reach : height.shape[0] - halo + reach, halo - reach : height.shape[1] - halo + reach
        ]
        is_kept |= kernels.supported_cells(
            np.ascontiguousarray(height[part]), np.ascontiguousarray(is_thin[part]), reach, slope * config.cell_m,
            config.layer_m, _LEAST,
        )  # fmt: skip
    return np.where(is_kept, inner, np.float32(np.nan))


def _is_lone(height: Float32Array, spread: Float32Array) -> BoolArray:
    """Return which cells have a lowest layer of one point: it has a height, and no spread."""
    return np.asarray(np.isnan(spread) & ~np.isnan(height))
