"""How long the dashes of a marking are, from what points show at their ends, however worn these are.

Separate from `dash_ends`, which reads the points: these are pure functions on what it found.
"""

from __future__ import annotations

import math
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.special import logsumexp, ndtr

from linework.arrays import FloatArray
from linework.lines.dashes import ALIKE_DASHES_M, MarkingRhythm

#: Step of the lengths and places that are compared, and how far they reach to both sides. [m]
_STEP_M, _REACH_M = 0.02, 0.6
#: A point looks bright as far as most of its spot lies on paint: spots are some 2 cm. [m]
_SPOT_M = 0.01
#: Typical lengths of what wear has removed: chips at an end, and patches (`methods.tracking.pattern`). [m]
_PATCHES_M = np.array([0.25, 2.5])
#: Chance that a bright point beyond an end is no paint (stains, studs), which may lie anywhere within the gap [m].
_STRAY, _STRAY_WITHIN_M = 0.02, 6.0
#: Shares of ends that a patch of wear has removed: from none to most. All are as likely before the points are looked at.
_WORN = (0.05, 0.2, 0.5, 0.8)
#: Deviations of the steps from dash to dash: painted by a machine, by hand or along a bend. As likely as each other. [m]
_UNEVEN_M = (0.01, 0.04)
#: How far the period may be off that of the first estimate, whose whole dashes may be worn ones [share], in steps that the
#: least deviation from dash to dash makes up for [m].
_PERIOD_REACH, _PERIOD_STEP_M = 0.01, 0.02
#: Shares of bright points beside a bright one: with none or all, no chance of a dark one follows.
_BRIGHT_SHARES = (0.3, 0.98)


class Estimate(NamedTuple):
    """A length and its standard deviation [m]."""

    value_m: float
    sigma_m: float


class DashesOfStretch(NamedTuple):
    """The period of dashes, and the logarithm of the likelihood of each of `lengths_about` (n,)."""

    period: Estimate
    likelihood: FloatArray


def lengths_about(dash_m: float) -> FloatArray:
    """Return the lengths (n,) [m] that are compared about a first estimate."""
    n = round(_REACH_M / _STEP_M)
    return np.asarray(dash_m + _STEP_M * np.arange(-n, n + 1), dtype=np.float64)


def dashes_of_stretch(
    begin: FloatArray, end: FloatArray, bright_share: float, dashes: FloatArray, rhythm: MarkingRhythm
) -> DashesOfStretch:
    """Return how likely each length is that all dashes of a stretch may have, from the points at their ends.

    All have one length and follow each other at one distance, nearly. Scan lines leave each end open between the outermost
    bright point and the next one; where the period of the dashes is near a multiple of the distance of scan lines, all are
    cut alike, and many dashes say no more than one. So period, places of the dashes and their length are found together: a hidden
    Markov chain from dash to dash, whose state is how far a dash lies from its place in the rhythm (forward algorithm,
    Rabiner 1989, doi:10.1109/5.18626). The length has the likelihood of all chains; periods, shares of worn ends
    and unevenness are summed out.

    Parameters
    ----------
    begin, end
        (k, N_BEYOND) as of `DashEnds`. [m]
    bright_share
        Share of bright points beside a bright one on the dashes.
    dashes
        (k, 2) begin and end of the dashes along the marking, a first estimate [m], ascending.
    rhythm
        Its first estimate.
    """
    period = rhythm.dash_m + rhythm.gap_m
    middle, length = dashes.mean(axis=1), dashes[:, 1] - dashes[:, 0]
    is_whole = np.abs(length - rhythm.dash_m) <= ALIKE_DASHES_M
    if not is_whole.any():
        is_whole[:] = True
    number = np.rint((middle - middle[is_whole][0]) / period)
    # Of two in one place the longer one; the other is what wear left beside it
    order = np.lexsort((-length, number))
    own = order[np.concatenate([[True], np.diff(number[order]) > 0.0])]
    place = middle[is_whole][0] + float(np.median((middle - middle[is_whole][0] - number * period)[is_whole]))
    lengths = lengths_about(rhythm.dash_m)
    first = place - 0.5 * rhythm.dash_m + (lengths - rhythm.dash_m)
    last = first[0] + lengths[0] + _STEP_M * np.arange(2 * len(lengths) - 1)
    share = min(max(bright_share, _BRIGHT_SHARES[0]), _BRIGHT_SHARES[1])
    steps = np.diff(number[own])
    n_steps = round(_PERIOD_REACH * period / _PERIOD_STEP_M)
    off = np.asarray(_PERIOD_STEP_M * np.arange(-n_steps, n_steps + 1), dtype=np.float64)
    found = []
    for off_m, worn in product(off.tolist(), _WORN):
        shift = (number[own] * (period + off_m))[:, None]
        begins = np.stack([
            _chance_of_end(-place, -seen, worn, share) for place, seen in zip(first + shift, begin[own], strict=True)
        ])  # fmt: skip
        ends = np.stack([
            _chance_of_end(place, seen, worn, share) for place, seen in zip(last + shift, end[own], strict=True)
        ])  # fmt: skip
        found += [_likelihood_of_lengths(begins, ends, uneven_m * np.sqrt(steps)) for uneven_m in _UNEVEN_M]
    likelihoods = np.stack(found).reshape(len(off), -1, len(lengths))
    of_period = _mean_of(period + off, logsumexp(likelihoods, axis=(1, 2)))
    sigma_m = math.hypot(of_period.sigma_m, _PERIOD_STEP_M / math.sqrt(12.0))
    return DashesOfStretch(of_period._replace(sigma_m=sigma_m), logsumexp(likelihoods, axis=(0, 1)))


