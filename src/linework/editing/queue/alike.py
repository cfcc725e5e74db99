"""Lines that are like one in which a person mended a fault: the same fault may be there, too.

Separate from `suspects`, which looks at each line by itself: here an example says what is looked for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.special import chdtrc

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.lines.along import DrivenPath
from linework.model.lines import LineSet

#: Largest distance of a line from the path, and from another line, that is measured. [m]
BESIDE_REACH_M = 25.0
#: Fewest other lines of the kind among which one can be said to be like another.
FEWEST_LINES = 4
#: Chance below which a line is listed as like the example, and below which it is very much so.
LIKE_CHANCE, VERY_LIKE_CHANCE = 0.3, 0.05
#: Reviews by which a person said that a line is right.
RIGHT_REVIEWS = ("accepted", "edited", "drawn")
#: Measures that are named as the reason, at most, and the largest share of lines as near in such a one.
_MOST_NAMED, _TELLING = 3, 0.25


@dataclass(frozen=True, slots=True)
class Alike:
    """A line that is like an example.

    Parameters
    ----------
    line
        Its number among the lines.
    chance
        Probability that a line drawn at random from those of its kind were as like the example, if its measures were
        independent of each other: small means very much alike.
    because
        The measures in which it is like the example and few others are, the most telling first.
    """

    line: int
    chance: float
    because: tuple[str, ...]


def line_measures(lines: LineSet, chosen: IntArray, way: DrivenPath) -> dict[str, FloatArray]:
    """Return what the lines themselves say of some of them, by its name in words: (k,) each, NaN where it is not known.

    Parameters
    ----------
    lines
        All lines, also those beside which the chosen run.
    chosen
        (k,) numbers of the lines that are measured.
    way
        The van's path; without one nothing is said about offset and direction.
    """
    own = lines.take(chosen)
    length_m, n = own.length_m, len(own)
    offset, across, bends = (np.full(n, np.nan) for _ in range(3))
    for i in range(n):
        xy = own[i].xyz[:, :2]
        step = xy[-1] - xy[0]
        reach_m = float(np.hypot(*step))
        bends[i] = 1.0 - reach_m / max(float(length_m[i]), 1e-9)
        along, left_m = way.offsets(xy, BESIDE_REACH_M)
        near = np.isfinite(along)
        if near.any() and reach_m > 0.0:
            offset[i] = float(np.median(np.abs(left_m[near])))
            k = np.clip(np.rint(along[near]).astype(np.int64), 0, len(way) - 1)
            across[i] = float(np.median(np.abs(way.left[k] @ (step / reach_m))))
    same, other = _to_the_next(lines, chosen)
    return {
        "confidence": own.confidence.astype(np.float64),
        "length": length_m,
        "bridged share": own.bridged_m / np.maximum(length_m, 1e-9),
        "accuracy in plan": _medians(own, own.sigma_xy_m),
        "accuracy in height": _medians(own, own.sigma_z_m),
        "width": own.width_m.astype(np.float64),
        "height": own.height_m.astype(np.float64),
        "distance from the path": offset,
        "direction to the path": across,
        "bends": bends,
        "distance to the next of its kind": same,
        "distance to the next of another kind": other,
    }


def _to_the_next(lines: LineSet, chosen: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return how far from the middle of each chosen line the nearest other of its kind is, and that of other kinds. [m]"""  # noqa: D400
    same, other = np.full(len(chosen), BESIDE_REACH_M), np.full(len(chosen), BESIDE_REACH_M)
    if len(chosen) == 0:
        return same, other
    plan = shapely.linestrings(
        lines.xyz[:, :2], indices=np.repeat(np.arange(len(lines)), np.diff(lines.offsets))
    )
    middles = shapely.line_interpolate_point(plan[chosen], 0.5, normalized=True)
    k, j = shapely.STRtree(plan).query(middles, predicate="dwithin", distance=BESIDE_REACH_M)
    away, is_same = shapely.distance(plan[j], middles[k]), lines.kind[chosen[k]] == lines.kind[j]
    is_itself = chosen[k] == j
    for nearest, own in ((same, is_same & ~is_itself), (other, ~is_same & ~is_itself)):
        np.minimum.at(nearest, k[own], away[own])
    return same, other


def _medians(lines: LineSet, vertex: FloatArray) -> FloatArray:
    parts = [vertex[a:b] for a, b in zip(lines.offsets[:-1], lines.offsets[1:], strict=True)]
    known = [part[np.isfinite(part)] for part in parts]
    return np.array([float(np.median(part)) if len(part) else np.nan for part in known])


def shares_as_near(
    example: int, population: BoolArray, measures: Mapping[str, FloatArray]
) -> dict[str, FloatArray]:
    """Return by measure the share of a population that is at least as near to an example as each line is: (n,), 0 to 1.

    Parameters
    ----------
    example
        Number of the line that is looked for.
    population
        (n,) the lines among which is counted, with or without the example.
    measures
        By name, (n,) of all lines. One that the example lacks, or that is the same for all, says nothing and is left out;
        lines that lack one are the farthest.
    """
    others = population.copy()
    others[example] = False
    found = {}
    for name, value in measures.items():
        mine = value[example]
        if not np.isfinite(mine):
            continue
        apart = np.where(np.isfinite(value), np.abs(value - mine), np.inf)
        among = np.sort(apart[others])
        if len(among) and among[0] < among[-1]:
            found[name] = np.searchsorted(among, apart, side="right") / len(among)
    return found


def lines_alike(
    examples: BoolArray, right: BoolArray, candidates: BoolArray, measures: Mapping[str, FloatArray]
) -> list[Alike]:
    """Return the candidates that are like an example, the most alike first.

    Parameters
    ----------
    examples
        (n,) lines in which a person mended the fault, as they were before.
    right
        (n,) lines of which a person said that they are right.
    candidates
        (n,) lines in which the fault may be.
    measures
        By name, (n,) each, of lines of one kind: see `line_measures`.

    Notes
    -----
    Of each measure counts how few lines of the kind are as near to the example as the candidate is: a rank, so that units,
    sensors and the spread of a survey do not matter. The measures are added up by their logarithms (Fisher 1932). A
    candidate is listed below `LIKE_CHANCE`, unless a line that a person called right is as like the example. Where most lines of
    a kind have the fault, few of them are rare among the others, and few are listed.
    """
    population = examples | right | candidates
    n = int(population.sum())
    best: dict[int, Alike] = {}
    if n <= FEWEST_LINES:
        return []
    for example in np.flatnonzero(examples).tolist():
        shares = shares_as_near(example, population, measures)
        if not shares:
            continue
        names, each = list(shares), np.array(list(shares.values()))
        chance = chdtrc(2 * len(each), -2.0 * np.log(np.maximum(each, 0.5 / n)).sum(axis=0))
        is_like = (chance <= LIKE_CHANCE) & (chance < np.min(chance[right], initial=np.inf))
        for k in np.flatnonzero(candidates & is_like).tolist():
            if k in best and best[k].chance <= chance[k]:
                continue
            order = np.argsort(each[:, k], kind="stable").tolist()
            telling = [names[m] for m in order if each[m, k] <= _TELLING]
            best[k] = Alike(k, float(chance[k]), tuple(telling[:_MOST_NAMED]))
    return sorted(best.values(), key=lambda one: (one.chance, one.line))
