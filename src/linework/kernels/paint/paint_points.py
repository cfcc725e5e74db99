"""Points near the road in the cells of a global lattice, and how bright the road is around each cell."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import BoolArray, Float32Array, FloatArray, Int32Array, IntArray

# Points of one place by the visits of the scanner: its passes and its heads see the same paint differently bright

#: Points of a place that lie further apart in time are of two visits [s]: the turns of a scanner follow each other
#: by 0.1 s and less, the second head looks at a place 3 m beside the van about that much later.
APART_S = 0.3
MOST_VISITS = 8


@njit(cache=True, nogil=True)
def split_into_visits(times: FloatArray, n: int, visit: IntArray, spans: FloatArray) -> int:
    """Write the visit of each of n times, return how many there are.

    spans: (8, 2), takes the first and the last time of each. Visits beyond the eighth join the nearest.
    """
    m = 0
    for i in range(n):
        nearest, at = np.inf, -1
        for k in range(m):
            apart = max(spans[k, 0] - times[i], times[i] - spans[k, 1])
            if apart < nearest:
                nearest, at = apart, k
        if nearest > APART_S and m < MOST_VISITS:
            spans[m, 0], spans[m, 1] = times[i], times[i]
            m += 1
        elif at >= 0:
            spans[at, 0], spans[at, 1] = min(spans[at, 0], times[i]), max(spans[at, 1], times[i])
    # What was apart may have met
    k = 0
    while k < m:
        for j in range(k + 1, m):
            if spans[j, 0] - spans[k, 1] <= APART_S and spans[k, 0] - spans[j, 1] <= APART_S:
                spans[k, 0], spans[k, 1] = min(spans[j, 0], spans[k, 0]), max(spans[j, 1], spans[k, 1])
                spans[j, 0], spans[j, 1] = spans[m - 1, 0], spans[m - 1, 1]
                m -= 1
                k = -1
                break
        k += 1
    for i in range(n):
        visit[i] = visit_of(times[i], spans, m)
    return m


@njit(cache=True, nogil=True)
def visit_of(time: float, spans: FloatArray, m: int) -> int:
    """Return the visit whose span is nearest to a time."""
    nearest, at = np.inf, 0
    for k in range(m):
        apart = max(spans[k, 0] - time, time - spans[k, 1])
        if apart < nearest:
            nearest, at = apart, k
    return at


@njit(cache=True, nogil=True)
def dark_level(values: FloatArray) -> tuple[float, float]:
    """Return level and spread of the dark surface among n values, which are put into another order.

    They are those of the normal distribution with the same quantiles: 25 %, and 10 or 40 %, whichever is nearer.
    What is bright (paint, grass beside the road) may be half of the values and moves the level by one spread; what
    is very dark (seams, wet places) a fifth.
    """
    n = len(values)
    middle = smallest(values, int(0.40 * (n - 1) + 0.5))
    quartile = smallest(values, int(0.25 * (n - 1) + 0.5))
    low = smallest(values, int(0.10 * (n - 1) + 0.5))
    # They lie 0.2533, 0.6745 and 1.2816 spreads below the middle of the distribution
    spread = min((quartile - low) / 0.6071, (middle - quartile) / 0.4212)
    return quartile + 0.6745 * spread, spread


@njit(cache=True, nogil=True)
def smallest(values: FloatArray, k: int) -> float:
    """Return the k-th smallest value (from 0) by Hoare's selection; those before it come to stand before it."""
    low, high = 0, len(values) - 1
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


#: Points of a cell that the background is taken from, evenly chosen: 9 cells give 108, the spread to a fifth.
N_SAMPLE = 12
#: From fewer there is no background.
LEAST_SAMPLE = 10
#: Cells with fewer points than this are looked at together with those around them.
FEW = 40


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
    """Return the lattice cell of each point that is near the road, -1 for all others.

    Parameters
    ----------
    xyz, origin
        (n, 3), (3,): points and local origin, world.
    surface
        Cell size, numbers of its north row and west column from the local origin (rows are counted northwards),
        and height of its zero above the origin.
    road, wanted
        (rows, cols): height of the road, north-up; where points are looked at.
    tolerance
        Largest distance from the road in height.
    lattice
        Cell size, numbers of the south row and the west column, number of rows and of columns.
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
    """Return chosen points (x, y, z from the origin, intensity, time) by cell, and the cells' starts; stable.

    time: (n,), or of no length, then times are 0.
    """
    starts = np.zeros(n_cells + 1, dtype=np.int64)
    for i in range(len(cells)):
        if cells[i] >= 0:
            starts[cells[i] + 1] += 1
    for c in range(n_cells):
        starts[c + 1] += starts[c]
    fill = starts[:-1].copy()
    points = np.empty((starts[n_cells], 5))
    for i in range(len(cells)):
        if cells[i] >= 0:
            at = fill[cells[i]]
            fill[cells[i]] += 1
            for k in range(3):
                points[at, k] = xyz[i, k] - origin[k]
            points[at, 3] = intensity[i]
            points[at, 4] = time[i] if len(time) else 0.0
    return points, starts


@njit(cache=True, nogil=True)
def count_bright(points: FloatArray, starts: IntArray, n_cols: int, spreads: float) -> FloatArray:
    """Return (n_cells, 3): number of bright points in each cell and the sums of their x and y.

    Bright: `spreads` spreads above the level of the dark surface in 3 x 3 cells, for each visit of the scanner by
    itself; or as bright as the brightest, where that is less (saturated).
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
                        value[n], time[n] = points[i, 3], points[i, 4]
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
                limit = limits[visit_of(points[i, 4], spans, m) if m > 1 else 0]
                if points[i, 3] >= limit and limit < np.inf:
                    out[at, 0] += 1.0
                    out[at, 1] += points[i, 0]
                    out[at, 2] += points[i, 1]
    return out


@njit(cache=True, nogil=True)
def bright_centres(
    bright: FloatArray, starts: IntArray, n_cols: int, share: float
) -> tuple[IntArray, FloatArray]:
    """Return the cells with more bright points than chance brings, and the mean place of these points.

    Chance: a share `share` of the points, and three standard deviations of that number; where points are few,
    two standard deviations in the 3 x 3 cells around one with a bright point.
    """
    n_cells = len(starts) - 1
    found, where = np.empty(n_cells, dtype=np.int64), np.empty((n_cells, 2))
    m = 0
    for at in range(n_cells):
        if bright[at, 0] == 0.0:
            continue
        n, k, sigmas = starts[at + 1] - starts[at], bright[at, 0], 3.0
        if n < FEW:
            n, k, sigmas = 0, 0.0, 2.0
            for r in range(max(at // n_cols - 1, 0), min(at // n_cols + 2, n_cells // n_cols)):
                for c in range(max(at % n_cols - 1, 0), min(at % n_cols + 2, n_cols)):
                    n += starts[r * n_cols + c + 1] - starts[r * n_cols + c]
                    k += bright[r * n_cols + c, 0]
        if k > share * n + sigmas * np.sqrt(share * n):
            found[m] = at
            where[m, 0], where[m, 1] = bright[at, 1] / bright[at, 0], bright[at, 2] / bright[at, 0]
            m += 1
    return found[:m], where[:m]