def likeliest_length(about_m: float, likelihood: FloatArray) -> Estimate:
    """Return the mean of a likelihood of `lengths_about` a length, and its deviation with those of both spots."""
    found = _mean_of(lengths_about(about_m), likelihood)
    return found._replace(sigma_m=math.sqrt(found.sigma_m**2 + 2.0 * _SPOT_M**2 / 3.0))


def _mean_of(values: FloatArray, likelihood: FloatArray) -> Estimate:
    weight = np.exp(likelihood - likelihood.max())
    weight /= weight.sum()
    mean = float(weight @ values)
    return Estimate(mean, math.sqrt(float(weight @ (values - mean) ** 2)))


def _chance_of_end(place: FloatArray, beyond: FloatArray, worn: float, share: float) -> FloatArray:
    """Return how likely the points at an end are, if it lies at each of some places (n,) [m], outwards positive.

    The outermost bright point and the dark ones beyond it (N_BEYOND,), up to the end, belong to the paint: each is dark with
    the share that wear leaves bare among its points, or all because a patch is gone from the end to the outermost bright one.
    """
    there = beyond[np.isfinite(beyond)]
    if len(there) == 0:
        return np.ones(len(place))
    reached = ndtr((place[:, None] - there) / _SPOT_M)
    if len(there) == 1:
        # Nothing was hit beyond: it may end anywhere
        return np.asarray(np.maximum(reached[:, 0], _STRAY), dtype=np.float64)
    step = max(float(there[1] - there[0]), _SPOT_M)
    # Each further point within the paint makes it less likely by the share of bright ones
    dark = reached[:, 1:] @ (share * (1.0 - share) ** np.arange(len(there) - 1))
    whole = share * np.maximum(reached[:, 0] - dark, 0.0)
    beyond_m = np.maximum(place - there[0], 0.0)[:, None]
    patch = reached[:, 0] * (np.exp(-beyond_m / _PATCHES_M) * np.minimum(step / _PATCHES_M, 1.0)).mean(axis=1)
    chance = (1.0 - worn) * whole + worn * patch + _STRAY * step / _STRAY_WITHIN_M
    return np.asarray(chance, dtype=np.float64)


def _likelihood_of_lengths(begins: FloatArray, ends: FloatArray, uneven_m: FloatArray) -> FloatArray:
    """Return the logarithm of the likelihood of each length (n,).

    begins, ends: (k, n) and (k, 2 n - 1) chances of the places of the ends of each dash; uneven_m: (k - 1,) deviations of
    the steps between them.
    """
    n = begins.shape[1]
    chance, total = np.full((n, n), 1.0 / n), 0.0
    for i, (begin, end) in enumerate(zip(begins, ends, strict=True)):
        if i and uneven_m[i - 1] > 0.0:
            chance = gaussian_filter1d(chance, uneven_m[i - 1] / _STEP_M, axis=1, mode="constant")
        # Row: length; column: place of the begin
        chance = chance * begin * np.lib.stride_tricks.sliding_window_view(end, n)
        sum_of_all = float(chance.sum())
        chance, total = chance / sum_of_all, total + math.log(sum_of_all)
    return np.asarray(total + np.log(np.maximum(chance.sum(axis=1), 1e-300)))
