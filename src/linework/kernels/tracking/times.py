"""Times of the points near lines, and moving sums along lines; each in one pass."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, Int32Array, IntArray

#: Side of a lookup cell over the radius of the circles in it: wider than a circle, so that one touches 4 at most.
CELL_OVER_REACH, MOST_CELLS = 2.5, 4


@njit(cache=True, nogil=True)
def times_near(
    xyz: FloatArray, time_s: FloatArray, vertices: FloatArray, owner: IntArray, n_lines: int, reach: float
) -> tuple[FloatArray, FloatArray]:
    """Return the first and the last time of the points within `reach` of each line's vertices, in space.

    Parameters
    ----------
    xyz, time_s
        (n, 3) [m], (n,) [s]: the points.
    vertices, owner
        (k, 3) [m], k >= 1; (k,) int64: the line that each belongs to.
    reach
        [m].

    Returns
    -------
    (n_lines,) first and (n_lines,) last times [s]; NaN for a line without points near it.

    Notes
    -----
    Vertices are chained in every cell that their circle touches: at most 4, as cells are wider than circles.
    """
    cell, west, south, first, following, entry = _vertices_by_cell(vertices, reach)
    n_y, n_x = first.shape
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


@njit(cache=True, nogil=True)
def moving_sums(values: FloatArray, offsets: IntArray, half: int) -> FloatArray:
    """Return the sums over each station and `half` stations on either side, line by line, (n, m).

    Parameters
    ----------
    values
        (n, m), not negative: columns over the stations of all lines.
    offsets
        (k + 1,): line i has the stations from offsets[i] to offsets[i + 1]; beyond its ends nothing is added.

    Notes
    -----
    From cumulative sums along each line, so that counts add up exactly, whatever lies before them. These are kept for
    one line at a time: those of all lines would not stay in the processor's cache.
    """
    n, m = values.shape
    longest = 0
    for i in range(len(offsets) - 1):
        longest = max(longest, offsets[i + 1] - offsets[i])
    out, total = np.empty((n, m)), np.zeros((longest + 1, m))
    for i in range(len(offsets) - 1):
        begin, stop = offsets[i], offsets[i + 1]
        length = stop - begin
        for k in range(length):
            for j in range(m):
                total[k + 1, j] = total[k, j] + values[begin + k, j]
        for k in range(length):
            high, low = min(k + half + 1, length), max(k - half, 0)
            for j in range(m):
                out[begin + k, j] = max(total[high, j] - total[low, j], 0.0)
    return out


@njit(cache=True, nogil=True)
def points_near(
    xyz: FloatArray, vertices: FloatArray, owner: IntArray, reach: float
) -> tuple[IntArray, IntArray]:
    """Return the points within `reach` of each line's vertices, in space: (k,) int64 lines, and (k,) int64 points.

    Parameters
    ----------
    xyz
        (n, 3) [m]: the points.
    vertices, owner
        (v, 3) [m], v >= 1; (v,) int64: the line that each belongs to.
    reach
        [m].

    Notes
    -----
    In the order of the points; a point may be near several lines, but each pair occurs once.
    """
    cell, west, south, first, following, entry = _vertices_by_cell(vertices, reach)
    n_y, n_x = first.shape
    lines, points = np.empty(1024, dtype=np.int64), np.empty(1024, dtype=np.int64)
    n = 0
    for i in range(len(xyz)):
        x, y = (xyz[i, 0] - west) / cell, (xyz[i, 1] - south) / cell
        if not (x >= 0.0 and y >= 0.0 and x < n_x and y < n_y):
            continue
        own = n
        k = first[int(y), int(x)]
        while k >= 0:
            v = entry[k]
            k = following[k]
            away = (
                (xyz[i, 0] - vertices[v, 0]) ** 2
                + (xyz[i, 1] - vertices[v, 1]) ** 2
                + (xyz[i, 2] - vertices[v, 2]) ** 2
            )
            is_new = away <= reach * reach
            for j in range(own, n):
                is_new = is_new and lines[j] != owner[v]
            if is_new:
                if n == len(lines):
                    lines = np.concatenate((lines, np.empty_like(lines)))
                    points = np.concatenate((points, np.empty_like(points)))
                lines[n], points[n] = owner[v], i
                n += 1
    return lines[:n].copy(), points[:n].copy()


@njit(cache=True, nogil=True)
def _vertices_by_cell(
    vertices: FloatArray, reach: float
) -> tuple[float, float, float, Int32Array, Int32Array, Int32Array]:
    """Return side, west and south edge of cells [m], and the vertices whose circles touch each, as chains."""
    cell = CELL_OVER_REACH * reach
    west, south = vertices[:, 0].min() - reach, vertices[:, 1].min() - reach
    n_x = int((vertices[:, 0].max() + reach - west) / cell) + 1
    n_y = int((vertices[:, 1].max() + reach - south) / cell) + 1
    first = np.full((n_y, n_x), -1, dtype=np.int32)
    following = np.empty(MOST_CELLS * len(vertices), dtype=np.int32)
    entry = np.empty(MOST_CELLS * len(vertices), dtype=np.int32)
    n = 0
    for v in range(len(vertices)):
        x, y = vertices[v, 0] - west, vertices[v, 1] - south
        for row in range(int(max(y - reach, 0.0) / cell), min(int((y + reach) / cell), n_y - 1) + 1):
            for col in range(int(max(x - reach, 0.0) / cell), min(int((x + reach) / cell), n_x - 1) + 1):
                entry[n], following[n] = v, first[row, col]
                first[row, col] = n
                n += 1
    return cell, west, south, first, following, entry
