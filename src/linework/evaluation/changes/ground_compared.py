"""Whether the ground across a line looks the same in both surveys: a line that only one found was then missed by the other.

Separate from `ground_seen`, which reads the points: this compares what they show. A stripe of paint is a bump of brightness
across the line, a kerb a step of height, the edge of a pavement a step of both. The size of this shape in one survey is
compared with that in the other: the ratio is 1 where the ground is as it was and 0 where the line is gone, whatever the gain
of either scanner.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp
from scipy.stats import chi2

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray
from linework.evaluation.changes.ground_seen import (
    N_STEPS,
    ON_GROUND,
    PROFILE_STEP_M,
    STANDING,
    STEP_PLACES_M,
    STRETCH,
    GroundAlongLines,
    GroundAtPlaces,
)

#: How far beside paint, and from where to where beside an edge, the ground is part of the shape: the next line, or the edge
#: of the pavement, may be as near as that. [m]
_BESIDE_PAINT_M, _BESIDE_EDGE_M = 0.2, (0.05, 0.35)
#: A shape stands out from its noise by at least this many deviations, else it says nothing.
_LEAST_DEVIATIONS = 4.0
#: Deviation of the ratio where there are too few lines that both found to tell how alike the two show them: the ratio then
#: says little, and half-way between both answers nothing.
_RATIO_SIGMA = 0.5
#: Deviation of what has gone over of a line that moved: half-way is two of them. The registration is good to a centimetre or
#: two of the 5 that are looked at.
_MOVE_SIGMA = 0.25
#: Fewest stretches that tell how much lines that both found differ: a median is then known to a third of the spread.
_FEWEST = 12
#: Fewest places of what stands that were seen, a metre apart: a lorry with its trailer is 18.75 m long, and drives away.
_FEWEST_PLACES = 20
#: How lines of both surveys differ has long tails: a car beside the line, leaves, a kerb that is worn. It is weighed by
#: Student's t of two degrees of freedom, as a mixture of normal distributions with these variances (the reciprocals of
#: chi-squared over its degrees): what is ten times as far as most is one in a hundred.
_VARIANCES = 2.0 / chi2.ppf((np.arange(1000) + 0.5) / 1000, 2.0)
#: Least deviation of the ratio of lines that both found: paint and verges change within a year. [share]
_LEAST_SIGMA = 0.05


@dataclass(frozen=True, slots=True)
class ShapeRatio:
    """The shape of a line across it, in one survey as a multiple of that in the other.

    Parameters
    ----------
    ratio, sigma
        1 where both are the same, and its standard deviation by the noise of the points.
    """

    ratio: float
    sigma: float


def shape_ratio(
    own: GroundAtPlaces, other: GroundAtPlaces, channels: tuple[int, ...] | None = None
) -> ShapeRatio | None:
    """Return the shape of a line in the other survey as a multiple of the own one; None where that does not stand out.

    Parameters
    ----------
    own, other
        What both surveys show at the same places, of one stretch of line.
    channels
        Height (0) or brightness (1); None: whatever shows the line.
    """
    product = square = 0.0
    for channel in channels or _channels(own):
        here, there = (_size_of_shape(ground, channel) for ground in (own, other))
        if here is not None and there is not None:
            (size, variance), (other_size, other_variance) = here, there
            product += size * other_size / (variance + other_variance)
            # What noise alone makes of a square
            square += (size**2 - variance) / (variance + other_variance)
    if square < _LEAST_DEVIATIONS**2:
        return None
    return ShapeRatio(product / square, math.sqrt((1.0 + (product / square) ** 2) / square))


def move_ratio(own: GroundAtPlaces, other: GroundAtPlaces, away_m: float) -> ShapeRatio | None:
    """Return how much of a line's shape has gone over to beside its place: 1 where it has moved there, 0 where it is as it was.

    Parameters
    ----------
    own, other
        What both surveys show at the same places, of one stretch of line.
    away_m
        How far to the left the other survey found it. [m]
    """
    weights = found = 0.0
    before, after = (_shape_at(float(own.half_m.mean()), q) for q in (0.0, away_m))
    for channel in _channels(own):
        size = _size_of_shape(own, channel)
        here, there = (_profile(ground, channel) for ground in (own, other))
        if size is None or size[0] ** 2 < size[1] or here is None or there is None:
            continue
        (mean, variance), (other_mean, other_variance) = here, there
        used = np.isfinite(mean + other_mean)
        moved = (size[0] * (after - before))[used]
        fitted = _fitted(moved, (other_mean - mean)[used], 1.0 / (variance + other_variance)[used], used)
        if fitted is not None:
            found += fitted[0] / fitted[1]
            weights += 1.0 / fitted[1]
    if weights < _LEAST_DEVIATIONS**2:
        return None
    return ShapeRatio(found / weights, weights**-0.5)


def standing_ratio(own: GroundAtPlaces, other: GroundAtPlaces) -> ShapeRatio | None:
    """Return how often the other survey has points of what stands at places, as a multiple of how often the own one has.

    Of the places that it saw: where it has points there, or beside and below. None where there are too few.
    """
    stands = own.upper > 0
    seen = stands & (other.upper + other.below > 0)
    n = int(seen.sum())
    if n < _FEWEST_PLACES or 2 * n < len(stands):
        return None
    share = float((other.upper[seen] > 0).mean())
    # Of a share of 0 or 1 of few places it is not known that it is that of all
    return ShapeRatio(share, math.sqrt((share * (1.0 - share) + 1.0 / n) / n))


def _log_likelihood(away: float, noise: float, spread: float) -> float:
    """Return how likely a ratio is so far from what is expected, by noise (Gauss) and by how lines differ (Student's t).

    As a logarithm, but for what is the same for all of one noise and spread.
    """
    variance = noise**2 + spread**2 * _VARIANCES
    return float(logsumexp(-0.5 * (away**2 / variance + np.log(variance))))


def _channels(ground: GroundAtPlaces) -> tuple[int, ...]:
    """Return what shows a line: paint its brightness (1) alone, as a road may be crowned under it, an edge its height (0), too."""
    return (1,) if ground.half_m.mean() > 0.0 else (0, 1)


def _size_of_shape(ground: GroundAtPlaces, channel: int) -> tuple[float, float] | None:
    """Return the size of a line in height [m] or brightness [1] and its variance by the noise of the points.

    By least squares with a level and a slope, of the mean of all places. The noise of a point is what it differs by from
    others of its step. None where there are too few.
    """
    half_m = float(ground.half_m.mean())
    profile = _profile(ground, channel)
    if profile is None:
        return None
    mean, variance = profile
    away = np.abs(STEP_PLACES_M)
    beside = (
        (away >= _BESIDE_EDGE_M[0]) & (away <= _BESIDE_EDGE_M[1])
        if half_m == 0.0
        else away <= half_m + _BESIDE_PAINT_M
    )
    used = beside & np.isfinite(mean)
    if not all((used & (side * STEP_PLACES_M > half_m)).any() for side in (1.0, -1.0)):
        return None
    return _fitted(_shape_at(half_m, 0.0)[used], mean[used], 1.0 / variance[used], used)


def _profile(ground: GroundAtPlaces, channel: int) -> tuple[FloatArray, FloatArray] | None:
    """Return means by step of height [m], or of brightness as a multiple of that of all steps, and their variances, or None.

    NaN where there are no points.
    """
    n = ground.number.sum(axis=0)
    used = n > 0
    total, squares = (ground.sums[:, k].sum(axis=0)[used] for k in (channel, channel + 2))
    n_free = int(n.sum() - used.sum())
    within = float((squares - total**2 / n[used]).sum()) / max(n_free, 1)
    if n_free < 1 or within <= 0.0:
        return None
    mean, variance = np.full((2, N_STEPS), np.nan)
    mean[used], variance[used] = total / n[used], within / n[used]
    scale = float(mean[used].mean()) if channel else 1.0
    return (mean / scale, variance / scale**2) if scale > 0.0 else None


def _fitted(
    shape: FloatArray, values: FloatArray, weight: FloatArray, used: BoolArray
) -> tuple[float, float] | None:
    """Return how much of a shape there is in values at the steps used, and its variance, beside a level and a slope."""
    design = np.stack([np.ones(len(shape)), STEP_PLACES_M[used], shape], axis=1)
    normal = design.T @ (weight[:, None] * design)
    if len(shape) < 3 or np.linalg.matrix_rank(normal) < 3:
        return None
    inverse = np.linalg.inv(normal)
    return float((inverse @ (design.T @ (weight * values)))[2]), float(inverse[2, 2])


def _shape_at(half_m: float, at_m: float) -> FloatArray:
    """Return by step across what paint of a width, or an edge (0), at a distance to the left is like."""
    low, high = STEP_PLACES_M - 0.5 * PROFILE_STEP_M, STEP_PLACES_M + 0.5 * PROFILE_STEP_M
    if half_m > 0.0:
        covered = np.minimum(high, at_m + half_m) - np.maximum(low, at_m - half_m)
        return np.asarray(np.clip(covered / PROFILE_STEP_M, 0.0, 1.0))
    return np.asarray(np.clip((high - at_m) / PROFILE_STEP_M, 0.0, 1.0) - 0.5)


@dataclass(frozen=True, slots=True)
class GroundCompared:
    """How much the ground across lines says for a change, of each kind of line.

    Parameters
    ----------
    ground
        What both surveys show.
    of_same
        Kind: ratio of lines that both surveys found, and its deviation over what noise makes.
    """

    ground: GroundAlongLines
    of_same: dict[str, tuple[float, float]]

    def log_odds(
        self, kind: str, stations: IntArray, *, moved: bool = False, height_ratio: float | None = None
    ) -> float:
        """Return by how much a stretch of a line is likelier where it has changed, as a logarithm; 0 where nothing is known.

        What has moved left its place, and lies beside it; where it did not, one of the surveys has measured another line.

        height_ratio: how many times as high the step is in the other survey where its height has changed; None where that is
        not what is asked.
        """
        row = self.ground.row[stations]
        row = row[(row >= 0) & ((np.append(self.ground.away_m, 0.0)[row] != 0.0) == moved)]
        # Of what stands points tell where it is, not how high; of what is flat nothing is a multiple
        is_flat = height_ratio is not None and not math.isfinite(height_ratio)
        is_of_place = not moved and height_ratio is None
        if not len(row) or (kind in STANDING and not is_of_place) or is_flat:
            return 0.0
        own, other = self.ground.own.at(row), self.ground.other.at(row)
        if moved:
            left = move_ratio(own, other, float(np.median(self.ground.away_m[row])))
            found = None if left is None else ShapeRatio(1.0 - left.ratio, left.sigma)
            same, sigma = 1.0, _MOVE_SIGMA
        else:
            channels = None if height_ratio is None else (0,)
            found = standing_ratio(own, other) if kind in STANDING else shape_ratio(own, other, channels)
            same, sigma = self.of_same.get(kind, (1.0, _RATIO_SIGMA))
        if found is None:
            return 0.0
        changed = same * (height_ratio or 0.0)
        is_changed, is_same = (
            _log_likelihood(found.ratio - expected, found.sigma, sigma) for expected in (changed, same)
        )
        return is_changed - is_same


def ground_compared(ground: GroundAlongLines, kinds: AnyArray, lines: IntArray) -> GroundCompared:
    """Return how the ground of two surveys compares.

    Parameters
    ----------
    ground
        What both show at stations of one survey's lines.
    kinds, lines
        (n,) kind and number of the line of each station.
    """
    looked = np.flatnonzero(ground.row >= 0)
    found = looked[ground.is_found[ground.row[looked]]]
    by_kind: dict[str, list[ShapeRatio]] = {}
    of_same = {}
    for kind in sorted(set(kinds[found].tolist())):
        own = found[kinds[found] == kind]
        if kind in STANDING:
            row = ground.row[own]
            of_all = standing_ratio(ground.own.at(row), ground.other.at(row))
            of_same[kind] = (1.0 if of_all is None else of_all.ratio), _RATIO_SIGMA
        else:
            rows = (ground.row[stations] for stations in _in_stretches(own, lines))
            compared = (shape_ratio(ground.own.at(row), ground.other.at(row)) for row in rows)
            by_kind[kind] = [one for one in compared if one is not None]
    # Of kinds of which there are few, what all kinds tell
    every = [one for ratios in by_kind.values() for one in ratios]
    for kind in ON_GROUND:
        ratios = by_kind.get(kind, [])
        usual = _usual(ratios if len(ratios) >= _FEWEST else every)
        if usual is not None:
            of_same[kind] = usual
    return GroundCompared(ground, of_same)


def _usual(ratios: list[ShapeRatio]) -> tuple[float, float] | None:
    """Return the median of ratios, and their spread over what noise makes; None of too few."""
    if len(ratios) < _FEWEST:
        return None
    value, noise = np.array([(one.ratio, one.sigma) for one in ratios]).T
    middle = float(np.median(value))
    spread = 1.4826 * float(np.median(np.abs(value - middle)))
    beyond = math.sqrt(max(spread**2 - float(np.median(noise)) ** 2, 0.0))
    return middle, max(beyond, _LEAST_SIGMA)


def _in_stretches(stations: IntArray, lines: IntArray) -> Iterator[IntArray]:
    """Yield stations, ascending, in stretches of one line: a single one has too few points, and those that stand out are chance."""
    for of_line in np.split(stations, np.flatnonzero(np.diff(lines[stations])) + 1):
        yield from np.array_split(of_line, max(len(of_line) // STRETCH, 1))
