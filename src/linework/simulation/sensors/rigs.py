"""The scanners a survey can be made with, drawn by the seed: `with_scanner` puts one into a scenario."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from linework.errors import UsageError, argument, did_you_mean
from linework.simulation.roads.scenario import Scenario
from linework.simulation.sensors.heads import Head, Scanner, SpinningScanner

#: Share of the pulses of a profile scanner and of a spinning one that come back, roughly: the rest meets the sky, the
#: vehicle, or nothing within range (measured over the kinds of road: 0.45 to 0.55, and 0.15 to 0.7).
_COMES_BACK, _SPINS_BACK = 0.5, 0.4
#: Scan lines of profile scanners per metre of road at most, over all heads and passes: what one van records.
_MOST_LINES_PER_M = 35.0
#: Beams per turn of a profile scanner, and columns per turn of a spinning one, at least and at most.
_RAYS, _COLUMNS = (100.0, 20_000.0), (36.0, 4096.0)


def with_scanner(scenario: Scenario, scanner: str, points_per_m: float | None = None) -> Scenario:
    """Return the scenario measured with another scanner; what is drawn for it follows from the scenario's seed.

    Parameters
    ----------
    scanner
        "default": as the scenario has it. "one": one profile scanner. "tilted": two or three whose planes lean
        and cross by any angles. "spinning16", "spinning32", "spinning64", "spinning128": a lidar of that many
        beams on the roof of a car.
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
    rng = np.random.default_rng([scenario.seed, 24, SCANNERS.index(scanner)])
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
    height = float(rng.uniform(2.0, 2.6))
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
        heads.append(
            Scanner(
                position_m=(-1.05, left, height),
                yaw_deg=yaw,
                pitch_deg=pitch,
                turns_per_s=turns,
                rays_per_turn=rays,
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
            position_m=(float(rng.uniform(0.8, 1.6)), float(rng.uniform(-0.1, 0.1)), float(rng.uniform(1.75, 2.1))),
            elevation_deg=_numbers(elevation),
            # Columns of lasers stand side by side in the housing, 2 to 4 of them
            azimuth_deg=_numbers((np.arange(n_beams) % int(rng.integers(2, 5)) - 1.0) * rng.uniform(0.5, 3.0)),
            range_bias_m=_numbers(rng.normal(0.0, rng.uniform(0.003, 0.015), n_beams)),
            gain=_numbers(np.exp(rng.normal(0.0, rng.uniform(0.05, 0.25), n_beams))),
            turns_per_s=turns,
            columns_per_turn=float(np.floor(np.clip(columns, *_COLUMNS)) + rng.uniform(0.1, 0.9)),
            tilt_deg=float(rng.uniform(-3.0, 5.0)),
        )  # fmt: skip
        # Ranges of such lidars scatter by 1 to 3 cm (their makers' figures)
        sensor = replace(scenario.sensor, range_noise_m=float(rng.uniform(0.006, 0.03)))
        return replace(scenario, scanners=(head,), sensor=sensor)

    return draw


def _numbers(values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(v) for v in values)


_RIGS: dict[str, Callable[[Scenario, float | None, np.random.Generator], Scenario]] = {
    "one": _one,
    "tilted": _tilted,
    **{f"spinning{n}": _spinning(n) for n in (16, 32, 64, 128)},
}
SCANNERS = ("default", *_RIGS)
