"""Bands of a profile across a search area that lie within others: two near lines, and lines on brighter strips.

Separate from `stripe_search`, which finds the bands that stand out most: this looks into them.
"""

from __future__ import annotations

import math

from numba import njit

from linework.arrays import FloatArray, IntArray

#: Bins of road beside a stripe that it is compared with: 0.10 m in a search area of 0.5 m (the lines of a double
#: line are 0.1 m and more apart).
N_SIDE = 4
#: Fewest points inside and on each side of a stripe.
BAND_POINTS = 3.0
#: Fewest bins of a shoulder: 0.2 m in a search area of 0.5 m, 0.4 m in one of 1 m, where the spot of a beam from the air blurs
#: edges over 0.2 to 0.3 m. Of 4 and 8, 8 lost less (als-roads-t0717-junction and -t1664, 2026-11-30).
LEAST_SHOULDER = 8


@njit(cache=True, nogil=True)
def difference_t(mean: float, n: float, other: float, n_other: float, variance: float) -> float:
    """Return how much brighter the mean of n points is than that of others, over its standard deviation."""
    return float((mean - other) / math.sqrt(variance * (1.0 / n + 1.0 / n_other)))


@njit(cache=True, nogil=True)
def dark_gap(
    number: FloatArray,
    total: FloatArray,
    variance: float,
    rises: IntArray,
    falls: IntArray,
    outer: tuple[int, int],
    least_t: float,
) -> tuple[int, int, float]:
    """Return the gap that is darker than both lines of a band, its first and last border and t-value; -1 without one.

    Parameters
    ----------
    number, total
        (m + 1,): see `linework.kernels.paint.stripe_search.edges_of`.
    variance
        Of the brightness within the bins.
    rises, falls
        Borders where the profile rises and falls most.
    outer
        First and last border of the band.
    least_t
        Smallest t-value.
    """
    low, high = outer
    best, first, last = least_t, -1, -1
    for a in falls:
        n_right = number[a] - number[low]
        if a <= low or a >= high or n_right < BAND_POINTS:
            continue
        right = (total[a] - total[low]) / n_right
        for b in rises:
            n_gap, n_left = number[b] - number[a], number[high] - number[b]
            if b <= a or b >= high or n_gap < BAND_POINTS or n_left < BAND_POINTS:
                continue
            gap, left = (total[b] - total[a]) / n_gap, (total[high] - total[b]) / n_left
            if gap >= right or gap >= left:
                continue
            t = min(
                difference_t(right, n_right, gap, n_gap, variance),
                difference_t(left, n_left, gap, n_gap, variance),
            )
            if t > best:
                best, first, last = t, a, b
    return first, last, best


