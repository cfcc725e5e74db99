"""Boxes of an opened survey, found where they are asked for."""

from __future__ import annotations

import math

import numpy as np

from linework.files.store_read import PointStore
from linework.methods.protocol import BoxMethod
from linework.model.arrays import FloatArray
from linework.model.boxes import BoxSet
from linework.model.grid import Bounds, holds
from linework.model.points import Points
from linework.model.tile import TileData
from linework.tiling.surfaces import SurveySurface

#: Boxes are found block by block, so that a line's surroundings are few points. [m]
BLOCK_M = 16.0
#: Points are read by larger squares, those of the tile store, and so many of them stay at hand. [m]
READ_M, N_READ = 64.0, 6


class SurveyBoxes:
    """The boxes of a survey, as far as they have been asked for.

    Parameters
    ----------
    origin
        Local origin of the survey [m, world].
    """

    def __init__(
        self,
        store: PointStore,
        surface: SurveySurface,
        method: BoxMethod,
        origin: tuple[float, float, float],
    ) -> None:
        self._store, self._surface, self._method, self._origin = store, surface, method, origin
        self._found: dict[tuple[int, int], BoxSet] = {}
        self._read: dict[tuple[int, int], Points] = {}

    @property
    def boxes(self) -> BoxSet:
        """All boxes found so far [m, from the local origin]."""
        return BoxSet.concatenate(self._found.values()) if self._found else BoxSet.empty()

    def load(self, places: FloatArray, reach_m: float) -> bool:
        """Find all boxes within `reach_m` of places (n, 2) [m, world]; return whether any were added."""
        low = np.floor((places - reach_m) / BLOCK_M).astype(np.int64)
        high = np.floor((places + reach_m) / BLOCK_M).astype(np.int64)
        asked = {
            (col, row)
            for (west, south), (east, north) in zip(low.tolist(), high.tolist(), strict=True)
            for row in range(south, north + 1)
            for col in range(west, east + 1)
        }
        new = sorted(asked - self._found.keys())
        for block in new:
            self._found[block] = self._detect(*block)
        return any(len(self._found[block]) for block in new)

    def _detect(self, col: int, row: int) -> BoxSet:
        core = Bounds(col * BLOCK_M, row * BLOCK_M, (col + 1) * BLOCK_M, (row + 1) * BLOCK_M)
        if self._store.count_in(core) == 0:
            return BoxSet.empty()
        extent = core.grown(self._method.buffer_m)
        square = self._square(math.floor(core.west / READ_M), math.floor(core.south / READ_M))
        points = square.take(np.flatnonzero(holds(extent, square.xyz)))
        if len(points) == 0:
            return BoxSet.empty()
        tile = TileData(f"e{col}n{row}", core, points, None, "", self._surface.over(extent), self._origin)
        boxes = self._method.detect(tile)
        return boxes.take(holds(core, boxes.centre + np.asarray(self._origin)))

    def _square(self, east: int, north: int) -> Points:
        """Return the points of a square and of the buffer around it, in canonical order."""
        if (east, north) not in self._read:
            while len(self._read) >= N_READ:
                del self._read[next(iter(self._read))]
            bounds = Bounds(east * READ_M, north * READ_M, (east + 1) * READ_M, (north + 1) * READ_M)
            self._read[east, north] = self._store.points(bounds.grown(self._method.buffer_m))
        return self._read[east, north]
