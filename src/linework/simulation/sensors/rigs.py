"""The scanners a survey can be made with, drawn by the seed: `equipped` puts one into a scenario."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.errors import UsageError, argument, did_you_mean
from linework.simulation.roads.scenario import Flight, Scenario, Station
from linework.simulation.sensors.conditions import check_conditions, with_hard_conditions, with_second_pass
from linework.simulation.sensors.drive import drive
from linework.simulation.sensors.heads import Head, Scanner, SpinningScanner, StationScanner, SwathScanner

#: Share of the pulses of a profile scanner and of a spinning one that come back, roughly: the rest meets the sky, the
#: vehicle, or nothing within range (measured over the kinds of road: 0.45 to 0.55, and 0.15 to 0.7).
_COMES_BACK, _SPINS_BACK = 0.5, 0.4
#: Scan lines of profile scanners per metre of road at most, over all heads and passes: what one van records.
_MOST_LINES_PER_M = 35.0
#: Width of the land along a road that is modelled, roughly, and least and most points of an airborne survey. [m, 1/m2]
_CORRIDOR_M, _DENSITIES = 50.0, (0.5, 500.0)
#: Lengths of pieces of road with points, and of those without, from and to. [m]
_PIECE_M = (10.0, 60.0)
#: Beams per turn of a profile scanner, and columns per turn of a spinning one, at least and at most.
_RAYS, _COLUMNS = (100.0, 20_000.0), (36.0, 4096.0)


def equipped(
    scenario: Scenario,
    *,
    scanner: str = "default",
    points_per_m: float | None = None,
    conditions: str = "usual",
    holes: bool = False,
) -> Scenario:
    """Return the scenario as it is measured: by which scanner, under which conditions, with which gaps.

    Parameters
    ----------
    scenario
        From `draw_scenario`, with the same `points_per_m`.
    scanner, points_per_m
        As for `with_scanner`.
    conditions
        "usual", or "hard": `with_hard_conditions`.
    holes
        Cut the road in pieces of 10 to 60 m by stretches of 10 to 60 m without points.

    Raises
    ------
    UsageError
        Another scanner than `SCANNERS`, or other conditions than `SURVEY_CONDITIONS`.
    """
    check_conditions(conditions)
    if holes:
        scenario = replace(scenario, holes_m=_holes(scenario))
    if conditions == "usual":
        return with_scanner(scenario, scanner, points_per_m)
    n_before = len(scenario.passes)
    scenario = with_second_pass(scenario)
    if scanner == "default" and points_per_m is not None:
        # The wanted density is that of all passes
        share = n_before / len(scenario.passes)
        scenario = replace(scenario, scanners=tuple(_thinned(head, share) for head in scenario.scanners))
    return with_hard_conditions(with_scanner(scenario, scanner, points_per_m))


def _holes(scenario: Scenario) -> tuple[tuple[float, float], ...]:
    """Return stretches without points, and as long pieces between them; at least one where the road has room for it."""
    rng = np.random.default_rng([scenario.seed, 28, sum(map(ord, scenario.kind))])
    holes, at = list[tuple[float, float]](), 0.0
    # On a short road they are short enough for one hole to fit
    most = min(_PIECE_M[1], scenario.length_m / 3.0)
    while True:
        start = at + float(rng.uniform(_PIECE_M[0], most))
        end = start + float(rng.uniform(_PIECE_M[0], most))
        if end + _PIECE_M[0] > scenario.length_m:
            return tuple(holes)
        holes.append((start, end))
        at = end


def _thinned(head: Head, share: float) -> Head:
    """Return a profile scanner that sends this share of its pulses."""
    assert isinstance(head, Scanner)
    rays = max(np.floor(share * head.rays_per_turn), _RAYS[0]) + head.rays_per_turn % 1.0
    return replace(head, rays_per_turn=float(rays))


def with_scanner(scenario: Scenario, scanner: str, points_per_m: float | None = None) -> Scenario:
    """Return the scenario measured with another scanner; what is drawn for it follows from the scenario's seed.

    Parameters
    ----------
    scanner
        "default": as the scenario has it. "one": one profile scanner. "tilted": two or three whose planes lean
        and cross by any angles. "spinning16", "spinning32", "spinning64", "spinning128": a lidar of that many
        beams on the roof of a car. "airborne": two overlapping flight strips. "terrestrial": two or three stations of a
        scanner on a tripod.
    points_per_m
        About how many points per metre of road to record; None: as drawn.

    Raises
    ------
    UsageError
        Another scanner.
    """
    if scanner not in SCANNERS:
        problem = f"there is no scanner {scanner!r}" + did_you_mean([str(scanner)], SCANNERS)
        raise UsageError(problem, where=argument("scanner"), advice=f"choose one of {', '.join(SCANNERS)}")
    if scanner == "default":
        return scenario
    numbers = [scenario.seed, 24, SCANNERS.index(scanner), sum(map(ord, scenario.kind))]
    rng = np.random.default_rng(numbers)
    return replace(_RIGS[scanner](scenario, points_per_m, rng), scanner=scanner)


def _one(scenario: Scenario, points_per_m: float | None, rng: np.random.Generator) -> Scenario:
    """Return it with one head whose plane is anything from upright across the road to leaning back by 45 degrees."""
    tilt = float(rng.uniform(-20.0, 20.0)), float(rng.uniform(0.0, 45.0))
    return _with_profiles(scenario, [tilt], points_per_m, rng)


def _tilted(scenario: Scenario, points_per_m: float | None, rng: np.random.Generator) -> Scenario:
    """Return it with two or three heads, each turned and leaning by its own angles; no two alike."""
    turned = [rng.uniform(15.0, 60.0), -rng.uniform(15.0, 60.0), rng.uniform(-10.0, 10.0)]
    n = int(rng.integers(2, 4))
    return _with_profiles(
        scenario, [(float(yaw), float(rng.uniform(0.0, 50.0))) for yaw in turned[:n]], points_per_m, rng
    )


def _with_profiles(
    scenario: Scenario,
    tilts_deg: list[tuple[float, float]],
    points_per_m: float | None,
    rng: np.random.Generator,
) -> Scenario:
    """Return the scenario with profile heads of these yaws and pitches, scan lines 4 to 22 cm apart for each."""
    height, max_returns = float(rng.uniform(2.0, 2.6)), int(rng.choice([1, 4]))
    n = len(tilts_deg) * len(scenario.passes)
    closest = max(0.04, n / _MOST_LINES_PER_M)
    heads: list[Head] = []
    for i, (yaw, pitch) in enumerate(tilts_deg):
        spacing = float(np.exp(rng.uniform(np.log(closest), np.log(0.22))))
        turns = scenario.passes[0].speed_mps / spacing
        rays = float(np.exp(rng.uniform(np.log(600), np.log(1500))))
        if points_per_m is not None:
            rays = float(np.clip(points_per_m / n * spacing / _COMES_BACK, *_RAYS))
        # No whole number, see `Scanner`
        rays = float(np.floor(rays) + rng.uniform(0.1, 0.9))
        left = 0.35 * float(np.sign(yaw)) if len(tilts_deg) > 1 and i < 2 else 0.0
        # A single head stands as far behind the van as its plane needs to pass the corners of the body on both sides
        behind = 0.95 * np.tan(np.radians(abs(yaw))) if len(tilts_deg) == 1 else 0.0
        heads.append(
            Scanner(
                position_m=(-1.05 - float(behind), left, height),
                yaw_deg=yaw,
                pitch_deg=pitch,
                turns_per_s=turns,
                rays_per_turn=rays,
                max_returns=max_returns,
            )
        )
    return replace(scenario, scanners=tuple(heads))


def _spinning(n_beams: int) -> Callable[[Scenario, float | None, np.random.Generator], Scenario]:
    """Return what draws a lidar of that many beams."""

    def draw(scenario: Scenario, points_per_m: float | None, rng: np.random.Generator) -> Scenario:
        low, high = -rng.uniform(15.0, 30.0), rng.uniform(2.0, 22.0)
        share = np.linspace(-1.0, 1.0, n_beams)
        if rng.random() < 0.5:  # denser towards the middle, as beams for roads are
            share = np.sign(share) * np.abs(share) ** rng.uniform(1.0, 1.8)
        elevation = low + (high - low) * 0.5 * (share + 1.0) + rng.normal(0.0, 0.03, n_beams)
        turns = float(rng.uniform(5.0, 20.0))
        columns = float(rng.uniform(9_000.0, 20_000.0)) / turns
        if points_per_m is not None:
            a_second = points_per_m * scenario.passes[0].speed_mps / len(scenario.passes)
            columns = a_second / (_SPINS_BACK * n_beams * turns)
        head = SpinningScanner(
            position_m=(float(rng.uniform(0.4, 0.9)), float(rng.uniform(-0.1, 0.1)), float(rng.uniform(1.8, 2.3))),
            elevation_deg=_numbers(elevation),
            # Columns of lasers stand side by side in the housing, 2 to 4 of them
            azimuth_deg=_numbers((np.arange(n_beams) % int(rng.integers(2, 5)) - 1.0) * rng.uniform(0.5, 3.0)),
            range_bias_m=_numbers(rng.normal(0.0, rng.uniform(0.003, 0.015), n_beams)),
            gain=_numbers(np.exp(rng.normal(0.0, rng.uniform(0.05, 0.25), n_beams))),
            turns_per_s=turns,
            columns_per_turn=float(np.floor(np.clip(columns, *_COLUMNS)) + rng.uniform(0.1, 0.9)),
            tilt_deg=float(rng.uniform(-3.0, 5.0)),
            max_returns=int(rng.choice([1, 2])),
        )  # fmt: skip
        # Ranges of such lidars scatter by 1 to 3 cm (their makers' figures)
        sensor = replace(scenario.sensor, range_noise_m=float(rng.uniform(0.006, 0.03)))
        return replace(scenario, scanners=(head,), sensor=sensor)

    return draw


def _airborne(scenario: Scenario, points_per_m: float | None, rng: np.random.Generator) -> Scenario:
    """Return it flown over in two strips that overlap by 20 to 60 %; the road lies anywhere in the overlap."""
    path = _path(scenario)
    height, half_deg = float(rng.uniform(300.0, 1000.0)), float(rng.uniform(15.0, 30.0))
    density = float(rng.uniform(8.0, 30.0))
    if points_per_m is not None:
        density = float(np.clip(points_per_m / _CORRIDOR_M, *_DENSITIES))
    # Both strips together; lines and the points in them are about equally far apart
    apart = float(np.sqrt(2.0 / density * np.exp(rng.uniform(-0.5, 0.5))))
    speed, swath = float(rng.uniform(50.0, 80.0)), 2.0 * height * np.tan(np.radians(half_deg))
    head = SwathScanner(
        half_angle_deg=half_deg,
        oscillates=bool(rng.random() < 0.5),
        lines_per_s=speed / apart,
        pulses_per_line=float(np.floor(swath * apart * density / 2.0) + rng.uniform(0.1, 0.9)),
        divergence_rad=float(rng.uniform(0.1, 0.3)) / height,
    )
    along = path[-1] - path[0]
    # A place of less than a third of the swath is flown over in any direction, a road along itself
    free = np.pi if np.ptp(path[:, :2], axis=0).max() < swath / 3.0 else np.radians(10.0)
    heading = float(np.arctan2(along[1], along[0]) + rng.uniform(-free, free))
    course, left = np.array([np.cos(heading), np.sin(heading)]), np.array([-np.sin(heading), np.cos(heading)])
    middle = 0.5 * (path[:, :2].min(axis=0) + path[:, :2].max(axis=0))
    # Beyond the ends: what lies there is seen, too, and a nod of the aircraft shifts lines by some 15 m
    run = float(np.ptp(path[:, :2] @ course)) + 80.0
    overlap = float(rng.uniform(0.2, 0.6)) * swath
    shift, flights = float(rng.uniform(-0.5, 0.5)) * overlap, []
    for i, side in enumerate((1.0, -1.0)):
        backwards = i == 1 and bool(rng.random() < 0.5)
        sense = -1.0 if backwards else 1.0
        start = middle + left * (side * 0.5 * (swath - overlap) + shift) - sense * 0.5 * run * course
        flights.append(
            Flight(
                start_m=(float(start[0]), float(start[1]), float(np.mean(path[:, 2])) + height),
                heading_rad=heading + (np.pi if backwards else 0.0),
                length_m=run,
                speed_mps=speed,
                sway_rad=float(np.radians(rng.uniform(0.3, 1.5))),
                pose_error_m=_error(rng, 0.01),
                start_time_s=scenario.passes[0].start_time_s + 600.0 * i,
            )
        )
    sensor = replace(
        scenario.sensor,
        range_noise_m=float(rng.uniform(0.008, 0.03)),
        max_range_m=3.0 * height,
        gain=scenario.sensor.gain * (height / 10.0) ** scenario.sensor.range_power,
        # Birds and haze above, multiple reflections below
        stray_m=(-60.0, 15.0),
    )
    return replace(scenario, scanners=(head,), sensor=sensor, flights=tuple(flights))


def _terrestrial(scenario: Scenario, points_per_m: float | None, rng: np.random.Generator) -> Scenario:
    """Return it scanned from two or three tripods on the lane, the outer ones a quarter of its length from the ends."""
    path, n = _path(scenario), int(rng.integers(2, 4))
    step = float(np.radians(rng.uniform(0.08, 0.16)))
    if points_per_m is not None:
        # Half a turn of the axis times a turn of the mirror
        step = float(np.sqrt(2.0 * np.pi**2 * n * _COMES_BACK / (points_per_m * scenario.length_m)))
    head = StationScanner(
        turns=float(np.ceil(np.pi / step)),
        rays_per_turn=float(np.floor(2.0 * np.pi / step) + rng.uniform(0.1, 0.9)),
        pulses_per_s=float(rng.uniform(1e5, 1e6)),
    )
    duration = head.turns * head.rays_per_turn / head.pulses_per_s
    stations = []
    for i, share in enumerate(np.linspace(0.25, 0.75, n)):
        x, y, z = path[int(share * (len(path) - 1))]
        stations.append(
            Station(
                place_m=(
                    float(x + rng.uniform(-0.4, 0.4)),
                    float(y + rng.uniform(-0.4, 0.4)),
                    float(z + rng.uniform(1.69, 1.85)),
                ),
                yaw_rad=float(rng.uniform(-np.pi, np.pi)),
                duration_s=duration,
                pose_error_m=_error(rng, 0.003),
                start_time_s=scenario.passes[0].start_time_s + i * np.ceil(duration + 300.0),
            )
        )
    sensor = replace(
        scenario.sensor,
        range_noise_m=float(rng.uniform(0.002, 0.006)),
        max_range_m=float(rng.uniform(80.0, 200.0)),
    )
    return replace(scenario, scanners=(head,), sensor=sensor, stations=tuple(stations))


def _path(scenario: Scenario) -> FloatArray:
    """Return (n, 3) where the first pass would be driven, local frame."""
    rng = np.random.default_rng([scenario.seed, 21, 0])
    return drive(scenario.layout.road, scenario.passes[0], scenario.length_m, rng).xyz


def _error(rng: np.random.Generator, most_m: float) -> tuple[float, float, float]:
    """Return an error of up to `most_m` in any direction."""
    error = rng.normal(size=3)
    x, y, z = error * rng.uniform(0.0, most_m) / np.linalg.norm(error)
    return float(x), float(y), float(z)


def _numbers(values: AnyArray) -> tuple[float, ...]:
    return tuple(float(v) for v in values)


_RIGS: dict[str, Callable[[Scenario, float | None, np.random.Generator], Scenario]] = {
    "one": _one,
    "tilted": _tilted,
    **{f"spinning{n}": _spinning(n) for n in (16, 32, 64, 128)},
    "airborne": _airborne,
    "terrestrial": _terrestrial,
}
SCANNERS = ("default", *_RIGS)
