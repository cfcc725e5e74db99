"""Hard conditions: what scanners, calibration, navigation and weather do to a survey, drawn by the seed.

References
----------
Skaloud, Lichti (2006), Rigorous approach to bore-sight self-calibration in airborne laser scanning, ISPRS Journal of
Photogrammetry and Remote Sensing 61(1), doi:10.1016/j.isprsjprs.2006.07.003: how boresight and time errors move points.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from linework.arrays import FloatArray
from linework.errors import UsageError, argument, did_you_mean
from linework.simulation.roads.scenario import Conditions, Pass, Scenario
from linework.simulation.scene.materials import LASER_REFLECTANCE, Material
from linework.simulation.scene.part import Scene
from linework.simulation.sensors.drive import Drive
from linework.simulation.sensors.heads import Head
from linework.simulation.sensors.scanner import Caster, Hits, to_local_frame

SURVEY_CONDITIONS = ("usual", "hard")
#: Errors of position, from and to, that boresight, late times and slow navigation errors cause each. [m]
_ERRORS_M = (0.002, 0.030)
#: Surfaces that mirror a laser beam.
_SHINY = (Material.CAR, Material.GLASS, Material.STEEL, Material.SIGN)
#: Nearest drop of which a return is recorded: what is nearer is taken for the cover's own reflection. [m]
_NEAREST_DROP_M = 0.8


def check_conditions(conditions: str) -> None:
    """Refuse a name that is not one of `SURVEY_CONDITIONS`.

    Raises
    ------
    UsageError
        Another name.
    """
    if conditions not in SURVEY_CONDITIONS:
        problem = f"there are no conditions {conditions!r}" + did_you_mean(
            [str(conditions)], SURVEY_CONDITIONS
        )
        raise UsageError(
            problem, where=argument("conditions"), advice=f"choose one of {', '.join(SURVEY_CONDITIONS)}"
        )


def with_second_pass(scenario: Scenario) -> Scenario:
    """Return the scenario with a second pass, against the first one where the road has such a lane, in 3 of 4."""
    rng = _generator(scenario, 0)
    first = scenario.passes[0]
    if len(scenario.passes) > 1 or rng.random() > 0.75:
        return scenario
    lanes = scenario.layout.lanes
    against = [lane for lane in lanes if lane[1] != first.direction]
    offset, direction = (against or list(lanes))[-1]
    second = Pass(
        q_m=offset,
        direction=direction,
        speed_mps=first.speed_mps,
        wander_m=first.wander_m,
        pose_error_m=(0.0, 0.0, 0.0),
        # Speeds vary by a tenth: the first pass is over by then
        start_time_s=first.start_time_s + max(400.0, np.ceil(1.3 * scenario.length_m / first.speed_mps)),
    )
    return replace(scenario, passes=(first, second))


def with_hard_conditions(scenario: Scenario) -> Scenario:
    """Return the scenario, its scanners chosen, under hard conditions.

    Ranges: range noise 2 to 40 mm; intensities of 8 bit in 6 of 10, at 0.5 to 5 times the usual gain, so that paint
    saturates; a zero offset of up to twice what asphalt gives; drift 20 to 60 %; gain steps of up to 2
    between heads and 40 % between beams; boresight, time and slow position errors of 2 to 30 mm each; 0 to 20 % of the
    beams on shiny things mirrored, 0 to 2 % on rain drops.
    """
    rng = _generator(scenario, 1)
    bits = 8 if rng.random() < 0.6 else 16
    full = 2.0**bits - 1.0
    # Counts of asphalt straight below: paint may be at the top of the scale, but nobody flies or drives on with a
    # receiver that sees white everywhere
    below = 3.0 if scenario.is_driven else 5.0
    if scenario.flights:
        below = scenario.sensor.max_range_m / 3.0
    seen = float(LASER_REFLECTANCE[Material.ASPHALT]) * (below / 10.0) ** -scenario.sensor.range_power
    usual = scenario.sensor.gain * 2.0 ** (bits - scenario.sensor.intensity_bits)
    gain = min(usual * _between(rng, 0.5, 5.0), 0.4 * full / seen)
    zero = float(min(seen * gain * rng.uniform(0.0, 2.0), 0.3 * full))
    sensor = replace(
        scenario.sensor,
        range_noise_m=_between(rng, 0.002, 0.040),
        intensity_bits=bits,
        gain=gain,
        drift=float(rng.uniform(0.2, 0.6)),
    )
    gains = tuple(g for head in scenario.scanners for g in _gains(head, rng))
    # Lever at which a boresight error shows
    reach = 10.0 if scenario.is_driven else 20.0
    if scenario.flights:
        reach = scenario.sensor.max_range_m / 3.0
    conditions = Conditions(
        zero_counts=zero,
        gain=gains,
        boresight_rad=tuple(_rotation(rng, _between(rng, *_ERRORS_M) / reach) for _ in scenario.scanners),
        delay_s=float(rng.choice([-1.0, 1.0])) * _between(rng, *_ERRORS_M) / _speed(scenario),
        wander_m=_between(rng, *_ERRORS_M),
        mirror_share=float(rng.uniform(0.0, 0.2)),
        # Nobody flies in rain
        rain_share=0.0 if scenario.flights else float(rng.uniform(0.0, 0.02)) * (rng.random() < 0.5),
    )
    return replace(scenario, sensor=sensor, conditions=conditions)


def _generator(scenario: Scenario, number: int) -> np.random.Generator:
    return np.random.default_rng([scenario.seed, 26, sum(map(ord, scenario.kind)), number])


def _speed(scenario: Scenario) -> float:
    return scenario.flights[0].speed_mps if scenario.flights else scenario.passes[0].speed_mps


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a value between two, evenly over their logarithms."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _rotation(rng: np.random.Generator, angle_rad: float) -> tuple[float, float, float]:
    axis = rng.normal(size=3)
    x, y, z = angle_rad * axis / np.linalg.norm(axis)
    return float(x), float(y), float(z)


def _gains(head: Head, rng: np.random.Generator) -> tuple[float, ...]:
    """Return a gain for each beam of a head: a step that they share, and if there are several, one of its own."""
    step = _between(rng, 0.5, 2.0)
    spread = float(rng.uniform(0.1, 0.4)) if head.n_beams > 1 else 0.0
    return tuple(float(step * np.exp(own)) for own in rng.normal(0.0, spread, head.n_beams))


def wandering(scenario: Scenario, carriers: list[Drive]) -> list[Drive]:
    """Return what carries the scanners, with a slow position error of its own in each pass, strip or station."""
    if scenario.conditions is None:
        return carriers
    errors = [
        scenario.conditions.wander_m * _slow(c.time_s, np.random.default_rng([scenario.seed, 27, i]))
        for i, c in enumerate(carriers)
    ]
    return [replace(c, error_m=c.error_m + error) for c, error in zip(carriers, errors, strict=True)]


def _slow(time_s: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return (n, 3) waves of amplitude 1 with periods of 8 s to 2 minutes: satellites change, corrections come late."""
    period, phase = (
        np.exp(rng.uniform(np.log(8.0), np.log(120.0), (2, 3))),
        rng.uniform(0.0, 2.0 * np.pi, (2, 3)),
    )
    since = (time_s - time_s[0])[:, None]
    slow, fast = (np.sin(2.0 * np.pi * since / p + f) for p, f in zip(period, phase, strict=True))
    return np.asarray(0.7 * slow + 0.3 * fast)


