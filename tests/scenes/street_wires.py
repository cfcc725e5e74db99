"""Wires over a street as a mobile scanner sees them: dense, close together, or hung from each other."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray

#: Where the wires are, so that coordinates are as large as those of a map projection. [m]
EAST_M, NORTH_M = 500_000.0, 5_600_000.0


def hanging_wire(
    rng: np.random.Generator,
    begin: tuple[float, float, float],
    end: tuple[float, float, float],
    *,
    sag_m: float,
    noise_m: float = 0.01,
    per_m: float = 30.0,
) -> tuple[FloatArray, FloatArray]:
    """Return the points (n, 3) on a wire between two supports, and the wire itself (m, 3) every 2 cm [m, world]."""
    a, b = np.array(begin), np.array(end)
    length = float(np.linalg.norm(b - a))

    def place(t: FloatArray) -> FloatArray:
        hang = np.column_stack([np.zeros((len(t), 2)), -4.0 * sag_m * t * (1.0 - t)])
        return a + (b - a) * t[:, None] + hang + np.array([EAST_M, NORTH_M, 0.0])

    hit = place(rng.uniform(0.0, 1.0, rng.poisson(per_m * length)))
    return hit + rng.normal(0.0, noise_m, hit.shape), place(np.linspace(0.0, 1.0, round(50.0 * length)))


def contact_line(
    seed: int, *, noise_m: float = 0.01, with_messenger: bool = True
) -> tuple[FloatArray, list[FloatArray]]:
    """Return points (n, 3) and the wires of three spans of an overhead line: contact wire, droppers and messenger [m]."""
    rng = np.random.default_rng(seed)
    points, wires = [], []
    for k in range(3):
        near, far = 30.0 * k, 30.0 * (k + 1)
        contact = (near, 0.2 * (-1) ** k, 5.5), (far, -0.2 * (-1) ** k, 5.5)
        messenger = (near, 0.0, 6.7), (far, 0.0, 6.7)
        hung = [hanging_wire(rng, *contact, sag_m=0.01, noise_m=noise_m)]
        if with_messenger:
            hung.append(hanging_wire(rng, *messenger, sag_m=0.7, noise_m=noise_m))
        for at in np.linspace(0.1, 0.9, 6):
            top = 6.7 - 4.0 * 0.7 * at * (1.0 - at)
            dropper = np.column_stack(
                [np.full((12, 1), near + 30.0 * at), np.zeros((12, 1)), rng.uniform(5.5, top, (12, 1))]
            )
            points.append(dropper + rng.normal(0.0, noise_m, (12, 3)) + np.array([EAST_M, NORTH_M, 0.0]))
        points += [seen for seen, _ in hung]
        wires += [wire for _, wire in hung]
    return np.concatenate(points), wires
