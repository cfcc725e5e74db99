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
    related_of,
    scale_of,
    shifted_runs,
)
from linework.model.lines import LineSet

#: Pieces of both surveys this near show the same paint: half the length of a piece, and what surveys are apart. [m]
_SAME_M = 1.5
#: What remaining paint errs by however many pieces are taken, as all share one brightness of whole paint: rms over 10 m of
#: simulated roads (docs/report.md, seeds 2521 and 2522, 2026-11-23). [%]
_COMMON_SIGMA = 4.8
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
    Differences of pieces are judged as moves of lines are, see `shifts`; the mean of a stretch also exceeds 1.96 standard
    deviations of what all pieces of a marking err by together.
    """
    before, sigma_before, after, sigma_after, own = _pairs(old, new)
    if not len(own):
        return []
    sigma = np.hypot(sigma_before, sigma_after)
    rows_of, along_of = [], []
    for number in np.unique(old.line[own]).tolist():
        rows = np.flatnonzero(old.line[own] == number)
        line = shapely.linestrings(lines[number].xyz[:, :2])
        along = shapely.line_locate_point(line, shapely.points(old.xy[own[rows]]))
        order = np.argsort(along, kind="stable")
        rows_of.append(rows[order])
        along_of.append(along[order])
    sequences = [(after[rows] - before[rows]) / sigma[rows] for rows in rows_of]
    scale = scale_of(sequences)
    chance = Chance(scale, related_of([s / scale for s in sequences]))
    road_km = len(np.unique(np.floor(old.xy[own] / _CELL_M), axis=0)) * _CELL_M / 1000.0
    least = least_deviations(len(own), chance.related, FALSE_PER_KM * road_km)
    found = []
    for rows, along, sequence in zip(rows_of, along_of, sequences, strict=True):
        for a, b in shifted_runs(sequence, chance, least):
            run, half = rows[a : b + 1], 0.5 * old.length_m[own[rows[[a, b]]]]
            values = float(before[run].mean()), float(after[run].mean())
            by_chance = chance.deviation(len(run)) * float(np.sqrt(np.mean(sigma[run] ** 2)))
            deviation = float(np.hypot(by_chance, np.sqrt(2.0) * _COMMON_SIGMA))
            if abs(values[1] - values[0]) > 1.96 * deviation:
                ends = max(float(along[a] - half[0]), 0.0), float(along[b] + half[1])
                found.append(PaintChange(int(old.line[own[run[0]]]), *ends, *values, deviation))
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
