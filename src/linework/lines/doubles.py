"""Double lines: two lines of paint side by side as the one line that they mean.

Separate from `merged`, which finds the same line measured twice: here two lines are two stripes of one marking.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import shapely
from scipy.spatial import cKDTree

from linework.arrays import FloatArray, IntArray, distance_along
from linework.lines.along import PLACE_STEP_M, line_stretch, places_along
from linework.lines.dashes import MarkingRhythm, dash_rhythms
from linework.lines.merged import DOUBLE_APART_M, SAME_FEATURE_M
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet

#: Lines beside each other over less are no double line: where roads part, lines run together for a while. [m]
_SHORTEST_M = 10.0
#: Stripes that turn from each other by more than this do not belong together. [cosine of 5 degrees]
_ALONG_COSINE = 0.9962
#: What one stripe is longer than the other by: the ends of solid lines are known to some decimetres. [m]
_REST_M = 1.0
#: Distance of the places at which the middle is taken at most. [m]
_STEP_M = 1.0
#: Nearest places of a place that are looked at: those within reach on two lines, and on its own.
_N_NEAREST = 16


class Stripe(NamedTuple):
    """One of the two lines of a double line: pattern, width, how far left of the middle [m], and its dashes if known."""

    pattern: str
    width_m: float
    offset_m: float
    rhythm: MarkingRhythm | None


class Doubles(NamedTuple):
    """Lines with each double line as one, and the stripes of these, right one first, by the line's number."""

    lines: LineSet
    stripes: dict[int, tuple[Stripe, Stripe]]


class _Pair(NamedTuple):
    """A stretch of one line [m] that has another beside it: their numbers, and the stretch of the other."""

    base: int
    other: int
    is_left: bool
    base_m: tuple[float, float]
    other_m: tuple[float, float]


def merged_doubles(lines: LineSet) -> Doubles:
    """Return lines in which each double line is one, along the middle of its stripes.

    Two lane markings, at least one of which is marked as `double`, are the stripes of one line where they run 0.15 to
    0.5 m beside each other over 10 m and more. What one of them is longer by stays a line of its own.

    The one line has the pattern of both from left to right ("solid_dashed"; "" where one is unknown), the width from
    outer edge to outer edge, both ids, the lower confidence, the mean of both deviations (stripes share most of their
    errors), and is bridged where both are. All else is that of the longer stripe.

    Examples
    --------
    >>> x = np.linspace(0.0, 50.0, 51)
    >>> rows = [np.column_stack([x, np.full(51, y), np.zeros(51)]) for y in (-0.1, 0.1, 3.5)]
    >>> found = merged_doubles(LineSet.from_lines(rows, kind=["lane_marking"] * 3, id=["a", "b", "c"],
    ...                                           pattern=["solid", "dashed", "solid"], double=[True, True, False])).lines
    >>> found.id.tolist(), found.pattern.tolist(), float(np.abs(found[0].xyz[:, 1]).max().round(6))
    (['b+a', 'c'], ['dashed_solid', 'solid'], 0.0)
    """
    pairs = _free(_pairs(lines))
    if not pairs:
        return Doubles(lines, {})
    rhythms = dash_rhythms(lines)
    taken: dict[int, list[tuple[float, float]]] = defaultdict(list)
    of_base: dict[int, list[_Pair]] = defaultdict(list)
    for pair in pairs:
        of_base[pair.base].append(pair)
        taken[pair.base].append(pair.base_m)
        taken[pair.other].append(pair.other_m)
    found: list[LineSet] = []
    stripes: dict[int, tuple[Stripe, Stripe]] = {}
    names: Counter[str] = Counter()
    for i in range(len(lines)):
        for pair in sorted(of_base.get(i, []), key=lambda one: one.base_m):
            line, both = _joined(lines, pair, rhythms)
            names[str(line.id[0])] += 1
            if line.id[0] and names[str(line.id[0])] > 1:
                line = line.with_columns(id=[f"{line.id[0]}.{names[str(line.id[0])]}"])
            stripes[len(found)] = both
            found.append(line)
        found += _rest(lines.take([i]), taken[i]) if i in taken else [lines.take([i])]
    return Doubles(LineSet.concatenate(found), stripes)


