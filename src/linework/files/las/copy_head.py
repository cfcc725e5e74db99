"""What stands before and behind the points of a LAS file, for a copy whose records are longer.

Separate from `copy`, which copies the points: nothing here looks at one. Bytes that need not change stay as they are.

References
----------
ASPRS, LAS Specification 1.4 - R15: header in section 2.4, records in 2.5 and 2.7, classification lookup and extra bytes
in section 4. COPC 1.0 (https://copc.io): its records hold places of chunks in the file.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from linework.errors import InputError
from linework.files.las.header import EXTENDED_HEAD_BYTES, HEAD_BYTES, RECORD_BYTES, LasHeader

#: (user id, record id) of records: of the compressor, of extra bytes, of names of classes, and of COPC.
_LASZIP, _EXTRA, _LOOKUP = (b"laszip encoded", 22204), (b"LASF_Spec", 4), (b"LASF_Spec", 0)
_COPC = {(b"copc", 1), (b"copc", 1000)}
#: Numbers of the types of extra bytes that are added, and their sizes. [bytes]
_TYPES = {"u1": (1, 1), "<u4": (5, 4)}
#: Bytes of the description of an extra dimension, and most bytes without a description that one can stand for.
_DESCRIPTION_BYTES, _MOST_UNDESCRIBED = 192, 255
#: Classes of a table of classes, and bytes of each: its number, and its name.
_N_CLASSES, _NAME_BYTES = 256, 15
#: Places in the header: bits of the encoding, bytes before the points, records, length of a point record, and, in
#: versions 1.3 and 1.4, waveforms and extended records.
_ENCODING, _POINTS, _N_RECORDS, _RECORD, _WAVEFORMS, _EXTENDED = 6, 96, 100, 105, 227, 235
_HAS_WAVEFORMS_INSIDE, _HAS_EXTENDED, _HAS_WAVEFORMS_OFFSET = 2, 4, 3
#: Largest point record, and largest data of a record. [bytes]
_MOST_BYTES = 65_535


@dataclass(frozen=True, slots=True)
class ExtraColumn:
    """An extra dimension that a copy gets: its name, its type ("u1" or "<u4") and what it is, at most 32 characters."""

    name: str
    dtype: str
    description: str

    @property
    def n_bytes(self) -> int:
        """Bytes in a point record."""
        return _TYPES[self.dtype][1]

    def described(self) -> bytes:
        """Return its description (specification, table 24)."""
        number, _ = _TYPES[self.dtype]
        head = struct.pack("<2xBB32s4x", number, 0, self.name.encode())
        return head + bytes(120) + self.description.encode()[:32].ljust(32, b"\0")


@dataclass(frozen=True, slots=True)
class CopyHead:
    """What stands before and behind the points of a copy.

    Parameters
    ----------
    before
        Header and records, up to the points.
    behind
        Extended records and what follows them; empty without any.
    record_bytes
        Length of a point record.
    left_out
        What cannot be copied, in words.
    """

    before: bytes
    behind: bytes
    record_bytes: int
    left_out: tuple[str, ...]

    def finished(self, end: int, waveforms: int) -> bytes:
        """Return the header and records of a file whose points end at a byte.

        Parameters
        ----------
        waveforms
            Where waveforms begin behind that byte, as far as they did in the original; -1: there are none.
        """
        out = bytearray(self.before)
        if out[25] >= _HAS_EXTENDED and struct.unpack_from("<I", out, _EXTENDED + 8)[0]:
            struct.pack_into("<Q", out, _EXTENDED, end)
        if waveforms >= 0:
            struct.pack_into("<Q", out, _WAVEFORMS, end + waveforms)
        return bytes(out)


def copy_head(
    path: Path,
    file: BinaryIO,
    header: LasHeader,
    columns: Sequence[ExtraColumn],
    classes: Mapping[int, str],
    laszip: bytes | None,
) -> tuple[CopyHead, int]:
    """Return header and records of a copy with further columns, and how far behind the points waveforms begin (-1: none).

    Parameters
    ----------
    columns
        Extra dimensions behind those that are there.
    classes
        Names of classes by their numbers; empty: the file gets no table of them.
    laszip
        Data of the compressor's record of the copy; None: it is not compressed.

    Raises
    ------
    InputError
        The file has a dimension of one of the names, or no room for more.
    """
    names = [column.name for column in columns if column.name in header.columns]
    if names:
        raise InputError(
            f"has the dimension {names[0]} already: it is a classified copy",
            where=path,
            advice="classify the original",
        )
    record_bytes = header.record_bytes + sum(column.n_bytes for column in columns)
    file.seek(0)
    before = file.read(header.point_offset)
    header_bytes, _, n_records = struct.unpack_from("<HII", before, 94)
    records, rest, left_out = _records(before, header_bytes, n_records)
    n_described = _described_bytes(records)
    extra = b"".join(column.described() for column in columns)
    undescribed = header.record_bytes - RECORD_BYTES[header.point_format] - n_described
    extra = _undescribed(undescribed) + extra
    records = _with_data(records, _EXTRA, extra, "Extra bytes", is_added=True)
    if classes:
        records = _with_data(
            records, _LOOKUP, _lookup(records, classes), "Classification lookup", is_added=False
        )
    if laszip is not None:
        records = _with_data(records, _LASZIP, laszip, "", is_added=False)
    too_long = record_bytes > _MOST_BYTES or any(
        len(data) - HEAD_BYTES > _MOST_BYTES for data in records.values()
    )
    if too_long:
        raise InputError("has no room for more extra dimensions", where=path, advice="leave the file out")
    body = b"".join(records.values())
    start = bytearray(before[:header_bytes])
    struct.pack_into("<II", start, _POINTS, header_bytes + len(body) + len(rest), len(records))
    struct.pack_into("<H", start, _RECORD, record_bytes)
    behind, waveforms, lost = _behind(file, start, header)
    head = CopyHead(
        bytes(start) + body + rest, behind, record_bytes, tuple(dict.fromkeys([*left_out, *lost]))
    )
    return head, waveforms


_Key = tuple[bytes, int, int]


def _records(before: bytes, start: int, n_records: int) -> tuple[dict[_Key, bytes], bytes, list[str]]:
    """Return the records as (user id, record id, how many there were before): bytes, what follows them, and what is left out."""
    found: dict[_Key, bytes] = {}
    left_out = []
    for _ in range(n_records):
        user, number, length = struct.unpack_from("<16sHH", before, start + 2)
        name = user.split(b"\0")[0]
        whole = before[start : start + HEAD_BYTES + length]
        start += len(whole)
        if (name, number) in _COPC:
            left_out.append("the index of a COPC file")
            continue
        same = sum(1 for key in found if key[:2] == (name, number))
        found[(name, number, same)] = whole
    return found, before[start:], left_out


def _described_bytes(records: Mapping[_Key, bytes]) -> int:
    """Return the bytes of a point record that the file's extra dimensions describe."""
    data = records.get((*_EXTRA, 0), b"")[HEAD_BYTES:]
    total = 0
    for at in range(0, len(data) - _DESCRIPTION_BYTES + 1, _DESCRIPTION_BYTES):
        number, options = data[at + 2], data[at + 3]
        size = (1, 1, 2, 2, 4, 4, 8, 8, 4, 8)[(number - 1) % 10] if number else 0
        total += size * (1 + (number - 1) // 10) if number else options
    return total


def _undescribed(n: int) -> bytes:
    """Return descriptions of bytes of no type, so that what follows them is found."""
    out = b""
    while n > 0:
        size = min(n, _MOST_UNDESCRIBED)
        out += struct.pack("<2xBB32s", 0, size, b"undescribed").ljust(_DESCRIPTION_BYTES, b"\0")
        n -= size
    return out


def _with_data(
    records: Mapping[_Key, bytes], key: tuple[bytes, int], data: bytes, text: str, *, is_added: bool
) -> dict[_Key, bytes]:
    """Return records with the data of one of them replaced or continued; a new one is the last."""
    out = dict(records)
    whole = out.get((*key, 0), struct.pack("<2x16sHH32s", *key, 0, text.encode()))
    body = whole[HEAD_BYTES:] + data if is_added else data
    out[(*key, 0)] = whole[:20] + struct.pack("<H", len(body) & 0xFFFF) + whole[22:HEAD_BYTES] + body
    return out


def _lookup(records: Mapping[_Key, bytes], classes: Mapping[int, str]) -> bytes:
    """Return a table of classes: the file's own, with ours put in."""
    own = records.get((*_LOOKUP, 0), b"")[HEAD_BYTES:]
    names = {
        own[at]: own[at + 1 : at + 1 + _NAME_BYTES]
        for at in range(0, len(own) - _NAME_BYTES, 1 + _NAME_BYTES)
    }
    names |= {
        number: name.encode()[:_NAME_BYTES].ljust(_NAME_BYTES, b"\0") for number, name in classes.items()
    }
    return b"".join(bytes([i]) + names.get(i, bytes(_NAME_BYTES)) for i in range(_N_CLASSES))


def _behind(file: BinaryIO, start: bytearray, header: LasHeader) -> tuple[bytes, int, list[str]]:
    """Return what follows the points, how far behind them waveforms begin (-1: none), and what of it is left out."""
    minor = start[25]
    waveforms = -1
    first, n_extended = 0, 0
    if minor >= _HAS_EXTENDED:
        first, n_extended = struct.unpack_from("<QI", start, _EXTENDED)
    is_inside = struct.unpack_from("<H", start, _ENCODING)[0] & _HAS_WAVEFORMS_INSIDE
    wave = (
        struct.unpack_from("<Q", start, _WAVEFORMS)[0] if minor >= _HAS_WAVEFORMS_OFFSET and is_inside else 0
    )
    starts = [at for at in (first if n_extended else 0, wave) if at >= header.point_offset]
    if not starts:
        return b"", -1, []
    file.seek(min(starts))
    out = file.read()
    if wave:
        waveforms = wave - min(starts)
    if not n_extended:
        return out, waveforms, []
    kept, n_kept, lost, at = b"", 0, list[str](), first - min(starts)
    before = out[:at]
    for _ in range(n_extended):
        user, number, length = struct.unpack_from("<16sHQ", out, at + 2)
        whole = out[at : at + EXTENDED_HEAD_BYTES + length]
        at += len(whole)
        if (user.split(b"\0")[0], number) in _COPC:
            lost.append("the index of a COPC file")
        else:
            kept, n_kept = kept + whole, n_kept + 1
    struct.pack_into("<I", start, _EXTENDED + 8, n_kept)
    if n_kept == 0:
        struct.pack_into("<Q", start, _EXTENDED, 0)
    return before + kept + out[at:], waveforms, lost
