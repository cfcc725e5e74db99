"""One stripe of paint, precisely: its two edges, where it begins and ends."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.paint.stripe_search import POINT_X, POINT_Y, POINT_Z, Q
from linework.kernels.tracking.cholesky import factor, solve

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
        v = work[i, POINT_Y] * ux - work[i, POINT_X] * uy
        if v > limits[0] and v < limits[1]:
            u = work[i, POINT_X] * ux + work[i, POINT_Y] * uy
            if abs(u) < radius:
                strip[m, 0], strip[m, 1], strip[m, 2], strip[m, 3] = u, v, work[i, Q], work[i, POINT_Z]
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


# What is beside a stripe of paint: worn edges, other bright ground, steps; and the stripe's height


@njit(cache=True, nogil=True)
def edge_variance(strip: FloatArray, stretch: tuple[float, float], across: float, fit: FloatArray) -> float:
    """Return the variance of a stripe's centre that the fit does not see: gaps between points, and worn edges.

    Across the road points follow each other at a distance a, at random: an edge half way between the last one on
    the paint and the next one beside it is off by a / sqrt(2), the centre between two edges by a / 2. And where a
    share f of the paint between the edges is gone, as much may be gone beyond one of them: f / (1 - f) of the
    width, evenly distributed.
    """
    inside, paint, gone = 0, 1, 0
    middle = 0.5 * fit[5] + 0.25 * (fit[3] + fit[4])
    for i in range(len(strip)):
        u = strip[i, 0]
        if u > stretch[0] and u < stretch[1]:
            inside += 1
            if abs(strip[i, 1] - fit[0] - fit[1] * u) < 0.45 * fit[2]:
                paint += 1
                gone += strip[i, 2] < middle
    apart = across / max(inside, 1)
    worn = min(gone / paint, 0.6)
    return float((0.5 * apart) ** 2 + (worn / (1.0 - worn) * fit[2]) ** 2 / 12.0)


@njit(cache=True, nogil=True)
def bright_beside(strip: FloatArray, stretch: tuple[float, float], fit: FloatArray, side: float) -> float:
    """Return the share of points within `side` of a stripe's edges that look like its paint, on the worse side.

    The road beside paint has next to none, whatever its level; a strip of grass beside other grass has many.
    """
    counts = np.zeros((2, 2))
    for i in range(len(strip)):
        d = strip[i, 1] - fit[0] - fit[1] * strip[i, 0]
        beyond = abs(d) - 0.5 * fit[2]
        if beyond > 0.0 and beyond < side and strip[i, 0] > stretch[0] and strip[i, 0] < stretch[1]:
            k = 0 if d > 0.0 else 1
            counts[k, 0] += 1.0
            counts[k, 1] += 1.0 if strip[i, 2] > 0.5 * (fit[5] + fit[3 + k]) else 0.0
    left, right = counts[0, 1] / max(counts[0, 0], 1.0), counts[1, 1] / max(counts[1, 0], 1.0)
    return float(max(left, right))


@njit(cache=True, nogil=True)
def height_of(
    strip: FloatArray, stretch: tuple[float, float], fit: FloatArray, at: float, side: float
) -> tuple[float, float, float, float]:
    """Return the height of the stripe's centre at `at` and its sigma; the height of a kerb here and its sigma.

    What lies within `side` of the stripe counts. Paint lies in one plane with the road on both its sides.
    """
    normal, right, solution, row = np.zeros((4, 4)), np.zeros(4), np.zeros(4), np.ones(4)
    half = 0.5 * fit[2]
    points, number = np.empty((len(strip), 3)), 0
    for i in range(len(strip)):
        u = strip[i, 0]
        d = strip[i, 1] - fit[0] - fit[1] * u
        if u >= stretch[0] and u <= stretch[1] and abs(d) <= half + side:
            points[number, 0], points[number, 1] = u - at, d
            points[number, 2] = strip[i, 3] - strip[0, 3]
            number += 1
    if number < 8:
        return strip[0, 3], 0.05, 0.0, 1.0
    points = points[:number]
    # The plane through all points
    for i in range(number):
        row[1], row[2], row[3] = points[i, 0], points[i, 1], 0.0
        _add(row, points[i, 2], normal, right)
    _solve(normal, right, solution)
    zones = np.zeros((4, 3))
    total = 0.0
    for i in range(number):
        off = points[i, 2] - solution[0] - solution[1] * points[i, 0] - solution[2] * points[i, 1]
        d = points[i, 1]
        zone = (0 if d < -half else 1) if d < 0.0 else (2 if d < half else 3)
        zones[zone, 0] += 1.0
        zones[zone, 1] += off
        zones[zone, 2] += off * off
        total += off * off
    z, variance = strip[0, 3] + solution[0], total / max(number - 3, 1) + 1e-8
    right[:] = 0.0
    right[0] = variance
    solve(normal, right, solution)
    sigma = math.sqrt(solution[0])
    # A step between the planes of the two sides
    normal[:], right[:] = 0.0, 0.0
    for i in range(number):
        if abs(points[i, 1]) >= half:
            row[1], row[2], row[3] = points[i, 0], points[i, 1], 0.5 if points[i, 1] > 0.0 else -0.5
            _add(row, points[i, 2], normal, right)
    _solve(normal, right, solution)
    height, noise = kerb_from_bend(zones)
    step = abs(solution[3])
    right[:] = 0.0
    right[3] = noise * noise
    solve(normal, right, solution)
    sigma_step, sigma_height = math.sqrt(solution[3]), noise / 0.3 / math.sqrt(0.25 * number)
    if step - 3.0 * sigma_step > height - 3.0 * sigma_height:
        return z, sigma, step, sigma_step
    return z, sigma, height, sigma_height


@njit(cache=True, nogil=True)
def _add(row: FloatArray, value: float, normal: FloatArray, right: FloatArray) -> None:
    """Add an observation to normal equations of four unknowns."""
    for a in range(4):
        right[a] += row[a] * value
        for b in range(a + 1):
            normal[a, b] += row[a] * row[b]


@njit(cache=True, nogil=True)
def _solve(normal: FloatArray, right: FloatArray, out: FloatArray) -> None:
    """Solve normal equations in place, unknowns without observations become 0."""
    for a in range(4):
        normal[a, a] += 1e-4
    factor(normal)
    solve(normal, right, out)


@njit(cache=True, nogil=True)
def kerb_from_bend(zones: FloatArray) -> tuple[float, float]:
    """Return the height of a kerb that would bend four zones off their plane as far, and the noise.

    zones: number, sum and sum of squares of the distances from the plane: right of the stripe, its right and left
    half, left of it. A kerb leaves 0.3 of its height in one of them. The noise is that on both sides; where the
    stripe is twice as rough (the face of a kerb, grass), it is as if half of that were a bend.
    """
    # Degrees of freedom and squares of what scatters: beside the stripe, and on it
    free, square, largest = np.zeros(2), np.zeros(2), 0.0
    for k in range(4):
        if zones[k, 0] >= 3.0:
            on = 1 if k == 1 or k == 2 else 0
            mean = zones[k, 1] / zones[k, 0]
            free[on] += zones[k, 0] - 1.0
            square[on] += max(zones[k, 2] - mean * zones[k, 1], 0.0)
            largest = max(largest, abs(mean))
    if free[0] < 3.0:
        return 0.0, 1.0
    noise = math.sqrt(square[0] / free[0] + 1e-8)
    if free[1] > 0.0 and square[1] / free[1] > 3.0 * noise * noise:
        largest = max(largest, 0.5 * math.sqrt(square[1] / free[1] - noise * noise))
    return largest / 0.3, noise
