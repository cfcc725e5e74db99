"""The period of a dashed line: paint along the line, folded over every period in use.

Of a dashed line one stretch of the period is free of paint in every repetition, however worn the dashes are; of a
worn solid line no stretch is.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import BoolArray, FloatArray, IntArray

#: Fewest bins of a period: a dash and a gap of two bins each.
LEAST_BINS = 4
#: Periods are tried so densely that the last repetition is off by at most this share of the period.
PHASE_DRIFT = 0.1
#: Periods that paint is folded over at a time: each step of a phase waits for the one before, four phases do not wait for
#: one another.
_AT_A_TIME = 4
#: Places in a bin are counted in so many bits, those with paint in the bits above.
_PAINT_BITS = 32


@njit(cache=True, nogil=True)
def fold_paint(is_paint: BoolArray, step_m: float, periods_m: FloatArray, bins: IntArray) -> None:
    """Fold paint over four periods: count its places in bins of the period, and those of them with paint.

    Parameters
    ----------
    is_paint
        (n,) bool: whether there is paint, every `step_m` along the line. [m]
    periods_m
        (4,) periods. [m]
    bins
        (4, k) int64, written: in each of the `bins_of_period` bins of a period the number of places, plus
        2 ** `_PAINT_BITS` times the number of those with paint.
    """
    n_a, n_b = float(bins_of_period(periods_m[0], step_m)), float(bins_of_period(periods_m[1], step_m))
    n_c, n_d = float(bins_of_period(periods_m[2], step_m)), float(bins_of_period(periods_m[3], step_m))
    # The phases are carried along: a remainder at every place takes ten times as long
    by_a, by_b = step_m / periods_m[0] * n_a, step_m / periods_m[1] * n_b
    by_c, by_d = step_m / periods_m[2] * n_c, step_m / periods_m[3] * n_d
    a = b = c = d = 0.0
    bins[:] = 0
    for i in range(len(is_paint)):
        one = 1 + (1 << _PAINT_BITS) if is_paint[i] else 1
        bins[0, np.uint64(a)] += one
        bins[1, np.uint64(b)] += one
        bins[2, np.uint64(c)] += one
        bins[3, np.uint64(d)] += one
        a, b, c, d = a + by_a, b + by_b, c + by_c, d + by_d
        a = a - n_a if a >= n_a else a
        b = b - n_b if b >= n_b else b
        c = c - n_c if c >= n_c else c
        d = d - n_d if d >= n_d else d


@njit(cache=True, nogil=True)
def bins_of_period(period_m: float, step_m: float) -> int:
    """Return the number of bins of a period [m], paint being given every `step_m`: two steps each."""
    return max(round(period_m / (2.0 * step_m)), LEAST_BINS)


@njit(cache=True, nogil=True)
def best_rhythm(
    is_paint: BoolArray, step_m: float, periods_m: tuple[float, float], least: tuple[float, float, float],
    paint: tuple[float, float], most_dash_m: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Return period, length of the gap [m] and shares of paint of the rhythm with the highest contrast; zeros if none.

    Parameters
    ----------
    is_paint
        (n,) bool: whether there is paint, every `step_m` along the line.
    periods_m
        Shortest and longest period. [m]
    least
        Shortest dash, shortest gap [m], smallest share of the gap in the period.
    paint
        Largest share of paint in the gaps, smallest contrast.
    most_dash_m
        Longest dash. [m]

    Notes
    -----
    The shares are those in the dashes and in the gaps; the contrast is their difference.
    """
    shortest_m, longest_m = periods_m
    least_dash, least_gap, least_gap_share = least
    most_gap_paint, least_contrast = paint
    n = len(is_paint)
    length = n * step_m
    best_period = best_gap = best_inside = best_outside = 0.0
    periods = np.empty(_AT_A_TIME)
    bins = np.empty((_AT_A_TIME, bins_of_period(max(longest_m, shortest_m), step_m)), dtype=np.int64)
    period = shortest_m
    while period <= longest_m:
        # The next four; those beyond the longest are the first again, and not looked at
        n_tried, periods[:] = 0, period
        while n_tried < _AT_A_TIME and period <= longest_m:
            periods[n_tried] = period
            n_tried += 1
            period += PHASE_DRIFT * period * period / length
        fold_paint(is_paint, step_m, periods, bins)
        for j in range(n_tried):
            tried, n_bins = periods[j], bins_of_period(periods[j], step_m)
            count, total = bins[j] & ((1 << _PAINT_BITS) - 1), bins[j] >> _PAINT_BITS
            # The longest run of bins free of paint, across the end of the period
            run = longest = last = 0
            for k in range(2 * n_bins):
                b = k if k < n_bins else k - n_bins
                if total[b] <= most_gap_paint * count[b]:
                    run += 1
                    if run > longest:
                        longest, last = run, k
                else:
                    run = 0
            longest = min(longest, n_bins)
            gap = longest * tried / n_bins
            is_gap = gap >= max(least_gap, least_gap_share * tried)
            if not is_gap or not least_dash <= tried - gap <= most_dash_m:
                continue
            inside = outside = n_inside = n_outside = 0.0
            for k in range(n_bins):
                b = (last + 1 + k) % n_bins
                if k < n_bins - longest:
                    inside, n_inside = inside + total[b], n_inside + count[b]
                else:
                    outside, n_outside = outside + total[b], n_outside + count[b]
            inside, outside = inside / max(n_inside, 1.0), outside / max(n_outside, 1.0)
            if inside - outside >= least_contrast and inside - outside > best_inside - best_outside:
                best_period, best_gap, best_inside, best_outside = tried, gap, inside, outside
    return best_period, best_gap, best_inside, best_outside
