"""Read and check the header of a LAS/LAZ file: every count is bounded by the file size before allocation.

The libraries that read LAS trust the header: 4 changed bytes make them loop, allocate 64 GB or silently return
half the points. This module reads the 227 to 375 bytes and the variable length records (VLRs) itself, and refuses
impossible values.

References
----------
ASPRS, LAS Specification 1.4 - R15, sections 2.4 (header) and 2.6 (point formats).
"""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from linework.errors import InputError
from linework.files.clouds.e57_header import E57Scans, e57_columns, read_e57_scans
from linework.files.clouds.headers import read_cloud_table
from linework.files.clouds.table import CLOUD_SUFFIXES, CloudTable
from linework.files.input import open_input
from linework.files.las.chunks import LazTable, read_laz_table, refuse_unfinished
from linework.files.las.columns import LasColumn, columns_of_las
from linework.files.remote.address import is_remote

#: Bytes of a point record without extra bytes, by point format (specification tables 7 to 17).
RECORD_BYTES = {0: 20, 1: 28, 2: 26, 3: 34, 4: 57, 5: 63, 6: 30, 7: 36, 8: 38, 9: 59, 10: 67}
#: Point formats with a GPS time.
_WITH_TIME = (1, 3, 4, 5, 6, 7, 8, 9, 10)
#: Least header bytes by minor version; some writers add more.
_HEADER_BYTES = {0: 227, 1: 227, 2: 227, 3: 235, 4: 375}
#: Bits of the header's global encoding.
_HAS_ADJUSTED_TIME, _HAS_WAVEFORMS = 1, 2
_DAMAGED = "copy the file again, or leave it out"
_Corner = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class LasHeader:
    """Content of a checked header.

    Parameters
    ----------
    low, high
        Bounding box of the points according to the header; None where it is invalid. [unit of the file]
    projection
        The CRS records as (record id, bytes).
    columns
        Further columns of the points by name, extra dimensions first.
    cloud
        Of a PLY, PCD or E57 file: where its points are. Such a file has no scales and no box; only E57 may have a CRS.
    """

    version: tuple[int, int]
    point_format: int
    record_bytes: int
    n_points: int
    point_offset: int
    scales: tuple[float, float, float]
    offsets: tuple[float, float, float]
    low: tuple[float, float, float] | None
    high: tuple[float, float, float] | None
    has_adjusted_time: bool
    projection: tuple[tuple[int, bytes], ...]
    columns: Mapping[str, LasColumn]
    laz: LazTable | None
    warnings: tuple[str, ...]
    cloud: CloudTable | E57Scans | None = None

    @property
    def has_time(self) -> bool:
        """Whether the point format has a time."""
        return self.point_format in _WITH_TIME

    @property
    def version_text(self) -> str:
        """Version as text, such as "1.4"; "" for files of other formats."""
        if self.cloud is not None:
            return ""
        return f"{self.version[0]}.{self.version[1]}"


def read_las_header(path: Path) -> LasHeader:
    """Read and check the header of a LAS, LAZ or COPC file, or of a PLY, PCD or E57 file.

    Raises
    ------
    InputError
        Not a regular LAS file, cut off, or a header that cannot be true; with the numbers.
    MachineError
        The file is at an address, and its server cannot be reached or fails.
    """
    if path.suffix.lower() == ".e57":
        return _e57_header(path)
    if path.suffix.lower() in CLOUD_SUFFIXES:
        return _cloud_header(path)
    with open_input(path) as file:
        return _Reader(path, file, file.seek(0, os.SEEK_END)).header()


def _cloud_header(path: Path) -> LasHeader:
    """Return the header of a PLY or PCD file as that of a laser file without scales, box and CRS."""
    table, n_points = read_cloud_table(path)
    columns = {name: LasColumn(name, table.row[name].str, 0) for name in table.further}
    warnings: tuple[str, ...] = ()
    if table.intensity and table.row[table.intensity].str not in ("|u1", "<u2", ">u2"):
        warnings = (
            "intensities from 0 to 1 are scaled to 65,535; others are rounded, and cut at 0 and 65,535",
        )
    return LasHeader(
        (0, 0), 1 if table.time else 0, table.row.itemsize, n_points, table.first_byte, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0),
        None, None, False, (), columns, None, warnings, table,
    )  # fmt: skip


def _e57_header(path: Path) -> LasHeader:
    """Return the header of an E57 file as that of a laser file without scales and box."""
    scans = read_e57_scans(path)
    columns = {name: LasColumn(name, "<f4", 0) for name in e57_columns(scans)}
    n_bytes = 8 * max((len(scan.fields) for scan in scans.scans), default=0)
    return LasHeader(
        (0, 0), 1 if scans.has_time else 0, n_bytes, scans.n_points, 0, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0), None, None,
        False, scans.projection, columns, None, scans.warnings, scans,
    )  # fmt: skip


