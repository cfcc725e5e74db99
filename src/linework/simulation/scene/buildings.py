"""Walls, facades with windows, bridges.

Separate from `scene`, which puts a world together: these objects only hide others and have no truth lines.
"""

from __future__ import annotations

import itertools

import numpy as np

from linework.arrays import FloatArray
from linework.simulation.roads.road import Road
from linework.simulation.roads.scenario import Bridge, Car, Gantry, Hedge, House, Plant, Tunnel, Wall
from linework.simulation.scene.materials import Material
from linework.simulation.scene.meshes import Mesh, boxes, columns, flakes, joined_meshes, prism, sheet
from linework.simulation.scene.part import Part

_WALL_THICK_M = 0.25


def wall(road: Road, spec: Wall) -> Part:
    """Return a wall (face, top, back) or a facade with rows of windows set 12 cm back."""
    s = road.stations_between(spec.start_m, spec.end_m)
    outward = np.sign(spec.q_m)
    base = road.ground_height(s, spec.q_m) - 0.1
    if not spec.is_facade:
        out = outward * np.array([0.0, 0.0, _WALL_THICK_M, _WALL_THICK_M])
        # A wall's top is level in steps of its own length: here it follows the ground
        up = np.array([0.0, spec.height_m + 0.1, spec.height_m + 0.1, 0.0])
        points = road.place(s[:, None], spec.q_m + out[None], base[:, None] + up[None])
        return Part((sheet(points, Material.WALL),))
    level = float(base.min())
    meshes = []
    edges = np.arange(spec.start_m, spec.end_m + 1e-6, 1.4)
    for i, (a, b) in enumerate(itertools.pairwise(edges)):
        is_bay = i % 2 == 1
        rows = np.unique(np.concatenate([[0.0, spec.height_m], np.arange(1.0, spec.height_m, 1.5)]))
        for j, (low, high) in enumerate(itertools.pairwise(rows)):
            is_window = is_bay and j % 2 == 1
            q = spec.q_m + outward * (0.12 if is_window else 0.0)
            corner = road.place(np.array([[a, a], [b, b]]), q, np.array([[level + low, level + high]] * 2))
            meshes.append(sheet(corner, Material.GLASS if is_window else Material.WALL))
    return Part(tuple(meshes))


def bridge(road: Road, spec: Bridge) -> Part:
    """Return a bridge's deck over the road and its columns."""
    reach = max(road.left.width_m, road.right.width_m) + 14.0
    half = 0.5 * spec.width_m
    s = spec.s_m + np.array([-half, half, half, -half])
    q = np.array([reach, reach, -reach, -reach])
    across = np.linspace(-road.right.width_m, road.left.width_m, 9)
    top_of_road = float(np.max(road.carriageway_height(spec.s_m + np.array([[-half], [half]]), across)))
    low = road.place(s, q, top_of_road + spec.clearance_m)
    deck = prism(low, low + np.array([0.0, 0.0, 1.2]), Material.CONCRETE)
    feet = np.concatenate(
        [
            road.on_ground(
                np.array([spec.s_m - 0.3 * half, spec.s_m + 0.3 * half]),
                sign * (road.side(sign).width_m + 3.0),
            )
            for sign in (1, -1)
        ]
    )
    return Part((deck, columns(feet, spec.clearance_m + 1.0, 0.45, Material.CONCRETE)))


#: Thickness of the deck of a road bridge, and of the lining of a tunnel with the earth on it. [m]
_DECK_M, _LINING_M = 1.0, 2.0


def deck(road: Road) -> Part:
    """Return what carries a road over another: the underside of a deck as wide as road and footways, and its edges."""
    s = road.stations_m
    out = np.array([-1.0, -1.0, 1.0, 1.0])
    edge = np.where(out < 0.0, road.right.width_m + road.right.reach_m, road.left.width_m + road.left.reach_m)
    q = np.broadcast_to(out * edge, (len(s), 4))
    along = np.broadcast_to(s[:, None], q.shape)
    down = np.array([0.0, _DECK_M, _DECK_M, 0.0])
    return Part((sheet(road.place(along, q, road.ground_height(along, q) - down), Material.CONCRETE),))


