"""The scene made ready for cameras: what a ray meets first, and whether the sun shines there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from linework.arrays import AnyArray, BoolArray, FloatArray
from linework.simulation.materials import Material
from linework.simulation.part import Scene
from linework.simulation.scenario import Scenario, Wall
from linework.simulation.scene import build_scene

#: Nothing is looked at beyond this. [m]
REACH_M = 400.0
#: Shadow rays start this far from where they were cast off, so that a surface does not shade itself. [m]
_CLEAR_M = 0.01
#: Windows are set back by a little less.
_REVEAL_M = 0.13


@dataclass(frozen=True, slots=True)
class Seen:
    """What n rays met.

    Parameters
    ----------
    triangle
        (n,) int: index into the scene's mesh, -1: nothing.
    depth
        (n,) float64: in units of the ray's direction.
    """

    triangle: AnyArray
    depth: FloatArray


class View:
    """The scene of one pass for cameras; vehicles have their own length again."""

    def __init__(self, scenario: Scenario, i_pass: int = 0) -> None:
        layout = scenario.layout
        cars = tuple(replace(c, stretch=1.0) for c in layout.cars if c.only_pass in (-1, i_pass))
        walls = (*layout.walls, *(_behind(w) for w in layout.walls if w.is_facade))
        self.scenario = replace(scenario, layout=replace(layout, cars=cars, walls=walls))
        self.scene: Scene = build_scene(self.scenario)
        mesh = self.scene.mesh
        self._all = _Rays(mesh.vertices, mesh.triangles)
        # Mesh of wire hardly shades, and hides by chance only
        self._solid_index = np.flatnonzero(mesh.material != Material.MESH)
        self._solid = _Rays(mesh.vertices, mesh.triangles[self._solid_index])
        a, b, c = (mesh.vertices[mesh.triangles[:, i]] for i in range(3))
        normal = np.cross(b - a, c - a)
        area = np.maximum(np.sum(normal * normal, axis=1), 1e-30)
        self.normal: FloatArray = normal / np.sqrt(area)[:, None]
        self._level = np.sum(self.normal * a, axis=1)
        # Chainage and offset of a place on a triangle: linear in it
        pa, pb, pc = (mesh.chainage_offset[mesh.triangles[:, i]] for i in range(3))
        along_b, along_c = (np.cross(e, f) / area[:, None] for e, f in ((c - a, normal), (normal, b - a)))
        self.place_slope: FloatArray = (pb - pa)[:, :, None] * along_b[:, None] + (pc - pa)[
            :, :, None
        ] * along_c[:, None]
        self._place_level = pa - np.einsum("kij,kj->ki", self.place_slope, a)

    def look(self, origin: FloatArray, direction: FloatArray, through_mesh: BoolArray) -> Seen:
        """Return what (n, 3) rays from one place meet; those of `through_mesh` pass wire mesh."""
        triangle = self._all.first(origin, direction)
        mesh = self.scene.mesh
        on = np.flatnonzero((triangle >= 0) & (mesh.material[triangle] == Material.MESH) & through_mesh)
        if len(on):
            behind = self._solid.first(origin, direction[on])
            triangle[on] = np.where(behind >= 0, self._solid_index[behind], -1)
        normal = self.normal[triangle]
        slope = np.sum(normal * direction, axis=1)
        slope = np.where(np.abs(slope) < 1e-9, 1e-9, slope)
        return Seen(triangle, (self._level[triangle] - normal @ origin) / slope)

    def place(self, triangle: AnyArray, xyz: FloatArray) -> FloatArray:
        """Return (n, 2) chainage and offset of places on ground triangles."""
        return np.asarray(
            np.einsum("kij,kj->ki", self.place_slope[triangle], xyz) + self._place_level[triangle]
        )

    def is_lit(self, xyz: FloatArray, normal: FloatArray, to_sun: FloatArray) -> BoolArray:
        """Return where the sun is not hidden; `normal` points to the side that is looked at."""
        faces = np.flatnonzero(normal @ to_sun > 0.0)
        lit = np.zeros(len(xyz), dtype=np.bool_)
        start = xyz[faces] + _CLEAR_M * (normal[faces] + to_sun)
        lit[faces] = self._solid.first(start, np.broadcast_to(to_sun, start.shape)) < 0
        return lit

    def is_hidden(self, origin: FloatArray, xyz: FloatArray) -> BoolArray:
        """Return which of (n, 3) places something hides from one place; wire mesh hides nothing."""
        return np.asarray(self._solid.first(origin, xyz - origin, 0.999) >= 0)


def _behind(facade: Wall) -> Wall:
    """Return what stands behind a facade, so that no sky shines through beside its windows."""
    q = facade.q_m + np.sign(facade.q_m) * _REVEAL_M
    return replace(facade, q_m=q, height_m=facade.height_m - 0.5, is_facade=False)


class _Rays:
    """Triangles ready for rays; near the origin single precision is good to 0.1 mm."""

    def __init__(self, vertices: FloatArray, triangles: AnyArray) -> None:
        self._embree = EmbreeScene()
        self._mesh = TriangleMesh(self._embree, vertices.astype(np.float32), triangles)

    def first(self, origin: FloatArray, direction: FloatArray, reach: float = REACH_M) -> AnyArray:
        """Return the index of the first triangle of each ray within `reach` of its lengths, or -1."""
        if len(direction) == 0:
            return np.zeros(0, dtype=np.int64)
        start = np.ascontiguousarray(np.broadcast_to(origin, direction.shape), dtype=np.float32)
        far = np.full(len(direction), reach, dtype=np.float32)
        return np.asarray(self._embree.run(start, direction.astype(np.float32), dists=far), dtype=np.int64)


def horizontal(normals: FloatArray) -> FloatArray:
    """Return the level direction along surfaces with these normals; east where they are level themselves."""
    along = np.stack([-normals[:, 1], normals[:, 0]], axis=1)
    length = np.linalg.norm(along, axis=1, keepdims=True)
    return np.asarray(np.where(length > 0.05, along / np.maximum(length, 1e-9), np.array([[1.0, 0.0]])))
