"""Requests to the pictures worker: the picture of a tile, and one step towards preparing all of them."""

from __future__ import annotations

import hashlib
from contextlib import suppress
from pathlib import Path

from linework.errors import MachineError, UsageError
from linework.runs.resume import source_hash
from linework.workbench.views.cells import TileCells, cells_folder
from linework.workbench.views.layers import TileLayers, fill_between_points, margin_cells
from linework.workbench.views.patches import PatchReader
from linework.workbench.views.pyramid import IMAGES, TILE_PX, Lattice, MapTile
from linework.workbench.views.tile_colours import ColourScale, tile_picture
from linework.workbench.worker.session import SurveySession

#: Names of the images.
_NAMES = tuple(name for name, _, _ in IMAGES)
#: Finest level whose density is counted, with cells of 1/8 m: finer ones hold one point or none.
DENSITY_LEVEL = -1


def tile_png(session: SurveySession, image: str, tile: MapTile) -> bytes:
    """Return the PNG of an image of a tile, b"" for a tile without points.

    Raises
    ------
    UsageError
        There is no such image.
    """
    if image not in _NAMES:
        raise UsageError(f"no image {image[:40]!r}", advice=f"choose from {', '.join(_NAMES)}")
    cells = tile_cells(session)
    if cells is None:
        return b""
    layers = density_layers(cells, tile) if image == "density" else cells.layers(tile)[0]
    if layers is None:
        return b""
    if image == "density":
        return tile_picture(image, layers, cells.scale, tile.cell_m, 0)
    return tile_picture(
        image, fill_between_points(layers, tile.cell_m), cells.scale, tile.cell_m, margin_cells(tile)
    )


def density_layers(cells: TileCells, tile: MapTile) -> TileLayers | None:
    """Return the layers of a tile for its density; of a finer tile the enlarged ones of `DENSITY_LEVEL`."""
    up = max(0, DENSITY_LEVEL - tile.level)
    coarser = MapTile(tile.level + up, tile.east >> up, tile.north >> up)
    layers, _ = cells.layers(coarser)
    if layers is None:
        return None
    margin, n = margin_cells(coarser), TILE_PX >> up
    col = margin + (tile.east - (coarser.east << up)) * n
    row = margin + TILE_PX - n - (tile.north - (coarser.north << up)) * n
    part = layers.part(slice(row, row + n), slice(col, col + n))
    return TileLayers(*(layer.repeat(1 << up, axis=0).repeat(1 << up, axis=1) for layer in part))


def prepare_tiles(session: SurveySession) -> tuple[int, int]:
    """Make one more of the tiles to be kept on disk; return the number made, and of all, 0 and 0 when all are made."""
    cells = tile_cells(session)
    if cells is None or not cells.go_on():
        return 0, 0
    return cells.n_done, cells.n_all


def patch_reader(session: SurveySession) -> PatchReader | None:
    """Return the reader of the survey's points, one for all requests; None without points."""
    points = session.recordings.points
    if points is None:
        return None

    def read() -> PatchReader:
        path = session.recordings.trajectory
        return PatchReader(points.points, session.surface, None if path is None else path.xyz[:, :2])

    return session.keep("patch reader", read)


def tile_cells(session: SurveySession) -> TileCells | None:
    """Return the cells of all tiles, one object for all requests; None without points."""
    reader = patch_reader(session)
    if reader is None:
        return None
    coarsest = Lattice.of(reader.store.bounds).coarsest
    return session.keep("tile cells", lambda: TileCells(reader, _folder(reader), coarsest))


def picture_scale(session: SurveySession) -> ColourScale | None:
    """Return the colour scale of all pictures of the survey; None without points."""
    cells = tile_cells(session)
    return None if cells is None else cells.scale


def _folder(reader: PatchReader) -> Path | None:
    """Return the folder of kept cells, named by the surface they show and by the code that makes them; or None."""
    surface = reader.surface
    name = surface.tiles.folder.name if surface is not None else ""
    made_of = name + source_hash("kernels", "files", "surface", "workbench")
    # If the disk cannot be written, each picture is made when it is requested
    with suppress(MachineError):
        return cells_folder(reader.store.folder, hashlib.sha256(made_of.encode()).hexdigest()[:16])
    return None
