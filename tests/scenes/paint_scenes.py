"""Made-up roads with paint: level ground, points at random places or on scan lines, exact stripes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray
from linework.model.grid import Bounds, Grid
from linework.model.ground import Ground
from linework.model.points import Points
from linework.model.tile import TileData

#: Somewhere on a map, away from its zero; the ground is level at this height.
EAST_M, NORTH_M, HEIGHT_M = 500_400.0, 5_400_000.0, 31.0
ORIGIN = (499_200.0, 5_400_000.0, 0.0)


@dataclass(frozen=True)
class Stripe:
    """Paint between two places of the scene [m], `width_m` wide, `contrast` times as bright as the road."""

    start: tuple[float, float]
    end: tuple[float, float]
    width_m: float = 0.12
    contrast: float = 2.0

    def holds(self, xy: FloatArray) -> np.ndarray:
        """Return which places lie on the paint."""
        u, length = self.direction, self.length_m
        d = xy - self.start
        return (np.abs(d @ [-u[1], u[0]]) <= 0.5 * self.width_m) & (d @ u >= 0.0) & (d @ u <= length)

    @property
    def direction(self) -> FloatArray:
        """Unit vector along it."""
        u: FloatArray = np.subtract(self.end, self.start)
        return u / np.hypot(*u)

    @property
    def length_m(self) -> float:
        """Its length."""
        return float(np.hypot(*np.subtract(self.end, self.start)))

    def across(self, xy: FloatArray) -> FloatArray:
        """Return signed distances from its centreline, left of it positive."""
        u = self.direction
        return np.asarray((xy - self.start) @ [-u[1], u[0]])


def road_points(
    rng: np.random.Generator,
    stripes: Sequence[Stripe],
    *,
    size_m: float = 12.0,
    per_m2: float = 400.0,
    noise: float = 0.08,
    level: float = 1000.0,
) -> tuple[FloatArray, FloatArray]:
    """Return places (n, 3) in the scene and intensities of points at random places of a level road."""
    xy = rng.uniform(0.0, size_m, (int(per_m2 * size_m**2), 2))
    shade = np.ones(len(xy))
    for stripe in stripes:
        shade[stripe.holds(xy)] = stripe.contrast
    intensity = level * shade * (1.0 + noise * rng.normal(size=len(xy)))
    return np.column_stack([xy, 0.005 * rng.normal(size=len(xy))]), np.maximum(np.floor(intensity), 0.0)


def tile_of(xyz: FloatArray, intensity: FloatArray | None, time_s: FloatArray | None = None) -> TileData:
    """Return scene points as a tile."""
    world = xyz + np.array((EAST_M, NORTH_M, HEIGHT_M))
    points = Points(
        world, intensity=None if intensity is None else intensity.astype(np.float32), time_s=time_s
    )
    return TileData("scene", points.bounds.grown(1.0), points, origin=ORIGIN)


def level_surface(size_m: float = 12.0) -> Ground:
    """Return the level road under a scene, and 2 m of it on all sides."""
    grid = Grid.covering(
        Bounds(EAST_M - 2.0, NORTH_M - 2.0, EAST_M + size_m + 2.0, NORTH_M + size_m + 2.0), 0.5
    )
    height = np.full(grid.shape, HEIGHT_M, dtype=np.float32)
    everywhere = np.ones(grid.shape, dtype=np.bool_)
    return Ground(grid, 0.0, height, height, everywhere, everywhere)


def in_scene(centre: FloatArray) -> FloatArray:
    """Return (n, 2) places of boxes in the scene."""
    return centre[:, :2] + np.subtract(ORIGIN[:2], (EAST_M, NORTH_M))
