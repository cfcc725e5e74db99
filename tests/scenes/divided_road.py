"""A road of two carriageways with a raised median, as a scanner on the roof of a van sees it: kerbs cast shadows."""

from __future__ import annotations

import numpy as np

from linework.model.points import Points
from linework.model.trajectory import Trajectory

#: Where kerbs stand across the road, from right to left [m]: the van drives at 0, the median lies between the second and
#: the third, and hides the foot of the third.
KERBS_M = (-2.1, 5.0, 8.6, 15.7)
KERB_M, SCANNER_M, LENGTH_M = 0.12, 2.4, 60.0
ORIGIN = np.array([500_000.0, 5_600_000.0, 100.0])
#: Random roughness of footways, carriageways and median, from right to left. [m]
ROUGHNESS_M = (0.02, 0.003, 0.02, 0.003, 0.02)


def profile_m(y: np.ndarray) -> np.ndarray:
    """Return the height of the road across, sloping by 2 % away from the median, at y [m]."""
    right, left = KERBS_M[1], KERBS_M[2]
    away = np.where(y < right, right - y, np.maximum(y - left, 0.0))
    on = np.searchsorted(KERBS_M, y) % 2 == 1
    return -0.02 * np.minimum(away, 7.1) + np.where(on, 0.0, KERB_M)


def divided_road(seed: int) -> Points:
    """Return the points of 100 profiles a second at 10 m/s, each turned by 45 degrees to one or the other side."""
    rng = np.random.default_rng(seed)
    y = np.arange(-14.0, 26.0, 0.01)
    parts = []
    for side in (-1.0, 1.0):
        # The first part of the road that each ray meets is in sight
        at = np.sort(y[side * y > 0.05] * side) * side
        horizon = np.maximum.accumulate(np.sqrt(2.0) * np.abs(at) / (SCANNER_M - profile_m(at)))
        for k, start in enumerate(np.arange(-25.0, LENGTH_M + 25.0, 0.1)):
            rays = np.tan(np.arange(rng.uniform(0.0, 0.0016), 1.5, 0.0016))
            hit = np.clip(np.searchsorted(horizon, rays), 1, len(at) - 1)
            rays, hit = rays[rays < horizon[-1]], hit[rays < horizon[-1]]
            share = (rays - horizon[hit - 1]) / np.maximum(horizon[hit] - horizon[hit - 1], 1e-12)
            across = at[hit - 1] + share * (at[hit] - at[hit - 1])
            z = profile_m(at[hit - 1]) + share * (profile_m(at[hit]) - profile_m(at[hit - 1]))
            along = start + np.abs(across) * (1.0 if k % 2 else -1.0)
            parts.append(np.column_stack([along, across, z]))
    xyz = np.concatenate(parts)
    xyz = xyz[(xyz[:, 0] > 0.0) & (xyz[:, 0] < LENGTH_M)]
    rough = np.array(ROUGHNESS_M)[np.searchsorted(KERBS_M, xyz[:, 1])]
    xyz[:, 2] += rng.normal(0.0, rough)
    brightness = np.where(rough > 0.01, 300.0, 200.0) * rng.lognormal(0.0, 0.1, len(xyz))
    return Points(xyz + ORIGIN, intensity=np.round(brightness).astype(np.float32), crs="EPSG:25832")


def driven() -> Trajectory:
    """Return the way of the van along y = 0."""
    x = np.arange(0.0, LENGTH_M, 0.5)
    return Trajectory(x / 10.0, np.column_stack([x, 0.0 * x, profile_m(0.0 * x)]) + ORIGIN)
