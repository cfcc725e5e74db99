"""The records of a laser file, one after the other, as they are or decompressed."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lazrs

from linework.arrays import AnyArray
from linework.errors import InputError
from linework.files.las_header import LasHeader

#: Chunk size that says: every chunk has its own (COPC).
_VARIABLE_CHUNKS = 0xFFFFFFFF


class RecordSource:
    """The records of one file, read one after the other into buffers."""

    def __init__(
        self, path: Path, file: io.BufferedReader, header: LasHeader, *, is_sequential: bool
    ) -> None:
        self._path, self._file, self._header = path, file, header
        self._is_sequential = is_sequential
        self._fill: Callable[[AnyArray], None] | None = None

    def read(self, view: AnyArray, start: int) -> AnyArray:
        """Fill a byte buffer with the records from point `start` on, and return it."""
        try:
            self._fill = self._fill or self._filler()
            self._fill(view)
        except (KeyboardInterrupt, SystemExit):
            raise
        except MemoryError:
            raise
        except BaseException as error:  # lazrs panics are no Exceptions
            n = len(view) // self._header.record_bytes
            raise InputError(
                f"points {start:,} to {start + n:,} of {self._header.n_points:,} cannot be decoded (cut off or"
                " damaged)",
                where=self._path,
                advice="copy the file again, or leave it out",
            ) from error
        return view

    def _filler(self) -> Callable[[AnyArray], None]:
        """Return a function that fills a byte buffer with the next records."""
        laz, offset = self._header.laz, self._header.point_offset
        self._file.seek(offset)
        if laz is None:
            return self._fill_plain
        selection = lazrs.DecompressionSelection(
            lazrs.SELECTIVE_DECOMPRESS_XY_RETURNS_CHANNEL | lazrs.SELECTIVE_DECOMPRESS_Z
            | lazrs.SELECTIVE_DECOMPRESS_INTENSITY | lazrs.SELECTIVE_DECOMPRESS_GPS_TIME
            | lazrs.SELECTIVE_DECOMPRESS_CLASSIFICATION | lazrs.SELECTIVE_DECOMPRESS_FLAGS
        )  # fmt: skip
        if laz.is_sound and not self._is_sequential:
            return lazrs.ParLasZipDecompressor(self._file, laz.vlr, selection).decompress_many  # type: ignore[no-any-return]
        source: io.BufferedIOBase = self._file
        # This decoder reads the chunk table even where it needs none, and a decoder may have died of that table;
        # to tell apart chunks of several sizes it needs it
        if laz.table_offset is not None and laz.chunk_size != _VARIABLE_CHUNKS:
            source = io.BufferedReader(_WithoutChunkTable(self._file, laz.table_offset), 1 << 20)
            source.seek(offset)
        return lazrs.LasZipDecompressor(source, laz.vlr, selection).decompress_many  # type: ignore[no-any-return]

    def _fill_plain(self, view: AnyArray) -> None:
        if self._file.readinto(view.data) != len(view):
            raise EOFError("cut off")


class _WithoutChunkTable(io.RawIOBase):
    """A file as if its chunk table had no chunks."""

    def __init__(self, file: io.BufferedReader, table_offset: int) -> None:
        self._file, self._table_offset = file, table_offset

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = 0, /) -> int:
        return self._file.seek(offset, whence)

    def readinto(self, buffer: Any, /) -> int:
        at, view = self._file.tell(), memoryview(buffer).cast("B")
        n = self._file.readinto(view)
        first, last = max(self._table_offset - at, 0), min(self._table_offset + 8 - at, n)
        if first < last:
            view[first:last] = bytes(last - first)
        return n