def tunnel(road: Road, spec: Tunnel) -> Part:
    """Return walls and vault of a tunnel, its portals, and the land on top of it."""
    s = road.stations_between(spec.start_m, spec.end_m)
    middle, half = 0.5 * (spec.left_m + spec.right_m), 0.5 * (spec.left_m - spec.right_m)
    turn = np.linspace(0.0, np.pi, 13)
    q = middle + half * np.concatenate([[1.0], np.cos(turn), [-1.0]])
    up = np.concatenate([[-0.1], spec.wall_m + spec.rise_m * np.sin(turn), [-0.1]])
    level = road.alignment.height(s)[:, None]
    tube = road.place(s[:, None], q[None], level + up[None])
    # The land on top reaches as far as that beside the road; a portal is the wall between both
    wide = (road.left.width_m + road.left.reach_m, -road.right.width_m - road.right.reach_m)
    top = level + spec.wall_m + spec.rise_m + _LINING_M
    # Down to the land beside it at its edges
    q_top = np.concatenate([wide[:1], np.linspace(wide[0], wide[1], 13), wide[1:]])
    down = np.concatenate([[1.0], np.zeros(13), [1.0]]) * (top - level)
    q_top = np.broadcast_to(q_top, (len(s), len(q_top)))
    place = np.stack([np.broadcast_to(s[:, None], q_top.shape), q_top], axis=-1).reshape(-1, 2)
    land = sheet(road.place(s[:, None], q_top, top - down), Material.GRASS).on_road(place)
    meshes = [sheet(tube, Material.CONCRETE), land]
    for at, arch in ((s[0], up), (s[-1], up)):
        base = float(road.alignment.height(at))
        outline = np.concatenate([[wide[0]], q, [wide[1]]])
        low = base + np.concatenate([[-0.1], arch, [-0.1]])
        high = np.full(len(low), base + spec.wall_m + spec.rise_m + _LINING_M)
        rows = road.place(at, np.stack([outline, outline], axis=1), np.stack([low, high], axis=1))
        meshes.append(sheet(rows, Material.CONCRETE))
    return Part(tuple(meshes))


def gantry(road: Road, spec: Gantry) -> Part:
    """Return a sign gantry: two columns, four thin straight chords across the road, a panel on them."""
    across = np.linspace(spec.right_m, spec.left_m, 9)
    level = float(np.max(road.carriageway_height(spec.s_m, across))) + spec.clearance_m
    middle, span = 0.5 * (spec.right_m + spec.left_m), spec.left_m - spec.right_m
    heading = np.full(1, float(road.alignment.heading(spec.s_m)))
    chords = [
        boxes(
            road.place(spec.s_m + ahead, middle, level + up)[None],
            heading,
            (0.12, span, 0.12),
            Material.STEEL,
        )
        for ahead in (-0.4, 0.4)
        for up in (0.0, 0.9)
    ]
    feet = road.on_ground(spec.s_m, np.array([spec.right_m, spec.left_m]))
    posts = columns(feet, level + 1.1 - feet[:, 2], 0.25, Material.STEEL)
    panel = road.place(spec.s_m - 0.6, spec.right_m + 0.3 * span, level - 0.2)[None]
    return Part((*chords, posts, boxes(panel, heading, (0.05, 3.5, 2.2), Material.SIGN)))


# Hedges, bushes and trees: many small leaves in a bumpy hull, so that no part of them is flat

#: Leaf size, and leaves per square metre of hull: together with the core they hide most of what is behind.
_LEAF_M, _LEAVES_PER_M2 = 0.11, 200.0


def hedge(road: Road, spec: Hedge, rng: np.random.Generator) -> Part:
    """Return a hedge: leaves around a solid core; height and width swell and shrink along it."""
    length = spec.end_m - spec.start_m
    around = 2.0 * spec.height_m + spec.width_m
    n = int(length * around * _LEAVES_PER_M2)
    s = rng.uniform(spec.start_m, spec.end_m, n)
    u = rng.uniform(0.0, around, n)
    swell = _bumps(s, rng)
    height, width = spec.height_m * (1.0 + 0.10 * swell), spec.width_m * (1.0 + 0.12 * _bumps(s, rng))
    depth = rng.exponential(0.06, n)
    # Once around the hull: up the road side, over the top, down the far side
    up = np.where(
        u < spec.height_m,
        u / spec.height_m,
        np.where(u > around - spec.height_m, (around - u) / spec.height_m, 1.0),
    )
    out = np.clip((u - spec.height_m) / spec.width_m, 0.0, 1.0) - 0.5
    on_top = (u >= spec.height_m) & (u <= around - spec.height_m)
    q = spec.q_m + out * width - np.where(on_top, 0.0, np.sign(out) * np.minimum(depth, 0.4 * width))
    z = up * height - np.where(on_top, np.minimum(depth, 0.4 * height), 0.0)
    leaves = flakes(road.on_ground(s, q, z), _LEAF_M * rng.uniform(0.6, 1.3, n), Material.LEAF, rng)
    at = road.stations_between(spec.start_m, spec.end_m)
    half = 0.5 * spec.width_m - 0.16
    if half < 0.05:
        return Part((leaves,))
    base = road.ground_height(at, spec.q_m)
    out_core, up_core = np.array([-half, -half, half, half]), np.array([0.0, 1.0, 1.0, 0.0])
    rise = (
        base[:, None] + up_core[None] * (0.9 * spec.height_m - 0.16) * (1.0 + 0.1 * _bumps(at, rng))[:, None]
    )
    core = sheet(road.place(at[:, None], spec.q_m + out_core[None], rise), Material.LEAF)
    return Part((leaves, core))


