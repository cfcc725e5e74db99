"""The edges that run beside a road's boundaries and are none: gutters, backs of footways, verges, feet of walls.

Separate from `ground`, whose truth lines are what the sensors should find: these are there to be told from them, and are
no part of a survey's truth.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from linework.arrays import FloatArray
from linework.model.lines import LineSet
from linework.simulation.roads.alignment import kerb_paths
from linework.simulation.roads.road import Road
from linework.simulation.roads.scenario import Scenario
from linework.simulation.scene.materials import Material

#: Breaks of slope smaller than this are no edges: the crossfall of a footway is as much. [m/m]
_LEAST_BREAK = 0.02
#: A wall this near the back of a footway stands on it. [m]
_ON_BACK_M = 0.3


def parallel_edges(scenario: Scenario) -> LineSet:
    """Return the edges beside the boundaries of a scenario's road, of the kind `edge_other`, each with its role.

    Returns
    -------
    LineSet
        In the frame of the survey's truth, without a CRS.
    """
    road = scenario.layout.road
    if road.surface != Material.ASPHALT:
        return LineSet.empty()
    found = [*_of_land(road), *_of_walls(scenario), *_of_gutters(scenario)]
    return LineSet.from_lines(
        [xyz + np.asarray(scenario.origin_m) for _, xyz in found],
        kind=["edge_other"] * len(found),
        role=[role for role, _ in found],
        method=["truth"] * len(found),
    )


def _of_land(road: Road) -> Iterator[tuple[str, FloatArray]]:
    """Yield where the land beyond a boundary changes: its material, or its slope."""
    span = (road.alignment.start_m, road.alignment.end_m)
    for sign in (1, -1):
        side = road.side(sign)
        slope = np.diff(side.land_z_m) / np.diff(side.land_d_m)
        for i in range(1, len(side.land_material)):
            inner, outer = side.land_material[i - 1 : i + 1]
            is_break = inner != outer or abs(slope[i] - slope[i - 1]) > _LEAST_BREAK
            if not is_break or Material.ASPHALT in (inner, outer):
                continue
            beyond = float(side.land_d_m[i])
            for path in kerb_paths(side.mouths, span, side.reach_m, road.truth_chainages, 0.5):
                at = path[:, 0]
                wide = np.maximum(path[:, 1], side.extra_m(at))
                q = sign * (side.width_m + np.minimum(wide + beyond, side.reach_m))
                yield "footway_back" if inner == Material.FOOTWAY else "verge", road.on_ground(at, q)


def _of_walls(scenario: Scenario) -> Iterator[tuple[str, FloatArray]]:
    """Yield the feet of walls and house fronts."""
    road = scenario.layout.road
    for wall in scenario.layout.walls:
        yield "wall_foot", road.on_ground(road.truth_chainages(wall.start_m, wall.end_m), wall.q_m)


def _of_gutters(scenario: Scenario) -> Iterator[tuple[str, FloatArray]]:
    """Yield the edges of gutters on the side of the carriageway."""
    road = scenario.layout.road
    for stain in scenario.layout.stains:
        if stain.of == "gutter":
            q = min(stain.right_m, stain.left_m, key=abs)
            yield "gutter", road.on_ground(road.truth_chainages(stain.start_m, stain.end_m), q)
