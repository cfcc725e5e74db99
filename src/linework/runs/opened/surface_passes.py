"""The passes over tiles of the surface: tasks carry names and settings, and write arrays to a folder.

Separate from `surface`, which decides for the whole survey: these run in worker processes, a tile at a time.

heights -> regions -> (regions are united and chosen) -> coarse heights -> carried on
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Protocol

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray
from linework.files.store.cell_tiles import SurfaceTiles, TileNumber
from linework.files.store.read import PointStore
from linework.model.grid import Bounds
from linework.model.points import Points
from linework.surface.aside import BESIDE_M, RoadAside, smooth_aside
from linework.surface.bare_earth import block_halos, block_sizes
from linework.surface.blocks import N_BLOCK_PLANES, BlockHeights, blocks_over
from linework.surface.carry import CoarseGround, extended_surface, halo_cells
from linework.surface.cells import NEAR_PATH_M, SURFACE_BLOCK_M, CellWindow
from linework.surface.config import RoadConfig
from linework.surface.heights import CellHeights, SpreadsUnder, UnevenLimits, cell_heights, count_spreads
from linework.surface.regions import CellRegions, Islands, RegionFacts, cell_regions, cells_with, region_halo
from linework.surface.strays import LoneCells, stray_halo, without_strays

#: Samples of the path in each box by which it is looked up: 256 m of path. [samples]
PATH_BOX = 1024
#: Names of the arrays that are needed only while the surface is made: height, spread and number of points of
#: the cells as measured; the same without strays, and heights of blocks of them; road and ground labels; edges; road and ground labels that were chosen.
MEASURED, CELLS, LABEL_ARRAY, EDGES, CHOSEN = "measured", "cells", "labels", "edges", "chosen"
#: For all tiles: samples and boxes of the path; codes and numbers of islands.
PATH, ISLANDS, UNEVEN = "path", "islands", "uneven"
#: Sigma of a ground that is not known, in a tile's surface.
NOT_KNOWN = 65535
#: The sigma of each value. [m]
_SIGMA_M = np.append(np.arange(NOT_KNOWN, dtype=np.float32) / np.float32(1e3), np.float32(np.nan))
#: Arrays that stay: road, ground, kind and sigma of the cells; coarse ground.
SURFACE, COARSE = "surface", "coarse"
#: Index of road and of ground in arrays that hold both, and of the number of points in those of cells.
_ROAD, _GROUND, _COUNT = 0, 1, 2
#: Index of the first of the planes of blocks, behind those of cells: lowest heights and known cells, size by size.
_FIRST_BLOCKS = 3
#: Record of each cell along the edges of a tile, two cells deep.
_EDGE = np.dtype([("height", "f4"), ("east", "f4"), ("north", "f4"), ("road", "i4"), ("ground", "i4")])
_SIDES = {"west": np.s_[:, :2], "east": np.s_[:, -2:], "north": np.s_[:2, :], "south": np.s_[-2:, :]}


class PointSource(Protocol):
    """Points in any rectangle: the part of `PointStore` that the passes need."""

    def points(
        self, bounds: Bounds, *, ordered: bool, with_time: bool, with_intensity: bool, with_columns: bool
    ) -> Points:
        """Return the points in a rectangle [m, world]."""
        ...

    @property
    def block_counts(self) -> tuple[IntArray, IntArray]:
        """Blocks of 64 m (n, 2) int64, numbered east and north, and the points in each."""
        ...


@dataclass(frozen=True, slots=True)
class SurfaceTileTask:
    """One tile in one pass.

    Parameters
    ----------
    source
        Folder of the store, or another source of points.
    z0_m
        Local height origin of the whole survey. [m, world]
    rough_limit_m
        Spread of the lowest layer above which a cell is rough [m]; not known yet in the first pass.
    is_dense
        Whether single low cells may be stray; not known yet in the first pass.
    """

    source: Path | PointSource
    tiles: SurfaceTiles
    tile: TileNumber
    config: RoadConfig
    z0_m: float
    rough_limit_m: float = np.nan
    is_dense: bool = False


def find_heights(task: SurfaceTileTask) -> tuple[IntArray, SpreadsUnder, LoneCells]:
    """Write the heights of a tile's cells.

    Returns
    -------
    spreads, under, lone
        Histogram of the spreads of the cells (empty: no points), those under the path, and the lone cells.
    """
    cell_m = task.config.cell_m
    # Edges that binary fractions do not hit: points on them may lie either way, so a little more is read
    margin_m = 0.0 if (cell_m * 1024).is_integer() else 1e-3
    source = _opened(task.source) if isinstance(task.source, Path) else task.source
    bands = []
    for band in _bands(task.tiles.window(task.tile), cell_m):
        points = source.points(
            band.bounds(cell_m).grown(margin_m),
            ordered=False,
            with_time=False,
            with_intensity=False,
            with_columns=False,
        )
        bands.append(cell_heights(points.xyz, band, task.z0_m, task.config))
    height, spread, count = (
        np.concatenate([getattr(band, name) for band in bands]) for name in ("height", "spread", "count")
    )
    if not count.any():
        return np.zeros(0, dtype=np.int64), SpreadsUnder.added([]), LoneCells()
    window = task.tiles.window(task.tile)
    task.tiles.write(MEASURED, task.tile, height, spread, count)
    heights = CellHeights(window, height, spread, count)
    path = _path_near(task.tiles, window.bounds(cell_m))
    return count_spreads(spread), SpreadsUnder.of(path, heights, task.z0_m, cell_m), LoneCells.of(heights)


def leave_strays_out(task: SurfaceTileTask) -> bool:
    """Write the heights of a tile's cells without stray ones, and those of blocks; return True."""
    tiles, window, config = task.tiles, task.tiles.window(task.tile), task.config
    height, spread, count = tiles.read(MEASURED, task.tile)
    if task.is_dense:
        around = window.grown(stray_halo(config))
        near, near_spread = (tiles.over(MEASURED, which, around, np.float32(np.nan)) for which in (0, 1))
        height = without_strays(near, near_spread, tiles.over(MEASURED, _COUNT, around, np.int32(0)), config)
    blocks = [BlockHeights.of(window, height, size) for size in block_sizes(config)]
    tiles.write(CELLS, task.tile, height, spread, count, *(plane for b in blocks for plane in b.planes))
    return True


