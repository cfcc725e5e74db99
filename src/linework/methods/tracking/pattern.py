"""The pattern of paint along a line: where it is solid and where dashed, and the single dashes.

Separate from `marking_lines`, which makes lines in space: this knows only intervals of paint along one axis.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.kernels.paint.rhythm import best_rhythm
from linework.kernels.paint.stripe_extent import LEAST_GAP_M
from linework.lines.dashes import ALIKE_DASHES_M, LEAST_WHOLE, N_NEAR, whole_dashes

#: Step at which paint is sampled along the line. [m]
PAINT_STEP_M = 0.10
#: Periods in use, dash and gap together: from 1 m + 1 m at crossings to 6 m + 18 m. [m]
PERIODS_M = (1.8, 26.0)
#: Shortest dash and gap in use. [m]
LEAST_DASH_M, LEAST_PAINT_GAP_M = 0.5, LEAST_GAP_M
#: Paint without a gap over more than this is solid: the longest dashes in use are 6 m long, and wear may close the gap
#: to a stain beside one. [m]
LONGEST_DASH_M = 8.0
#: Gaps shorter than this share of a rhythm's gap are wear, not gaps of the rhythm.
WEAR_SHARE_OF_GAP = 0.4
#: Fewest dashes of a dashed part of a line that is solid elsewhere: wear makes three of a solid one.
LEAST_INTERVALS = 4
#: Most by which distances from dash to dash of one rhythm differ, beside what leaves their ends unsharp. [share]
SPACING_SHARE = 0.1
#: Most of the pieces of paint of a line with several rhythms that belong to none of them. [share]
MOST_UNEXPLAINED = 0.1
#: Smallest share of the gap in the period (warning lines: 6 m of paint, 3 m of gap).
LEAST_GAP_SHARE = 0.28
#: Smallest share of the dash in the period: the least in use is 1 m of 6 m (United Kingdom, lane lines in towns). What is
#: less are stains, covers and the like in a row.
LEAST_SHARE_OF_PERIOD = 0.125
#: Largest share of paint at any place of the gap (stains, and two dashes that are seen as one); smallest in the dashes
#: beyond that, with 70 % worn off. Lines of patches alone, 60 to 120 m, 30 to 85 % worn, have a rhythm in 0.5 % of 1,500
#: cases at 0.08 and at 0.16, in 2.4 % at 0.25.
GAP_PAINT, DASH_PAINT = 0.16, 0.25
#: Fewest repetitions that show a period.
LEAST_PERIODS = 2.0
#: Share of paint that is left at most: no line is without any wear.
_MOST_EXPECTED = 0.99
#: Typical length of a patch that wear has removed [m]; a rhythm that patches produce with more than this chance does
#: not count.
PATCH_M, RHYTHM_CHANCE = 2.5, 0.005
#: A dash is whole if its length is this near the usual one. [m]
WHOLE_PAINT_M = ALIKE_DASHES_M
#: Range about the folded period in which the exact one lies, as a share of it, and the step in which it is looked for [m]:
#: in a bend, dashes of a line 4 m beside the axis of one of 150 m are drawn 1/37 (2.7 %) longer or shorter than there.
_PERIOD_REACH, _PERIOD_STEP_M = 0.03, 0.01
#: Lengths of the windows over which lines are judged: most patterns keep period and phase for 60 m; long ones need more to
#: be seen often enough, short ones are out of phase sooner in a bend. [m]
PATTERN_WINDOWS_M = (60.0, 120.0, math.inf, 30.0)
#: Most by which the whole length exceeds the longest one that is left, beside what wear leaves unsharp. [share]
WHOLE_SHARE = 0.05
#: Share of the gap up to which paint still belongs to the dash before it.
SLACK_SHARE = 0.3
#: Windows of paint whose best rhythm is kept: markings are sought two or three times over the same tracks, and where
#: nothing changed between, their paint is the same.
_FOLDS_KEPT = 8192


@dataclass(frozen=True, slots=True)
class PaintRhythm:
    """Dashes of `dash_m` every `period_m` [m]; contrast: share of paint in the dashes less that in the gaps."""

    period_m: float
    dash_m: float
    contrast: float


@dataclass(frozen=True, slots=True)
class PatternStretch:
    """A stretch of a line from `start_m` to `end_m` [m] with one pattern: a rhythm, or None where it is solid."""

    start_m: float
    end_m: float
    rhythm: PaintRhythm | None


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


def find_stretches(paint: FloatArray) -> list[PatternStretch]:
    """Return the stretches of a line with one pattern each, in order: lines change it before junctions and gores.

    Paint without a gap over more than a dash is solid; what lies between is dashed where it has a rhythm of its own. A
    dashed stretch reaches to where solid paint begins.

    Parameters
    ----------
    paint
        (k, 2) intervals of paint along a line [m], ascending.

    >>> dashes = np.arange(5)[:, None] * 9.0 + np.array([0.0, 3.0])
    >>> paint = np.concatenate([dashes, [[45.0, 65.0]], dashes + 68.0])
    >>> [(s.start_m, s.end_m, s.rhythm is not None) for s in find_stretches(paint)]
    [(0.0, 45.0, True), (45.0, 65.0, False), (65.0, 107.0, True)]
    """
    dashed = _dashed_parts(paint, LEAST_PAINT_GAP_M)
    # Between them the line is solid, from the first to the last paint
    first, last = float(paint[0, 0]), float(paint[:, 1].max())
    ends = [first, *(e for s in dashed for e in (s.start_m, s.end_m)), last]
    solid = [PatternStretch(a, b, None) for a, b in zip(ends[::2], ends[1::2], strict=True) if b > a]
    return sorted([*dashed, *solid], key=lambda s: s.start_m)


def _dashed_parts(paint: FloatArray, close_m: float) -> list[PatternStretch]:
    """Return the dashed stretches between solid paint, whose gaps of up to `close_m` are wear."""
    closed = merged_intervals(paint[:, 0], paint[:, 1], close_m)
    is_solid = closed[:, 1] - closed[:, 0] > LONGEST_DASH_M
    found: list[PatternStretch] = []
    for is_long, group in itertools.groupby(range(len(closed)), key=lambda k: bool(is_solid[k])):
        if is_long:
            continue
        run = list(group)
        start = closed[run[0] - 1, 1] if run[0] > 0 else closed[0, 0]
        end = closed[run[-1] + 1, 0] if run[-1] + 1 < len(closed) else closed[-1, 1]
        within = (paint[:, 0] >= closed[run[0], 0]) & (paint[:, 1] <= closed[run[-1], 1])
        found += _dashed_part(paint, within, (float(start), float(end)))
    return found


def _dashed_part(whole: FloatArray, within: BoolArray, ends_m: tuple[float, float]) -> list[PatternStretch]:
    """Return the dashed stretches of a part of a line's paint that has none longer than a dash; it reaches to `ends_m`.

    whole, within: (k, 2) intervals of the line [m], (k,) bool.
    """
    paint = whole[within]
    start_m, end_m = ends_m
    n = len(paint)
    runs = _other_rhythms(paint)
    if runs:
        # Each stretch reaches from the last paint of the one before it to its own, the last to the end
        limits = [start_m, *(float(paint[b - 1, 1]) for _, b, _ in runs[:-1]), end_m]
        return [
            PatternStretch(*ends, rhythm)
            for ends, (_, _, rhythm) in zip(itertools.pairwise(limits), runs, strict=True)
            if rhythm is not None
        ]
    # All of it; or beside a worn solid part, which has short pieces as well
    parts = [(0, n)]
    for k in range(1, n - LEAST_INTERVALS + 1):
        parts += [(k, n), (0, n - k)]
    for number, (a, b) in enumerate(parts):
        rhythm = find_rhythm(paint[a:b], RHYTHM_CHANCE if number == 0 else RHYTHM_CHANCE / len(parts))
        if rhythm is None or (b - a < len(whole) and len(dashes_of(paint[a:b], rhythm)) < LEAST_INTERVALS):
            continue
        start = start_m if a == 0 else float(paint[a - 1, 1])
        end = end_m if b == n else float(paint[b, 0])
        wear_m = WEAR_SHARE_OF_GAP * (rhythm.period_m - rhythm.dash_m)
        closed = merged_intervals(paint[a:b, 0], paint[a:b, 1], wear_m)
        if wear_m > LEAST_PAINT_GAP_M and np.max(closed[:, 1] - closed[:, 0]) > LONGEST_DASH_M:
            return [
                replace(
                    s,
                    start_m=start if s.start_m == paint[a, 0] else s.start_m,
                    end_m=end if s.end_m == paint[b - 1, 1] else s.end_m,
                )
                for s in _dashed_parts(paint[a:b], wear_m)
            ]
        return [PatternStretch(start, end, rhythm)]
    return []


def _other_rhythms(paint: FloatArray) -> list[tuple[int, int, PaintRhythm | None]]:
    """Return the parts of dashed paint that have rhythms of their own, in order: first, end, rhythm; [] if it has one.

    Before junctions dashes get shorter, or denser. Where dashes follow each other at one distance, and those elsewhere at
    another, rhythms of their own explain the paint better than one for all, and than none. Dashes that are missing here and
    there leave multiples of one distance, and are no other rhythm.

    paint: (k, 2) intervals without solid paint [m], ascending.
    """
    found: list[tuple[int, int, PaintRhythm | None]] = []
    evidence, all_of_it = 0.0, _fold_of(paint)
    # As many runs might begin as there are intervals
    chance = RHYTHM_CHANCE / len(paint)
    for a, b in _evenly_spaced(paint):
        fold = _fold_of(paint[a:b])
        if fold is not None and fold.evidence > -math.log(chance):
            found.append((a, b, fold.rhythm))
            evidence += fold.evidence + math.log(chance)
    periods = [rhythm.period_m for _, _, rhythm in found if rhythm is not None]
    least = min(periods, default=0.0)
    is_other = any(abs(period / least - round(period / least)) > SPACING_SHARE for period in periods)
    if not periods or (not is_other and all_of_it is not None):
        return []
    if all_of_it is not None and all_of_it.evidence >= evidence:
        return []
    parts: list[tuple[int, int, PaintRhythm | None]] = []
    for a, b, rhythm in [*found, (len(paint), len(paint), None)]:
        before = parts[-1][1] if parts else 0
        if a > before:
            # Beside dashes three more are none of a worn solid line
            fold = _fold_of(paint[before:a])
            is_dashed = fold is not None and fold.evidence > -math.log(chance)
            parts.append((before, a, fold.rhythm if fold is not None and is_dashed else None))
        if b > a:
            parts.append((a, b, rhythm))
    # Worn dashes leave a few evenly spaced pieces among others
    unexplained = sum(b - a for a, b, rhythm in parts if rhythm is None)
    return parts if unexplained <= MOST_UNEXPLAINED * len(paint) else []


def _evenly_spaced(paint: FloatArray) -> list[tuple[int, int]]:
    """Return the runs of `LEAST_INTERVALS` and more dashes at one distance from each other: first and end.

    >>> _evenly_spaced(np.array([[0.0, 3.0], [9.0, 12.0], [18.0, 21.0], [27.0, 30.0], [33.0, 36.0]]))
    [(0, 4)]
    """
    spacing = np.diff(paint, axis=0)
    runs, a = [], 0
    while a < len(spacing):
        b = a + 1
        usual = float(spacing[a].mean())
        while b < len(spacing) and np.all(
            np.abs(spacing[b] - usual) <= SPACING_SHARE * usual + WHOLE_PAINT_M
        ):
            b += 1
            usual = float(spacing[a:b].mean())
        if b - a + 1 >= LEAST_INTERVALS:
            runs.append((a, b + 1))
            # The last dash of a run may be the first of the next one; it belongs to this
            a = b + 1
        else:
            a += 1
    return runs


def find_rhythm(paint: FloatArray, chance: float = RHYTHM_CHANCE) -> PaintRhythm | None:
    """Return the rhythm of a dashed line, or None if the paint has none: a solid line, however worn.

    Parameters
    ----------
    paint
        (k, 2) intervals of paint along a line [m], ascending.
    chance
        Greatest chance with which wear may produce the rhythm.

    Notes
    -----
    The paint is folded over every period in use: in a dashed line one stretch of the period is free of paint in
    every repetition, and the rest is not. Wear removes paint, but not at the same place of each period. Along a bend the
    period changes, and a long line is out of phase with itself, so that lines are judged over windows of several lengths:
    windows of which more than half show one period show it together, and those that show it best decide. That they agree is
    evidence of its own, for which no more is asked of many windows than of one: of 4,000 solid lines of 60 to 300 m with
    patches worn off, 8 had a rhythm (2026-11-26, `tests.scenes.worn_lines`).
    """
    if len(paint) < 2 or np.max(paint[1:, 0] - paint[:-1, 1]) < LEAST_PAINT_GAP_M:
        return None
    start, end = float(paint[0, 0]), float(paint[-1, 1])
    numbers = (math.ceil((end - start) / length_m) for length_m in PATTERN_WINDOWS_M)
    most, found = math.log(1.0 / chance), None
    for n in dict.fromkeys(max(number, 1) for number in numbers):
        edges = np.linspace(start, end, n + 1)
        windows = [
            paint[(paint[:, 1] > a) & (paint[:, 0] < b)] for a, b in itertools.pairwise(edges.tolist())
        ]
        folds = sorted(filter(None, map(_fold_of, windows)), key=lambda fold: fold.rhythm.period_m)
        usual = folds[len(folds) // 2].rhythm.period_m if folds else 0.0
        alike = [fold for fold in folds if abs(fold.rhythm.period_m - usual) <= _PERIOD_REACH * usual]
        evidence = sum(fold.evidence for fold in alike)
        if 2 * len(alike) > n and evidence >= most:
            most, found = evidence, alike[len(alike) // 2].rhythm
    return found


@dataclass(frozen=True, slots=True)
class _Fold:
    """The best rhythm of paint, and the logarithm of the chance that wear produced it, with the sign turned."""

    rhythm: PaintRhythm
    evidence: float


def _fold_of(paint: FloatArray) -> _Fold | None:
    """Return the best rhythm of the paint within a window."""
    if len(paint) < 2:
        return None
    start, end = float(paint[0, 0]), float(paint[-1, 1])
    period, gap, inside, outside = _best_fold(paint.tobytes())
    if period - gap <= LEAST_SHARE_OF_PERIOD * period:
        return None
    # The chance that wear left so little paint in the gaps of a solid line, of whose paint as much is left as in the dashes
    n_patches = (end - start) / period * gap / PATCH_M
    rhythm = PaintRhythm(period, period - gap, inside - outside)
    return _Fold(rhythm, n_patches * _divergence(outside, inside))


def _divergence(share: float, expected: float) -> float:
    """Return how unlikely a share is where another is expected, per trial: exp(-n d) bounds the chance (Chernoff 1952, doi:10.1214/aoms/1177729330).

    >>> round(math.exp(-10 * _divergence(0.0, 0.5)), 6) == round(0.5**10, 6)
    True
    """
    expected = min(expected, _MOST_EXPECTED)
    some = share * math.log(share / expected) if share > 0.0 else 0.0
    return some + (1.0 - share) * math.log((1.0 - share) / (1.0 - expected))


@lru_cache(maxsize=_FOLDS_KEPT)
def _best_fold(paint: bytes) -> tuple[float, float, float, float]:
    """Return period, gap [m] and shares of the best rhythm of paint, zeros if none; paint: (k, 2) float64 [m]."""
    start_m, end_m = np.frombuffer(paint, dtype=np.float64).reshape(-1, 2).T
    start, end = float(start_m[0]), float(end_m[-1])
    n = max(round((end - start) / PAINT_STEP_M), 1)
    place: FloatArray = start + (np.arange(n, dtype=np.float64) + 0.5) * PAINT_STEP_M
    i = np.searchsorted(start_m, place, side="right") - 1
    is_paint = place < end_m[np.maximum(i, 0)]
    longest = min(PERIODS_M[1], (end - start + LEAST_PAINT_GAP_M) / LEAST_PERIODS)
    return best_rhythm(
        is_paint, PAINT_STEP_M, (PERIODS_M[0], longest), (LEAST_DASH_M, LEAST_PAINT_GAP_M, LEAST_GAP_SHARE),
        (GAP_PAINT, DASH_PAINT), LONGEST_DASH_M,
    )  # fmt: skip


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

    Dashes of one line have one length and one period. Each is folded upon the whole ones nearest to it, of which at least
    three are equally long: if they begin and end at one place of the period, that is the whole dash. Otherwise it is folded
    upon all around it: where at least two of them begin, and two end, at one place of the period, that is the whole dash,
    if it is no longer than the usual one. It contains the remains; if none does, they stay as they are.

    >>> dashes = np.array([[0.0, 3.0], [9.0, 12.0], [19.2, 20.1], [27.0, 30.0], [36.0, 39.0]])
    >>> restore_worn_dashes(dashes, PaintRhythm(9.0, 3.0, 0.9))[2].round(3).tolist()
    [18.0, 21.0]
    """
    if len(dashes) < LEAST_WHOLE + 1:
        return dashes
    length = dashes[:, 1] - dashes[:, 0]
    usual_m = min(float(length.max()), rhythm.dash_m)
    longest_m = (1.0 + WHOLE_SHARE) * usual_m + WHOLE_PAINT_M
    middle = dashes.mean(axis=1)
    out = dashes.copy()
    is_whole = whole_dashes(length)
    for i in np.flatnonzero((length < usual_m - WHOLE_PAINT_M) & ~is_whole).tolist():
        order = np.argsort(np.abs(middle - middle[i]), kind="stable")
        near = order[is_whole[order]][:N_NEAR]
        if len(near) >= LEAST_WHOLE:
            folded = _folded(dashes[near], np.rint((middle[near] - middle[i]) / rhythm.period_m), rhythm)
            start, end = folded.mean(axis=0).tolist()
            is_inside = start - WHOLE_PAINT_M <= dashes[i, 0] and dashes[i, 1] <= end + WHOLE_PAINT_M
            if np.ptp(folded, axis=0).max() <= WHOLE_PAINT_M and is_inside:
                out[i] = start, end
                continue
        # Along a bend the period changes: the nearest few may agree where more do not
        for n_near in (2 * N_NEAR + 1, N_NEAR + 1):
            near = order[:n_near]
            folded = _folded(dashes[near], np.rint((middle[near] - middle[i]) / rhythm.period_m), rhythm)
            start, second_start = np.sort(folded[:, 0])[:2].tolist()
            end, second_end = np.sort(folded[:, 1])[:-3:-1].tolist()
            agree = second_start - start <= WHOLE_PAINT_M and end - second_end <= WHOLE_PAINT_M
            if agree and end - start <= longest_m:
                out[i] = start, end
                break
    return out


