"""Hedges, bushes and trees: many small leaves in a bumpy hull, so that no part of them is flat."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.simulation.materials import Material
from linework.simulation.meshes import columns, flakes, sheet
from linework.simulation.part import Part
from linework.simulation.road import Road
from linework.simulation.scenario import Hedge, Plant

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
