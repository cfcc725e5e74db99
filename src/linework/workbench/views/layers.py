"""Raster layers of a map tile, from points or from the tiles below it, before they become a picture.

Separate from `cells`, which keeps them in memory and on disk.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from linework.arrays import AnyArray
from linework.kernels.cells import tile_cells as kernels
from linework.workbench.views.patches import PatchReader
from linework.workbench.views.pyramid import TILE_PX, MapTile

#: Distance within which a cell without points is shown as the nearest one: points beside the van are closer. [m]
FILL_M = 0.15
#: The least such distance, in cells, for coarse ones.
FILL_CELLS = 1.5
#: Span over which slopes of fine cells are smoothed; the margin of a tile includes half of it. [m]
SLOPE_SPAN_M = 0.2
#: Kept as float16: densities up to this [1/m2], and intensities divided by this, which fit its range.
_MOST_DENSE, _FULL = 60_000.0, 16.0


class TileLayers(NamedTuple):
    """Raster layers (n_rows, n_cols) of a tile, row 0 north; NaN, and density 0, in cells without points.

    Parameters
    ----------
    density
        Number of points per area. [1/m2]
    ground, stands
        Height of the ground above the survey's height origin, and of objects above the ground. [m]
    above
        Height above the road of the highest point that is not above lorries. [m]
    bright
        Mean intensity of the ground, as recorded.
    """

    density: AnyArray
    ground: AnyArray
    stands: AnyArray
    above: AnyArray
    bright: AnyArray

    @property
    def n_bytes(self) -> int:
        """Memory of the layers. [bytes]"""  # noqa: D400
        return sum(layer.nbytes for layer in self)

    def packed(self) -> TileLayers:
        """Return the layers in 12 bytes a cell: the ground as it is, the rest as float16, to a thousandth."""
        half = np.float16
        return TileLayers(
            np.minimum(self.density, _MOST_DENSE).astype(half), self.ground, self.stands.astype(half),
            self.above.astype(half), (self.bright / _FULL).astype(half),
        )  # fmt: skip

    def unpacked(self) -> TileLayers:
        """Return packed layers as float32."""
        whole = TileLayers(*(layer.astype(np.float32) for layer in self))
        return whole._replace(bright=whole.bright * np.float32(_FULL))

    def part(self, rows: slice, cols: slice) -> TileLayers:
        """Return a rectangle of the cells."""
        return TileLayers(*(layer[rows, cols] for layer in self))


def margin_cells(tile: MapTile) -> int:
    """Return the width of the margin that a tile's picture depends on, in cells: 0 where cells are coarse."""
    return math.ceil((FILL_M + 0.5 * SLOPE_SPAN_M) / tile.cell_m) if tile.level < 0 else 0


def layers_from_points(reader: PatchReader, tile: MapTile, *, keep: bool) -> TileLayers:
    """Return the layers of a tile with its margin, from points, in whatever order they come."""
    margin = margin_cells(tile)
    n, bounds = TILE_PX + 2 * margin, tile.bounds.grown(margin * tile.cell_m)
    sums = kernels.no_sums(n, n)
    for patch in reader.patches(bounds, keep=keep):
        corner = bounds.west - patch.corner[0], bounds.south - patch.corner[1]
        kernels.add_points(patch.columns, corner, tile.cell_m, sums)
    return TileLayers(*kernels.layers_of(sums, tile.cell_m))


def layers_from_children(children: list[TileLayers | None]) -> TileLayers:
    """Return the layers of a tile from those of its four children; None: a child without points."""
    shape = (TILE_PX, TILE_PX)
    out = TileLayers(np.zeros(shape, np.float32), *(np.full(shape, np.nan, np.float32) for _ in range(4)))
    for k, child in enumerate(children):
        if child is not None:
            kernels.join_cells(tuple(child), tuple(out), (k // 2) * TILE_PX // 2, (k % 2) * TILE_PX // 2)
    return out


def fill_between_points(layers: TileLayers, cell_m: float) -> TileLayers:
    """Return layers with empty cells filled from the nearest cell within `FILL_M`."""
    reach = max(FILL_M / cell_m, FILL_CELLS)
    known = layers.density > 0
    nearest = kernels.nearest_known_index(known, reach)
    is_near = nearest >= 0
    out = []
    for layer in layers:
        values = layer.ravel()[np.maximum(nearest, 0)]
        values[~is_near] = 0.0 if layer is layers.density else np.nan
        out.append(values)
    return TileLayers(*out)
