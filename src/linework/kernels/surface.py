"""Loops of the surface room: lowest supported height per cell, its layer, region growing, heights."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

F64 = npt.NDArray[np.float64]
F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]


@njit(cache=True, nogil=True)
def lowest_supported(
    xyz: F64, west: float, north: float, z0: float, cell: float, n_rows: int, n_cols: int, support: float
) -> tuple[F32, I32]:
    """Return per cell the lowest height that another point supports, and the number of points.

    A stray point below the ground stands alone: it is passed over when the next point above it is
    more than `support` higher. Of each cell the four lowest points are kept, so up to three strays
    are passed over. Heights are relative to z0; NaN where a cell holds no point.
    """
    low = np.full((n_rows, n_cols, 4), np.float32(np.inf), dtype=np.float32)
    count = np.zeros((n_rows, n_cols), dtype=np.int32)
    for i in range(len(xyz)):
        c = int(np.floor((xyz[i, 0] - west) / cell))
        r = int(np.floor((north - xyz[i, 1]) / cell))
        if r < 0 or r >= n_rows or c < 0 or c >= n_cols:
            continue
        count[r, c] += 1
        z = np.float32(xyz[i, 2] - z0)
        if z >= low[r, c, 3]:
            continue
        k = 3
        while k > 0 and low[r, c, k - 1] > z:
            low[r, c, k] = low[r, c, k - 1]
            k -= 1
        low[r, c, k] = z
    out = np.full((n_rows, n_cols), np.float32(np.nan), dtype=np.float32)
    for r in range(n_rows):
        for c in range(n_cols):
            n = min(count[r, c], 4)
            for k in range(n):
                if k == n - 1 or low[r, c, k + 1] - low[r, c, k] <= support:
                    out[r, c] = low[r, c, k]
                    break
    return out, count


@njit(cache=True, nogil=True)
def lowest_layer(
    xyz: F64, west: float, north: float, z0: float, cell: float, low: F32, thickness: float
) -> tuple[F32, F32]:
    """Return mean height and spread of the points within `thickness` above each cell's low."""
    n_rows, n_cols = low.shape
    total = np.zeros((n_rows, n_cols))
    square = np.zeros((n_rows, n_cols))
    number = np.zeros((n_rows, n_cols), dtype=np.int32)
    for i in range(len(xyz)):
        c = int(np.floor((xyz[i, 0] - west) / cell))
        r = int(np.floor((north - xyz[i, 1]) / cell))
        if r < 0 or r >= n_rows or c < 0 or c >= n_cols:
            continue
        above = xyz[i, 2] - z0 - low[r, c]
        if above >= 0.0 and above <= thickness:
            total[r, c] += above
            square[r, c] += above * above
            number[r, c] += 1
    mean = np.full((n_rows, n_cols), np.float32(np.nan), dtype=np.float32)
    spread = np.full((n_rows, n_cols), np.float32(np.nan), dtype=np.float32)
    for r in range(n_rows):
        for c in range(n_cols):
            n = number[r, c]
            if n > 0:
                m = total[r, c] / n
                mean[r, c] = low[r, c] + m
                spread[r, c] = np.sqrt(max(square[r, c] / n - m * m, 0.0))
    return mean, spread


