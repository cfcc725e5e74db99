"""A survey from a seed: points, trajectory and exact lines, all in memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.crs import parse_crs
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.model.trajectory import Trajectory
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.roads.scenario import Scenario
from linework.simulation.scene.part import Scene
from linework.simulation.scene.scene import build_scene, truth_lines
from linework.simulation.sensors.drive import Drive, drive, reported_trajectory
from linework.simulation.sensors.scanner import Caster, Hits, on_wire_axis, record_points, scan

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
        One of `linework.simulation.roads.draw.ROADS`.
    seed
        Decides everything else, within the ranges of `linework.simulation.roads.draw`.
    length_m
        How far the van drives.
    points_per_m
        About how many points per metre of road to record; None: as the seed draws it.
    """
    return survey_of(draw_scenario(kind, seed, length_m, points_per_m=points_per_m))


def survey_of(scenario: Scenario) -> SimulatedSurvey:
    """Return the survey of a scenario, as it was drawn or with parts of it replaced."""
    scene = build_scene(scenario)
    drives = drives_of(scenario)
    rng = np.random.default_rng([scenario.seed, 31])
    points: list[Points] = []
    places: list[FloatArray] = []
    triangles: list[AnyArray] = []
    times: list[FloatArray] = []
    for hits in scan_passes(scenario, scene, drives):
        points.append(record_points(scenario, scene, hits, rng))
        places.append(hits.xyz)
        triangles.append(hits.triangle)
        times.append(hits.time_s)
    all_hits = np.concatenate(places), np.concatenate(triangles), np.concatenate(times)
    crs = parse_crs(SIMULATED_CRS)
    return SimulatedSurvey(
        points=points_by_time(points),
        trajectory=reported_trajectory(drives, scenario.origin_m),
        truth=truth_lines(scenario, scene, all_hits, crs),
        crs=crs,
        scenario=scenario,
    )


def drives_of(scenario: Scenario) -> list[Drive]:
    """Return the van's true path in each pass."""
    return [
        drive(scenario.layout.road, spec, scenario.length_m, np.random.default_rng([scenario.seed, 21, i]))
        for i, spec in enumerate(scenario.passes)
    ]


def scan_passes(scenario: Scenario, scene: Scene, drives: Sequence[Drive]) -> Iterator[Hits]:
    """Yield the hits of all passes and scanners in batches, without noise."""
    caster = Caster(scene)
    for i, way in enumerate(drives):
        for j, scanner in enumerate(scenario.scanners):
            rng = np.random.default_rng([scenario.seed, 22, i, j])
            for hits in scan(caster, way, scanner, scenario.sensor.max_range_m, i, rng):
                yield on_wire_axis(scene, hits)


def points_by_time(parts: Sequence[Points]) -> Points:
    """Return all points in one, by time."""
    time = np.concatenate([p.time_s for p in parts if p.time_s is not None])
    order = np.argsort(time, kind="stable")
    return Points(
        np.concatenate([p.xyz for p in parts])[order],
        intensity=np.concatenate([p.intensity for p in parts if p.intensity is not None])[order],
        time_s=time[order],
    )
