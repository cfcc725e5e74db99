"""The header of a LAS/LAZ file, every count in it bounded by the file's size before anything is allocated.

The libraries that read LAS believe the header: 4 changed bytes make them loop, allocate 64 GB or return
half the points without a word. This reads the 227 to 375 bytes and the variable length records (VLRs)
itself, and refuses what cannot be true.

References
----------
ASPRS, LAS Specification 1.4 - R15, sections 2.4 (header), 2.5 (VLRs), 2.6 (point formats); laszip VLR as in
LASzip's `laszip.hpp`.
"""

from __future__ import annotations

import math
import os
import stat
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from linework.errors import InputError
from linework.files.las_chunks import LazTable, read_laz_table

#: Bytes of a point record without extra bytes, by point format (specification tables 7 to 17).
RECORD_BYTES = {0: 20, 1: 28, 2: 26, 3: 34, 4: 57, 5: 63, 6: 30, 7: 36, 8: 38, 9: 59, 10: 67}
#: Point formats with a GPS time.
_WITH_TIME = (1, 3, 4, 5, 6, 7, 8, 9, 10)
#: Header bytes by minor version; some writers add more, none can have less.
_HEADER_BYTES = {0: 227, 1: 227, 2: 227, 3: 235, 4: 375}
_DAMAGED = "copy the file again, or leave it out"


@dataclass(frozen=True, slots=True)
class LasHeader:
    """What is needed of a checked header; `projection` holds the CRS records as (record id, bytes)."""

    version: tuple[int, int]
    point_format: int
    record_bytes: int
    n_points: int
    point_offset: int
    scales: tuple[float, float, float]
    offsets: tuple[float, float, float]
    has_adjusted_time: bool
    projection: tuple[tuple[int, bytes], ...]
    laz: LazTable | None
    warnings: tuple[str, ...]

    @property
    def has_time(self) -> bool:
        """Whether the point format has a time."""
        return self.point_format in _WITH_TIME

    @property
    def version_text(self) -> str:
        """Version, as people write it."""
        return f"{self.version[0]}.{self.version[1]}"


def read_las_header(path: Path) -> LasHeader:
    """Read and check the header of a LAS, LAZ or COPC file.

    Raises
    ------
    InputError
        Not a regular LAS file, cut off, or a header that cannot be true; with the numbers.
    """
    n_bytes = regular_file_bytes(path)
    if n_bytes == 0:
        raise InputError("empty file (0 bytes)", where=path, advice="copy the file again")
    with path.open("rb") as file:
        return _Reader(path, file, n_bytes).header()


def regular_file_bytes(path: Path) -> int:
    """Return the size of a regular file; a pipe, a device or a folder is refused unopened, so nothing can hang.

    Raises
    ------
    InputError
        Missing, unreadable, or not a regular file.
    """
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot be opened: {reason}", where=path, advice="check the name") from error
    if not stat.S_ISREG(status.st_mode):
        raise InputError("is not a regular file", where=path, advice="name a file on a disk")
    if not os.access(path, os.R_OK):
        raise InputError("may not be read", where=path, advice="check its permissions")
    return status.st_size


