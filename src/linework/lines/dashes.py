"""Dashes of dashed markings: which belong to which, and their rhythm."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from scipy.spatial import cKDTree

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.model.lines import LineSet

#: A dash belongs to the marking whose line is this near to its middle. [m]
_NEAR_M = 0.3
#: Fewest dashes whose median says what the rhythm of a marking is: more than half of the gaps between four are single.
_FEWEST = 4
#: Whole dashes are equally long within this: an end is known to half the distance of scan lines, 0.1 m and more. [m]
ALIKE_DASHES_M = 0.25
#: Rounds after which shares of whole dashes change by less than a thousandth.
_N_ROUNDS = 30
#: Fewest equally long dashes that show a rhythm: a line through the middles of three has a scatter.
LEAST_WHOLE = 3
#: Dashes less than this many times the least distance apart are next to each other.
_SINGLE = 1.5
#: Share of the steps between whole dashes that are one period: below it, the shortest step is a stray dash in a space.
_LEAST_SUCCESSIVE = 0.3
#: Dashes lie within this share of a period of their places: places at random are 0.29 periods off.
_LEAST_REGULAR = 0.1
#: Worn dashes were restored from as many whole ones about them, so that more are not independent: `methods.tracking.pattern`.
N_NEAR = 4
#: Of more lengths, as many quantiles stand for all: pairs are a square of their number.
_MOST_PAIRED = 500
#: Paint looks bright as far as the spot of a beam touches it: ends are up to half a spot of some 2 cm beyond it. [m]
_SPOT_M = 0.02


class MarkingRhythm(NamedTuple):
    """Length [m] of the dashes of a marking, and of the gaps between them, with their standard deviations."""

    dash_m: float
    gap_m: float
    dash_sigma_m: float = math.nan
    gap_sigma_m: float = math.nan


def dash_rhythms(lines: LineSet) -> dict[int, MarkingRhythm]:
    """Return the rhythm of dashed markings with four dashes and more, by the number of the marking.

    >>> rows = [[[0, 0, 0], [40, 0, 0]], *([[x, 0, 0], [x + 3, 0, 0]] for x in (0, 9, 18, 27))]
    >>> kinds = ["lane_marking", *["lane_marking_dash"] * 4]
    >>> dash_rhythms(LineSet.from_lines(rows, kind=kinds, pattern=["dashed"] * 5))[0][:2]
    (3.0, 6.0)
    """
    found = {}
    for _, i, ends in dashes_by_marking(lines):
        if len(ends) < _FEWEST:
            continue
        along = dashes_along(lines[i].xyz, ends)
        found[i] = rhythm_of_whole(along) or MarkingRhythm(
            float(np.median(along[:, 1] - along[:, 0])), float(np.median(along[1:, 0] - along[:-1, 1]))
        )
    return found


def dashes_along(xyz: FloatArray, ends: FloatArray) -> FloatArray:
    """Return the begin and end of dashes along their marking (k, 2) [m], ascending.

    Parameters
    ----------
    xyz
        (n, 3) vertices of the marking. [m, world]
    ends
        (k, 2, 2) both ends of each dash in plan. [m, world]
    """
    middle = shapely.line_locate_point(shapely.linestrings(xyz[:, :2]), shapely.points(ends.mean(axis=1)))
    half = 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    order = np.argsort(middle, kind="stable")
    return np.asarray(np.column_stack([middle - half, middle + half])[order])


def whole_dashes(length_m: FloatArray) -> BoolArray:
    """Return which dashes (k,) are more likely whole than worn.

    Whole dashes of a marking have one length, with the errors of their ends; what wear left of one, or a stain made longer,
    has any length. Shares, length and scatter of the two are those that explain all lengths best (by expectation and
    maximisation, Dempster 1977, doi:10.1111/j.2517-6161.1977.tb01600.x), begun with the most lengths within `ALIKE_DASHES_M`,
    of equal numbers the longest.

    >>> whole_dashes(np.array([3.0, 1.1, 2.95, 3.02, 1.9, 2.5])).tolist()
    [True, False, True, True, False, False]
    """
    if not len(length_m):
        return np.zeros(0, dtype=bool)
    ascending = np.sort(length_m)
    n_alike = np.searchsorted(ascending, ascending + ALIKE_DASHES_M, side="right") - np.arange(len(ascending))
    shortest = ascending[len(ascending) - 1 - int(np.argmax(n_alike[::-1]))]
    chance = np.where((length_m >= shortest) & (length_m <= shortest + ALIKE_DASHES_M), 1.0, 0.0)
    for _ in range(_N_ROUNDS):
        n = float(chance.sum())
        mean = float(chance @ length_m) / n
        sigma = max(math.sqrt(float(chance @ (length_m - mean) ** 2) / n), _SPOT_M)
        whole = (
            n
            / len(length_m)
            * np.exp(-0.5 * ((length_m - mean) / sigma) ** 2)
            / (sigma * math.sqrt(2.0 * math.pi))
        )
        chance = whole / (whole + (1.0 - n / len(length_m)) / ascending[-1])
    return np.asarray(chance > 0.5)


def rhythm_of_whole(dashes: FloatArray) -> MarkingRhythm | None:
    """Return the rhythm of the whole dashes of a stretch, None where less than three are equally long and a whole number of periods apart, or half of all lie elsewhere.

    A single end is as far off as half the distance of scan lines. A mean over many dashes is not, and the period is
    known better still, as it adds up from the first whole dash to the last. Wear makes dashes shorter: where three or more
    are longer than the most and cover their places, the most were cut alike, and the longer ones are whole. Less than three
    were drawn through a gap. Every second dash may be cut longer: others in the middle of the gaps are dashes, too.

    Parameters
    ----------
    dashes
        (k, 2) begin and end along the marking [m], ascending.

    Examples
    --------
    >>> worn = np.array([[0.0, 3.0], [9.0, 12.0], [18.6, 20.0], [27.0, 30.0], [45.0, 48.0]])
    >>> [round(value, 3) for value in rhythm_of_whole(worn)[:2]]
    [3.0, 6.0]
    """
    length = dashes[:, 1] - dashes[:, 0]
    found, chosen = None, np.arange(len(dashes))
    while len(chosen):
        chosen = chosen[whole_dashes(length[chosen])]
        rhythm = _rhythm_of(dashes[chosen])
        if rhythm is None:
            break
        rhythm = _with_those_between(rhythm, dashes, chosen)
        period = rhythm.dash_m + rhythm.gap_m
        is_of_it = _is_at_its_place(rhythm, dashes, chosen, period)
        if 2 * np.count_nonzero(is_of_it) >= len(dashes):
            found = rhythm
        # What is as long as a period are two dashes that were joined
        chosen = np.flatnonzero(is_of_it & (length > rhythm.dash_m + ALIKE_DASHES_M) & (length < period))
    return found


def _is_at_its_place(
    rhythm: MarkingRhythm, dashes: FloatArray, whole: IntArray, period_m: float
) -> BoolArray:
    """Return which dashes (k,) lie whole periods from the whole ones, their numbers (n,): a worn one by up to half of what it lost."""
    length, middle = dashes[:, 1] - dashes[:, 0], dashes.mean(axis=1)
    off = middle - middle[whole[0]]
    off -= np.median((off - period_m * np.rint(off / period_m))[whole])
    beyond = np.abs(off - period_m * np.rint(off / period_m)) - 0.5 * np.abs(length - rhythm.dash_m)
    return np.asarray(beyond <= ALIKE_DASHES_M)


def _with_those_between(rhythm: MarkingRhythm, dashes: FloatArray, whole: IntArray) -> MarkingRhythm:
    """Return the rhythm with half its period where dashes lie in the middle of most of its gaps.

    Scan lines may cut every second dash longer, and these pass for the whole ones. What is less than half as long may be
    anything, and a single one is a stray.
    """
    period = rhythm.dash_m + rhythm.gap_m
    length, middle = dashes[:, 1] - dashes[:, 0], dashes.mean(axis=1)
    is_between = (
        (middle > middle[whole[0]])
        & (middle < middle[whole[-1]])
        & (2 * length >= rhythm.dash_m)
        & _is_at_its_place(rhythm, dashes, whole, period / 2)
        & ~_is_at_its_place(rhythm, dashes, whole, period)
    )
    gaps = np.unique(np.floor((middle[is_between] - middle[whole[0]]) / period))
    n_gaps = round(float(middle[whole[-1]] - middle[whole[0]]) / period)
    if 2 * len(gaps) <= n_gaps or period / 2 <= rhythm.dash_m:
        return rhythm
    return rhythm._replace(gap_m=period / 2 - rhythm.dash_m)


def _rhythm_of(whole: FloatArray) -> MarkingRhythm | None:
    """Return the rhythm of dashes (n, 2) of one length; None of less than three, or where they are not whole periods apart."""
    n = len(whole)
    if n < LEAST_WHOLE:
        return None
    length, middle = whole[:, 1] - whole[:, 0], whole.mean(axis=1)
    step = np.diff(middle)
    if step.min() <= length.mean():
        # Dashes on each other: two surveys of one marking, or a patch
        return None
    single = float(np.median(step[step <= _SINGLE * step.min()]))
    periods = np.rint(step / single)
    if np.mean(periods == 1.0) < _LEAST_SUCCESSIVE:
        return None
    number = np.concatenate([[0.0], np.cumsum(periods)])
    number -= number.mean()
    spread = float(number @ number)
    period = float(number @ middle) / spread
    off = middle - middle.mean() - period * number
    if math.sqrt(float(off @ off) / n) > min(ALIKE_DASHES_M, _LEAST_REGULAR * period):
        return None
    n_own = min(n, N_NEAR)
    scatter = float(length.var(ddof=1))
    # Ends that err by themselves make lengths scatter twice as much as middles. Where lengths do not, scan lines at one
    # distance cut all dashes to one length: the rest is the error of all of them, and of their mean
    shared = max(4.0 * float(off @ off) / (n - 2) - scatter, 0.0)
    dash_sigma = math.sqrt(scatter / n_own + shared + _SPOT_M**2 / 3.0)
    period_sigma = math.sqrt(float(off @ off) / (n - 2) / spread)
    dash = middle_of_pairs(length)
    return MarkingRhythm(dash, period - dash, dash_sigma, math.hypot(dash_sigma, period_sigma))


def middle_of_pairs(length_m: FloatArray) -> float:
    """Return the median of the means of all pairs of lengths (n,), each with itself too [m].

    What has lost a little at its ends passes for whole, and wear has one sign: up to 29 % of such dashes do not matter. Scan
    lines make dashes of one length either of two lengths, one line more or less. Their median is one of the two, though the
    truth lies between; that of pairs does, too (Hodges and Lehmann 1963, doi:10.1214/aoms/1177704172).

    >>> middle_of_pairs(np.array([3.1, 3.1, 3.1, 2.9, 2.9]))
    3.0
    """
    n = min(len(length_m), _MOST_PAIRED)
    level = np.quantile(length_m, (np.arange(n) + 0.5) / n, method="hazen")
    one, other = np.triu_indices(n)
    return float(np.median(0.5 * (level[one] + level[other])))


def dashes_by_marking(lines: LineSet) -> Iterator[tuple[str, int, FloatArray]]:
    """Yield the id and the number of each dashed marking, and the ends (k, 2, 2) of its dashes."""
    marks = np.flatnonzero((lines.kind == "lane_marking") & (lines.pattern == "dashed"))
    dashes = np.flatnonzero(lines.kind == "lane_marking_dash")
    if not len(marks) or not len(dashes):
        return
    places, owner = [], []
    for i in marks.tolist():
        xy = lines[i].xyz[:, :2]
        for a, b in pairwise(xy):
            n = max(math.ceil(float(np.linalg.norm(b - a)) / (_NEAR_M / 2)), 1)
            places.append(a + np.linspace(0.0, 1.0, n + 1)[:, None] * (b - a))
            owner.append(np.full(n + 1, i))
    tree, owners = cKDTree(np.concatenate(places)), np.concatenate(owner)
    found: dict[int, list[FloatArray]] = defaultdict(list)
    for i in dashes.tolist():
        xy = lines[i].xyz[:, :2]
        away, nearest = tree.query((xy[0] + xy[-1]) / 2)
        if away <= _NEAR_M:
            found[int(owners[nearest])].append(np.stack([xy[0], xy[-1]]))
    for i in sorted(found):
        yield str(lines.id[i]) or f"line {i + 1}", i, np.stack(found[i])
