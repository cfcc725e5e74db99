"""Dashes of dashed markings along a route: lengths, gaps, and dashes that are missing.

Separate from `samples`: dashes are counted along their marking, not at stations.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely
from scipy.spatial import cKDTree

from linework.arrays import FloatArray, IntArray
from linework.evaluation.chainage.dash_ends import DashEnds
from linework.evaluation.chainage.dash_lengths import DashesOfStretch, dashes_of_stretch, likeliest_length
from linework.evaluation.chainage.samples import Sample
from linework.lines.crosscuts import Axis
from linework.lines.dashes import (
    ALIKE_DASHES_M,
    MarkingRhythm,
    dashes_along,
    dashes_by_marking,
    rhythm_of_whole,
)
from linework.model.lines import LineSet

#: Stations beyond this are those of another road. [m]
_FAR_M = 30.0
#: The rhythm is that of the dashes this near: means of markings are over 100 m (CS 126). [m]
_ABOUT_M = 50.0
#: Rhythms that differ by less than this many standard deviations of both are one. [deviations]
_BY_CHANCE = 2.0


def dash_samples(lines: LineSet, axis: Axis, ends: DashEnds | None = None) -> Iterator[Sample]:
    """Yield the length of each dash, the gap after it, and the number of dashes missing in it.

    Lengths are those of the marking's rhythm, from the whole dashes about the dash or, where these are alike, from all: of a worn dash less is left, and
    a single end is known to half the distance of scan lines only. Where no rhythm is known they are unknown, and those of
    a dash that is too long for it. A gap with room for more dashes is missing paint where the marking was measured; where
    it was bridged, the gap is not counted.

    Parameters
    ----------
    ends
        What the points show at the ends of the dashes: lengths are better known by them (`dashes_of_stretch`).
    """
    tree = cKDTree(axis.xyz[:, :2])
    for name, line, corners_of in dashes_by_marking(lines):
        along = dashes_along(lines[line].xyz, corners_of)
        middle = along.mean(axis=1)
        shape = shapely.linestrings(lines[line].xyz[:, :2])
        places = shapely.get_coordinates(shapely.line_interpolate_point(shape, middle))
        corners = shapely.get_coordinates(shapely.line_interpolate_point(shape, along.ravel())).reshape(
            -1, 2, 2
        )
        away, station = tree.query(places)
        of_all = rhythm_of_whole(along)
        seen = _lengths_by_points(along, of_all, ends, line)
        for i in np.flatnonzero(away <= _FAR_M).tolist():
            s = float(axis.station_m[station[i]])
            offset = float((places[i] - axis.xyz[station[i], :2]) @ axis.left[station[i]])
            rhythm = _rhythm_at(_rhythm_near(along[np.abs(middle - middle[i]) <= _ABOUT_M], of_all), of_all)
            rhythm = seen.get(i, rhythm)
            is_known = rhythm is not None and along[i, 1] - along[i, 0] <= rhythm.dash_m + ALIKE_DASHES_M
            # Of a dash at a hidden stretch a part may be hidden
            is_whole = is_known and not _is_bridged(lines, line, *corners[i])
            dash, gap, dash_sigma, gap_sigma = rhythm or MarkingRhythm(math.nan, math.nan)
            yield Sample(s, offset, "marking", "dash_length", name, dash if is_whole else None, dash_sigma)
            if i + 1 == len(along):
                continue
            is_known = is_known and not _is_bridged(lines, line, places[i], places[i + 1])
            missing = round((middle[i + 1] - middle[i]) / (dash + gap)) - 1 if is_known else 0
            yield Sample(
                s,
                offset,
                "marking",
                "missing_dashes",
                name,
                max(missing, 0.0) if is_known else None,
                math.nan,
            )
            if missing <= 0:
                yield Sample(s, offset, "marking", "gap_length", name, gap if is_known else None, gap_sigma)


def _lengths_by_points(
    along: FloatArray, of_all: MarkingRhythm | None, ends: DashEnds | None, line: int
) -> dict[int, MarkingRhythm | None]:
    """Return the rhythm of each dash of a marking from the points at the ends of all, by its number; of those that have one.

    Found stretch by stretch, as periods drift; stretches have one length unless theirs differ by more than chance makes.
    None where the likeliest length is farther from that of the lines than lengths are compared: lines and points disagree.
    """
    rows = np.flatnonzero(ends.line == line) if ends is not None else np.zeros(0, dtype=np.int64)
    if ends is None or of_all is None or len(rows) != len(along):
        return {}
    own = ends.take(rows)
    share = float(own.n_bright.sum()) / max(int(own.n_pairs.sum()), 1)
    stretch = ((along.mean(axis=1) - along[0].mean()) // (2.0 * _ABOUT_M)).astype(np.int64)
    found: list[tuple[IntArray, DashesOfStretch]] = []
    for k in np.unique(stretch).tolist():
        here = np.flatnonzero(stretch == k)
        near = _rhythm_near(along[here], of_all)
        if near is None or abs(near.dash_m - of_all.dash_m) > ALIKE_DASHES_M:
            near = of_all
        rhythm = MarkingRhythm(of_all.dash_m, near.dash_m + near.gap_m - of_all.dash_m)
        found.append((here, dashes_of_stretch(own.begin[here], own.end[here], share, along[here], rhythm)))
    likelihoods = np.sum([one.likelihood for _, one in found], axis=0)
    if np.argmax(likelihoods) in (0, len(likelihoods) - 1):
        return dict.fromkeys(range(len(along)))
    every = likeliest_length(of_all.dash_m, likelihoods)
    lengths: dict[int, MarkingRhythm | None] = {}
    for here, (period, likelihood) in found:
        alone = likeliest_length(of_all.dash_m, likelihood)
        by_chance = _BY_CHANCE * math.hypot(alone.sigma_m, every.sigma_m)
        dash = every if abs(alone.value_m - every.value_m) <= by_chance else alone
        gap_sigma = math.hypot(dash.sigma_m, period.sigma_m)
        rhythm = MarkingRhythm(dash.value_m, period.value_m - dash.value_m, dash.sigma_m, gap_sigma)
        lengths |= dict.fromkeys(here.tolist(), rhythm)
    return lengths


def _rhythm_near(along: FloatArray, of_all: MarkingRhythm | None) -> MarkingRhythm | None:
    """Return the rhythm of some dashes (k, 2) of a marking; None where it is that of every second or third of its dashes.

    Of a few dashes three whole ones may be two periods apart each, with worn ones between.
    """
    near = rhythm_of_whole(along)
    if near is None or of_all is None:
        return near
    period, usual = near.dash_m + near.gap_m, of_all.dash_m + of_all.gap_m
    times = round(period / usual)
    return None if times >= 2 and abs(period - times * usual) <= times * ALIKE_DASHES_M else near


def _rhythm_at(near: MarkingRhythm | None, of_all: MarkingRhythm | None) -> MarkingRhythm | None:
    """Return the rhythm at a dash from that of the dashes near it and that of its whole marking, None where both are unknown.

    Scan lines pass over neighbouring dashes alike, which cuts them to one length: only many dashes show the length between.
    So it is that of the whole marking, unless the dashes near differ from it by more than chance makes: then the marking
    has more than one rhythm. Where those near are much shorter at the same period, they were worn alike, as the marking has
    longer ones.
    """
    if near is None or of_all is None:
        return near or of_all
    off = abs(near.dash_m + near.gap_m - of_all.dash_m - of_all.gap_m)
    is_shorter = near.dash_m + ALIKE_DASHES_M < of_all.dash_m
    by_chance = _BY_CHANCE * math.hypot(near.dash_sigma_m, of_all.dash_sigma_m)
    is_one = is_shorter or abs(near.dash_m - of_all.dash_m) <= by_chance
    return of_all if is_one and off <= ALIKE_DASHES_M else near


def _is_bridged(lines: LineSet, i: int, a: FloatArray, b: FloatArray) -> bool:
    """Return whether a marking was carried across a gap anywhere between two places."""
    first, last = int(lines.offsets[i]), int(lines.offsets[i + 1])
    xy, bridged = lines.xyz[first:last, :2], lines.bridged[first:last]
    near = [int(np.argmin(np.linalg.norm(xy - place, axis=1))) for place in (a, b)]
    return bool(bridged[min(near) : max(near) + 1].any())
