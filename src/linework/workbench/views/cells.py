"""Layers of all tiles: made from points or from the four tiles below, cached in memory and on disk.

Separate from `tiles`, because it is the cache below all requests for tiles.
"""

from __future__ import annotations

import shutil
import time
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import astuple, fields
from pathlib import Path

import numpy as np

from linework.errors import MachineError
from linework.files.output.publish import machine_errors
from linework.files.store.cell_tiles import SurfaceTiles
from linework.kernels.cells.tile_cells import GROUND_M
from linework.workbench.views.layers import TileLayers, layers_from_children, layers_from_points
from linework.workbench.views.patches import PatchReader
from linework.workbench.views.pyramid import TILE_PX, MapTile
from linework.workbench.views.tile_colours import ColourScale

#: Format of the kept cells; raise it when those of older versions must not be used.
_VERSION = 2
#: Memory of the cells that are kept. [bytes]
CELLS_CACHE_BYTES = 64 << 20
#: Time to make missing parts of a coarse tile; then it is shown without them. [s]
PATIENCE_S = 0.15


class TileCells:
    """Layers of every tile of a survey.

    Parameters
    ----------
    folder
        Folder for levels above 0 and the colour scale; None: nothing is kept on disk.
    coarsest
        Highest level.

    Notes
    -----
    A tile of a level above 0 is complete once all below it are, and only then is it kept on disk. A tile has the same
    values however it was made.
    """

    def __init__(self, reader: PatchReader, folder: Path | None, coarsest: int) -> None:
        self.reader, self.coarsest = reader, coarsest
        self._disk = SurfaceTiles(folder, TILE_PX) if folder is not None else None
        self._kept: OrderedDict[MapTile, TileLayers] = OrderedDict()
        self._n_bytes = 0
        self._occupied = _occupied(reader, coarsest)
        self._order = self._from_below()
        self.n_done, self.n_all = 0, sum(len(tiles) for level, tiles in self._occupied.items() if level > 0)
        self.scale = self._scale()

    def layers(self, tile: MapTile, patience_s: float = PATIENCE_S) -> tuple[TileLayers | None, bool]:
        """Return the layers of a tile (None: it has no points), and whether they are complete."""
        if tile.level <= 0:
            return self._fine(tile), True
        return self._coarse(tile, time.monotonic() + patience_s)

    def go_on(self) -> bool:
        """Make one more of the tiles to be kept, from the finest up; return whether one was left."""
        for tile in self._order:
            self.n_done += 1
            if tile not in self._kept and not self._is_on_disk(tile):
                self._coarse(tile, float("inf"))
                return True
        return False

    def _fine(self, tile: MapTile) -> TileLayers | None:
        if not self._has_points(tile):
            return None
        if tile.level < 0:
            return layers_from_points(self.reader, tile, keep=True)
        found = self._recalled(tile)
        return found or self._remember(tile, layers_from_points(self.reader, tile, keep=False))

    def _coarse(self, tile: MapTile, until_s: float) -> tuple[TileLayers | None, bool]:
        if tile not in self._occupied.get(tile.level, ()):
            return None, True
        found = self._recalled(tile) or self._from_disk(tile)
        if found is not None:
            return found, True
        children, is_whole = [], True
        for child in tile.children:
            if child.level > 0:
                cells, is_child_whole = self._coarse(child, until_s)
            elif time.monotonic() < until_s:
                cells, is_child_whole = self._fine(child), True
            else:
                cells, is_child_whole = None, child not in self._occupied[0]
            children.append(cells)
            is_whole &= is_child_whole
        made = layers_from_children(children)
        if is_whole:
            made = self._remember(tile, made)
            self._to_disk(tile, made)
        return made, is_whole

    def _has_points(self, tile: MapTile) -> bool:
        """Return whether a tile of level 0 or below may show points; a finer one includes a margin."""
        shift, reach = -tile.level, 1 if tile.level < 0 else 0
        east, north = tile.east >> shift, tile.north >> shift
        around = range(-reach, reach + 1)
        return any(MapTile(0, east + i, north + j) in self._occupied[0] for i in around for j in around)

    def _recalled(self, tile: MapTile) -> TileLayers | None:
        found = self._kept.get(tile)
        if found is None:
            return None
        self._kept.move_to_end(tile)
        return found.unpacked()

    def _remember(self, tile: MapTile, layers: TileLayers) -> TileLayers:
        """Keep the layers of a tile, and return them as they are kept, rounded, so that they are always the same."""
        packed = layers.packed()
        self._kept[tile] = packed
        self._n_bytes += packed.n_bytes
        while self._n_bytes > CELLS_CACHE_BYTES:
            self._n_bytes -= self._kept.popitem(last=False)[1].n_bytes
        return packed.unpacked()

    def _is_on_disk(self, tile: MapTile) -> bool:
        return self._disk is not None and self._disk.has(_name(tile), (tile.east, tile.north))

    def _from_disk(self, tile: MapTile) -> TileLayers | None:
        if self._disk is None:
            return None
        # Damaged files are replaced
        with suppress(FileNotFoundError, MachineError):
            arrays = self._disk.read(_name(tile), (tile.east, tile.north))
            if [array.shape for array in arrays] == [(TILE_PX, TILE_PX)] * len(TileLayers._fields):
                return self._remember(tile, TileLayers(*arrays).unpacked())
        return None

    def _to_disk(self, tile: MapTile, layers: TileLayers) -> None:
        # A full disk does not stop pictures
        if self._disk is not None:
            with suppress(MachineError):
                self._disk.write(_name(tile), (tile.east, tile.north), *layers.packed())

    def _scale(self) -> ColourScale:
        if self._disk is not None:
            with suppress(FileNotFoundError, MachineError):
                arrays = self._disk.read_common("scale")
                if [array.shape for array in arrays] == [(len(fields(ColourScale)),)]:
                    return ColourScale(*arrays[0].tolist())
        scale = measured_scale(self.reader)
        if self._disk is not None:
            with suppress(MachineError):
                self._disk.write_common("scale", np.array(astuple(scale)))
        return scale

    def _from_below(self) -> Iterator[MapTile]:
        """Yield the tiles above level 0, each after its children, neighbours close together."""

        def below(tile: MapTile) -> Iterator[MapTile]:
            if tile in self._occupied[tile.level] and tile.level > 0:
                for child in tile.children:
                    yield from below(child)
                yield tile

        for tile in sorted(self._occupied[self.coarsest]):
            yield from below(tile)


