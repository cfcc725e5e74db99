"""Tiles of cells on disk (road and ground surface, the workbench's images): arrays per tile, and shared ones."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from linework.arrays import AnyArray
from linework.files.array_file import ARRAY_SUFFIX, opened_arrays, write_arrays
from linework.files.documents import read_json
from linework.files.output.publish import machine_errors
from linework.files.output.replace import make_durable, replace_file
from linework.files.store.packed_cells import packed_plane, plane_rows
from linework.surface.cells import CellWindow

#: Number of a tile east and north.
TileNumber = tuple[int, int]
#: Written last: a folder that holds it holds a whole surface.
_RECORD = "surface.json"


@dataclass(frozen=True, slots=True)
class SurfaceTiles:
    """A folder with files of named arrays, one file for each tile of cells.

    Parameters
    ----------
    folder
        Where the files are.
    n_cells
        Size of a tile, in rows and columns.
    origin
        Numbers east and north of the first cell of tile (0, 0).
    """

    folder: Path
    n_cells: int
    origin: tuple[int, int] = (0, 0)

    def window(self, tile: TileNumber) -> CellWindow:
        """Return the cells of a tile."""
        west, south = (o + number * self.n_cells for o, number in zip(self.origin, tile, strict=True))
        return CellWindow(west, south, self.n_cells, self.n_cells)

    def touching(self, window: CellWindow) -> Iterator[TileNumber]:
        """Yield the numbers of the tiles that share cells with a window, whether they exist or not."""
        (o_east, o_north), n = self.origin, self.n_cells
        for north in range((window.south - o_north) // n, (window.north - 1 - o_north) // n + 1):
            for east in range((window.west - o_east) // n, (window.east - 1 - o_east) // n + 1):
                yield east, north

    def write(self, name: str, tile: TileNumber, *arrays: AnyArray) -> None:
        """Write arrays of a tile, whole or not at all."""
        parts = [part for values in arrays for part in packed_plane(values)]
        self.write_common(_tile_name(name, tile), *parts)

    def has(self, name: str, tile: TileNumber) -> bool:
        """Return whether a tile has arrays of this name."""
        return self._path(_tile_name(name, tile)).exists()

    def read(self, name: str, tile: TileNumber, first: int = 0) -> tuple[AnyArray, ...]:
        """Return the arrays of a tile, from the first that is wanted.

        Raises
        ------
        FileNotFoundError
            The tile has none of this name.
        MachineError
            The file is damaged.
        """
        with opened_arrays(self._path(_tile_name(name, tile))) as arrays:
            return tuple(plane_rows(arrays, which) for which in range(first, arrays.n_arrays // 2))

    def part(self, name: str, which: int, tile: TileNumber, window: CellWindow) -> AnyArray | None:
        """Return the cells of one array of a tile that lie in a window; None where the tile lacks this name.

        Raises
        ------
        MachineError
            The file is damaged.
        """
        own = self.window(tile)
        shared = own.common(window)
        if shared is None:
            return None
        rows, cols = own.part(shared)
        try:
            with opened_arrays(self._path(_tile_name(name, tile))) as arrays:
                return np.ascontiguousarray(plane_rows(arrays, which, rows)[:, cols])
        except FileNotFoundError:
            return None

    def over(self, name: str, which: int, window: CellWindow, empty: Any) -> AnyArray:
        """Return one of the arrays over a window, put together from the tiles.

        Parameters
        ----------
        empty
            Value of cells without a tile; its type is the result's.

        Raises
        ------
        MachineError
            A file is damaged.
        """
        out = np.full(window.shape, empty)
        for tile in self.touching(window):
            values = self.part(name, which, tile, window)
            if values is not None:
                out[self.place(tile, window)] = values
        return out

    def place(self, tile: TileNumber, window: CellWindow) -> tuple[slice, slice]:
        """Return the slices of a window's array that a tile covers."""
        shared = self.window(tile).common(window)
        return window.part(shared) if shared else (slice(0), slice(0))

    def write_common(self, name: str, *arrays: AnyArray) -> None:
        """Write arrays shared by all tiles, whole or not at all."""
        write_arrays(self._path(name), *arrays)

    def read_common(self, name: str) -> tuple[AnyArray, ...]:
        """Return arrays shared by all tiles.

        Raises
        ------
        FileNotFoundError
            There are none of this name.
        MachineError
            The file is damaged.
        """
        with opened_arrays(self._path(name)) as arrays:
            return arrays.all()

    def keep_only(self, *names: str) -> None:
        """Make the arrays of these names durable and remove all others."""
        for path in self.folder.glob(f"*{ARRAY_SUFFIX}"):
            if path.name.split(".")[0] in names:
                make_durable(path)
            else:
                path.unlink(missing_ok=True)

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}{ARRAY_SUFFIX}"


def _tile_name(name: str, tile: TileNumber) -> str:
    return f"{name}.e{tile[0]}n{tile[1]}"


def clear_surface(folder: Path) -> None:
    """Make the folder, and remove what an earlier or unfinished pass left in it."""
    with machine_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / _RECORD).unlink(missing_ok=True)
        for path in folder.glob(f"*{ARRAY_SUFFIX}"):
            path.unlink(missing_ok=True)


def write_surface_record(folder: Path, record: Mapping[str, Any]) -> None:
    """Write the record that marks a surface as whole, and says what it was made from.

    Raises
    ------
    MachineError
        The folder is full, read-only or gone.
    """
    replace_file(folder / _RECORD, json.dumps(record, indent=1).encode())


def read_surface_record(folder: Path) -> dict[str, Any] | None:
    """Return the record of a surface, or None where there is no whole surface."""
    try:
        record = read_json((folder / _RECORD).read_text(encoding="utf-8"), folder)
    except (OSError, ValueError):
        return None
    return record if isinstance(record, dict) else None
