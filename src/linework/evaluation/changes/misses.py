"""Whether what only one of two surveys found is a change: by what both surveys miss of lines that are there.

Separate from `epochs`: this knows lengths and classes of lines, not places. What one survey found and the other did not has
changed, or was missed, or was never there. How often lines of a class are missed, and over which lengths, is what the two
surveys show themselves: most of a road is as it was.

References
----------
Robbins (1956), An empirical Bayes approach to statistics: what is common to many cases is taken from them.
Efron (2008), Microarrays, empirical Bayes and the two-groups model, doi:10.1214/07-STS236: chance and change as two groups,
the share of both taken from all cases, and each case by what the others say.
Lomax (1954), Business failures, doi:10.1080/01621459.1954.10501239: lengths whose mean is not known.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from scipy.special import expit

from linework.lines.crosscuts import STATION_M

#: Shorter stretches are not looked at. [m]
LEAST_STRETCH_M = 2.0
#: What one survey found otherwise is a change where that is twice as likely as that one of both erred.
LIKELY_CHANGE = 2.0 / 3.0
#: Before any is seen: length of a stretch that is missed, as long as the pieces in which lines are followed. [m]
_MISSED_M = 5.0
#: What is known of a class by the class above it counts as one stretch for how often, and two for how long (the fewest for
#: which the mean of lengths is finite).
_AS_ONE, _AS_TWO = 1.0, 2.0
#: Before any is seen: changes of roads are of any length up to a km, and as rare as one in a km of lines. [m]
_LONGEST_CHANGE_M, _CHANGE_EVERY_M = 1000.0, 1000.0
#: Rounds until shares stay as they are.
_ROUNDS = 30


@dataclass(frozen=True, slots=True)
class Alone:
    """A stretch of a line that only one survey found.

    Parameters
    ----------
    levels
        What lines like it are, from the widest class to the narrowest.
    length_m
        Its length. [m]
    confidence
        Probability that there is such a line at all.
    log_odds
        How much likelier what the points show is where the road has changed, as a logarithm.
    """

    levels: tuple[str, ...]
    length_m: float
    confidence: float
    log_odds: float = 0.0


class _Class:
    """Stretches that were missed of lines of a class, and metres that both surveys found."""

    def __init__(self) -> None:
        self.found_m = self.n = self.sum_m = 0.0

    def add(self, share: float, length_m: float) -> None:
        self.n += share
        self.sum_m += share * length_m


def change_probabilities(
    alone: Sequence[Alone], found_m: Sequence[tuple[tuple[str, ...], float]]
) -> list[float]:
    """Return for each stretch that only one survey found the probability that the road has changed there.

    Parameters
    ----------
    alone
        All of them, of both surveys.
    found_m
        Class and metres of lines that both surveys found.

    Notes
    -----
    Misses happen at a rate for each metre of line and have exponential lengths; both are taken class by class, each class
    with the one above it as a prior, from all other stretches as far as these are no changes. Changes have one rate for all
    classes and any length. What is found alone is weighed between the two, and counts to either by its probability.

    Examples
    --------
    Edges of a pavement are often missed for a few metres, and rails are not:

    >>> found = [(("edge",), 300.0), (("rail",), 600.0)]
    >>> missed = [Alone(("edge",), length, 0.9) for length in (3.0, 5.0, 4.0, 9.0, 12.0)]
    >>> for one in [Alone(("edge",), 12.0, 0.9), Alone(("rail",), 12.0, 0.9), Alone(("edge",), 90.0, 0.9)]:
    ...     print(one.levels[0], one.length_m, round(change_probabilities([*missed, one], found)[-1], 1))
    edge 12.0 0.2
    rail 12.0 0.4
    edge 90.0 0.9
    """
    classes = _classes_of(alone, found_m)
    chance = _first_guess(alone, found_m)
    for one, p in zip(alone, chance, strict=True):
        _add(classes, one, 1.0 - p)
    order = range(len(alone))
    for _ in range(_ROUNDS):
        before = list(chance)
        for i in order:
            _add(classes, alone[i], chance[i] - 1.0)
            chance[i] = _probability(alone[i], classes)
            _add(classes, alone[i], 1.0 - chance[i])
        if max((abs(a - b) for a, b in zip(before, chance, strict=True)), default=0.0) < 1e-4:
            break
    return [one.confidence * p for one, p in zip(alone, chance, strict=True)]


def _classes_of(
    alone: Sequence[Alone], found_m: Sequence[tuple[tuple[str, ...], float]]
) -> dict[tuple[str, ...], _Class]:
    """Return the classes of all lines by their levels, with their lengths and without misses."""
    classes: dict[tuple[str, ...], _Class] = defaultdict(_Class)
    for levels, metres in [*found_m, *((one.levels, one.length_m) for one in alone)]:
        for k in range(len(levels) + 1):
            classes[levels[:k]].found_m += metres
    return classes


def _first_guess(alone: Sequence[Alone], found_m: Sequence[tuple[tuple[str, ...], float]]) -> list[float]:
    """Return 1 for what are changes, else 0: of each widest class the longest, as many as make all together likeliest.

    Two that are alike may be misses, each because of the other, or changes, each because of none: which of both is likelier
    only both together say.
    """
    chance = [0.0] * len(alone)
    for kind in sorted({one.levels[:1] for one in alone}):
        classes = _classes_of(alone, found_m)
        own = sorted(
            (i for i, one in enumerate(alone) if one.levels[:1] == kind), key=lambda i: alone[i].length_m
        )
        # From the shortest on, each as a miss by what those before it are, against a change
        odds = [0.0]
        for i in own:
            odds.append(
                odds[-1] + _log_missed(alone[i], classes) - _log_changed(alone[i]) - alone[i].log_odds
            )
            _add(classes, alone[i], 1.0)
        for i in own[odds.index(max(odds)) :]:
            chance[i] = 1.0
    return chance


def _add(classes: dict[tuple[str, ...], _Class], one: Alone, share: float) -> None:
    for k in range(len(one.levels) + 1):
        classes[one.levels[:k]].add(share, _beyond_m(one))


def _sums(classes: dict[tuple[str, ...], _Class], levels: tuple[str, ...]) -> tuple[float, float, float]:
    """Return number and metres of what was missed of a class, and metres that were found."""
    own = classes[levels]
    return own.n, own.sum_m, own.found_m


def _beyond_m(one: Alone) -> float:
    """Return how much longer a stretch is than those that are not looked at; ends are known to a station's distance [m]."""
    return max(one.length_m - LEAST_STRETCH_M, 0.0) + STATION_M


