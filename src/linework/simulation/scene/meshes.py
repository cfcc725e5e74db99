"""Triangle meshes and the few shapes everything is made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import AnyArray, FloatArray, offsets_of
from linework.simulation.scene.materials import Material


@dataclass(frozen=True, slots=True)
class Mesh:
    """Triangles in the local frame.

    Parameters
    ----------
    vertices
        (n, 3) float64 [m, local].
    triangles
        (k, 3) int32: vertex indices.
    material
        (k,) uint8: `Material` of each triangle.
    target
        (k,) int32: the truth line that hits on the triangle support, or -1.
    wire
        (k,) int32: the wire segment the triangle belongs to, or -1.
    only_pass
        (k,) int8: the pass in which the triangle exists (a passing car), or -1 for all.
    chainage_offset
        (n, 2) float64 [m]: place of ground vertices on the road; NaN elsewhere.
    """

    vertices: FloatArray
    triangles: AnyArray
    material: AnyArray
    target: AnyArray
    wire: AnyArray
    only_pass: AnyArray
    chainage_offset: FloatArray

    @classmethod
    def of(
        cls, vertices: FloatArray, triangles: AnyArray, material: AnyArray | Material, target: int = -1
    ) -> Mesh:
        """Build a mesh of one target; one material, or one per triangle."""
        k = len(triangles)
        return cls(
            vertices=np.asarray(vertices, dtype=np.float64),
            triangles=np.asarray(triangles, dtype=np.int32),
            material=np.broadcast_to(np.asarray(material, dtype=np.uint8), (k,)),
            target=np.full(k, target, dtype=np.int32),
            wire=np.full(k, -1, dtype=np.int32),
            only_pass=np.full(k, -1, dtype=np.int8),
            chainage_offset=np.full((len(vertices), 2), np.nan),
        )

    def on_road(self, chainage_offset: FloatArray) -> Mesh:
        """Return the mesh with the road place of its vertices."""
        return replace(self, chainage_offset=chainage_offset)

    def of_wire(self, segment: AnyArray) -> Mesh:
        """Return the mesh with the wire segment of each triangle."""
        return replace(self, wire=np.asarray(segment, dtype=np.int32))

    def in_pass(self, i_pass: int) -> Mesh:
        """Return the mesh as something that is there in one pass only (-1: in all)."""
        return replace(self, only_pass=np.full(len(self.triangles), i_pass, dtype=np.int8))


def joined_meshes(meshes: Iterable[Mesh]) -> Mesh:
    """Return one mesh of all."""
    kept = list(meshes)
    starts = offsets_of([len(m.vertices) for m in kept])
    return Mesh(
        vertices=np.concatenate([m.vertices for m in kept]),
        triangles=np.concatenate(
            [m.triangles + np.int32(start) for m, start in zip(kept, starts, strict=False)]
        ),
        material=np.concatenate([m.material for m in kept]),
        target=np.concatenate([m.target for m in kept]),
        wire=np.concatenate([m.wire for m in kept]),
        only_pass=np.concatenate([m.only_pass for m in kept]),
        chainage_offset=np.concatenate([m.chainage_offset for m in kept]),
    )


def sheet(points: FloatArray, material: AnyArray | Material, target: int = -1) -> Mesh:
    """Return the surface through a (rows, cols, 3) array of points, two triangles per cell.

    `material` may be one value, or one per column interval (cols - 1).
    """
    rows, cols = points.shape[:2]
    i = np.arange(rows - 1)[:, None] * cols + np.arange(cols - 1)[None, :]
    lower = np.stack([i, i + 1, i + cols], axis=-1)
    upper = np.stack([i + 1, i + cols + 1, i + cols], axis=-1)
    triangles = np.stack([lower, upper], axis=2).reshape(-1, 3)
    per_column = np.broadcast_to(np.asarray(material, dtype=np.uint8), (cols - 1,))
    per_cell = np.repeat(np.broadcast_to(per_column, (rows - 1, cols - 1)).ravel(), 2)
    return Mesh.of(points.reshape(-1, 3), triangles, per_cell, target)


def prism(
    base: FloatArray,
    top: FloatArray,
    material: AnyArray | Material,
    target: int = -1,
    *,
    open_ends: bool = False,
) -> Mesh:
    """Return the solid between two (n, 3) outlines of equally many corners (convex, in the same order)."""
    n = len(base)
    i, j = np.arange(n), (np.arange(n) + 1) % n
    walls = np.concatenate([np.stack([i, j, n + i], 1), np.stack([j, n + j, n + i], 1)])
    caps = np.stack([np.zeros(n - 2, dtype=np.int64), np.arange(1, n - 1), np.arange(2, n)], 1)
    triangles = walls if open_ends else np.concatenate([walls, caps, caps + n])
    return Mesh.of(np.concatenate([base, top]), triangles, material, target)


def boxes(
    centres: FloatArray,
    along: FloatArray,
    sizes: Sequence[float] | FloatArray,
    material: Material,
    target: int = -1,
) -> Mesh:
    """Return upright boxes.

    Parameters
    ----------
    centres
        (n, 3): middle of each box's foot.
    along
        (n,): direction of the length, anticlockwise from east. [rad]
    sizes
        Length, width, height; one for all or (n, 3). [m]
    """
    n = len(centres)
    size = np.broadcast_to(np.asarray(sizes, dtype=np.float64), (n, 3))
    corner = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    u = np.stack([np.cos(along), np.sin(along)], axis=1)
    v = np.stack([-u[:, 1], u[:, 0]], axis=1)
    plan = corner[None, :, :1] * (size[:, None, :1] * u[:, None]) + corner[None, :, 1:] * (
        size[:, None, 1:2] * v[:, None]
    )
    foot = centres[:, None, :] + np.concatenate([plan, np.zeros((n, 4, 1))], axis=2)
    top = foot + np.array([0.0, 0.0, 1.0]) * size[:, None, 2:]
    vertices = np.concatenate([foot, top], axis=1).reshape(-1, 3)
    faces = [[0, 1, 4], [1, 5, 4], [1, 2, 5], [2, 6, 5], [2, 3, 6], [3, 7, 6], [3, 0, 7], [0, 4, 7]]
    one = np.array([*faces, [4, 5, 6], [4, 6, 7], [0, 2, 1], [0, 3, 2]])
    triangles = (one[None] + 8 * np.arange(n)[:, None, None]).reshape(-1, 3)
    return Mesh.of(vertices, triangles, material, target)


def columns(
    feet: FloatArray, height_m: AnyArray | float, radius_m: float, material: Material, target: int = -1
) -> Mesh:
    """Return upright octagonal columns on (n, 3) feet."""
    turn = np.arange(8) * (np.pi / 4.0)
    ring = radius_m * np.stack([np.cos(turn), np.sin(turn), np.zeros(8)], axis=1)
    heights = np.broadcast_to(np.asarray(height_m, dtype=np.float64), (len(feet),))
    up = np.array([0.0, 0.0, 1.0])
    return joined_meshes(
        prism(foot + ring, foot + ring + h * up, material, target)
        for foot, h in zip(feet, heights, strict=True)
    )


def flakes(
    centres: FloatArray, size_m: AnyArray | float, material: Material, rng: np.random.Generator
) -> Mesh:
    """Return a small triangle of random attitude at each of (n, 3) places: leaves and twigs."""
    n = len(centres)
    a, b = rng.normal(size=(n, 3)), rng.normal(size=(n, 3))
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b -= a * np.sum(a * b, axis=1, keepdims=True)
    b /= np.linalg.norm(b, axis=1, keepdims=True)
    turn = np.array([0.0, 2.0943951, 4.1887902])
    size = np.broadcast_to(np.asarray(size_m, dtype=np.float64), (n,))[:, None, None]
    corner = np.cos(turn)[None, :, None] * a[:, None] + np.sin(turn)[None, :, None] * b[:, None]
    vertices = (centres[:, None, :] + 0.6 * size * corner).reshape(-1, 3)
    return Mesh.of(vertices, np.arange(3 * n).reshape(-1, 3), material)
