"""When the points near lines were measured: one pass over all points."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray


@njit(cache=True, nogil=True)
def times_near(
    xyz: FloatArray, time_s: FloatArray, vertices: FloatArray, owner: IntArray, n_lines: int, reach: float
) -> tuple[FloatArray, FloatArray]:
    """Return the first and the last time of the points within `reach` of each line's vertices, in space.

    vertices (k, 3), at least one; owner (k,): the line each belongs to. A line without points near: NaN.

    Vertices are chained in every cell that their circle touches: 4 at most, as cells are wider than circles.
    """
    cell = 2.5 * reach
    west, south = vertices[:, 0].min() - reach, vertices[:, 1].min() - reach
    n_x = int((vertices[:, 0].max() + reach - west) / cell) + 1
    n_y = int((vertices[:, 1].max() + reach - south) / cell) + 1
    first = np.full((n_y, n_x), -1, dtype=np.int32)
    following = np.empty(4 * len(vertices), dtype=np.int32)
    entry = np.empty(4 * len(vertices), dtype=np.int32)
    n = 0
    for v in range(len(vertices)):
        x, y = vertices[v, 0] - west, vertices[v, 1] - south
        for row in range(int(max(y - reach, 0.0) / cell), min(int((y + reach) / cell), n_y - 1) + 1):
            for col in range(int(max(x - reach, 0.0) / cell), min(int((x + reach) / cell), n_x - 1) + 1):
                entry[n], following[n] = v, first[row, col]
                first[row, col] = n
                n += 1
    start, end = np.full(n_lines, np.inf), np.full(n_lines, -np.inf)
    for i in range(len(xyz)):
        x, y = (xyz[i, 0] - west) / cell, (xyz[i, 1] - south) / cell
        if not (x >= 0.0 and y >= 0.0 and x < n_x and y < n_y):
            continue
        k = first[int(y), int(x)]
        while k >= 0:
            v = entry[k]
            k = following[k]
            line, t = owner[v], time_s[i]
            if t >= start[line] and t <= end[line]:
                continue
            away = (
                (xyz[i, 0] - vertices[v, 0]) ** 2
                + (xyz[i, 1] - vertices[v, 1]) ** 2
                + (xyz[i, 2] - vertices[v, 2]) ** 2
            )
            if away <= reach * reach:
                start[line], end[line] = min(start[line], t), max(end[line], t)
    for line in range(n_lines):
        if start[line] > end[line]:
            start[line], end[line] = np.nan, np.nan
    return start, end


# Sums over a few stations about each, of many lines that lie one after the other


@njit(cache=True, nogil=True)
def moving_sums(values: FloatArray, offsets: IntArray, half: int) -> FloatArray:
    """Return (n, m) the sums over the station itself and `half` on either side, line by line.

    Line i has the stations from offsets[i] to offsets[i + 1]; beyond its ends there is nothing. From
    cumulative sums along each line: counts add up exactly, whatever lies before them.
    """
    n, m = values.shape
    out, total = np.empty((n, m)), np.zeros((n + 1, m))
    for i in range(len(offsets) - 1):
        begin, stop = offsets[i], offsets[i + 1]
        length = stop - begin
        total[0] = 0.0
        for k in range(length):
            for j in range(m):
                total[k + 1, j] = total[k, j] + values[begin + k, j]
        for k in range(length):
            high, low = min(k + half + 1, length), max(k - half, 0)
            for j in range(m):
                out[begin + k, j] = max(total[high, j] - total[low, j], 0.0)
    return out
