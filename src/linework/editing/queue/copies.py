"""Lines that may be one line measured twice: two of a kind that run closer to each other than two lines can.

Separate from `suspects`: this compares lines with each other, that looks at each by itself.
"""

from __future__ import annotations

import numpy as np
import shapely

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray, distance_along, offsets_of
from linework.editing.queue.suspects import REVIEWED_TOGETHER, Suspect, line_middle, view_box
from linework.model.lines import STACKED_FORM, LineSet

#: Length over which two lines run together before they are queued: shorter, they may cross or meet. [m]
LEAST_TOGETHER_M = 5.0
#: Share of the weaker line's length that runs along the other.
_LEAST_SHARE = 0.5
#: Distance of the places at which two lines are compared. [m]
_STEP_M = 0.5
#: Stations that are compared together, at some 80 bytes each: 20 MB.
_STATIONS_AT_ONCE = 250_000
#: Standard deviations within which two measurements of one line agree (99.7 % of a normal distribution).
_N_SIGMAS = 3.0
#: Difference of heights above which lines are one above the other, as wires are. [m]
_LEAST_ABOVE_M = 0.3
#: That a line beside another is right: nothing says which of the two readings holds.
_UNDECIDED = 0.5


def copied_lines(lines: LineSet) -> list[Suspect]:
    """Return unreviewed lines that run along a better one of their kind, within what the accuracies of both allow.

    Two painted lines are at least a line's width apart (stripe and gap of a double line), and two kerbs do not run
    through each other: closer ones, with three standard deviations of their difference to spare, may be one. Which is
    meant to go, the one of lower confidence, then the shorter, is the item's line; nothing is proposed, since a double
    line in images can be measured as badly.
    """
    found = []
    for kind in sorted(set(lines.kind.tolist()) - set(REVIEWED_TOGETHER)):
        found += _copies_of(lines[kind])
    return found


def _copies_of(lines: LineSet) -> list[Suspect]:
    """Return the suspects among lines of one kind, one a line."""
    if len(lines) < 2:
        return []
    plan = np.array([shapely.LineString(lines[k].xyz[:, :2]) for k in range(len(lines))])
    sigma_m = np.array([_median(lines[k].sigma_xy_m) for k in range(len(lines))])
    width_m, length_m = np.nan_to_num(lines.width_m), lines.length_m
    reach_m = 2.0 * np.maximum(width_m + _N_SIGMAS * sigma_m * np.sqrt(2.0), 1e-3)
    weak, other = _weaker_first(lines, length_m, _near_pairs(plan, reach_m))
    # The pipes of a rail are one above another
    is_stacked = lines.form == STACKED_FORM
    counts = (lines.review[weak] == "") & ~(is_stacked[weak] & is_stacked[other])
    weak, other = weak[counts], other[counts]
    limit_m = (width_m[weak] + width_m[other]) / 2 + _N_SIGMAS * np.hypot(sigma_m[weak], sigma_m[other])
    least_m = np.maximum(LEAST_TOGETHER_M, _LEAST_SHARE * length_m)
    # Of each weaker line: the greatest length beside one other and, with its sign changed, the distance there
    best: dict[int, tuple[float, float]] = {}
    stations = [_stations(lines[k].xyz) for k in range(len(lines))]
    for k in _long_beside(plan, stations, (weak, other), limit_m, least_m[weak]).tolist():
        i, j = int(weak[k]), int(other[k])
        together_m, apart_m = _together(stations[i], lines[j].xyz, float(limit_m[k]))
        if together_m < least_m[i]:
            continue
        best[i] = max(best.get(i, (0.0, 0.0)), (together_m, -apart_m))
    return [_suspect(lines, k, together_m, -nearness) for k, (together_m, nearness) in sorted(best.items())]