def _bumps(s: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return a smooth value of about -1 to 1 along the road: three waves of random length and phase."""
    wave, phase = rng.uniform(0.7, 4.0, 3), rng.uniform(0.0, 2.0 * np.pi, 3)
    return np.asarray(np.mean(np.sin(2.0 * np.pi * s[:, None] / wave + phase), axis=1) * 1.5)


def plant(road: Road, spec: Plant, rng: np.random.Generator) -> Part:
    """Return a bush on the ground, or a tree: a crown of leaves over a trunk."""
    leaf = _LEAF_M if spec.trunk_m == 0.0 else 0.3
    crown = spec.height_m - spec.trunk_m
    area = 4.0 * np.pi * spec.radius_m * max(spec.radius_m, 0.5 * crown)
    n = int(area * (_LEAVES_PER_M2 if spec.trunk_m == 0.0 else 40.0))
    d = rng.normal(size=(n, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    d *= rng.uniform(0.3, 1.0, (n, 1)) ** (1.0 / 4.0)
    lumps = 1.0 + 0.15 * np.sin(5.0 * d[:, 0] + rng.uniform(0, 6)) * np.sin(4.0 * d[:, 1] + rng.uniform(0, 6))
    foot = road.on_ground(spec.s_m, spec.q_m)
    shape = np.array([spec.radius_m, spec.radius_m, 0.5 * crown])
    middle = foot + np.array([0.0, 0.0, spec.trunk_m + 0.5 * crown])
    leaves = flakes(middle + d * lumps[:, None] * shape, leaf * rng.uniform(0.6, 1.3, n), Material.LEAF, rng)
    if spec.trunk_m == 0.0:
        return Part((leaves,))
    trunk = columns(
        foot[None] - np.array([0.0, 0.0, 0.1]),
        spec.trunk_m + 0.5 * crown,
        0.06 * spec.radius_m + 0.05,
        Material.WOOD,
    )
    return Part((leaves, trunk))


def house(road: Road, spec: House) -> Part:
    """Return walls and a roof that hangs over them by 0.4 m."""
    foot = road.on_ground(spec.s_m, spec.q_m)
    heading = float(road.alignment.heading(spec.s_m))
    u = np.array([np.cos(heading), np.sin(heading), 0.0])
    v = np.array([-u[1], u[0], 0.0])
    middle = foot - np.array([0.0, 0.0, 0.5])
    size = (spec.length_m, spec.width_m, spec.eaves_m + 0.5)
    walls = boxes(middle[None], np.array([heading]), size, Material.WALL)
    half = 0.5 * spec.width_m + 0.4
    across = np.array([-half, half]) if spec.is_shed else np.array([-half, 0.0, half])
    rise = spec.rise_m * np.array([0.0, 1.0] if spec.is_shed else [0.0, 1.0, 0.0])
    along = (0.5 * spec.length_m + 0.4) * np.array([-1.0, 1.0])
    up = np.array([0.0, 0.0, 1.0])
    points = (
        foot
        + along[:, None, None] * u
        + across[None, :, None] * v
        + (spec.eaves_m + 0.05 + rise)[None, :, None] * up
    )
    return Part((walls, sheet(points, Material.CONCRETE)))


# Cars and lorries: a body with bonnet, cabin and windows over wheels, open underneath


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
    mesh = joined_meshes(bodies)
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
    return joined_meshes([glass, roof])


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
