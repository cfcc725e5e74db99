"""Raster images of the laser points: how many per cell, how high, how bright."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from linework.arrays import Float32Array, FloatArray, IntArray, checked
from linework.errors import InputError
from linework.kernels import rasterise as kernels
from linework.model.grid import Grid, Image
from linework.model.points import Points

#: Largest grid that is made: 36 bytes per cell while counting, so 1.8 GB. A square of 1.4 km at 0.20 m.
MAX_CELLS = 50_000_000


@dataclass(frozen=True, slots=True)
class RasterImages:
    """The images of one pass over the points.

    Parameters
    ----------
    density
        uint32: points per cell.
    maximum, minimum, mean
        float32 [m]: highest, lowest and mean height, less `height_origin_m`; NaN where no point is.
    intensity
        float32: mean intensity as recorded, NaN where no point is; None where the points have none.
    height_origin_m
        Add it to get world heights; 0 where heights above the road were given. float32 holds 0.1 mm up to
        1 km about it.
    """

    density: Image
    maximum: Image
    minimum: Image
    mean: Image
    intensity: Image | None
    height_origin_m: float


def rasterise(points: Points, grid: Grid, *, height_m: Float32Array | None = None) -> RasterImages:
    """Return density, maximum, minimum and mean height, and mean intensity, of the points on `grid`.

    Parameters
    ----------
    height_m
        (n,) float32 [m]: heights to use instead of the points' own, e.g. above the road; points whose
        height is NaN, or beyond 100 km, are left out.

    Raises
    ------
    InputError
        When the grid is larger than `MAX_CELLS`.

    Notes
    -----
    Points outside the grid are left out. Cells are half open (west and north edge inside, before
    rotation), and decided on the lattice that grids share, so a point on an edge is in the same cell
    whatever tile it is seen from. The answer does not depend on the order of the points. One pass.

    >>> cloud = Points(np.array([[0.1, 0.1, 5.0], [0.1, 0.15, 7.0], [0.5, 0.1, 6.0]]))
    >>> images = rasterise(cloud, grid_for(cloud, 0.2))
    >>> images.density.values.tolist(), (images.maximum.values + images.height_origin_m).tolist()
    ([[2, 0, 1]], [[7.0, nan, 6.0]])
    """
    check_size(grid)
    n = len(points)
    if height_m is None:
        height: FloatArray | Float32Array = points.xyz[:, 2]
        origin = float(math.floor(height.min())) if n else 0.0
    else:
        height, origin = checked("height_m", height_m, np.float32, (n,)), 0.0
    intensity = points.intensity if points.intensity is not None else np.zeros(0, dtype=np.float32)
    density, *heights, bright = kernels.rasterise(
        points.xyz, height, origin, intensity, placement(grid), grid.n_rows, grid.n_cols
    )
    maximum, minimum, mean = (Image(h.reshape(grid.shape), grid) for h in heights)
    has_intensity = points.intensity is not None and n > 0
    return RasterImages(
        density=Image(density.reshape(grid.shape), grid),
        maximum=maximum,
        minimum=minimum,
        mean=mean,
        intensity=Image(bright.reshape(grid.shape), grid) if has_intensity else None,
        height_origin_m=origin,
    )


def grid_for(points: Points, cell_m: float) -> Grid:
    """Return the smallest north-up grid over the points on the global lattice of multiples of `cell_m`.

    Raises
    ------
    InputError
        When there are no points, or the grid would be larger than `MAX_CELLS`.
    """
    if len(points) == 0:
        raise InputError("no points to make an image of", advice="check the survey with linework info")
    bounds = points.bounds
    check_cells(bounds.width_m / cell_m, bounds.height_m / cell_m)
    return Grid.covering(bounds, cell_m)


def cells_of(points: Points, grid: Grid) -> IntArray:
    """Return the (n,) int64 index ``row * n_cols + col`` of the cell of each point; -1 outside the grid."""
    cells: IntArray = kernels.cells_of(points.xyz, placement(grid), grid.n_rows, grid.n_cols)
    return cells


def check_size(grid: Grid) -> None:
    """Refuse a grid of more than `MAX_CELLS` cells, before anything of its size is made."""
    check_cells(grid.n_cols, grid.n_rows)


def check_cells(n_cols: float, n_rows: float) -> None:
    """Refuse `n_cols` x `n_rows` cells (fractions, inf and NaN allowed) when they are over `MAX_CELLS`."""
    if not n_cols * n_rows <= MAX_CELLS:
        raise InputError(
            f"an image of {n_rows:,.0f} x {n_cols:,.0f} cells = {n_rows * n_cols:,.0f}, "
            f"the limit is {MAX_CELLS:,}",
            advice="take a larger cell, a grid turned to the road, or a part of the survey",
        )


def placement(grid: Grid) -> FloatArray:
    """Return the (8,) float64 placement of a grid as the kernels take it (see `kernels.rasterise.cell_of`).

    A north-up grid whose corner is a multiple of its cell counts cells from the world's origin; any other
    grid from its own corner.
    """
    w, h = grid.cell_width_m, grid.cell_height_m
    cos, sin = math.cos(math.radians(grid.rotation_deg)), math.sin(math.radians(grid.rotation_deg))
    first_col, top_row = round(grid.east_m / w), round(grid.north_m / h)
    # 1e-6 of a cell: the rounding of k * cell and back is 1e-8 of a cell at UTM northings
    on_lattice = abs(grid.east_m / w - first_col) < 1e-6 and abs(grid.north_m / h - top_row) < 1e-6
    if grid.rotation_deg == 0.0 and on_lattice:
        return np.array([0.0, 0.0, 1.0, 0.0, w, h, first_col, top_row], dtype=np.float64)
    return np.array([grid.east_m, grid.north_m, cos, sin, w, h, 0.0, 0.0], dtype=np.float64)
