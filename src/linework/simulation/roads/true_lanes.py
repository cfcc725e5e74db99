"""The lanes of a simulated road, stated from what was drawn and not from its lines."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from linework.arrays import FloatArray
from linework.simulation.roads.alignment import widening
from linework.simulation.roads.road import Road
from linework.simulation.roads.scenario import Marking, RoadLayout, Scenario, Symbol
from linework.simulation.scene.ground import dash_ends
from linework.simulation.scene.materials import Material

#: Distance of the places at which lanes are stated. [m]
LANE_STEP_M = 0.5
#: The lines of a double line are nearer than this. [m]
_DOUBLE_M = 1.0


@dataclass(frozen=True, slots=True)
class TrueLanes:
    """Places of lanes every `LANE_STEP_M` along them, one row per lane and place.

    Parameters
    ----------
    right_xyz, left_xyz
        (n, 3) what bounds the lane on both sides. [m, world]
    """

    right_xyz: FloatArray
    left_xyz: FloatArray

    def __len__(self) -> int:
        return len(self.right_xyz)


def true_lanes(scenario: Scenario, *, most_m: float) -> TrueLanes:
    """Return the lanes that the paint of a road tells, as long as its scanners were driven along it.

    A lane is between two neighbouring markings of one carriageway, or between a marking that is no edge line and the
    pavement's edge. What is outside an edge line (shoulder, parking strip, gutter) is none, nor is what has no paint on
    either side, what paint closes to traffic, or the mouth of a side street. Side streets have lanes beyond their
    corners.

    Parameters
    ----------
    most_m
        Width from which two rows of vehicles have room, so that a space is no single lane. [m]
    """
    rows = _rows(scenario.layout, (0.0, scenario.length_m), most_m)
    for over in scenario.layout.over:
        rows += _rows(over, (over.road.alignment.start_m, over.road.alignment.end_m), most_m)
    origin = np.asarray(scenario.origin_m)
    right, left = (np.array([row[i] for row in rows]).reshape(-1, 3) + origin for i in (0, 1))
    return TrueLanes(right, left)


def _rows(
    layout: RoadLayout, span: tuple[float, float], most_m: float
) -> list[tuple[FloatArray, FloatArray]]:
    """Return right and left of the lanes of one road, place by place."""
    road = layout.road
    rows: list[tuple[FloatArray, FloatArray]] = []
    if road.surface == Material.ASPHALT:
        for s in np.arange(span[0], span[1] + 1e-6, LANE_STEP_M).tolist():
            bounds = _bounds(layout, s)
            for (right, right_role), (left, left_role) in pairwise(bounds):
                is_paint = [bool(right_role), bool(left_role)]
                if not any(is_paint) or (not all(is_paint) and "edge" in (right_role, left_role)):
                    continue
                middle = 0.5 * (right + left)
                if any(a <= s <= b and low <= middle <= high for a, b, low, high in layout.closed_m):
                    continue
                if _DOUBLE_M < left - right < most_m:
                    rows.append((road.on_ground(s, right), road.on_ground(s, left)))
        for symbol in layout.symbols:
            rows += _side_street(road, symbol, most_m) if symbol.role else []
    return rows


def _bounds(layout: RoadLayout, s: float) -> list[tuple[float, str]]:
    """Return offset and role of the markings in force and of the pavement's edges ("") at a chainage, from right to left."""
    road = layout.road
    found = []
    for m in layout.markings:
        start, end = _painted_span(m)
        if start <= s <= end and not (m.generation == "older" and _is_replaced(layout, s)):
            found.append((m.q_m + (float(m.shift_m(s)) if m.shift_m is not None else 0.0), m.role))
    at = np.array([s])
    for sign in (1, -1):
        side = road.side(sign)
        if float(widening(side.mouths, at, side.reach_m)[0]) == 0.0:
            found.append((sign * (side.width_m + float(side.extra_m(s))), ""))
    found += [(q, "") for q in layout.far_edges_m]
    return sorted(found)


def _is_replaced(layout: RoadLayout, s: float) -> bool:
    """Return whether there are newer lines than the older ones at a chainage."""
    return any(m.start_m <= s <= m.end_m for m in layout.markings if m.generation != "older")


def _painted_span(marking: Marking) -> tuple[float, float]:
    if marking.pattern != "dashed":
        return marking.start_m, marking.end_m
    dashes = dash_ends(marking)
    return (float(dashes[0, 0]), float(dashes[-1, 1])) if len(dashes) else (0.0, -1.0)


def _side_street(road: Road, line: Symbol, most_m: float) -> list[tuple[FloatArray, FloatArray]]:
    """Return the lanes on both sides of the centre line of a side street, beyond its corners."""
    middle, sign = 0.5 * (line.start_m + line.end_m), 1 if line.left_m > 0.0 else -1
    side = road.side(sign)
    (mouth,) = (m for m in side.mouths if m.start_m < middle < m.end_m)
    low, high = sorted((abs(line.right_m), abs(line.left_m)))
    rows = []
    for q in np.arange(max(low, side.width_m + mouth.radius_m), high, LANE_STEP_M).tolist():
        for edge in (mouth.start_m, mouth.end_m):
            if abs(edge - middle) < most_m:
                right, left = (edge, middle) if (edge < middle) == (sign < 0) else (middle, edge)
                rows.append((road.on_ground(right, sign * q), road.on_ground(left, sign * q)))
    return rows
