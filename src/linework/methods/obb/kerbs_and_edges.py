"""Boundary boxes: pieces of the edge of the carriageway's surface.

After Kang, Lee and Lee (2023), doi:10.3390/rs15194656: the points of a search area whose normals are those of the road
make its floor plane; the edge of that plane is the reference line of the box. Beyond the paper the search areas are
found automatically, and the foot of a kerb is the line where floor and face meet, to a fraction of the spacing of the
points.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray
from linework.kernels.boundaries import boundary_boxes as kernels
from linework.kernels.boundaries.evenness import unevenness_beside
from linework.kernels.boundaries.profiles import FloorCells, FloorLimits
from linework.kernels.boundaries.stone_boxes import AT_EDGE_M
from linework.kernels.boundaries.walls import points_of_walls
from linework.kernels.cells import floor, places
from linework.kernels.cells.bins import steps_to_set
from linework.model.boxes import BoxForm, BoxSet
from linework.model.grid import Bounds, holds
from linework.model.ground import Ground
from linework.model.points import Points
from linework.model.settings import Settings, setting
from linework.model.tile import TileData, local_origin

#: Heights over the ground of the points that are used: feet of walls are above it, floors under grass below. [m]
BOUNDARY_BAND_M = (-0.30, 0.60)
#: Cells within this many steps of road or ground are used: half a metre into holes.
NEAR_CELLS = 2
#: Half of the extent of a boundary box across. [m]
HALF_WIDTH_M = 0.25
#: Widths of gutters of stones brighter than the road. [m]
GUTTERS_M = (0.10, 0.60)
#: The middle of a stripe, or the front of a gutter, is this near to the boundary at its edge. [m]
STONES_REACH_M = max(GUTTERS_M) + AT_EDGE_M
#: A box depends on the points within this of its cell only: a search area of 2.4 m, the facets around it, and the ground
#: beside it (3.5 m); one at the back of a gutter on those of the cell at its front. [m]
BOUNDARY_REACH_M = 6.0 + STONES_REACH_M
#: Without any bright stripe.
NO_STRIPES = BoxSet.empty()


@dataclass(frozen=True, slots=True, kw_only=True)
class BoundaryConfig(Settings):
    """Settings of the boundary boxes."""

    min_step_m: float = setting(
        0.015, unit="m", reason="dropped kerbs are 2 to 3 cm above the gutter", low=0.005, high=0.2
    )
    max_step_m: float = setting(0.30, unit="m", reason="high kerbs have 25 cm", low=0.05, high=0.6)
    normal_deg: float = setting(
        5.0, unit="deg", reason="the paper's floor: normals of 85 degrees and more", low=1, high=30
    )
    level_reference: bool = setting(
        False, unit="-", reason="the paper takes normals from the vertical; on a grade that refuses the road"
    )
    max_noise_m: float = setting(
        0.03,
        unit="m",
        reason="the paper's 2 cm for the points of the floor, and a reserve; at the road as much as the scanner has",
        low=0.005,
        high=0.1,
    )


@dataclass(frozen=True, slots=True)
class FloorPoints:
    """Points near the ground in the cells of the survey's lattice, as kernels take them.

    Parameters
    ----------
    data
        The points by fine cell, and what is computed of each cell.
    ground
        Height of the ground over the local origin (rows, cols) float32 [m], its cell size [m], its first column and
        the row after its last.
    times
        (n,) int64 number of each point in the tile, and (m,) the tile's times [s] (none: empty).
    """

    data: FloorCells
    ground: tuple[AnyArray, float, int, int]
    times: tuple[AnyArray, AnyArray]

    @classmethod
    def of(cls, points: Points, surface: Ground, origin: tuple[float, float, float]) -> FloorPoints:
        """Return the points near the ground, sorted into the lattice, with sums and facets of its cells."""
        g = surface.grid
        west = round((g.east_m - origin[0]) / g.cell_width_m)
        north = round((g.north_m - origin[1]) / g.cell_width_m)
        near = steps_to_set(surface.is_road | surface.is_ground, NEAR_CELLS) <= NEAR_CELLS
        ground_m = surface.ground_m + np.float32(surface.z0_m - origin[2])
        at = np.array(origin)
        col, row, span = floor.cells_near_ground(
            points.xyz, at, g.cell_width_m, west, north, ground_m, near, BOUNDARY_BAND_M
        )
        no_strength = np.zeros(len(points), dtype=np.float32)
        strength = no_strength if points.intensity is None else points.intensity
        local, source, starts = floor.sort_by_cell(points.xyz, strength, at, col, row, span)
        sums = floor.cell_sums(local, starts, span)
        near_road = steps_to_set(surface.is_road, NEAR_CELLS) <= NEAR_CELLS
        of_cells = _at_cells(near_road, g.cell_width_m, west, north, span)
        # Floors are those of the ground alone
        is_wall, on_ground = points_of_walls(local, starts, span)
        of_ground = floor.sums_without(sums, local, starts, span, is_wall, on_ground)
        facets = floor.facets_of(of_ground, starts, span)
        data = FloorCells(local, starts, span, sums, facets, of_cells, is_wall, on_ground)
        time_s = np.zeros(0) if points.time_s is None else points.time_s
        return cls(data, (ground_m, g.cell_width_m, west, north), (source, time_s))


def _at_cells(grid: BoolArray, cell_width_m: float, west: int, north: int, span: IntArray) -> BoolArray:
    """Return the values of a grid at the middles of the cells of two fine ones, (cells,) bool; False beyond it."""
    n_rows, n_cols = int(span[floor.SPAN_ROWS]) // 2, int(span[floor.SPAN_COLS]) // 2
    x_m = (span[floor.SPAN_WEST] + 2.0 * np.arange(n_cols) + 1.0) * floor.FINE_M
    y_m = (span[floor.SPAN_SOUTH] + 2.0 * np.arange(n_rows) + 1.0) * floor.FINE_M
    col = np.floor(x_m / cell_width_m).astype(np.int64) - west
    row = north - 1 - np.floor(y_m / cell_width_m).astype(np.int64)
    inside = ((row >= 0) & (row < grid.shape[0]))[:, None] & ((col >= 0) & (col < grid.shape[1]))
    rows, cols = np.clip(row, 0, grid.shape[0] - 1), np.clip(col, 0, grid.shape[1] - 1)
    return np.asarray(grid[rows[:, None], cols] & inside).ravel()


def find_boundary_boxes(
    tile: TileData,
    surface: Ground,
    config: BoundaryConfig,
    cores: Sequence[Bounds] = (),
    stripes: BoxSet = NO_STRIPES,
) -> BoxSet:
    """Return the boundary boxes in a tile's core: of its cells, by row (from the south) and column, then of its stripes.

    They are the same to the last bit in every tile that holds the points within `BOUNDARY_REACH_M` of them.

    Parameters
    ----------
    cores
        Disjoint parts of the core, searched instead of the whole of it.
    stripes
        Bright stripes, paint or stone, up to `STONES_REACH_M` beyond the core: where the ground bends or steps at an edge
        of theirs, there is a boundary.
    """
    if len(tile.points) == 0:
        return BoxSet.empty()
    # Points near the ground; planes of their cells
    origin = local_origin_of(tile)
    base = FloorPoints.of(tile.points, surface, origin)
    parts = []
    for core in cores or (tile.core,):
        around = core.grown(STONES_REACH_M)
        local = (
            around.west - origin[0],
            around.south - origin[1],
            around.east - origin[0],
            around.north - origin[1],
        )
        # In every cell: the line where floor and face of a kerb meet, or the edge from smooth to rough
        found = kernels.boxes_in_cells(base.data, base.ground, base.times, kernel_settings(config), local)
        # Along bright stripes, and behind edges: the bend or the low step at the edge of stones
        near = stripes.take(holds(around, stripes.centre + origin))
        seeds = np.concatenate([_edges_of_stripes(near), _behind_edges(found)])
        stones = kernels.boxes_at_stripes(base.data, base.ground, base.times, kernel_settings(config), seeds)
        found = np.concatenate([found, stones])
        parts.append(found[holds(core, found[:, [places.BOX_X, places.BOX_Y]] + origin[:2])])
    rows = np.concatenate(parts)
    # Beside edges: how even the ground is that may be the carriageway's
    return boundary_box_set(rows, unevenness_beside(base.data.sums, base.data.span, rows))


def _edges_of_stripes(stripes: BoxSet) -> FloatArray:
    """Return where the ground may bend or step at an edge of stripes, (m, 7) [m, local]."""
    narrow = stripes.take(stripes.form == BoxForm.STRIPE)
    off = narrow.half_v_m[:, None] + [-AT_EDGE_M, AT_EDGE_M]
    return np.column_stack([narrow.centre, narrow.u, off])


def _behind_edges(rows: FloatArray) -> FloatArray:
    """Return where the ground may bend or step at the back of a gutter, by the edge or change at its front, (m, 7)."""
    changes = rows[(rows[:, places.FORM] == places.EDGE) | (rows[:, places.FORM] == places.CHANGE)]
    middle = 0.5 * sum(GUTTERS_M)
    ux, uy = changes[:, places.BOX_UX], changes[:, places.BOX_UY]
    # Outwards: to the right
    x, y = changes[:, places.BOX_X] + middle * uy, changes[:, places.BOX_Y] - middle * ux
    off = np.broadcast_to([0.0, 0.5 * (GUTTERS_M[1] - GUTTERS_M[0])], (len(changes), 2))
    return np.column_stack([x, y, changes[:, places.BOX_Z], ux, uy, off])


def local_origin_of(tile: TileData) -> tuple[float, float, float]:
    """Return the local origin of a tile's survey [m, world]: its own, or one made from its points."""
    if tile.origin is not None:
        return tile.origin
    bounds = tile.points.bounds
    return local_origin(bounds.west, bounds.south, float(tile.points.xyz[:, 2].min()))


