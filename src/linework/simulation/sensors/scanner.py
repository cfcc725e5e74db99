"""Laser scanners: every beam is a ray cast against the scene, so what hides things is real."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray
from linework.errors import extra_needed
from linework.simulation.scene.materials import RETURN_SHARE, SEE_THROUGH
from linework.simulation.scene.part import Scene
from linework.simulation.sensors.drive import Drive
from linework.simulation.sensors.heads import BODIES, Head

#: Beams at a time: what the arrays of a batch need stays under 100 MB.
_BATCH = 200_000
#: How often a beam may go on through leaves, mesh and glass.
_MAX_LAYERS = 4
#: Share of the returns from leaves and wires behind which enough light of a wide beam goes on for another return.
_GOES_ON = 0.6
#: Returns of one pulse that are closer than this melt into one: half the length of a pulse of 5 ns. [m]
_PULSE_M = 0.75


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
    sweep
        (n,) int32: scan line, counted through the survey.
    beam
        (n,) int32: laser, counted through the heads.
    strip
        (n,) int32: pass, flight strip or station.
    angle_deg
        (n,) float32: scan angle.
    is_edge, is_forward
        (n,) bool, as in `Pulses`.
    return_number, n_returns
        (n,) uint8: which return of its pulse, from 1, of how many.
    false_range_m
        (n,) float64: range of a mirrored return or a drop, recorded instead; else NaN.
    """

    time_s: FloatArray
    origin: FloatArray
    direction: FloatArray
    range_m: FloatArray
    triangle: AnyArray
    chainage_offset: FloatArray
    cos_incidence: FloatArray
    error_m: FloatArray
    sweep: AnyArray
    beam: AnyArray
    strip: AnyArray
    angle_deg: Float32Array
    is_edge: BoolArray
    is_forward: BoolArray
    return_number: AnyArray
    n_returns: AnyArray
    false_range_m: FloatArray

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
        self._box = mesh.vertices.min(axis=0) - 1.0, mesh.vertices.max(axis=0) + 1.0

    def cast(
        self,
        origin: FloatArray,
        direction: FloatArray,
        max_range_m: float,
        i_pass: int,
        rng: np.random.Generator,
        max_returns: int = 1,
    ) -> tuple[AnyArray, AnyArray, FloatArray]:
        """Return the beams that came back, the triangles they met and the ranges.

        A beam goes through leaves, wire mesh and glass by chance, and through cars of other passes always. With
        several returns, a part of the beam goes on behind a return from leaves, mesh, glass and wires.
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
            if max_returns > 1:
                thin = see_through[triangle] | (mesh.wire[triangle] >= 0)
                onward |= returned & thin & (rng.random(len(alive)) < _GOES_ON)
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

    def mirrored(self, direction: FloatArray, triangle: AnyArray) -> FloatArray:
        """Return the directions of beams after the triangles mirror them."""
        normal = self._normal[triangle]
        return np.asarray(direction - 2.0 * np.sum(direction * normal, axis=1)[:, None] * normal)

    def may_meet(self, origin: FloatArray, direction: FloatArray) -> BoolArray:
        """Return which beams pass through the box around the scene: most of a swath lies beside it."""
        return _through_box(origin, direction, *self._box)

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
    caster: Caster,
    carrier: Drive,
    head: Head,
    max_range_m: float,
    strip: int,
    rng: np.random.Generator,
    *,
    first_sweep: int = 0,
    first_beam: int = 0,
) -> Iterator[Hits]:
    """Yield the hits of one head in one pass, batch after batch in time order.

    Parameters
    ----------
    strip
        Number of the pass.
    first_sweep, first_beam
        Numbers of its first scan line and its first beam in the survey.
    """
    for first in range(0, pulses_of(carrier, head), _BATCH):
        k = np.arange(first, min(first + _BATCH, pulses_of(carrier, head)))
        pulses = head.pulses(k)
        if head.body:
            clear = ~_meets_body(np.asarray(head.position_m), pulses.direction, head.body)
            k, pulses = k[clear], pulses.take(clear)
        time = carrier.time_s[0] + k / head.pulses_per_s
        origin, direction = _cast_off(carrier, head, time, pulses.direction)
        if head.divergence_rad:
            towards = caster.may_meet(origin, direction)
            origin, direction, time, pulses = (
                origin[towards],
                direction[towards],
                time[towards],
                pulses.take(towards),
            )
        ray, triangle, reach = caster.cast(
            origin, _within_footprint(direction, head, rng), max_range_m, strip, rng, head.max_returns
        )
        number, count = np.ones(len(ray), dtype=np.uint8), np.ones(len(ray), dtype=np.uint8)
        if head.max_returns > 1:
            kept, number, count = _returns(ray, reach, head.max_returns)
            ray, triangle, reach = ray[kept], triangle[kept], reach[kept]
        origin, direction, time, pulses = origin[ray], direction[ray], time[ray], pulses.take(ray)
        place, cosine = caster.detail(origin + direction * reach[:, None], direction, triangle)
        error = np.stack([np.interp(time, carrier.time_s, e) for e in carrier.error_m.T], axis=1)
        yield Hits(
            time, origin, direction, reach, triangle, place, cosine, error,
            sweep=(first_sweep + pulses.sweep).astype(np.int32),
            beam=(first_beam + pulses.beam).astype(np.int32),
            strip=np.full(len(ray), strip, dtype=np.int32),
            angle_deg=pulses.angle_deg,
            is_edge=pulses.is_edge,
            is_forward=pulses.is_forward,
            return_number=number,
            n_returns=count,
            false_range_m=np.full(len(ray), np.nan),
        )  # fmt: skip


def pulses_of(carrier: Drive, head: Head) -> int:
    """Return how many pulses a head sends in one pass."""
    return int((carrier.time_s[-1] - carrier.time_s[0]) * head.pulses_per_s)


def _within_footprint(direction: FloatArray, head: Head, rng: np.random.Generator) -> FloatArray:
    """Return where in its footprint each beam meets things first: anywhere within the cone of a wide beam."""
    if head.divergence_rad == 0.0:
        return direction
    # Evenly over the disk; beams do not look along x or y only, so that neither product is zero everywhere
    radius = 0.5 * head.divergence_rad * np.sqrt(rng.random(len(direction)))
    around = 2.0 * np.pi * rng.random(len(direction))
    least = np.argmin(np.abs(direction), axis=1)
    side = np.cross(direction, np.eye(3)[least])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(direction, side)
    aim = direction + radius[:, None] * (np.cos(around)[:, None] * side + np.sin(around)[:, None] * other)
    return np.asarray(aim / np.linalg.norm(aim, axis=1, keepdims=True))


def _returns(ray: AnyArray, reach: FloatArray, most: int) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Return which hits become returns of their own, their numbers within the pulse, and how many it has.

    Parameters
    ----------
    ray, reach
        (n,) pulse of each hit, ascending, and its range [m], ascending within a pulse.
    """
    close = np.zeros(len(ray), dtype=np.bool_)
    close[1:] = (ray[1:] == ray[:-1]) & (reach[1:] - reach[:-1] < _PULSE_M)
    kept = np.flatnonzero(~close)
    _, first, count = np.unique(ray[kept], return_index=True, return_counts=True)
    number = np.arange(len(kept)) - np.repeat(first, count) + 1
    recorded = number <= most
    total = np.minimum(np.repeat(count, count), most)
    return kept[recorded], number[recorded].astype(np.uint8), total[recorded].astype(np.uint8)