def _probability(one: Alone, classes: dict[tuple[str, ...], _Class]) -> float:
    """Return the probability of a change by what all others are."""
    return float(expit(_log_changed(one) + one.log_odds - _log_missed(one, classes)))


def _log_changed(one: Alone) -> float:
    """Return the logarithm of how often changes of this length begin in a metre, by metre of length."""
    return -math.log(
        max(one.length_m, LEAST_STRETCH_M) * math.log(_LONGEST_CHANGE_M / LEAST_STRETCH_M) * _CHANGE_EVERY_M
    )


def _log_missed(one: Alone, classes: dict[tuple[str, ...], _Class]) -> float:
    """Return the logarithm of how often misses of this length begin in a metre, by metre of length, by what all others are.

    A long stretch among very many short ones is so rarely missed that only the logarithm can tell.
    """
    rate, mean_m, shape = 0.0, _MISSED_M, _AS_TWO
    for k in range(len(one.levels) + 1):
        # Of a class above, what is not of the class below: no case counts twice
        n, sum_m, found_m = (
            max(a - b, 0.0)
            for a, b in zip(
                _sums(classes, one.levels[:k]), _sums(classes, one.levels[: k + 1]) if k < len(one.levels) else (0.0,) * 3,
                strict=True,
            )
        )  # fmt: skip
        if k == 0:
            rate = (n + 0.5) / max(found_m, _CHANGE_EVERY_M)
        else:
            rate = (n + _AS_ONE) / (found_m + _AS_ONE / rate)
        shape = _AS_TWO + n
        mean_m = (mean_m * (_AS_TWO - 1.0) + sum_m) / (shape - 1.0)
    scale_m = mean_m * (shape - 1.0)
    return math.log(rate * shape / scale_m) - (shape + 1.0) * math.log1p(_beyond_m(one) / scale_m)
