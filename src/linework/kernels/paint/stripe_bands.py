"""Bands of a profile across a search area that lie within others: two near lines, and lines on brighter strips.

Separate from `stripe_search`, which finds the bands that stand out most: this looks into them.
"""

from __future__ import annotations

import math

from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.tracking.small_systems import inverse_of_three

#: Bins of road beside a stripe that it is compared with: 0.10 m in a search area of 0.5 m (the lines of a double
#: line are 0.1 m and more apart).
N_SIDE = 4
#: Fewest points inside and on each side of a stripe.
BAND_POINTS = 3.0
#: Added to the diagonal of the equations of a parabola, in points, so that too few of them leave it unsure, not undefined.
RIDGE = 1e-3
#: Fewest bins of a shoulder: 0.2 m in a search area of 0.5 m, 0.4 m in one of 1 m, where the spot of a beam from the air blurs
#: edges over 0.2 to 0.3 m. Of 4 and 8, 8 lost less (als-roads-t0717-junction and -t1664, 2026-11-30).
LEAST_SHOULDER = 8


@njit(cache=True, nogil=True)
def difference_t(mean: float, n: float, other: float, n_other: float, variance: float) -> float:
    """Return how much brighter the mean of n points is than that of others, over its standard deviation."""
    return float((mean - other) / math.sqrt(variance * (1.0 / n + 1.0 / n_other)))


