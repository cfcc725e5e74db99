"""Small sound laser files of every kind, and a way to damage one of them that a seed decides."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import laspy
import lazrs
import numpy as np

N_POINTS = 2_000
#: Two chunks and a third that is not full.
N_MANY = 120_000
#: The compressor does not write waveforms (formats 4, 5, 9, 10).
COMPRESSED_FORMATS = (0, 1, 2, 3, 6, 7, 8)
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


def make_bases(folder: Path) -> dict[str, Path]:
    """Write the sound files and return their paths by name."""
    folder.mkdir(parents=True, exist_ok=True)
    made = {}
    for number in range(11):
        for suffix in ("las", "laz"):
            if suffix == "las" or number in COMPRESSED_FORMATS:
                made[f"{suffix}-{number}"] = laspy_file(folder / f"format{number}.{suffix}", number, N_POINTS)
    made["laz-1-chunks"] = laspy_file(folder / "chunks1.laz", 1, N_MANY)
    made["laz-6-chunks"] = laspy_file(folder / "chunks6.laz", 6, N_MANY)
    made["copc-7"] = write_copc(folder / "a.copc.laz")
    return made


def drive_records(header: laspy.LasHeader, n: int) -> laspy.ScaleAwarePointRecord:
    """Return points of a road 40 m long: coordinates, intensities and times vary as a scanner's do."""
    rng = np.random.default_rng(5)
    record = laspy.ScaleAwarePointRecord.zeros(n, header=header)
    low = np.array([500_000.0, 5_400_000.0, 100.0])
    xyz = rng.uniform([0, -4, 0], [40, 4, 3], (n, 3)) + low
    for axis, name in enumerate("XYZ"):
        record[name] = np.rint((xyz[:, axis] - header.offsets[axis]) / header.scales[axis]).astype(np.int32)
    record["intensity"] = rng.integers(1, 60_000, n)
    if "gps_time" in record.point_format.dimension_names:
        record["gps_time"] = 3e8 + np.arange(n) * 1e-5
    return record


def _header(number: int) -> laspy.LasHeader:
    header = laspy.LasHeader(point_format=number, version="1.4" if number > 5 else "1.3")
    header.scales, header.offsets = [0.001] * 3, [500_000.0, 5_400_000.0, 0.0]
    header.global_encoding.gps_time_type = laspy.header.GpsTimeType.STANDARD
    return header


def laspy_file(path: Path, number: int, n: int) -> Path:
    header = _header(number)
    with laspy.open(path, mode="w", header=header) as writer:
        writer.write_points(drive_records(header, n))
    return path


def write_copc(
    path: Path, *, n: int = N_POINTS, n_chunks: int = 4, chunks: list[bytes] | None = None
) -> Path:
    """Write a file laid out as COPC: info record first, chunks of own sizes, the hierarchy at the end.

    Parameters
    ----------
    chunks
        Records of each chunk; None: `n` points of a drive.
    """
    header = _header(7)
    if chunks is None:
        records = drive_records(header, n).array
        chunks = [part.tobytes() for part in np.array_split(records, n_chunks)]
    counts = [len(chunk) // 36 for chunk in chunks]
    vlr = lazrs.LazVlr.new_for_compression(7, 0, use_variable_size_chunks=True)
    info = struct.pack("<5d2Q2d", 5e5, 5.4e6, 100.0, 20.0, 1.0, 0, 0, 3e8, 3e8 + 1) + bytes(88)
    header.vlrs.append(laspy.VLR("copc", 1, "", info))
    header.vlrs.append(laspy.VLR("laszip encoded", 22204, "", vlr.record_data()))
    header.point_count = sum(counts)
    header.are_points_compressed = True
    stream = io.BytesIO()
    header.write_to(stream)
    start = stream.tell()
    compressor = lazrs.ParLasZipCompressor(stream, vlr)
    compressor.compress_chunks([np.frombuffer(chunk, np.uint8) for chunk in chunks])
    compressor.done()
    data = bytearray(stream.getvalue())
    listed = lazrs.read_chunk_table(_at(data, start), vlr)
    entries, at = b"", start + 8
    for i, (count, size) in enumerate(zip(counts, (size for _, size in listed), strict=True)):
        entries += struct.pack("<4iQ2i", min(i, 1), i, 0, 0, at, size, count)
        at += size
    hierarchy = struct.pack("<H16sHQ32s", 0, b"copc", 1000, len(entries), b"") + entries
    struct.pack_into("<QI", data, 235, len(data), 1)
    struct.pack_into("<2Q", data, 375 + 54 + 40, len(data) + 60, len(entries))
    path.write_bytes(data + hierarchy)
    return path


def _at(data: bytearray, place: int) -> io.BytesIO:
    stream = io.BytesIO(data)
    stream.seek(place)
    return stream


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
_SHARES = (0.25, 0.45, 0.08, 0.07, 0.05, 0.05, 0.05)
