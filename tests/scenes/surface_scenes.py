"""Small surveys for tests of the surface: roads through made-up places, in a point store or in memory."""

import numpy as np
from tests.oracles.store_twin import made

from linework.model.trajectory import Trajectory
from linework.processes.executors import Serial
from linework.runs.opened.surface import SurfaceTiling, make_surface
from linework.surface.config import RoadConfig

#: South-west corner of the scenes: just off the corners of blocks and tiles.
ORIGIN = np.array([500_000.0 - 20.0, 5_800_000.0 - 12.0, 100.0])
CONFIG = RoadConfig()
SMALL_TILES = SurfaceTiling(64)


def on_lattice(xyz):
    """Coordinates as the point store gives them back."""
    return np.rint(np.asarray(xyz) * 1e4) / 1e4


def bend(s_m):
    """A road that turns and climbs: positions (n, 2) and heights (n,) at chainages, from (0, 0)."""
    return np.column_stack([s_m, 12.0 * np.sin(s_m / 25.0)]), 0.03 * s_m


def winding_road(seed, length_m=110.0, per_m2=22):
    """Road with kerbs, verges, a hedge, a roof, a gap in the data with pavement beyond it, and strays."""
    rng = np.random.default_rng(seed)
    s, q = rng.uniform(0, length_m, int(length_m * 24 * per_m2)), 0.0
    q = rng.uniform(-12, 12, len(s))
    q = np.where((q > 6.0) & (q < 7.5), rng.uniform(-3, 3, len(s)), q)  # nothing was measured there
    xy, z = bend(s)
    xy[:, 1] += q
    z = z + np.where(np.abs(q) < 4.0, -0.02 * np.abs(q), 0.04) + rng.normal(0, 0.006, len(s))
    hedge = (q < -8.0) & (rng.random(len(s)) < 0.7)
    z = z + np.where(hedge, rng.uniform(0.0, 1.5, len(s)), 0.0)
    roof = (q > 7.5) & (np.abs(s - 70.0) < 8.0)
    z = np.where(roof, 7.0, z)
    stray = rng.random(len(s)) < 1e-3
    z = z - np.where(stray, rng.uniform(0.5, 5.0, len(s)), 0.0)
    return on_lattice(np.column_stack([xy, z]) + ORIGIN)


def along(length_m=110.0, up_m=0.0):
    """Return the path on the winding road, at some height above it."""
    s = np.arange(2.0, length_m - 2.0, 1.0)
    xy, z = bend(s)
    return Trajectory(s, np.column_stack([xy, z + up_m]) + ORIGIN)


def store_of(folder, xyz, *, order=None, batch=10**9):
    """Write points to a store, in a given order and in batches."""
    xyz = xyz if order is None else xyz[order]
    return made(folder, [(xyz, np.zeros(len(xyz), np.uint16), None)], batch=batch)


def surface_of(store, trajectory, folder, *, layout=SMALL_TILES, config=CONFIG, executor=None, key="a"):
    """Make the surface of a store."""
    return make_surface(
        store,
        trajectory,
        config,
        folder,
        executor or Serial(),
        lambda done, total: None,
        key=key,
        layout=layout,
    )
