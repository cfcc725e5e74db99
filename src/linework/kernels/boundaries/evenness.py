"""Unevenness of the ground on either side of a boundary box, beyond the noise of its points.

The means of the cells of a window differ from an even surface (a plane that may be bowed across and twisted) by the noise
of their points and by the unevenness of the ground. The noise is known from within the cells; what is left is the
ground's own, as the variance between groups is in a one-way analysis of variance (DerSimonian and Laird 1986,
doi:10.1016/0197-2456(86)90046-2). So a noisy scanner or a sparse survey does not make a road uneven.

Positions are in metres from the survey's local origin.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.cables.fit import MAD
from linework.kernels.cells.floor import (
    FINE_M,
    SPAN_COLS,
    SPAN_ROWS,
    SPAN_SOUTH,
    SPAN_WEST,
    SUM_COLUMNS,
    SUM_N,
    SUM_X,
    SUM_Y,
    SUM_Z,
    add_shifted,
    plane_of,
)
from linework.kernels.cells.places import (
    BOX_CELL_M,
    BOX_UX,
    BOX_UY,
    BOX_X,
    BOX_Y,
    FORM,
    KERB,
)
from linework.kernels.tracking.small_systems import factor, solve

#: Length of the window along the box, and its extent from the box: past gutter stones, and within the narrowest road. [m]
WINDOW_M, _NEAREST_M, _FARTHEST_M = 4.0, 0.4, 2.4
#: Unknowns of an even surface: height, slopes along and across, twist, and bow across (crown, ruts).
_UNKNOWNS = 5
#: Fewest cells of a window, fewest points of a cell, and of one whose own scatter is measured: a plane has three unknowns.
_LEAST_CELLS, _LEAST_POINTS, _OWN_SCATTER_POINTS = 12, 2, 5
#: Errors that the points of a cell share (of the trajectory, of a beam, of a pass) over the noise of one point. Estimated
#: on two real airborne surveys that were looked at (als-roads t0809, t1178; 2026-11-28): beyond 2.5 cm of noise, their
#: roads differ by 0.5 to 0.7 cm.
SHARED_ERROR = 0.2
#: Smallest share of the cells whose own scatter is measured.
_LEAST_SHARE = 0.3
#: Cells farther than this from the even surface, in spreads of all cells, count as if they were this far: cars, kerbs.
_CLIP = 3.0
#: Rounds of weighing the cells by the noise and the unevenness of the last one; unevenness of the first [m].
_ROUNDS, _FIRST_M = 3, 0.005
#: Columns of a cell: along and across from the window's middle [m], mean height [m], number of points, and variance of its
#: points about their own plane [m2], 0 where they are too few.
_ALONG, _ACROSS, _HEIGHT, _COUNT, _SCATTER = range(5)


@njit(cache=True, nogil=True)
def unevenness_beside(sums: FloatArray, span: IntArray, boxes: FloatArray) -> FloatArray:
    """Return the variance of the ground's own unevenness to the left and to the right of boxes, (n, 2) [m2].

    Negative where the cells differ less than the noise of their points explains; NaN with too few points, and for kerbs,
    which are built.

    Parameters
    ----------
    sums, span
        (fine cells, 11) and (4,) int64; see `linework.kernels.cells.floor.cell_sums`.
    boxes
        (n, 18) rows with the columns of `linework.kernels.cells.places`.
    """
    out = np.full((len(boxes), 2), np.nan)
    most = int(2.0 * np.hypot(_FARTHEST_M, 0.5 * WINDOW_M) / BOX_CELL_M) + 3
    cells = np.empty((most * most, 5))
    for i in range(len(boxes)):
        if boxes[i, FORM] == KERB:
            continue
        ux, uy = boxes[i, BOX_UX], boxes[i, BOX_UY]
        for side in range(2):
            along = (ux, uy) if side == 0 else (-ux, -uy)
            n = _cells_beside(sums, span, (boxes[i, BOX_X], boxes[i, BOX_Y]), along, cells)
            scatter = cells[:n, _SCATTER][cells[:n, _SCATTER] > 0.0]
            if n >= _LEAST_CELLS and len(scatter) >= _LEAST_SHARE * n:
                # Few points of a cell may lie close to their plane by chance
                of_points = np.maximum(cells[:n, _SCATTER], np.median(scatter))
                of_means = of_points * (1.0 / cells[:n, _COUNT] + SHARED_ERROR**2)
                out[i, side] = _variance_between(cells[:n], of_means)
    return out


@njit(cache=True, nogil=True)
def _cells_beside(
    sums: FloatArray,
    span: IntArray,
    place: tuple[float, float],
    along_u: tuple[float, float],
    cells: FloatArray,
) -> int:
    """Write the cells to the left of a place, (n, 5), columns `_ALONG` to `_SCATTER`, and return n."""
    ux, uy = along_u
    middle, half_m = 0.5 * (_NEAREST_M + _FARTHEST_M), (0.5 * WINDOW_M, 0.5 * (_FARTHEST_M - _NEAREST_M))
    x0, y0 = place[0] - uy * middle, place[1] + ux * middle
    reach = np.hypot(half_m[0], half_m[1])
    west, south = span[SPAN_WEST] // 2, span[SPAN_SOUTH] // 2
    first_c, last_c = int(np.floor((x0 - reach) / BOX_CELL_M)), int(np.floor((x0 + reach) / BOX_CELL_M))
    first_r, last_r = int(np.floor((y0 - reach) / BOX_CELL_M)), int(np.floor((y0 + reach) / BOX_CELL_M))
    s = np.empty(SUM_COLUMNS)
    n = 0
    for r in range(max(first_r - south, 0), min(last_r - south + 1, span[SPAN_ROWS] // 2)):
        for c in range(max(first_c - west, 0), min(last_c - west + 1, span[SPAN_COLS] // 2)):
            dx, dy = (west + c + 0.5) * BOX_CELL_M - x0, (south + r + 0.5) * BOX_CELL_M - y0
            along, across = dx * ux + dy * uy, dy * ux - dx * uy
            if abs(along) > half_m[0] or abs(across) > half_m[1]:
                continue
            s[:] = 0.0
            for i in range(2):
                for j in range(2):
                    at = (2 * r + i) * span[SPAN_COLS] + 2 * c + j
                    if sums[at, SUM_N] > 0.0:
                        add_shifted(s, sums, at, (j - 0.5) * FINE_M, (i - 0.5) * FINE_M)
            if s[SUM_N] < _LEAST_POINTS:
                continue
            mx, my, cell = s[SUM_X] / s[SUM_N], s[SUM_Y] / s[SUM_N], cells[n]
            cell[_ALONG], cell[_ACROSS] = along + mx * ux + my * uy, across + my * ux - mx * uy
            cell[_HEIGHT], cell[_COUNT] = s[SUM_Z] / s[SUM_N], s[SUM_N]
            rms = plane_of(s)[3] if s[SUM_N] >= _OWN_SCATTER_POINTS else np.nan
            cell[_SCATTER] = rms * rms if rms == rms else 0.0
            n += 1
    return n


@njit(cache=True, nogil=True)
def _variance_between(cells: FloatArray, of_means: FloatArray) -> float:
    """Return the variance of the cells' heights about an even surface beyond that of their means [m2].

    Parameters
    ----------
    cells
        (n, 5), columns `_ALONG` to `_SCATTER`.
    of_means
        (n,) variance of each mean by the scatter of its points. [m2]
    """
    n = len(cells)
    normal, right = np.empty((_UNKNOWNS, _UNKNOWNS)), np.empty(_UNKNOWNS)
    row, found, left = np.empty(_UNKNOWNS), np.empty(_UNKNOWNS), np.empty(n)
    # Heights from the first cell's: sums of squares keep their digits
    zero, between = cells[0, _HEIGHT], _FIRST_M**2
    for _ in range(_ROUNDS):
        normal[:], right[:] = 0.0, 0.0
        for k in range(n):
            _even_surface(cells[k], row)
            weight = _FIRST_M**2 / (of_means[k] + max(between, 0.0))
            for a in range(_UNKNOWNS):
                right[a] += weight * row[a] * (cells[k, _HEIGHT] - zero)
                for b in range(a + 1):
                    normal[a, b] += weight * row[a] * row[b]
        factor(normal)
        solve(normal, right, found)
        for k in range(n):
            _even_surface(cells[k], row)
            left[k] = cells[k, _HEIGHT] - zero
            for a in range(_UNKNOWNS):
                left[k] -= row[a] * found[a]
        most = _CLIP * MAD * np.median(np.abs(left))
        squares, noise = 0.0, 0.0
        for k in range(n):
            squares += min(left[k] * left[k], most * most)
            noise += of_means[k] * (n - _UNKNOWNS) / n
        between = (squares - noise) / (n - _UNKNOWNS)
    return float(between)


@njit(cache=True, nogil=True)
def _even_surface(cell: FloatArray, row: FloatArray) -> None:
    """Write what each unknown of an even surface adds to the height of a cell (5,)."""
    u, v = cell[_ALONG], cell[_ACROSS]
    row[0], row[1], row[2], row[3], row[4] = 1.0, u, v, u * v, v * v
