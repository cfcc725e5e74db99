"""Cars and lorries: a body with bonnet, cabin and windows over wheels, open underneath."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.simulation.materials import Material
from linework.simulation.meshes import Mesh, joined, prism
from linework.simulation.part import Part
from linework.simulation.road import Road
from linework.simulation.scenario import Car


def car(road: Road, spec: Car) -> Part:
    """Return a car or lorry standing on the road along its direction."""
    half, width, height = 0.5 * spec.length_m, spec.width_m, spec.height_m
    if spec.is_lorry:
        bodies = [
            _block(-half, half - 2.4, width, (0.9, height), Material.CAR),
            _block(half - 2.2, half, width, (0.4, 0.85 * height), Material.CAR),
        ]
        wheels = [-half + 0.9, -half + 2.2, half - 1.4]
        radius = 0.5
    else:
        waist = 0.58 * height
        bodies = [
            _block(-half, half, width, (0.20, waist), Material.CAR, round_m=0.18),
            _cabin(-0.40 * spec.length_m, 0.22 * spec.length_m, width, (waist, height)),
        ]
        wheels = [-0.31 * spec.length_m, 0.31 * spec.length_m]
        radius = 0.32
    bodies += [_wheel(x, side * (0.5 * width - 0.12), radius) for x in wheels for side in (-1, 1)]
    mesh = joined(bodies)
    heading = float(road.alignment.heading(spec.s_m)) + (np.pi if spec.heading < 0 else 0.0)
    x, y = mesh.vertices[:, 0] * spec.stretch, mesh.vertices[:, 1]
    foot = road.on_ground(spec.s_m, spec.q_m)
    # Tilted with the road's grade, so that wheels stand on it
    rise = float(road.alignment.grade(spec.s_m)) * (-1.0 if spec.heading < 0 else 1.0)
    placed = np.stack(
        [
            foot[0] + x * np.cos(heading) - y * np.sin(heading),
            foot[1] + x * np.sin(heading) + y * np.cos(heading),
            foot[2] + mesh.vertices[:, 2] + rise * x,
        ],
        axis=1,
    )
    whole = Mesh.of(placed, mesh.triangles, mesh.material)
    return Part((whole.in_pass(spec.only_pass),))


def _block(
    back: float,
    front: float,
    width: float,
    heights: tuple[float, float],
    material: Material,
    round_m: float = 0.0,
) -> Mesh:
    """Return a box whose corners in plan are cut off by `round_m`."""
    low, high = heights
    outline = _outline(back, front, 0.5 * width, round_m)
    return prism(_at(outline, low), _at(outline, high), material)


def _cabin(back: float, front: float, width: float, heights: tuple[float, float]) -> Mesh:
    """Return the cabin: windows all around that lean inwards, and a roof."""
    low, high = heights
    foot = _at(_outline(back, front, 0.5 * width, 0.1), low)
    shrunk = _outline(back + 0.25, front - 0.55, 0.5 * width - 0.16, 0.1)
    glass = prism(foot, _at(shrunk, high), Material.GLASS, open_ends=True)
    roof = prism(_at(shrunk, high - 0.04), _at(shrunk, high), Material.CAR)
    return joined([glass, roof])


def _outline(back: float, front: float, half: float, cut: float) -> FloatArray:
    if cut <= 0.0:
        return np.array([[back, -half], [front, -half], [front, half], [back, half]])
    return np.array(
        [
            [back, -half + cut], [back + cut, -half], [front - cut, -half], [front, -half + cut],
            [front, half - cut], [front - cut, half], [back + cut, half], [back, half - cut],
        ]
    )  # fmt: skip


def _at(outline: FloatArray, z: float) -> FloatArray:
    return np.column_stack([outline, np.full(len(outline), z)])


def _wheel(x: float, y: float, radius: float) -> Mesh:
    turn = np.arange(10) * (2.0 * np.pi / 10.0)
    ring = np.stack([x + radius * np.cos(turn), np.zeros(10), radius * (1.0 + np.sin(turn))], axis=1)
    return prism(ring + np.array([0.0, y - 0.11, 0.0]), ring + np.array([0.0, y + 0.11, 0.0]), Material.TYRE)
