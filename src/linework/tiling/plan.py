"""Which tiles a survey is worked in: cores that share no place, each with a buffer around it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from linework.model.grid import Bounds

#: Cores begin and end on whole multiples of this, so that the same survey has the same tiles in every run
#: and a point on the eastern or northern edge of the extent lies inside the half-open core. [m]
CORE_LATTICE_M = 10.0
#: A survey no larger than this, east-west and north-south, is one tile: its raster image at the default
#: cell of 0.2 m has 36 million cells, of the 50 million that `linework.imaging` allows. [m]
MAX_SINGLE_M = 1200.0
#: Size of the cores of larger surveys: with 120 m of buffer all round, 38 million cells. [m]
CORE_M = 1000.0


@dataclass(frozen=True, slots=True)
class Tile:
    """A tile to be worked: what it answers for, and how much more it gets to see.

    Parameters
    ----------
    tile_id
        Its south-west corner in lattice steps: the same place has the same name in every run.
    core
        Half open; cores of a plan do not overlap.
    buffer_m
        Margin of points around the core. [m]
    """

    tile_id: str
    core: Bounds
    buffer_m: float

    @property
    def extent(self) -> Bounds:
        """Core and buffer."""
        return self.core.grown(self.buffer_m)


def plan_tiles(bounds: Bounds, buffer_m: float) -> tuple[Tile, ...]:
    """Return the tiles that cover `bounds` (closed: points may lie on its edges), south-west first.

    >>> [t.core for t in plan_tiles(Bounds(3.0, 20.0, 30.0, 41.0), 5.0)]
    [Bounds(west=0.0, south=20.0, east=40.0, north=50.0)]
    >>> [t.tile_id for t in plan_tiles(Bounds(500.0, 0.0, 2500.0, 30.0), 5.0)]
    ['e0n0', 'e100n0', 'e200n0']
    """
    if not all(map(math.isfinite, bounds)) or bounds.west > bounds.east or bounds.south > bounds.north:
        raise ValueError(f"bounds {tuple(bounds)}: expected finite numbers, west <= east, south <= north")
    if max(bounds.width_m, bounds.height_m) <= MAX_SINGLE_M:
        west, south = _lattice(bounds.west, CORE_LATTICE_M), _lattice(bounds.south, CORE_LATTICE_M)
        east, north = _lattice(bounds.east, CORE_LATTICE_M), _lattice(bounds.north, CORE_LATTICE_M)
        whole = Bounds(west, south, east + CORE_LATTICE_M, north + CORE_LATTICE_M)
        return (_tile(whole, buffer_m),)
    return tuple(
        _tile(Bounds(col * CORE_M, row * CORE_M, (col + 1) * CORE_M, (row + 1) * CORE_M), buffer_m)
        for row in range(math.floor(bounds.south / CORE_M), math.floor(bounds.north / CORE_M) + 1)
        for col in range(math.floor(bounds.west / CORE_M), math.floor(bounds.east / CORE_M) + 1)
    )


def _lattice(value_m: float, step_m: float) -> float:
    """Return the last lattice line at or below a coordinate."""
    return math.floor(value_m / step_m) * step_m


def _tile(core: Bounds, buffer_m: float) -> Tile:
    east, north = round(core.west / CORE_LATTICE_M), round(core.south / CORE_LATTICE_M)
    return Tile(f"e{east}n{north}", core, buffer_m)