def _cast_off(drive: Drive, head: Head, time: FloatArray, beam: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return origins and directions of vehicle-frame beams in the local frame."""
    columns = (drive.roll_rad, drive.pitch_rad, drive.yaw_rad)
    roll, nose, yaw = (np.interp(time, drive.time_s, c) for c in columns)
    where = np.stack([np.interp(time, drive.time_s, c) for c in drive.xyz.T], axis=1)
    mount = np.broadcast_to(np.asarray(head.position_m), beam.shape)
    return where + to_local_frame(mount, roll, nose, yaw), to_local_frame(beam, roll, nose, yaw)


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


def _meets_body(origin: FloatArray, beam: FloatArray, body: str) -> BoolArray:
    """Return which beams pass through the vehicle's body (slab test in the vehicle frame)."""
    return _through_box(origin, beam, *np.asarray(BODIES[body]))


def _through_box(origin: FloatArray, beam: FloatArray, low: FloatArray, high: FloatArray) -> BoolArray:
    safe = np.where(np.abs(beam) < 1e-12, 1e-12, beam)
    near, far = (low - origin) / safe, (high - origin) / safe
    enter = np.max(np.minimum(near, far), axis=1)
    leave = np.min(np.maximum(near, far), axis=1)
    return np.asarray((leave > np.maximum(enter, 0.0)), dtype=np.bool_)


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
    return replace(hits, range_m=reach)
