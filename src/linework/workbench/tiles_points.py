"""The points under a tile: read patch by patch, with their height above the road, and kept while there is room."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, Float32Array, FloatArray
from linework.files.store_read import PointStore
from linework.model.grid import Bounds
from linework.surface.road import height_above_road
from linework.tiling.surfaces import SurveySurface
from linework.workbench.tiles import BLOCK_M, Tile
from linework.workbench.tiles_brightness import asphalt_level

#: A patch has so many points at most: 20 MB while they are kept, 70 MB while they are read.
MOST_POINTS = 1_000_000
#: Patches are kept up to this. [bytes]
ROOM = 128 << 20


@dataclass(frozen=True, slots=True)
class Patch:
    """The points of a square, as they come.

    Parameters
    ----------
    corner
        South-west corner [m, world], and the surface's height origin.
    x, y, z
        (n,) float32 from the corner. [m]
    above
        (n,) float32: height above the road [m], NaN where it is not known.
    intensity
        (n,) uint16: asphalt is 1000 where the van's way is known, else as recorded; 0 where the survey has none.
    """

    corner: tuple[float, float, float]
    x: Float32Array
    y: Float32Array
    z: Float32Array
    above: Float32Array
    intensity: AnyArray

    def __len__(self) -> int:
        return len(self.x)

    @property
    def columns(self) -> tuple[AnyArray, ...]:
        """x, y, z, above, intensity."""
        return self.x, self.y, self.z, self.above, self.intensity

    @property
    def n_bytes(self) -> int:
        """Memory of the columns."""
        return sum(column.nbytes for column in self.columns)


class PatchReader:
    """Reads the points of any square.

    Parameters
    ----------
    surface
        None: no height above the road is known.
    path
        (k, 2) places of the van's way [m, world]; none: intensities stay as recorded.
    """

    def __init__(
        self, store: PointStore, surface: SurveySurface | None, path: FloatArray | None = None
    ) -> None:
        self.store, self.surface = store, surface
        self._asphalt = None if surface is None or path is None else asphalt_level(store, surface, path)
        self.z0_m = surface.z0_m if surface is not None else 0.0
        blocks, counts = store.block_counts
        #: Points by number of block.
        self.counts = {(e, n): k for (e, n), k in zip(blocks.tolist(), counts.tolist(), strict=True)}
        self._kept: OrderedDict[Tile, Patch] = OrderedDict()
        self._n_bytes = 0

    def patches(self, bounds: Bounds, *, keep: bool = True) -> Iterator[Patch]:
        """Yield the patches that hold the points of a rectangle, row-major from the south-west.

        Parameters
        ----------
        keep
            Keep them for the next that asks, as long as there is room.
        """
        for tile in self._patches_over(bounds):
            yield self._patch(tile, keep)

    def count_in(self, bounds: Bounds) -> int:
        """Return how many points lie in the blocks that share places with a rectangle."""
        return sum(self.counts.get((tile.east, tile.north), 0) for tile in tiles_over(bounds, 0))

    def _patches_over(self, bounds: Bounds) -> Iterator[Tile]:
        for block in tiles_over(bounds, 0):
            n = self.counts.get((block.east, block.north), 0)
            if n == 0:
                continue
            level = -max(0, math.ceil(math.log(n / MOST_POINTS, 4.0)))
            for tile in tiles_over(bounds, level):
                if tile.east >> -level == block.east and tile.north >> -level == block.north:
                    yield tile

    def _patch(self, tile: Tile, keep: bool) -> Patch:
        found = self._kept.get(tile)
        if found is not None:
            self._kept.move_to_end(tile)
            return found
        patch = self._read(tile.bounds)
        if keep:
            self._kept[tile] = patch
            self._n_bytes += patch.n_bytes
            while self._n_bytes > ROOM and len(self._kept) > 1:
                self._n_bytes -= self._kept.popitem(last=False)[1].n_bytes
        return patch

    def _read(self, bounds: Bounds) -> Patch:
        points = self.store.points(bounds, ordered=False, with_time=False)
        n = len(points)
        xyz, intensity = points.xyz, points.intensity
        above = np.full(n, np.nan, np.float32)
        if self.surface is not None and n:
            # Heights are taken between the middles of cells: also of those beyond the edge
            above = height_above_road(self.surface.over(bounds.grown(self.surface.cell_m)), xyz)
        x, y, z = (
            (xyz[:, i] - origin).astype(np.float32)
            for i, origin in enumerate((bounds.west, bounds.south, self.z0_m))
        )
        bright = np.zeros(n, np.uint16) if intensity is None else intensity.astype(np.uint16)
        if self._asphalt is not None:
            bright = self._asphalt.normalised(x, y, bright, bounds)
        return Patch((bounds.west, bounds.south, self.z0_m), x, y, z, above, bright)


def tiles_over(bounds: Bounds, level: int) -> Iterator[Tile]:
    """Yield the tiles of a level that share places with a rectangle, row-major from the south-west.

    >>> [(t.east, t.north) for t in tiles_over(Bounds(0.0, 10.0, 64.0, 70.0), 0)]
    [(0, 0), (0, 1)]
    """
    size = math.ldexp(BLOCK_M, level)
    last = math.ceil(bounds.east / size), math.ceil(bounds.north / size)
    for north in range(math.floor(bounds.south / size), last[1]):
        for east in range(math.floor(bounds.west / size), last[0]):
            yield Tile(level, east, north)
