"""From a scenario to its triangles and truth lines."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from linework.simulation.buildings import bridge, gantry, wall
from linework.simulation.ground import boundaries, ground, marking_truth, symbol_truth
from linework.simulation.part import Part, Scene, assembled
from linework.simulation.plants import hedge, plant
from linework.simulation.rails import barrier, fence, guardrail
from linework.simulation.scenario import Scenario
from linework.simulation.vehicles import car
from linework.simulation.wires import cable, pole


def build_scene(scenario: Scenario) -> Scene:
    """Return the world of a scenario, local frame; the same scenario gives the same triangles."""
    return assembled(_parts(scenario))


def _parts(scenario: Scenario) -> Iterator[Part]:
    layout, road = scenario.layout, scenario.layout.road
    yield ground(road)
    yield boundaries(road, layout.far_edges_m)
    yield from (marking_truth(road, m) for m in layout.markings)
    yield from (symbol_truth(road, s) for s in layout.symbols)
    yield from (guardrail(road, r) for r in layout.rails)
    yield from (barrier(road, b) for b in layout.barriers)
    yield from (fence(road, f) for f in layout.fences)
    yield from (cable(road, c) for c in layout.cables)
    yield from (pole(road, p) for p in layout.poles)
    yield from (wall(road, w) for w in layout.walls)
    yield from (bridge(road, b) for b in layout.bridges)
    yield from (gantry(road, g) for g in layout.gantries)
    yield from (car(road, c) for c in layout.cars)
    for i, h in enumerate(layout.hedges):
        yield hedge(road, h, np.random.default_rng([scenario.seed, 11, i]))
    for i, p in enumerate(layout.plants):
        yield plant(road, p, np.random.default_rng([scenario.seed, 12, i]))