def _pairs(lines: LineSet) -> list[_Pair]:
    """Return the stretches of lines that have another beside them as the stripes of a double line have."""
    marks = np.flatnonzero((lines.kind == "lane_marking") & (lines.review != "rejected"))
    if not lines.double[marks].any():
        return []
    places = places_along(lines.take(marks))
    xy = places.xyz[:, :2]
    reach_m = float(np.hypot(DOUBLE_APART_M, PLACE_STEP_M))
    _, near = cKDTree(xy).query(xy, k=_N_NEAREST, distance_upper_bound=reach_m)
    at, k = np.nonzero(near < len(xy))
    other = near[at, k]
    is_other = places.line[at] != places.line[other]
    at, other = at[is_other], other[is_other]
    apart, way = xy[other] - xy[at], places.way[at]
    across = way[:, 0] * apart[:, 1] - way[:, 1] * apart[:, 0]
    along = (apart * way).sum(axis=1)
    is_beside = (np.abs(across) >= SAME_FEATURE_M) & (np.abs(across) <= DOUBLE_APART_M)
    is_beside &= (np.abs(along) <= PLACE_STEP_M) & (
        np.abs((way * places.way[other]).sum(axis=1)) >= _ALONG_COSINE
    )
    beside: dict[tuple[int, int, bool], list[int]] = defaultdict(list)
    for a, b, is_left in zip(at[is_beside], other[is_beside], across[is_beside] > 0, strict=True):
        beside[int(marks[places.line[a]]), int(marks[places.line[b]]), bool(is_left)].append(int(a))
    found = []
    for (base, line, is_left), listed in beside.items():
        if not (lines.double[base] or lines.double[line]) or _rank(lines, base) <= _rank(lines, line):
            continue
        found += _stretches(lines, base, line, is_left, places.chainage_m[np.unique(listed)])
    return found


def _rank(lines: LineSet, i: int) -> tuple[float, list[list[float]]]:
    """Return what orders lines by length; of lines as long as each other by their ends, whatever their order."""
    xyz = lines[i].xyz
    return round(float(lines.length_m[i]), 4), sorted(xyz[[0, -1]].tolist())


def _stretches(lines: LineSet, base: int, line: int, is_left: bool, at_m: FloatArray) -> list[_Pair]:
    """Return the stretches of a line with another beside it at these distances along it [m], long enough ones."""
    other = shapely.linestrings(lines[line].xyz[:, :2])
    whole, own = float(other.length), shapely.linestrings(lines[base].xyz[:, :2])
    cuts = [0, *(np.flatnonzero(np.diff(at_m) > _REST_M) + 1).tolist(), len(at_m)]
    found = []
    for first, last in pairwise(cuts):
        a, b = (_at_end(float(m), float(own.length)) for m in at_m[[first, last - 1]])
        if b - a < _SHORTEST_M:
            continue
        ends = shapely.line_locate_point(other, shapely.line_interpolate_point(own, [a, b]))
        c, d = sorted(_at_end(float(m), whole) for m in ends)
        found.append(_Pair(base, line, is_left, (a, b), (c, d)))
    return found


def _at_end(at_m: float, length_m: float) -> float:
    """Return a distance along a line, at its end where the rest would be shorter than `_REST_M`."""
    return 0.0 if at_m < _REST_M else length_m if length_m - at_m < _REST_M else at_m


def _free(pairs: list[_Pair]) -> list[_Pair]:
    """Return pairs no two of which use the same stretch of a line; of those that do, the longest."""
    taken: dict[int, list[tuple[float, float]]] = defaultdict(list)
    found = []
    for pair in sorted(pairs, key=lambda one: (one.base_m[0] - one.base_m[1], one.base_m, one.other_m)):
        spans = ((pair.base, pair.base_m), (pair.other, pair.other_m))
        if not any(a < high and low < b for line, (a, b) in spans for low, high in taken[line]):
            for line, span in spans:
                taken[line].append(span)
            found.append(pair)
    return found


