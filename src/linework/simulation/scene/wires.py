"""Cables between supports, and poles.

Separate from `scene`, which puts a world together: these hang between supports, or stand alone, and do not follow the
road.
"""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.model.lines import POLE
from linework.simulation.roads.road import Road
from linework.simulation.roads.scenario import Cable, Pole
from linework.simulation.scene.materials import Material
from linework.simulation.scene.meshes import Mesh, boxes, columns, joined_meshes
from linework.simulation.scene.part import Part, TruthLine


def catenary(a: FloatArray, b: FloatArray, sag_m: float, t: FloatArray) -> FloatArray:
    """Return (n, 3) points of a hanging wire at shares `t` of its plan span from `a` to `b`.

    The catenary constant is span^2 / (8 sag), which makes the sag below the chord right to about 0.1 % at
    the usual 1 to 3 % of the span; the curve itself is an exact catenary, also between unequal heights.
    """
    span = float(np.hypot(*(b - a)[:2]))
    c = span**2 / (8.0 * sag_m)
    lowest = 0.5 * span - c * np.arcsinh((b[2] - a[2]) / (2.0 * c * np.sinh(0.5 * span / c)))
    xyz = a + (b - a) * t[:, None]
    xyz[:, 2] = a[2] + c * (np.cosh((t * span - lowest) / c) - np.cosh(lowest / c))
    return np.asarray(xyz)


def cable(road: Road, spec: Cable) -> Part:
    """Return a wire as square prisms of the width in which beams still return; truth: its axis."""
    a = road.on_ground(spec.start[0], spec.start[1], spec.start[2])
    b = road.on_ground(spec.end[0], spec.end[1], spec.end[2])
    span = float(np.hypot(*(b - a)[:2]))
    nodes = catenary(a, b, spec.sag_m, np.linspace(0.0, 1.0, int(np.ceil(span)) + 1))
    n = len(nodes) - 1
    along = (b - a)[:2] / span
    # Corners above, below and to both sides: what a beam from below sees is the full width
    corner = np.array(
        [[0.0, 0.0, 1.0], [-along[1], along[0], 0.0], [0.0, 0.0, -1.0], [along[1], -along[0], 0.0]]
    )
    ring = nodes[:, None, :] + 0.5 * spec.seen_width_m * corner[None]
    i = 4 * np.arange(n)[:, None] + np.arange(4)[None]
    j = 4 * np.arange(n)[:, None] + (np.arange(4)[None] + 1) % 4
    triangles = np.stack([np.stack([i, j, i + 4], -1), np.stack([j, j + 4, i + 4], -1)], 2).reshape(-1, 3)
    mesh = Mesh.of(ring.reshape(-1, 3), triangles, Material.WIRE, target=0)
    mesh = mesh.of_wire(np.repeat(np.arange(n), 8))
    xyz = catenary(a, b, spec.sag_m, np.linspace(0.0, 1.0, int(np.ceil(span / 0.5)) + 1))
    clearance = float(np.min(xyz[:, 2] - road.ground_height(*road.alignment.locate(xyz[:, :2]))))
    line = TruthLine(
        kind="cable", xyz=xyz, width_m=spec.wire_m, clearance_m=clearance,
        network=spec.network, circuit=spec.circuit, span=spec.span,
    )  # fmt: skip
    return Part((mesh,), (line,), np.stack([nodes[:-1], nodes[1:]], axis=1), spec.wire_m)


def pole(road: Road, spec: Pole) -> Part:
    """Return a pole, with a lamp's arm or a sign where it has one; truth: the axis of one with wires, from foot to top."""
    foot = road.on_ground(spec.s_m, spec.q_m, -0.1)
    heading = float(road.alignment.heading(spec.s_m))
    inward = heading + (-np.pi / 2 if spec.q_m > 0 else np.pi / 2)
    target = 0 if spec.network else -1
    meshes = [columns(foot[None], spec.height_m + 0.1, spec.radius_m, Material.POLE, target)]
    top = foot + np.array([0.0, 0.0, spec.height_m])
    reach = np.array([np.cos(inward), np.sin(inward), 0.0])
    if spec.arm_m > 0.0:
        middle = top + 0.5 * spec.arm_m * reach
        meshes.append(boxes(middle[None], np.array([inward]), (spec.arm_m, 0.08, 0.08), Material.POLE))
        lamp = top + spec.arm_m * reach
        meshes.append(boxes(lamp[None], np.array([inward]), (0.6, 0.25, 0.12), Material.POLE))
    if spec.has_sign:
        plate = (
            top
            - np.array([0.0, 0.0, 0.7])
            + (spec.radius_m + 0.02) * np.array([np.cos(heading), np.sin(heading), 0.0])
        )
        meshes.append(boxes(plate[None], np.array([heading]), (0.02, 0.6, 0.6), Material.SIGN))
    lines: tuple[TruthLine, ...] = ()
    if spec.network:
        axis = road.on_ground(spec.s_m, spec.q_m, 0.0) + np.array(
            [[0.0, 0.0, 0.0], [0.0, 0.0, spec.height_m]]
        )
        lines = (TruthLine(kind=POLE, xyz=axis, form="pole", height_m=spec.height_m, network=spec.network),)
    return Part((joined_meshes(meshes),), lines)
