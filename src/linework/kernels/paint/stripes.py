"""Stripes of paint in a search area, measured."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.paint.stripe_fit import (
    bright_beside,
    edge_variance,
    extent,
    fit_stripe,
    height_of,
    strip_of,
)
from linework.kernels.paint.stripe_search import MOST_STRIPES, PROFILE_ACROSS_M, Q, direction, stripes_across

#: Columns of a stripe.
(
    CX, CY, CZ, STRIPE_UX, STRIPE_UY, STRIPE_HALF_U, STRIPE_HALF_V, STRIPE_SIGMA_V, SIGMA_Z, STRIPE_SIGMA_U, T_VALUE, STRIPE_STEP, SIGMA_STEP,
    DARK, STRIPE_BRIGHT, NUMBER, FIRST, LAST, LENGTH, APART, ALONG,
) = range(21)  # fmt: skip
STRIPE_COLUMNS = 21
#: Stripes so near to a cell may pass through it when measured; a piece in it is at least so long. [m]
NEAR_CELL_M, LEAST_PIECE_M = 0.05, 0.04
#: Points on the paint in fewer of 8 parts of a stripe are too few.
LEAST_PARTS = 3
#: Share of points beside a stripe that may be as bright as its paint (specks, a ragged edge).
MOST_BESIDE = 0.25

#: Why a search area has no stripe.
STRIPE_FOUND, TOO_FEW_POINTS, HOLES, NO_BRIGHT, NO_STRIPE = range(5)


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
    work: FloatArray,
    n: int,
    radius: float,
    levels: tuple[float, float],
    cell: tuple[float, float, float, float],
    least_t: float,
    out: FloatArray,
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
    edges = np.empty((MOST_STRIPES, 3))
    m = stripes_across(work, n, angle, radius, least_t, edges)
    axes = (math.cos(angle), math.sin(angle))
    wide = (cell[0] - NEAR_CELL_M, cell[1] - NEAR_CELL_M, cell[2] + NEAR_CELL_M, cell[3] + NEAR_CELL_M)
    fit, covariance, strip = np.empty(6), np.empty((6, 6)), np.empty((n, 4))
    number, sparse = 0, False
    for j in range(m):
        # Stripes that do not come near the cell are left to others
        offset = 0.5 * (edges[j, 0] + edges[j, 1])
        s0, s1 = clipped(-offset * axes[1], offset * axes[0], axes[0], axes[1], (-radius, radius), wide)
        if s1 <= s0:
            continue
        low, high = fit_window(edges[:m], j, radius)
        near = strip[: strip_of(work, n, axes, radius, (low, high), strip)]
        fit[:] = 0.0
        fit[0], fit[2], fit[5] = offset, edges[j, 1] - edges[j, 0], 0.7
        begin, end, used, parts = fit_closely(near, radius, high - low, fit, covariance)
        sparse = sparse or parts < LEAST_PARTS
        if used == 0 or bright_beside(near, (begin, end), fit, 0.16 * radius) > MOST_BESIDE:
            continue
        row = out[number]
        if write_place(fit, (begin, end), axes, cell, row):
            write_figures(near, (begin, end), high - low, radius, fit, covariance, row)
            row[DARK] = dark + (bright - dark) * max(fit[3], fit[4])
            row[STRIPE_BRIGHT] = dark + (bright - dark) * fit[5]
            row[NUMBER] = used
            row[APART] = radius * math.sqrt(math.pi * (1.0 + PROFILE_ACROSS_M * PROFILE_ACROSS_M) / n)
            number += 1
    return number, HOLES if sparse else (STRIPE_FOUND if number else NO_STRIPE)


@njit(cache=True, nogil=True)
def fit_window(edges: FloatArray, j: int, radius: float) -> tuple[float, float]:
    """Return between which offsets a stripe is fitted: road on both sides, no paint of its neighbours."""
    right, left = edges[j, 0], edges[j, 1]
    low, high = right - 0.24 * radius, left + 0.24 * radius
    for k in range(len(edges)):
        # Most of the gap, but not its border
        if k != j and edges[k, 1] <= right:
            low = max(low, edges[k, 1] + 0.2 * (right - edges[k, 1]))
        if k != j and edges[k, 0] >= left:
            high = min(high, edges[k, 0] - 0.2 * (edges[k, 0] - left))
    return low, high


@njit(cache=True, nogil=True)
def fit_closely(
    near: FloatArray, radius: float, across: float, fit: FloatArray, covariance: FloatArray
) -> tuple[float, float, int, int]:
    """Fit a stripe roughly, find how far along there is paint, and fit it precisely on that stretch.

    Returns
    -------
    Begin and end of the stretch; the points used, 0 where there is no stripe; and in how many of 8 parts of the
    stretch there are points on the paint.
    """
    least = 0.3 * radius
    if fit_stripe(near, (-radius, radius), min(0.06 * radius, fit[2] / 3.0), 3, fit, covariance) == 0:
        return 0.0, 0.0, 0, 0
    begin, end, parts = extent(near, radius, fit)
    if parts < 2 or end - begin < least:
        return begin, end, 0, parts
    # An edge is passed over by 8 points, if it can be
    blur = min(max(8.0 * across * radius / ((end - begin) * len(near)), 0.01), fit[2] / 3.0)
    used = fit_stripe(near, (begin, end), blur, 4, fit, covariance)
    begin, end, last = extent(near, radius, fit)
    if last < 2 or end - begin < least or not (fit[5] > fit[3] and fit[5] > fit[4]):
        return begin, end, 0, parts
    return begin, end, used, parts


@njit(cache=True, nogil=True)
def write_place(
    fit: FloatArray,
    stretch: tuple[float, float],
    axes: tuple[float, float],
    cell: tuple[float, float, float, float],
    row: FloatArray,
) -> bool:
    """Write where the stripe lies in a cell: the middle of the piece in it; return whether there is such a piece."""
    root = math.sqrt(1.0 + fit[1] ** 2)
    ux, uy = (axes[0] - fit[1] * axes[1]) / root, (axes[1] + fit[1] * axes[0]) / root
    px, py = -fit[0] * axes[1], fit[0] * axes[0]
    begin, end = stretch[0] * root, stretch[1] * root
    s0, s1 = clipped(px, py, ux, uy, (begin, end), cell)
    if s1 - s0 < LEAST_PIECE_M:
        return False
    s = 0.5 * (s0 + s1)
    row[CX], row[CY], row[STRIPE_UX], row[STRIPE_UY] = px + s * ux, py + s * uy, ux, uy
    row[STRIPE_HALF_U], row[LENGTH], row[STRIPE_HALF_V] = (
        min(s - begin, end - s),
        end - begin,
        0.5 * fit[2] / root,
    )
    row[ALONG] = s / root
    return True


@njit(cache=True, nogil=True)
def write_figures(
    near: FloatArray,
    stretch: tuple[float, float],
    across: float,
    radius: float,
    fit: FloatArray,
    covariance: FloatArray,
    row: FloatArray,
) -> None:
    """Write how precise a stripe is, how much it stands out, and its height."""
    at = row[ALONG]
    variance = covariance[0, 0] + 2.0 * at * covariance[0, 1] + at * at * covariance[1, 1]
    unseen = edge_variance(near, stretch, across, fit)
    row[STRIPE_SIGMA_V] = math.sqrt(variance + unseen)
    # What the fit does not see is another at the other end: over half the length at the least
    row[STRIPE_SIGMA_U] = math.sqrt(covariance[1, 1] + 4.0 * unseen / row[LENGTH] ** 2)
    row[T_VALUE] = min(
        (fit[5] - fit[3]) / math.sqrt(covariance[5, 5] + covariance[3, 3] - 2.0 * covariance[5, 3]),
        (fit[5] - fit[4]) / math.sqrt(covariance[5, 5] + covariance[4, 4] - 2.0 * covariance[5, 4]),
    )
    row[CZ], row[SIGMA_Z], row[STRIPE_STEP], row[SIGMA_STEP] = height_of(
        near, stretch, fit, at, 0.18 * radius
    )
    row[FIRST], row[LAST] = -1.0, -1.0