@njit(cache=True, nogil=True)
def mean_between(number: FloatArray, total: FloatArray, a: int, b: int) -> tuple[float, float]:
    """Return the mean brightness of the points between two borders, and their number; 0 and 0 without any.

    number, total: (m + 1,) see `linework.kernels.paint.stripe_search.edges_of`.
    """
    n = number[b] - number[a]
    return (total[b] - total[a]) / max(n, 1.0), n


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
        if a <= low or a >= high:
            continue
        right, n_right = mean_between(number, total, low, a)
        for b in rises:
            if b <= a or b >= high:
                continue
            gap, n_gap = mean_between(number, total, a, b)
            left, n_left = mean_between(number, total, b, high)
            if min(n_right, n_gap, n_left) < BAND_POINTS:
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
    beside: int,
    least_t: float,
) -> tuple[int, int, float]:
    """Return the band that stands out most inside a wider one, its first and last border and t-value; -1 without one.

    Paint on a strip that is brighter than the road (dry, dusty, between wheel tracks): the strip stands out more from
    the road than the paint from the strip. It does so without the paint, too, by the same t-value: else it is the paint
    with noise at its edges. Arguments as for `dark_gap`, and

    beside
        Fewest bins of the strip on either side of the band.
    """
    low, high = outer
    best, first, last = least_t, -1, -1
    road_right, n_road_right = mean_between(number, total, max(low - N_SIDE, 0), low)
    road_left, n_road_left = mean_between(number, total, high, min(high + N_SIDE, len(number) - 1))
    if min(n_road_right, n_road_left) < BAND_POINTS:
        return first, last, best
    for a in rises:
        if a < low + beside or a >= high:
            continue
        right, n_right = mean_between(number, total, max(a - N_SIDE, low), a)
        for b in falls:
            if b <= a or b > high - beside:
                continue
            mean, n_in = mean_between(number, total, a, b)
            left, n_left = mean_between(number, total, b, min(b + N_SIDE, high))
            if min(n_right, n_in, n_left) < BAND_POINTS:
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
            if beside > 1 and t > best:
                t = min(t, t_over_bow(number, total, variance, outer, (a, b), (beside + 1) // 2))
            if t > best and off > least_t:
                best, first, last = t, a, b
    return first, last, best


@njit(cache=True, nogil=True)
def t_over_bow(
    number: FloatArray,
    total: FloatArray,
    variance: float,
    outer: tuple[int, int],
    inner: tuple[int, int],
    blurred: int,
) -> float:
    """Return how much brighter a band is than the strip that it lies on would be there, over its standard deviation.

    A strip between wheel tracks rises towards its middle: its brightness beside the band, but for the bins over which the
    band's edges are blurred, is that of a parabola, which goes on under the band.

    Parameters
    ----------
    number, total, variance
        As for `dark_gap`.
    outer, inner
        First and last border of the strip, and of the band.
    blurred
        Bins on either side of the band that are left out.
    """
    low, high = outer
    middle, scale = 0.5 * (low + high), 0.5 * (high - low)
    # Sums of the powers of the place, and of the brightness times these, beside the band; and of the places in it
    n0 = n1 = n2 = n3 = n4 = s0 = s1 = s2 = in1 = in2 = 0.0
    for b in range(low, high):
        x, n = (b + 0.5 - middle) / scale, number[b + 1] - number[b]
        if inner[0] <= b < inner[1]:
            in1, in2 = in1 + n * x, in2 + n * x * x
        elif not inner[0] - blurred <= b < inner[1] + blurred:
            n0, n1, n2, n3, n4 = n0 + n, n1 + n * x, n2 + n * x**2, n3 + n * x**3, n4 + n * x**4
            brightness = total[b + 1] - total[b]
            s0, s1, s2 = s0 + brightness, s1 + brightness * x, s2 + brightness * x * x
    mean, n_in = mean_between(number, total, inner[0], inner[1])
    in1, in2 = in1 / n_in, in2 / n_in
    c00, c01, c02, c11, c12, c22 = inverse_of_three(n0 + RIDGE, n1, n2, n2 + RIDGE, n3, n4 + RIDGE)
    weight0 = c00 + c01 * in1 + c02 * in2
    weight1 = c01 + c11 * in1 + c12 * in2
    weight2 = c02 + c12 * in1 + c22 * in2
    expected = weight0 * s0 + weight1 * s1 + weight2 * s2
    uncertain = weight0 + weight1 * in1 + weight2 * in2
    return float((mean - expected) / math.sqrt(variance * (1.0 / n_in + max(uncertain, 0.0))))


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

    Paint beside dust, stones or a place that dries: the paint ends on one side only, and stands out more together with
    the strip beside it than alone. Without the paint, too, the strip, its shoulder, stands out from the road on both sides.
    Arguments as for `dark_gap`.
    """
    low, high = outer
    best, first, last = least_t, -1, -1
    road_right, n_road_right = mean_between(number, total, max(low - N_SIDE, 0), low)
    road_left, n_road_left = mean_between(number, total, high, min(high + N_SIDE, len(number) - 1))
    if min(n_road_right, n_road_left) < BAND_POINTS:
        return first, last, best
    for k in range(len(falls) + len(rises)):
        # The paint is on the right of the band, and falls towards the shoulder, or on the left
        is_right = k < len(falls)
        border = falls[k] if is_right else rises[k - len(falls)]
        a, b, begin, end = (low, border, border, high) if is_right else (border, high, low, border)
        if b <= a or end - begin < LEAST_SHOULDER:
            continue
        paint, n_paint = mean_between(number, total, a, b)
        shoulder, n_shoulder = mean_between(number, total, begin, end)
        near = (begin, begin + N_SIDE) if is_right else (end - N_SIDE, end)
        beside, n_beside = mean_between(number, total, near[0], near[1])
        if min(n_paint, n_beside) < BAND_POINTS:
            continue
        road, n_road = (road_right, n_road_right) if is_right else (road_left, n_road_left)
        t = min(
            difference_t(paint, n_paint, road, n_road, variance),
            difference_t(paint, n_paint, beside, n_beside, variance),
        )
        off = min(
            difference_t(shoulder, n_shoulder, road_right, n_road_right, variance),
            difference_t(shoulder, n_shoulder, road_left, n_road_left, variance),
        )
        if t > best and off > least_t:
            best, first, last = t, a, b
    return first, last, best
