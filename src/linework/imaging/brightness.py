"""How bright the ground is, as the eye wants it: paint stands out near and far, on old and on new asphalt."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt, map_coordinates

from linework.arrays import AnyArray, BoolArray, FloatArray

#: What is no higher than this above the ground about it is shown: the road with its kerbs. [m]
ABOVE_M = 0.30
#: The ground's height is taken from squares of this side. [m]
GROUND_CELL_M = 1.0
#: Share of a square's points that may be stray ones below the ground.
STRAY_SHARE = 0.02
#: Grey of the median brightness; paint is lighter.
MIDDLE_GREY = 0.3
#: A block has to hold so many cells for percentiles of its own.
LEAST_CELLS = 30


def near_ground(xyz: FloatArray) -> BoolArray:
    """Return (n,) bool: the point is on the lowest thing about it, or little above.

    Parameters
    ----------
    xyz
        (n, 3) float64 [m]. The lowest thing in a square of 1 m is the height that 2 % of its points are below.
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
    """Return the brightness of the ground as greys of 0 to 1, row 0 at the bottom; NaN where no point is near.

    Parameters
    ----------
    places
        (n, 2) float64 [m]: where the points are, in the picture's axes.
    intensity
        (n,) as recorded, on any scale.
    box
        Picture's extent: (left, right), (bottom, top). [m]
    cell_m
        Side of a pixel. Gaps between scan lines are filled from up to three pixels, or 0.25 m, away.
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
    # Blocks of 2 m: across a lane, intensity falls to a third with range and incidence
    grey = local_grey(mean, max(8, round(2.0 / cell_m)))
    return _filled(grey, max(3.0, 0.25 / cell_m))


def local_grey(values: FloatArray, block: int) -> FloatArray:
    """Return greys: the median of the surroundings is dark grey, their brightest hundredth white.

    Parameters
    ----------
    values
        (rows, cols) float64, NaN where nothing is.
    block
        Surroundings are blocks of so many rows and columns; between their middles all changes evenly.

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
    enough = np.isfinite(blocks).sum(axis=1) >= LEAST_CELLS
    middle, bright = np.full(rows * cols, np.nan), np.full(rows * cols, np.nan)
    if not enough.any():
        if not np.isfinite(values).any():
            return np.full(values.shape, np.nan)
        middle[:], bright[:] = np.nanpercentile(values, [50, 99])
    else:
        middle[enough], bright[enough] = np.nanpercentile(blocks[enough], [50, 99], axis=1)
    middle_at, bright_at = (
        _between(_filled(v.reshape(rows, cols), np.inf), block, values.shape) for v in (middle, bright)
    )
    # Where nothing is brighter, noise is not blown up to look like paint
    span = np.maximum(bright_at - middle_at, 0.5 * np.abs(middle_at) + 1e-9)
    return np.asarray(np.clip(MIDDLE_GREY + (1.0 - MIDDLE_GREY) * (values - middle_at) / span, 0.0, 1.0))


def _between(blocks: FloatArray, block: int, shape: tuple[int, ...]) -> FloatArray:
    """Return (rows, cols) values that run evenly from middle to middle of the blocks."""
    places = [(np.arange(n) + 0.5) / block - 0.5 for n in shape]
    grid = np.meshgrid(*places, indexing="ij")
    return np.asarray(map_coordinates(blocks, grid, order=1, mode="nearest"))


def _filled(values: FloatArray, reach: float) -> FloatArray:
    """Return values with empty cells taken from the nearest one that is not, up to `reach` cells away."""
    is_empty = np.isnan(values)
    if not is_empty.any() or is_empty.all():
        return values
    distance, nearest = distance_transform_edt(is_empty, return_indices=True)
    return np.asarray(np.where(distance <= reach, values[tuple(nearest)], np.nan))
