"""Brightness without what rows of points differ by: strips of an aircraft that overlap, each with a gain of its own.

Where scan lines are farther apart than a line of paint is wide, one row of a brighter strip between rows of a darker one
looks like a line. Rows of one strip lie anywhere between those of another, and each is straight to centimetres, so that
a row is told from paint by the rows within one spacing of scan lines beside it: paint covers them, too.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.paint.paint_points import POINT_INTENSITY, POINT_X, POINT_Y, smallest

#: Columns of the directions of rows: unit vector along them, and how far apart scan lines are. [m]
ROW_X, ROW_Y, ROW_APART = range(3)
#: Half of a row's width [m]: rows of airborne scanners are straight to about this; and what is neither of the row nor
#: beside it.
HALF_ROW_M, BESIDE_FROM_M = 0.02, 0.03
#: Rows count as beside a row as far as this share of the spacing of scan lines: the next ones of its own strip, and those
#: of others between them.
BESIDE_SHARE = 1.15
#: Points of a row this far along it are compared with [m], in a window that reaches this far across, about a cell of 0.5 m
#: whose points lie this far from its middle; a point depends on those within the last of these.
ROW_ALONG_M, ROW_ACROSS_M, IN_CELL_M, ROWS_REACH_M = 1.5, 1.0, 0.36, 2.5
#: A window with this many points is left as it is: they are nearer to each other than 0.1 m, so that each line of paint has
#: several rows.
MOST_IN_WINDOW = 1400
#: Fewest points of a window, of a row and beside it, fewest rows whose scatter tells what rows differ by, and fewest
#: degrees of freedom of the noise.
LEAST_WINDOW, FEWEST_IN_ROW, FEWEST_ROWS, FREE_IN_ROWS = 40, 2, 10, 20.0
#: Brightness farther from the middle of a window, in spreads, is paint or dark: it counts as this much, and is left.
CLIP_SPREADS = 2.5
#: Medians of a window are looked for within this many spreads of those of the one before: of 0.06 to 0.45 the fastest.
MEDIAN_NEAR = 0.2
#: Rows are evened by no more than this many standard deviations of what rows differ by: what differs more is paint along
#: the rows. Of 0.8, 1.2 and 2.0 it loses least of the dashes along the rows of als-roads-t0717-junction (2026-11-30,
#: decision 195).
MOST_EVENED = 0.8
#: Median of the square of a standard normal number, and standard deviation of the median of n of them, times the root of
#: n and in units of it; spread over the median distance from the middle.
MEDIAN_SQUARE, MEDIAN_SIGMA, SPREAD = 0.4549, 2.33, 1.4826


@njit(cache=True, nogil=True)
def evened_rows(
    points: FloatArray,
    starts: IntArray,
    lattice: tuple[float, int, int, int, int],
    directions: FloatArray,
) -> FloatArray:
    """Return the intensities of points without what the rows that they lie in differ by, (n,).

    Of each cell the direction counts in which rows differ most, if they do. A point's row is compared with the points
    within one spacing of scan lines beside it, without the point itself, and shrunk by the noise of both (best linear
    prediction: Robinson 1991, doi:10.1214/ss/1177011926).

    Parameters
    ----------
    points, starts, lattice
        (n, 5), (n_cells + 1,): see `linework.kernels.paint.paint_points.sort_into_cells`.
    directions
        (k, 3) with the columns `ROW_X` to `ROW_APART`.
    """
    cell, south, west, n_rows, n_cols = lattice
    out = points[:, POINT_INTENSITY].copy()
    reach = math.ceil((ROWS_REACH_M - 0.5 * cell) / cell)
    # Columns one after the other: medians go through one of them
    window, part = np.empty((3, MOST_IN_WINDOW)).T, np.empty((2, MOST_IN_WINDOW))
    level, spread = 0.0, 0.0
    for row in range(n_rows):
        for col in range(n_cols):
            at = row * n_cols + col
            if starts[at + 1] == starts[at]:
                continue
            middle = ((col + west + 0.5) * cell, (row + south + 0.5) * cell)
            n = gather_window(points, starts, n_cols, (row, col, reach), middle, window)
            if n < LEAST_WINDOW or n == MOST_IN_WINDOW:
                continue
            level, spread, highest = clip_window(window, n, part, (level, spread))
            if spread == 0.0:
                continue
            best, variance, within = 0, 0.0, 0.0
            for k in range(len(directions)):
                between, inside = variance_of_rows(window, n, directions[k])
                if between > variance:
                    best, variance, within = k, between, inside
            if variance == 0.0:
                continue
            most = MOST_EVENED * math.sqrt(variance)
            for i in range(starts[at], starts[at + 1]):
                intensity = points[i, POINT_INTENSITY]
                # Paint and what is dark; and the end of the scanner's scale, at which many points are alike
                if abs(intensity - level) > CLIP_SPREADS * spread or intensity >= highest:
                    continue
                x, y = points[i, POINT_X] - middle[0], points[i, POINT_Y] - middle[1]
                excess, share = excess_of_row(window, n, directions[best], x, y)
                shrunk = excess * variance / (variance + within * share) if share > 0.0 else 0.0
                out[i] -= min(max(shrunk, -most), most)
    return out


@njit(cache=True, nogil=True)
def gather_window(
    points: FloatArray,
    starts: IntArray,
    n_cols: int,
    cells: tuple[int, int, int],
    middle: tuple[float, float],
    out: FloatArray,
) -> int:
    """Write the points about a cell to `out` (m, 3): place from its middle [m], and intensity; return their number.

    cells: row and column of the cell, and how many cells the window reaches beyond it.
    """
    row, col, reach = cells
    radius = math.hypot(ROW_ALONG_M + IN_CELL_M, ROW_ACROSS_M)
    n_rows, n = (len(starts) - 1) // n_cols, 0
    first, last = max(col - reach, 0), min(col + reach, n_cols - 1)
    for r in range(max(row - reach, 0), min(row + reach + 1, n_rows)):
        for i in range(starts[r * n_cols + first], starts[r * n_cols + last + 1]):
            x, y = points[i, POINT_X] - middle[0], points[i, POINT_Y] - middle[1]
            if x * x + y * y <= radius * radius and n < len(out):
                out[n, 0], out[n, 1], out[n, 2] = x, y, points[i, POINT_INTENSITY]
                n += 1
    return n


@njit(cache=True, nogil=True)
def clip_window(
    window: FloatArray, n: int, part: FloatArray, about: tuple[float, float]
) -> tuple[float, float, float]:
    """Clip the intensities of a window (n, 3) about their median; return that, their spread and the highest of them.

    part: (2, n or more) scratch. about: median and spread of a window nearby, where those of this one are looked for first.
    """
    level, before = about
    values, near = part[0], part[1]
    values[:n] = window[:n, 2]
    highest, middle = values[:n].max(), median_about(values, n, level, MEDIAN_NEAR * before, near)
    for i in range(n):
        values[i] = abs(window[i, 2] - middle)
    spread = SPREAD * median_about(values, n, before / SPREAD, MEDIAN_NEAR * before, near)
    for i in range(n):
        window[i, 2] = min(max(window[i, 2] - middle, -CLIP_SPREADS * spread), CLIP_SPREADS * spread)
    return middle, spread, highest


@njit(cache=True, nogil=True)
def median_about(values: FloatArray, n: int, about: float, within: float, near: FloatArray) -> float:
    """Return the upper median of the first n values, looked for within a distance of a number first.

    near: (n or more,) scratch. Windows of neighbouring cells share most of their points: their medians lie close together,
    and only what lies between two limits has to be put in order.
    """
    k, below, m = n // 2, 0, 0
    for i in range(n):
        below += int(values[i] < about - within)
        near[m] = values[i]
        m += int((values[i] >= about - within) & (values[i] <= about + within))
    if below <= k < below + m:
        return smallest(near, k - below, m)
    near[:n] = values[:n]
    return smallest(near, k, n)


@njit(cache=True, nogil=True)
def variance_of_rows(window: FloatArray, n: int, direction: FloatArray) -> tuple[float, float]:
    """Return the variance of what rows of a direction (3,) differ by from those beside them, and that of points within rows.

    The first is that of the median row: paint along the rows, which covers few of them, does not count. It is 0 where
    rows scatter no more than their points.
    """
    size = 2.0 * HALF_ROW_M
    n_bins = int(2.0 * ROW_ACROSS_M / size)
    number, total, within, free = np.zeros(n_bins), np.zeros(n_bins), 0.0, 0.0
    for i in range(n):
        u = window[i, 0] * direction[ROW_X] + window[i, 1] * direction[ROW_Y]
        v = window[i, 1] * direction[ROW_X] - window[i, 0] * direction[ROW_Y]
        if abs(u) <= ROW_ALONG_M and abs(v) < ROW_ACROSS_M:
            b = min(int((v + ROW_ACROSS_M) / size), n_bins - 1)
            number[b] += 1.0
            total[b] += window[i, 2]
            within += window[i, 2] ** 2
    for b in range(n_bins):
        if number[b] > 0.0:
            within -= total[b] ** 2 / number[b]
            free += number[b] - 1.0
    if free < FREE_IN_ROWS or within <= 0.0:
        return 0.0, 0.0
    variance, wide = within / free, int(BESIDE_SHARE * direction[ROW_APART] / size + 0.5)
    squares, shares, m = np.empty(n_bins), 0.0, 0
    for b in range(n_bins):
        left, left_total, right, right_total = 0.0, 0.0, 0.0, 0.0
        for k in range(2, wide + 1):
            if b + k < n_bins:
                left += number[b + k]
                left_total += total[b + k]
            if b - k >= 0:
                right += number[b - k]
                right_total += total[b - k]
        if min(number[b], left, right) >= FEWEST_IN_ROW:
            share = 1.0 / number[b] + 0.25 / left + 0.25 / right
            excess = total[b] / number[b] - 0.5 * (left_total / left + right_total / right)
            squares[m] = excess * excess / (variance * share)
            shares += share
            m += 1
    if m < FEWEST_ROWS:
        return 0.0, variance
    # Most places have one strip only: what chance adds to the median is taken off
    ratio = smallest(squares, m // 2, m) / MEDIAN_SQUARE - MEDIAN_SIGMA / math.sqrt(m)
    return max(ratio - 1.0, 0.0) * variance * shares / m, variance


@njit(cache=True, nogil=True)
def excess_of_row(
    window: FloatArray, n: int, direction: FloatArray, x: float, y: float
) -> tuple[float, float]:
    """Return by how much the row of the point at (x, y) is brighter than the points beside it, without that point.

    Behind it comes the variance of that difference over that of a point; 0 where there are too few points.

    Parameters
    ----------
    window
        (n or more, 3), see `gather_window`; it holds the point itself, too.
    direction
        (3,) with the columns `ROW_X` to `ROW_APART`.
    x, y
        The point, from the middle of the window. [m]
    """
    ux, uy, apart = direction[ROW_X], direction[ROW_Y], BESIDE_SHARE * direction[ROW_APART]
    number, left, right = 0.0, 0.0, 0.0
    total, left_total, right_total = 0.0, 0.0, 0.0
    for i in range(n):
        dx, dy = window[i, 0] - x, window[i, 1] - y
        v = dy * ux - dx * uy
        if abs(v) > apart or abs(dx * ux + dy * uy) > ROW_ALONG_M or (dx == 0.0 and dy == 0.0):
            continue
        if abs(v) <= HALF_ROW_M:
            number += 1.0
            total += window[i, 2]
        elif v > BESIDE_FROM_M:
            left += 1.0
            left_total += window[i, 2]
        elif v < -BESIDE_FROM_M:
            right += 1.0
            right_total += window[i, 2]
    if min(number, left, right) < FEWEST_IN_ROW:
        return 0.0, 0.0
    excess = total / number - 0.5 * (left_total / left + right_total / right)
    return excess, 1.0 / number + 0.25 / left + 0.25 / right
