"""Where road or ground was measured, asked of a whole survey."""

from __future__ import annotations

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.methods.protocol import Sight, sight_of
from linework.model.grid import Bounds
from linework.runs.opened.surface import SurveySurface

#: The surface is looked at in pieces of this, and so many of them stay at hand. [m]
SIGHT_PIECE_M, N_PIECES = 256.0, 32


class SurveySight:
    """Says for places in the world whether road or ground was measured there (see `linework.methods.protocol`)."""

    def __init__(self, surface: SurveySurface) -> None:
        self._surface = surface
        self._pieces: dict[tuple[int, int], Sight] = {}

    def __call__(self, xy: FloatArray) -> BoolArray:
        """Return (n,) bool for (n, 2) places [m, world]."""
        out = np.zeros(len(xy), dtype=np.bool_)
        number = np.floor(xy / SIGHT_PIECE_M).astype(np.int64)
        for east, north in np.unique(number, axis=0).tolist():
            inside = (number[:, 0] == east) & (number[:, 1] == north)
            out[inside] = self._piece(east, north)(xy[inside])
        return out

    def _piece(self, east: int, north: int) -> Sight:
        if (east, north) not in self._pieces:
            while len(self._pieces) >= N_PIECES:
                del self._pieces[next(iter(self._pieces))]
            west, south = east * SIGHT_PIECE_M, north * SIGHT_PIECE_M
            surface = self._surface.over(Bounds(west, south, west + SIGHT_PIECE_M, south + SIGHT_PIECE_M))
            self._pieces[east, north] = sight_of(surface)
        return self._pieces[east, north]
