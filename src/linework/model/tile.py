"""A piece of a survey as a method gets it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from linework.model.grid import Bounds
from linework.model.points import Points
from linework.model.surface import RoadSurface
from linework.model.trajectory import Trajectory

#: Local origins are whole multiples of this: of every lattice that methods use (cells, windows, columns). [m]
ORIGIN_STEP_M = 1200.0


@dataclass(frozen=True, slots=True)
class TileData:
    """The points of a tile's core and of the buffer around it.

    Parameters
    ----------
    tile_id
        Name of the tile, the same in every run.
    core
        What the tile answers for (half open); points beyond it are buffer.
    points
        Points of core and buffer.
    trajectory
        The vehicle's path (whole), or None.
    source
        Name of what the points come from, for the lines' `source` field.
    surface
        Road and ground of the whole survey over core and buffer, or None: a method finds them in the points.
    origin
        Local origin shared by all tiles of a survey [m, world], so that the same points give the same
        numbers in each of them; None: made from the points, see `local_origin`.
    """

    tile_id: str
    core: Bounds
    points: Points
    trajectory: Trajectory | None = None
    source: str = ""
    surface: RoadSurface | None = None
    origin: tuple[float, float, float] | None = None


def local_origin(west: float, south: float, low: float) -> tuple[float, float, float]:
    """Return the local origin of a survey with this south-west corner and lowest height.

    >>> local_origin(500100.0, 5400000.0, 31.0)
    (499200.0, 5400000.0, 0.0)
    """
    east, north, up = (math.floor(value / ORIGIN_STEP_M) * ORIGIN_STEP_M for value in (west, south, low))
    return east, north, up
