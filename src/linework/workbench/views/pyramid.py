"""Tiles of the plan view: squares of 256 pixels that nest in one another and in the store's blocks."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

from linework.model.grid import Bounds

#: Side of a tile. [pixels]
TILE_PX = 256
#: Side of a tile of level 0, which is a block of the point store, and of its cells, fine enough for paint. [m]
TILE_BLOCK_M = 64.0
TILE_CELL_M = TILE_BLOCK_M / TILE_PX
#: The finest level: cells of 1/64 m, half the distance of points beside the van.
FINEST = -4
#: Name, title and unit of the images.
IMAGES = (
    ("intensity", "Intensity", ""),
    ("height", "Height", "m"),
    ("above_road", "Height above the road", "m"),
    ("density", "Density", "points/m²"),
)


class MapTile(NamedTuple):
    """A square of the world: 64 m on level 0, twice as large on each level above.

    Parameters
    ----------
    level
        `FINEST` or above.
    east, north
        Its south-west corner, as a multiple of its size from the world's origin.
    """

    level: int
    east: int
    north: int

    @property
    def size_m(self) -> float:
        """Length of a side. [m]"""  # noqa: D400
        return math.ldexp(TILE_BLOCK_M, self.level)

    @property
    def cell_m(self) -> float:
        """Length of a pixel's side. [m]"""  # noqa: D400
        return math.ldexp(TILE_CELL_M, self.level)

    @property
    def bounds(self) -> Bounds:
        """The square, half open. [m, world]"""  # noqa: D400
        size = self.size_m
        return Bounds(self.east * size, self.north * size, (self.east + 1) * size, (self.north + 1) * size)

    @property
    def children(self) -> tuple[MapTile, ...]:
        """The four tiles one level below: north-west, north-east, south-west, south-east."""
        e, n = 2 * self.east, 2 * self.north
        return tuple(MapTile(self.level - 1, e + i, n + 1 - j) for j in (0, 1) for i in (0, 1))

    @property
    def parent(self) -> MapTile:
        """The tile one level above that holds this one.

        >>> MapTile(0, -1, 5).parent
        MapTile(level=1, east=-1, north=2)
        """
        return MapTile(self.level + 1, self.east // 2, self.north // 2)


@dataclass(frozen=True, slots=True)
class Lattice:
    """The page's numbering of a survey's tiles: zoom from the coarsest, columns east and rows south from a corner.

    Parameters
    ----------
    coarsest
        Level of zoom 0.
    west, north
        Number of the first column's tile at zoom 0, and of the tile north of the first row.
    """

    coarsest: int
    west: int
    north: int

    @classmethod
    def of(cls, bounds: tuple[float, float, float, float]) -> Lattice:
        """Return the lattice of a survey by its bounds [m, world]: a tile of zoom 0 is as large as the survey.

        >>> Lattice.of((500_000.0, 5_800_000.0, 500_900.0, 5_800_100.0)).document()["origin"]
        [499712.0, 5800960.0]
        """
        west, south, east, north = bounds
        extent = max(east - west, north - south, 4.0 * TILE_BLOCK_M)
        coarsest = math.ceil(math.log2(extent / TILE_BLOCK_M))
        size = math.ldexp(TILE_BLOCK_M, coarsest)
        return cls(coarsest, math.floor(west / size), math.floor(north / size) + 1)

    def document(self) -> dict[str, Any]:
        """Return the JSON document for the page: pixels of a tile, north-west corner [m, world], resolutions [m]."""
        size = math.ldexp(TILE_BLOCK_M, self.coarsest)
        resolutions = [math.ldexp(TILE_CELL_M, level) for level in range(self.coarsest, FINEST - 1, -1)]
        return {
            "tile_px": TILE_PX,
            "origin": [self.west * size, self.north * size],
            "resolutions": resolutions,
        }

    def tile(self, z: int, col: int, row: int) -> MapTile | None:
        """Return the tile at a zoom, column and row; None outside the lattice.

        >>> Lattice(4, 488, 5665).tile(4, 3, 1)
        MapTile(level=0, east=7811, north=90638)
        """
        level = self.coarsest - z
        if z < 0 or level < FINEST:
            return None
        # A survey crosses at most one edge of the tiles of zoom 0 in each direction
        if not (0 <= col < 2 << z and 0 <= row < 2 << z):
            return None
        return MapTile(level, (self.west << z) + col, (self.north << z) - 1 - row)
