"""Points under a tile, read patch by patch with their height above the road, in a cache of limited size."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, Float32Array, FloatArray, distance_along
from linework.files.store.read import PointStore
from linework.kernels.cells.tile_cells import divided_by
from linework.model.grid import Bounds
from linework.runs.opened.surface import SurveySurface
from linework.surface.road import height_above_road, is_road_point
from linework.workbench.views.pyramid import TILE_BLOCK_M, MapTile

#: Most points of a patch: 20 MB while it is kept, 70 MB while it is read.
MOST_PATCH_POINTS = 1_000_000
#: Memory of the patches that are kept. [bytes]
PATCH_CACHE_BYTES = 128 << 20


@dataclass(frozen=True, slots=True)
class PointPatch:
    """The points of a square, unordered.

    Parameters
    ----------
    corner
        South-west corner, and the height origin of the surface. [m, world]
    x, y, z
        (n,) float32 from the corner. [m]
    above
        (n,) float32: height above the road [m], NaN where it is unknown.
    intensity
        (n,) uint16: asphalt is `ASPHALT` if the van's path is known, else as recorded; 0 if the survey has none.
    """

    corner: tuple[float, float, float]
    x: Float32Array
    y: Float32Array
    z: Float32Array
    above: Float32Array
    intensity: AnyArray

    def __len__(self) -> int:
        return len(self.x)

    @property
    def columns(self) -> tuple[AnyArray, ...]:
        """The columns x, y, z, above, intensity."""
        return self.x, self.y, self.z, self.above, self.intensity

    @property
    def n_bytes(self) -> int:
        """Memory of the columns. [bytes]"""  # noqa: D400
        return sum(column.nbytes for column in self.columns)


class PatchReader:
    """Reads the points of any rectangle.

    Parameters
    ----------
    surface
        None: heights above the road are unknown.
    path
        (k, 2) vertices of the van's path [m, world]; None: intensities stay as recorded.
    """

    def __init__(
        self, store: PointStore, surface: SurveySurface | None, path: FloatArray | None = None
    ) -> None:
        self.store, self.surface = store, surface
        self._asphalt = None if surface is None or path is None else asphalt_level(store, surface, path)
        self.z0_m = surface.z0_m if surface is not None else 0.0
        blocks, counts = store.block_counts
        #: Number of points by block (east, north).
        self.counts = {(e, n): k for (e, n), k in zip(blocks.tolist(), counts.tolist(), strict=True)}
        self._kept: OrderedDict[MapTile, PointPatch] = OrderedDict()
        self._n_bytes = 0

    def patches(self, bounds: Bounds, *, keep: bool = True) -> Iterator[PointPatch]:
        """Yield the patches that hold the points of a rectangle, row-major from the south-west.

        Parameters
        ----------
        keep
            Keep them in the cache.
        """
        for tile in self._patches_over(bounds):
            yield self._patch(tile, keep)

    def count_in(self, bounds: Bounds) -> int:
        """Return the number of points in the blocks that overlap a rectangle."""
        return sum(self.counts.get((tile.east, tile.north), 0) for tile in tiles_over(bounds, 0))

    def _patches_over(self, bounds: Bounds) -> Iterator[MapTile]:
        for block in tiles_over(bounds, 0):
            n = self.counts.get((block.east, block.north), 0)
            if n == 0:
                continue
            level = -max(0, math.ceil(math.log(n / MOST_PATCH_POINTS, 4.0)))
            for tile in tiles_over(bounds, level):
                if tile.east >> -level == block.east and tile.north >> -level == block.north:
                    yield tile

    def _patch(self, tile: MapTile, keep: bool) -> PointPatch:
        found = self._kept.get(tile)
        if found is not None:
            self._kept.move_to_end(tile)
            return found
        patch = self._read(tile.bounds)
        if keep:
            self._kept[tile] = patch
            self._n_bytes += patch.n_bytes
            while self._n_bytes > PATCH_CACHE_BYTES and len(self._kept) > 1:
                self._n_bytes -= self._kept.popitem(last=False)[1].n_bytes
        return patch

    def _read(self, bounds: Bounds) -> PointPatch:
        points = self.store.points(bounds, ordered=False, with_time=False, with_columns=False)
        n = len(points)
        xyz, intensity = points.xyz, points.intensity
        above = np.full(n, np.nan, np.float32)
        if self.surface is not None and n:
            # Heights are interpolated between the centres of cells, also of those beyond the edge
            above = height_above_road(self.surface.over(bounds.grown(self.surface.cell_m)), xyz)
        x, y, z = (
            (xyz[:, i] - origin).astype(np.float32)
            for i, origin in enumerate((bounds.west, bounds.south, self.z0_m))
        )
        bright = np.zeros(n, np.uint16) if intensity is None else intensity.astype(np.uint16)
        if self._asphalt is not None:
            bright = self._asphalt.normalised(x, y, bright, bounds)
        return PointPatch((bounds.west, bounds.south, self.z0_m), x, y, z, above, bright)


def tiles_over(bounds: Bounds, level: int) -> Iterator[MapTile]:
    """Yield the tiles of a level that overlap a rectangle, row-major from the south-west.

    >>> [(t.east, t.north) for t in tiles_over(Bounds(0.0, 10.0, 64.0, 70.0), 0)]
    [(0, 0), (0, 1)]
    """
    size = math.ldexp(TILE_BLOCK_M, level)
    last = math.ceil(bounds.east / size), math.ceil(bounds.north / size)
    for north in range(math.floor(bounds.south / size), last[1]):
        for east in range(math.floor(bounds.west / size), last[0]):
            yield MapTile(level, east, north)


# Intensity of asphalt by distance from the van's path; intensities divided by it show paint at any distance alike

#: Normalised intensity of asphalt: whole numbers are fine enough then.
ASPHALT = 1000.0
#: Width of a distance bin, largest distance, and spacing of the nodes between which the level is interpolated. [m]
_BIN_M, _FARTHEST_M, _NODE_M = 0.5, 40.0, 1.0
#: Fewest road points that give the level of a bin, and number of blocks that are sampled.
_LEAST, _N_BLOCKS = 300, 12
#: Quantile of the road points' intensity that is asphalt: the darkest ground, darker than plants beside the road.
_SHARE = 0.3
#: Height of the scanner above the road: beyond the road the level falls with the range from it. [m]
_MOUNT_M = 2.2
#: Points within this height above the road are road. [m]
_ROAD_M = 0.03
#: Bins of the running median along the distance.
_MEDIAN_BINS = 5


@dataclass(frozen=True, slots=True)
class AsphaltLevel:
    """Intensity of asphalt by distance from the van's path.

    Parameters
    ----------
    path
        Places of the path, in plan.
    level
        (n,) recorded intensities at distances (k + 0.5) `_BIN_M`.
    """

    path: cKDTree
    level: FloatArray

    def normalised(self, x: AnyArray, y: AnyArray, intensity: AnyArray, bounds: Bounds) -> AnyArray:
        """Return (n,) uint16 intensities, asphalt at `ASPHALT`, of points x, y (n,) [m] from the corner of bounds."""
        cols, rows = (int(np.ceil(side / _NODE_M)) + 1 for side in (bounds.width_m, bounds.height_m))
        east, north = np.meshgrid(
            bounds.west + _NODE_M * np.arange(cols), bounds.south + _NODE_M * np.arange(rows)
        )
        apart, _ = self.path.query(
            np.column_stack([east.ravel(), north.ravel()]), distance_upper_bound=_FARTHEST_M
        )
        at = np.minimum(apart, _FARTHEST_M) / _BIN_M - 0.5
        level = np.interp(at, np.arange(len(self.level)), self.level).reshape(rows, cols)
        return np.asarray(divided_by(x, y, intensity, level / ASPHALT, _NODE_M))


def asphalt_level(store: PointStore, surface: SurveySurface, path: FloatArray) -> AsphaltLevel | None:
    """Return the level of asphalt of a survey from the road points of sampled blocks; None: unknown.

    Parameters
    ----------
    path
        (k, 2) vertices of the van's path [m, world], closer to each other than its width.
    """
    if len(path) == 0 or not store.facts.get("has_intensity", True):
        return None
    along = distance_along(path)
    tree = cKDTree(path[np.unique(np.floor(along / _BIN_M), return_index=True)[1]])
    blocks, _ = store.block_counts
    values: list[list[AnyArray]] = [[] for _ in range(int(_FARTHEST_M / _BIN_M))]
    for east, north in blocks[:: max(1, len(blocks) // _N_BLOCKS)].tolist():
        corner = east * TILE_BLOCK_M, north * TILE_BLOCK_M
        bounds = Bounds(*corner, corner[0] + TILE_BLOCK_M, corner[1] + TILE_BLOCK_M)
        points = store.points(bounds, ordered=False, with_time=False, with_columns=False)
        if points.intensity is None:
            return None
        road = points.take(is_road_point(surface.over(bounds.grown(surface.cell_m)), points.xyz, _ROAD_M))
        cells = ((road.xyz[:, :2] - corner) / _BIN_M).astype(np.int64)
        apart = _distances(tree, corner)[cells[:, 1], cells[:, 0]]
        bins = np.minimum(apart / _BIN_M, len(values)).astype(np.int64)
        order = np.argsort(bins, kind="stable")
        parts = np.split(
            np.asarray(road.intensity)[order], np.searchsorted(bins[order], np.arange(len(values) + 1))
        )
        for k, part in enumerate(parts[1:-1]):
            values[k].append(part)
    return _fitted(tree, [np.concatenate(parts) if parts else np.zeros(0) for parts in values])


def _distances(path: cKDTree, corner: tuple[float, float]) -> FloatArray:
    """Return (n, n) distances of the centres of a block's cells of `_BIN_M` from the path, row 0 south. [m]"""  # noqa: D400
    middles = _BIN_M * (np.arange(round(TILE_BLOCK_M / _BIN_M)) + 0.5)
    east, north = np.meshgrid(corner[0] + middles, corner[1] + middles)
    apart, _ = path.query(np.stack([east, north], axis=-1), distance_upper_bound=_FARTHEST_M)
    return np.asarray(apart)


def _fitted(path: cKDTree, values: list[AnyArray]) -> AsphaltLevel | None:
    known = np.array([k for k, v in enumerate(values) if len(v) >= _LEAST])
    if len(known) == 0:
        return None
    levels = median_filter(
        np.array([np.quantile(values[k], _SHARE) for k in known]), _MEDIAN_BINS, mode="nearest"
    )
    every = np.arange(len(values))
    # It falls with the distance: where it seems to rise there is grass beside the road
    level = np.minimum.accumulate(np.interp(every, known, np.maximum(levels, 1.0)))
    reach = np.hypot((every + 0.5) * _BIN_M, _MOUNT_M)
    beyond = every > known[-1]
    level[beyond] *= reach[known[-1]] / reach[beyond]
    return AsphaltLevel(path, level)
