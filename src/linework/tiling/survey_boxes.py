"""Boxes of an opened survey, found where they are asked for."""

from __future__ import annotations

import math

import numpy as np

from linework.files.store_read import PointStore
from linework.methods.protocol import BoxMethod
from linework.model.arrays import BoolArray, FloatArray
from linework.model.boxes import BoxSet
from linework.model.grid import Bounds, holds
from linework.model.tile import TileData
from linework.tiling.surfaces import SurveySurface

#: Boxes are found block by block: half a block of the tile store on a side. [m]
BLOCK_M = 32.0


class SurveyBoxes:
    """The boxes of some forms of a method (a `linework.methods.obb.follow.BoxSource`).

    Parameters
    ----------
    forms
        Of `linework.model.boxes.BoxForm`: what is kept.
    origin
        Local origin of the survey [m, world].
    """

    def __init__(
        self,
        store: PointStore,
        surface: SurveySurface,
        method: BoxMethod,
        forms: tuple[int, ...],
        origin: tuple[float, float, float],
    ) -> None:
        self._store, self._surface, self._method = store, surface, method
        self._forms, self._origin = forms, origin
        self._loaded: set[tuple[int, int]] = set()
        self._boxes = BoxSet.empty()

    @property
    def boxes(self) -> BoxSet:
        """All boxes found so far; more are added behind them."""
        return self._boxes

    def load(self, xy: FloatArray, reach_m: float) -> bool:
        """Find all boxes within `reach_m` of a place [m, from the local origin]; return whether any were added."""
        east, north = float(xy[0]) + self._origin[0], float(xy[1]) + self._origin[1]
        found = [
            self._detect(col, row)
            for row in range(
                math.floor((north - reach_m) / BLOCK_M), math.floor((north + reach_m) / BLOCK_M) + 1
            )
            for col in range(
                math.floor((east - reach_m) / BLOCK_M), math.floor((east + reach_m) / BLOCK_M) + 1
            )
            if (col, row) not in self._loaded
        ]
        added = [boxes for boxes in found if len(boxes)]
        if added:
            self._boxes = BoxSet.concatenate([self._boxes, *added])
        return bool(added)

    def _detect(self, col: int, row: int) -> BoxSet:
        self._loaded.add((col, row))
        core = Bounds(col * BLOCK_M, row * BLOCK_M, (col + 1) * BLOCK_M, (row + 1) * BLOCK_M)
        if self._store.count_in(core) == 0:
            return BoxSet.empty()
        extent = core.grown(self._method.buffer_m)
        points = self._store.points(extent)
        if len(points) == 0:
            return BoxSet.empty()
        surface = self._surface.over(extent)
        tile = TileData(f"e{col}n{row}", core, points, None, "", surface, self._origin)
        boxes = self._method.detect(tile)
        kept: BoolArray = holds(core, boxes.centre + np.asarray(self._origin)) & np.isin(
            boxes.form, self._forms
        )
        return boxes.take(kept)
