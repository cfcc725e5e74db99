"""A line as bytes, exactly, for the history of a drawing."""

from __future__ import annotations

import json
import math
import struct
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.errors import InputError
from linework.model.lines import LINE_COLUMNS, LineSet

_LENGTH = struct.Struct("<I")
#: The fastest: a commit waits for it, and coordinates do not get much smaller anyway.
_LEVEL = 1
#: No line is larger: six million vertices.
MOST_BYTES = 1 << 28


def line_bytes(lines: LineSet) -> list[bytes]:
    """Return each line as bytes; equal lines give equal bytes.

    Notes
    -----
    The length of a JSON document (4 bytes, little endian), the document (columns of the line, and `n`, its
    vertices), then x, y, z, sigma_xy_m and sigma_z_m of all vertices as float64 and bridged and observed as bytes.
    """
    columns = {name: getattr(lines, name).tolist() for name in LINE_COLUMNS}
    found = []
    for i, (first, end) in enumerate(
        zip(lines.offsets[:-1].tolist(), lines.offsets[1:].tolist(), strict=True)
    ):
        head = {"n": end - first} | {name: _plain(values[i]) for name, values in columns.items()}
        text = json.dumps(head, ensure_ascii=True, allow_nan=False).encode()
        numbers = (lines.xyz, lines.sigma_xy_m, lines.sigma_z_m)
        parts = [values[first:end].astype("<f8").tobytes() for values in numbers]
        parts += [values[first:end].astype(np.uint8).tobytes() for values in (lines.bridged, lines.observed)]
        found.append(b"".join([_LENGTH.pack(len(text)), text, *parts]))
    return found


def packed(line: bytes) -> bytes:
    """Return a line's bytes as they are stored."""
    return zlib.compress(line, _LEVEL)


def unpacked_lines(stored: Sequence[bytes], crs: str) -> LineSet:
    """Return the lines of what was stored.

    Raises
    ------
    InputError
        It was not stored by `packed`, or is damaged.
    """
    try:
        return _unpacked(stored, crs)
    except (ValueError, KeyError, TypeError, struct.error, zlib.error) as error:
        raise InputError("its history is damaged", advice="go back to a copy") from error


def _unpacked(stored: Sequence[bytes], crs: str) -> LineSet:
    heads: list[dict[str, Any]] = []
    numbers: list[FloatArray] = []
    flags: list[AnyArray] = []
    for content in stored:
        # A few bytes may stand for any number of zeros
        line = zlib.decompressobj().decompress(content, MOST_BYTES)
        (length,) = _LENGTH.unpack_from(line)
        start = _LENGTH.size + length
        head = json.loads(line[_LENGTH.size : start])
        n = int(head["n"])
        heads.append(head)
        numbers.append(np.frombuffer(line, "<f8", 5 * n, start))
        flags.append(np.frombuffer(line, np.uint8, 2 * n, start + 40 * n).reshape(2, n))
    if not heads:
        return LineSet.empty(crs)
    columns: dict[str, Any] = {
        "sigma_xy_m": np.concatenate(
            [values[-2 * (len(values) // 5) : -(len(values) // 5)] for values in numbers]
        ),
        "sigma_z_m": np.concatenate([values[-(len(values) // 5) :] for values in numbers]),
        "bridged": np.concatenate([both[0] for both in flags]).astype(bool),
        "observed": np.concatenate([both[1] for both in flags]).astype(bool),
    }
    for name in LINE_COLUMNS:
        meta = LineSet.__dataclass_fields__[name].metadata
        values = [head.get(name, meta["default"]) for head in heads]
        if meta["dtype"] is np.float64:
            values = [math.nan if value is None else value for value in values]
        columns[name] = np.array(values, dtype=meta["dtype"])
    xyz = [values[: 3 * (len(values) // 5)].reshape(-1, 3) for values in numbers]
    return LineSet.from_lines(xyz, crs=crs, **columns)


def _plain(value: Any) -> Any:
    return None if value != value else value
