"""What the scanners record of their hits: noisy positions and intensities, and stray points."""

from __future__ import annotations

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.model.points import Points
from linework.simulation.materials import GROUND, REFLECTANCE, ROUGHNESS_M, Material
from linework.simulation.paint import paint_cover, smooth_noise
from linework.simulation.part import Scene
from linework.simulation.scanner import Hits
from linework.simulation.scenario import Scenario, Sensor


def on_wire_axis(scene: Scene, hits: Hits) -> Hits:
    """Return the hits with those on wires moved along their beams to the wire's near surface.

    The mesh of a wire is as thick as a beam's spot, so that realistically many beams meet it; the range
    that comes back is nevertheless that of the wire itself.
    """
    wire = scene.mesh.wire[hits.triangle]
    on = np.flatnonzero(wire >= 0)
    a, b = scene.wire_segments[wire[on], 0], scene.wire_segments[wire[on], 1]
    u = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    d, w = hits.direction[on], hits.origin[on] - a
    # Closest approach of two lines: minimise |w + t d - (..) u|
    across = np.sum(d * u, axis=1)
    t = (np.sum(w * u, axis=1) * across - np.sum(w * d, axis=1)) / np.maximum(1.0 - across**2, 1e-6)
    reach = hits.range_m.copy()
    reach[on] = np.where(np.abs(t - reach[on]) < 0.5, t - 0.5 * scene.wire_m[wire[on]], reach[on])
    return Hits(
        hits.time_s, hits.origin, hits.direction, reach, hits.triangle, hits.chainage_offset,
        hits.cos_incidence, hits.error_m,
    )  # fmt: skip


def recorded(scenario: Scenario, scene: Scene, hits: Hits, rng: np.random.Generator) -> Points:
    """Return the survey's points, one per hit, world frame, in the order of `hits`."""
    sensor = scenario.sensor
    material = scene.mesh.material[hits.triangle]
    reach = hits.range_m + sensor.range_noise_m * rng.normal(size=len(hits))
    stray = rng.random(len(hits)) < sensor.stray_share
    # Rain, dust and multiple reflections: anywhere along the beam, also behind what it met (below ground)
    reach = np.where(stray, hits.range_m * rng.uniform(0.2, 1.4, len(hits)), reach)
    xyz = hits.origin + hits.direction * reach[:, None] + hits.error_m
    rough = ROUGHNESS_M[material] * rng.normal(size=len(hits))
    is_grass = material == Material.GRASS
    # Blades stand up from the soil: grass is never below it
    xyz[:, 2] += np.where(is_grass, 1.5 * np.abs(rough), rough)
    intensity = _intensity(scenario, hits, material, rng)
    return Points(xyz + np.asarray(scenario.origin_m), intensity, hits.time_s)


def _intensity(scenario: Scenario, hits: Hits, material: AnyArray, rng: np.random.Generator) -> AnyArray:
    sensor = scenario.sensor
    strength = _reflectance(scenario, hits, material)
    strength *= (hits.range_m / 10.0) ** -sensor.range_power * hits.cos_incidence**sensor.incidence_power
    strength *= _drift(sensor, hits.time_s)
    strength *= np.maximum(1.0 + 0.07 * rng.normal(size=len(hits)), 0.1)
    return np.floor(np.clip(strength * sensor.gain, 0.0, 2**sensor.intensity_bits - 1)).astype(np.float32)


def _reflectance(scenario: Scenario, hits: Hits, material: AnyArray) -> FloatArray:
    reflectance = REFLECTANCE[material].copy()
    on_ground = GROUND[material]
    place = hits.chainage_offset[on_ground]
    # Texture: stones and stains; patches of other asphalt along the road
    fine = smooth_noise(place[:, 0] / 0.3, place[:, 1] / 0.3, scenario.seed + 101)
    patch = smooth_noise(place[:, 0] / 12.0, place[:, 1] / 2.5, scenario.seed + 102)
    texture = 1.0 + 0.2 * (fine - 0.5) + 0.3 * (patch - 0.5)
    reflectance[on_ground] *= texture
    on_asphalt = np.flatnonzero(material == Material.ASPHALT)
    layout = scenario.layout
    cover = paint_cover(hits.chainage_offset[on_asphalt], layout.markings, scenario.seed, layout.symbols)
    paint = REFLECTANCE[Material.ASPHALT] * scenario.sensor.contrast
    reflectance[on_asphalt] += cover * (paint - reflectance[on_asphalt])
    return reflectance


def _drift(sensor: Sensor, time_s: FloatArray) -> FloatArray:
    """Return the slow change of the receiver: `drift` from trough to crest."""
    return np.asarray(1.0 + 0.5 * sensor.drift * np.sin(2.0 * np.pi * time_s / sensor.drift_period_s))
