"""Conductors of a power line as an airborne scanner sees them: sparse, in bundles, scattered farther than a gate, blown aside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import Float32Array, FloatArray


@dataclass(frozen=True)
class AirborneWires:
    """Points of a span, (n, 3) [m, world], their heights above ground (n,) [m], and the true wires, each (m, 3) [m, world]."""

    xyz: FloatArray
    height_m: Float32Array
    wires: list[FloatArray]


def airborne_wires(
    seed: int,
    *,
    length_m: float = 250.0,
    apart_m: tuple[float, ...] = (0.0, 0.4),
    phases: int = 2,
    per_m: float = 2.5,
    across_m: float = 0.07,
    up_m: float = 0.04,
    bow_m: float = 0.2,
) -> AirborneWires:
    """Return one span of a line of `phases`, 6 m above one another, each of wires `apart_m` from the first [m].

    Parameters
    ----------
    per_m
        Points of each wire per metre.
    across_m, up_m
        Standard deviations of a point. [m]
    bow_m
        How far the wind has pushed the middle aside. [m]
    """
    rng = np.random.default_rng(seed)
    angle, east, north = rng.uniform(0.0, np.pi), 200_000.0, 570_000.0
    along, left = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    sag = rng.uniform(0.02, 0.035) * length_m
    points, wires = [], []
    for level in range(phases):
        for apart in apart_m:
            aside, higher = apart + rng.normal(0.0, 0.01), 18.0 + 6.0 * level + rng.normal(0.0, 0.02)

            def place(s: FloatArray, aside: float = aside, higher: float = higher) -> FloatArray:
                hang = 1.0 - (2.0 * s / length_m - 1.0) ** 2
                o = aside + bow_m * hang
                plan = s[:, None] * along + o[:, None] * left
                return np.column_stack([plan + np.array([east, north]), higher + sag * (1.0 - hang)])

            s = np.sort(rng.uniform(0.0, length_m, rng.poisson(per_m * length_m)))
            noise = rng.normal(0.0, 1.0, (len(s), 2)) * [across_m, up_m]
            hit = place(s)
            hit[:, :2] += noise[:, :1] * left
            hit[:, 2] += noise[:, 1]
            points.append(hit)
            wires.append(place(np.arange(0.0, length_m, 1.0)))
    xyz = np.concatenate(points)
    return AirborneWires(xyz, xyz[:, 2].astype(np.float32), wires)
