"""What the road and the ground of an area cost on disk, known before anything of them is written.

Separate from `surface`, which makes them: this only counts. The bounds follow from how cells are packed
(`linework.files.store.packed_cells`): empty ones cost nothing, so points decide, and not the area around them.
"""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from linework.arrays import IntArray
from linework.errors import InputError, MachineError, argument
from linework.files.output.publish import machine_errors
from linework.files.store.cell_tiles import SurfaceTiles, TileNumber
from linework.files.store.packed_cells import END_BYTES
from linework.model.grid import Bounds
from linework.surface.blocks import N_BLOCK_PLANES
from linework.surface.cells import SURFACE_BLOCK_M, CellWindow
from linework.surface.config import RoadConfig

#: Bytes of a cell in each plane: height, spread and number of points, as measured and without strays; two labels;
#: road, ground, kind and sigma.
_CELLS, _LABELS, _SURFACE = (4, 4, 4), (4, 4), (4, 4, 1, 2)
#: Bytes of a block of cells in each plane: lowest heights, and number of known cells.
_BLOCK = (4,) * N_BLOCK_PLANES
#: Bytes of a cell along an edge, and cells of all edges in sides of a tile: two cells deep.
_EDGE_BYTES, _EDGE_SIDES = 20, 8
#: Stretches of a row of the surface that one cell with points adds: its own, and the crease that averages
#: make against the next, 2 m wide.
_CREASE_STRETCHES = 6
#: Bytes of a file without its planes: array headers, and half a block of the file system.
_FILE_BYTES = 4096
#: Bytes of a point in the store: key, time and intensity.
_POINT_BYTES = 18
#: An area is out of proportion when its surface takes this much, and this many times the bytes of its points: 20
#: points on each square metre of road take 2 times their bytes, one on each metre of road 1,000 times, and then
#: there is no line to be found in them.
_MUCH_BYTES, _PROPORTION = 1_000_000_000, 3000
#: Share of the bounds that a surface takes at least: roads recorded from the air took 0.2, points 1 km apart 0.02, but
#: those are out of proportion before. Where that does not fit, the whole will not.
_LEAST_SHARE = 0.1


class SurfaceCost(NamedTuple):
    """Upper bounds.

    Parameters
    ----------
    n_tiles
        Tiles of cells that the surface may cover.
    n_files, n_bytes
        Files while it is made, and their size.
    """

    n_tiles: int
    n_files: int
    n_bytes: int


def tiles_with_points(
    blocks: IntArray, counts: IntArray, tiles: SurfaceTiles, config: RoadConfig, margin: int
) -> dict[TileNumber, int]:
    """Return the tiles with cells of blocks or within a margin of them [cells], in order, and the points of those blocks.

    Parameters
    ----------
    blocks, counts
        (n, 2) int64 numbers east and north of blocks of 64 m, and (n,) points in each.
    """
    found: Counter[TileNumber] = Counter()
    corners = (np.asarray(blocks) * SURFACE_BLOCK_M).tolist()
    for (east, north), n in zip(corners, np.asarray(counts).tolist(), strict=True):
        block = Bounds(east, north, east + SURFACE_BLOCK_M, north + SURFACE_BLOCK_M)
        for tile in tiles.touching(CellWindow.over(block, config.cell_m).grown(margin)):
            found[tile] += n
    return dict(sorted(found.items()))


def surface_cost(
    occupied: Iterable[int], reached: Iterable[int], n_cells: int, sizes: Sequence[int]
) -> SurfaceCost:
    """Return what a surface costs at most.

    Parameters
    ----------
    occupied, reached
        Points of each tile that holds some, and of each that is close enough to have a surface.
    n_cells
        Rows and columns of a tile.
    sizes
        Sides of the blocks whose heights are kept beside those of cells. [cells]
    """
    n_tiles = n_files = n_bytes = 0
    for n in occupied:
        # Each cell with points ends two stretches: the empty cells before it, and itself
        n_files += 5
        n_bytes += 5 * _FILE_BYTES
        n_bytes += _at_most(2 * n + 1, (*_CELLS, *_CELLS, *_LABELS), n_cells**2)
        # A tile may begin and end within a block
        n_bytes += sum(_at_most(2 * n + 1, _BLOCK, (n_cells // size + 2) ** 2) for size in sizes)
        n_bytes += _at_most(2 * n + 4, (_EDGE_BYTES,), _EDGE_SIDES * n_cells)
    for n in reached:
        # Far from all cells with points, heights change from block to block: at most 4 in a row
        n_tiles += 1
        n_files += 1
        n_bytes += _FILE_BYTES + _at_most(n_cells * (4 + _CREASE_STRETCHES * n), _SURFACE, n_cells**2)
    return SurfaceCost(n_tiles, n_files, n_bytes)


def check_surface_cost(cost: SurfaceCost, n_points: int, area: tuple[float, float], folder: Path) -> None:
    """Refuse a surface that its points are not worth, or that the disk has no room for.

    Parameters
    ----------
    n_points
        Of the survey.
    area
        Its extent east and north. [m]

    Raises
    ------
    InputError
        The area is out of proportion.
    MachineError
        The disk lacks the room.
    """
    east_km, north_km = (size / 1000.0 for size in area)
    size = f"{n_points:,} points over {east_km:,.3g} x {north_km:,.3g} km"
    needed = f"{cost.n_tiles:,} tiles, {cost.n_files:,} files and up to {cost.n_bytes / 1e9:.3g} GB of disk"
    if cost.n_bytes > max(_MUCH_BYTES, _PROPORTION * _POINT_BYTES * n_points):
        raise InputError(
            f"{size} are too far apart for lines: their ground would take {needed}", where="points",
            advice="check the scale and the CRS of the files with linework info, or extract a part of the survey",
        )  # fmt: skip
    with machine_errors(folder):
        usage = shutil.disk_usage(folder)
    # Some network disks report no size at all
    if usage.total and _LEAST_SHARE * cost.n_bytes > usage.free:
        raise MachineError(
            f"the ground below {size} needs {needed}, {usage.free / 1e9:.3g} GB are free", where=folder,
            advice=f"free some space, or name a folder on another disk with {argument('work', 'DIR')}",
        )  # fmt: skip


def _at_most(n_stretches: int, planes: tuple[int, ...], n_cells: int) -> int:
    """Return the bytes of planes, packed or as they are."""
    return sum(min(n_stretches * (END_BYTES + n), n_cells * n) for n in planes)
