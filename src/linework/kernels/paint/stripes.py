"""Stripes of paint in one search area: found, fitted, and written as rows with named columns."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.paint.paint_points import POINT_INTENSITY
from linework.kernels.paint.stripe_extent import dash_at, extent
from linework.kernels.paint.stripe_fit import (
    FIT_OFFSET,
    FIT_PAINT,
    FIT_ROAD_LEFT,
    FIT_ROAD_RIGHT,
    FIT_SLOPE,
    FIT_UNKNOWNS,
    FIT_WIDTH,
    STRIP_COLUMNS,
    bright_beside,
    edge_variance,
    fade_gain,
    fit_stripe,
    strip_of,
)
from linework.kernels.paint.stripe_height import height_of
from linework.kernels.paint.stripe_search import (
    BAND_COLUMNS,
    BAND_LEFT,
    BAND_RIGHT,
    MOST_STRIPES,
    PROFILE_REACH,
    direction,
    stripes_across,
)
from linework.kernels.paint.stripe_sides import sides_of

#: Columns of a stripe: centre, unit vector along it, half extents [m]; standard deviations across, of the height [m]
#: and of the direction [rad]; t-value of the paint against the road; height of a step under it and its sigma [m];
#: intensity of road and paint; points used; first and last time [s], both -1 if no point lay on it; whole length,
#: spacing of the points, and place along the search area's direction [m]; gain of edges that fade over crisp ones; difference of the road
#: on both sides over the contrast of the paint; rise of the ground from its right to its left [m].
(
    STRIPE_X, STRIPE_Y, STRIPE_Z, STRIPE_UX, STRIPE_UY, STRIPE_HALF_U, STRIPE_HALF_V,
    STRIPE_SIGMA_V, STRIPE_SIGMA_Z, STRIPE_SIGMA_U, STRIPE_T, STRIPE_STEP, STRIPE_SIGMA_STEP,
    STRIPE_DARK, STRIPE_BRIGHT, STRIPE_POINTS, STRIPE_FIRST, STRIPE_LAST, STRIPE_LENGTH,
    STRIPE_SPACING, STRIPE_ALONG, STRIPE_FADES, STRIPE_SIDES, STRIPE_RISE,
) = range(24)  # fmt: skip
STRIPE_COLUMNS = 24
#: A stripe found within this of a cell may pass through it once it is measured; and the shortest piece in a cell. [m]
NEAR_CELL_M, LEAST_PIECE_M = 0.05, 0.04
#: Fewest of 8 parts along a stripe with points on its paint, to trust it, and to measure it at all.
LEAST_PARTS, FEWEST_PARTS = 3, 2
#: Share of points beside a stripe that may be as bright as its paint (specks, a ragged edge).
MOST_BESIDE = 0.25
#: Road beside a stripe, in radii of the search area: checked for bright points, used for its height, and fitted.
BESIDE_REACH, HEIGHT_REACH, FIT_REACH = 0.16, 0.18, 0.24
#: Share of the gap to the next stripe at either end that belongs to the blurred edges, not to the road.
GAP_BORDER = 0.2
#: Shortest stripe, and blur of an edge in the first, rough fit, in radii of the search area.
LEAST_LENGTH, ROUGH_BLUR = 0.3, 0.06
#: Blur of an edge in the fine fit: this many points lie in it, but no less than the scanner resolves [m] (and no more
#: than a third of the stripe's width).
EDGE_POINTS, LEAST_BLUR_M = 8.0, 0.01
#: Gauss-Newton steps of the rough and of the fine fit.
ROUGH_ROUNDS, FINE_ROUNDS = 3, 4
#: Brightness at which points are clipped: values darker than road or brighter than paint carry no more information.
DARKEST, BRIGHTEST = -1.0, 1.5
#: Brightness of paint that a fit begins with: worn paint is darker than the brightest points.
FIRST_PAINT = 0.7
#: Below this a component of a unit vector counts as 0.
ZERO_COMPONENT = 1e-9

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
    """Return the stretch of the line p + s u, within `stretch`, that lies in a box; empty: begin > end.

    box: west, south, east and north edge.
    """
    begin, end = stretch
    west, south, east, north = box
    for axis in range(2):
        p, u = (px, ux) if axis == 0 else (py, uy)
        low, high = (west, east) if axis == 0 else (south, north)
        if abs(u) < ZERO_COMPONENT:
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
    angle: float,
    out: FloatArray,
) -> tuple[int, int]:
    """Find the stripes of a search area that pass through a cell.

    Parameters
    ----------
    work
        (n or more, 5): the points within 1.75 radii of the area's middle, x and y from there. Overwritten:
        intensities become brightness, 0 for road and 1 for paint.
    radius
        Of the search area. [m]
    levels
        Approximate intensity of road and of paint.
    cell
        West, south, east and north edge from the middle of the search area. [m]
    least_t
        Smallest t-value of a band, see `stripes_across`.
    angle
        Direction of the stripes [rad]; NaN: that of the points.
    out
        (4, 24) output, a row for each stripe; places are from the middle of the search area.

    Returns
    -------
    The number of stripes, and why there are none; HOLES where a larger area should be tried.
    """
    dark, bright = levels
    west, south, east, north = cell
    for i in range(n):
        scaled = (work[i, POINT_INTENSITY] - dark) / (bright - dark)
        work[i, POINT_INTENSITY] = min(max(scaled, DARKEST), BRIGHTEST)
    if math.isnan(angle):
        angle = direction(work, n, radius)
    edges = np.empty((MOST_STRIPES, BAND_COLUMNS))
    m = stripes_across(work, n, angle, radius, least_t, edges)
    axes = (math.cos(angle), math.sin(angle))
    wide = (west - NEAR_CELL_M, south - NEAR_CELL_M, east + NEAR_CELL_M, north + NEAR_CELL_M)
    fit, covariance = np.empty(FIT_UNKNOWNS), np.empty((FIT_UNKNOWNS, FIT_UNKNOWNS))
    strip = np.empty((n, STRIP_COLUMNS))
    number, sparse = 0, False
    for j in range(m):
        # Stripes that do not pass near the cell belong to other cells
        offset = 0.5 * (edges[j, BAND_RIGHT] + edges[j, BAND_LEFT])
        s0, s1 = clipped(-offset * axes[1], offset * axes[0], axes[0], axes[1], (-radius, radius), wide)
        if s1 <= s0:
            continue
        low, high = fit_window(edges[:m], j, radius)
        near = strip[: strip_of(work, n, axes, radius, (low, high), strip)]
        fit[:] = 0.0
        fit[FIT_OFFSET], fit[FIT_WIDTH] = offset, edges[j, BAND_LEFT] - edges[j, BAND_RIGHT]
        fit[FIT_PAINT] = FIRST_PAINT
        begin, end, used, parts = fit_closely(near, radius, high - low, fit, covariance)
        sparse = sparse or parts < LEAST_PARTS
        if used == 0 or bright_beside(near, (begin, end), fit, BESIDE_REACH * radius) > MOST_BESIDE:
            continue
        row = out[number]
        s0, s1 = clipped(-offset * axes[1], offset * axes[0], axes[0], axes[1], (begin, end), wide)
        own = dash_at(near, radius, fit, (begin, end), 0.5 * (s0 + s1))
        if write_place(fit, own, axes, cell, row):
            write_figures(near, (begin, end), high - low, radius, fit, covariance, row)
            row[STRIPE_DARK] = dark + (bright - dark) * max(fit[FIT_ROAD_LEFT], fit[FIT_ROAD_RIGHT])
            row[STRIPE_BRIGHT] = dark + (bright - dark) * fit[FIT_PAINT]
            row[STRIPE_POINTS] = used
            blur = fine_blur(near, (begin, end), high - low, radius, fit)
            row[STRIPE_FADES] = fade_gain(near, (begin, end), blur, fit)
            row[STRIPE_SIDES] = sides_of(work, n, axes, (begin, end), fit, edges[:m], j)
            row[STRIPE_SPACING] = radius * math.sqrt(math.pi * (1.0 + PROFILE_REACH * PROFILE_REACH) / n)
            number += 1
    return number, HOLES if sparse else (STRIPE_FOUND if number else NO_STRIPE)


@njit(cache=True, nogil=True)
def fit_window(edges: FloatArray, j: int, radius: float) -> tuple[float, float]:
    """Return the lowest and highest offset [m] that stripe j is fitted over: road on both sides, no other paint.

    edges: (m, 3), see `stripes_across`.
    """
    right, left = edges[j, BAND_RIGHT], edges[j, BAND_LEFT]
    low, high = right - FIT_REACH * radius, left + FIT_REACH * radius
    for k in range(len(edges)):
        # Most of the gap to a neighbour, but not its border
        if k != j and edges[k, BAND_LEFT] <= right:
            low = max(low, edges[k, BAND_LEFT] + GAP_BORDER * (right - edges[k, BAND_LEFT]))
        if k != j and edges[k, BAND_RIGHT] >= left:
            high = min(high, edges[k, BAND_RIGHT] - GAP_BORDER * (edges[k, BAND_RIGHT] - left))
    return low, high


@njit(cache=True, nogil=True)
def fit_closely(
    near: FloatArray, radius: float, across: float, fit: FloatArray, covariance: FloatArray
) -> tuple[float, float, int, int]:
    """Fit a stripe roughly, find the stretch along it with paint, and fit it precisely on that stretch.

    Parameters
    ----------
    near
        (n, 4): points, see `strip_of`.
    radius, across
        Of the search area; width of the strip. [m]
    fit, covariance
        (6,) input and output, (6, 6) output: see `fit_stripe`.

    Returns
    -------
    Begin and end of the stretch [m]; the number of points used, 0 where there is no stripe; and the number of 8
    parts of the stretch with points on the paint.
    """
    least = LEAST_LENGTH * radius
    blur = min(ROUGH_BLUR * radius, fit[FIT_WIDTH] / 3.0)
    if fit_stripe(near, (-radius, radius), blur, ROUGH_ROUNDS, fit, covariance) == 0:
        return 0.0, 0.0, 0, 0
    begin, end, parts = extent(near, radius, fit)
    if parts < FEWEST_PARTS or end - begin < least:
        return begin, end, 0, parts
    blur = fine_blur(near, (begin, end), across, radius, fit)
    used = fit_stripe(near, (begin, end), blur, FINE_ROUNDS, fit, covariance)
    begin, end, last = extent(near, radius, fit)
    is_brighter = fit[FIT_PAINT] > fit[FIT_ROAD_LEFT] and fit[FIT_PAINT] > fit[FIT_ROAD_RIGHT]
    if last < FEWEST_PARTS or end - begin < least or not is_brighter:
        return begin, end, 0, parts
    return begin, end, used, parts


@njit(cache=True, nogil=True)
def fine_blur(
    near: FloatArray, stretch: tuple[float, float], across: float, radius: float, fit: FloatArray
) -> float:
    """Return the blur of an edge [m] in the fine fit; arguments as for `fit_closely` and `edge_variance`."""
    begin, end = stretch
    dense = EDGE_POINTS * across * radius / ((end - begin) * len(near))
    return float(min(max(dense, LEAST_BLUR_M), fit[FIT_WIDTH] / 3.0))


@njit(cache=True, nogil=True)
def write_place(
    fit: FloatArray,
    stretch: tuple[float, float],
    axes: tuple[float, float],
    cell: tuple[float, float, float, float],
    row: FloatArray,
) -> bool:
    """Write centre, direction and extent of the piece of a stripe in a cell; return whether there is such a piece.

    Parameters
    ----------
    fit, stretch
        (6,) unknowns of the stripe; its begin and end [m].
    axes
        Unit vector along the search area's direction.
    cell
        West, south, east and north edge. [m]
    row
        (24,) output.
    """
    axis_x, axis_y = axes
    first, last = stretch
    root = math.sqrt(1.0 + fit[FIT_SLOPE] ** 2)
    ux, uy = (axis_x - fit[FIT_SLOPE] * axis_y) / root, (axis_y + fit[FIT_SLOPE] * axis_x) / root
    px, py = -fit[FIT_OFFSET] * axis_y, fit[FIT_OFFSET] * axis_x
    begin, end = first * root, last * root
    s0, s1 = clipped(px, py, ux, uy, (begin, end), cell)
    if s1 - s0 < LEAST_PIECE_M:
        return False
    s = 0.5 * (s0 + s1)
    row[STRIPE_X], row[STRIPE_Y], row[STRIPE_UX], row[STRIPE_UY] = px + s * ux, py + s * uy, ux, uy
    row[STRIPE_HALF_U], row[STRIPE_LENGTH], row[STRIPE_HALF_V] = (
        min(s - begin, end - s),
        end - begin,
        0.5 * fit[FIT_WIDTH] / root,
    )
    row[STRIPE_ALONG] = s / root
    return True


@njit(cache=True, nogil=True)
def contrast_t(fit: FloatArray, covariance: FloatArray, side: int) -> float:
    """Return the difference of paint and road on one side over its sigma; `fit` (6,), `covariance` (6, 6)."""
    variance = covariance[FIT_PAINT, FIT_PAINT] + covariance[side, side] - 2.0 * covariance[FIT_PAINT, side]
    return float((fit[FIT_PAINT] - fit[side]) / math.sqrt(variance))


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
    """Write a stripe's standard deviations, its t-value against the road, and its height.

    Parameters
    ----------
    near
        (n, 4): points, see `linework.kernels.paint.stripe_fit.strip_of`.
    stretch, across, radius
        Begin and end of the stripe; width of the strip; radius of the search area. [m]
    fit, covariance
        (6,) unknowns, (6, 6).
    row
        (24,) input and output.
    """
    at = row[STRIPE_ALONG]
    slope_variance = covariance[FIT_SLOPE, FIT_SLOPE]
    variance = (
        covariance[FIT_OFFSET, FIT_OFFSET]
        + 2.0 * at * covariance[FIT_OFFSET, FIT_SLOPE]
        + at * at * slope_variance
    )
    unknown = edge_variance(near, stretch, across, fit)
    row[STRIPE_SIGMA_V] = math.sqrt(variance + unknown)
    # The error that the fit does not know of is independent at the two ends: over half the length at the least
    row[STRIPE_SIGMA_U] = math.sqrt(slope_variance + 4.0 * unknown / row[STRIPE_LENGTH] ** 2)
    row[STRIPE_T] = min(
        contrast_t(fit, covariance, FIT_ROAD_LEFT), contrast_t(fit, covariance, FIT_ROAD_RIGHT)
    )
    height, sigma, step, sigma_step, rise = height_of(near, stretch, fit, at, HEIGHT_REACH * radius)
    row[STRIPE_Z], row[STRIPE_SIGMA_Z] = height, sigma
    row[STRIPE_STEP], row[STRIPE_SIGMA_STEP], row[STRIPE_RISE] = step, sigma_step, rise
    row[STRIPE_FIRST], row[STRIPE_LAST] = -1.0, -1.0
