"""The stripes of a whole tile: a search area for each cell with bright points."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.paint.paint_points import (
    MOST_VISITS,
    POINT_COLUMNS,
    POINT_INTENSITY,
    POINT_TIME,
    POINT_X,
    POINT_Y,
    dark_level,
    split_into_visits,
    visit_of,
)
from linework.kernels.paint.stripe_search import MOST_STRIPES, PROFILE_REACH, gather_within_reach
from linework.kernels.paint.stripes import (
    HOLES,
    NO_BRIGHT,
    STRIPE_COLUMNS,
    STRIPE_FIRST,
    STRIPE_FOUND,
    STRIPE_HALF_U,
    STRIPE_HALF_V,
    STRIPE_LAST,
    STRIPE_UX,
    STRIPE_UY,
    STRIPE_X,
    STRIPE_Y,
    TOO_FEW_POINTS,
    stripes_in_area,
)

#: Radii of search areas [m]: the 0.5 m of Kang et al. (2023), and larger ones for sparse points (airborne: 20
#: points/m2; one turn of a car's scanner).
RADII_M = (0.5, 1.0, 2.0)
#: Bright points are this many standard deviations above the level of the road.
BRIGHT_SPREADS = 2.5
#: Fewest points of a search area: paint 0.12 m wide covers a twelfth of it. And the number of points over the
#: diameter in metres from which on no larger area is tried.
LEAST_STRIPE_POINTS, MANY_POINTS = 80, 400
#: Points that the levels of road and paint are estimated from, and the fewest of a visit of the scanner.
N_LEVEL, LEAST_VISIT = 200, 10


@njit(cache=True, nogil=True)
def even_out(work: FloatArray, n: int) -> tuple[int, float, float]:
    """Scale all visits of the scanner to the same road, in place; return number of points, dark and bright level.

    Each visit's intensities are divided by the level of its dark surface; a visit of few points is left out.
    If a level is 0 (intensities of dark points not recorded) they stay as they are.

    Parameters
    ----------
    work
        (n or more, 5): points, see `linework.kernels.paint.stripe_search.gather_within_reach`.
    """
    # A part of the points, evenly chosen, shows which visits there are and how dark the road is in each
    stride = n // N_LEVEL + 1
    taken = (n + stride - 1) // stride
    time, value = np.empty(N_LEVEL), np.empty(N_LEVEL)
    visit, spans = np.zeros(taken, dtype=np.int64), np.zeros((MOST_VISITS, 2))
    for k in range(taken):
        time[k], value[k] = work[k * stride, POINT_TIME], work[k * stride, POINT_INTENSITY]
    m = split_into_visits(time, taken, visit, spans)
    levels, counts, part = np.zeros(MOST_VISITS), np.zeros(MOST_VISITS, dtype=np.int64), np.empty(N_LEVEL)
    lowest = np.inf
    for v in range(m):
        for k in range(taken):
            if visit[k] == v:
                part[counts[v]] = value[k]
                counts[v] += 1
        if counts[v] >= LEAST_VISIT:
            levels[v], _ = dark_level(part[: counts[v]])
            lowest = min(lowest, levels[v])
    kept = 0
    for i in range(n):
        v = visit_of(work[i, POINT_TIME], spans, m) if m > 1 else 0
        if counts[v] >= LEAST_VISIT:
            if kept < i:
                for k in range(POINT_COLUMNS):
                    work[kept, k] = work[i, k]
            if lowest > 0.0:
                work[kept, POINT_INTENSITY] /= levels[v]
            kept += 1
    if kept == 0:
        return 0, 0.0, 0.0
    stride = kept // N_LEVEL + 1
    taken = (kept + stride - 1) // stride
    for k in range(taken):
        value[k] = work[k * stride, POINT_INTENSITY]
    dark, spread = dark_level(value[:taken])
    # The bright level: the mean of the points that stand out, or the brightest
    limit, total, number, brightest = dark + BRIGHT_SPREADS * spread, 0.0, 0, dark
    for i in range(kept):
        brightest = max(brightest, work[i, POINT_INTENSITY])
        if work[i, POINT_INTENSITY] > limit:
            total += work[i, POINT_INTENSITY]
            number += 1
    return kept, dark, total / number if number > 0 else brightest


@njit(cache=True, nogil=True)
def stripes_at(
    points: FloatArray,
    starts: IntArray,
    lattice: tuple[float, int, int, int, int],
    place: tuple[float, float],
    cell: tuple[float, float, float, float],
    least_t: float,
    angle: float,
    work: FloatArray,
    out: FloatArray,
) -> tuple[int, int, FloatArray]:
    """Find the stripes about a place that pass through a cell, in the smallest search area that shows them.

    Parameters
    ----------
    points, starts, lattice
        (n, 5), (n_cells + 1,): see `linework.kernels.paint.paint_points.sort_into_cells`.
    place
        Middle of the search area. [m, from the local origin]
    cell
        West, south, east and north edge. [m, from the local origin]
    least_t
        Smallest t-value, see `linework.kernels.paint.stripe_search.stripes_across`.
    angle
        Direction of the stripes [rad]; NaN: that of the points.
    work
        (k, 5) scratch.
    out
        (4, 24) output: see `linework.kernels.paint.stripes`.

    Returns
    -------
    The number of stripes, why there are none, and the scratch (grown if it was too small).
    """
    x, y = place
    west, south, east, north = cell
    box = (west - x, south - y, east - x, north - y)
    why = TOO_FEW_POINTS
    for radius in RADII_M:
        reach = math.sqrt(1.0 + PROFILE_REACH * PROFILE_REACH) * radius
        n = gather_within_reach(points, starts, lattice, x, y, reach, work)
        if n < 0:
            work = np.empty((-2 * n, work.shape[1]))
            n = gather_within_reach(points, starts, lattice, x, y, reach, work)
        if n < LEAST_STRIPE_POINTS:
            continue
        n, dark, bright = even_out(work, n)
        if n < LEAST_STRIPE_POINTS:
            continue
        if n < len(work):
            work[n, POINT_TIME] = np.nan
        if not bright > dark:
            why = NO_BRIGHT
            continue
        number, why = stripes_in_area(work, n, radius, (dark, bright), box, least_t, angle, out)
        for k in range(number):
            out[k, STRIPE_X] += x
            out[k, STRIPE_Y] += y
        if number > 0 or (why != HOLES and n > MANY_POINTS / (2.0 * radius)):
            return number, STRIPE_FOUND if number > 0 else why, work
    return 0, why, work


@njit(cache=True, nogil=True)
def all_stripes(
    points: FloatArray,
    starts: IntArray,
    lattice: tuple[float, int, int, int, int],
    cells: IntArray,
    places: FloatArray,
    angles: FloatArray,
    least_t: float,
) -> FloatArray:
    """Return the stripes of all cells in the cells' order, (m, 24): see `linework.kernels.paint.stripes`.

    Parameters
    ----------
    points, starts, lattice
        (n, 5), (n_cells + 1,): see `linework.kernels.paint.paint_points.sort_into_cells`.
    cells, places
        (k,) cells with bright points, and (k, 2) the middle of each one's search area [m, from the local origin].
    angles
        (k,) direction of the stripes in each cell [rad]; NaN: that of the points.
    least_t
        Smallest t-value, see `linework.kernels.paint.stripe_search.stripes_across`.
    """
    size, south, west, _, n_cols = lattice
    out = np.empty((256, STRIPE_COLUMNS))
    some = np.empty((MOST_STRIPES, STRIPE_COLUMNS))
    work = np.empty((4096, POINT_COLUMNS))
    m = 0
    for k in range(len(cells)):
        row, col = cells[k] // n_cols + south, cells[k] % n_cols + west
        cell = (col * size, row * size, (col + 1) * size, (row + 1) * size)
        place = (places[k, 0], places[k, 1])
        number, _, work = stripes_at(points, starts, lattice, place, cell, least_t, angles[k], work, some)
        for j in range(number):
            # Half open: a centre on the northern or eastern edge belongs to another cell
            if np.floor(some[j, STRIPE_X] / size) != col or np.floor(some[j, STRIPE_Y] / size) != row:
                continue
            if m == len(out):
                grown = np.empty((2 * m, STRIPE_COLUMNS))
                grown[:m] = out
                out = grown
            out[m] = some[j]
            write_stripe_times(work, place, out[m])
            m += 1
    return out[:m]


@njit(cache=True, nogil=True)
def write_stripe_times(work: FloatArray, place: tuple[float, float], stripe: FloatArray) -> None:
    """Write the first and last time of the points on a stripe (24,).

    work: (n, 5) points with x and y from `place`, ended by a time that is NaN.
    """
    x, y = place
    dx, dy = stripe[STRIPE_X] - x, stripe[STRIPE_Y] - y
    first, last = np.inf, -np.inf
    for i in range(len(work)):
        if np.isnan(work[i, POINT_TIME]):
            break
        u = (work[i, POINT_X] - dx) * stripe[STRIPE_UX] + (work[i, POINT_Y] - dy) * stripe[STRIPE_UY]
        v = (work[i, POINT_Y] - dy) * stripe[STRIPE_UX] - (work[i, POINT_X] - dx) * stripe[STRIPE_UY]
        if abs(u) <= stripe[STRIPE_HALF_U] and abs(v) <= stripe[STRIPE_HALF_V]:
            first, last = min(first, work[i, POINT_TIME]), max(last, work[i, POINT_TIME])
    if first <= last:
        stripe[STRIPE_FIRST], stripe[STRIPE_LAST] = first, last
