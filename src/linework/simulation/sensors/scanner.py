"""Profile scanners on the van: every beam is a ray cast against the scene, so what hides things is real."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray
from linework.errors import extra_needed
from linework.model.points import Points
from linework.simulation.roads.scenario import Scanner, Scenario, Sensor
from linework.simulation.scene.materials import (
    GROUND,
    LASER_REFLECTANCE,
    RETURN_SHARE,
    ROUGHNESS_M,
    SEE_THROUGH,
    Material,
)
from linework.simulation.scene.paint import paint_cover, smooth_noise, stain_shade
from linework.simulation.scene.part import Scene
from linework.simulation.sensors.drive import Drive

#: Beams at a time: what the arrays of a batch need stays under 100 MB.
_BATCH = 200_000
#: Directions that are told apart between two pulses.
_FINER = 64
#: How often a beam may go on through leaves, mesh and glass.
_MAX_LAYERS = 4
#: The van's own body in its frame: beams through it are lost. (x, y, z from; to) [m]
_VAN = (np.array([-1.0, -0.95, 0.25]), np.array([4.2, 0.95, 1.9]))


@dataclass(frozen=True, slots=True)
class Hits:
    """Where beams met the scene, before any noise.

    Parameters
    ----------
    time_s
        (n,) float64.
    origin, direction
        (n, 3) float64: beam, local frame; unit direction.
    range_m
        (n,) float64.
    triangle
        (n,) int32: index into the scene's mesh.
    chainage_offset
        (n, 2) float64 [m]: place on the road for hits on the ground, else NaN.
    cos_incidence
        (n,) float64.
    error_m
        (n, 3) float64: pose error at that time.
    """

    time_s: FloatArray
    origin: FloatArray
    direction: FloatArray
    range_m: FloatArray
    triangle: AnyArray
    chainage_offset: FloatArray
    cos_incidence: FloatArray
    error_m: FloatArray

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def xyz(self) -> FloatArray:
        """(n, 3) positions, local frame."""
        return self.origin + self.direction * self.range_m[:, None]

    def take(self, index: AnyArray) -> Hits:
        """Return the chosen hits."""
        return Hits(*(getattr(self, name)[index] for name in self.__dataclass_fields__))

    @classmethod
    def concatenate(cls, parts: list[Hits]) -> Hits:
        """Return all hits of `parts` in order."""
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in cls.__dataclass_fields__))


class Caster:
    """The scene made ready for rays; intersections are refined in double precision."""

    def __init__(self, scene: Scene) -> None:
        mesh = scene.mesh
        self._scene = scene
        with extra_needed("simulate"):
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene

        self._embree = EmbreeScene()
        self._mesh = TriangleMesh(self._embree, mesh.vertices.astype(np.float32), mesh.triangles)
        a, b, c = (mesh.vertices[mesh.triangles[:, i]] for i in range(3))
        normal = np.cross(b - a, c - a)
        length = np.linalg.norm(normal, axis=1)
        self._normal = normal / np.maximum(length, 1e-30)[:, None]
        self._level = np.sum(self._normal * a, axis=1)

    def cast(
        self,
        origin: FloatArray,
        direction: FloatArray,
        max_range_m: float,
        i_pass: int,
        rng: np.random.Generator,
    ) -> tuple[AnyArray, AnyArray, FloatArray]:
        """Return the beams that came back, the triangles they met and the ranges.

        A beam goes through leaves, wire mesh and glass by chance, and through cars of other passes always.
        """
        mesh = self._scene.mesh
        share, see_through = RETURN_SHARE[mesh.material], SEE_THROUGH[mesh.material]
        alive = np.arange(len(origin))
        passed = np.zeros(len(origin))
        found: list[tuple[AnyArray, AnyArray, FloatArray]] = []
        for _ in range(_MAX_LAYERS):
            o, d = origin[alive] + direction[alive] * passed[alive, None], direction[alive]
            reach = (max_range_m - passed[alive]).astype(np.float32)
            triangle = self._embree.run(o.astype(np.float32), d.astype(np.float32), dists=reach)
            hit = triangle >= 0
            alive, triangle, o, d = alive[hit], triangle[hit], o[hit], d[hit]
            t = passed[alive] + self._exact_range(o, d, triangle)
            ghost = (mesh.only_pass[triangle] >= 0) & (mesh.only_pass[triangle] != i_pass)
            returned = ~ghost & (rng.random(len(alive)) < share[triangle])
            found.append((alive[returned], triangle[returned], t[returned]))
            onward = (ghost | see_through[triangle]) & ~returned
            passed[alive] = t + 0.002
            alive = alive[onward]
            if len(alive) == 0:
                break
        rays, triangles, ranges = (np.concatenate([f[i] for f in found]) for i in range(3))
        order = np.argsort(rays, kind="stable")
        return rays[order], triangles[order], ranges[order]

    def _exact_range(self, origin: FloatArray, direction: FloatArray, triangle: AnyArray) -> FloatArray:
        """Return where a ray meets the triangle's plane; float32 alone is off by up to a millimetre."""
        normal = self._normal[triangle]
        slope = np.sum(normal * direction, axis=1)
        slope = np.where(np.abs(slope) < 1e-6, 1e-6, slope)
        return np.asarray((self._level[triangle] - np.sum(normal * origin, axis=1)) / slope)

    def detail(
        self, xyz: FloatArray, direction: FloatArray, triangle: AnyArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the road place (chainage, offset) of hits and the cosine of incidence."""
        mesh = self._scene.mesh
        corner = mesh.triangles[triangle]
        a, b, c = (mesh.vertices[corner[:, i]] for i in range(3))
        normal = np.cross(b - a, c - a)
        area = np.maximum(np.sum(normal * normal, axis=1), 1e-30)
        u = np.sum(np.cross(xyz - a, c - a) * normal, axis=1) / area
        v = np.sum(np.cross(b - a, xyz - a) * normal, axis=1) / area
        pa, pb, pc = (mesh.chainage_offset[corner[:, i]] for i in range(3))
        place = pa + u[:, None] * (pb - pa) + v[:, None] * (pc - pa)
        cosine = np.abs(np.sum(direction * self._normal[triangle], axis=1))
        return place, cosine


def scan(
    caster: Caster, drive: Drive, scanner: Scanner, max_range_m: float, i_pass: int, rng: np.random.Generator
) -> Iterator[Hits]:
    """Yield the hits of one scanner in one pass, batch after batch in time order."""
    n_directions = _FINER * int(scanner.rays_per_turn)
    profile = _profile(scanner, n_directions)
    outside = ~_meets_van(np.asarray(scanner.position_m), profile)
    rate = scanner.turns_per_s * scanner.rays_per_turn
    n = int((drive.time_s[-1] - drive.time_s[0]) * rate)
    for first in range(0, n, _BATCH):
        k = np.arange(first, min(first + _BATCH, n))
        turn = (np.mod(k / scanner.rays_per_turn, 1.0) * n_directions).astype(np.int64)
        k, turn = k[outside[turn]], turn[outside[turn]]
        time = drive.time_s[0] + k / rate
        origin, direction = _cast_off(drive, scanner, time, profile[turn])
        ray, triangle, reach = caster.cast(origin, direction, max_range_m, i_pass, rng)
        origin, direction, time = origin[ray], direction[ray], time[ray]
        place, cosine = caster.detail(origin + direction * reach[:, None], direction, triangle)
        error = np.stack([np.interp(time, drive.time_s, e) for e in drive.error_m.T], axis=1)
        yield Hits(time, origin, direction, reach, triangle, place, cosine, error)


def _profile(scanner: Scanner, n: int) -> FloatArray:
    """Return (n, 3) directions evenly around one turn of the mirror, vehicle frame."""
    yaw, pitch = np.radians(scanner.yaw_deg), np.radians(scanner.pitch_deg)
    # The profile's plane: across the scanner's axis (x turned by yaw, lowered by pitch, so that the
    # beams that go down go backwards, clear of the van)
    side = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    up = np.array([np.cos(yaw) * np.sin(pitch), np.sin(yaw) * np.sin(pitch), np.cos(pitch)])
    turn = 2.0 * np.pi * np.arange(n) / n
    return np.asarray(np.cos(turn)[:, None] * up + np.sin(turn)[:, None] * side)


def _cast_off(
    drive: Drive, scanner: Scanner, time: FloatArray, beam: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return origins and directions of vehicle-frame beams in the local frame."""
    columns = (drive.roll_rad, drive.pitch_rad, drive.yaw_rad)
    roll, nose, head = (np.interp(time, drive.time_s, c) for c in columns)
    where = np.stack([np.interp(time, drive.time_s, c) for c in drive.xyz.T], axis=1)
    mount = np.broadcast_to(np.asarray(scanner.position_m), beam.shape)
    return where + to_local_frame(mount, roll, nose, head), to_local_frame(beam, roll, nose, head)


def to_local_frame(xyz: FloatArray, roll: FloatArray, pitch: FloatArray, yaw: FloatArray) -> FloatArray:
    """Return vehicle-frame vectors in the local frame: Rz(yaw) Ry(-pitch) Rx(roll).

    >>> nose_up = to_local_frame(np.array([[1.0, 0, 0]]), np.zeros(1), np.array([0.1]), np.zeros(1))
    >>> bool(nose_up[0, 2] > 0)
    True
    """
    x, y, z = xyz[:, 0], xyz[:, 1], xyz[:, 2]
    cos, sin = np.cos(roll), np.sin(roll)
    y, z = cos * y - sin * z, sin * y + cos * z
    cos, sin = np.cos(pitch), np.sin(pitch)
    x, z = cos * x - sin * z, sin * x + cos * z
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1)


