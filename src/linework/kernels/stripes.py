"""Stripes of paint in a search area, measured."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from linework.kernels.stripe_fit import edge_variance, extent, fit_stripe, height_of, strip_of
from linework.kernels.stripe_search import ACROSS, MOST_STRIPES, Q, direction, stripes_across

F64 = npt.NDArray[np.float64]

#: Columns of a stripe.
(
    CX, CY, CZ, UX, UY, HALF_U, HALF_V, SIGMA_V, SIGMA_Z, SIGMA_U, T_VALUE, STEP, SIGMA_STEP,
    DARK, BRIGHT, NUMBER, FIRST, LAST, LENGTH, APART,
) = range(20)  # fmt: skip
N_COLUMNS = 20

#: Why a search area has no stripe.
FOUND, TOO_FEW_POINTS, HOLES, NO_BRIGHT, NO_STRIPE = range(5)


@njit(cache=True, nogil=True)
def clipped(
    px: float,
    py: float,
    ux: float,
    uy: float,
    stretch: tuple[float, float],
    box: tuple[float, float, float, float],
) -> tuple[float, float]:
    """Return the stretch of the line p + s u that lies in a box (west, south, east, north); empty: begin > end."""
    begin, end = stretch
    for axis in range(2):
        p, u = (px, ux) if axis == 0 else (py, uy)
        low, high = (box[0], box[2]) if axis == 0 else (box[1], box[3])
        if abs(u) < 1e-9:
            if p < low or p >= high:
                return 1.0, 0.0
            continue
        a, b = (low - p) / u, (high - p) / u
        begin, end = max(begin, min(a, b)), min(end, max(a, b))
    return begin, end


@njit(cache=True, nogil=True)
def stripes_in_area(
    work: F64,
    n: int,
    radius: float,
    levels: tuple[float, float],
    cell: tuple[float, float, float, float],
    least_t: float,
    out: F64,
) -> tuple[int, int]:
    """Find the stripes of a search area that pass through a cell.

    Parameters
    ----------
    work
        (n, 5): the points within 1.75 radii of its middle.
    levels
        Intensity of road and of paint, about.
    cell
        West, south, east and north edge from the middle of the search area.
    out
        Takes one row per stripe; places are from the middle of the search area.

    Returns
    -------
    Their number, and why there are none; HOLES where a larger area should be tried.
    """
    dark, bright = levels
    for i in range(n):
        work[i, Q] = min(max((work[i, Q] - dark) / (bright - dark), -1.0), 1.5)
    angle = direction(work, n, radius)
    found = np.empty((MOST_STRIPES, 3))
    m = stripes_across(work, n, angle, radius, least_t, found)
    axes = (math.cos(angle), math.sin(angle))
    fit, covariance = np.empty(6), np.empty((6, 6))
    number, sparse = 0, False
    scale = 2.0 * radius
    wide = (cell[0] - 0.05, cell[1] - 0.05, cell[2] + 0.05, cell[3] + 0.05)
    strip = np.empty((n, 4))
    for j in range(m):
        right_edge, left_edge = found[j, 0], found[j, 1]
        offset, width = 0.5 * (right_edge + left_edge), left_edge - right_edge
        low, high = right_edge - 0.12 * scale, left_edge + 0.12 * scale
        for k in range(m):
            # Half way into the gap there is no paint of the neighbour
            if k != j and found[k, 1] <= right_edge:
                low = max(low, found[k, 1] + 0.2 * (right_edge - found[k, 1]))
            if k != j and found[k, 0] >= left_edge:
                high = min(high, found[k, 0] - 0.2 * (found[k, 0] - left_edge))
        # Stripes that do not come near the cell are left to others
        s0, s1 = clipped(-offset * axes[1], offset * axes[0], axes[0], axes[1], (-radius, radius), wide)
        if s1 <= s0:
            continue
        k = strip_of(work, n, axes, radius, (low, high), strip)
        near = strip[:k]
        fit[0], fit[1], fit[2], fit[3], fit[4], fit[5] = offset, 0.0, width, 0.0, 0.0, 0.7
        if fit_stripe(near, (-radius, radius), min(0.03 * scale, width / 3.0), 3, fit, covariance) == 0:
            sparse = True
            continue
        begin, end, parts = extent(near, radius, fit)
        if parts < 3:
            sparse = True
        if parts < 2 or end - begin < 0.15 * scale:
            continue
        # Precisely, on this stretch: an edge is passed over by 8 points, if it can be
        blur = min(max(4.0 * (high - low) * scale / ((end - begin) * k), 0.01), fit[2] / 3.0)
        used = fit_stripe(near, (begin, end), blur, 4, fit, covariance)
        if used == 0 or not (fit[5] > fit[3] and fit[5] > fit[4]):
            continue
        begin, end, parts = extent(near, radius, fit)
        if parts < 2 or end - begin < 0.15 * scale:
            continue
        # The piece of the centreline in this cell
        root = math.sqrt(1.0 + fit[1] ** 2)
        ux, uy = (axes[0] - fit[1] * axes[1]) / root, (axes[1] + fit[1] * axes[0]) / root
        px, py = -fit[0] * axes[1], fit[0] * axes[0]
        s0, s1 = clipped(px, py, ux, uy, (begin * root, end * root), cell)
        if s1 - s0 < 0.04:
            continue
        s = 0.5 * (s0 + s1)
        at = s / root
        row = out[number]
        row[CX], row[CY], row[UX], row[UY] = px + s * ux, py + s * uy, ux, uy
        row[HALF_U] = min(s - begin * root, end * root - s)
        row[LENGTH] = (end - begin) * root
        row[HALF_V] = 0.5 * fit[2] / root
        variance = covariance[0, 0] + 2.0 * at * covariance[0, 1] + at * at * covariance[1, 1]
        row[SIGMA_V] = math.sqrt(variance + edge_variance(near, (begin, end), high - low, fit)) / root
        row[SIGMA_U] = math.sqrt(covariance[1, 1])
        row[T_VALUE] = min(
            (fit[5] - fit[3]) / math.sqrt(covariance[5, 5] + covariance[3, 3] - 2.0 * covariance[5, 3]),
            (fit[5] - fit[4]) / math.sqrt(covariance[5, 5] + covariance[4, 4] - 2.0 * covariance[5, 4]),
        )
        row[CZ], row[SIGMA_Z], row[STEP], row[SIGMA_STEP] = height_of(
            near, (begin, end), fit, at, 0.09 * scale
        )
        row[DARK] = dark + (bright - dark) * max(fit[3], fit[4])
        row[BRIGHT] = dark + (bright - dark) * fit[5]
        row[NUMBER] = used
        row[APART] = radius * math.sqrt(math.pi * (1.0 + ACROSS * ACROSS) / n)
        row[FIRST], row[LAST] = -1.0, -1.0
        number += 1
    return number, HOLES if sparse else (FOUND if number else NO_STRIPE)
