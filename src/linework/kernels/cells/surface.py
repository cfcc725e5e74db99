"""Loops of the surface room over points and cells: heights per cell, slopes, heights above a surface."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import BoolArray, Float32Array, FloatArray, Int32Array, IntArray

#: Heights are added in steps of this: sums of whole numbers do not depend on the order of the points. [1/m]
FIXED = 2.0**20


@njit(cache=True, nogil=True)
def lowest_supported(
    xyz: FloatArray, west: int, south: int, n_rows: int, n_cols: int, cell: float, z0: float, support: float
) -> tuple[Int32Array, Float32Array, Float32Array, Int32Array]:
    """Return each point's cell and height, and per cell the lowest supported height and the number of points.

    Cells are counted from the coordinates' zero: `west` and `south` are the numbers of the first column and
    of the last row. A point on an edge belongs to the cell east or north of it. Points elsewhere: cell -1.

    A stray point below the ground stands alone: it is passed over when the next point above it is
    more than `support` higher. Of each cell the four lowest points are kept, so up to three strays
    are passed over. Heights are relative to z0; NaN where a cell holds no point.
    """
    cells = np.empty(len(xyz), dtype=np.int32)
    heights = np.empty(len(xyz), dtype=np.float32)
    low = np.full((n_rows * n_cols, 4), np.float32(np.inf), dtype=np.float32)
    count = np.zeros(n_rows * n_cols, dtype=np.int32)
    for i in range(len(xyz)):
        c = int(np.floor(xyz[i, 0] / cell)) - west
        r = n_rows - 1 - (int(np.floor(xyz[i, 1] / cell)) - south)
        if r < 0 or r >= n_rows or c < 0 or c >= n_cols:
            cells[i] = -1
            continue
        at = r * n_cols + c
        cells[i] = at
        count[at] += 1
        z = np.float32(xyz[i, 2] - z0)
        heights[i] = z
        # Pushed down the four places without a branch: whether a point is among the lowest cannot be foreseen
        for k in range(4):
            kept = low[at, k]
            low[at, k] = z if z < kept else kept
            z = kept if z < kept else z
    out = np.full(n_rows * n_cols, np.float32(np.nan), dtype=np.float32)
    for at in range(n_rows * n_cols):
        n = min(count[at], 4)
        for k in range(n):
            if k == n - 1 or low[at, k + 1] - low[at, k] <= support:
                out[at] = low[at, k]
                break
    return cells, heights, out.reshape((n_rows, n_cols)), count.reshape((n_rows, n_cols))


@njit(cache=True, nogil=True)
def lowest_layer(
    cells: Int32Array, heights: Float32Array, low: Float32Array, thickness: float
) -> tuple[Float32Array, Float32Array]:
    """Return mean height and spread of the points within `thickness` above each cell's low.

    They are added in whole numbers: neither the order of the points nor their batches matter. Squares lose
    their last 8 bits, so that 2**31 points of a layer 1 m thick have room in a cell.
    """
    n_rows, n_cols = low.shape
    floor = low.reshape(-1)
    total = np.zeros(n_rows * n_cols, dtype=np.int64)
    square = np.zeros(n_rows * n_cols, dtype=np.int64)
    number = np.zeros(n_rows * n_cols, dtype=np.int32)
    for i in range(len(cells)):
        at = cells[i]
        if at < 0:
            continue
        # Both as float32: the lowest point is 0 above itself
        above = float(heights[i]) - float(floor[at])
        if above >= 0.0 and above <= thickness:
            q = int(np.rint(above * FIXED))
            total[at] += q
            square[at] += (q * q) >> 8
            number[at] += 1
    mean = np.full(n_rows * n_cols, np.float32(np.nan), dtype=np.float32)
    spread = np.full(n_rows * n_cols, np.float32(np.nan), dtype=np.float32)
    for at in range(n_rows * n_cols):
        n = number[at]
        if n > 0:
            m = total[at] / n / FIXED
            mean[at] = np.float32(floor[at] + m)
            if n > 1:
                spread[at] = np.float32(np.sqrt(max(square[at] / n * (256.0 / FIXED / FIXED) - m * m, 0.0)))
    return mean.reshape((n_rows, n_cols)), spread.reshape((n_rows, n_cols))


@njit(cache=True, nogil=True)
def count_in_steps(values: Float32Array, step: float, n: int) -> IntArray:
    """Return how many values lie in each of the first n steps from 0; larger ones count in the last."""
    counts = np.zeros(n, dtype=np.int64)
    for r in range(values.shape[0]):
        for c in range(values.shape[1]):
            if not np.isnan(values[r, c]):
                counts[min(int(values[r, c] / step), n - 1)] += 1
    return counts


@njit(cache=True, nogil=True)
def median_slopes(
    height: Float32Array, wanted: BoolArray, cell: float, reach: int, network: Int32Array
) -> tuple[Float32Array, Float32Array]:
    """Return slope east and north: medians of neighbour differences within `reach` cells around.

    A median is not tilted by a kerb. NaN where not wanted; 0 where no difference is known.

    Parameters
    ----------
    height
        (n_rows + 2 h, n_cols + 2 h): with a halo of h = reach + 1 cells around the wanted ones.
    wanted
        (n_rows, n_cols).
    network
        (k, 2): comparisons that bring the middle of (2 reach + 1)**2 values, and the one below, to their places.

    Notes
    -----
    The cells of a row are sorted side by side, each in its own lane: 50 ns a cell instead of 500.
    """
    n_rows, n_cols = wanted.shape
    width = 2 * reach + 1
    east = np.full((n_rows, n_cols), np.float32(np.nan), dtype=np.float32)
    north = np.full((n_rows, n_cols), np.float32(np.nan), dtype=np.float32)
    step = np.empty((width, n_cols + 2 * reach), dtype=np.float32)
    values = np.empty((width * width, n_cols), dtype=np.float32)
    side = np.empty(n_cols, dtype=np.float32)
    stretches = np.empty((n_cols // 8 + 1, 2), dtype=np.int64)
    for r in range(n_rows):
        n = _stretches_of(wanted[r], stretches)
        if n == 0:
            continue
        for axis in range(2):
            for k in range(width):
                row = height[r + 1 + k]
                other = height[r + 2 + k]
                if axis == 0:
                    for c in range(n_cols + 2 * reach):
                        step[k, c] = row[c + 2] - row[c + 1]
                else:
                    for c in range(n_cols + 2 * reach):
                        step[k, c] = row[c + 1] - other[c + 1]
            out = east[r] if axis == 0 else north[r]
            _medians(step, stretches[:n], reach, network, values, side, out)
            for c in range(n_cols):
                out[c] = out[c] / np.float32(cell) if wanted[r, c] else np.float32(np.nan)
    return east, north


@njit(cache=True, nogil=True)
def _stretches_of(wanted: BoolArray, stretches: IntArray) -> int:
    """Write where each stretch of wanted columns begins and ends; return how many there are.

    Stretches less than 8 columns apart are one: short ones cost more than the columns between them.
    """
    n = 0
    for c in range(len(wanted)):
        if wanted[c]:
            if n == 0 or c - stretches[n - 1, 1] >= 8:
                stretches[n, 0] = c
                n += 1
            stretches[n - 1, 1] = c + 1
    return n


@njit(cache=True, nogil=True)
def _medians(
    step: Float32Array,
    stretches: IntArray,
    reach: int,
    network: Int32Array,
    values: Float32Array,
    side: Float32Array,
    out: Float32Array,
) -> None:
    """Write the median of the known steps around each column of the stretches.

    Missing values become infinite, in turn above and below all others: the middle stays the middle.
    """
    width = 2 * reach + 1
    m = 0
    for s in range(len(stretches)):
        begin, n = stretches[s, 0], stretches[s, 1] - stretches[s, 0]
        for k in range(width):
            for j in range(width):
                lane, source = values[k * width + j], step[k]
                for i in range(n):
                    lane[m + i] = source[begin + j + i]
        m += n
    side[:m] = np.float32(np.inf)
    for k in range(width * width):
        lane = values[k]
        for i in range(m):
            value, missing = lane[i], side[i]
            lane[i] = missing if value != value else value
            side[i] = -missing if value != value else missing
    for k in range(len(network)):
        a, b = values[network[k, 0]], values[network[k, 1]]
        for i in range(m):
            x, y = a[i], b[i]
            a[i] = x if x < y else y
            b[i] = y if x < y else x
    middle, below = values[width * width // 2], values[width * width // 2 - 1]
    m = 0
    for s in range(len(stretches)):
        for c in range(stretches[s, 0], stretches[s, 1]):
            # An odd number is missing: one more above than below, so the two middle values lie one lower
            median = np.float32(0.5) * (below[m] + middle[m]) if side[m] < 0.0 else middle[m]
            out[c] = median if np.isfinite(median) else np.float32(0.0)
            m += 1


@njit(cache=True, nogil=True)
def height_above(
    xyz: FloatArray, west: float, north: float, z0: float, cell: float, reference: Float32Array
) -> Float32Array:
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
