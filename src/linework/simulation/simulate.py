"""A survey from a seed: points, trajectory and exact lines, all in memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import AnyArray
from linework.crs import parse_crs
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.model.trajectory import Trajectory
from linework.simulation.point_classes import classes_of_hits
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.roads.scenario import Scenario
from linework.simulation.scene.part import Scene
from linework.simulation.scene.scene import build_scene, truth_lines
from linework.simulation.sensors.conditions import false_ranges, misplaced, wandering
from linework.simulation.sensors.drive import Drive, drive, flown, reported_trajectory, stood
from linework.simulation.sensors.records import record_points
from linework.simulation.sensors.rigs import equipped
from linework.simulation.sensors.scanner import Caster, Hits, on_wire_axis, pulses_of, scan

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
        As reported, with its pose errors; None for flights and stations.
    truth
        Exact lines with `observed` per vertex.
    crs
        WKT2 of all of it.
    scenario
        What was drawn.
    sweep
        (n,) int32, one per point: its scan line (a turn or swing of the mirror; of a spinning scanner, a turn of one
        beam), counted through the survey.
    beam
        (n,) int32: its laser, counted through the heads.
    strip
        (n,) int32: its pass, flight strip or station.
    point_class
        (n,) uint8: its true class, as `linework.methods.classes.point_class.PointClass` numbers them.
    """

    points: Points
    trajectory: Trajectory | None
    truth: LineSet
    crs: str
    scenario: Scenario
    sweep: AnyArray
    beam: AnyArray
    strip: AnyArray
    point_class: AnyArray

    def take(self, index: AnyArray) -> SimulatedSurvey:
        """Return the survey with the chosen points only; its truth, and what of it was observed, stays."""
        chosen = {name: getattr(self, name)[index] for name in ("sweep", "beam", "strip", "point_class")}
        return replace(self, points=self.points.take(index), **chosen)


def simulate_survey(
    kind: str = "straight",
    seed: int = 0,
    length_m: float = 200.0,
    *,
    points_per_m: float | None = None,
    scanner: str = "default",
    conditions: str = "usual",
    holes: bool = False,
) -> SimulatedSurvey:
    """Return the survey of one road; the same arguments give the same values to the last bit.

    Parameters
    ----------
    kind
        A kind of road, one of ROADS in `linework.simulation.roads.draw`.
    seed
        Decides everything else, within the ranges of `linework.simulation.roads.draw`.
    length_m
        How far the van drives.
    points_per_m
        About how many points per metre of road to record; None: as the seed draws it.
    scanner
        What measures it, one of SCANNERS in `linework.simulation.sensors.rigs`.
    conditions
        "usual" or "hard", see `linework.simulation.sensors.conditions`.
    holes
        Leave stretches of 10 to 60 m without points, which cut the road in pieces.
    """
    scenario = draw_scenario(kind, seed, length_m, points_per_m=points_per_m)
    return survey_of(
        equipped(scenario, scanner=scanner, points_per_m=points_per_m, conditions=conditions, holes=holes)
    )


def survey_of(scenario: Scenario) -> SimulatedSurvey:
    """Return the survey of a scenario, as it was drawn or with parts of it replaced."""
    scene = build_scene(scenario)
    carriers = carriers_of(scenario)
    rng = np.random.default_rng([scenario.seed, 31])
    points: list[Points] = []
    met: list[tuple[AnyArray, ...]] = []
    numbers: list[tuple[AnyArray, ...]] = []
    classes: list[AnyArray] = []
    for hits in scan_passes(scenario, scene, carriers):
        points.append(record_points(scenario, scene, hits, rng))
        classes.append(classes_of_hits(scenario, scene, hits, points[-1].xyz))
        met.append((hits.xyz, hits.triangle, hits.time_s, np.isnan(hits.false_range_m)))
        numbers.append((hits.sweep, hits.beam, hits.strip))
    xyz, triangle, time_s, is_true = (np.concatenate(column) for column in zip(*met, strict=True))
    order = np.argsort(time_s, kind="stable")
    sweep, beam, strip = (np.concatenate(column)[order] for column in zip(*numbers, strict=True))
    crs = parse_crs(SIMULATED_CRS)
    return SimulatedSurvey(
        points=Points.concatenate(points).take(order),
        trajectory=reported_trajectory(carriers, scenario.origin_m) if scenario.is_driven else None,
        truth=truth_lines(scenario, scene, (xyz[is_true], triangle[is_true], time_s[is_true]), crs),
        crs=crs,
        scenario=scenario,
        sweep=sweep,
        beam=beam,
        strip=strip,
        point_class=np.concatenate(classes)[order],
    )


def drives_of(scenario: Scenario) -> list[Drive]:
    """Return the vehicle's true path in each pass."""
    drives = [
        drive(scenario.layout.road, spec, scenario.length_m, np.random.default_rng([scenario.seed, 21, i]))
        for i, spec in enumerate(scenario.passes)
    ]
    return wandering(scenario, drives)


def carriers_of(scenario: Scenario) -> list[Drive]:
    """Return the true poses of what carries the scanners: in each pass, on each strip or at each station."""
    if scenario.is_driven:
        return drives_of(scenario)
    flights = [
        flown(flight, np.random.default_rng([scenario.seed, 25, i]))
        for i, flight in enumerate(scenario.flights)
    ]
    return wandering(scenario, flights + [stood(station) for station in scenario.stations])


def delivered(scenario: Scenario, hits: Hits) -> Hits:
    """Return the hits outside the stretches of which no points were delivered."""
    if not scenario.holes_m:
        return hits
    s, _ = scenario.layout.road.alignment.locate(hits.xyz[:, :2])
    starts, ends = np.asarray(scenario.holes_m).T
    return hits.take(np.searchsorted(starts, s, side="right") == np.searchsorted(ends, s, side="right"))


def scan_passes(scenario: Scenario, scene: Scene, carriers: Sequence[Drive]) -> Iterator[Hits]:
    """Yield the hits of all passes and scanners in batches, without noise."""
    caster = Caster(scene)
    first_sweep = 0
    for i, way in enumerate(carriers):
        first_beam = 0
        for j, head in enumerate(scenario.scanners):
            rng = np.random.default_rng([scenario.seed, 22, i, j])
            reach = scenario.sensor.max_range_m
            batches = scan(caster, way, head, reach, i, rng, first_sweep=first_sweep, first_beam=first_beam)
            for batch in batches:
                hits = delivered(scenario, on_wire_axis(scene, batch))
                if scenario.conditions is None:
                    yield hits
                    continue
                error = hits.error_m + misplaced(scenario.conditions, way, j, hits)
                false = false_ranges(scenario.conditions, caster, scene, hits, i, rng)
                yield replace(hits, error_m=error, false_range_m=false)
            first_sweep += head.n_sweeps(pulses_of(way, head))
            first_beam += head.n_beams
