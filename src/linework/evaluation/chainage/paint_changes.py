"""Where paint has worn away or was renewed between two surveys, from what the points of each show on the markings.

Separate from `paint_along`, which measures one survey.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.spatial import cKDTree

from linework.arrays import FloatArray, IntArray
from linework.evaluation.chainage.paint_along import paint_left
from linework.evaluation.chainage.paint_points import PaintPieces
from linework.evaluation.shifts import (
    FALSE_PER_KM,
    Chance,
    least_deviations,
    shifted_runs,
)
from linework.model.lines import LineSet

#: Pieces of both surveys this near show the same paint: half the length of a piece, and what surveys are apart. [m]
_SAME_M = 1.5
#: Length of a stretch that is judged, and what remaining paint errs by over it, from all causes: rms on simulated roads
#: (docs/report.md, seeds 2521 and 2522, 2026-11-23). [m, %]
_STRETCH_M, _STRETCH_SIGMA = 10.0, 4.8
#: Side of the cells that are counted for the length of the road. [m]
_CELL_M = 25.0


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


def paint_changes(lines: LineSet, old: PaintPieces, new: PaintPieces) -> list[PaintChange]:
    """Return the stretches of markings over which the remaining paint has changed by more than chance.

    Parameters
    ----------
    lines
        Lines of the old survey.
    old, new
        What the points of each survey show on its own markings, see `paint_pieces`: registered within half a metre.

    Notes
    -----
    Means over 10 m are judged as moves of lines are, see `shifts`, but by their stated deviations: all paint of a road may
    have worn, so that differences between surveys do not tell what chance is. As the pieces of a marking share one
    brightness of whole paint, the mean of a run must also exceed 1.96 deviations of a single stretch.
    """
    before, sigma_before, after, sigma_after, own = _pairs(old, new)
    if not len(own):
        return []
    judged = []
    for number in np.unique(old.line[own]).tolist():
        rows = np.flatnonzero(old.line[own] == number)
        line = shapely.linestrings(lines[number].xyz[:, :2])
        along = shapely.line_locate_point(line, shapely.points(old.xy[own[rows]]))
        at, stretch, count = np.unique(along // _STRETCH_M, return_inverse=True, return_counts=True)
        variance = sigma_before[rows] ** 2 + sigma_after[rows] ** 2
        noise = np.sqrt(np.bincount(stretch, weights=variance)) / count
        judged.append((
            number, _STRETCH_M * at, np.bincount(stretch, weights=before[rows]) / count,
            np.bincount(stretch, weights=after[rows]) / count, np.hypot(noise, np.sqrt(2.0) * _STRETCH_SIGMA),
        ))  # fmt: skip
    chance = Chance(1.0, np.zeros(0))
    n_stretches = sum(len(one[1]) for one in judged)
    road_km = len(np.unique(np.floor(old.xy[own] / _CELL_M), axis=0)) * _CELL_M / 1000.0
    least = least_deviations(n_stretches, chance.related, FALSE_PER_KM * road_km)
    found = []
    for number, at, was, now, sigma in judged:
        for a, b in shifted_runs((now - was) / sigma, chance, least):
            run = slice(a, b + 1)
            values, deviation = (
                (float(was[run].mean()), float(now[run].mean())),
                float(np.sqrt(np.mean(sigma[run] ** 2))),
            )
            if abs(values[1] - values[0]) > 1.96 * deviation:
                end = min(float(at[b]) + _STRETCH_M, float(lines.length_m[number]))
                found.append(PaintChange(number, float(at[a]), end, *values, deviation))
    return found


def _pairs(
    old: PaintPieces, new: PaintPieces
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, IntArray]:
    """Return paint left and its deviation before and after, and the pieces of the old survey that both show."""
    left, sigma = paint_left(old)
    left_new, sigma_new = paint_left(new)
    own, there = np.flatnonzero(np.isfinite(left)), np.flatnonzero(np.isfinite(left_new))
    if not len(own) or not len(there):
        none = np.zeros(0)
        return none, none, none, none, np.zeros(0, dtype=np.int64)
    origin = old.xy[own[0]]
    away, nearest = cKDTree(new.xy[there] - origin).query(old.xy[own] - origin)
    near = away <= _SAME_M
    own, there = own[near], there[nearest[near]]
    return left[own], sigma[own], left_new[there], sigma_new[there], own
