"""A grid turned to the main direction of a survey, so that a long road fits a narrow image."""

from __future__ import annotations

import math

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.imaging.raster import check_cells
from linework.model.grid import Grid
from linework.model.points import Points
from linework.model.trajectory import Trajectory


def main_direction_grid(
    points: Points, cell_along_m: float, cell_across_m: float, *, trajectory: Trajectory | None = None
) -> Grid:
    """Return the smallest grid over the points whose columns run along the main direction.

    Parameters
    ----------
    cell_along_m, cell_across_m
        Cell width (along the road) and height (across it). [m]
    trajectory
        Gives the direction where it has two places or more; else the points do.

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
        raise InputError("no points to make an image of", advice="check the survey with linework info")
    along_path = trajectory is not None and len(trajectory) > 1
    direction = main_direction_rad((trajectory if along_path else points).xyz[:, :2])  # type: ignore[union-attr]
    rotation_deg = math.degrees(direction)
    cos, sin = math.cos(math.radians(rotation_deg)), math.sin(math.radians(rotation_deg))
    origin = points.xyz[0, :2]
    east, north = points.xyz[:, 0] - origin[0], points.xyz[:, 1] - origin[1]
    along, up = east * cos + north * sin, north * cos - east * sin
    # Half a cell of margin: no point lies on the edge, whatever the rounding
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

    It is in (-pi/2, pi/2]; 0 where there is none (one place, or a round cloud).

    >>> import numpy as np
    >>> round(math.degrees(main_direction_rad(np.array([[0.0, 0.0], [2.0, 2.0], [4.0, 4.0]]))), 9)
    45.0
    """
    de, dn = (xy - xy.mean(axis=0)).T
    # Twice the angle of the principal axis of the symmetric 2 x 2 covariance, in closed form
    sideways, shared = float(de @ de - dn @ dn), 2.0 * float(de @ dn)
    direction = 0.5 * math.atan2(shared, sideways)
    return math.pi / 2 if direction <= -math.pi / 2 else direction
