"""Small sound laser files of every kind, and a way to damage one of them that a seed decides."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from tests.scenes.laser_files import COMPRESSED_FORMATS, copc_file, drive_file, point_by_point

N_POINTS = 2_000
#: Two chunks and a third that is not full.
N_MANY = 120_000
_INTEGERS = {1: "<B", 2: "<H", 4: "<I", 8: "<Q"}
#: (place, bytes) of the numbers of a header; floats are those of 8 bytes from 131 to 227.
HEADER_FIELDS = (
    (6, 2), (24, 1), (25, 1), (94, 2), (96, 4), (100, 4), (104, 1), (105, 2), (107, 4),
    *((at, 8) for at in range(131, 255, 8)), (227, 8), (235, 8), (243, 4), (247, 8),
)  # fmt: skip
FLOATS = range(131, 227)
EXTREME_FLOATS = (
    0.0, -0.0, np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-300, 5e-324, -0.001, 1e9, -1e12, 1e7, 1.7976931348623157e308,
)  # fmt: skip


def make_bases(folder: Path) -> dict[str, bytes]:
    """Return the bytes of sound files of every kind, by name; they are written to `folder`."""
    made = [drive_file(folder / f"las-{number}.las", number, N_POINTS) for number in range(11)]
    made += [drive_file(folder / f"laz-{number}.laz", number, N_POINTS) for number in COMPRESSED_FORMATS]
    made += [drive_file(folder / f"chunks-{number}.laz", number, N_MANY) for number in (1, 6)]
    made.append(copc_file(folder / "copc-7.copc.laz", n=N_POINTS))
    made.append(point_by_point(folder / "old-1.laz"))
    return {path.name: path.read_bytes() for path in made}


def damaged(seed: int, bases: dict[str, bytes]) -> tuple[str, str, bytes]:
    """Return (base, what was done, bytes) of one damaged file; the seed decides all."""
    rng = np.random.default_rng([seed, 17])
    names = sorted(bases)
    name = names[int(rng.integers(len(names)))]
    data, done = bytearray(bases[name]), []
    for _ in range(1 + int(rng.integers(3)) * int(rng.random() < 0.3)):
        change = _CHANGES[int(rng.choice(len(_CHANGES), p=_SHARES))]
        done.append(f"{change.__name__.strip('_')} {change(rng, data)}")
    return name, ", ".join(done), bytes(data)


def _flip(rng: np.random.Generator, data: bytearray) -> str:
    """Change bits of some bytes, half the times in the header and the records behind it."""
    end = min(len(data), 1200) if rng.random() < 0.5 else len(data)
    places = rng.integers(0, max(end, 1), int(rng.integers(1, 21))) if end else []
    for at in places:
        data[at] ^= int(rng.integers(1, 256))
    return f"{len(places)} bytes below {end}"


def _poke(rng: np.random.Generator, data: bytearray) -> str:
    """Put an extreme value into a number of the header, its records, the chunk table or the COPC parts."""
    fields = [*HEADER_FIELDS, *_record_fields(data)]
    at, size = fields[int(rng.integers(len(fields)))]
    if at + size > len(data):
        return "nothing"
    if size == 8 and at in FLOATS:
        value = float(rng.choice(EXTREME_FLOATS))
        struct.pack_into("<d", data, at, value)
        return f"{value:g} at {at}"
    top = 1 << 8 * size
    choices = [
        0,
        1,
        2,
        top - 1,
        top // 2,
        top // 2 - 1,
        top // 4,
        len(data) % top,
        int(rng.integers(0, 1 << 31)) % top,
    ]
    value = choices[int(rng.integers(len(choices)))]
    if rng.random() < 0.3:  # beside what is there
        value = (int.from_bytes(data[at : at + size], "little") + int(rng.integers(-3, 4))) % top
    struct.pack_into(_INTEGERS[size], data, at, value)
    return f"{value} at {at}"


def _record_fields(data: bytearray) -> list[tuple[int, int]]:
    """Return (place, bytes) of the numbers in and behind the variable length records."""
    if len(data) < 375:
        return []
    header_bytes, points, n_records = struct.unpack_from("<HII", data, 94)
    found: list[tuple[int, int]] = []
    at = header_bytes
    for _ in range(min(n_records, 20)):
        if at + 54 > min(points, len(data)):
            break
        length = struct.unpack_from("<H", data, at + 20)[0]
        found += [(at + 18, 2), (at + 20, 2)]
        if data[at + 2 : at + 16] == b"laszip encoded":
            found += [(at + 54 + place, size) for place, size in _LASZIP_FIELDS]
        if data[at + 2 : at + 6] == b"copc":
            found += [(at + 54 + 8 * i, 8) for i in range(9)]
        at += 54 + length
    if points + 8 <= len(data) and data[104] & 0xC0:
        table = struct.unpack_from("<Q", data, points)[0]
        found += [(points, 8), (points + 38, 4), (points + 42, 4), (points + 46, 4), (points + 54, 4)]
        if table + 16 < len(data):
            found += [(table, 4), (table + 4, 4), (table + 8, 4), (table + 12, 2)] * 2
    start, n_extended = struct.unpack_from("<QI", data, 235) if data[25] == 4 else (0, 0)
    if n_extended and start + 92 <= len(data):
        found += [(start + 18, 2), (start + 20, 8), (start + 76, 8), (start + 84, 4), (start + 88, 4)]
    return found


_LASZIP_FIELDS = (
    (0, 2), (2, 2), (4, 1), (8, 4), (12, 4), (16, 8), (24, 8), (32, 2), (34, 2), (36, 2), (38, 2), (40, 2), (42, 2),
)  # fmt: skip


def _truncate(rng: np.random.Generator, data: bytearray) -> str:
    """Cut the end off."""
    kept = int(rng.integers(0, len(data) + 1))
    del data[kept:]
    return f"to {kept}"


def _zero(rng: np.random.Generator, data: bytearray) -> str:
    """Write a block of zeros, as a disk does that lost one."""
    at = (
        int(rng.integers(0, len(data) // 4096 + 1)) * 4096
        if rng.random() < 0.7
        else int(rng.integers(0, len(data) + 1))
    )
    end = min(at + 4096, len(data))
    data[at:end] = bytes(max(end - at, 0))
    return f"{at} to {end}"


def _insert(rng: np.random.Generator, data: bytearray) -> str:
    """Put bytes in."""
    at, n = int(rng.integers(0, len(data) + 1)), int(rng.integers(1, 65))
    data[at:at] = rng.bytes(n)
    return f"{n} at {at}"


def _remove(rng: np.random.Generator, data: bytearray) -> str:
    """Take bytes out."""
    at, n = int(rng.integers(0, len(data) + 1)), int(rng.integers(1, 65))
    del data[at : at + n]
    return f"{n} at {at}"


def _swap(rng: np.random.Generator, data: bytearray) -> str:
    """Exchange two halves, of the whole or of what is behind the header."""
    start = 0 if rng.random() < 0.2 else min(1500, len(data))
    middle = start + (len(data) - start) // 2
    data[start:] = data[middle:] + data[start:middle]
    return f"halves from {start}"


_CHANGES = (_flip, _poke, _truncate, _zero, _insert, _remove, _swap)
#: Those that know nothing of laser files.
BYTE_CHANGES = (_flip, _flip, _flip, _truncate, _zero, _insert, _remove, _swap)
_SHARES = (0.25, 0.45, 0.08, 0.07, 0.05, 0.05, 0.05)
