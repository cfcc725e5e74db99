"""Kernels of the road surface: heights per cell, median slopes, heights of points above a surface."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import BoolArray, Float32Array, FloatArray, Int32Array, IntArray

#: Steps of the fixed-point sums of heights: integer sums do not depend on the order of the points. [1/m]
FIXED = 2.0**20
#: Lowest points kept per cell: up to three stray points are passed over.
_N_LOW = 4
#: Points of a layer that is no chance: two strays have about the same height now and then.
_N_LAYER = 3
#: Bits dropped from the squares of heights in steps: 2**31 points of a layer 1 m thick have room in a cell.
_SQUARE_BITS = 8
#: Runs of wanted columns less than this apart are processed as one: short ones cost more. [columns]
_LEAST_APART = 8


@njit(cache=True, nogil=True)
def lowest_supported(
    xyz: FloatArray, west: int, south: int, n_rows: int, n_cols: int, cell: float, z0: float, support: float
) -> tuple[Int32Array, Float32Array, Float32Array, Int32Array]:
    """Return cell and height of each point, and the lowest supported height and the number of points of each cell.

    A stray point below the ground is isolated: it is passed over when the next point above it is more than
    `support` higher. The four lowest points of each cell are kept, so up to three strays are passed over.

    Parameters
    ----------
    xyz
        (n, 3) points. [m, world]
    west, south, n_rows, n_cols
        Numbers of the first column and of the last row, counted from the zero of the coordinates, and the
        shape. A point on an edge belongs to the cell east or north of it. [cells]
    cell, z0, support
        Side of a cell, zero of heights, and greatest distance of a supporting point. [m]

    Returns
    -------
    cells
        (n,) int32 flat index; -1 outside.
    heights
        (n,) float32 above z0. [m]
    low
        (n_rows, n_cols) float32 above z0, NaN in empty cells. [m]
    count
        (n_rows, n_cols) int32.
    """
    cells = np.empty(len(xyz), dtype=np.int32)
    heights = np.empty(len(xyz), dtype=np.float32)
    low = np.full((n_rows * n_cols, _N_LOW), np.float32(np.inf), dtype=np.float32)
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
        # Inserted without a branch, which could not be predicted
        for k in range(_N_LOW):
            kept = low[at, k]
            low[at, k] = z if z < kept else kept
            z = kept if z < kept else z
    out = np.full(n_rows * n_cols, np.float32(np.nan), dtype=np.float32)
    for at in range(n_rows * n_cols):
        n = min(count[at], _N_LOW)
        for k in range(n):
            if k == n - 1 or low[at, k + 1] - low[at, k] <= support:
                out[at] = low[at, k]
                break
    return cells, heights, out.reshape((n_rows, n_cols)), count.reshape((n_rows, n_cols))


@njit(cache=True, nogil=True)
def above_strays(
    cells: Int32Array,
    heights: Float32Array,
    low: Float32Array,
    count: Int32Array,
    number: Int32Array,
    thickness: float,
    least: int,
    share: float,
) -> tuple[Float32Array, int]:
    """Return the lows of cells, where layers of points tell strays from the ground, and how many have changed.

    The lowest layer with at least `share` of the points of the densest one, and three, is the ground.

    Parameters
    ----------
    cells, heights, low, count
        As `lowest_supported` returns them.
    number
        (n_rows, n_cols) int32 points of the lowest layer: `lowest_layer`.
    thickness
        Of a layer. [m]
    least, share
        Points of a densest layer of which this can be said, and the share.
    """
    floor, n_points, n_lowest = low.reshape(-1).copy(), count.reshape(-1), number.reshape(-1)
    # Where the points of each cell that may have strays begin
    begin = np.full(len(floor), -1, dtype=np.int64)
    total = 0
    for at in range(len(floor)):
        if n_points[at] >= least and n_lowest[at] < max(_N_LAYER, share * n_points[at]):
            begin[at] = total
            total += n_points[at]
    if total == 0:
        return floor.reshape(low.shape), 0
    inside = np.empty(total, dtype=np.float32)
    end = begin.copy()
    for i in range(len(cells)):
        at = cells[i]
        if at >= 0 and begin[at] >= 0:
            inside[end[at]] = heights[i]
            end[at] += 1
    n_changed = 0
    for at in range(len(floor)):
        if begin[at] < 0:
            continue
        ordered = np.sort(inside[begin[at] : end[at]])
        # Points from each on within the thickness
        n_layer = np.zeros(len(ordered), dtype=np.int64)
        stop = 0
        for k in range(len(ordered)):
            while stop < len(ordered) and ordered[stop] - ordered[k] <= thickness:
                stop += 1
            n_layer[k] = stop - k
        densest = n_layer.max()
        if densest < least:
            continue
        k = 0
        while n_layer[k] < max(_N_LAYER, share * densest):
            k += 1
        if ordered[k] > floor[at]:
            floor[at] = ordered[k]
            n_changed += 1
    return floor.reshape(low.shape), n_changed


@njit(cache=True, nogil=True)
def lowest_layer(
    cells: Int32Array, heights: Float32Array, low: Float32Array, thickness: float
) -> tuple[Float32Array, Float32Array, Int32Array]:
    """Return mean and standard deviation of heights, and number, of the points within `thickness` above each cell's low.

    Sums are of whole numbers: neither the order of the points nor their batches matter.

    Parameters
    ----------
    cells, heights, low
        As `lowest_supported` returns them.
    thickness
        Of the layer. [m]

    Returns
    -------
    mean, spread, number
        (n_rows, n_cols) float32 each, NaN in empty cells; the spread also with one point [m]; int32.
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
        # Both are float32, so that the lowest point is exactly 0 above itself
        above = float(heights[i]) - float(floor[at])
        if above >= 0.0 and above <= thickness:
            q = int(np.rint(above * FIXED))
            total[at] += q
            square[at] += (q * q) >> _SQUARE_BITS
            number[at] += 1
    mean = np.full(n_rows * n_cols, np.float32(np.nan), dtype=np.float32)
    spread = np.full(n_rows * n_cols, np.float32(np.nan), dtype=np.float32)
    for at in range(n_rows * n_cols):
        n = number[at]
        if n > 0:
            m = total[at] / n / FIXED
            mean[at] = np.float32(floor[at] + m)
            if n > 1:
                spread[at] = np.float32(
                    np.sqrt(max(square[at] / n * (2.0**_SQUARE_BITS / FIXED / FIXED) - m * m, 0.0))
                )
    return mean.reshape((n_rows, n_cols)), spread.reshape((n_rows, n_cols)), number.reshape((n_rows, n_cols))


