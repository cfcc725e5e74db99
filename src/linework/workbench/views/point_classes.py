"""The plan view coloured by the class of each point: road, footway, verge, marking, kerb and what stands there.

Separate from `tiles`, because classes depend on the lines, which change while one works: nothing is kept on disk.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.files.store.read import PointStore
from linework.kernels.cells import tile_cells as kernels
from linework.methods.classes.pieces import RoadPieces
from linework.methods.classes.point_class import PointClass
from linework.methods.classes.tile import PLAN_MARGIN_M, STANDING_MARGIN_M, tile_classes
from linework.model.lines import REJECTED_REVIEW, LineSet
from linework.runs.opened.surface import SurveySurface
from linework.surface.cells import path_samples
from linework.workbench.server.pictures import CLASS_COLOURS
from linework.workbench.views.layers import FILL_CELLS, FILL_M, margin_cells
from linework.workbench.views.pyramid import FINEST, TILE_BLOCK_M, TILE_PX, MapTile
from linework.workbench.views.tile_colours import indexed_png
from linework.workbench.worker.session import SurveySession

#: Most points of a picture: they are classified in a second or two.
MOST_CLASSIFIED = 4_000_000
#: Blocks that are kept, of 16 MB each.
_N_KEPT = 8
#: Cells of the finest level along a block, and samples of the vehicle's path. [1, m]
_BLOCK_CELLS, _PATH_STEP_M = TILE_PX << -FINEST, 0.5
#: Margin of lines around a tile [m]: boundaries that end within 30 m of one another are one.
_LINES_M = PLAN_MARGIN_M + 30.0


def lines_near_tile(lines: LineSet, tile: MapTile) -> LineSet:
    """Return the lines that the classes of a tile depend on; rejected ones count for nothing."""
    block = _blocks_of(tile)
    around = [b.bounds.grown(_LINES_M) for b in (block[0], block[-1])]
    low = np.array([around[0].west, around[0].south])
    high = np.array([around[1].east, around[1].north])
    inside = ((lines.xyz[:, :2] >= low) & (lines.xyz[:, :2] <= high)).all(axis=1)
    owner = np.repeat(np.arange(len(lines)), np.diff(lines.offsets))
    near = np.bincount(owner[inside], minlength=len(lines)) > 0
    return lines.take(np.flatnonzero(near & (lines.review != REJECTED_REVIEW)))


def class_tile_png(session: SurveySession, tile: MapTile, lines: LineSet) -> bytes:
    """Return the PNG of the classes of a tile, b"" for a tile without points, or with more than can be classified.

    Parameters
    ----------
    lines
        Those near the tile (`lines_near_tile`), in the CRS of the survey.
    """
    points, surface = session.recordings.points, session.surface
    if points is None or surface is None:
        return b""
    blocks = _blocks_of(tile)
    if sum(points.points.count_in(block.bounds) for block in blocks) > MOST_CLASSIFIED:
        return b""
    path = session.recordings.trajectory
    places = None if path is None else np.ascontiguousarray(path_samples(path, _PATH_STEP_M)[:, :2])
    kept = session.keep("class blocks", lambda: ClassBlocks(points.points, surface, places))
    shrink = 1 << (tile.level - FINEST)
    if tile.level >= 0:
        n = _BLOCK_CELLS // shrink
        ranks = np.zeros((TILE_PX, TILE_PX), np.uint8)
        for block in blocks:
            row = TILE_PX - n - (block.north - blocks[0].north) * n
            col = (block.east - blocks[0].east) * n
            ranks[row : row + n, col : col + n] = _shrunk(kept.ranks(block, lines), shrink)
        margin = 0
    else:
        margin, fine = margin_cells(tile), _shrunk(kept.ranks(blocks[0], lines), shrink)
        part = np.pad(fine, margin)
        per_block = len(fine) // TILE_PX
        row = (per_block - 1 - tile.north % per_block) * TILE_PX
        col = tile.east % per_block * TILE_PX
        ranks = part[row : row + TILE_PX + 2 * margin, col : col + TILE_PX + 2 * margin]
    nearest = kernels.nearest_known_index(ranks > 0, max(FILL_M / tile.cell_m, FILL_CELLS))
    filled = np.where(nearest >= 0, np.ascontiguousarray(ranks).ravel()[np.maximum(nearest, 0)], 0)
    inner = filled.reshape(ranks.shape)[margin : margin + TILE_PX, margin : margin + TILE_PX]
    return indexed_png(np.ascontiguousarray(inner, dtype=np.uint8), _PALETTE) if inner.any() else b""


class ClassBlocks:
    """Classes of the points of blocks of 64 m on their finest cells; those that were wanted last are kept."""

    def __init__(self, store: PointStore, surface: SurveySurface, path: FloatArray | None) -> None:
        self._store, self._surface, self._path = store, surface, path
        self._kept: OrderedDict[tuple[int, int, str], AnyArray] = OrderedDict()

    def ranks(self, block: MapTile, lines: LineSet) -> AnyArray:
        """Return the place in `CLASS_COLOURS`, from 1, of what each cell of a block shows, (n, n) uint8; 0: no points."""
        near = lines_near_tile(lines, block)
        key = (block.east, block.north, _mark_of(near))
        if key in self._kept:
            self._kept.move_to_end(key)
        else:
            self._kept[key] = self._found(block, near)
            while len(self._kept) > _N_KEPT:
                self._kept.popitem(last=False)
        return self._kept[key]

    def _found(self, block: MapTile, lines: LineSet) -> AnyArray:
        core = block.bounds
        points = self._store.points(
            core.grown(STANDING_MARGIN_M), ordered=False, with_time=False, with_columns=False
        )
        ranks = np.zeros((_BLOCK_CELLS, _BLOCK_CELLS), np.uint8)
        if len(points) == 0:
            return ranks
        path = np.zeros((0, 2)) if self._path is None else self._path
        made = tile_classes(
            core, self._surface.over(core.grown(PLAN_MARGIN_M)), points, RoadPieces.of(lines), path,
            has_path=self._path is not None,
        )  # fmt: skip
        xyz = np.ascontiguousarray(points.xyz)
        cell = np.floor((xyz[:, :2] - (core.west, core.south)) * (_BLOCK_CELLS / TILE_BLOCK_M)).astype(
            np.int64
        )
        own = np.flatnonzero(((cell >= 0) & (cell < _BLOCK_CELLS)).all(axis=1))
        intensity = np.zeros(len(xyz), np.float32) if points.intensity is None else points.intensity
        classes, line = np.zeros(len(xyz), np.uint8), np.zeros(len(xyz), np.uint32)
        made.classify(xyz, intensity, own, classes, line)
        np.maximum.at(ranks, (_BLOCK_CELLS - 1 - cell[own, 1], cell[own, 0]), _RANK[classes[own]])
        return ranks


def _blocks_of(tile: MapTile) -> list[MapTile]:
    """Return the blocks of 64 m that a tile consists of, or the one that it lies in, from the south-west."""
    if tile.level <= 0:
        return [MapTile(0, tile.east >> -tile.level, tile.north >> -tile.level)]
    n = 1 << tile.level
    west, south = tile.east * n, tile.north * n
    return [MapTile(0, west + i, south + j) for j in range(n) for i in range(n)]


def _shrunk(ranks: AnyArray, by: int) -> AnyArray:
    """Return square cells joined by the highest of each square of `by` cells."""
    n = len(ranks) // by
    joined: AnyArray = ranks.reshape(n, by, n, by).max(axis=(1, 3))
    return joined


def _mark_of(lines: LineSet) -> str:
    """Return a mark that differs where lines differ that classes depend on."""
    made_of = hashlib.sha256(lines.xyz.tobytes())
    for column in (lines.offsets, lines.width_m):
        made_of.update(column.tobytes())
    made_of.update(repr((lines.kind.tolist(), lines.form.tolist())).encode())
    return made_of.hexdigest()


_RANK = np.zeros(len(PointClass), np.uint8)
_RANK[[kind for kind, _, _ in CLASS_COLOURS]] = np.arange(1, len(CLASS_COLOURS) + 1)
_PALETTE = np.zeros((256, 3), np.uint8)
_PALETTE[1 : len(CLASS_COLOURS) + 1] = [
    [int(colour[k : k + 2], 16) for k in (1, 3, 5)] for _, _, colour in CLASS_COLOURS
]
