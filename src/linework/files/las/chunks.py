"""Check the laszip record and the chunk table of a LAZ file, whose errors crash decoders.

Separate from `header`, which reads what every file has: this reads what only compressed files have, without a decoder.

A false number of chunks makes the decoder allocate 64 GB and abort the process, a false size of an item makes it
panic; neither can be caught.

References
----------
laszip VLR and chunk table as in LASzip's `laszip.hpp` and `laswritepoint.cpp`.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

import lazrs

from linework.errors import InputError

_LASZIP_USER, _LASZIP_RECORD = b"laszip encoded", 22204
#: The compressor without chunks (before 2011), and the one with layers (point formats 6 to 10).
_POINT_BY_POINT, _LAYERED = 1, 3
_FIRST_LAYERED_ITEM, _LAST_ITEM = 10, 14
#: Layers by item type: point, RGB, RGB and infrared, wave packet; extra bytes have one each.
_LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}
#: More points than a chunk can have: decoders count them in 32 bits, and all ones mark chunks of variable size.
_ONE_CHUNK = 0xFFFFFFFE
#: Bytes after the header of a compressed file without points: the offset of the chunk table, and an empty table.
_EMPTY_BYTES = 64
#: Chunk size that marks chunks of variable size (COPC).
_VARIABLE_CHUNKS = 0xFFFFFFFF
#: Largest chunk: decoders allocate it at once; writers use 50,000 points, hardly ever more than a million.
_MAX_CHUNK = 10_000_000
#: A million equal points take 0.007 bytes each (measured); a higher count is false.
_MAX_POINTS_PER_BYTE = 1000
#: Scanner points, with noise in every coordinate, take 1 to 10 bytes each. A large file with 20 points per byte is
#: made to fill the disk when unpacked; a small one does no harm.
_BOMB_POINTS_PER_BYTE, _BOMB_POINTS = 20, 2_000_000
_DAMAGED = "copy the file again, or leave it out"


@dataclass(frozen=True, slots=True)
class LazTable:
    """Content of the laszip record and of the chunk table.

    Parameters
    ----------
    vlr
        The record, as decoders take it.
    chunk_size
        Points per chunk; 0 without chunks.
    table_offset
        Byte where the chunk table begins; None without chunks.
    is_sound
        Whether that table can be trusted.
    last_chunk
        Points before the last chunk, and the bytes where it begins and ends; None where chunks state their number of
        points themselves (point formats 6 to 10), and without a sound table.
    """

    vlr: bytes
    chunk_size: int
    table_offset: int | None
    is_sound: bool
    last_chunk: tuple[int, int, int] | None = None
    warnings: tuple[str, ...] = ()


def read_laz_table(
    path: Path,
    file: BinaryIO,
    vlrs: Sequence[tuple[bytes, int, bytes]],
    point_offset: int,
    record_bytes: int,
    n_points: int,
    points_end: int,
    *,
    walks: bool = True,
) -> LazTable:
    """Read and check the laszip record and the chunk table.

    Parameters
    ----------
    vlrs
        (user id, record id, data) of the variable length records.
    points_end
        Byte where the points and their chunk table end: the file's end, or where other records follow.
    walks
        Compare the table with the chunks themselves, which lie all over the file: before they are decoded.

    Raises
    ------
    InputError
        The record is missing, contradicts the header, or was made by a newer tool; the file is cut off.
    """
    data = next((d for u, r, d in vlrs if u == _LASZIP_USER and r == _LASZIP_RECORD), None)
    if data is None or len(data) < 34:
        raise _error(path, "points are compressed, but the laszip record is missing")
    compressor = struct.unpack_from("<H", data, 0)[0]
    chunk_size = struct.unpack_from("<I", data, 12)[0]
    if compressor not in (1, 2, 3):
        raise _newer(path, f"LAZ compressor {compressor}, expected 1 to 3")
    _check_items(path, data, compressor, record_bytes)
    _check_share(path, n_points, points_end - point_offset)
    if n_points == 0:
        refuse_unfinished(path, points_end - point_offset, _EMPTY_BYTES)
        return LazTable(data, 0, None, False)
    if compressor == _POINT_BY_POINT:
        # Decoders take 0 for variable chunks; this stands for one chunk without an end
        return LazTable(data[:12] + struct.pack("<I", _ONE_CHUNK) + data[16:], 0, None, False)
    if not (0 < chunk_size <= _MAX_CHUNK or chunk_size == _VARIABLE_CHUNKS):
        raise _error(path, f"laszip record says chunks of {chunk_size:,} points, expected some 50,000")
    at = _table_offset(path, file, point_offset, n_points)
    listed = _listed_chunks(file, data, point_offset, at)
    if compressor == _LAYERED and not walks:
        return LazTable(data, chunk_size, at, bool(listed))
    if compressor == _LAYERED:
        walked = _walked_chunks(path, file, data, point_offset, at, record_bytes)
        table = LazTable(data, chunk_size, at, _agree(path, listed, walked, chunk_size))
        return _judged(path, table, walked, n_points, is_exact=True)
    last = (sum(n for n, _ in listed[:-1]), at - listed[-1][1], at) if listed else None
    table = LazTable(data, chunk_size, at, bool(listed), last_chunk=last)
    return _judged(path, table, listed, n_points, is_exact=False)


def _check_share(path: Path, n_points: int, n_bytes: int) -> None:
    """Refuse more points than these bytes can hold, or than scanner points compress to."""
    if n_points > n_bytes * _MAX_POINTS_PER_BYTE:
        raise _too_many(path, n_points, f"{n_bytes:,} bytes of them")
    if n_points > max(_BOMB_POINTS, n_bytes * _BOMB_POINTS_PER_BYTE):
        raise InputError(
            f"header promises {n_points:,} points in {n_bytes:,} bytes, {n_points / n_bytes:.0f} to a byte: scanner"
            " points do not compress that far",
            where=path,
            advice="leave it out",
        )


def refuse_unfinished(path: Path, n_bytes: int, empty_bytes: int) -> None:
    """Refuse a file whose header was not updated after the points were written."""
    if n_bytes > empty_bytes:
        raise InputError(
            f"no points (0 in the header), but {n_bytes:,} bytes of them follow: the recording was not closed", where=path,
            advice="repair it with the tool that made it, or leave it out",
        )  # fmt: skip


def _agree(
    path: Path, listed: Sequence[tuple[int, int]], walked: Sequence[tuple[int, int]], chunk_size: int
) -> bool:
    """Return whether the chunk table agrees with the chunks; refuse chunks that make decoders loop.

    A short last chunk is listed as a full one, so for chunks of one size only the bytes are compared.
    """
    if chunk_size == _VARIABLE_CHUNKS:
        largest = max((n for n, _ in walked), default=0)
        if largest > _MAX_CHUNK:
            raise _error(path, f"a chunk of {largest:,} points, expected some 50,000")
        return list(listed) == list(walked)
    for i, (n, _) in enumerate(walked):
        if n > chunk_size or (n < chunk_size and i + 1 < len(walked)):
            raise _error(
                path,
                f"chunk {i + 1} of {len(walked):,} holds {n:,} points, the laszip record says {chunk_size:,}",
            )
    return [size for _, size in listed] == [size for _, size in walked]


def _judged(
    path: Path, table: LazTable, chunks: Sequence[tuple[int, int]], n_points: int, *, is_exact: bool
) -> LazTable:
    """Compare the points in the chunks with those promised; add warnings."""
    n_held = sum(n for n, _ in chunks)
    if chunks and n_points > n_held:
        raise _too_many(path, n_points, f"{n_held:,} in {len(chunks):,} chunks")
    warnings = []
    if not table.is_sound:
        if table.chunk_size == _VARIABLE_CHUNKS:
            raise _error(
                path, "damaged chunk table, and chunks of different sizes cannot be found without it"
            )
        warnings.append("damaged chunk table: decoded one chunk after the other")
    if n_held - n_points >= (1 if is_exact else table.chunk_size):
        warnings.append(
            f"chunks for {n_held:,} points, the header says {n_points:,}: the others are not read"
        )
    return replace(table, warnings=tuple(warnings))


def _too_many(path: Path, n_points: int, held: str) -> InputError:
    return _error(path, f"header promises {n_points:,} points but the file holds {held} (cut off or damaged)")


def _error(path: Path, problem: str) -> InputError:
    return InputError(problem, where=path, advice=_DAMAGED)


def _newer(path: Path, problem: str) -> InputError:
    return InputError(
        f"{problem}: made by a newer tool", where=path,
        advice="convert it to LAS 1.4 with the tool that made it",
    )  # fmt: skip


def _check_items(path: Path, data: bytes, compressor: int, record_bytes: int) -> None:
    n_items = struct.unpack_from("<H", data, 32)[0]
    if len(data) < 34 + 6 * n_items or n_items == 0:
        raise _error(path, f"laszip record promises {n_items} items in {len(data)} bytes")
    items = [struct.unpack_from("<HHH", data, 34 + 6 * i) for i in range(n_items)]
    total = sum(size for _, size, _ in items)
    if total != record_bytes:
        raise _error(path, f"laszip items add up to {total} bytes a point, the header says {record_bytes}")
    # Layers came with the point formats 6 to 10: their items and the layered compressor belong together
    is_layered = {kind >= _FIRST_LAYERED_ITEM for kind, _, _ in items}
    if is_layered != {compressor == _LAYERED} or max(kind for kind, _, _ in items) > _LAST_ITEM:
        kinds = ", ".join(str(kind) for kind, _, _ in items)
        raise _error(path, f"LAZ items of types {kinds} do not go with compressor {compressor}")
    newest = max(version for _, _, version in items)
    if newest > 3:
        raise _newer(path, f"LAZ items of version {newest}, expected at most 3")


def _table_offset(path: Path, file: BinaryIO, point_offset: int, n_points: int) -> int:
    n_bytes = file.seek(0, os.SEEK_END)
    file.seek(point_offset)
    at: int = struct.unpack("<q", file.read(8).ljust(8, b"\0"))[0]
    if at == -1:  # a writer that could not seek puts it last
        file.seek(-8, os.SEEK_END)
        at = struct.unpack("<q", file.read(8))[0]
    if not point_offset + 8 <= at <= n_bytes - 8:
        raise _error(
            path,
            f"header promises {n_points:,} points, but their chunk table at byte {at} is missing from the file of"
            f" {n_bytes:,} (cut off or damaged)",
        )
    return at


def _listed_chunks(file: BinaryIO, vlr: bytes, point_offset: int, at: int) -> list[tuple[int, int]]:
    """Return (points, bytes) of each chunk from the table; empty where it contradicts the file."""
    file.seek(at)
    version, n_chunks = struct.unpack("<II", file.read(8))
    # A chunk begins with one whole point, of at least 20 bytes.
    if version != 0 or not 0 < n_chunks * 20 <= at - point_offset:
        return []
    file.seek(point_offset)
    try:
        chunks: list[tuple[int, int]] = lazrs.read_chunk_table(file, lazrs.LazVlr(vlr))
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException:  # lazrs panics are not Exceptions
        return []
    return chunks if sum(size for _, size in chunks) == at - point_offset - 8 else []


def _walked_chunks(
    path: Path, file: BinaryIO, vlr: bytes, point_offset: int, end: int, record_bytes: int
) -> list[tuple[int, int]]:
    """Return (points, bytes) of each chunk from its own head: one point, a count, sizes of layers.

    A decoder allocates these sizes; they must add up to the bytes between points and table.
    """
    items = [struct.unpack_from("<HHH", vlr, 34 + 6 * i) for i in range(struct.unpack_from("<H", vlr, 32)[0])]
    n_layers = sum(_LAYERS.get(kind, size) for kind, size, _ in items)
    form = struct.Struct(f"<{1 + n_layers}I")
    chunks: list[tuple[int, int]] = []
    at = point_offset + 8
    while at < end:
        file.seek(at + record_bytes)
        head = file.read(form.size)
        count, *layers = form.unpack(head) if len(head) == form.size else (0,)
        size = record_bytes + form.size + sum(layers)
        if count == 0 or at + size > end:
            raise _error(
                path,
                f"chunk {len(chunks) + 1} after {sum(n for n, _ in chunks):,} points is damaged ({size:,} bytes, there"
                f" are {end - at:,})",
            )
        chunks.append((count, size))
        at += size
    return chunks
