"""Small laser files of every kind, and how to change a number in one of them."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import laspy
import lazrs
import numpy as np
from laspy.vlrs.known import WktCoordinateSystemVlr

#: Corner of the made-up road, and its size [m].
LOW, SIZE_M = np.array([500_000.0, 5_400_000.0, 100.0]), np.array([40.0, 8.0, 3.0])
#: The compressor writes no waveforms (formats 4, 5, 9, 10).
COMPRESSED_FORMATS = (0, 1, 2, 3, 6, 7, 8)
COPC_RECORD_BYTES = 36
# Places in a header
VERSION_MINOR, HEADER_BYTES, POINT_OFFSET, N_RECORDS, POINT_FORMAT, RECORD_BYTES = 25, 94, 96, 100, 104, 105
N_POINTS_OLD, SCALES, OFFSETS, BOX, EXTENDED, N_POINTS = 107, 131, 155, 179, 235, 247


def header_of(point_format: int, wkt: str = "") -> laspy.LasHeader:
    """Return a header with steps of 1 mm and GPS times of the adjusted kind."""
    header = laspy.LasHeader(version="1.4" if point_format > 5 else "1.2" if point_format < 4 else "1.3",
                             point_format=point_format)  # fmt: skip
    header.scales, header.offsets = [0.001] * 3, [LOW[0], LOW[1], 0.0]
    if header.version >= laspy.header.Version(1, 2):
        header.global_encoding.gps_time_type = laspy.header.GpsTimeType.STANDARD
    if wkt:
        header.vlrs.append(WktCoordinateSystemVlr(wkt))
        header.global_encoding.wkt = True
    return header


def drive_records(header: laspy.LasHeader, n: int) -> laspy.ScaleAwarePointRecord:
    """Return points of a road: coordinates, intensities and times vary as a scanner's do."""
    rng = np.random.default_rng(5)
    record = laspy.ScaleAwarePointRecord.zeros(n, header=header)
    xyz = rng.uniform(0.0, 1.0, (n, 3)) * SIZE_M + LOW
    for axis, name in enumerate("XYZ"):
        record[name] = np.rint((xyz[:, axis] - header.offsets[axis]) / header.scales[axis]).astype(np.int32)
    record["intensity"] = rng.integers(1, 60_000, n)
    if "gps_time" in record.point_format.dimension_names:
        record["gps_time"] = 3e8 + np.arange(n) * 1e-5
    return record


def drive_file(path: Path, point_format: int = 6, n: int = 400, wkt: str = "", **columns: object) -> Path:
    """Write a sound file; compressed where the name ends in .laz."""
    header = header_of(point_format, wkt)
    record = drive_records(header, n)
    for name, values in columns.items():
        record[name] = values
    path.parent.mkdir(parents=True, exist_ok=True)
    with laspy.open(path, mode="w", header=header) as writer:
        writer.write_points(record)
    return path


def copc_file(path: Path, *, n: int = 400, n_chunks: int = 4) -> Path:
    """Write a file laid out as COPC: info record first, chunks of own sizes, the hierarchy at the end."""
    header = header_of(7)
    records = drive_records(header, n).array
    chunks = [np.frombuffer(part.tobytes(), np.uint8) for part in np.array_split(records, n_chunks)]
    counts = [len(chunk) // COPC_RECORD_BYTES for chunk in chunks]
    vlr = lazrs.LazVlr.new_for_compression(7, 0, use_variable_size_chunks=True)
    info = struct.pack("<5d2Q2d", *(LOW + SIZE_M / 2), 20.0, 1.0, 0, 0, 3e8, 3e8 + 1) + bytes(88)
    header.vlrs.append(laspy.VLR("copc", 1, "", info))
    header.vlrs.append(laspy.VLR("laszip encoded", 22204, "", vlr.record_data()))
    header.point_count = n
    header.mins, header.maxs = LOW, LOW + SIZE_M
    header.are_points_compressed = True
    stream = io.BytesIO()
    header.write_to(stream)
    start = stream.tell()
    compressor = lazrs.ParLasZipCompressor(stream, vlr)
    compressor.compress_chunks(chunks)
    compressor.done()
    data = bytearray(stream.getvalue())
    stream.seek(start)
    listed = lazrs.read_chunk_table(stream, vlr)
    entries, at = b"", start + 8
    for i, (count, size) in enumerate(zip(counts, (size for _, size in listed), strict=True)):
        entries += struct.pack("<4iQ2i", min(i, 1), i, 0, 0, at, size, count)
        at += size
    struct.pack_into("<QI", data, EXTENDED, len(data), 1)
    struct.pack_into("<2Q", data, copc_info(data) + 40, len(data) + 60, len(entries))
    hierarchy = struct.pack("<H16sHQ32s", 0, b"copc", 1000, len(entries), b"") + entries
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(bytes(data) + hierarchy)
    return path


def point_by_point(path: Path, n: int = 400) -> Path:
    """Write a file as compressors did before 2011: one stream of points, no chunks."""
    data = drive_file(path, 1, n).read_bytes()
    start, record = points_start(data), laszip_record(data)
    old = bytearray(data[:start] + data[start + 8 : chunk_table(data)])
    struct.pack_into("<H", old, record, 1)
    struct.pack_into("<I", old, record + 12, 0)
    path.write_bytes(old)
    return path


def patched(path: Path, place: int, form: str, *values: float) -> Path:
    """Return `path` after its bytes at `place` were replaced."""
    data = bytearray(path.read_bytes())
    struct.pack_into("<" + form, data, place, *values)
    path.write_bytes(data)
    return path


def cut(path: Path, kept: int) -> Path:
    """Return `path` after all but its first bytes were cut off (a negative number: its last were)."""
    path.write_bytes(path.read_bytes()[:kept])
    return path


# Where parts of a file begin


def points_start(data: bytes) -> int:
    """Return the byte where the points begin; in a compressed file there stands the place of the chunk table."""
    return int(struct.unpack_from("<I", data, POINT_OFFSET)[0])


def chunk_table(data: bytes) -> int:
    """Return the byte where the chunk table begins."""
    return int(struct.unpack_from("<q", data, points_start(data))[0])


def laszip_record(data: bytes) -> int:
    """Return the byte where the record of the compressor begins."""
    return data.index(b"laszip encoded") + 52


def copc_info(data: bytes) -> int:
    """Return the byte where the COPC info begins."""
    return data.index(b"copc") + 52


def hierarchy(data: bytes) -> int:
    """Return the byte where the first entry of the COPC hierarchy begins."""
    return int(struct.unpack_from("<Q", data, EXTENDED)[0]) + 60
