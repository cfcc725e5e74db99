"""The period of a dashed line: paint along the line, folded over every period in use.

Of a dashed line one stretch of the period is free of paint in every repetition, however worn the dashes are; of a
worn solid line no stretch is.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import BoolArray

#: Fewest bins of a period: a dash and a gap of two bins each.
LEAST_BINS = 4
#: Periods are tried so densely that the last repetition is off by at most this share of the period.
PHASE_DRIFT = 0.1


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
    period = shortest_m
    while period <= longest_m:
        n_bins = max(round(period / (2.0 * step_m)), LEAST_BINS)
        count, total = np.zeros(n_bins), np.zeros(n_bins)
        # The phase is carried along: a remainder at every place takes ten times as long
        phase, per_step = 0.0, step_m / period * n_bins
        for i in range(n):
            k = int(phase)
            count[k] += 1.0
            total[k] += is_paint[i]
            phase += per_step
            if phase >= n_bins:
                phase -= n_bins
        # The longest run of bins free of paint, across the end of the period
        run = longest = 0
        last = 0
        for k in range(2 * n_bins):
            b = k % n_bins
            if total[b] <= most_gap_paint * count[b]:
                run += 1
                if run > longest:
                    longest, last = run, k
            else:
                run = 0
        longest = min(longest, n_bins)
        gap = longest * period / n_bins
        if gap >= max(least_gap, least_gap_share * period) and least_dash <= period - gap <= most_dash_m:
            inside = outside = n_inside = n_outside = 0.0
            for k in range(n_bins):
                b = (last + 1 + k) % n_bins
                if k < n_bins - longest:
                    inside, n_inside = inside + total[b], n_inside + count[b]
                else:
                    outside, n_outside = outside + total[b], n_outside + count[b]
            inside, outside = inside / max(n_inside, 1.0), outside / max(n_outside, 1.0)
            if inside - outside >= least_contrast and inside - outside > best_inside - best_outside:
                best_period, best_gap, best_inside, best_outside = period, gap, inside, outside
        period += PHASE_DRIFT * period * period / length
    return best_period, best_gap, best_inside, best_outside