class _Reader:
    """Reads one header; holds what every step of it needs."""

    def __init__(self, path: Path, file: BinaryIO, n_bytes: int) -> None:
        self.path, self.file, self.n_bytes = path, file, n_bytes
        self.warnings: list[str] = []

    def header(self) -> LasHeader:
        """Return the checked header."""
        head = self.file.read(375)
        if head[:4] != b"LASF":
            raise self._error("not a LAS/LAZ file (it does not begin with LASF)", "check what this file is")
        if len(head) < 227:
            raise self._error(f"cut off inside the header: {len(head)} of at least 227 bytes")
        version = (head[24], head[25])
        if version[0] != 1 or version[1] not in _HEADER_BYTES:
            raise self._error(
                f"LAS version {version[0]}.{version[1]}, expected 1.0 to 1.4", "convert it to LAS 1.4"
            )
        if len(head) < _HEADER_BYTES[version[1]]:
            raise self._error(f"cut off inside the header: {len(head)} of {_HEADER_BYTES[version[1]]} bytes")
        header_bytes, point_offset, n_vlrs = struct.unpack_from("<HII", head, 94)
        format_byte, record_bytes, n_legacy = struct.unpack_from("<BHI", head, 104)
        point_format, is_laz = format_byte & 0x3F, bool(format_byte & 0xC0)
        self._check_sizes(version[1], header_bytes, point_offset, n_vlrs, point_format, record_bytes)
        n_points = n_legacy
        if version[1] == 4:
            n_points = struct.unpack_from("<Q", head, 247)[0] or n_legacy
        vlrs = self._vlrs(header_bytes, n_vlrs, point_offset)
        if version[1] == 4:
            vlrs += self._evlrs(*struct.unpack_from("<QI", head, 235))
        scales, offsets = struct.unpack_from("<3d", head, 131), struct.unpack_from("<3d", head, 155)
        self._check_scales(scales, offsets)
        laz = None
        if is_laz:
            laz = read_laz_table(self.path, self.file, vlrs, point_offset, record_bytes, n_points)
            self.warnings += laz.warnings
        else:
            self._check_length(n_points, point_offset, record_bytes)
        projection = tuple((record, data) for user, record, data in vlrs if user == b"LASF_Projection")
        return LasHeader(
            version, point_format, record_bytes, n_points, point_offset, scales, offsets,
            bool(struct.unpack_from("<H", head, 6)[0] & 1), projection, laz, tuple(self.warnings),
        )  # fmt: skip

    def _error(self, problem: str, advice: str = _DAMAGED) -> InputError:
        return InputError(problem, where=self.path, advice=advice)

    def _check_sizes(
        self, minor: int, header: int, points: int, n_vlrs: int, point_format: int, record: int
    ) -> None:
        if header < _HEADER_BYTES[minor] or header > self.n_bytes:
            raise self._error(
                f"header says it is {header} bytes long, expected {_HEADER_BYTES[minor]} or a little more"
                f" in a file of {self.n_bytes}"
            )
        if not header <= points <= self.n_bytes:
            raise self._error(
                f"points should start at byte {points}, but the header ends at {header} and the file at"
                f" {self.n_bytes}"
            )
        if n_vlrs * 54 > points - header:
            raise self._error(
                f"header promises {n_vlrs} variable length records, but there are {points - header} bytes for them"
            )
        if point_format not in RECORD_BYTES:
            raise self._error(f"point format {point_format}, expected 0 to 10", "convert it to LAS 1.4")
        if record < RECORD_BYTES[point_format]:
            raise self._error(
                f"point records of {record} bytes, point format {point_format} needs {RECORD_BYTES[point_format]}"
            )

    def _check_scales(self, scales: tuple[float, ...], offsets: tuple[float, ...]) -> None:
        for axis, scale, offset in zip("xyz", scales, offsets, strict=True):
            # 1e-9 m to 1e6 m per step: finer than atoms or coarser than the earth is no survey.
            if not (math.isfinite(scale) and 1e-9 <= abs(scale) <= 1e6):
                raise self._error(f"{axis} scale is {scale:g}, expected a size such as 0.001")
            # No projected coordinate is larger than some 1e8 (feet, false eastings with a zone prefix).
            if not (math.isfinite(offset) and abs(offset) <= 1e9):
                raise self._error(f"{axis} offset is {offset:g}, expected at most 1e9")
            if scale < 0:
                self.warnings.append(f"{axis} scale is negative ({scale:g})")

    def _check_length(self, n_points: int, point_offset: int, record_bytes: int) -> None:
        held, rest = divmod(self.n_bytes - point_offset, record_bytes)
        if n_points > held:
            raise self._error(
                f"header promises {n_points:,} points but the file holds {held:,} (cut off or damaged)"
            )
        if n_points < held and n_points:
            self.warnings.append(
                f"{(held - n_points) * record_bytes + rest:,} bytes after the last of {n_points:,} points"
            )

    def _vlrs(self, start: int, n_vlrs: int, end: int) -> list[tuple[bytes, int, bytes]]:
        """Return (user id, record id, data) of the variable length records; `end` is where the points start."""
        self.file.seek(start)
        block = self.file.read(end - start)
        found, at = [], 0
        for i in range(n_vlrs):
            if at + 54 > len(block):
                raise self._error(f"only {i} of {n_vlrs} variable length records fit before the points")
            user, record, length = struct.unpack_from("<16sHH", block, at + 2)
            if at + 54 + length > len(block):
                raise self._error(
                    f"variable length record {i + 1} of {n_vlrs} runs {at + 54 + length - len(block)} bytes into"
                    " the points"
                )
            found.append((user.split(b"\0")[0], record, block[at + 54 : at + 54 + length]))
            at += 54 + length
        return found

    def _evlrs(self, start: int, n_evlrs: int) -> list[tuple[bytes, int, bytes]]:
        """Return the CRS records among the extended ones; others (waveforms, COPC hierarchy) are passed over."""
        if n_evlrs == 0:
            return []
        if start < 375 or start + 60 * n_evlrs > self.n_bytes:
            raise self._error(
                f"header promises {n_evlrs} extended records from byte {start}, the file ends at {self.n_bytes}"
            )
        found, at = [], start
        for i in range(n_evlrs):
            self.file.seek(at)
            head = self.file.read(60)
            if len(head) < 60:
                raise self._error(f"only {i} of {n_evlrs} extended records are in the file")
            user, record, length = struct.unpack_from("<16sHQ", head, 2)
            if at + 60 + length > self.n_bytes:
                raise self._error(f"extended record {i + 1} of {n_evlrs} runs past the end of the file")
            name = user.split(b"\0")[0]
            # A WKT is some kB; what calls itself one and is larger than 1 MB is not read.
            if name == b"LASF_Projection" and length <= 1 << 20:
                found.append((name, record, self.file.read(length)))
            at += 60 + length
        return found
