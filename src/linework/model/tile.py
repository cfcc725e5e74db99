"""A tile of a survey as a method receives it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from linework.model.grid import Bounds
from linework.model.ground import Ground
from linework.model.points import Points
from linework.model.scanner import ScannerTiming
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
        Area that this tile is responsible for (half open); points beyond it are buffer.
    points
        Points of core and buffer.
    trajectory
        The vehicle's path (whole), or None.
    source
        Name of the data source, for the lines' `source` field.
    surface
        Road and ground surface of the survey over core and buffer; None: the method derives it from the points.
    origin
        Local origin shared by all tiles of a survey [m, world], so that the same points give the same
        numbers in each of them; None: derived from the points (see `local_origin`).
    is_whole
        Whether the tile is the whole survey: its lines are then not cut at the edges of the core.
    scanner
        What is known of the survey's scanner; None: the method derives it from the points.
    """

    tile_id: str
    core: Bounds
    points: Points
    trajectory: Trajectory | None = None
    source: str = ""
    surface: Ground | None = None
    origin: tuple[float, float, float] | None = None
    is_whole: bool = True
    scanner: ScannerTiming | None = None


def local_origin(west: float, south: float, low: float) -> tuple[float, float, float]:
    """Return the local origin of a survey with this south-west corner and lowest height.

    >>> local_origin(500100.0, 5400000.0, 31.0)
    (499200.0, 5400000.0, 0.0)
    """
    east, north, up = (math.floor(value / ORIGIN_STEP_M) * ORIGIN_STEP_M for value in (west, south, low))
    return east, north, up
