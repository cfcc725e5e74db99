"""A guardrail or a cable from a picked place: tiles along the line are searched, and their lines joined.

Separate from `trace`, which takes the request and crosses gaps: this searches whole tiles for what stands beside or
above the road.
"""

from __future__ import annotations

import math

import numpy as np

from linework.arrays import FloatArray
from linework.files.store.layout import STORE_CELL_M
from linework.files.store.read import PointStore
from linework.methods.radon.method import CableMethod, RailMethod
from linework.methods.seams import UNCUT_AT_SEAMS, inside_core, join_seams
from linework.model.grid import Bounds, Image
from linework.model.lines import LineSet
from linework.model.tile import TileData
from linework.runs.opened.surface import SurveySurface

#: Side of the tiles that are searched. [m]
CORE_M = 128.0
#: Tiles over which a line is followed at most: 12 km. [tiles]
MOST_TILES = 100
#: Ends on the edge of a core are searched this far around, for the tile beyond it. [m]
_AROUND_END_M = 1e-6


class RailPieces:
    """The lines of a method in the tiles that were searched so far, joined."""

    def __init__(
        self,
        store: PointStore,
        surface: SurveySurface,
        method: RailMethod | CableMethod,
        origin: tuple[float, float, float],
    ) -> None:
        self._store, self._surface, self._method, self._origin = store, surface, method, origin
        self._tiles: dict[tuple[int, int], LineSet] = {}

    def line_at(self, place: FloatArray, reach_m: float) -> tuple[LineSet, float] | None:
        """Return the whole line nearest to a place (2,) [m, world] within reach, and its distance [m]; None: no line."""
        self._search(place[0] - reach_m, place[1] - reach_m, place[0] + reach_m, place[1] + reach_m)
        while True:
            lines = self._joined()
            distances = [distance_m(lines[i].xyz[:, :2], place) for i in range(len(lines))]
            if not distances or min(distances) > reach_m:
                return None
            i = int(np.argmin(distances))
            if lines.kind[i] in UNCUT_AT_SEAMS:
                return lines.take([i]), float(distances[i])
            ends = lines[i].xyz[[0, -1], :2]
            n = len(self._tiles)
            for x, y in ends.tolist():
                # A line that ends on the edge of a core may continue in the next tile
                self._search(x - _AROUND_END_M, y - _AROUND_END_M, x + _AROUND_END_M, y + _AROUND_END_M)
            if len(self._tiles) == n or n >= MOST_TILES:
                return lines.take([i]), float(distances[i])

    def lines_about(self, places: FloatArray) -> LineSet:
        """Return the lines in the tiles that hold places (n, 2) [m, world], and in those searched before."""
        for x, y in places.tolist():
            self._search(x, y, x, y)
        return self._joined()

    def each_once_about(self, places: FloatArray) -> LineSet:
        """Return the lines as `lines_about`, wires from the tile of their middle alone: several tiles may find them."""
        self.lines_about(places)
        cores = {tile: _core(*tile) for tile in self._tiles}
        return LineSet.concatenate([inside_core(lines, cores[tile]) for tile, lines in self._tiles.items()])

    def _joined(self) -> LineSet:
        cores = [_core(*tile) for tile in self._tiles]
        return join_seams(LineSet.concatenate(self._tiles.values()), cores)

    def _search(self, west: float, south: float, east: float, north: float) -> None:
        for row in range(math.floor(south / CORE_M), math.floor(north / CORE_M) + 1):
            for col in range(math.floor(west / CORE_M), math.floor(east / CORE_M) + 1):
                if (col, row) not in self._tiles:
                    self._tiles[col, row] = self._lines(_core(col, row))

    def _lines(self, core: Bounds) -> LineSet:
        extent = core.grown(self._method.buffer_m)
        if self._store.count_in(core) == 0:
            return LineSet.empty()
        surface, lowest, above_m = self._surface.over(extent), None, 0.0
        # Points are left out by the ground below their cell of the store: cells of the surface must hold whole ones
        if math.isfinite(self._method.least_height_m) and surface.grid.cell_width_m % STORE_CELL_M == 0.0:
            lowest = Image(surface.ground_m, surface.grid)
            above_m = surface.z0_m + self._method.least_height_m
        points = self._store.points(extent, lowest=lowest, above_m=above_m)
        if len(points) == 0:
            return LineSet.empty()
        tile = TileData("trace", core, points, None, "", surface, self._origin)
        lines = self._method.look(tile)
        lines = lines.take(np.isin(lines.kind, self._method.kinds))  # without poles
        # A line that is never cut belongs to the tile of its middle, where the place need not be: all are kept
        is_whole = np.isin(lines.kind, UNCUT_AT_SEAMS)
        return LineSet.concatenate([lines.take(is_whole), inside_core(lines.take(~is_whole), core)])


def distance_m(line: FloatArray, place: FloatArray) -> float:
    """Return the distance [m] of a place (2,) from a line (n, 2), in plan.

    >>> distance_m(np.array([[0.0, 0.0], [10.0, 0.0]]), np.array([5.0, 2.0]))
    2.0
    """
    a, step = line[:-1], np.diff(line, axis=0)
    length2 = np.maximum(np.sum(step * step, axis=1), 1e-12)
    share = np.clip(np.sum((place - a) * step, axis=1) / length2, 0.0, 1.0)
    return float(np.linalg.norm(a + share[:, None] * step - place, axis=1).min())


def _core(col: int, row: int) -> Bounds:
    return Bounds(col * CORE_M, row * CORE_M, (col + 1) * CORE_M, (row + 1) * CORE_M)
