"""The tiles of a survey: disjoint cores, each with a buffer around it."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from linework.arrays import IntArray
from linework.model.grid import Bounds
from linework.runs.settings import TilingConfig

#: Greatest extent of a survey that may be one tile: its raster image at the default cell of 0.2 m has 36 million
#: cells, of the 50 million that `linework.imaging` allows. [m]
MAX_SINGLE_M = 1200.0
#: A tile is divided where the largest of its parts, buffers included, has at most this share of its points: otherwise
#: dividing spares no memory, and looks at the same points again and again.
_MOST_OF_DIVIDED = 0.75


@dataclass(frozen=True, slots=True)
class Tile:
    """A tile of a plan: the core whose lines belong to it, and the buffer of points around it.

    Parameters
    ----------
    tile_id
        South-west corner and size of the core: the same in every run.
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


def plan_tiles(
    extent: Bounds,
    blocks: IntArray,
    block_m: float,
    count_in: Callable[[Bounds], int],
    buffer_m: float,
    config: TilingConfig,
    *,
    only_high: bool = False,
) -> tuple[Tile, ...]:
    """Return the tiles that cover a survey, south-west first.

    Parameters
    ----------
    extent
        Of all points.
    blocks
        (n, 2) int64: east and north number of every block of `block_m` that holds points.
    count_in
        Returns the number of points in a rectangle, or a little more.
    only_high
        Whether the method looks at high points only: its tiles are wider, and not divided by their points.

    Notes
    -----
    A tile, buffer included, has at most `max_points`, unless its core is as small as `least_core_m`, or one of its parts
    would have more than three quarters of its points. A survey that fits into one tile is one tile; so is one no larger
    than a core if one of its tiles would have as many.
    """
    if not all(map(math.isfinite, extent)) or extent.west > extent.east or extent.south > extent.north:
        raise ValueError(f"extent {tuple(extent)}: expected finite numbers, west <= east, south <= north")
    # The far edges belong to the next core: a little more, so that a single core holds points on its own
    whole = Bounds(
        math.floor(extent.west), math.floor(extent.south),
        math.floor(extent.east) + 1.0, math.floor(extent.north) + 1.0,
    )  # fmt: skip
    core_m = config.high_core_m if only_high else config.core_m
    most = sys.maxsize if only_high else config.max_points
    is_small = max(whole.width_m, whole.height_m) <= max(MAX_SINGLE_M, core_m)
    if is_small and count_in(whole) <= most:
        return (_tile(whole, buffer_m),)
    tiles = [
        _tile(part, buffer_m)
        for core in _cores(blocks, block_m, core_m, config)
        for part in _divided(core, count_in, buffer_m, most, config)
    ]
    is_one_core = max(whole.width_m, whole.height_m) <= core_m
    if is_one_core and not _is_worth_dividing(count_in(whole), [t.core for t in tiles], count_in, buffer_m):
        return (_tile(whole, buffer_m),)
    return tuple(sorted(tiles, key=lambda tile: (tile.core.south, tile.core.west)))


def _cores(blocks: IntArray, block_m: float, core_m: float, config: TilingConfig) -> list[Bounds]:
    """Return the cells of the lattice of cores that blocks with points reach into."""
    east_m, north_m = config.shift_east_m, config.shift_north_m
    found = set()
    for east, north in (blocks * block_m).tolist():
        cols = range(math.floor((east - east_m) / core_m), math.ceil((east + block_m - east_m) / core_m))
        rows = range(math.floor((north - north_m) / core_m), math.ceil((north + block_m - north_m) / core_m))
        found |= {(row, col) for row in rows for col in cols}
    return [
        Bounds(
            east_m + col * core_m,
            north_m + row * core_m,
            east_m + (col + 1) * core_m,
            north_m + (row + 1) * core_m,
        )
        for row, col in sorted(found)
    ]


def _divided(
    core: Bounds, count_in: Callable[[Bounds], int], buffer_m: float, most: int, config: TilingConfig
) -> list[Bounds]:
    """Return the core; its parts if the tile has too many points and they far fewer; nothing if the core has none."""
    if count_in(core) == 0:
        return []
    n_points = count_in(core.grown(buffer_m))
    if n_points <= most or core.width_m / 2 < config.least_core_m:
        return [core]
    east, north = (core.west + core.east) / 2, (core.south + core.north) / 2
    quarters = (
        Bounds(core.west, core.south, east, north), Bounds(east, core.south, core.east, north),
        Bounds(core.west, north, east, core.north), Bounds(east, north, core.east, core.north),
    )  # fmt: skip
    parts = [part for quarter in quarters for part in _divided(quarter, count_in, buffer_m, most, config)]
    return parts if _is_worth_dividing(n_points, parts, count_in, buffer_m) else [core]


def _is_worth_dividing(
    n_points: int, parts: Sequence[Bounds], count_in: Callable[[Bounds], int], buffer_m: float
) -> bool:
    """Return whether the largest part, its buffer included, has far fewer points than `n_points`."""
    largest = max((count_in(part.grown(buffer_m)) for part in parts), default=0)
    return largest <= _MOST_OF_DIVIDED * n_points


def _tile(core: Bounds, buffer_m: float) -> Tile:
    return Tile(f"e{core.west:.0f}n{core.south:.0f}s{core.width_m:.0f}", core, buffer_m)
