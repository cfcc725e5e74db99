"""Brightness images of the ground with local contrast: paint stands out near and far, on old and new asphalt."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt, map_coordinates

from linework.arrays import AnyArray, BoolArray, FloatArray

#: Largest height above the ground that is shown: the road with its kerbs. [m]
ABOVE_M = 0.30
#: Side of the squares in which the height of the ground is determined. [m]
GROUND_CELL_M = 1.0
#: Share of the points of a square that may be outliers below the ground.
STRAY_SHARE = 0.02
#: Grey of the median brightness, 0 black and 1 white; paint is lighter.
MIDDLE_GREY = 0.3
#: Fewest cells of a block that has percentiles of its own.
LEAST_GREY_CELLS = 30
#: Side of the blocks of local contrast [m], and at least [pixels]: across a lane, intensity falls to a third with range
#: and incidence.
BLOCK_M, LEAST_BLOCK_PX = 2.0, 8
#: Reach over which gaps between scan lines are filled. [m, pixels]
GAP_FILL_M, GAP_FILL_PX = 0.25, 3.0
#: Percentiles of the brightness of the road and of paint.
ROAD_PERCENTILE, PAINT_PERCENTILE = 50, 99
#: Least span from grey to white as a share of the median, so that noise is not amplified where nothing is brighter.
LEAST_SPAN = 0.5


def near_ground(xyz: FloatArray) -> BoolArray:
    """Return (n,) bool: the point is on the ground or at most `ABOVE_M` above it.

    Parameters
    ----------
    xyz
        (n, 3) points. [m] The ground in a square of 1 m is the height that 2 % of its points are below.
    """
    if len(xyz) == 0:
        return np.zeros(0, dtype=np.bool_)
    col, row = np.floor(xyz[:, :2].T / GROUND_CELL_M).astype(np.int64)
    _, square = np.unique((col - col.min()) * (np.ptp(row) + 1) + row - row.min(), return_inverse=True)
    order = np.lexsort((xyz[:, 2], square))
    count = np.bincount(square)
    low = np.cumsum(count) - count + np.floor(STRAY_SHARE * count).astype(np.int64)
    return np.asarray(xyz[:, 2] <= xyz[order[low], 2][square] + ABOVE_M)


def brightness_picture(
    places: FloatArray, intensity: AnyArray, box: tuple[tuple[float, float], tuple[float, float]], cell_m: float
) -> FloatArray:  # fmt: skip
    """Return (rows, cols) brightness of the ground from 0 to 1, row 0 at the bottom; NaN where no point is near.

    Parameters
    ----------
    places
        (n, 2) points in the axes of the picture. [m]
    intensity
        (n,) intensity as recorded, on any scale.
    box
        Extent of the picture: (left, right), (bottom, top). [m]
    cell_m
        Side of a pixel. [m] Gaps between scan lines are filled from up to `GAP_FILL_PX` pixels or `GAP_FILL_M` away.
    """
    (left, right), (bottom, top) = box
    n_cols, n_rows = max(1, round((right - left) / cell_m)), max(1, round((top - bottom) / cell_m))
    col = np.floor((places[:, 0] - left) / cell_m).astype(np.int64)
    row = np.floor((places[:, 1] - bottom) / cell_m).astype(np.int64)
    inside = (col >= 0) & (col < n_cols) & (row >= 0) & (row < n_rows)
    cell = (row * n_cols + col)[inside]
    n = np.bincount(cell, minlength=n_rows * n_cols)
    total = np.bincount(cell, weights=intensity[inside], minlength=n_rows * n_cols)
    mean = np.divide(total, n, out=np.full(len(n), np.nan), where=n > 0).reshape(n_rows, n_cols)
    grey = local_grey(mean, max(LEAST_BLOCK_PX, round(BLOCK_M / cell_m)))
    return _filled(grey, max(GAP_FILL_PX, GAP_FILL_M / cell_m))


def local_grey(values: FloatArray, block: int) -> FloatArray:
    """Return (rows, cols) greys from 0 to 1: the local median is dark grey, the brightest hundredth white.

    Parameters
    ----------
    values
        (rows, cols) brightness, NaN where there is none.
    block
        Side of the blocks whose percentiles are taken, interpolated between their centres. [cells]

    Examples
    --------
    >>> one, ten = np.full((40, 40), 50.0), np.full((40, 40), 500.0)
    >>> one[:, 20], ten[:, 20] = 100.0, 1000.0
    >>> bool(np.allclose(local_grey(one, 10), local_grey(ten, 10)))
    True
    """
    rows, cols = (-(-n // block) for n in values.shape)
    padded = np.full((rows * block, cols * block), np.nan)
    padded[: values.shape[0], : values.shape[1]] = values
    blocks = padded.reshape(rows, block, cols, block).swapaxes(1, 2).reshape(rows * cols, -1)
    enough = np.isfinite(blocks).sum(axis=1) >= LEAST_GREY_CELLS
    middle, bright = np.full(rows * cols, np.nan), np.full(rows * cols, np.nan)
    if not enough.any():
        if not np.isfinite(values).any():
            return np.full(values.shape, np.nan)
        middle[:], bright[:] = np.nanpercentile(values, [ROAD_PERCENTILE, PAINT_PERCENTILE])
    else:
        middle[enough], bright[enough] = np.nanpercentile(
            blocks[enough], [ROAD_PERCENTILE, PAINT_PERCENTILE], axis=1
        )
    middle_at, bright_at = (
        _between(_filled(v.reshape(rows, cols), np.inf), block, values.shape) for v in (middle, bright)
    )
    span = np.maximum(bright_at - middle_at, LEAST_SPAN * np.abs(middle_at) + 1e-9)
    return np.asarray(np.clip(MIDDLE_GREY + (1.0 - MIDDLE_GREY) * (values - middle_at) / span, 0.0, 1.0))


def _between(blocks: FloatArray, block: int, shape: tuple[int, ...]) -> FloatArray:
    """Return (rows, cols) values interpolated linearly between the centres of the blocks."""
    places = [(np.arange(n) + 0.5) / block - 0.5 for n in shape]
    grid = np.meshgrid(*places, indexing="ij")
    return np.asarray(map_coordinates(blocks, grid, order=1, mode="nearest"))


def _filled(values: FloatArray, reach: float) -> FloatArray:
    """Return values with empty cells filled from the nearest known one, up to `reach` cells away."""
    is_empty = np.isnan(values)
    if not is_empty.any() or is_empty.all():
        return values
    distance, nearest = distance_transform_edt(is_empty, return_indices=True)
    return np.asarray(np.where(distance <= reach, values[tuple(nearest)], np.nan))
