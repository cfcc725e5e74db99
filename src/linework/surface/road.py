"""Road / non-road, the ground, and every point's height above the road.

The papers start from heights that are "normalized by making the road surface height equal to zero"
and show road and non-road points (Manandhar and Shibasaki 2002, figure 2) without saying how. Here:

1. the lowest supported height of every cell: stray points below the ground stand alone;
2. the mean of the layer above it, and how much that layer spreads (roughness);
3. the road grows from under the trajectory (without one: from the largest smooth low surface) over
   cells that continue the local slope; a kerb is a step that the slope does not explain;
4. the ground grows on from the road with looser bounds: verges, banks, pavements, not roofs;
5. beyond the road its surface is carried on from the nearest edge, and gives way to the ground.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from linework.errors import InputError
from linework.kernels import surface as kernels
from linework.model.arrays import AnyArray, BoolArray, Float32Array, FloatArray
from linework.model.grid import Grid
from linework.model.points import Points
from linework.model.settings import setting
from linework.model.surface import RoadSurface as RoadSurface
from linework.model.trajectory import Trajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadConfig:
    """Settings of the road surface."""

    cell_m: float = setting(
        0.5,
        unit="m",
        reason="holds two scan lines at 25 cm spacing; a kerb still stands out",
        low=0.05,
        high=5,
    )
    support_m: float = setting(
        0.15, unit="m", reason="a point with none this close above it is a stray", low=0.01, high=1
    )
    layer_m: float = setting(
        0.20,
        unit="m",
        reason="ground layer of a cell: 12 % grade over 0.5 m, and four sigma of 2 cm noise on both sides",
        low=0.02,
        high=1,
    )
    max_grade: float = setting(
        0.25, unit="m/m", reason="12 % grade, 6 % crossfall and twice that for a reserve", low=0.01, high=2
    )
    max_step_m: float = setting(
        0.035,
        unit="m",
        reason="half of the lowest kerb (7 cm); the mean of a cell is good to 1 cm",
        low=0.005,
        high=1,
    )
    ground_step_m: float = setting(
        0.25, unit="m", reason="per cell: banks up to 1 in 2 and kerbs, not walls or cars", low=0.01, high=5
    )
    roughness_m: float = setting(
        0.06,
        unit="m",
        reason="spread of the layer on asphalt at 12 % grade and 2 cm noise is 3 cm",
        low=0.005,
        high=1,
    )
    carry_m: float = setting(
        10.0,
        unit="m",
        reason="how far beyond its edge the road's height is the reference; then the ground",
        low=0,
    )
    max_cells: int = setting(
        60_000_000, unit="cells", reason="bounds the memory to about 2 GB", low=1000, high=2_000_000_000
    )


def find_road(points: Points, trajectory: Trajectory | None, config: RoadConfig) -> RoadSurface:
    """Find road and ground among the points.

    Raises
    ------
    InputError
        The extents need a larger grid than `max_cells`.
    """
    grid = _grid_for(points, config)
    cell = grid.cell_width_m
    z0 = float(np.median(points.xyz[:: max(len(points) // 10_000, 1), 2]))
    low, count = kernels.lowest_supported(
        points.xyz, grid.east_m, grid.north_m, z0, cell, grid.n_rows, grid.n_cols, config.support_m
    )
    height, spread = kernels.lowest_layer(
        points.xyz, grid.east_m, grid.north_m, z0, cell, low, config.layer_m
    )
    slope_east, slope_north = kernels.median_slope(height, cell, 2)
    known = ~np.isnan(height)
    rough = max(config.roughness_m, 1.5 * float(np.median(spread[known]))) if known.any() else 0.0
    smooth = known & (spread <= rough) & (np.hypot(slope_east, slope_north) <= config.max_grade)

    # The road: from under the van over everything that continues the slope
    seeds = _under(trajectory, grid, smooth, height + z0) if trajectory is not None else None
    slope = slope_east, slope_north
    if seeds is not None and seeds.any():
        is_road = _regions(height, slope, smooth, seeds, cell, config.max_step_m) > 0
    else:
        is_road = _largest(_regions(height, slope, smooth, smooth, cell, config.max_step_m), count)

    # The ground: on from the road with looser bounds, then pieces that the data separate from it
    level = np.zeros_like(height), np.zeros_like(height)
    is_ground = _regions(height, level, known, is_road, cell, config.ground_step_m) > 0
    apart = _apart_but_level(height, smooth & ~is_ground, is_ground, cell)
    is_ground |= _regions(height, level, known, apart, cell, config.ground_step_m) > 0

    road, distance = _carry_on(height, is_road, cell)
    ground, _ = _carry_on(height, is_ground, cell)
    share = np.clip((distance - config.carry_m) / max(config.carry_m, cell), 0.0, 1.0).astype(np.float32)
    return RoadSurface(grid, z0, (1 - share) * road + share * ground, ground, is_road, is_ground)


def height_above_road(surface: RoadSurface, xyz: FloatArray) -> Float32Array:
    """Return (n,) float32 heights above the road [m]; 0 on it, carried on smoothly beyond it."""
    return _height_above(surface, xyz, surface.road_m)


def height_above_ground(surface: RoadSurface, xyz: FloatArray) -> Float32Array:
    """Return (n,) float32 heights above the ground (the road is part of it). [m]"""  # noqa: D400
    return _height_above(surface, xyz, surface.ground_m)


def is_road_point(surface: RoadSurface, xyz: FloatArray, tolerance_m: float = 0.10) -> BoolArray:
    """Return (n,) bool: on a road cell and within `tolerance_m` of its surface (noise and grade in a cell)."""
    rows, cols = surface.grid.to_cell(xyz[:, :2])
    rows = np.clip(np.floor(rows).astype(np.int64), 0, surface.grid.n_rows - 1)
    cols = np.clip(np.floor(cols).astype(np.int64), 0, surface.grid.n_cols - 1)
    on_cell: BoolArray = surface.is_road[rows, cols]
    return on_cell & (np.abs(height_above_road(surface, xyz)) <= tolerance_m)


def _height_above(surface: RoadSurface, xyz: FloatArray, reference: Float32Array) -> Float32Array:
    g = surface.grid
    out: Float32Array = kernels.height_above(
        np.ascontiguousarray(xyz, dtype=np.float64),
        g.east_m,
        g.north_m,
        surface.z0_m,
        g.cell_width_m,
        reference,
    )
    return out


def _grid_for(points: Points, config: RoadConfig) -> Grid:
    bounds = points.bounds
    cells = (bounds.width_m / config.cell_m + 2) * (bounds.height_m / config.cell_m + 2)
    if not cells <= config.max_cells:
        raise InputError(
            f"extents of {bounds.width_m:.0f} x {bounds.height_m:.0f} m need {cells:.3g} cells of "
            f"{config.cell_m:g} m, allowed are {config.max_cells}",
            where="points",
            advice="extract a part of the survey, or raise road.max_cells or road.cell_m",
        )
    return Grid.covering(bounds, config.cell_m)


def _regions(
    height: Float32Array,
    slope: tuple[Float32Array, Float32Array],
    allowed: BoolArray,
    seeds: BoolArray,
    cell: float,
    max_step: float,
) -> AnyArray:
    # Contiguous, always: of one position only, numpy's are so, and numba would compile for both
    rows, cols = (np.ascontiguousarray(index) for index in np.nonzero(seeds))
    return np.asarray(kernels.label_regions(height, slope[0], slope[1], allowed, rows, cols, cell, max_step))


def _largest(labels: AnyArray, count: AnyArray) -> BoolArray:
    """Return the region that holds the most points: what the van drove on."""
    weight = np.bincount(labels.ravel(), weights=count.ravel())
    weight[0] = 0.5  # no region at all: the ground is found from everything
    chosen: BoolArray = labels == int(np.argmax(weight))
    return chosen


def _apart_but_level(
    height: Float32Array, candidates: BoolArray, ground: BoolArray, cell: float
) -> BoolArray:
    """Smooth pieces of 25 m2 and more that data holes part from the ground, and that lie level with it.

    Level: within a metre of the nearest ground plus a 12 % grade over the distance, at most 25 m of it: a
    roof stands higher than that over the ground at its foot. Opening by 3 x 3 cells drops wires.
    """
    labels, n = ndimage.label(ndimage.binary_opening(candidates, np.ones((3, 3))))
    if n == 0 or not ground.any():
        return np.zeros_like(candidates)
    index = np.arange(1, n + 1)
    large = ndimage.sum_labels(np.ones_like(labels), labels, index) * cell**2 >= 25.0
    distance, nearest = ndimage.distance_transform_edt(~ground, sampling=cell, return_indices=True)
    excess = np.abs(height - height[tuple(nearest)]) - 0.12 * np.minimum(distance, 25.0)
    level = ndimage.median(np.nan_to_num(excess, nan=1e6), labels, index) <= 1.0
    chosen: BoolArray = np.concatenate([[False], large & level])[labels]
    return chosen


def _under(trajectory: Trajectory, grid: Grid, smooth: BoolArray, height: AnyArray) -> BoolArray:
    """Smooth cells within a metre of the path in plan, and where the van's wheels can be.

    A path may be at the antenna's height: the usual distance below it tells the road from a bridge deck
    overhead, where that is all that was seen.
    """
    step = np.hypot(*np.diff(trajectory.xyz[:, :2], axis=0).T)
    chainage = np.concatenate([[0.0], np.cumsum(step)])
    at = np.arange(0.0, chainage[-1] + grid.cell_width_m, grid.cell_width_m / 2)
    path = np.stack([np.interp(at, chainage, trajectory.xyz[:, k]) for k in (0, 1, 2)], axis=-1)
    rows, cols = (np.floor(v).astype(np.int64) for v in grid.to_cell(path[:, :2]))
    reach = max(round(1.0 / grid.cell_width_m), 1)
    seeds = np.zeros(grid.shape, dtype=bool)
    drop = np.full(grid.shape, np.nan)
    for dr in range(-reach, reach + 1):
        for dc in range(-reach, reach + 1):
            r, c = rows + dr, cols + dc
            inside = (r >= 0) & (r < grid.n_rows) & (c >= 0) & (c < grid.n_cols)
            seeds[r[inside], c[inside]] = True
            drop[r[inside], c[inside]] = path[inside, 2] - height[r[inside], c[inside]]
    seeds &= smooth
    if seeds.any():
        seeds &= np.abs(drop - np.median(drop[seeds])) <= 1.0
    return seeds


def _carry_on(height: Float32Array, known: BoolArray, cell: float) -> tuple[Float32Array, Float32Array]:
    """Fill a surface from the nearest known cell, smooth the filled part, and give the distance to it."""
    if not (known & ~np.isnan(height)).any():
        known = ~np.isnan(height)
    distance, index = ndimage.distance_transform_edt(~known, sampling=cell, return_indices=True)
    filled = height[tuple(index)]
    # Rays of nearest cells meet in creases: average them over a fifth of the way already gone
    soft = ndimage.uniform_filter(filled, size=max(round(2.0 / cell), 1), mode="nearest")
    share = np.clip(distance / 2.0, 0.0, 1.0).astype(np.float32)
    out: Float32Array = ((1 - share) * filled + share * soft).astype(np.float32)
    return out, distance.astype(np.float32)
