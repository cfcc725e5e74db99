"""Points near the road, sorted into the cells of a global lattice, and the bright ones among them.

The same paint is differently bright for each pass and each head of a scanner, so brightness is compared within
a visit: the points of one place that follow each other in time.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import BoolArray, Float32Array, FloatArray, Int32Array, IntArray

#: Columns of sorted points: x, y, z from the survey's local origin [m], intensity as recorded, time [s].
POINT_X, POINT_Y, POINT_Z, POINT_INTENSITY, POINT_TIME = range(5)
POINT_COLUMNS = 5
#: Columns of the bright points of a cell: their number, and the sums of their x and y [m].
N_BRIGHT, BRIGHT_X, BRIGHT_Y = range(3)
#: Columns of a visit's time span: first and last time. [s]
VISIT_BEGIN, VISIT_END = range(2)

#: Points of a place that are further apart in time belong to different visits [s]: the turns of a scanner follow
#: each other within 0.1 s, and the second head passes a place 3 m beside the van about 0.3 s after the first.
APART_S = 0.3
#: Most visits told apart at one place; a survey has two heads and a few passes.
MOST_VISITS = 8
#: Quantiles that the dark surface is estimated from: at most half of the points are bright (paint, grass beside the
#: road), a tenth very dark (seams, wet places).
LOW_QUANTILE, MIDDLE_QUANTILE, HIGH_QUANTILE = 0.10, 0.25, 0.40
#: Distances between these quantiles of a normal distribution, in standard deviations: 25 % to 10 %, 40 % to 25 %,
#: and 50 % to 25 %.
LOW_TO_MIDDLE, MIDDLE_TO_HIGH, MIDDLE_TO_MEDIAN = 0.6071, 0.4212, 0.6745
#: Points of a cell that the background is estimated from, evenly chosen: 9 cells give 108, which give the spread to
#: a fifth.
N_SAMPLE = 12
#: Fewest points of a visit that give a background.
LEAST_SAMPLE = 10
#: A cell with fewer points than this is judged together with the cells around it.
FEW = 40
#: Standard deviations above the number of bright points expected by chance: in one cell, and in 3 x 3 cells of few
#: points, where less is lost by a false alarm than by a missed line.
CELL_SIGMAS, SPARSE_SIGMAS = 3.0, 2.0


@njit(cache=True, nogil=True)
def split_into_visits(times: FloatArray, n: int, visit: IntArray, spans: FloatArray) -> int:
    """Assign each of n times to a visit, and return the number of visits.

    Parameters
    ----------
    times
        (n or more,) [s].
    visit
        (n or more,) output: the visit of each time.
    spans
        (8, 2) output: first and last time of each visit [s]. Times beyond the eighth visit join the nearest.
    """
    m = 0
    for i in range(n):
        nearest, at = np.inf, -1
        for k in range(m):
            apart = max(spans[k, VISIT_BEGIN] - times[i], times[i] - spans[k, VISIT_END])
            if apart < nearest:
                nearest, at = apart, k
        if nearest > APART_S and m < MOST_VISITS:
            spans[m, VISIT_BEGIN], spans[m, VISIT_END] = times[i], times[i]
            m += 1
        elif at >= 0:
            spans[at, VISIT_BEGIN], spans[at, VISIT_END] = (
                min(spans[at, VISIT_BEGIN], times[i]),
                max(spans[at, VISIT_END], times[i]),
            )
    # Spans that have grown may have met
    k = 0
    while k < m:
        for j in range(k + 1, m):
            if (
                spans[j, VISIT_BEGIN] - spans[k, VISIT_END] <= APART_S
                and spans[k, VISIT_BEGIN] - spans[j, VISIT_END] <= APART_S
            ):
                spans[k, VISIT_BEGIN], spans[k, VISIT_END] = (
                    min(spans[j, VISIT_BEGIN], spans[k, VISIT_BEGIN]),
                    max(spans[j, VISIT_END], spans[k, VISIT_END]),
                )
                spans[j, VISIT_BEGIN], spans[j, VISIT_END] = (
                    spans[m - 1, VISIT_BEGIN],
                    spans[m - 1, VISIT_END],
                )
                m -= 1
                k = -1
                break
        k += 1
    for i in range(n):
        visit[i] = visit_of(times[i], spans, m)
    return m


@njit(cache=True, nogil=True)
def visit_of(time: float, spans: FloatArray, m: int) -> int:
    """Return the visit whose span is nearest to a time [s], of the first `m` spans (8, 2), which do not overlap."""
    nearest, at = np.inf, 0
    for k in range(m):
        apart = max(spans[k, VISIT_BEGIN] - time, time - spans[k, VISIT_END])
        if apart <= 0.0:
            return k
        if apart < nearest:
            nearest, at = apart, k
    return at


@njit(cache=True, nogil=True)
def dark_level(values: FloatArray) -> tuple[float, float]:
    """Return the mean and the standard deviation of the dark surface among values (n,), which are reordered.

    They are those of the normal distribution with the same quantiles: 25 %, and 10 or 40 %, whichever gives the
    smaller spread. Up to half of the values may be bright (paint, grass beside the road), which moves the level by
    one spread; up to a fifth may be very dark (seams, wet places).
    """
    n = len(values)
    # Each selection leaves all smaller values before the one that it finds
    at_high, at_middle = int(HIGH_QUANTILE * (n - 1) + 0.5), int(MIDDLE_QUANTILE * (n - 1) + 0.5)
    high = smallest(values, at_high, n)
    middle = smallest(values, at_middle, at_high + 1)
    low = smallest(values, int(LOW_QUANTILE * (n - 1) + 0.5), at_middle + 1)
    spread = min((middle - low) / LOW_TO_MIDDLE, (high - middle) / MIDDLE_TO_HIGH)
    return middle + MIDDLE_TO_MEDIAN * spread, spread


@njit(cache=True, nogil=True)
def smallest(values: FloatArray, k: int, n: int) -> float:
    """Return the k-th smallest (from 0) of the first n values by Hoare's selection, which moves smaller ones before it."""
    low, high = 0, n - 1
    while low < high:
        pivot = values[(low + high) >> 1]
        i, j = low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if k <= j:
            high = j
        elif k >= i:
            low = i
        else:
            break
    return float(values[k])