def misplaced(conditions: Conditions, carrier: Drive, i_head: int, hits: Hits) -> FloatArray:
    """Return (n, 3) how far boresight and late times move points [m, local frame]."""
    time = hits.time_s
    angles = [
        np.interp(time, carrier.time_s, a) for a in (carrier.roll_rad, carrier.pitch_rad, carrier.yaw_rad)
    ]
    lever = hits.direction * hits.range_m[:, None]
    turn = np.broadcast_to(np.asarray(conditions.boresight_rad[i_head]), lever.shape)
    off = np.cross(to_local_frame(turn, *angles), lever)
    if conditions.delay_s and len(carrier.time_s) > 2:
        speed = np.gradient(carrier.xyz, carrier.time_s, axis=0)
        velocity = np.stack([np.interp(time, carrier.time_s, v) for v in speed.T], axis=1)
        spin = np.interp(time, carrier.time_s, np.gradient(carrier.yaw_rad, carrier.time_s))
        whirl = spin[:, None] * np.stack([-lever[:, 1], lever[:, 0], np.zeros(len(lever))], axis=1)
        off = off + conditions.delay_s * (velocity + whirl)
    return np.asarray(off)


def false_ranges(
    conditions: Conditions, caster: Caster, scene: Scene, hits: Hits, i_pass: int, rng: np.random.Generator
) -> FloatArray:
    """Return (n,) the range of returns that are not of what the beam met [m]: mirrored ones, drops; NaN for the others.

    A mirrored return lies on the beam, as far off as the light went: behind the shiny surface.
    """
    found = np.full(len(hits), np.nan)
    shiny = np.isin(scene.mesh.material[hits.triangle], _SHINY)
    some = np.flatnonzero(shiny & (rng.random(len(hits)) < conditions.mirror_share))
    place = hits.xyz[some]
    mirrored = caster.mirrored(hits.direction[some], hits.triangle[some])
    ray, _, further = caster.cast(place + 0.01 * mirrored, mirrored, 40.0, i_pass, rng)
    found[some[ray]] = hits.range_m[some[ray]] + 0.01 + further
    wet = rng.random(len(hits)) < conditions.rain_share
    # Light spreads with the square of the range, and so do returns of drops thin out
    share = rng.random(len(hits))
    far = np.maximum(hits.range_m, _NEAREST_DROP_M)
    drop = 1.0 / (1.0 / _NEAREST_DROP_M - share * (1.0 / _NEAREST_DROP_M - 1.0 / far))
    return np.where(wet & (drop < hits.range_m), drop, found)
