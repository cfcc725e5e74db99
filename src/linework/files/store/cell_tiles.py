"""The road's and the ground's surface on disk: arrays of tiles of cells, and a few for all of them."""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from linework.arrays import AnyArray
from linework.errors import MachineError
from linework.files.output.publish import machine_errors
from linework.surface.cells import CellWindow

#: A tile's number east and north.
TileNumber = tuple[int, int]
#: Written last: where it is, the surface is whole.
_RECORD = "surface.json"
#: Files of arrays: one after the other as numpy writes them, each at a whole multiple of so many bytes.
_SUFFIX, _ALIGNED = ".arrays", 64
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
        self.write_common(_tile_name(name, tile), *arrays)

    def has(self, name: str, tile: TileNumber) -> bool:
        """Return whether a tile has arrays of this name."""
        return (self.folder / f"{_tile_name(name, tile)}{_SUFFIX}").exists()

    def read(self, name: str, tile: TileNumber) -> tuple[AnyArray, ...]:
        """Return the arrays of a tile.

        Raises
        ------
        FileNotFoundError
            The tile has none of this name.
        MachineError
            The file is damaged.
        """
        return self.read_common(_tile_name(name, tile))

    def part(self, name: str, which: int, tile: TileNumber, window: CellWindow) -> AnyArray | None:
        """Return of one of a tile's arrays the cells in a window; None where the tile has none of this name."""
        own = self.window(tile)
        shared = own.common(window)
        if shared is None:
            return None
        rows, cols = own.part(shared)
        try:
            with _opened(self.folder, _tile_name(name, tile)) as arrays:
                return np.ascontiguousarray(arrays.rows(which, rows.start, rows.stop)[:, cols])
        except FileNotFoundError:
            return None

    def over(self, name: str, which: int, window: CellWindow, empty: Any) -> AnyArray:
        """Return one of the arrays over any cells, put together from those of the tiles.

        Parameters
        ----------
        empty
            The value where there is no tile, of the arrays' type.
        """
        out = np.full(window.shape, empty)
        for tile in self.touching(window):
            values = self.part(name, which, tile, window)
            if values is not None:
                out[self.place(tile, window)] = values
        return out

    def place(self, tile: TileNumber, window: CellWindow) -> tuple[slice, slice]:
        """Return where in a window's array the cells lie that a tile shares with it."""
        shared = self.window(tile).common(window)
        return window.part(shared) if shared else (slice(0), slice(0))

    def write_common(self, name: str, *arrays: AnyArray) -> None:
        """Write arrays that belong to no tile."""
        path = self.folder / f"{name}{_SUFFIX}"
        part = path.with_suffix(".part")
        with machine_errors(path):
            with part.open("wb") as file:
                for values in arrays:
                    np.lib.format.write_array(file, values, (1, 0), allow_pickle=False)
                    file.write(bytes(-file.tell() % _ALIGNED))
            part.replace(path)

    def read_common(self, name: str) -> tuple[AnyArray, ...]:
        """Return arrays that belong to no tile."""
        with _opened(self.folder, name) as arrays:
            return arrays.all()

    def keep_only(self, *names: str) -> None:
        """Ask the disk to keep the arrays of these names; remove all others."""
        for path in self.folder.glob(f"*{_SUFFIX}"):
            if path.name.split(".")[0] not in names:
                path.unlink(missing_ok=True)
                continue
            with machine_errors(path), path.open("rb") as file:
                os.fsync(file.fileno())


class _Arrays:
    """An open file of arrays: read, not mapped, since a map of a file that fails kills the process."""

    def __init__(self, handle: int) -> None:
        self._handle = handle
        self._layout = []
        size, begin = os.fstat(handle).st_size, 0
        while begin < size:
            start = begin + 10 + int.from_bytes(os.pread(handle, 2, begin + 8), "little")
            dtype, shape = _header(os.pread(handle, start - begin, begin))
            self._layout.append((dtype, shape, start))
            begin = start + math.prod(shape) * dtype.itemsize
            if begin > size:
                raise ValueError(f"{size} bytes, expected {begin}")
            begin += -begin % _ALIGNED

    def all(self) -> tuple[AnyArray, ...]:
        """Return all arrays."""
        return tuple(self.rows(i, 0, shape[0]) for i, (_, shape, _) in enumerate(self._layout))

    def rows(self, which: int, first: int, last: int) -> AnyArray:
        """Return some rows of one of the arrays."""
        dtype, shape, start = self._layout[which]
        out = np.empty((last - first, *shape[1:]), dtype)
        row = math.prod(shape[1:]) * dtype.itemsize
        view, got = out.reshape(-1).view(np.uint8).data, 0
        while got < len(view):
            n = os.preadv(self._handle, [view[got:]], start + first * row + got)
            if n == 0:
                raise ValueError(f"ends before row {last}")
            got += n
        return out


@contextlib.contextmanager
def _opened(folder: Path, name: str) -> Iterator[_Arrays]:
    path = f"{folder}/{name}{_SUFFIX}"
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0))
    try:
        yield _Arrays(handle)
    except ValueError as error:
        raise MachineError(f"is damaged: {error}", where=path, advice=_ADVICE) from error
    except OSError as error:
        raise MachineError(
            f"cannot be read: {error.strerror or error}", where=path, advice=_ADVICE
        ) from error
    finally:
        os.close(handle)


@lru_cache
def _header(data: bytes) -> tuple[np.dtype[Any], tuple[int, ...]]:
    """Return type and shape that the header of an array tells."""
    file = io.BytesIO(data)
    if np.lib.format.read_magic(file) != (1, 0):
        raise ValueError("not an array of this program")
    shape, is_turned, dtype = np.lib.format.read_array_header_1_0(file)
    if is_turned or dtype.hasobject:
        raise ValueError("not an array of this program")
    return dtype, shape


def _tile_name(name: str, tile: TileNumber) -> str:
    return f"{name}.e{tile[0]}n{tile[1]}"


def clear_surface(folder: Path) -> None:
    """Remove what an earlier or unfinished pass has left in a folder, and make the folder."""
    with machine_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / _RECORD).unlink(missing_ok=True)
        for path in [*folder.glob(f"*{_SUFFIX}"), *folder.glob("*.part")]:
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