@njit(cache=True, nogil=True)
def cells_near_road(
    xyz: FloatArray,
    origin: FloatArray,
    surface: tuple[float, int, int, float],
    road: Float32Array,
    wanted: BoolArray,
    tolerance: float,
    lattice: tuple[float, int, int, int, int],
) -> Int32Array:
    """Return the lattice cell of each point that is near the road, (n,) int32; -1 for all other points.

    Parameters
    ----------
    xyz, origin
        (n, 3), (3,): points and the survey's local origin. [m, world]
    surface
        The road's raster: cell size [m], numbers of its north row and west column from the local origin (rows are
        counted northwards), and height of its zero above the origin [m].
    road, wanted
        (rows, cols) north-up: height of the road, float32 [m]; whether points there are used.
    tolerance
        Largest distance from the road in height. [m]
    lattice
        Cell size [m], numbers of the south row and the west column, number of rows and of columns.
    """
    size, north, west, z0 = surface
    cell, south_row, west_col, n_rows, n_cols = lattice
    rows, cols = road.shape
    out = np.full(len(xyz), -1, dtype=np.int32)
    for i in range(len(xyz)):
        x, y = xyz[i, 0] - origin[0], xyz[i, 1] - origin[1]
        # Bilinear between cell centres, from cell numbers of the whole survey
        fx, fy = x / size - 0.5, y / size - 0.5
        kx, ky = int(np.floor(fx)), int(np.floor(fy))
        c, r = kx - west, north - ky
        if c < 0 or c + 1 >= cols or r < 1 or r >= rows:
            continue
        a, b = fx - kx, fy - ky
        if not wanted[r if b < 0.5 else r - 1, c if a < 0.5 else c + 1]:
            continue
        low = road[r, c] * (1.0 - a) + road[r, c + 1] * a
        high = road[r - 1, c] * (1.0 - a) + road[r - 1, c + 1] * a
        above = xyz[i, 2] - origin[2] - z0 - (low * (1.0 - b) + high * b)
        if not abs(above) <= tolerance:
            continue
        col, row = int(np.floor(x / cell)) - west_col, int(np.floor(y / cell)) - south_row
        if row >= 0 and row < n_rows and col >= 0 and col < n_cols:
            out[i] = row * n_cols + col
    return out


@njit(cache=True, nogil=True)
def sort_into_cells(
    xyz: FloatArray,
    intensity: Float32Array,
    time: FloatArray,
    origin: FloatArray,
    cells: Int32Array,
    n_cells: int,
) -> tuple[FloatArray, IntArray]:
    """Return the points that have a cell, sorted by cell (stable), and where each cell starts.

    Parameters
    ----------
    xyz, intensity
        (n, 3) [m, world], (n,) float32.
    time
        (n,) [s]; empty: times are 0.
    origin
        (3,) [m, world].
    cells
        (n,) int32: the cell of each point, -1 for points to leave out.

    Returns
    -------
    points
        (k, 5) with the columns `POINT_X` to `POINT_TIME`.
    starts
        (n_cells + 1,) int64.
    """
    starts = np.zeros(n_cells + 1, dtype=np.int64)
    for i in range(len(cells)):
        if cells[i] >= 0:
            starts[cells[i] + 1] += 1
    for c in range(n_cells):
        starts[c + 1] += starts[c]
    fill = starts[:-1].copy()
    points = np.empty((starts[n_cells], POINT_COLUMNS))
    for i in range(len(cells)):
        if cells[i] >= 0:
            at = fill[cells[i]]
            fill[cells[i]] += 1
            for k in range(3):
                points[at, k] = xyz[i, k] - origin[k]
            points[at, POINT_INTENSITY] = intensity[i]
            points[at, POINT_TIME] = time[i] if len(time) else 0.0
    return points, starts