def _folded(dashes: FloatArray, number: FloatArray, rhythm: PaintRhythm) -> FloatArray:
    """Return dashes (k, 2) moved by whole numbers (k,) of periods, of the period at which they cover the least length.

    The fold of the paint knows the period to a tenth or so. Remains of worn dashes lie anywhere within the whole one, so
    that neither their middles nor their ends are a period apart; but at the right period they do not reach beyond it.

    >>> worn = np.array([[0.0, 1.0], [11.0, 12.0], [18.0, 21.0], [28.0, 29.0], [36.3, 37.0], [45.0, 48.0]])
    >>> _folded(worn, np.arange(6.0), PaintRhythm(9.1, 3.0, 0.9)).round(2)[3].tolist()
    [1.0, 2.0]
    """
    steps = round(_PERIOD_REACH * rhythm.period_m / _PERIOD_STEP_M)
    # From the middle outwards: of equal periods the one nearest to the fold's
    tried = rhythm.period_m + _PERIOD_STEP_M * np.array(sorted(range(-steps, steps + 1), key=abs))
    starts, ends = (dashes[:, k] - tried[:, None] * number for k in (0, 1))
    best = int(np.argmin(np.round(ends.max(axis=1) - starts.min(axis=1), 6)))
    return np.column_stack([starts[best], ends[best]])
