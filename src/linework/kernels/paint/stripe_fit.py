"""One stripe of paint fitted to the points around it: its two edges, its begin and end, and evidence against it.

The points around a stripe form a strip: u along the search area's direction, v across it, to the left.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.paint.paint_points import POINT_INTENSITY, POINT_X, POINT_Y, POINT_Z
from linework.kernels.paint.stripe_search import NARROWEST_LINE_M
from linework.kernels.tracking.small_systems import factor, solve

#: Columns of a strip of points: along and across [m], brightness (0 road, 1 paint), height [m].
STRIP_U, STRIP_V, STRIP_BRIGHTNESS, STRIP_HEIGHT = range(4)
STRIP_COLUMNS = 4
#: Unknowns of a fitted stripe: offset v at u = 0 [m], slope dv/du, width [m], brightness of the road on the left, of
#: the road on the right, and of the paint.
FIT_OFFSET, FIT_SLOPE, FIT_WIDTH, FIT_ROAD_LEFT, FIT_ROAD_RIGHT, FIT_PAINT = range(6)
FIT_UNKNOWNS = 6

#: Bins along a stripe, and parts along it whose errors are taken for independent.
N_ALONG, N_SLICES = 80, 8
#: Fewest points of a fitted stripe or plane.
FEWEST_FITTED = 8
#: Standard deviations of what is known before the fit: the offset to 0.1 m, the slope to 0.2, the width to 0.05 m
#: (lines are 0.10 m wide and wider), the brightness of paint, about 1, to 0.3.
PRIOR_OFFSET_M, PRIOR_SLOPE, PRIOR_WIDTH_M, PRIOR_PAINT = 0.1, 0.2, 0.05, 0.3
#: Weight, in points, that keeps every unknown of the fit where it is, so that the matrix stays regular.
DAMPING = 1e-3
#: Most that a step of the fit changes offset and width, as a share of the width and at least in metres, and the slope.
STEP_SHARE, STEP_LEAST_M, STEP_SLOPE = 0.25, 0.01, 0.1
#: Thinnest stripe the fit may arrive at. [m]
THINNEST_M = 0.02
#: Smallest variance of brightness, against division by zero. [(paint - road)^2]
LEAST_BRIGHTNESS_VARIANCE = 1e-6
#: Share of the width about a stripe's middle whose points are on the paint for certain, to either side.
MIDDLE_SHARE, WEAR_SHARE = 0.4, 0.45
#: Edges of what is not paint fade over twice this [m], if that is this many times the blur of the fit; steps of that fit.
FADING_M, LEAST_FADING, FADING_ROUNDS = 0.10, 2.0, 3
#: Most of a stripe's paint that counts as worn off: beyond it an edge cannot be located. [share]
MOST_WORN = 0.6


@njit(cache=True, nogil=True)
def strip_of(
    work: FloatArray,
    n: int,
    axes: tuple[float, float],
    radius: float,
    limits: tuple[float, float],
    strip: FloatArray,
) -> int:
    """Write the points between two offsets across to `strip`, and return their number.

    Parameters
    ----------
    work
        (n or more, 5): points of the search area, brightness scaled to 0 for road and 1 for paint.
    axes
        Unit vector along the stripe.
    radius
        Of the search area. [m]
    limits
        Lowest and highest offset across. [m]
    strip
        (n or more, 4) output with the columns `STRIP_U` to `STRIP_HEIGHT`.
    """
    ux, uy = axes
    low, high = limits
    m = 0
    for i in range(n):
        v = work[i, POINT_Y] * ux - work[i, POINT_X] * uy
        if v > low and v < high:
            u = work[i, POINT_X] * ux + work[i, POINT_Y] * uy
            if abs(u) < radius:
                strip[m, STRIP_U], strip[m, STRIP_V] = u, v
                strip[m, STRIP_BRIGHTNESS], strip[m, STRIP_HEIGHT] = (
                    work[i, POINT_INTENSITY],
                    work[i, POINT_Z],
                )
                m += 1
    return m


@njit(cache=True, nogil=True)
def fit_stripe(
    strip: FloatArray,
    stretch: tuple[float, float],
    blur: float,
    rounds: int,
    fit: FloatArray,
    covariance: FloatArray,
) -> int:
    """Fit a stripe to the brightness of all points around it by least squares, and return the number of points.

    The model has the brightness of the paint between two edges and those of the road on the left and on the right
    beyond them; it passes from one to the other over `blur` on both sides of an edge.

    Parameters
    ----------
    strip
        (n, 4): see `strip_of`.
    stretch
        Begin and end along the stripe of the points that are used. [m]
    blur
        [m].
    rounds
        Gauss-Newton steps.
    fit
        (6,) input and output: unknowns `FIT_OFFSET` to `FIT_PAINT`.
    covariance
        (6, 6) output, of the unknowns. The scatter between eight parts along the stripe is taken for independent,
        not that of the points: worn places and stains are larger than the spacing of the points.

    Returns
    -------
    The number of points used; 0 if there are fewer than 8.
    """
    n = FIT_UNKNOWNS
    begin, end = stretch
    # No line in use is narrower
    width0 = max(fit[FIT_WIDTH], NARROWEST_LINE_M)
    normal, right, step = np.zeros((n, n)), np.zeros(n), np.zeros(n)
    row = np.zeros(n)
    scores = np.zeros((N_SLICES, n))
    number, variance = 0, 1.0
    parts = N_SLICES / (end - begin)
    for k in range(rounds + 1):
        normal[:], right[:], scores[:] = 0.0, 0.0, 0.0
        number, squares = 0, 0.0
        slant = 0.25 / blur
        for i in range(len(strip)):
            u = strip[i, STRIP_U]
            if u <= begin or u >= end:
                continue
            number += 1
            part = min(int((u - begin) * parts), N_SLICES - 1)
            d = strip[i, STRIP_V] - fit[FIT_OFFSET] - fit[FIT_SLOPE] * u
            share = (0.5 * fit[FIT_WIDTH] - abs(d)) * 2.0 * slant + 0.5
            side = FIT_ROAD_LEFT if d > 0.0 else FIT_ROAD_RIGHT
            # Well on the road or on the paint only its level matters
            if share <= 0.0 or share >= 1.0:
                at = side if share <= 0.0 else FIT_PAINT
                residual = strip[i, STRIP_BRIGHTNESS] - fit[at]
                squares += residual * residual
                scores[part, at] += residual
                normal[at, at] += 1.0
                continue
            rise = (fit[FIT_PAINT] - fit[side]) * 2.0 * slant
            row[FIT_OFFSET] = rise if d > 0.0 else -rise
            row[FIT_SLOPE], row[FIT_WIDTH] = row[FIT_OFFSET] * u, 0.5 * rise
            row[FIT_ROAD_LEFT], row[FIT_ROAD_RIGHT], row[FIT_PAINT] = 0.0, 0.0, share
            row[side] = 1.0 - share
            residual = strip[i, STRIP_BRIGHTNESS] - fit[side] - (fit[FIT_PAINT] - fit[side]) * share
            squares += residual * residual
            for a in range(n):
                scores[part, a] += row[a] * residual
                for b in range(a + 1):
                    normal[a, b] += row[a] * row[b]
        if number < FEWEST_FITTED:
            return 0
        variance = squares / number + LEAST_BRIGHTNESS_VARIANCE
        normal[FIT_OFFSET, FIT_OFFSET] += variance / PRIOR_OFFSET_M**2
        normal[FIT_SLOPE, FIT_SLOPE] += variance / PRIOR_SLOPE**2
        normal[FIT_WIDTH, FIT_WIDTH] += variance / PRIOR_WIDTH_M**2
        right[FIT_WIDTH] = (width0 - fit[FIT_WIDTH]) * variance / PRIOR_WIDTH_M**2
        right[FIT_SLOPE] = -fit[FIT_SLOPE] * variance / PRIOR_SLOPE**2
        normal[FIT_PAINT, FIT_PAINT] += variance / PRIOR_PAINT**2
        right[FIT_PAINT] = (1.0 - fit[FIT_PAINT]) * variance / PRIOR_PAINT**2
        for a in range(n):
            normal[a, a] += DAMPING * variance
            for b in range(N_SLICES):
                right[a] += scores[b, a]
        factor(normal)
        if k < rounds:
            solve(normal, right, step)
            most = max(STEP_SHARE * fit[FIT_WIDTH], STEP_LEAST_M)
            fit[FIT_OFFSET] += min(max(step[FIT_OFFSET], -most), most)
            fit[FIT_SLOPE] += min(max(step[FIT_SLOPE], -STEP_SLOPE), STEP_SLOPE)
            fit[FIT_WIDTH] = max(fit[FIT_WIDTH] + min(max(step[FIT_WIDTH], -most), most), THINNEST_M)
            for a in range(FIT_ROAD_LEFT, n):
                fit[a] += step[a]
    # The scatter of the parts (an edge takes two unknowns), and that of the points
    covariance[:] = 0.0
    for b in range(N_SLICES):
        solve(normal, scores[b], step)
        for a in range(n):
            for c in range(n):
                covariance[a, c] += N_SLICES / (N_SLICES - 2.0) * step[a] * step[c]
    for a in range(n):
        right[:] = 0.0
        right[a] = variance
        solve(normal, right, step)
        for c in range(n):
            covariance[a, c] += step[c]
    return number


@njit(cache=True, nogil=True)
def fade_gain(strip: FloatArray, stretch: tuple[float, float], blur: float, fit: FloatArray) -> float:
    """Return how much better a strip whose edges fade explains the points than a stripe: gain in log likelihood.

    What is left between wheel tracks, a verge that grows over the road and a place that dries fade over decimetres;
    paint ends within a spot of the beam. 0 where the spacing of the points hides the difference.

    Parameters
    ----------
    strip, fit
        (n, 4), (6,): see `strip_of` and `fit_stripe`.
    stretch
        Begin and end of the stripe. [m]
    blur
        Of an edge in the fit of the stripe. [m]
    """
    fading = min(FADING_M, fit[FIT_WIDTH] / 3.0)
    if fading < LEAST_FADING * blur:
        return 0.0
    soft, covariance = fit.copy(), np.empty((FIT_UNKNOWNS, FIT_UNKNOWNS))
    number = fit_stripe(strip, stretch, fading, FADING_ROUNDS, soft, covariance)
    crisp, faded = squares_left(strip, stretch, blur, fit), squares_left(strip, stretch, fading, soft)
    return (
        0.5 * number * math.log(max(crisp, LEAST_BRIGHTNESS_VARIANCE) / max(faded, LEAST_BRIGHTNESS_VARIANCE))
    )


@njit(cache=True, nogil=True)
def squares_left(strip: FloatArray, stretch: tuple[float, float], blur: float, fit: FloatArray) -> float:
    """Return the sum of squares that a fitted stripe leaves; arguments as for `fit_stripe`."""
    begin, end = stretch
    total, slant = 0.0, 0.5 / blur
    for i in range(len(strip)):
        u = strip[i, STRIP_U]
        if u > begin and u < end:
            d = strip[i, STRIP_V] - fit[FIT_OFFSET] - fit[FIT_SLOPE] * u
            share = min(max((0.5 * fit[FIT_WIDTH] - abs(d)) * slant + 0.5, 0.0), 1.0)
            road = fit[FIT_ROAD_LEFT] if d > 0.0 else fit[FIT_ROAD_RIGHT]
            total += (strip[i, STRIP_BRIGHTNESS] - road - (fit[FIT_PAINT] - road) * share) ** 2
    return total


@njit(cache=True, nogil=True)
def edge_variance(strip: FloatArray, stretch: tuple[float, float], across: float, fit: FloatArray) -> float:
    """Return the variance of a stripe's centre that the fit does not know of: spacing of points, worn edges [m^2].

    Points follow each other across the road at a distance a, at random: an edge half-way between the last point on
    the paint and the next one beside it is off by a / sqrt(2), the centre between two edges by a / 2. And where a
    share f of the paint between the edges is gone, as much may be gone beyond one of them: f / (1 - f) of the
    width, evenly distributed.

    Parameters
    ----------
    strip, fit
        (n, 4), (6,): see `strip_of` and `fit_stripe`.
    stretch
        Begin and end of the stripe. [m]
    across
        Width of the strip. [m]
    """
    begin, end = stretch
    inside, paint, gone = 0, 1, 0
    middle = 0.5 * fit[FIT_PAINT] + 0.25 * (fit[FIT_ROAD_LEFT] + fit[FIT_ROAD_RIGHT])
    for i in range(len(strip)):
        u = strip[i, STRIP_U]
        if u > begin and u < end:
            inside += 1
            if abs(strip[i, STRIP_V] - fit[FIT_OFFSET] - fit[FIT_SLOPE] * u) < WEAR_SHARE * fit[FIT_WIDTH]:
                paint += 1
                gone += strip[i, STRIP_BRIGHTNESS] < middle
    apart = across / max(inside, 1)
    worn = min(gone / paint, MOST_WORN)
    return float((0.5 * apart) ** 2 + (worn / (1.0 - worn) * fit[FIT_WIDTH]) ** 2 / 12.0)


@njit(cache=True, nogil=True)
def bright_beside(strip: FloatArray, stretch: tuple[float, float], fit: FloatArray, side: float) -> float:
    """Return the share of points within `side` [m] of a stripe's edges that are as bright as it, on the worse side.

    The road beside paint has hardly any, whatever its level; a strip of grass beside other grass has many.
    `strip` (n, 4), `stretch`, `fit` (6,) as for `edge_variance`.
    """
    begin, end = stretch
    # Left and right of the stripe: points, and bright ones among them
    points, bright = np.zeros(2), np.zeros(2)
    for i in range(len(strip)):
        u = strip[i, STRIP_U]
        d = strip[i, STRIP_V] - fit[FIT_OFFSET] - fit[FIT_SLOPE] * u
        beyond = abs(d) - 0.5 * fit[FIT_WIDTH]
        if beyond > 0.0 and beyond < side and u > begin and u < end:
            k = 0 if d > 0.0 else 1
            points[k] += 1.0
            middle = 0.5 * (fit[FIT_PAINT] + fit[FIT_ROAD_LEFT if d > 0.0 else FIT_ROAD_RIGHT])
            bright[k] += 1.0 if strip[i, STRIP_BRIGHTNESS] > middle else 0.0
    left, right = bright[0] / max(points[0], 1.0), bright[1] / max(points[1], 1.0)
    return float(max(left, right))
