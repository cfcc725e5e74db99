"""The pattern of paint along a line: solid or dashed, and the single dashes.

Separate from `marking_lines`, which makes lines in space: this knows only intervals of paint along one axis.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray
from linework.kernels.paint.rhythm import best_rhythm

#: Step at which paint is sampled along the line. [m]
PAINT_STEP_M = 0.10
#: Periods in use, dash and gap together: from 1 m + 1 m at crossings to 6 m + 18 m. [m]
PERIODS_M = (1.8, 26.0)
#: Shortest dash and gap in use. [m]
LEAST_DASH_M, LEAST_PAINT_GAP_M = 0.5, 0.8
#: Smallest share of the gap in the period (warning lines: 6 m of paint, 3 m of gap).
LEAST_GAP_SHARE = 0.28
#: Largest share of paint in the gaps (stains); smallest in the dashes beyond that, with 70 % worn off.
GAP_PAINT, DASH_PAINT = 0.08, 0.25
#: Fewest repetitions that show a period.
LEAST_PERIODS = 2.0
#: Typical length of a patch that wear has removed [m]; a rhythm that patches produce with more than this chance does
#: not count.
PATCH_M, RHYTHM_CHANCE = 2.5, 0.005
#: A dash is whole if its length is this near the usual one [m]; fewest whole dashes that show where others belong;
#: number of the nearest ones that are used.
WHOLE_PAINT_M, LEAST_WHOLE, N_NEAR = 0.25, 3, 4
#: Length over which a pattern keeps its period and phase: lines are judged over windows of it. [m]
PATTERN_WINDOW_M = 60.0
#: Quantile of the lengths of dashes that whole ones have: wear only shortens.
WHOLE_QUANTILE = 0.8
#: Share of the gap up to which paint still belongs to the dash before it.
SLACK_SHARE = 0.3


@dataclass(frozen=True, slots=True)
class PaintRhythm:
    """Dashes of `dash_m` every `period_m` [m]; contrast: share of paint in the dashes less that in the gaps."""

    period_m: float
    dash_m: float
    contrast: float


def merged_intervals(start_m: FloatArray, end_m: FloatArray, close_m: float) -> FloatArray:
    """Return the union of intervals [m], (k, 2), with gaps of up to `close_m` closed.

    >>> merged_intervals(np.array([0.0, 0.9, 5.0]), np.array([1.0, 2.0, 6.0]), 0.1).tolist()
    [[0.0, 2.0], [5.0, 6.0]]
    """
    if len(start_m) == 0:
        return np.zeros((0, 2))
    order = np.argsort(start_m, kind="stable")
    start, reach = start_m[order], np.maximum.accumulate(end_m[order])
    new = np.concatenate([[True], start[1:] > reach[:-1] + close_m])
    last = np.concatenate([np.flatnonzero(new)[1:] - 1, [len(start) - 1]])
    return np.column_stack([start[new], reach[last]])


def find_rhythm(paint: FloatArray) -> PaintRhythm | None:
    """Return the rhythm of a dashed line, or None if the paint has none: a solid line, however worn.

    Parameters
    ----------
    paint
        (k, 2) intervals of paint along a line [m], ascending.

    Notes
    -----
    The paint is folded over every period in use: in a dashed line one stretch of the period is free of paint in
    every repetition, and the rest is not. Wear removes paint, but not at the same place of each period. Long lines
    are judged window by window, and the majority decides.
    """
    if len(paint) < 2 or np.max(paint[1:, 0] - paint[:-1, 1]) < LEAST_PAINT_GAP_M:
        return None
    start, end = float(paint[0, 0]), float(paint[-1, 1])
    n = max(int((end - start) / PATTERN_WINDOW_M), 1)
    edges = np.linspace(start, end, n + 1)
    found = [
        _rhythm_within(paint[(paint[:, 1] > a) & (paint[:, 0] < b)])
        for a, b in itertools.pairwise(edges.tolist())
    ]
    rhythms = sorted((r for r in found if r is not None), key=lambda r: r.period_m)
    if 2 * len(rhythms) == n:  # a draw: the whole line decides
        return _rhythm_within(paint)
    return rhythms[len(rhythms) // 2] if 2 * len(rhythms) > n else None


def _rhythm_within(paint: FloatArray) -> PaintRhythm | None:
    """Return the rhythm of the paint within a window."""
    if len(paint) < 2:
        return None
    start, end = float(paint[0, 0]), float(paint[-1, 1])
    n = max(round((end - start) / PAINT_STEP_M), 1)
    place: FloatArray = start + (np.arange(n, dtype=np.float64) + 0.5) * PAINT_STEP_M
    i = np.searchsorted(paint[:, 0], place, side="right") - 1
    is_paint = place < paint[np.maximum(i, 0), 1]
    longest = min(PERIODS_M[1], (end - start + LEAST_PAINT_GAP_M) / LEAST_PERIODS)
    period, gap, contrast = best_rhythm(
        is_paint, PAINT_STEP_M, (PERIODS_M[0], longest), (LEAST_DASH_M, LEAST_PAINT_GAP_M, LEAST_GAP_SHARE),
        (GAP_PAINT, DASH_PAINT),
    )  # fmt: skip
    if period == 0.0:
        return None
    # The chance that wear left no paint in any of the gaps of a solid line
    n_patches = (end - start) / period * gap / PATCH_M
    if -n_patches * math.log(max(1.0 - contrast, 0.01)) < math.log(1.0 / RHYTHM_CHANCE):
        return None
    return PaintRhythm(period, period - gap, contrast)


def dashes_of(paint: FloatArray, rhythm: PaintRhythm) -> FloatArray:
    """Return the single dashes as intervals [m], (k, 2), from the first to the last paint of each.

    The remains of a worn dash belong together: all that ends within the length of a dash and some of the gap. The
    phase is taken from dash to dash, as it drifts along a road.

    Parameters
    ----------
    paint
        (n, 2) intervals of paint along a line [m], ascending.

    >>> paint = np.array([[0.0, 1.0], [1.8, 3.0], [9.0, 12.0]])
    >>> dashes_of(paint, PaintRhythm(9.0, 3.0, 0.9)).tolist()
    [[0.0, 3.0], [9.0, 12.0]]
    """
    slack_m = SLACK_SHARE * (rhythm.period_m - rhythm.dash_m)
    dashes: list[list[float]] = []
    for start, end in paint.tolist():
        if dashes and end <= dashes[-1][0] + rhythm.dash_m + slack_m:
            dashes[-1][1] = end
        else:
            dashes.append([start, end])
    return np.array(dashes).reshape(-1, 2)


def restore_worn_dashes(dashes: FloatArray, rhythm: PaintRhythm) -> FloatArray:
    """Return dashes (k, 2) [m], with those that wear has shortened extended to their full length.

    Dashes of one line have one length and one period. Where the whole dashes around a worn one predict an interval
    that contains its remains, that interval is the dash; otherwise it stays as it is.

    >>> dashes = np.array([[0.0, 3.0], [9.0, 12.0], [19.2, 20.1], [27.0, 30.0], [36.0, 39.0]])
    >>> restore_worn_dashes(dashes, PaintRhythm(9.0, 3.0, 0.9))[2].round(3).tolist()
    [18.0, 21.0]
    """
    length = dashes[:, 1] - dashes[:, 0]
    if len(dashes) < LEAST_WHOLE + 1:
        return dashes
    nominal = float(np.quantile(length, WHOLE_QUANTILE))
    whole = np.flatnonzero(np.abs(length - nominal) <= WHOLE_PAINT_M)
    if len(whole) < LEAST_WHOLE:
        return dashes
    middle = dashes.mean(axis=1)
    out = dashes.copy()
    for i in np.flatnonzero(length < nominal - WHOLE_PAINT_M).tolist():
        near = whole[np.argsort(np.abs(middle[whole] - middle[i]), kind="stable")[:N_NEAR]]
        number = np.rint((middle[near] - middle[i]) / rhythm.period_m)
        # Phase from the nearest whole dashes, each a whole number of periods away
        phase = middle[near] - number * rhythm.period_m
        place = float(np.median(phase))
        start, end = place - 0.5 * nominal, place + 0.5 * nominal
        agree = float(np.ptp(phase)) <= 2.0 * WHOLE_PAINT_M
        if agree and start - WHOLE_PAINT_M <= dashes[i, 0] and dashes[i, 1] <= end + WHOLE_PAINT_M:
            out[i] = min(start, dashes[i, 0]), max(end, dashes[i, 1])
    return out
