"""Regions of cells: smooth ones that continue the slope, for roads, and looser ones, for the ground."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray
from linework.kernels.cells import regions as kernels
from linework.surface.bare_earth import bare_cells, bare_halo
from linework.surface.blocks import BlockHeights
from linework.surface.cells import CellWindow, block_of, drops_of_cells
from linework.surface.config import RoadConfig
from linework.surface.heights import SLOPE_HALO, smooth_slopes

#: Least area of a road where no path leads over it, and of bare cells that make a whole region ground: larger than the
#: roof of a lorry, or a few cells of a wire. [m2]
MIN_ROAD_M2 = 25.0
#: Unit in which spreads of cells are added up. [m]
SPREAD_UNIT_M = 1e-5


@dataclass(frozen=True, slots=True)
class CellRegions:
    """Regions of the cells of one window.

    Parameters
    ----------
    height, slope_east, slope_north
        (n_rows, n_cols) float32 [m, m/m]; slopes are NaN where the surface is rough.
    road, ground
        (n_rows, n_cols) int32 labels; 0: rough (road), no point or a steep edge (ground). Regions near the edge of the
        window, which may continue beyond it, come first.
    """

    window: CellWindow
    height: Float32Array
    slope_east: Float32Array
    slope_north: Float32Array
    road: AnyArray
    ground: AnyArray


@dataclass(frozen=True, slots=True)
class LabelTable:
    """Properties of the regions of a window that may continue beyond it, or are needed to choose road and ground.

    Parameters
    ----------
    labels
        (n,) int32, ascending: 1 to `n_border`, and others.
    cells, points, bare
        (n,) int64 number of cells of the region, of points in them, and of cells that the openings take for earth.
    scatter
        (n,) int64 sum of the spreads of the cells, in units of `SPREAD_UNIT_M`: whole numbers, so that sums over windows do
        not depend on the windows.
    first
        (n,) int64 code of the region's first cell in row order; the same in every window.
    island
        (n,) int32 island that the region belongs to (see `Islands`).
    """

    n_border: int
    labels: AnyArray
    cells: IntArray
    points: IntArray
    bare: IntArray
    scatter: IntArray
    first: IntArray
    island: AnyArray


@dataclass(frozen=True, slots=True)
class RegionFacts:
    """Summary of the regions of a window, from which road and ground are chosen over all windows.

    Parameters
    ----------
    bare
        (b,) int32 ground labels that are ground and not in the table: whole within the window.
    pairs
        (k, 3) int32 road label of the table, a ground label that shares cells with it, and how many.
    touching
        (t, 3) int32 road labels of the table that lie beside each other, with at most one cell between them, and in how
        many places.
    seeds
        (s,) int32 road labels of cells near the path; `drops` (s, 2) float32: smallest and
        largest depth of the cells below the path [m]; `spreads` (s,) float32: theirs [m].
    """

    road: LabelTable
    ground: LabelTable
    bare: AnyArray
    pairs: AnyArray
    touching: AnyArray
    seeds: AnyArray
    drops: Float32Array
    spreads: Float32Array


def region_halo(config: RoadConfig) -> int:
    """Return the width of the halo around a window on which its regions depend. [cells]."""
    return max(SLOPE_HALO, bare_halo(config))


def is_bare(bare: IntArray, cells: IntArray, cell_m: float) -> BoolArray:
    """Return which regions are ground, by the number of their bare cells and of all, (n,) bool.

    Half of the cells, or as many as a lorry's roof: the crest of a dam of which the banks are hidden has some at its foot.

    >>> is_bare(np.array([2, 2, 200]), np.array([3, 9, 999]), 0.5).tolist()
    [True, False, True]
    """
    return np.asarray((2 * bare >= cells) | (bare * cell_m**2 >= MIN_ROAD_M2))


def cell_regions(
    window: CellWindow,
    height: Float32Array,
    blocks: Mapping[int, BlockHeights],
    spread: Float32Array,
    count: AnyArray,
    path: FloatArray,
    islands: Islands,
    rough_limit_m: float,
    uneven_m: Float32Array,
    is_dense: bool,
    z0_m: float,
    config: RoadConfig,
) -> tuple[CellRegions, RegionFacts]:
    """Return the regions of the cells of a window, and their summary.

    Parameters
    ----------
    height
        (n_rows + 2 h, n_cols + 2 h) float32, with a halo of h = `region_halo`. [m]
    blocks
        As `linework.surface.bare_earth.block_halos` says.
    spread, count
        (n_rows, n_cols) float32 [m] and int32.
    path
        (n, 3) samples of the path, at least all those near the window. [m, world]
    islands
        Islands of the survey.
    rough_limit_m
        Largest spread of a smooth cell. [m]
    uneven_m
        (n_rows, n_cols) float32: largest spread about its plane. [m]
    is_dense
        Whether single low cells may be stray.
    z0_m
        Local height origin. [m, world]
    """
    cell, halo = config.cell_m, region_halo(config)
    near = slice(halo - SLOPE_HALO, SLOPE_HALO - halo or None)
    smooth, east, north = smooth_slopes(
        np.ascontiguousarray(height[near, near]), spread, rough_limit_m, uneven_m, config
    )
    earth, gentle = bare_cells(window, height, halo, blocks, is_dense, config)
    height = np.ascontiguousarray(height[halo:-halo, halo:-halo])
    road, n_road, first_road = kernels.label_regions(
        height, east, north, smooth, cell, config.max_step_m, False
    )
    ground, n_ground, first_ground = kernels.label_regions(
        height, east, north, gentle, cell, config.ground_step_m, True
    )
    cells, drops = drops_of_cells(path, window, height, smooth, z0_m, cell)
    seeds = road.ravel()[cells]
    scatter = np.rint(np.nan_to_num(spread) / SPREAD_UNIT_M).astype(np.int32)
    counts = count, earth.astype(np.int32), scatter
    large = kernels.sizes_of_labels(road, count, len(first_road))[0] * cell**2 >= MIN_ROAD_M2
    wanted = np.union1d(seeds, np.flatnonzero(large) + 1)
    roads = _table(window, road, n_road, first_road, counts, islands, cell, wanted)
    # Of the ground inside the window only that of roads that may be chosen is needed: the rest is decided here
    listed = np.zeros(len(first_road) + 1, dtype=bool)
    listed[roads.labels] = True
    on = listed[road] & (ground > 0)
    codes, shared = np.unique((road[on].astype(np.int64) << 32) | ground[on], return_counts=True)
    pairs = np.stack([codes >> 32, codes & 0xFFFFFFFF, shared], axis=-1).astype(np.int32)
    grounds = _table(window, ground, n_ground, first_ground, counts, islands, cell, np.unique(pairs[:, 1]))
    n_cells, n_bare = kernels.sizes_of_labels(ground, counts[1], len(first_ground))
    own = np.setdiff1d(np.flatnonzero(is_bare(n_bare, n_cells, cell)) + 1, grounds.labels).astype(np.int32)
    return CellRegions(window, height, east, north, road, ground), RegionFacts(
        roads, grounds, own, pairs, _touching(np.where(listed[road], road, 0)), seeds, drops,
        spread.ravel()[cells],
    )  # fmt: skip


def _touching(labels: AnyArray) -> AnyArray:
    """Return the pairs of labels (n_rows, n_cols) in the same row or column, next to each other or but one, and how often.

    (n, 3) int32.
    """
    found = []
    for plane in (labels, labels.T):
        found += [_different(plane[:, :-n], plane[:, n:]) for n in (1, 2)]
    return _counted(np.concatenate(found))


def _different(one: AnyArray, other: AnyArray) -> AnyArray:
    """Return the pairs of labels that differ, the smaller one first, (n, 2), as often as they occur."""
    at = (one != other) & (one > 0) & (other > 0)
    return np.sort(np.stack([one[at], other[at]], axis=-1), axis=1)


def _counted(pairs: AnyArray) -> AnyArray:
    """Return each of some pairs (n, 2) once, with how often it occurs, (k, 3) int32."""
    unique, times = np.unique(pairs, axis=0, return_counts=True)
    return np.column_stack([unique, times]).astype(np.int32)


def _table(
    window: CellWindow,
    labels: AnyArray,
    n_border: int,
    first: AnyArray,
    counts: tuple[AnyArray, AnyArray, AnyArray],
    islands: Islands,
    cell_m: float,
    wanted: AnyArray,
) -> LabelTable:
    """Return the table of labels near the edge, wanted ones, and the one with the most points of each island.

    `counts` are the points of each cell, 1 for each earth cell, and the spread of each.
    """
    (cells, points), (_, bare), (_, scatter) = (
        kernels.sizes_of_labels(labels, count, len(first)) for count in counts
    )
    north = window.north - 1 - first // window.n_cols
    east = window.west + first % window.n_cols
    place = (-north.astype(np.int64) << 32) + east
    island = islands.at(block_of(east, cell_m), block_of(north, cell_m))
    chosen = [np.arange(1, n_border + 1), wanted]
    inner = np.arange(n_border, len(first))
    for number in np.unique(island[inner]):
        of_it = inner[island[inner] == number]
        most = of_it[points[of_it] == points[of_it].max()]
        chosen.append(most[[np.argmin(place[most])]] + 1)
    kept = np.unique(np.concatenate(chosen)).astype(np.int32)
    at = kept - 1
    return LabelTable(n_border, kept, cells[at], points[at], bare[at], scatter[at], place[at], island[at])


def cells_with(labels: AnyArray, chosen: AnyArray) -> BoolArray:
    """Return the (n_rows, n_cols) bool mask of cells that have one of the chosen labels (n,)."""
    table = np.zeros(int(chosen.max(initial=0)) + 1, dtype=bool)
    table[chosen] = True
    return np.asarray(kernels.with_labels(labels, table))


def links_east(
    west: CellRegions, east: CellRegions, config: RoadConfig
) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Return the pairs of labels of road and of ground that are connected across an edge, and of roads that only touch.

    Only the two columns on either side of the edge are used: windows may be cropped to them. (n, 2) int32 each; roads that
    touch (n, 3), with the number of places.
    """
    a, b = (slice(None), slice(-2, None)), (slice(None), slice(0, 2))
    return _links(west, east, a, b, west.slope_east[a], east.slope_east[b], config, turned=False)


