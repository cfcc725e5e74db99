"""A survey from a seed: points, trajectory and exact lines, all in memory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.files.crs import parse_crs
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.model.trajectory import Trajectory
from linework.simulation.draw import draw_scenario
from linework.simulation.drive import Drive, drive, reported_trajectory
from linework.simulation.part import Scene
from linework.simulation.recording import on_wire_axis, recorded
from linework.simulation.scanner import Caster, Hits, scan
from linework.simulation.scenario import Scenario
from linework.simulation.scene import build_scene
from linework.simulation.truth import truth_lines

#: UTM zone 32 with heights of the German height system: where the made-up place is.
SIMULATED_CRS = "EPSG:25832+7837"


@dataclass(frozen=True, slots=True)
class SimulatedSurvey:
    """What a simulated drive leaves behind.

    Parameters
    ----------
    points
        In time order; world frame.
    trajectory
        As reported, with its pose errors.
    truth
        Exact lines with `observed` per vertex.
    crs
        WKT2 of all of it.
    scenario
        What was drawn.
    """

    points: Points
    trajectory: Trajectory
    truth: LineSet
    crs: str
    scenario: Scenario


def simulate_survey(
    kind: str = "straight", seed: int = 0, length_m: float = 200.0, *, points_per_m: float | None = None
) -> SimulatedSurvey:
    """Return the survey of one road; the same arguments give the same values to the last bit.

    Parameters
    ----------
    kind
        "straight", "bends", "urban" or "motorway".
    seed
        Decides everything else, within the ranges of `linework.simulation.draw`.
    length_m
        How far the van drives.
    points_per_m
        About how many points per metre of road to record; None: as the seed draws it.
    """
    scenario = draw_scenario(kind, seed, length_m, points_per_m=points_per_m)
    scene = build_scene(scenario)
    drives, hits = measure(scenario, scene)
    rng = np.random.default_rng([seed, 31])
    crs = parse_crs(SIMULATED_CRS)
    return SimulatedSurvey(
        points=recorded(scenario, scene, hits, rng),
        trajectory=reported_trajectory(drives, scenario.origin_m),
        truth=truth_lines(scenario, scene, hits, crs),
        crs=crs,
        scenario=scenario,
    )


def measure(scenario: Scenario, scene: Scene) -> tuple[list[Drive], Hits]:
    """Return the van's true ways and all hits of its scanners in time order, without noise."""
    caster = Caster(scene)
    drives, hits = [], []
    for i, spec in enumerate(scenario.passes):
        way = drive(
            scenario.layout.road, spec, scenario.length_m, np.random.default_rng([scenario.seed, 21, i])
        )
        drives.append(way)
        for j, scanner in enumerate(scenario.scanners):
            rng = np.random.default_rng([scenario.seed, 22, i, j])
            hits.append(scan(caster, way, scanner, scenario.sensor.max_range_m, i, rng))
    everything = Hits.concatenate(hits)
    everything = everything.take(np.argsort(everything.time_s, kind="stable"))
    return drives, on_wire_axis(scene, everything)
