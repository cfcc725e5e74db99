"""Point files with one fault each, made from small sound ones."""

from __future__ import annotations

import io
import struct
from collections.abc import Callable
from pathlib import Path

import lazrs
import numpy as np
from tests.scenes.laser_files import (
    HEADER_BYTES,
    N_POINTS,
    N_POINTS_OLD,
    chunk_table,
    copc_file,
    copc_info,
    cut,
    drive_file,
    hierarchy,
    laszip_record,
    patched,
    points_start,
)

N = 400
HEAD = 0
Make = Callable[[Path], Path]


def las(folder: Path, n: int = N) -> Path:
    return drive_file(folder / "x.las", 6, n)


def laz(folder: Path) -> Path:
    return drive_file(folder / "x.laz", 6, N)


def old_las(folder: Path) -> Path:
    """LAS 1.2, point format 1."""
    return drive_file(folder / "x.las", 1, N)


def old_laz(folder: Path) -> Path:
    """Chunks of points one after the other, without layers: what is damaged shows when it is decoded."""
    return drive_file(folder / "x.laz", 1, N)


def many_laz(folder: Path) -> Path:
    """Three chunks."""
    return drive_file(folder / "x.laz", 1, 120_000)


def copc(folder: Path) -> Path:
    return copc_file(folder / "x.copc.laz", n=N)


def drive_file_of(n: int, folder: Path) -> Path:
    return drive_file(folder / "x.laz", 6, n)


def holding(data: bytes, folder: Path) -> Path:
    path = folder / "x.laz"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    return path


def put(make: Make, part: object, place: int, form: str, *values: float) -> Make:
    """A file with one number replaced, `place` bytes into a part of it."""

    def made(folder: Path) -> Path:
        path = make(folder)
        start = part(path.read_bytes()) if callable(part) else part
        return patched(path, start + place, form, *values)

    return made


def cut_to(make: Make, kept: Callable[[bytes], int]) -> Make:
    def made(folder: Path) -> Path:
        path = make(folder)
        return cut(path, kept(path.read_bytes()))

    return made


def changed(make: Make, change: Callable[[bytearray], object]) -> Make:
    def made(folder: Path) -> Path:
        path = make(folder)
        data = bytearray(path.read_bytes())
        change(data)
        path.write_bytes(data)
        return path

    return made


def zero_block(data: bytearray) -> None:
    """4 kB of zeros, as a disk leaves them, in the second chunk."""
    at = (points_start(data) + chunk_table(data)) // 2
    data[at : at + 4096] = bytes(4096)


def flip_200(data: bytearray, seed: int) -> None:
    for at in np.random.default_rng(seed).integers(points_start(data) + 100, chunk_table(data), 200):
        data[at] ^= 0x55


def no_text(data: bytearray) -> None:
    """Bytes that are no UTF-8 in system id, software, user id and description of the first record."""
    data[26:90] = b"\xff" * 64
    at = struct.unpack_from("<H", data, HEADER_BYTES)[0]
    data[at + 22 : at + 54] = b"\xfe" * 32


def streamed(data: bytearray) -> None:
    """The place of the chunk table at the end of the file, as a writer leaves it that could not go back."""
    table = chunk_table(data)
    struct.pack_into("<q", data, points_start(data), -1)
    data += struct.pack("<q", table)


def page_that_holds_itself(data: bytearray) -> None:
    struct.pack_into("<Q2i", data, hierarchy(data) + 16, hierarchy(data), 128, -1)


def lies_of_copc(data: bytearray) -> None:
    """Nodes of impossible sizes and counts, a root page past the end, a half size that is no number, no spacing."""
    first, info = hierarchy(data), copc_info(data)
    for i, (size, count) in enumerate(((2**31 - 1, 100), (-1, 100), (100, 2**31 - 1), (100, -5))):
        struct.pack_into("<2i", data, first + 32 * i + 24, size, count)
    struct.pack_into("<2d2Q", data, info + 24, np.nan, 0.0, 2**60, 2**63)


def bomb(n_chunks: int) -> Make:
    """A sound file of equal points, 50,000 a chunk, compressed to next to nothing."""

    def made(folder: Path) -> Path:
        path = old_laz(folder)
        data = path.read_bytes()
        start = points_start(data)
        vlr, packed = lazrs.LazVlr(data[laszip_record(data) : start]), io.BytesIO()
        compressor = lazrs.LasZipCompressor(packed, vlr)
        compressor.compress_many(np.zeros(28 * 50_000, np.uint8))
        compressor.done()
        chunk = packed.getvalue()[8 : struct.unpack_from("<q", packed.getvalue())[0]]
        table = io.BytesIO()
        lazrs.write_chunk_table(table, [(50_000, len(chunk))] * n_chunks, vlr)
        place = struct.pack("<q", start + 8 + n_chunks * len(chunk))
        path.write_bytes(data[:start] + place + n_chunks * chunk + table.getvalue())
        return patched(path, N_POINTS_OLD, "I", n_chunks * 50_000)

    return made


def twice(folder: Path) -> Path:
    """Every point of a drive two times, one copy behind the other."""
    path = las(folder)
    data = path.read_bytes()
    path.write_bytes(data + data[points_start(data) :])
    return patched(path, N_POINTS, "Q", 2 * N)
