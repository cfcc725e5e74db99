"""Boxes of an opened survey, found where they are asked for."""

from __future__ import annotations

import numpy as np

from linework.files.store_read import PointStore
from linework.methods.protocol import BoxMethod
from linework.model.arrays import FloatArray
from linework.model.boxes import BoxSet
from linework.model.grid import Bounds, holds
from linework.model.tile import TileData
from linework.tiling.surfaces import SurveySurface

#: Boxes are found block by block, so that a line's surroundings are few points. [m]
BLOCK_M = 16.0
Block = tuple[int, int]


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
        self._asked: set[Block] = set()
        self._found: list[BoxSet] = []

    @property
    def boxes(self) -> BoxSet:
        """All boxes found so far [m, from the local origin]."""
        return BoxSet.concatenate(self._found) if self._found else BoxSet.empty()

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
        found = [self._detect(*corners) for corners in rectangles(asked - self._asked)]
        self._asked |= asked
        self._found += [boxes for boxes in found if len(boxes)]
        return any(len(boxes) for boxes in found)

    def _detect(self, first: Block, last: Block) -> BoxSet:
        """Return the boxes of a rectangle of blocks: in one go, since each comes with a buffer."""
        core = Bounds(
            first[0] * BLOCK_M, first[1] * BLOCK_M, (last[0] + 1) * BLOCK_M, (last[1] + 1) * BLOCK_M
        )
        if self._store.count_in(core) == 0:
            return BoxSet.empty()
        extent = core.grown(self._method.buffer_m)
        points = self._store.points(extent)
        if len(points) == 0:
            return BoxSet.empty()
        name = f"e{first[0]}n{first[1]}"
        tile = TileData(name, core, points, None, "", self._surface.over(extent), self._origin)
        boxes = self._method.detect(tile)
        return boxes.take(holds(core, boxes.centre + np.asarray(self._origin)))


def rectangles(blocks: set[Block]) -> list[tuple[Block, Block]]:
    """Return rectangles (first and last block) that hold all blocks, each once, and no others.

    >>> rectangles({(0, 0), (1, 0), (0, 1), (1, 1), (5, 1)})
    [((0, 0), (1, 1)), ((5, 1), (5, 1))]
    """
    left, found = set(blocks), []
    for col, row in sorted(blocks, key=lambda block: (block[1], block[0])):
        if (col, row) not in left:
            continue
        east = col
        while (east + 1, row) in left:
            east += 1
        north = row
        while all((c, north + 1) in left for c in range(col, east + 1)):
            north += 1
        left -= {(c, r) for c in range(col, east + 1) for r in range(row, north + 1)}
        found.append(((col, row), (east, north)))
    return found
