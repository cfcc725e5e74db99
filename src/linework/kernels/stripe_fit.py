"""One stripe of paint, precisely: its two edges, where it begins and ends."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.cholesky import factor, solve
from linework.kernels.stripe_search import Q, X, Y, Z

#: Bins along a stripe, and parts of it that are taken for independent.
N_ALONG = 80
N_SLICES = 8
#: Columns of a strip of points: along, across, brightness, height. Of a fit: offset, slope and width of the
#: stripe, brightness of the road on the left, on the right and of the paint.


@njit(cache=True, nogil=True)
def strip_of(
    work: FloatArray,
    n: int,
    axes: tuple[float, float],
    radius: float,
    limits: tuple[float, float],
    strip: FloatArray,
) -> int:
    """Write the points between two offsets as (along, across, brightness, height) to `strip`; return their number."""
    ux, uy = axes
    m = 0
    for i in range(n):
        v = work[i, Y] * ux - work[i, X] * uy
        if v > limits[0] and v < limits[1]:
            u = work[i, X] * ux + work[i, Y] * uy
            if abs(u) < radius:
                strip[m, 0], strip[m, 1], strip[m, 2], strip[m, 3] = u, v, work[i, Q], work[i, Z]
                m += 1
    return m


@njit(cache=True, nogil=True)
def extent(strip: FloatArray, radius: float, fit: FloatArray) -> tuple[float, float, int]:
    """Return where along its direction a stripe begins and ends, and in how many of 8 parts between are points.

    The stretch with the largest sum of brightness above the middle of road and paint is the most likely one
    for paint that begins once and ends once; an end is half way to the next point beyond.
    """
    size = 2.0 * radius / N_ALONG
    value, low, high = np.zeros(N_ALONG), np.full(N_ALONG, np.inf), np.full(N_ALONG, -np.inf)
    half = max(0.4 * fit[2], 0.02)
    middle = 0.5 * fit[5] + 0.25 * (fit[3] + fit[4])
    for i in range(len(strip)):
        u = strip[i, 0]
        if abs(strip[i, 1] - fit[0] - fit[1] * u) <= half:
            b = min(int((u + radius) / size), N_ALONG - 1)
            value[b] += strip[i, 2] - middle
            low[b], high[b] = min(low[b], u), max(high[b], u)
    best, first, last, total, begin = 0.0, 0, -1, 0.0, 0
    for b in range(N_ALONG):
        if total <= 0.0:
            total, begin = 0.0, b
        total += value[b]
        if total > best:
            best, first, last = total, begin, b
    if last < 0:
        return 0.0, 0.0, 0
    while low[first] > high[first]:
        first += 1
    gap, previous = size, low[first]
    part, parts = -1, 0
    for b in range(first, last + 1):
        if low[b] <= high[b]:
            gap = max(gap, low[b] - previous)
            previous = high[b]
            here = b * N_SLICES // N_ALONG
            if here != part:
                part, parts = here, parts + 1
    begin_m, end_m = low[first], high[last]
    after, before = -1, -1
    for b in range(last + 1, N_ALONG):
        if low[b] <= high[b]:
            after = b
            break
    for b in range(first - 1, -1, -1):
        if low[b] <= high[b]:
            before = b
            break
    # Without a point beyond, the paint is followed to the border if the next one would have lain there
    if after >= 0:
        end_m = 0.5 * (end_m + low[after])
    elif radius - end_m <= 1.5 * gap:
        end_m = radius
    if before >= 0:
        begin_m = 0.5 * (begin_m + high[before])
    elif radius + begin_m <= 1.5 * gap:
        begin_m = -radius
    return begin_m, end_m, parts


@njit(cache=True, nogil=True)
def fit_stripe(
    strip: FloatArray,
    stretch: tuple[float, float],
    blur: float,
    rounds: int,
    fit: FloatArray,
    covariance: FloatArray,
) -> int:
    """Fit a stripe to the brightness of all points around it by least squares; return the number of points.

    Brightness is that of the paint between two edges, that of the road on the left and on the right beyond
    them, and passes from one to the other over `blur` on both sides of an edge. `fit`: offset, slope, width,
    road left, road right, paint (changed in place). `covariance` (6, 6) takes the scatter between eight parts
    along the stripe for independent, not that of the points: worn places and stains are larger than those.
    """
    width0 = max(fit[2], 0.10)
    normal, right, step = np.zeros((6, 6)), np.zeros(6), np.zeros(6)
    row = np.zeros(6)
    scores = np.zeros((N_SLICES, 6))
    number, variance = 0, 1.0
    begin, parts = stretch[0], N_SLICES / (stretch[1] - stretch[0])
    for k in range(rounds + 1):
        normal[:], right[:], scores[:] = 0.0, 0.0, 0.0
        number, squares = 0, 0.0
        slant = 0.25 / blur
        for i in range(len(strip)):
            u = strip[i, 0]
            if u <= stretch[0] or u >= stretch[1]:
                continue
            number += 1
            part = min(int((u - begin) * parts), N_SLICES - 1)
            d = strip[i, 1] - fit[0] - fit[1] * u
            share = (0.5 * fit[2] - abs(d)) * 2.0 * slant + 0.5
            side = 3 if d > 0.0 else 4
            # On the road or on the paint one level is all that counts
            if share <= 0.0 or share >= 1.0:
                at = side if share <= 0.0 else 5
                residual = strip[i, 2] - fit[at]
                squares += residual * residual
                scores[part, at] += residual
                normal[at, at] += 1.0
                continue
            rise = (fit[5] - fit[side]) * 2.0 * slant
            row[0] = rise if d > 0.0 else -rise
            row[1], row[2] = row[0] * u, 0.5 * rise
            row[3], row[4], row[5] = 0.0, 0.0, share
            row[side] = 1.0 - share
            residual = strip[i, 2] - fit[side] - (fit[5] - fit[side]) * share
            squares += residual * residual
            for a in range(6):
                scores[part, a] += row[a] * residual
                for b in range(a + 1):
                    normal[a, b] += row[a] * row[b]
        if number < 8:
            return 0
        variance = squares / number + 1e-6
        # Known before: the width to about 5 cm (lines are 0.10 m and wider), the slope to 0.2, the paint to 0.3
        normal[0, 0] += variance / 0.1**2
        normal[1, 1] += variance / 0.2**2
        normal[2, 2] += variance / 0.05**2
        right[2] = (width0 - fit[2]) * variance / 0.05**2
        right[1] = -fit[1] * variance / 0.2**2
        normal[5, 5] += variance / 0.3**2
        right[5] = (1.0 - fit[5]) * variance / 0.3**2
        for a in range(6):
            normal[a, a] += 1e-3 * variance
            for b in range(N_SLICES):
                right[a] += scores[b, a]
        factor(normal)
        if k < rounds:
            solve(normal, right, step)
            quarter = max(0.25 * fit[2], 0.01)
            fit[0] += min(max(step[0], -quarter), quarter)
            fit[1] += min(max(step[1], -0.1), 0.1)
            fit[2] = max(fit[2] + min(max(step[2], -quarter), quarter), 0.02)
            for a in range(3, 6):
                fit[a] += step[a]
    # The scatter of the parts, of which two unknowns are spent for an edge, and that of the points
    covariance[:] = 0.0
    for b in range(N_SLICES):
        solve(normal, scores[b], step)
        for a in range(6):
            for c in range(6):
                covariance[a, c] += N_SLICES / (N_SLICES - 2.0) * step[a] * step[c]
    for a in range(6):
        right[:] = 0.0
        right[a] = variance
        solve(normal, right, step)
        for c in range(6):
            covariance[a, c] += step[c]
    return number