@njit(cache=True, nogil=True)
def median_about(image: F64, row: int, col: int, reach: int, values: F64) -> float:
    """Return the median of the known values within `reach` cells; 0 where none is. `values`: room for them.

    They are kept in order as they come: faster than a selection for so few.
    """
    n_rows, n_cols = image.shape
    n = 0
    for r in range(max(row - reach, 0), min(row + reach + 1, n_rows)):
        for c in range(max(col - reach, 0), min(col + reach + 1, n_cols)):
            value = image[r, c]
            if np.isnan(value):
                continue
            k = n
            while k > 0 and values[k - 1] > value:
                values[k] = values[k - 1]
                k -= 1
            values[k] = value
            n += 1
    if n == 0:
        return 0.0
    return float(values[n // 2] if n % 2 else 0.5 * (values[n // 2 - 1] + values[n // 2]))


@njit(cache=True, nogil=True)
def median_slope(height: F32, cell: float, reach: int) -> tuple[F32, F32]:
    """Return slope east and north: medians of neighbour differences within `reach` cells around.

    A median is not tilted by a kerb. NaN where no height is known; 0 where no difference is.
    """
    n_rows, n_cols = height.shape
    east = np.full((n_rows, n_cols), np.float32(np.nan), dtype=np.float32)
    north = np.full((n_rows, n_cols), np.float32(np.nan), dtype=np.float32)
    to_east, to_north = np.full((n_rows, n_cols), np.nan), np.full((n_rows, n_cols), np.nan)
    for r in range(n_rows):
        for c in range(n_cols):
            if c + 1 < n_cols:
                to_east[r, c] = (height[r, c + 1] - height[r, c]) / cell
            if r + 1 < n_rows:
                to_north[r, c] = (height[r, c] - height[r + 1, c]) / cell
    values = np.empty((2 * reach + 1) ** 2)
    for r in range(n_rows):
        for c in range(n_cols):
            if not np.isnan(height[r, c]):
                east[r, c] = median_about(to_east, r, c, reach, values)
                north[r, c] = median_about(to_north, r, c, reach, values)
    return east, north


@njit(cache=True, nogil=True)
def label_regions(
    height: F32,
    slope_east: F32,
    slope_north: F32,
    allowed: Mask,
    seed_rows: I64,
    seed_cols: I64,
    cell: float,
    max_step: float,
) -> I32:
    """Grow a region from every seed that no earlier one has reached; return labels 1, 2 ... and 0.

    Growth runs over 4-neighbours, and across one missing cell. A neighbour joins when it is allowed and
    its height differs from what the local slope predicts by at most `max_step`.
    """
    n_rows, n_cols = height.shape
    labels = np.zeros((n_rows, n_cols), dtype=np.int32)
    stack = np.empty((n_rows * n_cols, 2), dtype=np.int32)
    label = 0
    for i in range(len(seed_rows)):
        r, c = seed_rows[i], seed_cols[i]
        if not allowed[r, c] or labels[r, c] != 0:
            continue
        label += 1
        labels[r, c] = label
        stack[0, 0] = r
        stack[0, 1] = c
        n = 1
        while n > 0:
            n -= 1
            r, c = stack[n, 0], stack[n, 1]
            for k in range(4):
                dr = (k == 0) - (k == 1)
                dc = (k == 2) - (k == 3)
                for reach in range(1, 3):
                    rr, cc = r + dr * reach, c + dc * reach
                    if rr < 0 or rr >= n_rows or cc < 0 or cc >= n_cols:
                        break
                    if np.isnan(height[rr, cc]):
                        continue  # look one cell further: a hole between two scan lines
                    if allowed[rr, cc] and labels[rr, cc] == 0:
                        east = 0.5 * (slope_east[r, c] + slope_east[rr, cc])
                        north = 0.5 * (slope_north[r, c] + slope_north[rr, cc])
                        expected = (east * dc - north * dr) * reach * cell
                        if abs(height[rr, cc] - height[r, c] - expected) <= max_step:
                            labels[rr, cc] = label
                            stack[n, 0] = rr
                            stack[n, 1] = cc
                            n += 1
                    break
    return labels


@njit(cache=True, nogil=True)
def height_above(xyz: F64, west: float, north: float, z0: float, cell: float, reference: F32) -> F32:
    """Return each point's height above the reference surface, bilinear between cell centres."""
    n_rows, n_cols = reference.shape
    out = np.empty(len(xyz), dtype=np.float32)
    for i in range(len(xyz)):
        x = min(max((xyz[i, 0] - west) / cell - 0.5, 0.0), n_cols - 1.0)
        y = min(max((north - xyz[i, 1]) / cell - 0.5, 0.0), n_rows - 1.0)
        c, r = min(int(x), n_cols - 2), min(int(y), n_rows - 2)
        c, r = max(c, 0), max(r, 0)
        c1, r1 = min(c + 1, n_cols - 1), min(r + 1, n_rows - 1)
        fx, fy = x - c, y - r
        top = reference[r, c] * (1.0 - fx) + reference[r, c1] * fx
        bottom = reference[r1, c] * (1.0 - fx) + reference[r1, c1] * fx
        out[i] = np.float32(xyz[i, 2] - z0 - (top * (1.0 - fy) + bottom * fy))
    return out
