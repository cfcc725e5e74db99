"""Profile scanners on the van: every beam is a ray cast against the scene, so what hides things is real."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from linework.arrays import AnyArray, BoolArray, FloatArray
from linework.simulation.drive import Drive
from linework.simulation.materials import RETURN_SHARE, SEE_THROUGH
from linework.simulation.part import Scene
from linework.simulation.scenario import Scanner

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
    return where + turned(mount, roll, nose, head), turned(beam, roll, nose, head)


def turned(xyz: FloatArray, roll: FloatArray, pitch: FloatArray, yaw: FloatArray) -> FloatArray:
    """Return vehicle-frame vectors in the local frame: Rz(yaw) Ry(-pitch) Rx(roll).

    >>> nose_up = turned(np.array([[1.0, 0, 0]]), np.zeros(1), np.array([0.1]), np.zeros(1))
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
