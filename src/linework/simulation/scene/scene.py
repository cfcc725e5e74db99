"""From a scenario to its triangles and truth lines."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, BoolArray, FloatArray
from linework.kernels.tracking.times import times_near
from linework.model.lines import KINDS, LineSet
from linework.simulation.roads.scenario import Scenario
from linework.simulation.scene.buildings import bridge, car, gantry, hedge, house, plant, wall
from linework.simulation.scene.ground import boundary_truth, ground, island, marking_truth, symbol_truth
from linework.simulation.scene.materials import GROUND, Material
from linework.simulation.scene.part import Part, Scene, TruthLine, assemble_scene
from linework.simulation.scene.rails import barrier, fence, guardrail
from linework.simulation.scene.wires import cable, pole


def build_scene(scenario: Scenario) -> Scene:
    """Return the world of a scenario, local frame; the same scenario gives the same triangles."""
    return assemble_scene(_parts(scenario))


def _parts(scenario: Scenario) -> Iterator[Part]:
    layout, road = scenario.layout, scenario.layout.road
    yield ground(road)
    yield boundary_truth(road, layout.far_edges_m)
    yield from (island(road, i) for i in layout.islands)
    yield from (marking_truth(road, m) for m in layout.markings)
    yield from (symbol_truth(road, s) for s in layout.symbols)
    yield from (guardrail(road, r) for r in layout.rails)
    yield from (barrier(road, b) for b in layout.barriers)
    yield from (fence(road, f) for f in layout.fences)
    yield from (cable(road, c) for c in layout.cables)
    yield from (pole(road, p) for p in layout.poles)
    yield from (wall(road, w) for w in layout.walls)
    yield from (house(road, h) for h in layout.houses)
    yield from (bridge(road, b) for b in layout.bridges)
    yield from (gantry(road, g) for g in layout.gantries)
    yield from (car(road, c) for c in layout.cars)
    for i, h in enumerate(layout.hedges):
        yield hedge(road, h, np.random.default_rng([scenario.seed, 11, i]))
    for i, p in enumerate(layout.plants):
        yield plant(road, p, np.random.default_rng([scenario.seed, 12, i]))


# The exact lines of a simulated survey, and which of their vertices the scanners could measure

#: A vertex is observed with at least (this many) hits within (this distance, m) of it. Paint: hits on the
#: carriageway; boundaries: hits on the ground; all others: hits on that very beam, barrier face, fence, wire.
OBSERVED: dict[str, tuple[int, float]] = {
    "lane_marking": (5, 0.30),
    "lane_marking_dash": (5, 0.30),
    "road_marking_other": (5, 0.30),
    "road_boundary": (5, 0.25),
    "kerb_top": (5, 0.25),
    "guardrail": (5, 0.50),
    "barrier": (5, 0.50),
    "fence": (5, 0.50),
    "cable": (1, 1.00),
}
PAINT_KINDS = ("lane_marking", "lane_marking_dash", "road_marking_other")

#: The time of a line is that of the hits within this of its vertices: the face of a beam reaches 0.31 m down
#: from its top edge. [m]
TIMED_M = 0.3


def truth_lines(
    scenario: Scenario, scene: Scene, hits: tuple[FloatArray, AnyArray, FloatArray], crs: str
) -> LineSet:
    """Return all truth lines in the world frame, with `observed` per vertex, ordered by kind.

    Parameters
    ----------
    scenario, scene
        The world.
    hits
        (n, 3) positions [m, local], (n,) triangles and (n,) times [s] of all hits, without noise.
    crs
        WKT2.
    """
    order = sorted(range(len(scene.lines)), key=lambda i: KINDS.index(scene.lines[i].kind))
    lines = [scene.lines[i] for i in order]
    xyz, triangle, time_s = hits
    observed = _observed(scene, xyz, triangle)
    if not lines:
        return LineSet.empty(crs)
    vertices = np.concatenate([line.xyz for line in lines])
    owner = np.repeat(np.arange(len(lines)), [len(line.xyz) for line in lines])
    start_s, end_s = times_near(xyz, time_s, vertices, owner, len(lines), TIMED_M)
    columns = {
        name: [getattr(line, name) for line in lines]
        for name in (
            "kind",
            "role",
            "pattern",
            "form",
            "double",
            "width_m",
            "height_m",
            "lower_m",
            "n_beams",
            "clearance_m",
        )
    }
    return LineSet.from_lines(
        [line.xyz + np.asarray(scenario.origin_m) for line in lines],
        crs=crs,
        id=_ids(lines),
        source=[f"simulated {scenario.kind} seed {scenario.seed}"] * len(lines),
        method=["truth"] * len(lines),
        observed=np.concatenate([observed[i] for i in order]),
        sigma_xy_m=np.zeros(len(vertices)),
        sigma_z_m=np.zeros(len(vertices)),
        time_start_s=start_s,
        time_end_s=end_s,
        **columns,
    )


def _ids(lines: list[TruthLine]) -> list[str]:
    count: dict[str, int] = {}
    ids = []
    for line in lines:
        count[line.kind] = count.get(line.kind, 0) + 1
        ids.append(f"{line.kind}-{count[line.kind]:04d}")
    return ids


def _observed(scene: Scene, xyz: FloatArray, triangle: AnyArray) -> list[BoolArray]:
    material, target = scene.mesh.material[triangle], scene.mesh.target[triangle]
    carriageway = cKDTree(xyz[material == Material.ASPHALT])
    ground = cKDTree(xyz[GROUND[material]])
    of_target = _grouped(target, len(scene.lines))
    flags = []
    for i, line in enumerate(scene.lines):
        n, within = OBSERVED[line.kind]
        if line.kind in PAINT_KINDS:
            tree = carriageway
        elif line.kind in ("road_boundary", "kerb_top"):
            tree = ground
        else:
            tree = cKDTree(xyz[of_target[i]].reshape(-1, 3))
        flags.append(_at_least(tree, line.xyz, n, within))
    return flags


def _grouped(target: AnyArray, n: int) -> list[AnyArray]:
    """Return the indices of the hits on each target."""
    order = np.argsort(target, kind="stable")
    ends = np.searchsorted(target[order], np.arange(n + 1))
    return [order[a:b] for a, b in itertools.pairwise(ends)]


def _at_least(tree: cKDTree, xyz: FloatArray, n: int, within_m: float) -> BoolArray:
    """Return which vertices have at least `n` hits within reach: the n-th nearest is not too far."""
    if tree.n < n:
        return np.zeros(len(xyz), dtype=np.bool_)
    distance = tree.query(xyz, k=[n], distance_upper_bound=within_m * (1.0 + 1e-9))[0][:, 0]
    return np.asarray(distance <= within_m, dtype=np.bool_)