@njit(cache=True, nogil=True)
def count_in_steps(values: Float32Array, step: float, n: int) -> IntArray:
    """Return the histogram of values (rows, cols) in `n` bins of width `step` from 0, (n,) int64; NaN is left out.

    Larger values count in the last bin.
    """
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
    """Return slopes east and north, (n_rows, n_cols) float32: medians of neighbour differences within `reach` cells.

    A kerb does not tilt a median. NaN where not wanted; 0 where no difference is known.

    Parameters
    ----------
    height
        (n_rows + 2 h, n_cols + 2 h) float32, with a halo of h = reach + 1 cells. [m]
    wanted
        (n_rows, n_cols) bool.
    cell, reach
        Side of a cell [m], and reach of the median [cells].
    network
        (k, 2) int32 comparisons that bring the median of (2 reach + 1)**2 values, and the one below, to their
        places; see `linework.surface.heights.middle_network`.

    Notes
    -----
    The cells of a row are sorted side by side, each in its own lane: 50 ns per cell instead of 500.
    """
    n_rows, n_cols = wanted.shape
    width = 2 * reach + 1
    east = np.full((n_rows, n_cols), np.float32(np.nan), dtype=np.float32)
    north = np.full((n_rows, n_cols), np.float32(np.nan), dtype=np.float32)
    step = np.empty((width, n_cols + 2 * reach), dtype=np.float32)
    values = np.empty((width * width, n_cols), dtype=np.float32)
    side = np.empty(n_cols, dtype=np.float32)
    runs = np.empty((n_cols // _LEAST_APART + 1, 2), dtype=np.int64)
    for r in range(n_rows):
        n = _runs_of(wanted[r], runs)
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
            _medians(step, runs[:n], reach, network, values, side, out)
            for c in range(n_cols):
                out[c] = out[c] / np.float32(cell) if wanted[r, c] else np.float32(np.nan)
    return east, north


@njit(cache=True, nogil=True)
def _runs_of(wanted: BoolArray, runs: IntArray) -> int:
    """Write the range of each run of wanted columns, and return their number."""
    n = 0
    for c in range(len(wanted)):
        if wanted[c]:
            if n == 0 or c - runs[n - 1, 1] >= _LEAST_APART:
                runs[n, 0] = c
                n += 1
            runs[n - 1, 1] = c + 1
    return n


@njit(cache=True, nogil=True)
def _medians(
    step: Float32Array,
    runs: IntArray,
    reach: int,
    network: Int32Array,
    values: Float32Array,
    side: Float32Array,
    out: Float32Array,
) -> None:
    """Write the median of the known steps around each column of the runs.

    Missing values become infinite, alternately above and below all others, which keeps the median.
    """
    width = 2 * reach + 1
    m = 0
    for s in range(len(runs)):
        begin, n = runs[s, 0], runs[s, 1] - runs[s, 0]
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
    for s in range(len(runs)):
        for c in range(runs[s, 0], runs[s, 1]):
            # With an odd number missing there is one more above than below: the two middle values lie one lower
            median = np.float32(0.5) * (below[m] + middle[m]) if side[m] < 0.0 else middle[m]
            out[c] = median if np.isfinite(median) else np.float32(0.0)
            m += 1


@njit(cache=True, nogil=True)
def height_above(
    xyz: FloatArray, west: float, north: float, z0: float, cell: float, reference: Float32Array
) -> Float32Array:
    """Return the height of each point above a surface, bilinear between cell centres, (n,) float32 [m].

    Parameters
    ----------
    xyz
        (n, 3) points. [m, world]
    west, north, cell
        Edges of the north-up grid and side of a cell. [m, world]
    z0, reference
        Zero of heights [m, world], and (n_rows, n_cols) float32 heights above it [m].
    """
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