def links_south(
    north: CellRegions, south: CellRegions, config: RoadConfig
) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Return the same as `links_east` for windows one north of the other."""
    a, b = (slice(-2, None), slice(None)), (slice(0, 2), slice(None))
    return _links(north, south, a, b, -north.slope_north[a], -south.slope_north[b], config, turned=True)


def _links(
    one: CellRegions,
    other: CellRegions,
    a: tuple[slice, slice],
    b: tuple[slice, slice],
    slope_a: Float32Array,
    slope_b: Float32Array,
    config: RoadConfig,
    *,
    turned: bool,
) -> tuple[AnyArray, AnyArray, AnyArray]:
    def strip(values: AnyArray) -> AnyArray:
        return np.ascontiguousarray(values.T if turned else values)

    heights = strip(one.height[a]), strip(other.height[b])
    slopes = strip(slope_a), strip(slope_b)
    level = np.zeros_like(slopes[0])
    roads = strip(one.road[a]), strip(other.road[b])
    found = []
    for labels, slope, step in (
        (roads, slopes, config.max_step_m),
        ((strip(one.ground[a]), strip(other.ground[b])), (level, level), config.ground_step_m),
    ):
        links = kernels.links_across(
            heights[0], slope[0], labels[0], heights[1], slope[1], labels[1], config.cell_m, step
        )
        found.append(np.unique(links, axis=0))
    beside = np.concatenate(
        [np.stack([roads[0][:, i], roads[1][:, j]], axis=-1) for i, j in ((1, 0), (0, 0), (1, 1))]
    )
    return found[0], found[1], _counted(beside[(beside > 0).all(axis=1)])


# Islands: recorded areas that are not connected; each has a road of its own

_AROUND = ((0, 0), (1, 0), (0, 1), (1, 1), (1, -1), (-1, 0), (0, -1), (-1, -1), (-1, 1))


@dataclass(frozen=True, slots=True)
class Islands:
    """Connected groups of those blocks of 64 m that hold points; touching at a corner connects them.

    Parameters
    ----------
    codes
        (n,) int64, ascending: codes of the blocks; `number` (n,) int32: the island of each.
    """

    codes: IntArray
    number: AnyArray

    @classmethod
    def of(cls, blocks: IntArray) -> Islands:
        """Return the islands of blocks (n, 2) int64, given by their numbers east and north; sorted row by row.

        >>> Islands.of(np.array([[0, 0], [1, 1], [3, 0]])).number.tolist()
        [0, 1, 0]
        """
        codes = np.unique(_code(blocks[:, 0], blocks[:, 1]))
        east, north = codes & 0xFFFFFFFF, codes >> 32
        links = []
        for de, dn in _AROUND[1:5]:
            other = _code((east - 2**31) + de, north + dn)
            at = np.searchsorted(codes, other).clip(0, max(len(codes) - 1, 0))
            here = np.flatnonzero(codes[at] == other) if len(codes) else np.zeros(0, dtype=np.int64)
            links.append(np.stack([here, at[here]]))
        return cls(codes, connected_groups(len(codes), np.concatenate(links, axis=1).T))

    def at(self, east: IntArray, north: IntArray) -> AnyArray:
        """Return the island of each block or of one beside it, (n,) int32; -1 where there is none."""
        found = np.full(len(east), -1, dtype=np.int32)
        for de, dn in _AROUND:
            missing = np.flatnonzero(found < 0)
            if len(missing) == 0 or len(self.codes) == 0:
                break
            code = _code(east[missing] + de, north[missing] + dn)
            at = np.searchsorted(self.codes, code).clip(0, len(self.codes) - 1)
            found[missing] = np.where(self.codes[at] == code, self.number[at], -1)
        return found


def connected_groups(n: int, links: AnyArray) -> AnyArray:
    """Return the connected component of each of n nodes, (n,) int32, given links (m, 2).

    >>> connected_groups(4, np.array([[0, 2], [2, 3]])).tolist()
    [0, 1, 0, 0]
    """
    if n == 0:
        return np.zeros(0, dtype=np.int32)
    graph = coo_array((np.ones(len(links), dtype=np.int8), (links[:, 0], links[:, 1])), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int32)


def _code(east: IntArray, north: IntArray) -> IntArray:
    """Return one number (n,) for each block, ascending row by row."""
    return (np.asarray(north, dtype=np.int64) << 32) + (np.asarray(east, dtype=np.int64) + 2**31)