class _Reader:
    """Reads one header; holds what its steps share."""

    def __init__(self, path: Path, file: BinaryIO, n_bytes: int) -> None:
        self.path, self.file, self.n_bytes = path, file, n_bytes
        self.warnings: list[str] = []

    def header(self) -> LasHeader:
        """Return the checked header."""
        head, version = self._head()
        header_bytes, point_offset, n_records = struct.unpack_from("<HII", head, 94)
        format_byte, record_bytes, n_points = struct.unpack_from("<BHI", head, 104)
        point_format, is_laz = format_byte & 0x3F, bool(format_byte & 0xC0)
        self._check_sizes(version[1], header_bytes, point_offset, n_records, point_format, record_bytes)
        encoding = struct.unpack_from("<H", head, 6)[0]
        records = read_records(self.path, self.file, header_bytes, n_records, point_offset)
        # Where the points end: at the waveforms or the extended records behind them, if any
        ends = [self.n_bytes]
        if version[1] >= 3 and encoding & _HAS_WAVEFORMS:
            ends.append(struct.unpack_from("<Q", head, 227)[0])
        if version[1] == 4:
            n_points = struct.unpack_from("<Q", head, 247)[0] or n_points
            start, n_extended = struct.unpack_from("<QI", head, 235)
            records += read_extended_records(self.path, self.file, start, n_extended, self.n_bytes)
            ends += [start] if n_extended else []
        end = min(end for end in ends if end >= point_offset)
        scales, offsets = struct.unpack_from("<3d", head, 131), struct.unpack_from("<3d", head, 155)
        self._check_scales(scales, offsets)
        low, high = self._box(struct.unpack_from("<6d", head, 179))
        laz = None
        if is_laz:
            laz = read_laz_table(
                self.path, self.file, records, point_offset, record_bytes, n_points, end,
                walks=not is_remote(self.path),
            )  # fmt: skip
            self.warnings += laz.warnings
        else:
            self._check_length(n_points, point_offset, record_bytes, end)
        columns = columns_of_las(point_format, record_bytes, RECORD_BYTES[point_format], records)
        projection = tuple((record, data) for user, record, data in records if user == b"LASF_Projection")
        return LasHeader(
            version, point_format, record_bytes, n_points, point_offset, scales, offsets, low, high,
            bool(encoding & _HAS_ADJUSTED_TIME), projection, columns, laz, tuple(self.warnings),
        )  # fmt: skip

    def _head(self) -> tuple[bytes, tuple[int, int]]:
        """Return up to the bytes of the longest header, and the version."""
        self.file.seek(0)
        head = self.file.read(max(_HEADER_BYTES.values()))
        if head[:4] != b"LASF":
            raise self._error("not a LAS/LAZ file (it does not begin with LASF)", "check what this file is")
        if len(head) < _HEADER_BYTES[0]:
            raise self._error(f"cut off inside the header: {len(head)} of at least {_HEADER_BYTES[0]} bytes")
        version = (head[24], head[25])
        if version[0] != 1 or version[1] not in _HEADER_BYTES:
            newer = ": made by a newer tool" if version[0] == 1 else ""
            raise self._error(
                f"LAS version {version[0]}.{version[1]}, expected 1.0 to 1.4{newer}", "convert it to LAS 1.4"
            )
        if len(head) < _HEADER_BYTES[version[1]]:
            raise self._error(f"cut off inside the header: {len(head)} of {_HEADER_BYTES[version[1]]} bytes")
        return head, version

    def _error(self, problem: str, advice: str = _DAMAGED) -> InputError:
        return InputError(problem, where=self.path, advice=advice)

    def _check_sizes(
        self, minor: int, header: int, points: int, n_vlrs: int, point_format: int, record: int
    ) -> None:
        if header < _HEADER_BYTES[minor] or header > self.n_bytes:
            raise self._error(
                f"header says it is {header:,} bytes long, expected {_HEADER_BYTES[minor]} or a little more"
                f" in a file of {self.n_bytes:,}"
            )
        if not header <= points <= self.n_bytes:
            raise self._error(
                f"points should start at byte {points:,}, but the header ends at {header:,} and the file at"
                f" {self.n_bytes:,}"
            )
        if n_vlrs * HEAD_BYTES > points - header:
            raise self._error(
                f"header promises {n_vlrs:,} variable length records, but there are {points - header:,} bytes for them"
            )
        if point_format not in RECORD_BYTES:
            raise self._error(f"point format {point_format}, expected 0 to 10", "convert it to LAS 1.4")
        if record < RECORD_BYTES[point_format]:
            raise self._error(
                f"point records of {record} bytes, point format {point_format} needs {RECORD_BYTES[point_format]}"
            )

    def _check_scales(self, scales: tuple[float, ...], offsets: tuple[float, ...]) -> None:
        for axis, scale, offset in zip("xyz", scales, offsets, strict=True):
            # 1e-9 to 1e6 m per step: outside this range it is not a survey
            if not (math.isfinite(scale) and 1e-9 <= abs(scale) <= 1e6):
                raise self._error(f"{axis} scale is {scale:g}, expected a size such as 0.001")
            # Projected coordinates reach some 1e8 (feet, false eastings with a zone prefix)
            if not (math.isfinite(offset) and abs(offset) <= 1e9):
                raise self._error(f"{axis} offset is {offset:g}, expected at most 1e9")
            if scale < 0:
                self.warnings.append(f"{axis} scale is negative ({scale:g})")

    def _box(self, values: tuple[float, ...]) -> tuple[_Corner, _Corner] | tuple[None, None]:
        """Return the bounding box as (low, high); some writers leave it empty or inverted."""
        high, low = (values[0], values[2], values[4]), (values[1], values[3], values[5])
        for axis, least, most in zip("xyz", low, high, strict=True):
            if not (math.isfinite(least) and math.isfinite(most) and least <= most):
                self.warnings.append(
                    f"the header's bounding box is invalid ({axis} from {least:g} to {most:g}): not used"
                )
                return None, None
        return low, high

    def _check_length(self, n_points: int, point_offset: int, record_bytes: int, end: int) -> None:
        held, rest = divmod(end - point_offset, record_bytes)
        if n_points > held:
            behind = "" if end == self.n_bytes else f" before other records at byte {end:,}"
            raise self._error(
                f"header promises {n_points:,} points but the file holds {held:,}{behind} (cut off or damaged)"
            )
        if n_points == 0:
            refuse_unfinished(self.path, end - point_offset, record_bytes - 1)
        elif n_points < held:
            self.warnings.append(
                f"{(held - n_points) * record_bytes + rest:,} bytes after the last of {n_points:,} points"
            )


