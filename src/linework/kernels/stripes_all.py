"""Search areas over a whole tile: one for each cell that holds bright points."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from linework.kernels.stripes import (
    ACROSS,
    CX,
    CY,
    FIRST,
    FOUND,
    HALF_U,
    HALF_V,
    HOLES,
    INDEX,
    LAST,
    MOST_STRIPES,
    N_COLUMNS,
    NO_BRIGHT,
    TOO_FEW_POINTS,
    UX,
    UY,
    X,
    Y,
    gather,
    stripes_in_area,
)

F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

#: Radii of search areas [m]: the paper's, and larger ones for sparse points (airborne: 20 points/m2; one
#: turn of a car's scanner).
RADII_M = (0.5, 1.0, 2.0)
#: A search area with fewer points shows no stripe: of 1.4 x 2.8 radii paint 0.12 m wide covers a twelfth.
LEAST_POINTS = 60


@njit(cache=True, nogil=True)
def stripes_at(
    points: F64,
    starts: I64,
    lattice: tuple[float, int, int, int, int],
    place: tuple[float, float],
    cell: tuple[float, float, float, float],
    levels: tuple[float, float],
    least_t: float,
    work: F64,
    out: F64,
) -> tuple[int, int, F64]:
    """Find the stripes about a place that pass through a cell, in the smallest search area that shows them.

    Returns
    -------
    Their number, why there are none, and the work space (grown where it was too small).
    """
    if not levels[1] > levels[0]:
        return 0, NO_BRIGHT, work
    x, y = place
    box = (cell[0] - x, cell[1] - y, cell[2] - x, cell[3] - y)
    why = TOO_FEW_POINTS
    for radius in RADII_M:
        reach = math.sqrt(1.0 + ACROSS * ACROSS) * radius
        n = gather(points, starts, lattice, x, y, reach, work)
        if n < 0:
            work = np.empty((-2 * n, work.shape[1]))
            n = gather(points, starts, lattice, x, y, reach, work)
        if n < LEAST_POINTS:
            continue
        if n < len(work):
            work[n, INDEX] = -1.0
        number, why = stripes_in_area(work, n, radius, levels, box, least_t, out)
        for k in range(number):
            out[k, CX] += x
            out[k, CY] += y
        if why != HOLES:
            return number, why, work
        if number > 0:
            return number, FOUND, work
    return 0, why, work


@njit(cache=True, nogil=True)
def all_stripes(
    points: F64,
    starts: I64,
    times: F64,
    lattice: tuple[float, int, int, int, int],
    cells: I64,
    places: F64,
    background: F64,
    least_t: float,
) -> F64:
    """Return the stripes of all the cells in their order, one row each (see `linework.kernels.stripes`).

    times: (n,) of the points, or of no length.
    """
    size, south, west, _, n_cols = lattice
    out = np.empty((256, N_COLUMNS))
    some = np.empty((MOST_STRIPES, N_COLUMNS))
    work = np.empty((4096, 5))
    m = 0
    for k in range(len(cells)):
        row, col = cells[k] // n_cols + south, cells[k] % n_cols + west
        cell = (col * size, row * size, (col + 1) * size, (row + 1) * size)
        levels = (background[cells[k], 0], background[cells[k], 2])
        number, _, work = stripes_at(
            points, starts, lattice, (places[k, 0], places[k, 1]), cell, levels, least_t, work, some
        )
        for j in range(number):
            # Half open: a centre on the northern or eastern edge is another cell's
            if np.floor(some[j, CX] / size) != col or np.floor(some[j, CY] / size) != row:
                continue
            if m == len(out):
                grown = np.empty((2 * m, N_COLUMNS))
                grown[:m] = out
                out = grown
            out[m] = some[j]
            if len(times):
                _span(work, points, times, (places[k, 0], places[k, 1]), out[m])
            m += 1
    return out[:m]


@njit(cache=True, nogil=True)
def _span(work: F64, points: F64, times: F64, place: tuple[float, float], stripe: F64) -> None:
    """Write when the points on a stripe were measured."""
    dx, dy = stripe[CX] - place[0], stripe[CY] - place[1]
    first, last = np.inf, -np.inf
    for i in range(len(work)):
        k = int(work[i, INDEX])
        if k < 0:
            break
        u = (work[i, X] - dx) * stripe[UX] + (work[i, Y] - dy) * stripe[UY]
        v = (work[i, Y] - dy) * stripe[UX] - (work[i, X] - dx) * stripe[UY]
        if abs(u) <= stripe[HALF_U] and abs(v) <= stripe[HALF_V]:
            first, last = min(first, times[k]), max(last, times[k])
    if first <= last:
        stripe[FIRST], stripe[LAST] = first, last