@njit(cache=True, nogil=True)
def count_bright(points: FloatArray, starts: IntArray, n_cols: int, spreads: float) -> FloatArray:
    """Return the bright points of each cell, (n_cells, 3): their number and the sums of their x and y [m].

    A point is bright if it is `spreads` standard deviations above the level of the dark surface in 3 x 3 cells,
    within its own visit of the scanner; or as bright as the brightest, where that is less (saturated).

    Parameters
    ----------
    points, starts
        (n, 5), (n_cells + 1,): see `sort_into_cells`.
    n_cols
        Columns of the lattice.
    """
    n_cells = len(starts) - 1
    n_rows = n_cells // n_cols
    out = np.zeros((n_cells, 3))
    value, time, part = np.empty(9 * N_SAMPLE), np.zeros(9 * N_SAMPLE), np.empty(9 * N_SAMPLE)
    visit, spans = np.zeros(9 * N_SAMPLE, dtype=np.int64), np.zeros((MOST_VISITS, 2))
    limits = np.empty(MOST_VISITS)
    for row in range(n_rows):
        for col in range(n_cols):
            at = row * n_cols + col
            if starts[at + 1] == starts[at]:
                continue
            n = 0
            for r in range(max(row - 1, 0), min(row + 2, n_rows)):
                for c in range(max(col - 1, 0), min(col + 2, n_cols)):
                    first, number = (
                        starts[r * n_cols + c],
                        starts[r * n_cols + c + 1] - starts[r * n_cols + c],
                    )
                    taken = min(number, N_SAMPLE)
                    for k in range(taken):
                        i = first + k * number // taken
                        value[n], time[n] = points[i, POINT_INTENSITY], points[i, POINT_TIME]
                        n += 1
            m = split_into_visits(time, n, visit, spans)
            for v in range(m):
                number, highest = 0, -np.inf
                for i in range(n):
                    if visit[i] == v:
                        part[number] = value[i]
                        highest = max(highest, value[i])
                        number += 1
                limits[v] = np.inf
                if number >= LEAST_SAMPLE:
                    level, spread = dark_level(part[:number])
                    if highest > level:
                        limits[v] = min(level + spreads * spread, highest)
            for i in range(starts[at], starts[at + 1]):
                limit = limits[visit_of(points[i, POINT_TIME], spans, m) if m > 1 else 0]
                if points[i, POINT_INTENSITY] >= limit and limit < np.inf:
                    out[at, N_BRIGHT] += 1.0
                    out[at, BRIGHT_X] += points[i, POINT_X]
                    out[at, BRIGHT_Y] += points[i, POINT_Y]
    return out


@njit(cache=True, nogil=True)
def bright_centres(
    bright: FloatArray, starts: IntArray, n_cols: int, share: float
) -> tuple[IntArray, FloatArray]:
    """Return the cells with more bright points than expected by chance, and the mean place of those points.

    The limit is a share `share` of the points plus three standard deviations of that number; where a cell has
    few points, two standard deviations in the 3 x 3 cells around it.

    Parameters
    ----------
    bright
        (n_cells, 3): see `count_bright`.
    starts, n_cols
        As for `count_bright`.

    Returns
    -------
    (m,) int64 cells, ascending, and (m, 2) places [m, from the local origin].
    """
    n_cells = len(starts) - 1
    found, where = np.empty(n_cells, dtype=np.int64), np.empty((n_cells, 2))
    m = 0
    for at in range(n_cells):
        if bright[at, N_BRIGHT] == 0.0:
            continue
        n, k, sigmas = starts[at + 1] - starts[at], bright[at, N_BRIGHT], CELL_SIGMAS
        if n < FEW:
            n, k, sigmas = 0, 0.0, SPARSE_SIGMAS
            for r in range(max(at // n_cols - 1, 0), min(at // n_cols + 2, n_cells // n_cols)):
                for c in range(max(at % n_cols - 1, 0), min(at % n_cols + 2, n_cols)):
                    n += starts[r * n_cols + c + 1] - starts[r * n_cols + c]
                    k += bright[r * n_cols + c, N_BRIGHT]
        if k > share * n + sigmas * np.sqrt(share * n):
            found[m] = at
            where[m, 0] = bright[at, BRIGHT_X] / bright[at, N_BRIGHT]
            where[m, 1] = bright[at, BRIGHT_Y] / bright[at, N_BRIGHT]
            m += 1
    return found[:m], where[:m]
