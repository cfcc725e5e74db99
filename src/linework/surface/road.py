"""Road and ground of a survey, and heights of points above them.

The papers start from heights that are "normalized by making the road surface height equal to zero"
and show road and non-road points (Manandhar and Shibasaki 2002, figure 2) without saying how. Here:

1. the lowest supported height of every cell: stray points below the ground are isolated, and single ones that
   nothing around continues are no ground (`linework.surface.strays`);
2. the mean of the layer above it, and its spread (roughness);
3. the ground is where the bare earth shows, road or no road: verges, banks, pavements, fields, not roofs
   (`linework.surface.bare_earth`);
4. the road grows from under the trajectory (without one: every large smooth piece of the ground is road) over
   cells that continue the local slope; a kerb is a step that the slope does not explain;
5. beyond the road its surface is extended from the nearest edge, and blended into the ground.

`find_ground` does this for points in memory; `linework.runs.opened.surface` does the same tile by tile.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray
from linework.errors import InputError, UsageError, argument
from linework.kernels.cells import surface as kernels
from linework.model.ground import Ground as Ground
from linework.model.points import Points, refuse_unusable
from linework.model.trajectory import Trajectory
from linework.surface.bare_earth import block_halos, block_sizes
from linework.surface.blocks import BlockHeights
from linework.surface.carry import CoarseGround, extended_surface, halo_cells
from linework.surface.cells import CellWindow, path_samples
from linework.surface.choose import Choice
from linework.surface.config import RoadConfig as RoadConfig
from linework.surface.heights import (
    CellHeights,
    SpreadsUnder,
    UnevenLimits,
    cell_heights,
    count_spreads,
    height_origin,
    rough_limit_m,
)
from linework.surface.regions import Islands, cell_regions, cells_with, region_halo
from linework.surface.strays import LoneCells, stray_halo, without_strays


def find_ground(
    points: Points, trajectory: Trajectory | None = None, config: RoadConfig | None = None
) -> Ground:
    """Return road and ground, found in the points of a survey.

    Parameters
    ----------
    points
        In any order; only their positions matter.
    trajectory
        Path of the vehicle: the road is below it. None: all large regions of smooth ground are road.
    config
        Settings; None: the defaults.

    Raises
    ------
    UsageError
        There are no points, or coordinates that are not finite.
    InputError
        The extents need a larger grid than `max_cells`.

    Examples
    --------
    >>> east, north = np.meshgrid(np.arange(0.05, 20.0, 0.1), np.arange(0.05, 20.0, 0.1))
    >>> plane = np.stack([east.ravel(), north.ravel(), 7.0 + 0.02 * north.ravel()], axis=-1)
    >>> ground = find_ground(Points(plane))
    >>> bool(ground.is_road.all()), ground.height_m(np.array([[10.0, 10.0]])).round(3).tolist()
    (True, [7.2])
    """
    config = config or RoadConfig()
    if not len(points):
        raise UsageError("no points", where=argument("points"), advice="give at least one")
    refuse_unusable(points)
    window = _window_of(points, config)
    z0_m = height_origin(points.xyz[:: max(len(points) // 10_000, 1), 2])
    # Lowest supported height of every cell, and spread of the layer above it
    heights = cell_heights(points.xyz, window, z0_m, config)
    path = path_samples(trajectory, config.cell_m)
    uneven = UnevenLimits.of(SpreadsUnder.of(path, heights, z0_m, config.cell_m), config)
    is_dense = LoneCells.of(heights).is_dense
    if is_dense:
        halo = stray_halo(config)
        near, near_spread, n_near = (
            _with_halo(plane, halo) for plane in (heights.height, heights.spread, heights.count)
        )
        heights = replace(heights, height=without_strays(near, near_spread, n_near, config))
    limit_m = rough_limit_m(count_spreads(heights.spread), config)
    # Regions that continue the slope, and looser ones
    regions, facts = cell_regions(
        window,
        _with_halo(heights.height, region_halo(config)),
        _blocks_around(heights, config),
        heights.spread,
        heights.count,
        path,
        _islands(heights, config.cell_m),
        limit_m,
        uneven.over(window, config.cell_m),
        is_dense,
        z0_m,
        config,
    )
    # The road is under the van; the ground is bare earth, and what roads lie on
    choice = Choice([facts], [], config.cell_m)
    is_road = cells_with(regions.road, choice.road_labels(0))
    is_ground = is_road | cells_with(regions.ground, choice.ground_labels(0))
    coarse = CoarseGround.of(window, regions.height, is_ground, config.cell_m)
    # Beyond its edge the road is extended, and blended into the ground
    halo = halo_cells(config)
    road_m, ground_m, sigma_m = extended_surface(
        window,
        _with_halo(regions.height, halo),
        heights.spread,
        _with_halo(is_road, halo),
        _with_halo(is_ground, halo),
        coarse,
        config,
    )
    return Ground(window.grid(config.cell_m), z0_m, road_m, ground_m, is_road, is_ground, sigma_m)


def height_above_road(surface: Ground, xyz: FloatArray) -> Float32Array:
    """Return the heights of points (n, 3) [m, world] above the road, extended beyond it, (n,) float32 [m]."""
    return _height_above(surface, xyz, surface.road_m)


def height_above_ground(surface: Ground, xyz: FloatArray) -> Float32Array:
    """Return the heights of points (n, 3) [m, world] above the ground, the road included, (n,) float32 [m]."""
    return _height_above(surface, xyz, surface.ground_m)


def is_road_point(surface: Ground, xyz: FloatArray, tolerance_m: float = 0.10) -> BoolArray:
    """Return which points (n, 3) [m, world] lie on a road cell within `tolerance_m` of its surface, (n,) bool.

    The tolerance covers noise, and the grade within a cell.
    """
    rows, cols = surface.grid.to_cell(xyz[:, :2])
    rows = np.clip(np.floor(rows).astype(np.int64), 0, surface.grid.n_rows - 1)
    cols = np.clip(np.floor(cols).astype(np.int64), 0, surface.grid.n_cols - 1)
    on_cell: BoolArray = surface.is_road[rows, cols]
    return on_cell & (np.abs(height_above_road(surface, xyz)) <= tolerance_m)


def _height_above(surface: Ground, xyz: FloatArray, reference: Float32Array) -> Float32Array:
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


def _window_of(points: Points, config: RoadConfig) -> CellWindow:
    bounds = points.bounds
    cells = (bounds.width_m / config.cell_m + 2) * (bounds.height_m / config.cell_m + 2)
    if not cells <= config.max_cells:
        raise InputError(
            f"extents of {bounds.width_m:.0f} x {bounds.height_m:.0f} m need {cells:.3g} cells of "
            f"{config.cell_m:g} m, allowed are {config.max_cells}",
            where="points",
            advice="extract a part of the survey, or raise road.max_cells or road.cell_m",
        )
    return CellWindow.over(bounds, config.cell_m)


def _islands(heights: CellHeights, cell_m: float) -> Islands:
    """Return the recorded areas of a window."""
    rows, cols = heights.window.blocks(cell_m)
    r, c = np.nonzero(heights.count)
    code = np.unique((rows[r] - rows[-1]) << 32 | (cols[c] - cols[0]))
    return Islands.of(np.stack([(code & 0xFFFFFFFF) + cols[0], (code >> 32) + rows[-1]], axis=-1))


def _blocks_around(heights: CellHeights, config: RoadConfig) -> dict[int, BlockHeights]:
    """Return the blocks on which the regions of a window depend; beyond the window they are empty."""
    found, halos = {}, block_halos(config)
    for size in block_sizes(config):
        own = BlockHeights.of(heights.window, heights.height, size)
        found[size] = BlockHeights.united(size, own.window.grown(halos[size]), [own])
    return found


def _with_halo(values: AnyArray, n: int) -> AnyArray:
    """Return an array padded by n unknown cells on every side."""
    return np.pad(values, n, constant_values=np.nan if values.dtype == np.float32 else 0)