@njit(cache=True, nogil=True)
def narrower_band(
    number: FloatArray,
    total: FloatArray,
    variance: float,
    rises: IntArray,
    falls: IntArray,
    outer: tuple[int, int],
    least_t: float,
) -> tuple[int, int, float]:
    """Return the band that stands out most inside a wider one, its first and last border and t-value; -1 without one.

    Paint on a strip that is brighter than the road (dry, dusty, between wheel tracks): the strip stands out more from
    the road than the paint from the strip. It does so without the paint, too, by the same t-value: else it is the paint
    with noise at its edges.

    Parameters
    ----------
    number, total
        (m + 1,): see `linework.kernels.paint.stripe_search.edges_of`.
    variance
        Of the brightness within the bins.
    rises, falls
        Borders where the profile rises and falls most.
    outer
        First and last border of the wider band.
    least_t
        Smallest t-value.
    """
    low, high = outer
    best, first, last = least_t, -1, -1
    below, above = max(low - N_SIDE, 0), min(high + N_SIDE, len(number) - 1)
    n_road_right, n_road_left = number[low] - number[below], number[above] - number[high]
    if n_road_right < BAND_POINTS or n_road_left < BAND_POINTS:
        return first, last, best
    road_right, road_left = (
        (total[low] - total[below]) / n_road_right,
        (total[above] - total[high]) / n_road_left,
    )
    for a in rises:
        n_right = number[a] - number[max(a - N_SIDE, low)]
        if a <= low or a >= high or n_right < BAND_POINTS:
            continue
        right = (total[a] - total[max(a - N_SIDE, low)]) / n_right
        for b in falls:
            n_in, n_left = number[b] - number[a], number[min(b + N_SIDE, high)] - number[b]
            if b <= a or b >= high or n_in < BAND_POINTS or n_left < BAND_POINTS:
                continue
            mean, left = (total[b] - total[a]) / n_in, (total[min(b + N_SIDE, high)] - total[b]) / n_left
            if mean <= right or mean <= left:
                continue
            t = min(
                difference_t(mean, n_in, right, n_right, variance),
                difference_t(mean, n_in, left, n_left, variance),
            )
            n_rest = number[high] - number[low] - n_in
            rest = (total[high] - total[low] - total[b] + total[a]) / n_rest
            off = min(
                difference_t(rest, n_rest, road_right, n_road_right, variance),
                difference_t(rest, n_rest, road_left, n_road_left, variance),
            )
            if t > best and off > least_t:
                best, first, last = t, a, b
    return first, last, best


@njit(cache=True, nogil=True)
def band_on_shoulder(
    number: FloatArray,
    total: FloatArray,
    variance: float,
    rises: IntArray,
    falls: IntArray,
    outer: tuple[int, int],
    least_t: float,
) -> tuple[int, int, float]:
    """Return the band along one side of a wider one, its first and last border and t-value; -1 without one.

    Paint beside dust, stones or a place that dries: the paint ends on one side only, and with all of the strip beside it
    stands out more than alone. The strip stands out from the road on both sides without the paint, too.

    Parameters
    ----------
    number, total
        (m + 1,): see `linework.kernels.paint.stripe_search.edges_of`.
    variance
        Of the brightness within the bins.
    rises, falls
        Borders where the profile rises and falls most.
    outer
        First and last border of the wider band.
    least_t
        Smallest t-value.
    """
    low, high = outer
    best, first, last = least_t, -1, -1
    right = mean_between(number, total, max(low - N_SIDE, 0), low)
    left = mean_between(number, total, high, min(high + N_SIDE, len(number) - 1))
    for k in range(len(falls) + len(rises)):
        # The paint is on the right, and falls towards the shoulder, or on the left
        is_right = k < len(falls)
        border = falls[k] if is_right else rises[k - len(falls)]
        a, b, begin, end = (low, border, border, high) if is_right else (border, high, low, border)
        if b <= a or end - begin < LEAST_SHOULDER:
            continue
        near = (begin, begin + N_SIDE) if is_right else (end - N_SIDE, end)
        paint, beside = mean_between(number, total, a, b), mean_between(number, total, near[0], near[1])
        shoulder, road, beyond = mean_between(number, total, begin, end), right, left
        if not is_right:
            road, beyond = left, right
        if min(paint[1], beside[1], shoulder[1], road[1], beyond[1]) < BAND_POINTS:
            continue
        t = min(
            difference_t(paint[0], paint[1], road[0], road[1], variance),
            difference_t(paint[0], paint[1], beside[0], beside[1], variance),
        )
        off = min(
            difference_t(shoulder[0], shoulder[1], road[0], road[1], variance),
            difference_t(shoulder[0], shoulder[1], beyond[0], beyond[1], variance),
        )
        if t > best and off > least_t:
            best, first, last = t, a, b
    return first, last, best


@njit(cache=True, nogil=True)
def mean_between(number: FloatArray, total: FloatArray, a: int, b: int) -> tuple[float, float]:
    """Return the mean brightness of the points between two borders, and their number; `number`, `total`: (m + 1,) as above."""
    n = number[b] - number[a]
    return (total[b] - total[a]) / max(n, 1.0), n
