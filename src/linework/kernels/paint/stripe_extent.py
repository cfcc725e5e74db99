"""Where along its direction a stripe begins and ends, and where a dash does."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.paint.stripe_fit import (
    FIT_OFFSET,
    FIT_PAINT,
    FIT_ROAD_LEFT,
    FIT_ROAD_RIGHT,
    FIT_SLOPE,
    FIT_WIDTH,
    MIDDLE_SHARE,
    N_ALONG,
    N_SLICES,
    STRIP_BRIGHTNESS,
    STRIP_U,
    STRIP_V,
    THINNEST_M,
)

#: Paint is followed to the border of the search area if that is no farther than this many of its largest gaps.
BORDER_GAPS = 1.5
#: Shortest gap between dashes in use [m]; fewest points that show one: a stray one or two do not; and their brightness at
#: most, of road (0) and paint (1).
LEAST_GAP_M, GAP_POINTS, GAP_BRIGHTNESS = 0.8, 3.0, 0.25


@njit(cache=True, nogil=True)
def add_brightness(
    strip: FloatArray,
    radius: float,
    fit: FloatArray,
    bins: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
) -> None:
    """Add up, in bins along a stripe, the brightness of the points on it above the mean of road and paint.

    Parameters
    ----------
    strip, radius, fit
        See `extent`.
    bins
        (N_ALONG,) each, output: sums, numbers of points, and the first and the last point of each bin [m].
    """
    value, number, low, high = bins
    value[:], number[:], low[:], high[:] = 0.0, 0.0, np.inf, -np.inf
    size = 2.0 * radius / N_ALONG
    half = max(MIDDLE_SHARE * fit[FIT_WIDTH], THINNEST_M)
    middle = 0.5 * fit[FIT_PAINT] + 0.25 * (fit[FIT_ROAD_LEFT] + fit[FIT_ROAD_RIGHT])
    for i in range(len(strip)):
        u = strip[i, STRIP_U]
        if abs(strip[i, STRIP_V] - fit[FIT_OFFSET] - fit[FIT_SLOPE] * u) <= half:
            b = min(int((u + radius) / size), N_ALONG - 1)
            value[b] += strip[i, STRIP_BRIGHTNESS] - middle
            number[b] += 1.0
            low[b], high[b] = min(low[b], u), max(high[b], u)


@njit(cache=True, nogil=True)
def dash_at(
    strip: FloatArray, radius: float, fit: FloatArray, stretch: tuple[float, float], at: float
) -> tuple[float, float]:
    """Return the part of a stripe nearest to a place, from the gap before it to the gap behind it [m].

    One begin and one end are the most likely of a stretch that holds two dashes as well, if the gap between them has
    fewer points than each of them. A gap is as long as the shortest in use, and three points or more of it are as dark as
    the road.

    Parameters
    ----------
    strip, radius, fit
        See `extent`.
    stretch
        Begin and end of the stripe, as `extent` returns them. [m]
    at
        The place. [m]
    """
    begin, end = stretch
    if end - begin <= LEAST_GAP_M:
        return begin, end
    size = 2.0 * radius / N_ALONG
    value, number, low, high = np.empty(N_ALONG), np.empty(N_ALONG), np.empty(N_ALONG), np.empty(N_ALONG)
    add_brightness(strip, radius, fit, (value, number, low, high))
    road = 0.5 * (fit[FIT_ROAD_LEFT] + fit[FIT_ROAD_RIGHT])
    darkest = (GAP_BRIGHTNESS - 0.5) * (fit[FIT_PAINT] - road)
    first, last = int((begin + radius) / size), min(int((end + radius) / size), N_ALONG - 1)
    own = -1
    for b in range(first, last + 1):
        if value[b] > 0.0 and (
            own < 0 or abs((b + 0.5) * size - radius - at) < abs((own + 0.5) * size - radius - at)
        ):
            own = b
    if own < 0:
        return begin, end
    for ahead in (1, -1):
        # The paint ends where the sum along it is highest before a gap
        total, best, dark, end_bin = 0.0, 0.0, 0.0, own - ahead
        edge, b = high[own] if ahead > 0 else low[own], own
        while first <= b <= last:
            if low[b] <= high[b]:
                total, dark = total + value[b], dark + number[b]
                if total > best:
                    best, dark, end_bin = total, 0.0, b
                    edge = high[b] if ahead > 0 else low[b]
                far = high[b] if ahead > 0 else low[b]
                is_dark = value[b] < 0.0 and dark >= GAP_POINTS and total - best <= darkest * dark
                if is_dark and abs(far - edge) >= LEAST_GAP_M:
                    after = end_bin + ahead
                    while low[after] > high[after]:
                        after += ahead
                    beyond = low[after] if ahead > 0 else high[after]
                    if ahead > 0:
                        end = min(end, 0.5 * (edge + beyond))
                    else:
                        begin = max(begin, 0.5 * (edge + beyond))
                    break
            b += ahead
    return begin, end


@njit(cache=True, nogil=True)
def extent(strip: FloatArray, radius: float, fit: FloatArray) -> tuple[float, float, int]:
    """Return where along its direction a stripe begins and ends [m], and how many of 8 parts between have points.

    The stretch with the largest sum of brightness above the mean of road and paint is the most likely one for paint
    that begins once and ends once; an end is half-way to the next point beyond.

    Parameters
    ----------
    strip
        (n, 4): see `strip_of`.
    radius
        Of the search area. [m]
    fit
        (6,): unknowns `FIT_OFFSET` to `FIT_PAINT`.
    """
    size = 2.0 * radius / N_ALONG
    value, number, low, high = np.empty(N_ALONG), np.empty(N_ALONG), np.empty(N_ALONG), np.empty(N_ALONG)
    add_brightness(strip, radius, fit, (value, number, low, high))
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
    # Without a point beyond, the paint is followed to the border if the next point would have lain there
    if after >= 0:
        end_m = 0.5 * (end_m + low[after])
    elif radius - end_m <= BORDER_GAPS * gap:
        end_m = radius
    if before >= 0:
        begin_m = 0.5 * (begin_m + high[before])
    elif radius + begin_m <= BORDER_GAPS * gap:
        begin_m = -radius
    return begin_m, end_m, parts
