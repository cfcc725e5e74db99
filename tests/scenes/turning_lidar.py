"""A street with two kerbs, seen by a spinning lidar whose turns are each too high and tilted."""

import numpy as np

from linework.model.points import Points

#: Places of the kerbs across the street, and their height. [m]
KERB_Y_M, KERB_M = 4.0, 0.12


def street_m(y):
    """Return the height of the street at places across it."""
    return np.where(np.abs(y) > KERB_Y_M, KERB_M, -0.02 * np.abs(y))


def turned_street(seed, *, apart_m=0.04, tilt=0.004, n_turns=60, n_rings=24, rings_deg=1.0, noise_m=0.008):
    """Return the points, and by how much each is too high; all points of a turn have one time."""
    rng = np.random.default_rng(seed)
    # Rings of beams, 1.8 m above the road, with a point every half degree
    rings = 1.8 / np.tan(np.radians(4.0 + rings_deg * np.arange(n_rings)))
    away, azimuth = (grid.ravel() for grid in np.meshgrid(rings, np.radians(np.arange(0.0, 360.0, 0.5))))
    turn, away, azimuth = (
        np.repeat(np.arange(n_turns), len(away)),
        np.tile(away, n_turns),
        np.tile(azimuth, n_turns),
    )
    azimuth = azimuth + rng.uniform(0.0, 0.01, n_turns)[turn]
    van = 0.6 * turn
    x, y = van + away * np.cos(azimuth), away * np.sin(azimuth)
    inside = np.abs(y) < 8.0
    turn, van, x, y = turn[inside], van[inside], x[inside], y[inside]
    plane = rng.normal(0.0, 1.0, (n_turns, 3)) * [apart_m, tilt, tilt]
    too_high = plane[turn, 0] + plane[turn, 1] * (x - van) + plane[turn, 2] * y
    z = street_m(y) + rng.normal(0.0, noise_m, len(y)) + too_high
    xyz = np.stack([x + 500_000.0, y + 5_800_000.0, z + 60.0], axis=1)
    intensity = rng.normal(100.0, 5.0, len(y)).clip(1.0).astype(np.float32).round()
    return Points(xyz, intensity=intensity, time_s=1000.0 + 0.1 * turn, crs="local"), too_high
