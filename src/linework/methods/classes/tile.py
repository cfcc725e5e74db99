"""What the points of one tile are classified by: cells of the ground, pieces of lines, and cubes of what stands there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray
from linework.kernels.classes.near_lines import NearLines
from linework.kernels.classes.points import CELL_IS_ROAD, STANDS_M, PlanCells, give_classes
from linework.kernels.classes.standing import (
    CUBE_M,
    NO_LABEL,
    Cubes,
    cube_numbers,
    cube_sums,
    labels_of_cubes,
)
from linework.methods.classes.carriageway import SIGHT_M, plan_of
from linework.methods.classes.paint import least_of_paint
from linework.methods.classes.pieces import RoadPieces
from linework.methods.classes.point_class import PointClass
from linework.model.grid import Bounds, Grid, holds
from linework.model.ground import Ground
from linework.model.points import Points
from linework.surface.road import height_above_ground

#: Margin of points around a tile that what stands there depends on [m]: three cubes to each side.
STANDING_MARGIN_M = 1.2
#: Margin of ground and lines around a tile [m].
PLAN_MARGIN_M = SIGHT_M + 5.0
#: What stands higher than this above the lowest point of a tile has no class [m]: a mast, a tower; birds.
_HIGHEST_M = 200.0
#: A flat surface scatters at most this, or this many times as much as the road: the noise of most scanners is below 2 cm.
_FLAT_M, _FLAT_SCATTER = 0.030, 1.8


@dataclass(frozen=True, slots=True)
class TileClasses:
    """A tile in which points can be classified. All fields are arrays, so that it can be kept in a file.

    Parameters
    ----------
    height, bits, plan
        `PlanCells`: cells, their bits, and the four numbers.
    ends, kind, sides, number, reach, least, start, item, corner, shape
        `NearLines`.
    cube_start, cube_level, cube_label, cube_corner, cube_shape
        `Cubes`.
    """

    height: Float32Array
    bits: AnyArray
    plan: FloatArray
    ends: FloatArray
    kind: AnyArray
    sides: AnyArray
    number: AnyArray
    reach: FloatArray
    least: FloatArray
    start: AnyArray
    item: AnyArray
    corner: FloatArray
    shape: IntArray
    cube_start: AnyArray
    cube_level: AnyArray
    cube_label: AnyArray
    cube_corner: FloatArray
    cube_shape: IntArray

    def classify(
        self, xyz: FloatArray, intensity: Float32Array, index: IntArray, out: AnyArray, line: AnyArray
    ) -> None:
        """Write the class of some points to `out`, (n,) uint8, and the number of their line to `line`, (n,) uint32.

        Parameters
        ----------
        xyz, intensity
            (n, 3) float64 [m, world] and (n,) float32.
        index
            (k,) int64: the points that lie in this tile.
        """
        cells = PlanCells(self.height, self.bits, *self.plan.tolist())
        near = NearLines(
            self.ends, self.kind, self.sides, self.number, self.reach, self.least, self.start, self.item,
            *self.corner.tolist(), *self.shape.tolist(),
        )  # fmt: skip
        cubes = Cubes(
            self.cube_start,
            self.cube_level,
            self.cube_label,
            *self.cube_corner.tolist(),
            *self.cube_shape.tolist(),
        )
        give_classes(xyz, intensity, index, cells, near, cubes, out, line)

    def are_road(self, xyz: FloatArray, index: IntArray) -> BoolArray:
        """Return which of some points are road or paint, (k,) bool; arguments as for `classify`."""
        out, line = np.zeros(len(xyz), dtype=np.uint8), np.zeros(len(xyz), dtype=np.uint32)
        self.classify(xyz, np.zeros(len(xyz), dtype=np.float32), np.unique(index), out, line)
        return np.isin(out[index], (PointClass.ROAD, PointClass.MARKING))


def tile_classes(
    core: Bounds, ground: Ground, points: Points, pieces: RoadPieces, path: FloatArray, *, has_path: bool
) -> TileClasses:
    """Return what the points of a tile are classified by.

    Parameters
    ----------
    core
        The tile.
    ground
        Road and ground of the tile and of ``PLAN_MARGIN_M`` around it.
    points
        Of the tile and of ``STANDING_MARGIN_M`` around it, in any order.
    pieces
        Of the lines of the survey.
    path
        (n, 2) float64: places of the vehicle's path. [m, world]
    has_path
        Whether the survey has a path.
    """
    around = core.grown(PLAN_MARGIN_M)
    wide = pieces.near(around)
    inside = holds(around, path) if len(path) else np.zeros(0, dtype=bool)
    bits, sides = plan_of(ground, wide, path[inside], has_path=has_path)
    # What is needed in the tile itself: less of everything
    near = pieces.near(core)
    of_wide = {tuple(piece): side for piece, side in zip(wide.ends.tolist(), sides.tolist(), strict=True)}
    near_sides = np.array([of_wide[tuple(piece)] for piece in near.ends.tolist()], dtype=np.uint8)
    height, own_bits, grid = _cut(ground, bits, core)
    road = ground.sigma[(bits & CELL_IS_ROAD).astype(bool) & ground.is_ground]
    flat_m = max(_FLAT_M, _FLAT_SCATTER * float(np.median(road))) if len(road) else _FLAT_M
    above_m = height_above_ground(ground, points.xyz)
    cubes = _cubes(core, points.xyz[above_m > STANDS_M], ground, flat_m)
    found = TileClasses(
        height, own_bits, np.array([grid.east_m, grid.north_m, grid.cell_width_m, ground.z0_m]),
        near.ends, near.kind, near_sides, near.number, near.reach, near.least, near.start, near.item,
        np.array([near.west, near.south]), np.array([near.n_rows, near.n_cols]),
        cubes.start, cubes.level, cubes.label,
        np.array([cubes.west, cubes.south, cubes.base]), np.array([cubes.n_rows, cubes.n_cols]),
    )  # fmt: skip

    low = np.flatnonzero(np.abs(above_m) <= STANDS_M)
    are_road = partial(found.are_road, points.xyz)
    return replace(found, least=least_of_paint(near, points.xyz, points.intensity, low, are_road))


def _cut(ground: Ground, bits: AnyArray, core: Bounds) -> tuple[Float32Array, AnyArray, Grid]:
    """Return heights and bits of the cells in and next to a tile, and their grid."""
    g, cell = ground.grid, ground.grid.cell_width_m
    left = max(int(np.floor((core.west - g.east_m) / cell)) - 1, 0)
    right = min(int(np.ceil((core.east - g.east_m) / cell)) + 1, g.n_cols)
    top = max(int(np.floor((g.north_m - core.north) / cell)) - 1, 0)
    bottom = min(int(np.ceil((g.north_m - core.south) / cell)) + 1, g.n_rows)
    part = np.s_[top:bottom, left:right]
    grid = Grid(g.east_m + left * cell, g.north_m - top * cell, cell, cell, bottom - top, right - left)
    return np.ascontiguousarray(ground.ground_m[part]), np.ascontiguousarray(bits[part]), grid


def _cubes(core: Bounds, xyz: FloatArray, ground: Ground, flat_m: float) -> Cubes:
    """Return what stands in a tile, in cubes of one lattice for the whole world."""
    first = np.floor(np.array([core.west, core.south]) / CUBE_M).astype(np.int64) - 3
    last = np.ceil(np.array([core.east, core.north]) / CUBE_M).astype(np.int64) + 3
    west, south = (first * CUBE_M).tolist()
    n_cols, n_rows = (last - first).tolist()
    low = float(xyz[:, 2].min()) if len(xyz) else 0.0
    base = float(np.floor(low / CUBE_M)) * CUBE_M
    highest = float(xyz[:, 2].max()) if len(xyz) else 0.0
    n_levels = int(min(highest - base, _HIGHEST_M) / CUBE_M) + 1
    xyz = np.ascontiguousarray(xyz)
    number = cube_numbers(xyz, west, south, base, n_rows, n_cols, n_levels)
    cube, sums = cube_sums(
        xyz, number, np.argsort(number, kind="stable"), west, south, base, n_cols, n_levels
    )
    column, level = np.divmod(cube, n_levels)
    start = np.searchsorted(column, np.arange(n_rows * n_cols + 1)).astype(np.int32)
    cubes = Cubes(
        start,
        level.astype(np.int32),
        np.full(len(cube), NO_LABEL, dtype=np.uint8),
        west,
        south,
        base,
        n_rows,
        n_cols,
    )
    r, c = np.divmod(np.arange(n_rows * n_cols), n_cols)
    middle = np.stack([west + (c + 0.5) * CUBE_M, south + (r + 0.5) * CUBE_M], axis=-1)
    g = ground.grid
    rows, cols = (np.floor(v).astype(np.int64) for v in g.to_cell(middle))
    level_m = ground.ground_m[rows.clip(0, g.n_rows - 1), cols.clip(0, g.n_cols - 1)] + (ground.z0_m - base)
    below = np.ascontiguousarray((level_m / CUBE_M).astype(np.float32).reshape(n_rows, n_cols))
    return cubes._replace(label=labels_of_cubes(cubes, sums, below, flat_m))