def cells_folder(store: Path, key: str) -> Path:
    """Create and return the folder for the cells of a store's tiles; those of other keys are removed.

    Raises
    ------
    MachineError
        It cannot be created.
    """
    folder = store / f"tiles-{_VERSION}-{key}"
    with machine_errors(folder):
        for other in store.glob("tiles-*"):
            if other != folder:
                shutil.rmtree(other, ignore_errors=True)
        folder.mkdir(exist_ok=True)
    return folder


def _occupied(reader: PatchReader, coarsest: int) -> dict[int, set[MapTile]]:
    """Return the tiles with points, level by level."""
    tiles = {MapTile(0, east, north) for east, north in reader.counts}
    found = {0: tiles}
    for level in range(1, coarsest + 1):
        tiles = {tile.parent for tile in tiles}
        found[level] = tiles
    return found


def _name(tile: MapTile) -> str:
    return f"level{tile.level}"


# One colour scale for all pictures of a survey, measured on a sample of its blocks

#: Number of blocks sampled evenly, and of points in each.
_N_BLOCKS, _N_POINTS = 12, 20_000
#: Quantiles of the road points' intensity: the darkest asphalt; and paint, which covers 2 to 5 % of a marked road.
_DARK, _PAINT = 0.03, 0.99
#: Least brightness of paint relative to asphalt: on a road without paint nothing must look like it.
_LEAST_PAINT = 2.0
#: Quantiles of the ground's height at both ends of the colours, and the least range between them [m].
_LOW, _HIGH, _LEAST_M = 0.01, 0.99, 8.0
#: Points within this height of the road are level with it: neither kerbs nor grass. [m]
_LEVEL_M = 0.03
#: The darkest road is at least this share of asphalt's intensity, so that the scale stays finite.
_LEAST_DARK = 0.1


def measured_scale(reader: PatchReader) -> ColourScale:
    """Return the colour scale of a survey, by the intensity of its road and the height of its ground."""
    blocks = sorted(reader.counts, key=lambda block: block[::-1])
    chosen = blocks[:: max(1, len(blocks) // _N_BLOCKS)]
    heights, brights = [], []
    for east, north in chosen:
        for patch in reader.patches(MapTile(0, east, north).bounds, keep=False):
            ground = np.flatnonzero(np.abs(patch.above) <= GROUND_M)
            if reader.surface is None or len(ground) == 0:
                ground = np.arange(len(patch))
            heights.append(np.sort(patch.z[ground])[:: _step(len(ground))])
            level = np.flatnonzero(np.abs(patch.above) <= _LEVEL_M)
            brights.append(np.sort(patch.intensity[level])[:: _step(len(level))])
    z = np.concatenate([np.zeros(0, np.float32), *heights])
    bright = np.concatenate([np.zeros(0, np.uint16), *brights])
    low, high = np.quantile(z, (_LOW, _HIGH)) if len(z) else (0.0, 0.0)
    high = max(high, low + _LEAST_M)
    dark, asphalt, paint = np.quantile(bright, (_DARK, 0.5, _PAINT)) if len(bright) else (1.0, 1.0, 1.0)
    asphalt = max(asphalt, 1.0)
    paint = max(paint, _LEAST_PAINT * asphalt)
    return ColourScale(
        float(max(dark, _LEAST_DARK * asphalt)), float(asphalt), float(paint), float(low), float(high)
    )


def _step(n: int) -> int:
    return max(1, n // _N_POINTS)
