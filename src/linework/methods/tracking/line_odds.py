"""How likely pieces of paint in a row are one line: what was measured speaks for it, visible bare road against it.

Separate from `against_paint`, which weighs whether the pieces are paint at all: this takes them as paint.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import expit

from linework.arrays import FloatArray
from linework.methods.protocol import VISIBLE_STEP_M, Sight
from linework.methods.tracking.fitted import ROW_LOG_ODDS, STRAY_PATCHES
from linework.methods.tracking.pattern import PATCH_M, PERIODS_M, PaintRhythm
from linework.methods.tracking.smooth import SmoothLine

#: Longest arrow or letter [m]: 7.5 m where traffic is fast. Symbols of a lane that are repeated are read apart: farther from
#: each other than the longest of them is. [m]
LONGEST_SYMBOL_M, SYMBOLS_APART_M = 7.5, 10.0
#: Dashes that period, phase and length are fitted to.
FREE_DASHES = 3
#: Why pieces of paint are more likely in a row by chance than one line.
BARE_ROW = "mostly bare road: its pieces may lie in a row by chance"

SYMBOLS = "half a lane beside a line, in pieces no longer than symbols"
#: By how much a dash misses the next one that it points at, as a standard deviation [m]: half a lane off (1.25 m and more) it
#: points at the next lane's. Dashes of 3 m every 12 m on a bend of 60 m radius miss by 0.7 m, 1 m every 2 m on one of 6 m by 0.1.
_MISS_M = 1.0
#: Logarithm of the likelihood of what is two standard deviations off.
TWO_SIGMAS = -2.0
#: Why dashes are lines of their own.
POINT_ELSEWHERE = "do not point at one another around a bend: lines of their own, not dashes"


def odds_of_line(
    line: SmoothLine,
    paint: FloatArray,
    rhythm: PaintRhythm | None,
    dashes: FloatArray,
    visible: Sight,
    lane_sides: int = 0,
) -> float:
    """Return the logarithm of the odds that pieces of paint are one line, not a few that lie in a row by chance.

    Each patch of paint that is there, and each that is not though the road was seen, is more likely on a line as worn as
    this one or on none; what is hidden says nothing. Of a dashed line patches are its dashes. Half a lane beside another
    line there are arrows and letters: a piece as long as one is one patch, whatever its length, and between two such
    lines arrows stand in rows.

    Patches are taken as independent, though wear and what hides them go over several alike: long rows are judged surer
    than they are. Each dash beyond the third adds ln(period / dash): a stripe anywhere in a period lies in a dash's
    place by chance in dash / period of all cases. That, too, is taken as independent, of other dashes and of the patches.

    Arrows and covers are repeated at equal distances as well. Where only every second or third dash of a rhythm is there,
    farther apart than any dashes in use, the others are missing where they would be if there was such a row; and in the
    middle of a lane whatever is as far apart as arrows are is more likely to be some.

    Parameters
    ----------
    paint, dashes
        (k, 2) and (d, 2) intervals along the line, ascending. [m]
    visible
        Whether road or ground was measured at places [m, local].
    lane_sides
        On how many sides another line is half a lane away, 0 to 2.
    """
    in_rows = ROW_LOG_ODDS if lane_sides > 1 else 0.0
    if rhythm is None:
        length = paint[:, 1] - paint[:, 0]
        patches = float(np.maximum(1.0, length / PATCH_M).sum())
        if lane_sides > 0:
            patches = float((1.0 + np.maximum(length - LONGEST_SYMBOL_M, 0.0) / PATCH_M).sum())
        return in_rows + log_odds(patches, _bare_m(line, paint, visible) / PATCH_M)
    missing = 0.0
    for gap in np.column_stack([dashes[:-1, 1], dashes[1:, 0]]):
        gone = round((float(gap[1] - gap[0]) + rhythm.dash_m) / rhythm.period_m) - 1
        if gone > 0:
            seen_m = _bare_m(line, np.array([[gap[0], gap[0]], [gap[1], gap[1]]]), visible)
            missing += gone * min(seen_m / float(gap[1] - gap[0]), 1.0)
    # Three dashes make a period; that each further one lies in its place would be chance without a line
    in_place = max(len(dashes) - FREE_DASHES, 0) * math.log(rhythm.period_m / rhythm.dash_m)
    by_chance = in_rows + log_odds(len(dashes), missing) + in_place
    if lane_sides > 1 and rhythm.period_m >= SYMBOLS_APART_M:
        prior = ROW_LOG_ODDS
    elif _are_repeated_farther(dashes, rhythm):
        prior = -ROW_LOG_ODDS
    else:
        return by_chance
    return odds_against_both(by_chance, _log_odds_of_dashes(len(dashes), missing, prior))


def log_odds_of_bend(line: SmoothLine, rhythm: PaintRhythm, dashes: FloatArray) -> float:
    """Return the logarithm of the likelihood of dashes (d, 2) [m] that miss one another, 0 on a straight line.

    Dashes are read as one line because each points at the next, however the line bends between them.
    """
    gap = dashes[1:, 0] - dashes[:-1, 1]
    is_next = gap < rhythm.period_m
    if not is_next.any():
        return 0.0
    before, behind = (
        np.column_stack([np.interp(t[is_next], line.t_m, c) for c in line.normal.T])
        for t in (dashes[:-1, 1], dashes[1:, 0])
    )
    turn = np.arctan2(
        before[:, 0] * behind[:, 1] - before[:, 1] * behind[:, 0], np.sum(before * behind, axis=1)
    )
    # The tangent of an arc leaves it by this at its end
    miss_m = float(np.median(0.5 * np.abs(turn) * gap[is_next]))
    return -0.5 * (miss_m / _MISS_M) ** 2


def odds_against_both(first: float, second: float) -> float:
    """Return the logarithm of the odds against two other explanations, from those against each of them."""
    return -float(np.logaddexp(-first, -second))


def _are_repeated_farther(dashes: FloatArray, rhythm: PaintRhythm) -> bool:
    """Return whether only every n-th dash of a rhythm (d, 2) [m] is there, farther apart than dashes in use."""
    middle = dashes.mean(axis=1)
    every = int(np.gcd.reduce(np.rint(np.diff(middle) / rhythm.period_m).astype(np.int64), initial=0))
    return every > 1 and every * rhythm.period_m > PERIODS_M[1]


def _log_odds_of_dashes(painted: float, bare: float, prior: float) -> float:
    """Return the logarithm of the odds of worn dashes against what is repeated at the places of those that are left.

    A row of the latter has all that is seen, and lacks all that is missing; dashes as worn as these do so by chance.
    prior: the logarithm of the odds before anything was seen.
    """
    gone = (bare + 0.5) / (painted + bare + 1.0)
    return prior + painted * math.log(1.0 - gone) + bare * math.log(gone)


def log_odds(painted: float, bare: float) -> float:
    """Return the logarithm of the odds of a line by its patches of paint and of visible bare road.

    >>> log_odds(30, 20) > 30, log_odds(3, 23) < 0
    (True, True)
    """
    # Half a patch more of each: a line may be whole, but not known to be
    gone = (bare + 0.5) / (painted + bare + 1.0)
    there, missing = math.log((1.0 - gone) / STRAY_PATCHES), math.log(gone / (1.0 - STRAY_PATCHES))
    return ROW_LOG_ODDS + painted * there + bare * missing


def chance_of_line(odds: float) -> float:
    """Return the chance that belongs to a logarithm of odds, 0 to 1."""
    return float(expit(odds))


def _bare_m(line: SmoothLine, paint: FloatArray, visible: Sight) -> float:
    """Return the length of visible bare road between pieces of paint (k, 2) along a line [m]."""
    total = 0.0
    for start, end in zip(paint[:-1, 1].tolist(), paint[1:, 0].tolist(), strict=True):
        n = max(int((end - start) / VISIBLE_STEP_M), 1)
        t = start + (np.arange(n) + 0.5) / n * (end - start)
        xy = np.column_stack([np.interp(t, line.t_m, line.xyz[:, axis]) for axis in range(2)])
        total += (end - start) * float(np.mean(visible(xy)))
    return total