def _meets_van(origin: FloatArray, beam: FloatArray) -> BoolArray:
    """Return which beams pass through the van's body (slab test in the vehicle frame)."""
    safe = np.where(np.abs(beam) < 1e-12, 1e-12, beam)
    near, far = (_VAN[0] - origin) / safe, (_VAN[1] - origin) / safe
    enter = np.max(np.minimum(near, far), axis=1)
    leave = np.min(np.maximum(near, far), axis=1)
    return np.asarray((leave > np.maximum(enter, 0.0)), dtype=np.bool_)


# What the scanners record of their hits: noisy positions and intensities, and stray points


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


def record_points(scenario: Scenario, scene: Scene, hits: Hits, rng: np.random.Generator) -> Points:
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
    return Points(xyz + np.asarray(scenario.origin_m), intensity=intensity, time_s=hits.time_s)


def _intensity(scenario: Scenario, hits: Hits, material: AnyArray, rng: np.random.Generator) -> AnyArray:
    sensor = scenario.sensor
    strength = _reflectance(scenario, hits, material)
    strength *= (hits.range_m / 10.0) ** -sensor.range_power * hits.cos_incidence**sensor.incidence_power
    strength *= _drift(sensor, hits.time_s)
    strength *= np.maximum(1.0 + 0.07 * rng.normal(size=len(hits)), 0.1)
    return np.floor(np.clip(strength * sensor.gain, 0.0, 2**sensor.intensity_bits - 1)).astype(np.float32)


