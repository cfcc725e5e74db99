"""Read the points of PLY and PCD files in batches, as those of laser files."""

from __future__ import annotations

import itertools
import struct
from collections.abc import Generator, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.errors import InputError
from linework.files.clouds.lzf import unpacked_lzf
from linework.files.clouds.table import DAMAGED_ADVICE, CloudTable
from linework.files.las.batches import EARLIEST_S, LATEST_S, LasBatch
from linework.files.las.header import LasHeader
from linework.model.points import FARTHEST_COORDINATE_M

#: Coarsest step of coordinates: a tenth of what lines are asked to be right to. [m]
_COARSEST_M = 1e-3
#: Largest intensity of a laser file.
MOST_INTENSITY = 65_535
#: Intensities of which this share is from 0 to 1 are shares of full scale; the others are beyond it. [share]
_MOST_OF_THEM = 0.99
#: Longest line of text [characters]: a point has some ten numbers.
_LONGEST_LINE = 65_536


def read_cloud_batches(
    path: Path, header: LasHeader, *, factors: tuple[float, float], carry: Sequence[str], batch_points: int
) -> Generator[LasBatch, None, None]:
    """Yield all points of a PLY or PCD file, as `linework.files.las.batches.read_las_batches` those of a laser file.

    Raises
    ------
    InputError
        Points are missing, cannot be read, or have coordinates that 32-bit numbers round to more than a millimetre.
    """
    table = header.cloud
    assert isinstance(table, CloudTable)
    factor = _intensity_factor(path, header, table, batch_points)
    for rows in _checked(path, header, table, batch_points):
        xyz = np.stack([rows[name].astype(np.float64) for name in table.xyz], axis=1)
        # Text has the digits that it has, whatever type its header names
        if table.encoding != "text":
            coarse = [i for i, name in enumerate(table.xyz) if table.row[name] in ("<f4", ">f4")]
            check_steps(path, xyz, coarse)
        xyz *= np.array([factors[0], factors[0], factors[1]])
        n = len(rows)
        intensity = np.zeros(n, dtype=np.uint16)
        if table.intensity:
            values = np.nan_to_num(rows[table.intensity].astype(np.float64) * factor)
            intensity[:] = np.clip(np.rint(values), 0, MOST_INTENSITY)
        time = rows[table.time].astype(np.float64) if table.time else None
        columns = np.full((len(carry), n), np.nan, dtype=np.float32)
        with np.errstate(over="ignore", invalid="ignore"):
            for i, name in enumerate(carry):
                if name in table.further:
                    columns[i] = rows[name]
            # Places that are no numbers stand for beams without a return
            absurd = np.asarray(~(np.abs(xyz) < FARTHEST_COORDINATE_M).all(axis=1))
            untimed = None if time is None else np.asarray(~((time >= EARLIEST_S) & (time <= LATEST_S)))
        xyz[absurd] = np.nan
        yield LasBatch(
            xyz, intensity, time, columns, None, None, absurd if absurd.any() else None,
            untimed if untimed is not None and untimed.any() else None,
        )  # fmt: skip


def check_steps(path: Path, xyz: FloatArray, coarse: Sequence[int]) -> None:
    """Refuse coordinates (n, 3) that were rounded to more than a millimetre.

    Parameters
    ----------
    coarse
        Which of the axes are 32-bit numbers.

    Raises
    ------
    InputError
        With the largest coordinate, and the step there.
    """
    finite = np.abs(xyz[np.isfinite(xyz).all(axis=1)])
    if not len(finite) or not coarse:
        return
    largest = float(finite[finite.max(axis=1) < FARTHEST_COORDINATE_M][:, coarse].max(initial=0.0))
    step = float(np.spacing(np.float32(largest)))
    if step > _COARSEST_M:
        raise InputError(
            f"coordinates of up to {largest:,.0f} m as 32-bit numbers, which are {step:g} m apart: no offset was taken off",
            where=path, advice="write x, y and z as double, or less a whole offset",
        )  # fmt: skip