#: (user id, record id, data)
Record = tuple[bytes, int, bytes]

#: Bytes before the data of a variable length record, and of an extended one.
HEAD_BYTES, EXTENDED_HEAD_BYTES = 54, 60
#: Largest WKT record that is read; real ones have some kB.
_MAX_EXTENDED_BYTES = 1 << 20


def read_records(path: Path, file: BinaryIO, start: int, n_records: int, end: int) -> list[Record]:
    """Return the records between header and points; the caller has bounded their number.

    Parameters
    ----------
    end
        Byte where the points start.

    Raises
    ------
    InputError
        They do not fit before the points.
    """
    file.seek(start)
    block = file.read(end - start)
    found, at = [], 0
    for i in range(n_records):
        if at + HEAD_BYTES > len(block):
            raise _error(path, f"only {i:,} of {n_records:,} variable length records fit before the points")
        user, record, length = struct.unpack_from("<16sHH", block, at + 2)
        over = at + HEAD_BYTES + length - len(block)
        if over > 0:
            raise _error(
                path, f"variable length record {i + 1:,} of {n_records:,} runs {over:,} bytes into the points"
            )
        found.append((user.split(b"\0")[0], record, block[at + HEAD_BYTES : at + HEAD_BYTES + length]))
        at += HEAD_BYTES + length
    return found


def read_extended_records(
    path: Path, file: BinaryIO, start: int, n_records: int, n_bytes: int
) -> list[Record]:
    """Return the records of CRS and extra bytes among the extended ones; others (waveforms, COPC) are skipped.

    Parameters
    ----------
    n_bytes
        Size of the file.

    Raises
    ------
    InputError
        They are not in the file.
    """
    if n_records == 0:
        return []
    if start < 375 or start + EXTENDED_HEAD_BYTES * n_records > n_bytes:
        raise _error(
            path,
            f"header promises {n_records:,} extended records from byte {start:,}, the file ends at {n_bytes:,}",
        )
    found, at = [], start
    for i in range(n_records):
        file.seek(at)
        head = file.read(EXTENDED_HEAD_BYTES)
        if len(head) < EXTENDED_HEAD_BYTES:
            raise _error(path, f"only {i:,} of {n_records:,} extended records are in the file")
        user, record, length = struct.unpack_from("<16sHQ", head, 2)
        if at + EXTENDED_HEAD_BYTES + length > n_bytes:
            raise _error(path, f"extended record {i + 1:,} of {n_records:,} runs past the end of the file")
        name = user.split(b"\0")[0]
        if name in (b"LASF_Projection", b"LASF_Spec") and length <= _MAX_EXTENDED_BYTES:
            found.append((name, record, file.read(length)))
        at += EXTENDED_HEAD_BYTES + length
    return found


def _error(path: Path, problem: str) -> InputError:
    return InputError(problem, where=path, advice=_DAMAGED)
