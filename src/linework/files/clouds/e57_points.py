"""Read the points of E57 files in batches, scan after scan, with each scan's pose."""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.errors import InputError, needed
from linework.files.clouds.e57_header import CARTESIAN, E57Scan, E57Scans, e57_columns
from linework.files.clouds.rows import MOST_INTENSITY, check_steps
from linework.files.clouds.table import DAMAGED_ADVICE
from linework.files.input import plainly_named
from linework.files.las.batches import EARLIEST_S, LATEST_S, LasBatch
from linework.files.las.header import LasHeader
from linework.model.points import FARTHEST_COORDINATE_M

#: Flags of points; any value but 0 says that what it is about must not be used.
_NO_INTENSITY, _NO_TIME = "isIntensityInvalid", "isTimeStampInvalid"
_NO_PLACE = {True: "cartesianInvalidState", False: "sphericalInvalidState"}


def read_e57_batches(
    path: Path, header: LasHeader, *, factors: tuple[float, float], carry: Sequence[str], batch_points: int
) -> Generator[LasBatch, None, None]:
    """Yield all points of an E57 file, as `linework.files.las.batches.read_las_batches` those of a laser file.

    Raises
    ------
    InputError
        Points are missing, cannot be read, or have coordinates that 32-bit numbers round to more than a millimetre.
    """
    scans = header.cloud
    assert isinstance(scans, E57Scans)
    fields = e57_columns(scans)
    low, factor = _intensity_scale(path, scans, batch_points)
    for scan, values in _read(path, scans, batch_points):
        missing = _flags(values, _NO_PLACE[scan.place == CARTESIAN])
        xyz = _placed(path, scan, values, missing)
        xyz *= np.array([factors[0], factors[0], factors[1]])
        n = len(xyz)
        intensity = np.zeros(n, dtype=np.uint16)
        if "intensity" in values:
            with np.errstate(over="ignore", invalid="ignore"):
                scaled = np.nan_to_num((values["intensity"] - low) * factor)
            intensity[:] = np.clip(np.rint(scaled), 0, MOST_INTENSITY)
            intensity[_flags(values, _NO_INTENSITY)] = 0
        columns = np.full((len(carry), n), np.nan, dtype=np.float32)
        for i, name in enumerate(carry):
            if name == "point_source_id":
                columns[i] = scan.number
            elif name in fields:
                # Returns count from 0
                columns[i] = values[fields[name]] + (name == "return_number")
        with np.errstate(invalid="ignore"):
            absurd = np.asarray(~(np.abs(xyz) < FARTHEST_COORDINATE_M).all(axis=1))
        time, untimed = _times(scan, values) if scans.has_time else (None, None)
        xyz[absurd] = np.nan
        yield LasBatch(
            xyz, intensity, time, columns, None, None, _or_none(absurd), untimed, _or_none(missing)
        )


def _flags(values: Mapping[str, FloatArray], name: str) -> BoolArray:
    n = len(next(iter(values.values())))
    return np.asarray(values[name] != 0.0) if name in values else np.zeros(n, dtype=np.bool_)


def _or_none(mask: BoolArray) -> BoolArray | None:
    return mask if mask.any() else None


def _times(scan: E57Scan, values: Mapping[str, FloatArray]) -> tuple[FloatArray, BoolArray | None]:
    time = values["timeStamp"] + (scan.start_s or 0.0)
    time[_flags(values, _NO_TIME)] = np.nan
    with np.errstate(invalid="ignore"):
        return time, _or_none(np.asarray(~((time >= EARLIEST_S) & (time <= LATEST_S))))


