"""Search areas over a whole tile: one for each cell that holds bright points."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.paint.paint_points import MOST_VISITS, dark_level, split_into_visits, visit_of
from linework.kernels.paint.stripe_search import (
    MOST_STRIPES,
    POINT_X,
    POINT_Y,
    PROFILE_ACROSS_M,
    TIME,
    Q,
    gather_within_reach,
)
from linework.kernels.paint.stripes import (
    CX,
    CY,
    FIRST,
    HOLES,
    LAST,
    NO_BRIGHT,
    STRIPE_COLUMNS,
    STRIPE_FOUND,
    STRIPE_HALF_U,
    STRIPE_HALF_V,
    STRIPE_UX,
    STRIPE_UY,
    TOO_FEW_POINTS,
    stripes_in_area,
)

#: Radii of search areas [m]: the paper's, and larger ones for sparse points (airborne: 20 points/m2; one
#: turn of a car's scanner).
RADII_M = (0.5, 1.0, 2.0)
#: Bright points stand out from the road by this many spreads.
BRIGHT_SPREADS = 2.5
#: A search area with fewer points shows no stripe: paint 0.12 m wide covers a twelfth of it. One with many
#: shows all there is; the larger the area, the fewer.
LEAST_STRIPE_POINTS, MANY_POINTS = 80, 400
#: Points that say how dark the road and how bright the paint is, about, and the fewest of a visit.
N_LEVEL, LEAST_VISIT = 200, 10


@njit(cache=True, nogil=True)
def even_out(work: FloatArray, n: int) -> tuple[int, float, float]:
    """Bring all visits of the scanner to the same road, in place; return number of points, dark and bright level.

    Each visit's intensities are divided by the level of its dark surface; a visit of few points is left out.
    Where the level is 0 (intensities of dark points not known) they stay as they are.
    """
    # A part of the points, evenly chosen, says which visits there are and how dark the road is in each
    stride = n // N_LEVEL + 1
    taken = (n + stride - 1) // stride
    time, value = np.empty(N_LEVEL), np.empty(N_LEVEL)
    visit, spans = np.zeros(taken, dtype=np.int64), np.zeros((MOST_VISITS, 2))
    for k in range(taken):
        time[k], value[k] = work[k * stride, TIME], work[k * stride, Q]
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
        v = visit_of(work[i, TIME], spans, m) if m > 1 else 0
        if counts[v] >= LEAST_VISIT:
            if kept < i:
                work[kept] = work[i]
            if lowest > 0.0:
                work[kept, Q] /= levels[v]
            kept += 1
    if kept == 0:
        return 0, 0.0, 0.0
    stride = kept // N_LEVEL + 1
    taken = (kept + stride - 1) // stride
    for k in range(taken):
        value[k] = work[k * stride, Q]
    dark, spread = dark_level(value[:taken])
    # The mean of what stands out, or the brightest
    limit, total, number, brightest = dark + BRIGHT_SPREADS * spread, 0.0, 0, dark
    for i in range(kept):
        brightest = max(brightest, work[i, Q])
        if work[i, Q] > limit:
            total += work[i, Q]
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
    work: FloatArray,
    out: FloatArray,
) -> tuple[int, int, FloatArray]:
    """Find the stripes about a place that pass through a cell, in the smallest search area that shows them.

    Returns
    -------
    Their number, why there are none, and the work space (grown where it was too small).
    """
    x, y = place
    box = (cell[0] - x, cell[1] - y, cell[2] - x, cell[3] - y)
    why = TOO_FEW_POINTS
    for radius in RADII_M:
        reach = math.sqrt(1.0 + PROFILE_ACROSS_M * PROFILE_ACROSS_M) * radius
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
            work[n, TIME] = np.nan
        if not bright > dark:
            why = NO_BRIGHT
            continue
        number, why = stripes_in_area(work, n, radius, (dark, bright), box, least_t, out)
        for k in range(number):
            out[k, CX] += x
            out[k, CY] += y
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
    least_t: float,
) -> FloatArray:
    """Return the stripes of all the cells in their order, one row each (see `linework.kernels.paint.stripes`)."""
    size, south, west, _, n_cols = lattice
    out = np.empty((256, STRIPE_COLUMNS))
    some = np.empty((MOST_STRIPES, STRIPE_COLUMNS))
    work = np.empty((4096, 5))
    m = 0
    for k in range(len(cells)):
        row, col = cells[k] // n_cols + south, cells[k] % n_cols + west
        cell = (col * size, row * size, (col + 1) * size, (row + 1) * size)
        place = (places[k, 0], places[k, 1])
        number, _, work = stripes_at(points, starts, lattice, place, cell, least_t, work, some)
        for j in range(number):
            # Half open: a centre on the northern or eastern edge is another cell's
            if np.floor(some[j, CX] / size) != col or np.floor(some[j, CY] / size) != row:
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
    """Write when the points on a stripe were measured."""
    dx, dy = stripe[CX] - place[0], stripe[CY] - place[1]
    first, last = np.inf, -np.inf
    for i in range(len(work)):
        if np.isnan(work[i, TIME]):
            break
        u = (work[i, POINT_X] - dx) * stripe[STRIPE_UX] + (work[i, POINT_Y] - dy) * stripe[STRIPE_UY]
        v = (work[i, POINT_Y] - dy) * stripe[STRIPE_UX] - (work[i, POINT_X] - dx) * stripe[STRIPE_UY]
        if abs(u) <= stripe[STRIPE_HALF_U] and abs(v) <= stripe[STRIPE_HALF_V]:
            first, last = min(first, work[i, TIME]), max(last, work[i, TIME])
    if first <= last:
        stripe[FIRST], stripe[LAST] = first, last
