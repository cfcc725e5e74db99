"""Where paint has worn away or was renewed between two surveys, from what the points of each show on the markings.

Separate from `paint_along`, which measures one survey.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from scipy.spatial import cKDTree
from scipy.stats import norm

from linework.arrays import FloatArray, IntArray
from linework.evaluation.chainage.paint_along import paint_left
from linework.evaluation.chainage.paint_points import PaintPieces
from linework.evaluation.shifts import (
    FALSE_PER_KM,
    UNRELATED,
    Chance,
    least_deviations,
    shifted_runs,
)
from linework.model.lines import LineSet

#: Pieces of one marking this near show the same paint: half the length of a piece, and what is left of a shift along. [m]
_SAME_M = 1.5
#: Length of a stretch that is judged. [m]
_STRETCH_M = 10.0
#: What all pieces of a marking err by together, as they share one brightness of whole paint: rms of the mean differences
#: between two passes of 17 unchanged markings (simulated urban, motorway and straight roads, seeds 531 and 533,
#: 2026-11-24; ``benchmarks.epochs``). [%]
_COMMON_SIGMA = 4.0
#: Length of marking that has one such error: that of the markings it was taken from. [m]
_COMMON_M = 200.0


@dataclass(frozen=True, slots=True)
class PaintChange:
    """A stretch of a marking of the old survey with more or less paint in the new one.

    Parameters
    ----------
    line
        Number of the marking.
    from_m, to_m
        Ends along it. [m]
    before, after
        Shares of paint left. [%]
    sigma
        Standard deviation of their difference. [%]
    """

    line: int
    from_m: float
    to_m: float
    before: float
    after: float
    sigma: float


def paint_changes(
    old_lines: LineSet, new_lines: LineSet, old: PaintPieces, new: PaintPieces, place: FloatArray
) -> list[PaintChange]:
    """Return the stretches of markings over which the remaining paint has changed by more than chance.

    Parameters
    ----------
    old_lines, new_lines
        Lines of both surveys.
    old, new
        What the points of each survey show on its own markings, see `paint_pieces`.
    place
        (p, 2) where the pieces of the old survey are in the new one, after registration. [m, world]

    Notes
    -----
    Means over 10 m are judged as moves of lines are, see `shifts`, but by their stated deviations: all paint of a road may
    have worn, so that differences between surveys do not tell what chance is. Where a part was not measured in both, what
    lies before and behind is judged apart. The mean of a run is also judged by what all of a marking errs by together:
    that is drawn once a marking and not once a stretch, so that fewer of its deviations are more than chance.
    """
    pairs = _pairs(new_lines, old, new, place)
    own = pairs.own
    if not len(own):
        return []
    judged = []
    for number in np.unique(old.line[own]).tolist():
        rows = np.flatnonzero(old.line[own] == number)
        line = shapely.linestrings(old_lines[number].xyz[:, :2])
        along = shapely.line_locate_point(line, shapely.points(old.xy[own[rows]]))
        at, stretch, count = np.unique(along // _STRETCH_M, return_inverse=True, return_counts=True)
        noise = np.sqrt(np.bincount(stretch, weights=pairs.sigma[rows] ** 2)) / count
        was, now = (np.bincount(stretch, weights=v[rows]) / count for v in (pairs.before, pairs.after))
        parts = np.split(np.arange(len(at)), np.flatnonzero(np.diff(at) > 1) + 1)
        judged += [(number, _STRETCH_M * at[p], was[p], now[p], noise[p]) for p in parts]
    # Lines side by side are of one road
    n_stretches = sum(len(one[1]) for one in judged)
    road_km = _STRETCH_M / 1000.0 * max(
        sum(len(one[1]) for one in judged if one[0] == number) for number, *_ in judged
    )  # fmt: skip
    chance = Chance(1.0, UNRELATED)
    least = least_deviations(n_stretches, chance.filters, FALSE_PER_KM * road_km)
    n_common = sum(
        math.ceil(_STRETCH_M * sum(len(one[1]) for one in judged if one[0] == number) / _COMMON_M)
        for number in {number for number, *_ in judged}
    )
    least_common = float(norm.isf(0.5 * min(FALSE_PER_KM * road_km / n_common, 1.0)))
    found = []
    for number, at, was, now, noise in judged:
        for a, b in shifted_runs((now - was) / noise, chance, least):
            run = slice(a, b + 1)
            by_chance = float(np.sqrt(np.mean(noise[run] ** 2) / (b - a + 1)))
            deviation = float(np.hypot(by_chance, _COMMON_SIGMA))
            values = float(was[run].mean()), float(now[run].mean())
            if abs(values[1] - values[0]) > math.hypot(least * by_chance, least_common * _COMMON_SIGMA):
                end = min(float(at[b]) + _STRETCH_M, float(old_lines.length_m[number]))
                found.append(PaintChange(number, float(at[a]), end, *values, deviation))
    return found


class _Pairs(NamedTuple):
    """Pieces of the old survey (n,) that the new one shows too: which, their paint before and after, its deviation [%]."""

    own: IntArray
    before: FloatArray
    after: FloatArray
    sigma: FloatArray


def _pairs(new_lines: LineSet, old: PaintPieces, new: PaintPieces, place: FloatArray) -> _Pairs:
    """Return the pieces that both surveys show: of the nearest marking whose paint overlaps, the nearest piece."""
    left, sigma = paint_left(old)
    left_new, sigma_new = paint_left(new)
    own, there = np.flatnonzero(np.isfinite(left)), np.flatnonzero(np.isfinite(left_new))
    partner = np.full(len(own), -1)
    if len(own) and len(there):
        numbers = np.unique(new.line[there])
        shapes = [shapely.linestrings(new_lines[number].xyz[:, :2]) for number in numbers.tolist()]
        points = shapely.points(place[own])
        # Paint that is a width away from where it was is other paint
        row, shape = shapely.STRtree(shapes).query(points, predicate="dwithin", distance=old.width_m[own])
        away = shapely.distance(points[row], np.array(shapes, dtype=object)[shape])
        nearest = np.lexsort((shape, away, row))
        row, shape = (v[nearest][np.diff(row[nearest], prepend=-1) > 0] for v in (row, shape))
        for k in np.unique(shape).tolist():
            rows, pieces = row[shape == k], there[new.line[there] == numbers[k]]
            off, which = cKDTree(new.xy[pieces] - place[own[0]]).query(place[own[rows]] - place[own[0]])
            partner[rows[off <= _SAME_M]] = pieces[which[off <= _SAME_M]]
    own, partner = own[partner >= 0], partner[partner >= 0]
    return _Pairs(own, left[own], left_new[partner], np.hypot(sigma[own], sigma_new[partner]))
