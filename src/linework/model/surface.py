"""The road's and the ground's height, everywhere on a grid."""

from __future__ import annotations

from dataclasses import dataclass

from linework.arrays import BoolArray, Float32Array
from linework.model.grid import Grid


@dataclass(frozen=True, slots=True)
class RoadSurface:
    """The road's and the ground's height on one grid, without holes (NaN only where making it failed).

    Parameters
    ----------
    grid
        North-up grid on the global lattice.
    z0_m
        Local height origin: the surfaces are float32 above it. [m, world]
    road_m
        (rows, cols) float32 [m above z0_m]: the road, carried on beyond its edge into the ground.
    ground_m
        (rows, cols) float32 [m above z0_m]: the ground.
    is_road, is_ground
        (rows, cols) bool: cells where the surface was measured.
    """

    grid: Grid
    z0_m: float
    road_m: Float32Array
    ground_m: Float32Array
    is_road: BoolArray
    is_ground: BoolArray
