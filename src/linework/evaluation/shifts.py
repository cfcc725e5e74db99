"""Where the differences along a line are more than chance: significance adds up over stations that are independent.

Separate from `epochs`, which compares surveys: this looks at sequences of numbers. Errors of neighbouring stations are
related, so that the mean of a stretch says less than its length promises, and the step at each of its ends says more:
errors that change slowly make no steps. Both are weighed as generalised least squares does, by what each difference adds
to those before it.

References
----------
Aitken (1936), On least squares and linear combinations of observations, doi:10.1017/S0370164600014346.
Durbin (1960), The fitting of time-series models, doi:10.2307/1401322: filters from autocorrelations, order by order.
Sokal (1997), Monte Carlo methods in statistical mechanics, doi:10.1007/978-1-4899-0319-8_6: sums of autocorrelations up to
where they are lost in noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray, IntArray

#: A line has changed over stretches whose differences chance gives this often in a kilometre of road: moves and paint
#: together once.
FALSE_PER_KM = 0.5
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
#: Longest run of which every length is looked at: 1 km. [places]
_EVERY_LENGTH = 200


@dataclass(frozen=True, slots=True)
class Chance:
    """Differences by chance, where nothing has changed.

    Parameters
    ----------
    scale
        Their standard deviation over the stated one.
    filters
        (p + 1, p + 1) row k is what a difference adds to the k before it, over its deviation: factors of the
        difference itself, of the one before, and so on. See `filters_of`.
    """

    scale: float
    filters: FloatArray


#: The filters of differences that are not related.
UNRELATED: FloatArray = np.ones((1, 1))


def chance_of(sequences: Sequence[FloatArray], filters: FloatArray) -> Chance:
    """Return the chance of differences whose relation is known: their scale, and that of what each adds to those before."""
    scale = scale_of(sequences)
    new = [_whitened((s / scale)[None], filters)[0] for s in sequences]
    # Less than the filters expect is their margin, more is what they do not know
    return Chance(scale * max(scale_of(new), 1.0), filters)


def filters_of(related: FloatArray, n_places: int) -> FloatArray:
    """Return what differences add to those before them, from correlations that were taken from `n_places` differences.

    Parameters
    ----------
    related
        (m,) correlations of differences 1 to m places apart, see `related_of`.

    Notes
    -----
    Correlations are known to about sqrt((1 + 2 sum) / n): as much of the variance may be noise of each place, and counts
    as such. Without it, differences that seem to change slowly would make a change of every step.

    Examples
    --------
    >>> filters_of(np.array([0.4]), 10**9).round(2).tolist()
    [[1.0, 0.0], [1.09, -0.44]]
    """
    m = len(related)
    if m == 0:
        return UNRELATED
    size = 4 * (m + 1)
    covariance = np.zeros(size)
    covariance[: m + 1] = [1.0, *related]
    covariance[size - m :] = related[::-1]
    # Correlations that no differences can have are moved to the nearest that can be
    covariance = np.fft.irfft(np.maximum(np.fft.rfft(covariance).real, 0.0), n=size)[: m + 1]
    covariance = covariance / covariance[0]
    covariance[0] += np.sqrt((1.0 + 2.0 * float(related.sum())) / max(n_places, 1))
    covariance /= covariance[0]
    filters = np.zeros((m + 1, m + 1))
    factors, left = np.array([1.0]), 1.0
    filters[0, 0] = 1.0
    for k in range(1, m + 1):
        mirror = -float(factors @ covariance[k:0:-1]) / left
        factors = np.append(factors, 0.0) + mirror * np.append(0.0, factors[::-1])
        left *= 1.0 - mirror**2
        filters[k, : k + 1] = factors / np.sqrt(left)
    return filters


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


def _whitened(values: FloatArray, filters: FloatArray) -> FloatArray:
    """Return what each difference of sequences (k, n) adds to those before it, over its deviation."""
    n, order = values.shape[1], len(filters) - 1
    found = np.zeros(values.shape)
    for lag in range(min(order + 1, n)):
        found[:, lag:] += filters[np.minimum(np.arange(lag, n), order), lag] * values[:, : n - lag]
    return found


def _evidence(values: FloatArray, filters: FloatArray) -> FloatArray:
    """Return running sums (k, n + 1) of what sequences (k, n) say for a shift at each place."""
    n, order = values.shape[1], len(filters) - 1
    new = _whitened(values, filters)
    found = np.zeros((len(values), n + 1))
    for lag in range(min(order + 1, n)):
        found[:, 1 : n - lag + 1] += filters[np.minimum(np.arange(lag, n), order), lag] * new[:, lag:]
    return np.asarray(np.cumsum(found, axis=1))


class _Information:
    """How surely the shift of a run in a sequence of n differences is known, by its first place and length."""

    def __init__(self, n: int, filters: FloatArray) -> None:
        self._n, self._order = n, len(filters) - 1
        self._sums = np.hstack([np.zeros((len(filters), 1)), np.cumsum(filters, axis=1)])

    def deviations(self, length: int) -> FloatArray:
        """Return the reciprocal deviations (n - length + 1,) of evidence for runs of a length, from each first place."""
        n, order = self._n, self._order
        # From the order on, all runs look alike, but for where the sequence ends
        k = np.arange(min(length + order, n))
        inside = np.cumsum(self._seen(order, k, k, length) ** 2)
        first = np.arange(n - length + 1)
        found = inside[np.minimum(len(k), n - first) - 1]
        begin = np.arange(min(order, n - length + 1))[:, None]
        row = np.minimum(begin + k, n - 1)
        seen = np.where(begin + k < n, self._seen(np.minimum(row, order), k, k, length), 0.0)
        found[: len(begin)] = (seen**2).sum(axis=1)
        return np.asarray(1.0 / np.sqrt(found))

    def _seen(self, row: IntArray | int, begun: IntArray, k: IntArray, length: int) -> FloatArray:
        """Return what a shift of 1 adds k places behind the first one of a run."""
        order = self._order
        return np.asarray(
            self._sums[row, np.minimum(begun + 1, order + 1)]
            - self._sums[row, np.clip(k - length + 1, 0, order + 1)]
        )


def least_deviations(n_places: int, filters: FloatArray, n_allowed: float) -> float:
    """Return the number of deviations that runs of any length exceed by chance `n_allowed` times.

    Parameters
    ----------
    n_places
        Differences that are looked at, over all lines.
    filters
        What their relation is, see `filters_of`.

    Notes
    -----
    Counted on drawn differences with this relation, always the same.

    Examples
    --------
    >>> 3.0 < least_deviations(1200, UNRELATED, 0.5) < 4.5
    True
    """
    n = _DRAWN_PLACES
    new = np.random.default_rng(0).normal(size=(_N_DRAWN, n))
    drawn = np.zeros(new.shape)
    for i in range(n):
        row = filters[min(i, len(filters) - 1)]
        lags = min(i, len(row) - 1)
        drawn[:, i] = (new[:, i] - drawn[:, i - lags : i] @ row[lags:0:-1]) / row[0]
    total, information = _evidence(drawn, filters), _Information(n, filters)
    highest = np.zeros(_N_DRAWN)
    for length in range(1, n + 1):
        size = np.abs(total[:, length:] - total[:, :-length]) * information.deviations(length)
        highest = np.maximum(highest, size.max(axis=1))
    share = n_allowed * n / max(n_places, 1)
    return float(np.quantile(highest, max(1.0 - share, 0.05)))


def shifted_runs(values: FloatArray, chance: Chance, least: float) -> list[tuple[int, int]]:
    """Return the first and last place of each run over which a sequence is shifted, in order.

    Parameters
    ----------
    values
        (n,) differences over their stated deviations.
    least
        Deviations of the shift of a run that are more than chance.

    Notes
    -----
    The run with the most significant shift is taken first, its ends where significance is greatest; then what is left on
    both of its sides.

    Examples
    --------
    >>> shifted_runs(np.concatenate([np.zeros(20), np.full(9, 2.0), np.zeros(20)]), Chance(1.0, UNRELATED), 4.0)
    [(20, 28)]
    """
    found, open_ = [], [(0, len(values))]
    while open_:
        first, end = open_.pop()
        run = _most_significant(values[first:end] / chance.scale, chance.filters)
        if run is None or run[2] <= least:
            continue
        a, b = first + run[0], first + run[1]
        found.append((a, b))
        open_ += [(first, a), (b + 1, end)]
    return sorted(found)


def _most_significant(values: FloatArray, filters: FloatArray) -> tuple[int, int, float] | None:
    """Return first and last place of the run whose shift is the most deviations from zero, and how many."""
    n = len(values)
    if n == 0:
        return None
    total, information = _evidence(values[None], filters)[0], _Information(n, filters)

    def best(lengths: Sequence[int], low: int, high: int) -> tuple[int, int, float]:
        top = (0, 0, -1.0)
        for length in lengths:
            starts = np.arange(max(low, 0), min(high, n - length) + 1)
            if len(starts):
                size = np.abs(total[starts + length] - total[starts]) * information.deviations(length)[starts]
                k = int(np.argmax(size))
                top = max(
                    top, (int(starts[k]), int(starts[k]) + length - 1, float(size[k])), key=lambda t: t[2]
                )
        return top

    # A run that is a place too long has lost its steps: every length is looked at, up to where it hardly matters
    shares = 1.25 ** np.arange(2 + int(np.log(n) / np.log(1.25)))
    lengths = sorted(
        {*range(1, min(n, _EVERY_LENGTH) + 1), *np.minimum(n, shares.round()).astype(int).tolist()}
    )
    first, last, most = best(lengths, 0, n)
    length = last - first + 1
    if length <= _EVERY_LENGTH:
        return first, last, most
    # Its ends to the place
    near = range(max(1, round(length / 1.3) - 1), min(n, round(length * 1.3) + 1) + 1)
    return best(near, first - length, first + length)
