"""What laser scanners record of their hits: noisy positions, intensities, stray points, and the fields of a file."""

from __future__ import annotations

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.model.points import Points
from linework.simulation.roads.scenario import Scenario, Sensor
from linework.simulation.scene.materials import GROUND, LASER_REFLECTANCE, ROUGHNESS_M, Material
from linework.simulation.scene.paint import paint_cover, smooth_noise, stain_shade
from linework.simulation.scene.part import Scene
from linework.simulation.sensors.scanner import Hits

#: How bright a mirrored return or a drop is, in relation to what the beam met.
_FALSE_SHARE = 0.3


def record_points(scenario: Scenario, scene: Scene, hits: Hits, rng: np.random.Generator) -> Points:
    """Return the survey's points, one per hit, world frame, in the order of `hits`."""
    sensor = scenario.sensor
    material = scene.mesh.material[hits.triangle]
    bias = np.concatenate([head.range_bias_m for head in scenario.scanners])[hits.beam]
    is_false = np.isfinite(hits.false_range_m)
    reach = (
        np.where(is_false, hits.false_range_m, hits.range_m)
        + bias
        + sensor.range_noise_m * rng.normal(size=len(hits))
    )
    stray = rng.random(len(hits)) < sensor.stray_share
    # Rain, dust and multiple reflections: anywhere along the beam, also behind what it met (below ground)
    where = rng.uniform(0.2, 1.4, len(hits))
    if sensor.stray_m is None:
        reach = np.where(stray, hits.range_m * where, reach)
    else:
        reach = np.where(stray, hits.range_m + np.interp(where, (0.2, 1.4), sensor.stray_m), reach)
    xyz = hits.origin + hits.direction * reach[:, None] + hits.error_m
    rough = ROUGHNESS_M[material] * rng.normal(size=len(hits))
    is_grass = material == Material.GRASS
    # Blades stand up from the soil: grass is never below it
    xyz[:, 2] += np.where(is_grass, 1.5 * np.abs(rough), rough)
    intensity = _intensity(scenario, hits, material, rng)
    return Points(
        xyz + np.asarray(scenario.origin_m),
        intensity=intensity,
        time_s=hits.time_s,
        columns=_fields(scenario, hits) if scenario.scanner != "default" else {},
    )


def _fields(scenario: Scenario, hits: Hits) -> dict[str, AnyArray]:
    """Return the fields that files of real scanners have, by their names in LAS files; `ring` of many beams."""
    n_beams = np.array([head.n_beams for head in scenario.scanners])
    first = np.cumsum(n_beams) - n_beams
    head = np.searchsorted(first, hits.beam, side="right") - 1
    fields = {
        "point_source_id": hits.strip + 1,
        "scanner_channel": head,
        "scan_angle": hits.angle_deg,
        "return_number": hits.return_number,
        "number_of_returns": hits.n_returns,
        "scan_direction_flag": hits.is_forward,
        "edge_of_flight_line": hits.is_edge,
    }
    return fields | ({"ring": hits.beam - first[head]} if n_beams.max() > 1 else {})


def _intensity(scenario: Scenario, hits: Hits, material: AnyArray, rng: np.random.Generator) -> AnyArray:
    sensor = scenario.sensor
    strength = _reflectance(scenario, hits, material)
    strength *= (hits.range_m / 10.0) ** -sensor.range_power * hits.cos_incidence**sensor.incidence_power
    strength *= _drift(sensor, hits.time_s)
    strength *= np.concatenate([head.gain for head in scenario.scanners])[hits.beam]
    strength[np.isfinite(hits.false_range_m)] *= _FALSE_SHARE
    zero = 0.0
    if scenario.conditions is not None:
        strength *= np.asarray(scenario.conditions.gain)[hits.beam]
        zero = scenario.conditions.zero_counts
    strength *= np.maximum(1.0 + 0.07 * rng.normal(size=len(hits)), 0.1)
    return np.floor(np.clip(strength * sensor.gain + zero, 0.0, 2**sensor.intensity_bits - 1)).astype(
        np.float32
    )


def _reflectance(scenario: Scenario, hits: Hits, material: AnyArray) -> FloatArray:
    reflectance = LASER_REFLECTANCE[material].copy()
    on_ground = GROUND[material]
    place = hits.chainage_offset[on_ground]
    # Texture: stones and stains; patches of other asphalt along the road
    fine = smooth_noise(place[:, 0] / 0.3, place[:, 1] / 0.3, scenario.seed + 101)
    patch = smooth_noise(place[:, 0] / 12.0, place[:, 1] / 2.5, scenario.seed + 102)
    texture = 1.0 + 0.2 * (fine - 0.5) + 0.3 * (patch - 0.5)
    reflectance[on_ground] *= texture
    if stains := scenario.layout.all_stains:
        reflectance[on_ground] *= stain_shade(place, stains)
    on_asphalt = np.flatnonzero(material == Material.ASPHALT)
    cover = _cover(scenario, hits.take(on_asphalt))
    paint = LASER_REFLECTANCE[Material.ASPHALT] * scenario.sensor.contrast
    reflectance[on_asphalt] += cover * (paint - reflectance[on_asphalt])
    return reflectance


def _cover(scenario: Scenario, hits: Hits) -> FloatArray:
    """Return the share of each footprint on asphalt that is painted."""
    layout = scenario.layout
    place, markings = hits.chainage_offset, layout.all_markings
    wide = np.array([head.divergence_rad for head in scenario.scanners])
    if not wide.any():
        return paint_cover(place, markings, scenario.seed, layout.symbols)
    n_beams = np.array([head.n_beams for head in scenario.scanners])
    radius = 0.5 * np.repeat(wide, n_beams)[hits.beam] * hits.range_m
    cover = np.zeros(len(hits))
    # The middle and two rings that stand for equal areas of the disk
    steps = [(0.0, 0.0), *((r, a) for r in (0.55, 0.85) for a in np.arange(6) * np.pi / 3.0 + r)]
    for share, around in steps:
        off = (share * radius)[:, None] * np.array([np.cos(around), np.sin(around)])
        cover += paint_cover(place + off, markings, scenario.seed, layout.symbols)
    return np.asarray(cover / len(steps))


def _drift(sensor: Sensor, time_s: FloatArray) -> FloatArray:
    """Return the slow change of the receiver: `drift` from trough to crest."""
    return np.asarray(1.0 + 0.5 * sensor.drift * np.sin(2.0 * np.pi * time_s / sensor.drift_period_s))
