"""Kernels of the cable search: crowded columns, points near a segment, the Radon transform of a vertical slice."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from linework.arrays import AnyArray

#: Sub-cells along a side of a column: 25 in all, one bit each of an int32.
SIDE = 5
#: Elements of the grid of columns: side of a column [m], columns per row, first column, first row.
COLUMN_SIDE, COLUMNS_PER_ROW, FIRST_COLUMN, FIRST_ROW = range(4)

#: Room for points near a segment at first; doubled as needed.
_ROOM = 256
#: Multiplier that combines the numbers of a cell up and across into one: there are fewer than this across.
_KEY_STRIDE = 1e3


class SliceCurve(NamedTuple):
    """A hanging curve in a slice: height at station 0 [m], slope, curvature [1/m]."""

    height: float
    slope: float
    curvature: float


@njit(cache=True, nogil=True)
def crowding(
    order: AnyArray, start: AnyArray, layer: AnyArray, sub_cell: AnyArray, reach: int
) -> tuple[AnyArray, AnyArray]:
    """Return how full the column of each point is above or below it, and how wide its layer is.

    Parameters
    ----------
    order, start
        (n,) int64 points by column, and (columns + 1,) int64: where each column begins.
    layer, sub_cell
        (n,) int32 height bin of each point, and its sub-cell, 0 to 24.
    reach
        Layers above and below that are looked at.

    Returns
    -------
    stacked
        (n,) int32: occupied layers among layer + 2 .. layer + reach, or among those below where there are more.
    spread
        (n,) int32: occupied sub-cells of the column within one layer of the point.
    """
    stacked = np.zeros(len(layer), np.int32)
    spread = np.zeros(len(layer), np.int32)
    for c in range(len(start) - 1):
        first, last = start[c], start[c + 1]
        lowest = layer[order[first]]
        highest = lowest
        for i in range(first, last):
            lowest = min(lowest, layer[order[i]])
            highest = max(highest, layer[order[i]])
        n = highest - lowest + 1 + 2 * reach
        bits = np.zeros(n, np.int32)
        for i in range(first, last):
            p = order[i]
            bits[layer[p] - lowest + reach] |= np.int32(1) << sub_cell[p]
        below = np.zeros(n + 1, np.int32)  # number of occupied layers below each one
        for k in range(n):
            below[k + 1] = below[k] + (1 if bits[k] != 0 else 0)
        for i in range(first, last):
            p = order[i]
            k = layer[p] - lowest + reach
            stacked[p] = max(below[k + reach + 1] - below[k + 2], below[k - 1] - below[k - reach])
            union = bits[k - 1] | bits[k] | bits[k + 1]
            while union:
                union &= union - np.int32(1)
                spread[p] += 1
    return stacked, spread


@njit(cache=True, nogil=True)
def near_segment(
    keys: AnyArray,
    start: AnyArray,
    order: AnyArray,
    grid: AnyArray,
    xy: AnyArray,
    segment: AnyArray,
    reach: float,
) -> AnyArray:
    """Return the indices of the points within `reach` [m] of a segment in plan, (k,) int64.

    Parameters
    ----------
    keys, start, order
        (columns,) sorted row-major numbers of the occupied columns, (columns + 1,) where each begins in `order`,
        and (n,) points by column; int64.
    grid
        (4,) elements `COLUMN_SIDE` to `FIRST_ROW`.
    xy
        (n, 2) points. [m]
    segment
        (6,) x and y of a point, unit direction, first and last station. [m]
    """
    cell, n_cols = grid[COLUMN_SIDE], int(grid[COLUMNS_PER_ROW])
    west_col, south_row = int(grid[FIRST_COLUMN]), int(grid[FIRST_ROW])
    x0, y0, ux, uy, low, high = segment
    xa, xb = x0 + ux * low, x0 + ux * high
    ya, yb = y0 + uy * low, y0 + uy * high
    row_low = math.floor((min(ya, yb) - reach) / cell)
    row_high = math.floor((max(ya, yb) + reach) / cell)
    found = np.empty(_ROOM, np.int64)
    n = 0
    for row in range(max(row_low, south_row), row_high + 1):
        west, east = min(xa, xb) - reach, max(xa, xb) + reach
        if abs(uy) > 1e-6:  # the part of the line that can touch this row
            t1 = (row * cell - reach - y0) / uy
            t2 = ((row + 1) * cell + reach - y0) / uy
            ta, tb = max(min(t1, t2), low), min(max(t1, t2), high)
            west = max(west, min(x0 + ux * ta, x0 + ux * tb) - 1.5 * reach)
            east = min(east, max(x0 + ux * ta, x0 + ux * tb) + 1.5 * reach)
        col_low = max(math.floor(west / cell) - west_col, 0)
        col_high = min(math.floor(east / cell) - west_col, n_cols - 1)
        first = (row - south_row) * n_cols
        k = np.searchsorted(keys, first + col_low)
        while k < len(keys) and keys[k] <= first + col_high:
            for i in range(start[k], start[k + 1]):
                p = order[i]
                dx, dy = xy[p, 0] - x0, xy[p, 1] - y0
                along = dx * ux + dy * uy
                if low <= along <= high and abs(dy * ux - dx * uy) <= reach:
                    if n == len(found):
                        found = np.concatenate((found, np.empty(n, np.int64)))
                    found[n] = p
                    n += 1
            k += 1
    return found[:n]


@njit(cache=True, nogil=True)
def best_curve(
    points: tuple[AnyArray, AnyArray, AnyArray],
    left: AnyArray,
    shapes: tuple[AnyArray, AnyArray],
    sides: tuple[float, ...],
) -> tuple[int, SliceCurve]:
    """Return the number of steps along the best curve of a slice that support it, and the curve.

    Each step along the slice has one vote, which its occupied cells share.

    Parameters
    ----------
    points
        (n,) stations (rising), offsets and heights. [m]
    left
        (n,) bool: points that vote.
    shapes
        (k,) slopes and (c,) curvatures [1/m] that are tried.
    sides
        Sides of a cell along, up and across, and height of a bin of votes. [m]
    """
    s, o, z = points
    along, up, across, bin_m = sides
    voter, weight, step_of = np.empty(len(s), np.int64), np.empty(len(s)), np.empty(len(s), np.int64)
    key = np.empty(len(s))
    n, first = 0, 0
    for i in range(len(s)):
        if not left[i]:
            continue
        step = math.floor(s[i] / along)
        if n > first and step != step_of[first]:
            weight[first:n] = 1.0 / (n - first)
            first = n
        cell = math.floor(z[i] / up) * _KEY_STRIDE + math.floor(o[i] / across)
        k = n  # cells of a step in rising order, the first point of each
        while k > first and key[k - 1] > cell:
            k -= 1
        if k > first and key[k - 1] == cell:
            continue
        for j in range(n, k, -1):
            key[j], voter[j] = key[j - 1], voter[j - 1]
        key[k], voter[k], step_of[n] = cell, i, step
        n += 1
    weight[first:n] = 1.0 / max(n - first, 1)
    s, z = s[voter[:n]], z[voter[:n]]
    curve = slice_peak(s, z, weight[:n], shapes[0], shapes[1], bin_m)
    seen, last = 0, -(10**9)
    for i in range(n):
        off = z[i] - curve.height - curve.slope * s[i] - 0.5 * curve.curvature * s[i] * s[i]
        near = abs(off) <= bin_m
        if near and step_of[i] != last:
            seen, last = seen + 1, step_of[i]
    return seen, curve


@njit(cache=True, nogil=True)
def slice_peak(
    s: AnyArray, z: AnyArray, weight: AnyArray, slopes: AnyArray, curvatures: AnyArray, bin_m: float
) -> SliceCurve:
    """Return the hanging curve with most votes of the cells of a slice.

    A Radon transform of the vertical slice with one more parameter, the curvature: each cell votes with its
    weight for the height z - m s - k s^2 / 2. Two neighbouring bins count together, so that no curve falls
    between.

    Parameters
    ----------
    s, z, weight
        (n,) stations [m], heights [m] and weights of the cells.
    slopes, curvatures
        (k,) and (c,) that are tried. [1, 1/m]
    bin_m
        Height of a bin. [m]
    """
    top, best = 0.0, SliceCurve(0.0, 0.0, 0.0)
    bend = 0.5 * curvatures.max() * max(s.max() ** 2, s.min() ** 2)
    tilt = np.abs(slopes).max() * max(abs(s.max()), abs(s.min()))
    lowest = z.min() - tilt - bend
    n_bins = int((z.max() + tilt - lowest) / bin_m) + 3
    votes = np.zeros(n_bins + 1)  # bins count from 1: the first one has a neighbour below
    sag, bins = np.empty(len(s)), np.empty(len(s), np.int32)
    for k in curvatures:
        for i in range(len(s)):
            sag[i] = 0.5 * k * s[i] * s[i]
        for m in slopes:
            for i in range(len(s)):
                bins[i] = np.int32((z[i] - m * s[i] - sag[i] - lowest) / bin_m) + 1
            highest = 0.0
            for i in range(len(s)):
                b = bins[i]
                votes[b] += weight[i]
                highest = max(highest, votes[b] + max(votes[b - 1], votes[b + 1]))
            if highest > top:  # rare: find its bin
                for b in range(1, n_bins):
                    if votes[b] + votes[b + 1] > top:
                        top = votes[b] + votes[b + 1]
                        best = SliceCurve(lowest + b * bin_m, m, k)
            for i in range(len(s)):
                votes[bins[i]] = 0.0
    return best