def _reflectance(scenario: Scenario, hits: Hits, material: AnyArray) -> FloatArray:
    reflectance = LASER_REFLECTANCE[material].copy()
    on_ground = GROUND[material]
    place = hits.chainage_offset[on_ground]
    # Texture: stones and stains; patches of other asphalt along the road
    fine = smooth_noise(place[:, 0] / 0.3, place[:, 1] / 0.3, scenario.seed + 101)
    patch = smooth_noise(place[:, 0] / 12.0, place[:, 1] / 2.5, scenario.seed + 102)
    texture = 1.0 + 0.2 * (fine - 0.5) + 0.3 * (patch - 0.5)
    reflectance[on_ground] *= texture
    if scenario.layout.stains:
        reflectance[on_ground] *= stain_shade(place, scenario.layout.stains)
    on_asphalt = np.flatnonzero(material == Material.ASPHALT)
    layout = scenario.layout
    cover = paint_cover(hits.chainage_offset[on_asphalt], layout.markings, scenario.seed, layout.symbols)
    paint = LASER_REFLECTANCE[Material.ASPHALT] * scenario.sensor.contrast
    reflectance[on_asphalt] += cover * (paint - reflectance[on_asphalt])
    return reflectance


def _drift(sensor: Sensor, time_s: FloatArray) -> FloatArray:
    """Return the slow change of the receiver: `drift` from trough to crest."""
    return np.asarray(1.0 + 0.5 * sensor.drift * np.sin(2.0 * np.pi * time_s / sensor.drift_period_s))
