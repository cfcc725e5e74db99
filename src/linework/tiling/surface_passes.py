"""What is done to each tile of the surface: tasks that carry names and settings, and leave arrays in a folder.

heights -> regions -> (regions are united and chosen) -> pieces apart -> (chosen) -> carried on
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Protocol

import numpy as np

from linework.files.store_read import PointStore
from linework.files.surface_tiles import SurfaceTiles, TileNumber
from linework.model.arrays import AnyArray, BoolArray, FloatArray, IntArray
from linework.model.grid import Bounds
from linework.model.points import Points
from linework.surface import apart
from linework.surface.carry import CoarseGround, carried, halo_cells, reach_cells
from linework.surface.cells import Window
from linework.surface.config import RoadConfig
from linework.surface.heights import cell_heights, count_spreads
from linework.surface.islands import Islands
from linework.surface.path import NEAR_M
from linework.surface.regions import CellRegions, RegionFacts, cell_regions, cells_with
from linework.surface.slopes import HALO

#: The path is looked up by boxes around so many samples: 256 m of it.
PATH_BOX = 1024
#: Names of the arrays. What is needed only while the surface is made is removed in the end.
HEIGHTS, COUNT, LABELS, COLUMNS, ROWS, ROADS, GROUNDS = (
    "heights", "count", "labels", "columns", "rows", "roads", "grounds",
)  # fmt: skip
PATH, BOXES, ISLANDS, COARSE = "path", "boxes", "islands", "coarse"
SURFACE, KIND = "surface", "kind"
#: What is kept of the cells along a tile's edges.
_EDGE = np.dtype([("height", "f4"), ("east", "f4"), ("north", "f4"), ("road", "i4"), ("ground", "i4")])
_NO_HEIGHT = np.full(2, np.nan, dtype=np.float32)


class PointSource(Protocol):
    """Gives the points of any place: what is needed of `PointStore`."""

    def points(self, bounds: Bounds, *, ordered: bool, with_time: bool, with_intensity: bool) -> Points:
        """Return the points of a place."""
        ...

    @property
    def block_counts(self) -> tuple[IntArray, IntArray]:
        """Blocks of 64 m (n, 2) int64, numbered east and north, and the points in each."""
        ...


@dataclass(frozen=True, slots=True)
class TileTask:
    """One tile in one pass.

    Parameters
    ----------
    source
        The store's folder, or what gives points in its stead.
    z0_m
        Local height origin of the whole survey. [m, world]
    rough_limit_m
        Cells whose layer spreads more are rough; not known yet in the first pass.
    """

    source: Path | PointSource
    tiles: SurfaceTiles
    tile: TileNumber
    config: RoadConfig
    z0_m: float
    rough_limit_m: float = np.nan


def find_heights(task: TileTask) -> IntArray:
    """Write the heights of a tile's cells; return how many cells spread how much (none: there is no point)."""
    window, cell_m = task.tiles.window(task.tile), task.config.cell_m
    # Edges that binary fractions do not hit: points on them may lie either way, so a little more is read
    margin_m = 0.0 if (cell_m * 1024).is_integer() else 1e-3
    source = _opened(task.source) if isinstance(task.source, Path) else task.source
    points = source.points(
        window.bounds(cell_m).grown(margin_m), ordered=False, with_time=False, with_intensity=False
    )
    heights = cell_heights(points.xyz, window, task.z0_m, task.config)
    if not heights.count.any():
        return np.zeros(0, dtype=np.int64)
    task.tiles.write(HEIGHTS, task.tile, np.stack([heights.height, heights.spread]))
    task.tiles.write(COUNT, task.tile, heights.count)
    return np.append(count_spreads(heights.spread), 0)  # never empty


@lru_cache(maxsize=1)
def _opened(folder: Path) -> PointStore:
    return PointStore.open(folder)


def find_regions(task: TileTask) -> RegionFacts:
    """Write the labels of a tile's cells and what neighbours need of its edges; return what it tells of them."""
    tiles, window, config = task.tiles, task.tiles.window(task.tile), task.config
    heights = tiles.over(HEIGHTS, window.grown(HALO), _NO_HEIGHT)
    count = tiles.read(COUNT, task.tile)
    assert count is not None
    codes, numbers = tiles.read_common(ISLANDS)
    regions, facts = cell_regions(
        window,
        heights[0],
        np.ascontiguousarray(heights[1, HALO:-HALO, HALO:-HALO]),
        np.array(count),
        _path_near(tiles, window.bounds(config.cell_m)),
        Islands(codes, numbers.astype(np.int32)),
        task.rough_limit_m,
        task.z0_m,
        config,
    )
    tiles.write(LABELS, task.tile, np.stack([regions.road, regions.ground]))
    columns = [_edge(regions, np.s_[:, :2]), _edge(regions, np.s_[:, -2:])]
    rows = [_edge(regions, np.s_[:2]), _edge(regions, np.s_[-2:])]
    tiles.write(COLUMNS, task.tile, np.stack(columns))
    tiles.write(ROWS, task.tile, np.stack(rows))
    return facts


