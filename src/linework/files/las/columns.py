"""Further columns of LAS files, by name: extra dimensions, and standard fields beside place, time and intensity.

References
----------
ASPRS, LAS Specification 1.4 - R15: point formats in section 2.6, the extra bytes record in section 4 (tables 24, 25).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import lazrs
import numpy as np

from linework.arrays import AnyArray, Float32Array

#: User and number of the record that describes extra bytes, and the bytes of each description.
_USER, _RECORD, _BYTES = b"LASF_Spec", 4, 192
#: Types of extra bytes by number, from 1; the next ten are pairs of these, the ten after that triples.
_TYPES = ("u1", "i1", "<u2", "<i2", "<u4", "<i4", "<u8", "<i8", "<f4", "<f8")
#: Bits of the options: a value stands for "none", values are scaled, an offset is added to them.
_HAS_NO_DATA, _HAS_SCALE, _HAS_OFFSET = 1, 8, 16
#: Degrees per unit of the scan angle of point formats 6 to 10.
_SCAN_ANGLE_DEG = 0.006
#: First byte of red, green and blue by point format.
_COLOUR_BYTE = {2: 20, 3: 28, 5: 28, 7: 30, 8: 30, 10: 30}


@dataclass(frozen=True, slots=True)
class LasColumn:
    """Where a column is in a point record, and what its values mean.

    Parameters
    ----------
    dtype
        As numpy names it.
    offset
        First byte in the record.
    shift, mask
        Bits of a whole number: ``(value >> shift) & mask``; mask 0: all bits.
    scale, added
        The column is ``scale * value + added``.
    no_data
        Value that stands for "none", which becomes NaN; None: there is none.
    layer
        Part of a compressed file that must be unpacked for it, as lazrs numbers them.
    """

    name: str
    dtype: str
    offset: int
    shift: int = 0
    mask: int = 0
    scale: float = 1.0
    added: float = 0.0
    no_data: float | None = None
    layer: int = lazrs.SELECTIVE_DECOMPRESS_ALL_EXTRA_BYTES

    def values(self, raw: AnyArray, out: Float32Array) -> None:
        """Write the values (n,) of a field of records, of this dtype, to `out`."""
        # What float32 does not reach becomes infinite; scales of a damaged file may be no numbers
        with np.errstate(over="ignore", invalid="ignore"):
            if self.mask:
                out[:] = (raw >> self.shift) & self.mask
            elif self.scale == 1.0 and self.added == 0.0:
                out[:] = raw
            else:
                # In float64: an offset may be large
                out[:] = raw.astype(np.float64) * self.scale + self.added
        if self.no_data is not None:
            out[raw == self.no_data] = np.nan


def columns_of_las(
    point_format: int, record_bytes: int, standard_bytes: int, records: Sequence[tuple[bytes, int, bytes]]
) -> dict[str, LasColumn]:
    """Return the further columns of a file by name: extra dimensions first.

    Parameters
    ----------
    record_bytes, standard_bytes
        Bytes of a point record, and of one without extra bytes.
    records
        (user id, record id, data) of the variable length records.

    Notes
    -----
    Extra dimensions of two or three values are the columns ``name[0]``, ``name[1]`` and ``name[2]``. Bytes without a
    description, or of a type that is not a number, are passed over.

    Examples
    --------
    >>> list(columns_of_las(0, 20, 20, []))[:4]
    ['classification', 'return_number', 'number_of_returns', 'user_data']
    """
    data = next((data for user, record, data in records if user == _USER and record == _RECORD), b"")
    found = dict[str, LasColumn]()
    for column in (*_extra(data, standard_bytes, record_bytes), *_standard(point_format)):
        found.setdefault(column.name, column)
    return found


def _extra(data: bytes, start: int, end: int) -> Iterator[LasColumn]:
    """Yield the columns that descriptions of extra bytes name."""
    at = start
    for first in range(0, len(data) - _BYTES + 1, _BYTES):
        number, options = data[first + 2], data[first + 3]
        name = data[first + 4 : first + 36].split(b"\0")[0].decode("utf-8", errors="replace").strip()
        if number == 0:  # bytes of no type: the options are their number
            at += options
            continue
        if number > 3 * len(_TYPES):  # of a later specification: where the next one begins is not known
            return
        kind, n_values = _TYPES[(number - 1) % len(_TYPES)], 1 + (number - 1) // len(_TYPES)
        size = int(kind[-1])
        for i in range(n_values):
            if at + size > end:
                return
            more = first + 8 * i
            scale, added = (struct.unpack_from("<d", data, more + byte)[0] for byte in (112, 136))
            none = struct.unpack_from({"u": "<Q", "i": "<q", "f": "<d"}[kind[-2]], data, more + 40)[0]
            if name:
                yield LasColumn(
                    name if n_values == 1 else f"{name}[{i}]", kind, at,
                    scale=scale if options & _HAS_SCALE else 1.0,
                    added=added if options & _HAS_OFFSET else 0.0,
                    no_data=none if options & _HAS_NO_DATA else None,
                )  # fmt: skip
            at += size


def _standard(point_format: int) -> Iterator[LasColumn]:
    """Yield the standard fields beside place, time and intensity (specification tables 7 to 17)."""
    returns = lazrs.SELECTIVE_DECOMPRESS_XY_RETURNS_CHANNEL
    user, source = lazrs.SELECTIVE_DECOMPRESS_USER_DATA, lazrs.SELECTIVE_DECOMPRESS_POINT_SOURCE_ID
    classes, angle = lazrs.SELECTIVE_DECOMPRESS_CLASSIFICATION, lazrs.SELECTIVE_DECOMPRESS_SCAN_ANGLE
    if point_format >= 6:
        yield LasColumn("classification", "u1", 16, layer=classes)
        yield LasColumn("return_number", "u1", 14, mask=15, layer=returns)
        yield LasColumn("number_of_returns", "u1", 14, shift=4, mask=15, layer=returns)
        yield LasColumn("user_data", "u1", 17, layer=user)
        yield LasColumn("point_source_id", "<u2", 20, layer=source)
        yield LasColumn("scan_angle", "<i2", 18, scale=_SCAN_ANGLE_DEG, layer=angle)
    else:
        yield LasColumn("classification", "u1", 15, mask=31, layer=classes)
        yield LasColumn("return_number", "u1", 14, mask=7, layer=returns)
        yield LasColumn("number_of_returns", "u1", 14, shift=3, mask=7, layer=returns)
        yield LasColumn("user_data", "u1", 17, layer=user)
        yield LasColumn("point_source_id", "<u2", 18, layer=source)
        yield LasColumn("scan_angle", "i1", 16, layer=angle)
    flags = lazrs.SELECTIVE_DECOMPRESS_FLAGS
    # A LAZ file of the old formats keeps these bits with the returns
    flag_byte, flag_layer = (15, flags) if point_format >= 6 else (14, returns)
    yield LasColumn("scan_direction_flag", "u1", flag_byte, shift=6, mask=1, layer=flag_layer)
    yield LasColumn("edge_of_flight_line", "u1", flag_byte, shift=7, mask=1, layer=flag_layer)
    if point_format >= 6:
        yield LasColumn("scanner_channel", "u1", 15, shift=4, mask=3, layer=returns)
    if point_format in _COLOUR_BYTE:
        for i, name in enumerate(("red", "green", "blue")):
            first = _COLOUR_BYTE[point_format]
            yield LasColumn(name, "<u2", first + 2 * i, layer=lazrs.SELECTIVE_DECOMPRESS_RGB)
