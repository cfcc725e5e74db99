"""Paint folded over periods: four at a time count what each alone does."""

import numpy as np

from linework.kernels.paint.rhythm import best_rhythm, bins_of_period, fold_paint

STEP_M = 0.1


def test_periods_folded_together_count_what_each_alone_does():
    is_paint = np.random.default_rng(1).random(3000) < 0.4
    periods = np.array([1.8, 4.37, 9.0, 23.1])
    bins = np.empty((4, bins_of_period(25.0, STEP_M)), dtype=np.int64)
    fold_paint(is_paint, STEP_M, periods, bins)
    for period, found in zip(periods, bins, strict=True):
        n_bins = bins_of_period(period, STEP_M)
        count, total, phase = np.zeros(n_bins), np.zeros(n_bins), 0.0
        for painted in is_paint.tolist():
            count[int(phase)] += 1
            total[int(phase)] += painted
            phase += STEP_M / period * n_bins
            if phase >= n_bins:
                phase -= n_bins
        np.testing.assert_array_equal(found[:n_bins] & 0xFFFFFFFF, count)
        np.testing.assert_array_equal(found[:n_bins] >> 32, total)
        assert not found[n_bins:].any()


def test_the_last_periods_are_looked_at_however_many_there_are():
    # Of a line of dashes that repeat three times, the period is among the longest that are tried
    place = (np.arange(270) + 0.5) * STEP_M
    is_paint = place % 9.0 < 3.0
    for longest in np.linspace(8.99, 9.4, 8).tolist():
        period, gap, inside, outside = best_rhythm(
            is_paint, STEP_M, (6.0, longest), (0.5, 0.5, 0.28), (0.16, 0.25), 8.0
        )
        assert abs(period - 9.0) < 0.3 and abs(gap - 6.0) < 0.4 and inside - outside > 0.85