def _near_pairs(plan: AnyArray, reach_m: FloatArray) -> IntArray:
    """Return the pairs (2, k) of lines (n,) of which one may come within its reach of the other, the lower number first."""
    west, south, east, north = shapely.bounds(plan).T
    boxes = shapely.box(west - reach_m, south - reach_m, east + reach_m, north + reach_m)
    first, second = shapely.STRtree(plan).query(boxes)
    # Boxes of long lines overlap that are far apart; a pair counts whichever of the two reaches the other
    near = shapely.dwithin(plan[first], plan[second], reach_m[first])
    first, second, n = first[near], second[near], len(plan)
    pairs = np.sort((np.minimum(first, second) * n + np.maximum(first, second))[first != second])
    pairs = pairs[np.diff(pairs, prepend=-1) > 0]
    return np.stack([pairs // n, pairs % n])


def _weaker_first(lines: LineSet, length_m: FloatArray, pairs: IntArray) -> tuple[IntArray, IntArray]:
    """Return pairs (2, k), that line first which would go: unreviewed, of lower confidence, the shorter."""
    names, n = [str(name) for name in lines.id], len(lines)
    order = sorted(
        range(n), key=lambda k: (str(lines.review[k]) != "", lines.confidence[k], length_m[k], names[k])
    )
    rank = np.empty(n, dtype=np.int64)
    rank[order] = np.arange(n)
    is_first = rank[pairs[0]] <= rank[pairs[1]]
    return np.where(is_first, pairs[0], pairs[1]), np.where(is_first, pairs[1], pairs[0])


def _long_beside(
    plan: AnyArray, stations: list[FloatArray], pairs: tuple[IntArray, IntArray],
    limit_m: FloatArray, least_m: FloatArray,
) -> IntArray:  # fmt: skip
    """Return which pairs may run together for long enough, by the stations in the other's box, then by their distance.

    In a dense survey most pairs cross: `_together` for each of a million took minutes.
    """
    places = np.concatenate([own[:, :2] for own in stations])
    points = shapely.points(places)
    count = np.array([len(own) for own in stations], dtype=np.int64)
    start, boxes = offsets_of(count), shapely.bounds(plan)
    found = [np.zeros(0, dtype=np.int64)]
    part = np.cumsum(count[pairs[0]]) // _STATIONS_AT_ONCE
    for some in np.split(np.arange(len(limit_m)), np.flatnonzero(np.diff(part)) + 1):
        chosen = some
        for is_exact in (False, True):
            weak, other = pairs[0][chosen], pairs[1][chosen]
            pair = np.repeat(np.arange(len(chosen)), count[weak])
            at = np.arange(len(pair)) + np.repeat(start[weak] - offsets_of(count[weak])[:-1], count[weak])
            reach_m = limit_m[chosen][pair]
            near = (
                shapely.distance(points[at], plan[other][pair]) <= reach_m if is_exact
                else _in_box(places[at], boxes[other][pair], reach_m)
            )  # fmt: skip
            n_beside = np.bincount(pair, weights=near, minlength=len(chosen))
            chosen = chosen[n_beside * _STEP_M >= least_m[chosen]]
        found.append(chosen)
    return np.concatenate(found)


def _in_box(places: FloatArray, boxes: FloatArray, limit_m: FloatArray) -> BoolArray:
    """Return which places (n, 2) lie in boxes (n, 4) grown by a limit (n,)."""
    (east, north), (low_e, low_n, high_e, high_n) = places.T, boxes.T
    is_in = (east >= low_e - limit_m) & (east <= high_e + limit_m)
    return np.asarray(is_in & (north >= low_n - limit_m) & (north <= high_n + limit_m))


def _stations(line: FloatArray) -> FloatArray:
    """Return the places (k, 3) of a line (n, 3) at which it is compared with another."""
    along = distance_along(line)
    at = np.arange(0.5 * _STEP_M, along[-1], _STEP_M)
    return np.column_stack([np.interp(at, along, line[:, axis]) for axis in range(3)])


def _together(places: FloatArray, other: FloatArray, limit_m: float) -> tuple[float, float]:
    """Return the length of a line with stations (n, 3) that lies within a limit of another (m, 3), and their median distance there. [m]"""  # noqa: D400
    reference = shapely.LineString(other[:, :2])
    points = shapely.points(places[:, :2])
    apart_m = shapely.distance(points, reference)
    at = shapely.line_locate_point(reference, points)
    height = np.interp(at, distance_along(other[:, :2]), other[:, 2])
    # Beyond the other's end nothing runs beside it
    is_beside = (at > 0.0) & (at < reference.length) & (apart_m <= limit_m)
    is_beside &= ~(np.abs(places[:, 2] - height) > _LEAST_ABOVE_M)
    n_beside = int(is_beside.sum())
    return n_beside * _STEP_M, float(np.median(apart_m[is_beside])) if n_beside else float("nan")


def _median(values: FloatArray) -> float:
    """Return the median of the known values; 0 where none is known."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else 0.0


def _suspect(lines: LineSet, i: int, together_m: float, apart_m: float) -> Suspect:
    return Suspect(
        type="copy",
        ids=(str(lines.id[i]),),
        kind=str(lines.kind[i]),
        at=line_middle(lines[i].xyz),
        box=view_box(lines[i].xyz),
        length_m=_UNDECIDED * together_m,
        confidence=_UNDECIDED,
        reason=f"runs {100.0 * apart_m:.0f} cm beside a better one over {together_m:.0f} m: one line measured twice?",
    )
