"""A piece of a survey as a method gets it."""

from __future__ import annotations

from dataclasses import dataclass

from linework.model.grid import Bounds
from linework.model.points import Points
from linework.model.trajectory import Trajectory


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
    """

    tile_id: str
    core: Bounds
    points: Points
    trajectory: Trajectory | None = None
    source: str = ""