def edge_cells(tiles: SurfaceTiles, tile: TileNumber, side: str) -> CellRegions:
    """Return the two columns or rows of a tile's cells along its "west", "east", "north" or "south" edge."""
    values = tiles.read(COLUMNS if side in ("west", "east") else ROWS, tile)
    assert values is not None
    part = values[0 if side in ("west", "north") else 1]
    return CellRegions(tiles.window(tile), *(np.array(part[name]) for name in _EDGE.names or ()))


def _edge(regions: CellRegions, part: tuple[slice, ...] | slice) -> AnyArray:
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
    """Return all samples of the path that can be near cells of the bounds, and some more."""
    near = bounds.grown(2.0 * NEAR_M + 5.0)  # cells are 5 m at most
    boxes, path = tiles.read_common(BOXES), tiles.read_common(PATH)
    hit = (boxes[:, 0] <= near.east) & (boxes[:, 2] >= near.west)
    hit &= (boxes[:, 1] <= near.north) & (boxes[:, 3] >= near.south)
    parts = [path[i * PATH_BOX : (i + 1) * PATH_BOX] for i in np.flatnonzero(hit)]
    return np.concatenate([np.zeros((0, 3)), *parts])


@dataclass(frozen=True, slots=True)
class ApartReceipt:
    """What a tile tells of its smooth pieces (None: it has none), and of the ground in blocks of 64 m."""

    pieces: apart.Pieces | None
    coarse: CoarseGround


def find_apart(task: TileTask) -> ApartReceipt:
    """Return what is to be known of a tile's pieces that data holes may part from the ground."""
    tiles, window, config = task.tiles, task.tiles.window(task.tile), task.config
    heights, labels = tiles.read(HEIGHTS, task.tile), tiles.read(LABELS, task.tile)
    assert heights is not None and labels is not None
    around = window.grown(apart.HALO)
    is_ground = _cells_of(tiles, 1, GROUNDS, around)
    inner = around.part(window)
    coarse = CoarseGround.of(
        window, np.array(heights[0]), np.ascontiguousarray(is_ground[inner]), config.cell_m
    )
    smooth = tiles.over(LABELS, around, np.zeros(2, dtype=np.int32))[0] > 0
    found, n_border, n = apart.smooth_pieces(smooth & ~is_ground)
    if n == 0:
        return ApartReceipt(None, coarse)
    around = window.grown(reach_cells(config))
    pieces = apart.describe_pieces(
        found,
        (n_border, n),
        labels[1],
        tiles.over(HEIGHTS, around, _NO_HEIGHT)[0],
        _cells_of(tiles, 1, GROUNDS, around),
        config,
    )
    return ApartReceipt(pieces, coarse)


def carry_on(task: TileTask) -> bool:
    """Write road and ground of a tile; False where there is neither near."""
    tiles, window, config = task.tiles, task.tiles.window(task.tile), task.config
    around = window.grown(halo_cells(config))
    is_ground = _cells_of(tiles, 1, GROUNDS, around)
    if not is_ground.any():
        return False
    is_road = _cells_of(tiles, 0, ROADS, around)
    height = tiles.over(HEIGHTS, around, _NO_HEIGHT)[0]
    coarse = CoarseGround(*_columns(tiles.read_common(COARSE)))
    road_m, ground_m = carried(window, height, is_road, is_ground, coarse, config)
    inner = around.part(window)
    kind = is_road[inner].astype(np.uint8) | (is_ground[inner].astype(np.uint8) << 1)
    tiles.write(SURFACE, task.tile, np.stack([road_m, ground_m]), durable=True)
    tiles.write(KIND, task.tile, kind, durable=True)
    return True


def coarse_array(coarse: CoarseGround) -> AnyArray:
    """Return coarse ground as one array (n, 4), to be kept in a file."""
    return np.column_stack([coarse.blocks, coarse.total, coarse.cells])


def coarse_ground(array: AnyArray) -> CoarseGround:
    """Return what `coarse_array` was made of."""
    return CoarseGround(*_columns(array))


def _columns(array: AnyArray) -> tuple[IntArray, IntArray, IntArray]:
    return array[:, :2], array[:, 2], array[:, 3]


def _cells_of(tiles: SurfaceTiles, plane: int, chosen: str, window: Window) -> BoolArray:
    """Return which cells of a window have labels that were chosen: of roads (plane 0) or grounds (plane 1)."""
    out = np.zeros(window.shape, dtype=bool)
    for tile in tiles.touching(window):
        own = tiles.window(tile)
        shared = own.common(window)
        labels, names = tiles.read(LABELS, tile), tiles.read(chosen, tile)
        if shared and labels is not None and names is not None:
            part = np.array(labels[(plane, *own.part(shared))])
            out[window.part(shared)] = cells_with(part, names)
    return out
