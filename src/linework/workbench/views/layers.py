"""What is known of the cells of a tile, before it becomes a picture."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from linework.arrays import AnyArray
from linework.kernels.cells import tile_cells as kernels
from linework.workbench.views.patches import PatchReader
from linework.workbench.views.pyramid import TILE_PX, MapTile

#: Cells between points are shown as the nearest point within this: farther apart points do not lie beside the van. [m]
FILL_M = 0.15
#: And within so many cells, however coarse they are.
FILL_CELLS = 1.5
#: Slopes of fine cells are taken over so much; beside a tile so much is looked at, too. [m]
SLOPE_SPAN_M = 0.2
#: Kept in half the room: densities up to this [1/m2], intensities as parts of this.
_MOST_DENSE, _FULL = 60_000.0, 16.0


class TileLayers(NamedTuple):
    """Cells (n_rows, n_cols), row 0 north; NaN and density 0 where no point is.

    Parameters
    ----------
    density
        Points. [1/m2]
    ground, stands
        Height of the ground above the survey's height origin, and of what stands on it. [m]
    above
        Height above the road of the highest that a lorry does not pass under. [m]
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
        """Memory."""
        return sum(layer.nbytes for layer in self)

    def packed(self) -> TileLayers:
        """Return the same in 12 bytes a cell: heights as they are, the rest to a thousandth."""
        half = np.float16
        return TileLayers(
            np.minimum(self.density, _MOST_DENSE).astype(half), self.ground, self.stands.astype(half),
            self.above.astype(half), (self.bright / _FULL).astype(half),
        )  # fmt: skip

    def unpacked(self) -> TileLayers:
        """Return what was packed, float32."""
        whole = TileLayers(*(layer.astype(np.float32) for layer in self))
        return whole._replace(bright=whole.bright * np.float32(_FULL))

    def part(self, rows: slice, cols: slice) -> TileLayers:
        """Return some of the cells."""
        return TileLayers(*(layer[rows, cols] for layer in self))


def margin_cells(tile: MapTile) -> int:
    """Return how many cells beside a tile its picture depends on: none where cells are coarse."""
    return math.ceil((FILL_M + 0.5 * SLOPE_SPAN_M) / tile.cell_m) if tile.level < 0 else 0


def layers_from_points(reader: PatchReader, tile: MapTile, *, keep: bool) -> TileLayers:
    """Return the cells of a tile with its margin, from points. The order of the points does not matter."""
    margin = margin_cells(tile)
    n, bounds = TILE_PX + 2 * margin, tile.bounds.grown(margin * tile.cell_m)
    sums = kernels.no_sums(n, n)
    for patch in reader.patches(bounds, keep=keep):
        corner = bounds.west - patch.corner[0], bounds.south - patch.corner[1]
        kernels.add_points(patch.columns, corner, tile.cell_m, sums)
    return TileLayers(*kernels.layers_of(sums, tile.cell_m))


def layers_from_children(children: list[TileLayers | None]) -> TileLayers:
    """Return the cells of a tile from those of the four one level below; None: has no points."""
    shape = (TILE_PX, TILE_PX)
    out = TileLayers(np.zeros(shape, np.float32), *(np.full(shape, np.nan, np.float32) for _ in range(4)))
    for k, child in enumerate(children):
        if child is not None:
            kernels.join_cells(tuple(child), tuple(out), (k // 2) * TILE_PX // 2, (k % 2) * TILE_PX // 2)
    return out


def fill_between_points(layers: TileLayers, cell_m: float) -> TileLayers:
    """Return layers in which cells between points have what the nearest point within `FILL_M` has."""
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
