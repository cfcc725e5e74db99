"""Which tiles a survey is worked in: cores that share no place, each with a buffer around it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from linework.model.grid import Bounds

#: Cores begin and end on whole multiples of this, so that the same survey has the same tiles in every run
#: and a point on the eastern or northern edge of the extent lies inside the half-open core. [m]
CORE_LATTICE_M = 10.0


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
    """Return the tiles that cover `bounds` (closed: points may lie on its edges).

    Points are read whole today, so that one tile holds the whole extent.

    >>> [t.core for t in plan_tiles(Bounds(3.0, 20.0, 30.0, 41.0), 5.0)]
    [Bounds(west=0.0, south=20.0, east=40.0, north=50.0)]
    """
    if not all(map(math.isfinite, bounds)) or bounds.west > bounds.east or bounds.south > bounds.north:
        raise ValueError(f"bounds {tuple(bounds)}: expected finite numbers, west <= east, south <= north")
    west, south = math.floor(bounds.west / CORE_LATTICE_M), math.floor(bounds.south / CORE_LATTICE_M)
    east, north = math.floor(bounds.east / CORE_LATTICE_M) + 1, math.floor(bounds.north / CORE_LATTICE_M) + 1
    core = Bounds(
        west * CORE_LATTICE_M, south * CORE_LATTICE_M, east * CORE_LATTICE_M, north * CORE_LATTICE_M
    )
    return (Tile(f"e{west}n{south}", core, buffer_m),)
