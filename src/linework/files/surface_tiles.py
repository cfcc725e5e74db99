"""The road's and the ground's surface on disk: arrays of tiles of cells, and a few for all of them."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from linework.errors import MachineError
from linework.files.publish import machine_errors
from linework.model.arrays import AnyArray
from linework.surface.cells import Window

#: A tile's number east and north.
TileNumber = tuple[int, int]
#: Written last: where it is, the surface is whole.
_RECORD = "surface.json"
_ADVICE = "linework clean removes the work folder, the next run makes it anew"


@dataclass(frozen=True, slots=True)
class SurfaceTiles:
    """A folder of arrays, named, one for each tile of cells.

    Parameters
    ----------
    folder
        Where the files are.
    n_cells
        Size of a tile, in rows and columns.
    origin
        Cell numbers east and north that a tile begins at.
    """

    folder: Path
    n_cells: int
    origin: tuple[int, int] = (0, 0)

    def window(self, tile: TileNumber) -> Window:
        """Return the cells of a tile."""
        west, south = (o + number * self.n_cells for o, number in zip(self.origin, tile, strict=True))
        return Window(west, south, self.n_cells, self.n_cells)

    def touching(self, window: Window) -> Iterator[TileNumber]:
        """Yield the numbers of the tiles that share cells with a window, whether they exist or not."""
        (o_east, o_north), n = self.origin, self.n_cells
        for north in range((window.south - o_north) // n, (window.north - 1 - o_north) // n + 1):
            for east in range((window.west - o_east) // n, (window.east - 1 - o_east) // n + 1):
                yield east, north

    def write(self, name: str, tile: TileNumber, values: AnyArray, *, durable: bool = False) -> None:
        """Write an array of a tile, whole or not at all; `durable`: the disk is asked to keep it."""
        self.write_common(_tile_name(name, tile), values, durable=durable)

    def read(self, name: str, tile: TileNumber) -> AnyArray | None:
        """Return an array of a tile, mapped into memory, or None where the tile has none."""
        try:
            return self.read_common(_tile_name(name, tile))
        except FileNotFoundError:
            return None

    def over(self, name: str, window: Window, empty: AnyArray) -> AnyArray:
        """Return an array over any cells, put together from those of the tiles.

        Parameters
        ----------
        empty
            () or (k,): the value, or those of k planes, where there is no tile.
        """
        out = np.empty((*empty.shape, *window.shape), dtype=empty.dtype)
        out[...] = empty[..., None, None]
        for tile in self.touching(window):
            own = self.window(tile)
            shared = own.common(window)
            values = self.read(name, tile) if shared else None
            if shared and values is not None:
                out[(..., *window.part(shared))] = values[(..., *own.part(shared))]
        return out

    def write_common(self, name: str, values: AnyArray, *, durable: bool = False) -> None:
        """Write an array that belongs to no tile."""
        path = self.folder / f"{name}.npy"
        part = path.with_suffix(".part")
        with machine_errors(path), part.open("wb") as file:
            np.save(file, values, allow_pickle=False)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        with machine_errors(path):
            part.replace(path)

    def read_common(self, name: str) -> AnyArray:
        """Return an array that belongs to no tile, mapped into memory."""
        path = self.folder / f"{name}.npy"
        try:
            return np.asarray(np.load(path, mmap_mode="r", allow_pickle=False))
        except (ValueError, EOFError) as error:
            raise MachineError(f"is damaged: {error}", where=path, advice=_ADVICE) from error

    def remove(self, *names: str) -> None:
        """Remove the arrays of these names of all tiles."""
        for path in self.folder.glob("*.npy"):
            if path.name.split(".")[0] in names:
                path.unlink(missing_ok=True)


def _tile_name(name: str, tile: TileNumber) -> str:
    return f"{name}.e{tile[0]}n{tile[1]}"


def clear_surface(folder: Path) -> None:
    """Remove what an earlier or unfinished pass has left in a folder, and make the folder."""
    with machine_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / _RECORD).unlink(missing_ok=True)
        for path in [*folder.glob("*.npy"), *folder.glob("*.part")]:
            path.unlink(missing_ok=True)


def write_surface_record(folder: Path, record: Mapping[str, Any]) -> None:
    """Write what tells that a surface is whole, and of what."""
    path = folder / _RECORD
    part = path.with_suffix(".part")
    with machine_errors(path):
        with part.open("w", encoding="utf-8") as file:
            json.dump(record, file, indent=1)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)


def read_surface_record(folder: Path) -> dict[str, Any] | None:
    """Return what `write_surface_record` wrote, or None where there is no whole surface."""
    try:
        record = json.loads((folder / _RECORD).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return record if isinstance(record, dict) else None