def _joined(
    lines: LineSet, pair: _Pair, rhythms: Mapping[int, MarkingRhythm]
) -> tuple[LineSet, tuple[Stripe, Stripe]]:
    """Return the line along the middle of two stripes, and these from right to left."""
    base, other = lines.take([pair.base]), lines.take([pair.other])
    along = distance_along(base.xyz[:, :2], in_space=True)
    a, b = pair.base_m
    inside = along[(along > a + 1e-6) & (along < b - 1e-6)]
    cuts = np.concatenate([[a], inside, [b]])
    at = np.concatenate(
        [np.linspace(p, q, max(int(np.ceil((q - p) / _STEP_M)), 1) + 1)[:-1] for p, q in pairwise(cuts)]
    )
    at = np.append(at, b)
    own = _interpolated(base.xyz, along, at)
    along_other, at_other = distance_along(other.xyz[:, :2], in_space=True), _located(other, own)
    there = _interpolated(other.xyz, along_other, at_other)
    columns = {name: _nearest(getattr(base, name), along, at) for name in VERTEX_COLUMNS}
    beside = {name: _nearest(getattr(other, name), along_other, at_other) for name in VERTEX_COLUMNS}
    for name in ("sigma_xy_m", "sigma_z_m"):
        columns[name] = 0.5 * (columns[name] + beside[name])
    columns["bridged"] = columns["bridged"] & beside["bridged"]
    columns["observed"] = columns["observed"] | beside["observed"]
    half_m = 0.5 * float(np.median(np.hypot(*(there - own)[:, :2].T)))
    order = (pair.base, pair.other) if pair.is_left else (pair.other, pair.base)
    right, left = (lines.take([k]) for k in order)
    both = [
        Stripe(str(lines.pattern[k]), float(lines.width_m[k]), sign * half_m, rhythms.get(k))
        for k, sign in zip(order, (-1.0, 1.0), strict=True)
    ]
    of_line = {name: getattr(base, name) for name in LINE_COLUMNS}
    fields: dict[str, Any] = {
        "id": "+".join(name for name in (str(left.id[0]), str(right.id[0])) if name),
        "pattern": f"{left.pattern[0]}_{right.pattern[0]}" if left.pattern[0] and right.pattern[0] else "",
        "width_m": 2 * half_m + 0.5 * float(left.width_m[0] + right.width_m[0]),
        "confidence": float(min(left.confidence[0], right.confidence[0])), "double": True,
    }  # fmt: skip
    line = LineSet.from_lines([0.5 * (own + there)], crs=base.crs, **of_line, **columns)
    return line.with_columns(**{name: [value] for name, value in fields.items()}), (both[0], both[1])


def _located(line: LineSet, places: FloatArray) -> FloatArray:
    """Return how far along a line (n,) places are [m]."""
    return np.asarray(
        shapely.line_locate_point(shapely.linestrings(line.xyz[:, :2]), shapely.points(places[:, :2]))
    )


def _interpolated(xyz: FloatArray, along: FloatArray, at: FloatArray) -> FloatArray:
    return np.stack([np.interp(at, along, column) for column in xyz.T], axis=1)


def _nearest(values: Any, along: FloatArray, at: FloatArray) -> Any:
    """Return the values of vertices (n,) at the vertex after each place."""
    index: IntArray = np.clip(np.searchsorted(along, at), 0, len(along) - 1)
    return values[index]


def _rest(line: LineSet, taken: list[tuple[float, float]]) -> list[LineSet]:
    """Return what of a line no double line has."""
    length = float(distance_along(line.xyz[:, :2], in_space=True)[-1])
    cuts = [0.0, *(at for span in sorted(taken) for at in span), length]
    spans = [(a, b) for a, b in zip(cuts[::2], cuts[1::2], strict=True) if b - a >= _REST_M]
    found = [line_stretch(line, a, b) for a, b in spans]
    return [
        piece.with_columns(id=[f"{line.id[0]}.{k + 1}" if line.id[0] else ""])
        for k, piece in enumerate(found)
    ]
