"""Binary image: the cells that hold points inside a band of heights."""

from __future__ import annotations

import numpy as np

from linework.arrays import AnyArray, FloatArray, checked
from linework.imaging.raster import check_size, placement
from linework.kernels.rasterise import count_in_band
from linework.model.grid import Grid, Image


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
    The paper filters the image of heights; we count the points of the band themselves, so that a rail
    below a branch or a sign is not lost behind the cell's maximum.

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
