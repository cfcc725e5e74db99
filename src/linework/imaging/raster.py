"""Raster images of laser points: density, heights, intensity and height bands, and grids for them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, Float32Array, FloatArray, IntArray, checked
from linework.errors import InputError
from linework.kernels.cells.rasterise import cells_of_coordinates, count_in_band, rasterise_points
from linework.model.grid import Grid, Image
from linework.model.points import Points
from linework.model.trajectory import Trajectory

#: Most cells of a grid: 36 bytes per cell while counting, so 1.8 GB. A square of 1.4 km at 0.20 m.
MAX_CELLS = 50_000_000


@dataclass(frozen=True, slots=True)
class RasterImages:
    """Images of one pass over the points.

    Parameters
    ----------
    density
        uint32: points per cell.
    maximum, minimum, mean
        float32: highest, lowest and mean height less `height_origin_m`; NaN in empty cells. [m]
    intensity
        float32: mean intensity as recorded, NaN in empty cells; None where the points have none.
    height_origin_m
        Origin of the heights; 0 where heights above the road were given. float32 resolves 0.1 mm within 1 km of it.
        [m]
    """

    density: Image
    maximum: Image
    minimum: Image
    mean: Image
    intensity: Image | None
    height_origin_m: float


def rasterise(points: Points, grid: Grid, *, height_m: Float32Array | None = None) -> RasterImages:
    """Return density, maximum, minimum and mean height, and mean intensity of the points on `grid`.

    Parameters
    ----------
    height_m
        (n,) float32: heights to use instead of the points' own, e.g. above the road; points whose height is NaN or
        beyond 100 km are left out. [m]

    Raises
    ------
    InputError
        When the grid is larger than `MAX_CELLS`.

    Notes
    -----
    Points outside the grid are left out. Cells are half open (west and north edge inside, before rotation) and computed
    on the lattice that grids share, so that a point on an edge is in the same cell in every tile. The result does not
    depend on the order of the points.

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
    density, *heights, bright = rasterise_points(
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
        raise InputError("no points for an image", advice="check the survey with linework info")
    bounds = points.bounds
    check_cells(bounds.width_m / cell_m, bounds.height_m / cell_m)
    return Grid.covering(bounds, cell_m)


def cell_indices(points: Points, grid: Grid) -> IntArray:
    """Return the (n,) int64 index ``row * n_cols + col`` of the cell of each point; -1 outside the grid."""
    cells: IntArray = cells_of_coordinates(points.xyz, placement(grid), grid.n_rows, grid.n_cols)
    return cells


def check_size(grid: Grid) -> None:
    """Check the size of a grid before anything of its size is allocated.

    Raises
    ------
    InputError
        When the grid has more than `MAX_CELLS` cells.
    """
    check_cells(grid.n_cols, grid.n_rows)


def check_cells(n_cols: float, n_rows: float) -> None:
    """Check a number of columns and rows, which may be fractions, inf or NaN.

    Raises
    ------
    InputError
        When there are more than `MAX_CELLS` cells.
    """
    if not n_cols * n_rows <= MAX_CELLS:
        raise InputError(
            f"an image of {n_rows:,.0f} x {n_cols:,.0f} cells = {n_rows * n_cols:,.0f}, "
            f"the limit is {MAX_CELLS:,}",
            advice="use a larger cell, a grid along the road, or a part of the survey",
        )


def placement(grid: Grid) -> FloatArray:
    """Return the (8,) placement of a grid as the kernels of `linework.kernels.cells.rasterise` take it.

    A north-up grid whose corner is a multiple of its cell counts cells from the origin of the world, any other grid
    from its own corner.
    """
    w, h = grid.cell_width_m, grid.cell_height_m
    cos, sin = math.cos(math.radians(grid.rotation_deg)), math.sin(math.radians(grid.rotation_deg))
    first_col, top_row = round(grid.east_m / w), round(grid.north_m / h)
    # 1e-6 of a cell: the rounding of k * cell and back is 1e-8 of a cell at UTM northings
    on_lattice = abs(grid.east_m / w - first_col) < 1e-6 and abs(grid.north_m / h - top_row) < 1e-6
    if grid.rotation_deg == 0.0 and on_lattice:
        return np.array([0.0, 0.0, 1.0, 0.0, w, h, first_col, top_row], dtype=np.float64)
    return np.array([grid.east_m, grid.north_m, cos, sin, w, h, 0.0, 0.0], dtype=np.float64)


def in_height_band(
    points_xyz: FloatArray,
    height_m: AnyArray,
    grid: Grid,
    low_m: float,
    high_m: float,
    *,
    min_points: int = 1,
) -> Image:
    """Return the bool image that is True where at least `min_points` points lie in the band of heights.

    Parameters
    ----------
    points_xyz
        (n, 3) float64 [m, world].
    height_m
        (n,) float [m]: height of each point above the road; NaN is in no band.
    low_m, high_m
        The band, both ends inside [m]: 0.2 and 1.2 for guardrails; `high_m` may be inf.

    Raises
    ------
    InputError
        When the grid is larger than `linework.imaging.raster.MAX_CELLS`.

    Notes
    -----
    The paper filters the image of heights; here the points in the band are counted, so that a rail below a branch or a
    sign is not hidden by the maximum of the cell.

    References
    ----------
    Manandhar and Shibasaki (2002), "Binary Image Creation".

    >>> xyz = np.array([[0.1, 0.1, 0.0], [0.3, 0.1, 0.0]])
    >>> in_height_band(xyz, np.array([0.7, 3.0]), Grid(0.0, 0.2, 0.2, 0.2, 1, 2), 0.2, 1.2).values
    array([[ True, False]])
    """
    check_size(grid)
    xyz = checked("points_xyz", points_xyz, np.float64, (None, 3))
    height = checked("height_m", height_m, np.float32, (len(xyz),))
    count = count_in_band(xyz, height, low_m, high_m, placement(grid), grid.n_rows, grid.n_cols)
    return Image(count.reshape(grid.shape) >= max(min_points, 1), grid)


def main_direction_grid(
    points: Points, cell_along_m: float, cell_across_m: float, *, trajectory: Trajectory | None = None
) -> Grid:
    """Return the smallest grid over the points whose columns run along the main direction.

    Parameters
    ----------
    cell_along_m, cell_across_m
        Cell width (along the road) and height (across it). [m]
    trajectory
        The direction is taken from it where it has two positions or more, else from the points.

    Raises
    ------
    InputError
        When there are no points, or the grid would be larger than `linework.imaging.raster.MAX_CELLS`.

    Notes
    -----
    The direction is the first principal axis in plan, turned so that columns run eastwards (due north if
    neither): rotation in (-90, 90] degrees.
    """
    if len(points) == 0:
        raise InputError("no points for an image", advice="check the survey with linework info")
    along_path = trajectory is not None and len(trajectory) > 1
    direction = main_direction_rad((trajectory if along_path else points).xyz[:, :2])  # type: ignore[union-attr]
    rotation_deg = math.degrees(direction)
    cos, sin = math.cos(math.radians(rotation_deg)), math.sin(math.radians(rotation_deg))
    origin = points.xyz[0, :2]
    east, north = points.xyz[:, 0] - origin[0], points.xyz[:, 1] - origin[1]
    along, up = east * cos + north * sin, north * cos - east * sin
    # Half a cell of margin, so that no point lies on the edge whatever the rounding
    left, top = along.min() - 0.5 * cell_along_m, up.max() + 0.5 * cell_across_m
    n_cols = math.floor((along.max() - left) / cell_along_m) + 1
    n_rows = math.floor((top - up.min()) / cell_across_m) + 1
    check_cells(n_cols, n_rows)
    return Grid(
        east_m=float(origin[0] + left * cos - top * sin),
        north_m=float(origin[1] + left * sin + top * cos),
        cell_width_m=cell_along_m,
        cell_height_m=cell_across_m,
        n_rows=n_rows,
        n_cols=n_cols,
        rotation_deg=rotation_deg,
    )


def main_direction_rad(xy: FloatArray) -> float:
    """Return the direction of the first principal axis of (n, 2) places, anticlockwise from east.

    It is in (-pi/2, pi/2] [rad]; 0 where there is none (one place, or a round cloud).

    >>> import numpy as np
    >>> round(math.degrees(main_direction_rad(np.array([[0.0, 0.0], [2.0, 2.0], [4.0, 4.0]]))), 9)
    45.0
    """
    de, dn = (xy - xy.mean(axis=0)).T
    # Twice the angle of the principal axis of the symmetric 2 x 2 covariance, in closed form
    sideways, shared = float(de @ de - dn @ dn), 2.0 * float(de @ dn)
    direction = 0.5 * math.atan2(shared, sideways)
    return math.pi / 2 if direction <= -math.pi / 2 else direction
