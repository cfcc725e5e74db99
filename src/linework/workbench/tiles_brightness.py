"""How bright asphalt is at a distance from the van's way: what is divided by it is paint wherever it lies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, FloatArray
from linework.files.store_read import PointStore
from linework.kernels.tile_cells import divided_by
from linework.model.grid import Bounds
from linework.surface.road import is_road_point
from linework.tiling.surfaces import SurveySurface
from linework.workbench.tiles import BLOCK_M

#: Normalised intensities are whole numbers: asphalt is this.
ASPHALT = 1000.0
#: Distances are told apart by this, up to the last; the level is smooth between nodes a metre apart. [m]
_BIN_M, _FARTHEST_M, _NODE_M = 0.5, 40.0, 1.0
#: From so many points of the road a level is known; so many blocks are the survey.
_LEAST, _N_BLOCKS = 300, 12
#: Asphalt is the darkest ground: of the road's points so many are surely darker than what grows beside it.
_SHARE = 0.3
#: Beyond the road the level goes on to fall, with the range from a scanner so high. [m]
_MOUNT_M = 2.2


@dataclass(frozen=True, slots=True)
class AsphaltLevel:
    """Level of asphalt over the distance from the van's way.

    Parameters
    ----------
    way
        The way's places, in plan.
    level
        (n,) intensities as recorded, at distances of whole `_BIN_M` and a half.
    """

    way: cKDTree
    level: FloatArray

    def normalised(self, x: AnyArray, y: AnyArray, intensity: AnyArray, bounds: Bounds) -> AnyArray:
        """Return (n,) uint16 intensities with asphalt at `ASPHALT`, of points in bounds, counted from their corner."""
        cols, rows = (int(np.ceil(side / _NODE_M)) + 1 for side in (bounds.width_m, bounds.height_m))
        east, north = np.meshgrid(
            bounds.west + _NODE_M * np.arange(cols), bounds.south + _NODE_M * np.arange(rows)
        )
        apart, _ = self.way.query(
            np.column_stack([east.ravel(), north.ravel()]), distance_upper_bound=_FARTHEST_M
        )
        at = np.minimum(apart, _FARTHEST_M) / _BIN_M - 0.5
        level = np.interp(at, np.arange(len(self.level)), self.level).reshape(rows, cols)
        return np.asarray(divided_by(x, y, intensity, level / ASPHALT, _NODE_M))


def asphalt_level(store: PointStore, surface: SurveySurface, path: FloatArray) -> AsphaltLevel | None:
    """Return the level of asphalt of a survey, by the road's points of a sample of blocks; None: not known.

    Parameters
    ----------
    path
        (k, 2) places of the van's way [m, world], closer to one another than it is wide.
    """
    if len(path) == 0 or not store.facts.get("has_intensity", True):
        return None
    along = np.r_[0.0, np.cumsum(np.hypot(*np.diff(path, axis=0).T))]
    way = cKDTree(path[np.unique(np.floor(along / _BIN_M), return_index=True)[1]])
    blocks, _ = store.block_counts
    values: list[list[AnyArray]] = [[] for _ in range(int(_FARTHEST_M / _BIN_M))]
    for east, north in blocks[:: max(1, len(blocks) // _N_BLOCKS)].tolist():
        corner = east * BLOCK_M, north * BLOCK_M
        bounds = Bounds(*corner, corner[0] + BLOCK_M, corner[1] + BLOCK_M)
        points = store.points(bounds, ordered=False, with_time=False)
        if points.intensity is None:
            return None
        road = points.take(is_road_point(surface.over(bounds.grown(surface.cell_m)), points.xyz, 0.03))
        cells = ((road.xyz[:, :2] - corner) / _BIN_M).astype(np.int64)
        apart = _distances(way, corner)[cells[:, 1], cells[:, 0]]
        bins = np.minimum(apart / _BIN_M, len(values)).astype(np.int64)
        order = np.argsort(bins, kind="stable")
        parts = np.split(
            np.asarray(road.intensity)[order], np.searchsorted(bins[order], np.arange(len(values) + 1))
        )
        for k, part in enumerate(parts[1:-1]):
            values[k].append(part)
    return _fitted(way, [np.concatenate(parts) if parts else np.zeros(0) for parts in values])


def _distances(way: cKDTree, corner: tuple[float, float]) -> FloatArray:
    """Return the distance from the way of the middles of a block's cells of `_BIN_M`, row 0 south. [m]"""  # noqa: D400
    middles = _BIN_M * (np.arange(round(BLOCK_M / _BIN_M)) + 0.5)
    east, north = np.meshgrid(corner[0] + middles, corner[1] + middles)
    apart, _ = way.query(np.stack([east, north], axis=-1), distance_upper_bound=_FARTHEST_M)
    return np.asarray(apart)


def _fitted(way: cKDTree, values: list[AnyArray]) -> AsphaltLevel | None:
    known = np.array([k for k, v in enumerate(values) if len(v) >= _LEAST])
    if len(known) == 0:
        return None
    levels = median_filter(np.array([np.quantile(values[k], _SHARE) for k in known]), 5, mode="nearest")
    every = np.arange(len(values))
    # It falls with the distance: where it seems to rise, grass lies beside the road
    level = np.minimum.accumulate(np.interp(every, known, np.maximum(levels, 1.0)))
    reach = np.hypot((every + 0.5) * _BIN_M, _MOUNT_M)
    beyond = every > known[-1]
    level[beyond] *= reach[known[-1]] / reach[beyond]
    return AsphaltLevel(way, level)
