"""Paint along a line folded over every period: a gap that comes again in every repetition."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import BoolArray


@njit(cache=True, nogil=True)
def best_rhythm(
    is_paint: BoolArray, step_m: float, periods_m: tuple[float, float], least: tuple[float, float, float],
    paint: tuple[float, float],
) -> tuple[float, float, float]:  # fmt: skip
    """Return period [m], length of its free part [m] and contrast of the most contrasty rhythm; zeros if none.

    Parameters
    ----------
    is_paint
        (n,) whether there is paint, every `step_m` along the line.
    periods_m
        Shortest and longest period.
    least
        Shortest dash, shortest gap [m], least share of the gap in the period.
    paint
        Most paint in the gaps, least contrast.
    """
    n = len(is_paint)
    length = n * step_m
    best_period = best_gap = best_contrast = 0.0
    period = periods_m[0]
    while period <= periods_m[1]:
        n_bins = max(round(period / (2.0 * step_m)), 4)
        count, total = np.zeros(n_bins), np.zeros(n_bins)
        # The phase is carried on: a remainder for every place takes ten times as long
        phase, per_step = 0.0, step_m / period * n_bins
        for i in range(n):
            k = int(phase)
            count[k] += 1.0
            total[k] += is_paint[i]
            phase += per_step
            if phase >= n_bins:
                phase -= n_bins
        # The longest run of free bins, round the end
        run = longest = 0
        last = 0
        for k in range(2 * n_bins):
            b = k % n_bins
            if total[b] <= paint[0] * count[b]:
                run += 1
                if run > longest:
                    longest, last = run, k
            else:
                run = 0
        longest = min(longest, n_bins)
        gap = longest * period / n_bins
        if gap >= max(least[1], least[2] * period) and period - gap >= least[0]:
            inside = outside = n_inside = n_outside = 0.0
            for k in range(n_bins):
                b = (last + 1 + k) % n_bins
                if k < n_bins - longest:
                    inside, n_inside = inside + total[b], n_inside + count[b]
                else:
                    outside, n_outside = outside + total[b], n_outside + count[b]
            contrast = inside / max(n_inside, 1.0) - outside / max(n_outside, 1.0)
            if contrast >= paint[1] and contrast > best_contrast:
                best_period, best_gap, best_contrast = period, gap, contrast
        # So fine that the last repetition is off by a tenth of the period at most
        period += 0.1 * period * period / length
    return best_period, best_gap, best_contrast