def _placed(path: Path, scan: E57Scan, values: Mapping[str, FloatArray], missing: BoolArray) -> FloatArray:
    """Return the coordinates (n, 3) in the frame of the file, in its unit; those of missing points are not checked."""
    first, second, third = (values[name] for name in scan.place)
    with np.errstate(over="ignore", invalid="ignore"):
        if scan.place == CARTESIAN:
            coarse = [i for i, single in enumerate(scan.single) if single]
            check_steps(path, np.stack([first, second, third], axis=1)[~missing], coarse)
            x, y, z = first, second, third
        else:
            level = first * np.cos(third)
            x, y, z = level * np.cos(second), level * np.sin(second), first * np.sin(third)
        # Term by term: products of matrices are rounded by how many rows they have
        r, t = scan.rotation, scan.translation
        return np.stack([r[k] * x + r[k + 1] * y + r[k + 2] * z + t[k // 3] for k in (0, 3, 6)], axis=1)


def _intensity_scale(path: Path, scans: E57Scans, n_batch: int) -> tuple[float, float]:
    """Return what is taken off intensities, and the factor that brings them to 0 to 65,535.

    Shares of one are of full scale, and what fits is taken as it is, so that files stay comparable; other ranges, such as
    decibels, are stretched, all scans of a file alike. Limits that are wider than all values of a laser file are those of
    a type of numbers, over which the intensities would become one: then the range is that of the points.
    """
    if not scans.has_intensity:
        return 0.0, 1.0
    low, high = scans.intensity_range or (-np.inf, np.inf)
    if high - low > MOST_INTENSITY:
        low, high = _range_in_points(path, scans, n_batch)
    if low >= 0.0 and high <= MOST_INTENSITY:
        return 0.0, float(MOST_INTENSITY) if high <= 1.0 else 1.0
    return low, MOST_INTENSITY / (high - low) if high > low else 1.0


def _range_in_points(path: Path, scans: E57Scans, n_batch: int) -> tuple[float, float]:
    """Return the least and largest intensity of the points that have a place and an intensity to be used."""
    low, high = np.inf, -np.inf
    for scan, values in _read(path, scans, n_batch, only=("intensity", _NO_INTENSITY, *_NO_PLACE.values())):
        if "intensity" not in values:
            continue
        unused = _flags(values, _NO_INTENSITY) | _flags(values, _NO_PLACE[scan.place == CARTESIAN])
        given = values["intensity"][~unused]
        given = given[np.isfinite(given)]
        low, high = min(low, float(given.min(initial=np.inf))), max(high, float(given.max(initial=-np.inf)))
    return (low, high) if low <= high else (0.0, 0.0)


def _read(
    path: Path, scans: E57Scans, n_batch: int, only: Sequence[str] = ()
) -> Iterator[tuple[E57Scan, dict[str, FloatArray]]]:
    """Yield the values (n,) of fields in batches, scan after scan; overwritten by the next ones."""
    libe57 = needed("pye57.libe57", "e57", where=path)
    further = frozenset(e57_columns(scans).values())
    n_read = 0
    with contextlib.ExitStack() as held:
        plain = held.enter_context(plainly_named(path))
        try:
            file = libe57.ImageFile(str(plain), "r")
            held.callback(file.close)
            for scan in scans.scans:
                wanted = [name for name in _wanted(scan, further, scans.has_time) if not only or name in only]
                if not wanted:
                    continue
                n_scan = 0
                for values in _values(libe57, file, scan, wanted, n_batch):
                    n_scan += len(values[wanted[0]])
                    n_read += len(values[wanted[0]])
                    yield scan, values
                if n_scan != scan.n_points:
                    raise InputError(
                        f"scan {scan.number} promises {scan.n_points:,} points but the file holds {n_scan:,} (cut off or"
                        " damaged)", where=path, advice=DAMAGED_ADVICE,
                    )  # fmt: skip
        except libe57.E57Exception as error:
            raise InputError(
                f"points {n_read:,} to {scans.n_points:,} cannot be read ({' '.join(str(error).split())[:80]})",
                where=path, advice=DAMAGED_ADVICE,
            ) from error  # fmt: skip


def _wanted(scan: E57Scan, further: Collection[str], has_time: bool) -> list[str]:
    times = ("timeStamp", _NO_TIME) if has_time else ()
    flag = _NO_PLACE[scan.place == CARTESIAN]
    return [
        name for name in scan.fields
        if name in scan.place or name in ("intensity", _NO_INTENSITY, flag, *times, *further)
    ]  # fmt: skip


def _values(
    libe57: Any, file: Any, scan: E57Scan, names: Sequence[str], n_batch: int
) -> Iterator[dict[str, FloatArray]]:
    n = min(n_batch, scan.n_points)
    arrays = {name: np.empty(n) for name in names}
    buffers = libe57.VectorSourceDestBuffer()
    for name, array in arrays.items():
        buffers.append(libe57.SourceDestBuffer(file, name, array, n, True, True))
    reader = file.root()["data3D"][scan.number - 1]["points"].reader(buffers)
    try:
        while (k := reader.read()) > 0:
            yield {name: array[:k] for name, array in arrays.items()}
    finally:
        reader.close()