def _bands(window: CellWindow, cell_m: float) -> Iterator[CellWindow]:
    """Yield bands of rows of a window from the north, each as high as a block, so that few points are in memory."""
    n = max(math.floor(SURFACE_BLOCK_M / cell_m), 1)
    for first in range((window.north - 1) // n, window.south // n - 1, -1):
        band = window.common(CellWindow(window.west, first * n, n, window.n_cols))
        if band:
            yield band


@lru_cache(maxsize=1)
def _opened(folder: Path) -> PointStore:
    return PointStore.open(folder)


def find_regions(task: SurfaceTileTask) -> RegionFacts:
    """Write the labels of a tile's cells and its edges for the neighbours; return facts about its regions."""
    tiles, window, config = task.tiles, task.tiles.window(task.tile), task.config
    _, spread, count, *_ = tiles.read(CELLS, task.tile)
    regions, facts = cell_regions(
        window,
        tiles.over(CELLS, 0, window.grown(region_halo(config)), np.float32(np.nan)),
        _blocks_around(tiles, window, config),
        spread,
        count,
        _path_near(tiles, window.bounds(config.cell_m)),
        Islands(*tiles.read_common(ISLANDS)),
        task.rough_limit_m,
        UnevenLimits(*tiles.read_common(UNEVEN)).over(window, config.cell_m),
        task.is_dense,
        task.z0_m,
        config,
    )
    tiles.write(LABEL_ARRAY, task.tile, regions.road, regions.ground)
    tiles.write(EDGES, task.tile, *(_edge(regions, part) for part in _SIDES.values()))
    return facts


def _blocks_around(tiles: SurfaceTiles, window: CellWindow, config: RoadConfig) -> dict[int, BlockHeights]:
    """Return the blocks on which the regions of a window depend."""
    halos = block_halos(config)
    wanted = {size: blocks_over(window, size).grown(halos[size]) for size in block_sizes(config)}
    parts: dict[int, list[BlockHeights]] = {size: [] for size in wanted}
    halo = max(((halos[size] + 1) * size for size in wanted), default=0)
    for tile in tiles.touching(window.grown(halo)):
        if tiles.has(CELLS, tile):
            planes = tiles.read(CELLS, tile, first=_FIRST_BLOCKS)
            for i, size in enumerate(wanted):
                over = blocks_over(tiles.window(tile), size)
                own = planes[i * N_BLOCK_PLANES : (i + 1) * N_BLOCK_PLANES]
                parts[size].append(BlockHeights.of_planes(size, over, own))
    return {size: BlockHeights.united(size, over, parts[size]) for size, over in wanted.items()}


def edge_cells(tiles: SurfaceTiles, tile: TileNumber, side: str) -> CellRegions:
    """Return the two columns or rows of a tile's cells along its "west", "east", "north" or "south" edge."""
    edge = tiles.read(EDGES, tile)[list(_SIDES).index(side)]
    return CellRegions(tiles.window(tile), *(np.array(edge[name]) for name in _EDGE.names or ()))


def _edge(regions: CellRegions, part: tuple[slice, slice]) -> AnyArray:
    planes = regions.height, regions.slope_east, regions.slope_north, regions.road, regions.ground
    edge = np.empty(regions.height[part].shape, dtype=_EDGE)
    for name, plane in zip(_EDGE.names or (), planes, strict=True):
        edge[name] = plane[part]
    return edge


def path_boxes(path: FloatArray) -> FloatArray:
    """Return west, south, east, north (k, 4) of each stretch of `PATH_BOX` samples."""
    starts = np.arange(0, len(path), PATH_BOX)
    if len(starts) == 0:
        return np.zeros((0, 4))
    low = np.minimum.reduceat(path[:, :2], starts, axis=0)
    high = np.maximum.reduceat(path[:, :2], starts, axis=0)
    return np.concatenate([low, high], axis=1)


def _path_near(tiles: SurfaceTiles, bounds: Bounds) -> FloatArray:
    """Return all samples of the path that can be near cells of the bounds; a few more do no harm."""
    near = bounds.grown(2.0 * NEAR_PATH_M + 5.0)  # cells are 5 m at most
    path, boxes = tiles.read_common(PATH)
    hit = (boxes[:, 0] <= near.east) & (boxes[:, 2] >= near.west)
    hit &= (boxes[:, 1] <= near.north) & (boxes[:, 3] >= near.south)
    parts = [path[i * PATH_BOX : (i + 1) * PATH_BOX] for i in np.flatnonzero(hit)]
    return np.concatenate([np.zeros((0, 3)), *parts])


def coarse_heights(task: SurfaceTileTask) -> CoarseGround:
    """Return the mean heights of a tile's ground in blocks of 64 m."""
    height, *_ = task.tiles.read(CELLS, task.tile)
    window = task.tiles.window(task.tile)
    return CoarseGround.of(window, height, _ground_cells(task.tiles, window), task.config.cell_m)


def extend_tile_surface(task: SurfaceTileTask) -> tuple[bool, RoadAside]:
    """Write road and ground of a tile; return whether there is either nearby, and what lies beside its roads."""
    tiles, window, config = task.tiles, task.tiles.window(task.tile), task.config
    around = window.grown(halo_cells(config))
    is_road = _cells_of(tiles, _ROAD, around)
    is_ground = is_road | _cells_of(tiles, _GROUND, around)
    if not is_ground.any():
        return False, RoadAside()
    height = tiles.over(CELLS, 0, around, np.float32(np.nan))
    coarse = CoarseGround(*tiles.read_common(COARSE))
    spread = tiles.over(CELLS, 1, window, np.float32(np.nan))
    road_m, ground_m, sigma_m = extended_surface(window, height, spread, is_road, is_ground, coarse, config)
    inner = around.part(window)
    kind = kind_of(is_road[inner], is_ground[inner])
    tiles.write(SURFACE, task.tile, road_m, ground_m, kind, packed_sigma(sigma_m))
    near = window.grown(min(math.ceil(BESIDE_M / config.cell_m) + 1, halo_cells(config)))
    part = around.part(near)
    is_smooth = tiles.over(LABEL_ARRAY, _ROAD, near, np.int32(0)) > 0
    count = tiles.over(CELLS, _COUNT, near, np.int32(0))
    return True, smooth_aside(
        np.ascontiguousarray(is_road[part]), is_smooth, count, near.part(window), config.cell_m
    )


def packed_sigma(sigma_m: Float32Array) -> AnyArray:
    """Return the fourth array of a tile's surface: (rows, cols) uint16 sigma in millimetres, `NOT_KNOWN` for NaN."""
    return np.where(np.isnan(sigma_m), NOT_KNOWN, np.rint(sigma_m * 1e3).clip(0, NOT_KNOWN - 1)).astype(
        np.uint16
    )


def unpacked_sigma(sigma: AnyArray) -> Float32Array:
    """Return the sigma [m], (rows, cols) float32, of the fourth array of a tile's surface."""
    return np.asarray(_SIGMA_M.take(sigma))


def kind_of(is_road: BoolArray, is_ground: BoolArray) -> AnyArray:
    """Return the third array of a tile's surface: (rows, cols) uint8, a bit for road and one for ground."""
    kind: AnyArray = is_road.view(np.uint8) << _ROAD | is_ground.view(np.uint8) << _GROUND
    return kind


def is_kind(kind: AnyArray) -> tuple[BoolArray, BoolArray]:
    """Return which cells are road and which are ground, from the third array of a tile's surface."""
    return (kind & (1 << _ROAD)) != 0, (kind & (1 << _GROUND)) != 0


def _ground_cells(tiles: SurfaceTiles, window: CellWindow) -> BoolArray:
    """Return the cells of a window that are ground: a road is, also on a bridge whose edges are steep."""
    return _cells_of(tiles, _ROAD, window) | _cells_of(tiles, _GROUND, window)


def _cells_of(tiles: SurfaceTiles, what: int, window: CellWindow) -> BoolArray:
    """Return the cells of a window whose labels were chosen as road, or as ground."""
    out = np.zeros(window.shape, dtype=bool)
    for tile in tiles.touching(window):
        labels = tiles.part(LABEL_ARRAY, what, tile, window)
        # Labels without a choice: a later pass of the tile has failed
        if labels is not None and tiles.has(CHOSEN, tile):
            out[tiles.place(tile, window)] = cells_with(labels, tiles.read(CHOSEN, tile)[what])
    return out
