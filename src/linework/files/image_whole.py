"""Are the data of an image whole: decoders fill up what is missing, and say nothing."""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np

from linework.arrays import AnyArray
from linework.errors import InputError

#: Rows that a JPEG decoder makes up at once where the data end early (one or two rows of 8 x 8 blocks).
_BLOCK_ROWS = 16
#: What it makes up: blocks without data are in the middle of the scale.
_MADE_UP_GREY = 128
#: What to do about it.
DAMAGED = "copy the file again, or leave it out"


def check_complete(data: bytes, kind: str, path: Path) -> None:
    """Refuse a JPEG without its end and a PNG whose checksums do not hold: decoders fill up what is missing."""
    if kind in ("JPEG", "MPO") and data.rfind(b"\xff\xd9") < data.rfind(b"\xff\xda"):
        raise InputError(
            f"JPEG cut off after {len(data):,} bytes (it has no end)", where=path, advice=DAMAGED
        )
    if kind == "PNG":
        place, name = 8, b""
        while name != b"IEND":
            n = int.from_bytes(data[place : place + 4])
            name, end = data[place + 4 : place + 8], place + 8 + n
            if len(data) < end + 4:
                raise InputError(f"PNG cut off after {len(data):,} bytes", where=path, advice=DAMAGED)
            # Notes that are damaged spoil no pixel; their names begin with a small letter
            is_needed = name[:1].isupper()
            if is_needed and zlib.crc32(data[place + 4 : end]) != int.from_bytes(data[end : end + 4]):
                raise InputError(f"damaged PNG (checksum at byte {place:,})", where=path, advice=DAMAGED)
            place = end + 4


def check_tail(values: AnyArray, path: Path, *, is_jpeg: bool) -> None:
    """Refuse an image whose last rows are one grey: a JPEG whose data ended early though its end is there.

    Lenses, noise and rounding leave no 16 whole rows of one value, except where all is black or white. Other
    formats may hold what was decoded from such a JPEG, where the rows are 128; drawn images of theirs may end in
    rows of another grey.
    """
    tail = values[-_BLOCK_ROWS:]
    value = int(tail[0, 0])
    is_made_up = value == _MADE_UP_GREY or (is_jpeg and 0 < value < 255)
    if is_made_up and bool(np.all(tail == value)):
        whole = np.flatnonzero(np.any(values != value, axis=1))
        first = int(whole[-1]) + 1 if len(whole) else 0
        raise InputError(
            f"rows {first} to {len(values) - 1} are one grey ({value}): its data end early", where=path,
            advice=DAMAGED,
        )  # fmt: skip
