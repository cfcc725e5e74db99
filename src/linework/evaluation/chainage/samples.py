"""What can be measured at each station of a route: heights, widths and distances between lines.

Separate from `rows`, which sums samples up by intervals.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import BoolArray, FloatArray, distance_along
from linework.evaluation.chainage.crossings import FACE_M, Crossing
from linework.evaluation.chainage.other_lines import doubtful_bounds, paint_near, paired_near
from linework.lines.crosscuts import Axis
from linework.lines.lane_evidence import LANE_LIMITS_M, STRAY_PAINT_M
from linework.model.lines import LineSet

#: An axis along a line of paint is this near to it at most: it does not run between two lines. [m]
_SAME_LINE_M = 0.1
#: A rail belongs to the road whose edge is this near. [m]
_RAIL_REACH_M = 6.0
#: Distance of places along a wire: over a lane it is lowest at one of its ends, where it slopes by up to a tenth. [m]
_WIRE_STEP_M = 0.05


class Sample(NamedTuple):
    """A value at one place.

    Parameters
    ----------
    station_m
        Chainage. [m]
    offset_m
        Distance from the axis, positive to the left. [m]
    topic, quantity, line
        What was measured, and of which line, or of which two.
    value, sigma
        The value and its standard deviation; None where it was hidden, NaN where the deviation is not known.
    between
        Names of the two lines whose difference it is, "" where it is none.
    """

    station_m: float
    offset_m: float
    topic: str
    quantity: str
    line: str
    value: float | None
    sigma: float
    between: str = ""


def station_samples(axis: Axis, crossings: list[list[Crossing]]) -> Iterator[Sample]:
    """Yield the samples of all stations: lanes and carriageway, kerbs, guardrails and barriers."""
    other_paint_m, paired = paint_near(crossings), paired_near(crossings)
    others = doubtful_bounds(crossings)
    for k, (s, here) in enumerate(zip(axis.station_m.tolist(), crossings, strict=True)):
        bounds = [c for c in here if c.kind in ("lane_marking", "road_boundary")]
        yield from _carriageway(s, bounds, others[k])
        for right, left in lanes_at(bounds):
            is_unsure = may_lack_edge_line(right, left, bounds, other_paint_m[k]) or (
                (right.name, 1) in paired[k]
                or (left.name, -1) in paired[k]
                or not others[k].isdisjoint((right.name, left.name))
            )
            yield from _lane(s, right, left, is_unsure)
        for top in (c for c in here if c.kind == "kerb_top"):
            feet = [
                c for c in bounds if c.kind == "road_boundary" and abs(c.offset_m - top.offset_m) <= FACE_M
            ]
            if feet:
                foot = min(feet, key=lambda c: abs(c.offset_m - top.offset_m))
                yield _between(
                    s, top.offset_m, "kerb", "upstand", top.name, top.up_m - foot.up_m, top, foot, "z"
                )
        for rail in (c for c in here if c.kind in ("guardrail", "barrier")):
            yield from _rail(s, rail, bounds, other_paint_m[k])


def _between(
    s: float,
    offset_m: float,
    topic: str,
    quantity: str,
    name: str,
    value: float,
    a: Crossing,
    b: Crossing,
    axis: str,
) -> Sample:
    """Return a difference of two lines, None where one of them was not measured."""
    sigmas = (a.sigma_z_m, b.sigma_z_m) if axis == "z" else (a.sigma_xy_m, b.sigma_xy_m)
    known = None if a.bridged or b.bridged else value
    return Sample(
        s, offset_m, topic, quantity, name, known, math.hypot(*sigmas), between=f"{a.name} | {b.name}"
    )


def lanes_at(bounds: list[Crossing]) -> list[tuple[Crossing, Crossing]]:
    """Return neighbouring bounds, right and left, that are as far apart as those of a lane.

    Between two boundaries without paint is a lane, or the land beside the road: without paint it is not told.
    """
    return [
        (a, b)
        for a, b in pairwise(bounds)
        if LANE_LIMITS_M[0] <= b.offset_m - a.offset_m <= LANE_LIMITS_M[1]
        and "lane_marking" in (a.kind, b.kind)
    ]


def _carriageway(s: float, bounds: list[Crossing], others: set[str]) -> Iterator[Sample]:
    """Yield the width between the boundaries on both sides of the axis.

    Unknown where paint may be one of them, or one of them is among the boundaries that may be `others`.
    """
    edges = [c for c in bounds if c.kind == "road_boundary"]
    left = [c for c in edges if c.offset_m > FACE_M]
    right = [c for c in edges if c.offset_m < -FACE_M]
    if left and right:
        a, b = right[-1], left[0]
        width = _between(s, 0.0, "road", "carriageway_width", "", b.offset_m - a.offset_m, a, b, "xy")
        paint = [
            c.offset_m for c in bounds if c.kind == "lane_marking" and a.offset_m < c.offset_m < b.offset_m
        ]
        is_unsure = _may_end_at(paint, a.offset_m, b.offset_m) or not others.isdisjoint((a.name, b.name))
        yield width._replace(value=None) if is_unsure else width


def _may_end_at(paint_m: list[float], right_m: float, left_m: float) -> bool:
    """Return whether the outermost line of paint on either side may be the end of the carriageway, by offsets [m].

    Pale stones of a flush kerb look like paint. Beside the edge line they are too far for a double line and too near for
    a cycle lane, and the boundary behind them is that of the footway. Two lines on both sides of the axis, or with a lane
    up to the boundary on either side and no other paint, are those of the middle.
    """
    if len(paint_m) == 2 and min(paint_m[0] - right_m, left_m - paint_m[1]) >= LANE_LIMITS_M[0]:
        return False
    return any(
        STRAY_PAINT_M[0] < second - first < STRAY_PAINT_M[1]
        and not first < -_SAME_LINE_M < _SAME_LINE_M < second
        for first, second in (*pairwise(paint_m[:2]), *pairwise(paint_m[-2:]))
    )


def may_lack_edge_line(
    right: Crossing, left: Crossing, bounds: list[Crossing], paint_near_m: FloatArray
) -> bool:
    """Return whether a lane from paint to the end of the carriageway may lack an edge line that was not found.

    One lies between both before or behind, or on the other side of the road. At a kerb there need not be one because the other
    side has one: parking strips begin at a line. Along the other edge of the pavement, kerb or not, it is none of a strip.

    Parameters
    ----------
    right, left
        The bounds of a lane.
    bounds
        All of the station, from right to left.
    paint_near_m
        Offsets of paint at the stations about it, ascending. [m]
    """
    if right.kind == left.kind:
        return False
    paint, end = (right, left) if left.kind == "road_boundary" else (left, right)
    side = 1.0 if end is left else -1.0
    beyond = side * (paint_near_m - paint.offset_m)
    width = side * (end.offset_m - paint.offset_m)
    if np.any((beyond >= LANE_LIMITS_M[0]) & (beyond < width)):
        return True
    beside = [(c, -side * (c.offset_m - paint.offset_m)) for c in bounds]
    # The other edge of the pavement is beside the paint, or a lane further
    return end.form != "kerb" and any(
        LANE_LIMITS_M[0] <= away <= LANE_LIMITS_M[1]
        if c.kind == "lane_marking"
        else 0.0 < away < STRAY_PAINT_M[1]
        for c, away in beside
    )


def _lane(s: float, right: Crossing, left: Crossing, is_unsure: bool) -> Iterator[Sample]:
    """Yield width and crossfall of a lane; no width where it may end at an edge line that was not found."""
    width = left.offset_m - right.offset_m
    middle, name = (left.offset_m + right.offset_m) / 2, f"{right.name} | {left.name}"
    wide = _between(s, middle, "road", "lane_width", name, width, right, left, "xy")
    yield wide._replace(value=None) if is_unsure else wide
    fall = _between(
        s, middle, "road", "crossfall", name, 100 * (left.up_m - right.up_m) / width, right, left, "z"
    )
    yield fall._replace(sigma=100 * fall.sigma / width)


def _rail(s: float, rail: Crossing, bounds: list[Crossing], paint_near_m: FloatArray) -> Iterator[Sample]:
    """Yield the height above the edge of the carriageway, and the distance from the edge line.

    That is unknown where the line may be another one: it divides lanes, or one nearer to the rail is seen before or behind.
    """
    inside = [
        c
        for c in bounds
        if abs(c.offset_m) < abs(rail.offset_m) + FACE_M and abs(c.offset_m - rail.offset_m) <= _RAIL_REACH_M
    ]
    if not inside:
        yield Sample(s, rail.offset_m, rail.kind, "top_height", rail.name, None, math.nan)
        return
    edge = min(inside, key=lambda c: abs(c.offset_m - rail.offset_m))
    yield _between(
        s, rail.offset_m, rail.kind, "top_height", rail.name, rail.up_m - edge.up_m, rail, edge, "z"
    )
    paint = [c for c in inside if c.kind == "lane_marking"]
    if paint:
        line = min(paint, key=lambda c: abs(c.offset_m - rail.offset_m))
        away = abs(rail.offset_m - line.offset_m)
        offset = _between(s, rail.offset_m, rail.kind, "offset_from_line", rail.name, away, rail, line, "xy")
        side = math.copysign(1.0, rail.offset_m - line.offset_m)
        beyond = side * (paint_near_m - line.offset_m)
        is_another = bool(np.any((beyond >= LANE_LIMITS_M[0]) & (beyond < away)))
        yield offset._replace(value=None) if is_another or line.role in ("centre", "lane") else offset


def clearance_samples(lines: LineSet, axis: Axis, crossings: list[list[Crossing]]) -> Iterator[Sample]:
    """Yield the height of wires over each lane: places along the wires, whatever their direction."""
    tree = cKDTree(axis.xyz[:, :2])
    for i in np.flatnonzero(lines.kind == "cable").tolist():
        wire = lines[i]
        places, sigma, bridged = _places(lines, i)
        away, station = tree.query(places[:, :2])
        shift = places[:, :2] - axis.xyz[station, :2]
        offset = np.einsum("ij,ij->i", shift, axis.left[station])
        ahead = np.einsum("ij,ij->i", shift, axis.ahead[station])
        name = str(wire.id) or f"line {i + 1}"
        for row in np.flatnonzero((np.abs(ahead) <= 1.0) & (away < 30.0)).tolist():
            bounds = [c for c in crossings[station[row]] if c.kind in ("lane_marking", "road_boundary")]
            for right, left in lanes_at(bounds):
                if not right.offset_m <= offset[row] <= left.offset_m:
                    continue
                share = (offset[row] - right.offset_m) / (left.offset_m - right.offset_m)
                road = right.up_m * (1 - share) + left.up_m * share
                is_hidden = right.bridged or left.bridged or bridged[row]
                yield Sample(
                    float(axis.station_m[station[row]]), (left.offset_m + right.offset_m) / 2, "clearance", "clearance",
                    f"{name} over {right.name} | {left.name}", None if is_hidden else float(places[row, 2] - road),
                    math.hypot(float(sigma[row]), max(right.sigma_z_m, left.sigma_z_m)),
                )  # fmt: skip


def _places(lines: LineSet, i: int) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return places along a wire, the standard deviation of their heights, and where it was not measured."""
    first, last = int(lines.offsets[i]), int(lines.offsets[i + 1])
    xyz = lines.xyz[first:last]
    along = distance_along(xyz, in_space=True)
    at = np.linspace(0.0, along[-1], max(int(along[-1] / _WIRE_STEP_M), 1) + 1)
    nearest = np.clip(np.searchsorted(along, at), 0, last - first - 1)
    places = np.stack([np.interp(at, along, coordinate) for coordinate in xyz.T], axis=1)
    return places, np.interp(at, along, lines.sigma_z_m[first:last]), lines.bridged[first:last][nearest]


def shape_samples(axis: Axis) -> Iterator[Sample]:
    """Yield grade and curvature of the axis, over 20 m."""
    n = round(10.0)
    s = axis.station_m
    heading = np.unwrap(np.arctan2(axis.ahead[:, 1], axis.ahead[:, 0]))
    for i in range(n, len(s) - n):
        length = float(s[i + n] - s[i - n])
        grade = 100 * float(axis.xyz[i + n, 2] - axis.xyz[i - n, 2]) / length
        yield Sample(float(s[i]), 0.0, "road", "grade", "", grade, math.nan)
        bend = float(heading[i + n] - heading[i - n]) / length
        yield Sample(float(s[i]), 0.0, "road", "curvature", "", bend, math.nan)
