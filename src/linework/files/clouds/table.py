"""Where the values of points are in a PLY or PCD file, and which of them are places, intensities and times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from linework.errors import InputError

#: Rows of text, rows of bytes, or columns one after the other, compressed by LZF.
Encoding = Literal["text", "rows", "columns"]
#: Names of the columns that every point has or may have, as programs write them, in lower case.
_INTENSITY = ("intensity", "scalar_intensity", "reflectance", "reflectivity", "i")
_TIME = ("gps_time", "gpstime", "scalar_gps_time", "scalar_gpstime", "time", "timestamp", "t")
#: Suffixes of the formats.
CLOUD_SUFFIXES = (".ply", ".pcd", ".e57")
#: Most columns of a point, and bytes of a header: no scanner writes more, and both bound what is read of a damaged file.
_MOST_COLUMNS, MOST_HEADER_BYTES = 256, 1 << 16
DAMAGED_ADVICE = "copy the file again, or leave it out"


@dataclass(frozen=True, slots=True)
class CloudTable:
    """The points of a file as a table.

    Parameters
    ----------
    row
        Type of a row, with the columns' names in lower case, packed, in the byte order of the file.
    first_byte
        Where the points begin.
    xyz
        Names of the coordinates.
    intensity, time
        Names of these columns; "" without one.
    """

    row: np.dtype[Any]
    encoding: Encoding
    first_byte: int
    xyz: tuple[str, str, str]
    intensity: str
    time: str

    @property
    def further(self) -> tuple[str, ...]:
        """Names of the other columns."""
        own = {*self.xyz, self.intensity, self.time}
        return tuple(name for name in self.row.names or () if name not in own)


def cloud_table(
    path: Path,
    columns: Sequence[tuple[str, str]],
    encoding: Encoding,
    first_byte: int,
) -> CloudTable:
    """Return the table of columns (name, numpy's type).

    Raises
    ------
    InputError
        No coordinates, one name twice, or too many columns.
    """
    names = [name.lower() for name, _ in columns]
    twice = next((name for i, name in enumerate(names) if name in names[:i]), None)
    if twice is not None:
        raise InputError(f"two columns named {twice[:40]}", where=path, advice="name each column once")
    if len(columns) > _MOST_COLUMNS:
        raise InputError(
            f"{len(columns):,} columns, at most {_MOST_COLUMNS}", where=path, advice=DAMAGED_ADVICE
        )
    missing = [name for name in "xyz" if name not in names]
    if missing:
        raise InputError(f"points without {', '.join(missing)} (columns: {', '.join(names)[:80] or 'none'})",
                         where=path, advice="write x, y and z for each point")  # fmt: skip
    row = np.dtype([(name, kind) for name, (_, kind) in zip(names, columns, strict=True)])
    return CloudTable(
        row, encoding, first_byte, ("x", "y", "z"),
        next((name for name in _INTENSITY if name in names), ""), next((name for name in _TIME if name in names), ""),
    )  # fmt: skip


def check_rows_fit(path: Path, table: CloudTable, n_points: int, n_bytes: int) -> None:
    """Refuse a header that promises more points than the file can hold.

    Raises
    ------
    InputError
        With both numbers.
    """
    # A value of text takes a digit and a space
    least = table.row.itemsize if table.encoding == "rows" else 2 * len(table.row.names or ())
    if table.encoding != "columns" and n_points * least > n_bytes - table.first_byte + 1:
        raise InputError(
            f"header promises {n_points:,} points but the file holds at most {(n_bytes - table.first_byte) // least:,}"
            " (cut off or damaged)", where=path, advice=DAMAGED_ADVICE,
        )  # fmt: skip