def kernel_settings(c: BoundaryConfig) -> FloorLimits:
    """Return the settings as kernels take them."""
    steepest = math.tan(math.radians(c.normal_deg))
    return FloorLimits(c.min_step_m, steepest, c.max_step_m, c.max_noise_m, float(c.level_reference))


def boundary_box_set(rows: FloatArray, uneven_m2: FloatArray) -> BoxSet:
    """Return rows (n, 18), with the columns of `linework.kernels.cells.places`, and unevennesses (n, 2), as boxes."""
    return BoxSet(
        centre=rows[:, [places.BOX_X, places.BOX_Y, places.BOX_Z]],
        u=rows[:, [places.BOX_UX, places.BOX_UY]],
        half_u_m=rows[:, places.BOX_HALF_U],
        half_v_m=np.full(len(rows), HALF_WIDTH_M),
        sigma_v_m=rows[:, places.S_V],
        sigma_z_m=rows[:, places.S_Z],
        sigma_u_rad=rows[:, places.S_U],
        score=rows[:, places.SCORE],
        form=rows[:, places.FORM],
        height_m=rows[:, places.BOX_STEP],
        top_v_m=rows[:, places.TOP_V],
        contrast=rows[:, places.BOX_CONTRAST],
        rougher=rows[:, places.BOX_ROUGHER],
        uneven_m2=uneven_m2[:, 0],
        uneven_right_m2=uneven_m2[:, 1],
        n_points=rows[:, places.COUNT],
        time_start_s=rows[:, places.START],
        time_end_s=rows[:, places.BOX_END],
    )