def _intensity_factor(path: Path, header: LasHeader, table: CloudTable, n: int) -> float:
    """Return the factor that brings intensities to 0 to 65,535: full scale for shares of one, else 1.

    It is no stretch of a file's own range: files of one survey stay comparable.
    """
    if not table.intensity or table.row[table.intensity].kind != "f":
        return 1.0
    n_all = n_shares = n_whole = 0
    for rows in _checked(path, header, table, n):
        values = rows[table.intensity].astype(np.float64)
        values = values[np.isfinite(values)]
        n_all += len(values)
        n_shares += int(np.count_nonzero((values >= 0.0) & (values <= 1.0)))
        n_whole += int(np.count_nonzero(values == np.rint(values)))
    return float(MOST_INTENSITY) if n_shares >= _MOST_OF_THEM * n_all and n_whole < n_all else 1.0


def _checked(path: Path, header: LasHeader, table: CloudTable, n_batch: int) -> Iterator[AnyArray]:
    """Yield the rows (n,) in batches; as many as the header promises."""
    read = {"text": _text_rows, "rows": _byte_rows, "columns": _column_rows}[table.encoding]
    n_read = 0
    with path.open("rb") as file:
        file.seek(table.first_byte)
        try:
            for rows in read(file, table, header.n_points, n_batch):
                n_read += len(rows)
                yield rows
        except (ValueError, struct.error) as error:
            raise InputError(
                f"points {n_read:,} to {header.n_points:,} cannot be read ({str(error)[:60]})", where=path,
                advice=DAMAGED_ADVICE,
            ) from error  # fmt: skip
    if n_read != header.n_points:
        raise InputError(
            f"header promises {header.n_points:,} points but the file holds {n_read:,} (cut off or damaged)",
            where=path, advice=DAMAGED_ADVICE,
        )  # fmt: skip


def _byte_rows(file: BinaryIO, table: CloudTable, n_points: int, n_batch: int) -> Iterator[AnyArray]:
    for first in range(0, n_points, n_batch):
        n = min(n_batch, n_points - first)
        data = file.read(n * table.row.itemsize)
        yield np.frombuffer(data, table.row, len(data) // table.row.itemsize)
        if len(data) < n * table.row.itemsize:
            return


def _text_rows(file: BinaryIO, table: CloudTable, n_points: int, n_batch: int) -> Iterator[AnyArray]:
    names = table.row.names or ()
    # Values of text are read as they stand there, not as the type that the header names
    row = np.dtype([(name, "<f8") for name in names])
    for first in range(0, n_points, n_batch):
        n = min(n_batch, n_points - first)
        lines = [words for line in itertools.islice(_short_lines(file), n) if (words := line.split())]
        wrong = next((words for words in lines if len(words) != len(names)), None)
        if wrong is not None:
            raise ValueError(f"{len(wrong):,} values in a line of {len(names)}")
        values = np.array(lines, dtype=np.float64)
        yield values.reshape(-1, len(names)).view(row)[:, 0]
        if len(lines) < n:
            return


def _short_lines(file: BinaryIO) -> Iterator[bytes]:
    while line := file.readline(_LONGEST_LINE):
        if len(line) == _LONGEST_LINE:
            raise ValueError(f"a line of more than {_LONGEST_LINE:,} characters")
        yield line


def _column_rows(file: BinaryIO, table: CloudTable, n_points: int, n_batch: int) -> Iterator[AnyArray]:
    n_packed, n_bytes = struct.unpack("<II", file.read(8))
    if n_bytes != n_points * table.row.itemsize:
        raise ValueError(f"{n_bytes:,} bytes for {n_points:,} points of {table.row.itemsize}")
    data = file.read(n_packed)
    if len(data) < n_packed:
        raise ValueError(f"{len(data):,} of {n_packed:,} compressed bytes")
    block = unpacked_lzf(data, n_bytes)
    columns, at = {}, 0
    for name in table.row.names or ():
        kind = table.row[name]
        columns[name] = np.frombuffer(block, kind, n_points, at)
        at += n_points * kind.itemsize
    for first in range(0, n_points, n_batch):
        rows = np.zeros(min(n_batch, n_points - first), table.row)
        for name, column in columns.items():
            rows[name] = column[first : first + len(rows)]
        yield rows
