"""Where the differences along a line are more than chance: significance adds up over stations that are independent.

Separate from `epochs`, which compares surveys: this looks at sequences of numbers.

References
----------
Sokal (1997), Monte Carlo methods in statistical mechanics, doi:10.1007/978-1-4899-0319-8_6: sums of autocorrelations up to
where they are lost in noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray

#: A line has changed over stretches whose differences chance gives this often in a kilometre of road.
FALSE_PER_KM = 0.25
#: Fewest differences from which their scale and relation are taken; with fewer, the stated deviations hold.
_FEWEST = 30
#: Least scale: differences far below their stated deviations are of copies, not of measurements.
_LEAST_SCALE = 0.5
#: Differences beyond this many deviations are changes, and say nothing about chance.
_CLIP = 3.0
#: Farthest places whose relation is looked at. [places]
_MOST_LAGS = 40
#: Sequences that are drawn to count what chance does, and their length: 2 km in pieces of 5 m. [places]
_N_DRAWN, _DRAWN_PLACES = 400, 400


@dataclass(frozen=True, slots=True)
class Chance:
    """Differences by chance, where nothing has changed.

    Parameters
    ----------
    scale
        Their standard deviation over the stated one.
    related
        (m,) correlation of differences 1 to m places apart; 0 beyond.
    """

    scale: float
    related: FloatArray

    def deviation(self, n: int) -> float:
        """Return the standard deviation of the mean of n differences in a row."""
        lags = np.arange(1, min(n, len(self.related) + 1))
        total = n + 2.0 * float(np.sum((n - lags) * self.related[: len(lags)]))
        return self.scale * float(np.sqrt(total)) / n


def related_of(sequences: Sequence[FloatArray]) -> FloatArray:
    """Return the correlations (m,) of differences 1 to m places apart, from all sequences; none where they are unrelated.

    Parameters
    ----------
    sequences
        Differences over their scale, place by place, one sequence for each line: most of a road has not changed.

    Examples
    --------
    >>> steps = np.repeat(np.random.default_rng(0).normal(size=400), 5)
    >>> [round(float(v), 1) for v in related_of([steps])[:4]]
    [0.8, 0.6, 0.4, 0.2]
    """
    clipped = [np.clip(s, -_CLIP, _CLIP) for s in sequences]
    every = np.concatenate([np.zeros(0), *clipped])
    size = float(np.mean(every**2)) if len(every) else 0.0
    related: list[float] = []
    for lag in range(1, _MOST_LAGS + 1):
        products = np.concatenate([np.zeros(0), *(s[lag:] * s[:-lag] for s in clipped if len(s) > lag)])
        if len(products) < _FEWEST or size <= 0.0:
            break
        # What correlations of so many pairs, which are related themselves, are where there is none
        noise = np.sqrt((1.0 + 2.0 * sum(related)) / len(products))
        value = float(products.mean()) / size
        if value < noise:
            break
        related.append(value)
    return np.array(related)


def scale_of(sequences: Sequence[FloatArray]) -> float:
    """Return the standard deviation of differences over the stated one; 1 where there are too few.

    >>> round(scale_of([2.0 * np.random.default_rng(0).normal(size=2000)]), 1)
    2.0
    """
    every = np.concatenate([np.zeros(0), *sequences])
    if len(every) < _FEWEST:
        return 1.0
    middle = max(1.4826 * float(np.median(np.abs(every))), 1e-12)
    return max(middle * float(np.sqrt(np.mean(np.clip(every / middle, -_CLIP, _CLIP) ** 2))), _LEAST_SCALE)


def least_deviations(n_places: int, related: FloatArray, n_allowed: float) -> float:
    """Return the number of deviations that means over runs of any length exceed by chance `n_allowed` times.

    Parameters
    ----------
    n_places
        Differences that are looked at, over all lines.
    related
        (m,) their correlations, see `related_of`.

    Notes
    -----
    Counted on drawn differences with these correlations, always the same.

    Examples
    --------
    >>> 3.0 < least_deviations(1200, np.zeros(0), 0.5) < 4.5
    True
    """
    n = _DRAWN_PLACES
    size = 4 * (n + len(related))
    covariance = np.zeros(size)
    covariance[0], covariance[1 : len(related) + 1] = 1.0, related
    covariance[size - len(related) :] = related[::-1]
    spectrum = np.maximum(np.fft.rfft(covariance).real, 0.0)
    white = np.fft.rfft(np.random.default_rng(0).normal(size=(_N_DRAWN, size)))
    drawn = np.fft.irfft(white * np.sqrt(spectrum), n=size)[:, :n]
    deviation = _deviations(Chance(1.0, related), n)
    highest = [
        found[2] for row in drawn for found in [_most_significant(row, deviation)] if found is not None
    ]
    share = n_allowed * n / max(n_places, 1)
    return float(np.quantile(highest, max(1.0 - share, 0.05)))


def _deviations(chance: Chance, n: int) -> FloatArray:
    """Return the deviations (n + 1,) of means of 0 to n differences in a row."""
    return np.array([np.inf, *(chance.deviation(k) for k in range(1, n + 1))])


def shifted_runs(values: FloatArray, chance: Chance, least: float) -> list[tuple[int, int]]:
    """Return the first and last place of each run over which a sequence is shifted, in order.

    Parameters
    ----------
    values
        (n,) differences over their stated deviations.
    least
        Deviations of a mean that are more than chance.

    Notes
    -----
    The run with the most significant mean is taken first, its ends where significance is greatest; then what is left on
    both of its sides.

    Examples
    --------
    >>> shifted_runs(np.concatenate([np.zeros(20), np.full(9, 2.0), np.zeros(20)]), Chance(1.0, np.zeros(0)), 4.0)
    [(20, 28)]
    """
    deviation = _deviations(chance, len(values))
    found, open_ = [], [(0, len(values))]
    while open_:
        first, end = open_.pop()
        run = _most_significant(values[first:end], deviation)
        if run is None or run[2] <= least:
            continue
        a, b = first + run[0], first + run[1]
        found.append((a, b))
        open_ += [(first, a), (b + 1, end)]
    return sorted(found)


def _most_significant(values: FloatArray, deviation: FloatArray) -> tuple[int, int, float] | None:
    """Return first and last place of the run whose mean is the most deviations from zero, and how many."""
    n = len(values)
    if n == 0:
        return None
    total = np.concatenate([[0.0], np.cumsum(values)])

    def best(lengths: Sequence[int], low: int, high: int) -> tuple[int, int, float]:
        top = (0, 0, -1.0)
        for length in lengths:
            starts = np.arange(max(low, 0), min(high, n - length) + 1)
            if len(starts):
                size = np.abs(total[starts + length] - total[starts]) / length / deviation[length]
                k = int(np.argmax(size))
                top = max(
                    top, (int(starts[k]), int(starts[k]) + length - 1, float(size[k])), key=lambda t: t[2]
                )
        return top

    lengths = sorted({min(n, round(1.25**k)) for k in range(2 + int(np.log(n) / np.log(1.25)))})
    first, last, _ = best(lengths, 0, n)
    length = last - first + 1
    # Its ends to the place
    near = range(max(1, round(length / 1.3) - 1), min(n, round(length * 1.3) + 1) + 1)
    return best(near, first - length, first + length)
