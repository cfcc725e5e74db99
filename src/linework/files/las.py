"""Read and write laser points: LAS 1.0 to 1.4, LAZ, COPC."""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import lazrs
import numpy as np

from linework.errors import InputError
from linework.files.las_crs import resolve_crs
from linework.files.las_header import LasHeader, read_las_header
from linework.files.las_write import write_las as write_las
from linework.model.arrays import AnyArray, FloatArray
from linework.model.points import Points

#: Points decoded at a time: about 15 MB of records stay near the caches while they are converted, which
#: measures 5 to 10 % faster than one buffer of 4 million.
_BATCH = 500_000
#: Chunks are decoded side by side: two per core even out those that take longer.
_CHUNKS_PER_CORE = 2
#: Farther than any projected coordinate in metres or feet.
_ABSURD_M = 1e8
_WEEK_S = 604_800.0
#: As adjusted standard time this is the year 2043, as GPS seconds 2011: larger numbers are the latter.
_LEAST_GPS_S = 1e9
#: GPS seconds of the year 2106; larger numbers are milliseconds or nanoseconds.
_LAST_S = 4e9
_NOISE, _HIGH_NOISE = 7, 18

TimeKind = Literal["week", "adjusted", "gps", "none"]


@dataclass(frozen=True, slots=True)
class LasContent:
    """The points of one file and what was found on the way.

    Parameters
    ----------
    points
        In metres, in file order, without those rejected.
    crs
        WKT2 or "local".
    n_promised
        Points according to the header.
    n_rejected
        Points left out, by reason; with `points` they add up to `n_promised`.
    gps_time_kind
        "adjusted": GPS seconds less 1e9; "gps": GPS seconds since 1980; "week": seconds of an unknown week;
        "none". Times are given as they are stored.
    """

    points: Points
    crs: str
    n_promised: int
    n_rejected: dict[str, int]
    gps_time_kind: TimeKind
    point_format: int
    version: str
    warnings: tuple[str, ...]


class NoPointsError(InputError):
    """A sound file without points: nothing is lost by leaving it out."""


def read_las(
    path: Path, *, crs: str | None = None, progress: Callable[[int], None] | None = None
) -> LasContent:
    """Read all points of a LAS, LAZ or COPC file.

    Parameters
    ----------
    crs
        What the file's CRS is where it does not say: "EPSG:...", WKT or "local".
    progress
        Called with the number of points read so far.

    Raises
    ------
    InputError
        Empty, cut off, damaged, not LAS, or without any usable point.
    CrsError
        No CRS, one in degrees, or one that contradicts `crs`.

    Notes
    -----
    Coordinates in feet come back in metres, in the metric twin of the CRS, with a warning. Points of the
    noise classes, withheld points and points with absurd coordinates are left out and counted.
    """
    header = read_las_header(path)
    if header.n_points == 0:
        raise NoPointsError("no points (0 in the header)", where=path, advice="leave the file out")
    resolved = resolve_crs(header.projection, crs, where=path)
    columns = _read_columns(path, header, progress)
    warnings = [*header.warnings, *resolved.warnings]
    intensity: AnyArray | None = columns.intensity
    if not columns.intensity.any():
        intensity = None
        warnings.append("no intensity (0 for all points)")
    time, kind, bad_time = _time(columns.time, header, warnings)
    kept, rejected = _account({
        "noise class": columns.is_noise,
        "absurd coordinates": _absurd(columns.xyz, header),
        "time not finite": bad_time,
    })  # fmt: skip
    horizontal, vertical = resolved.factors
    if resolved.factors != (1.0, 1.0):
        columns.xyz *= [horizontal, horizontal, vertical]
    points = Points(columns.xyz, intensity, time)
    if kept is not None:
        points = points.take(kept)
    if len(points) == 0:
        reasons = ", ".join(f"{n:,} {reason}" for reason, n in rejected.items())
        raise InputError(
            f"no usable points among {header.n_points:,} ({reasons})", where=path, advice="leave the file out"
        )
    return LasContent(
        points, resolved.crs, header.n_points, rejected, kind, header.point_format,
        f"{header.version[0]}.{header.version[1]}", tuple(warnings),
    )  # fmt: skip


def _account(bad: dict[str, AnyArray | None]) -> tuple[AnyArray | None, dict[str, int]]:
    """Return which points to keep (None: all) and how many are left out by reason, each point counted once."""
    kept: AnyArray | None = None
    rejected = {}
    for reason, mask in bad.items():
        if mask is None:
            continue
        counted = mask if kept is None else mask & kept
        if counted.any():
            rejected[reason] = int(np.count_nonzero(counted))
        kept = ~mask if kept is None else kept & ~mask
    return kept, rejected


def _absurd(xyz: FloatArray, header: LasHeader) -> AnyArray | None:
    """Return which points no projected CRS has room for; None where the header's steps cannot reach there."""
    reach = max(2.0**31 * abs(s) + abs(o) for s, o in zip(header.scales, header.offsets, strict=True))
    if reach < _ABSURD_M or max(-float(xyz.min()), float(xyz.max())) < _ABSURD_M:
        return None
    return np.asarray((np.abs(xyz) >= _ABSURD_M).any(axis=1))


@dataclass(slots=True)
class _Columns:
    """Columns while they are filled."""

    xyz: FloatArray
    intensity: AnyArray
    time: FloatArray | None
    is_noise: AnyArray | None = None


def _read_columns(path: Path, header: LasHeader, progress: Callable[[int], None] | None) -> _Columns:
    """Decode the records batch by batch straight into the columns: one pass, no copy of the whole."""
    record = _record_dtype(header)
    n = header.n_points
    try:
        columns = _Columns(
            np.empty((n, 3)),
            np.empty(n, dtype=np.float32),
            np.empty(n) if "time" in (record.names or ()) else None,
        )
    except MemoryError as error:
        raise InputError(
            f"{n:,} points need {n * 36 / 2**30:.0f} GiB of memory", where=path, advice="split the file"
        ) from error
    done = 0
    for records in _batches(path, header, record):
        part = slice(done, done + len(records))
        for axis, name in enumerate("xyz"):
            column = columns.xyz[part, axis]
            np.multiply(records[name], header.scales[axis], out=column)
            column += header.offsets[axis]
        columns.intensity[part] = records["intensity"]
        if columns.time is not None:
            columns.time[part] = records["time"]
        _note_noise(columns, records, header.point_format, part)
        done += len(records)
        if progress is not None:
            progress(done)
    return columns


def _record_dtype(header: LasHeader) -> np.dtype[Any]:
    """Return where in a record the fields in use lie (specification tables 7 to 17)."""
    fields = {"x": ("<i4", 0), "y": ("<i4", 4), "z": ("<i4", 8), "intensity": ("<u2", 12)}
    if header.point_format >= 6:
        fields |= {"flags": ("u1", 15), "class": ("u1", 16), "time": ("<f8", 22)}
    else:
        fields |= {"class": ("u1", 15)}
        if header.point_format in (1, 3, 4, 5):
            fields |= {"time": ("<f8", 20)}
    return np.dtype({
        "names": list(fields), "formats": [f for f, _ in fields.values()],
        "offsets": [o for _, o in fields.values()], "itemsize": header.record_bytes,
    })  # fmt: skip


def _note_noise(columns: _Columns, records: AnyArray, point_format: int, part: slice) -> None:
    """Mark noise classes and withheld points; the mask is made when the first such point comes."""
    classes = records["class"]
    if point_format >= 6:
        bad = (classes == _NOISE) | (classes == _HIGH_NOISE) | (records["flags"] & 4 != 0)
    else:  # class in the low 5 bits, withheld in the top one
        bad = (classes & 31 == _NOISE) | (classes & 128 != 0)
    if columns.is_noise is None:
        if not bad.any():
            return
        columns.is_noise = np.zeros(len(columns.xyz), dtype=bool)
    columns.is_noise[part] = bad


def _batches(path: Path, header: LasHeader, record: np.dtype[Any]) -> Iterator[AnyArray]:
    """Yield the records in batches; the array is overwritten by the next one."""
    batch = _batch_points(header)
    buffer = np.empty(batch * header.record_bytes, dtype=np.uint8)
    with path.open("rb") as file:
        fill = None
        for start in range(0, header.n_points, batch):
            n = min(batch, header.n_points - start)
            view = buffer[: n * header.record_bytes]
            try:
                fill = fill or _filler(file, header)
                fill(view)
            except (KeyboardInterrupt, SystemExit, GeneratorExit):
                raise
            except BaseException as error:  # lazrs panics are no Exceptions
                raise InputError(
                    f"points {start:,} to {start + n:,} of {header.n_points:,} cannot be decoded (cut off or damaged)",
                    where=path,
                    advice="copy the file again, or leave it out",
                ) from error
            yield view.view(record)


def _batch_points(header: LasHeader) -> int:
    """Return how many points to decode at a time: whole chunks, enough of them for all cores."""
    chunk = header.laz.chunk_size if header.laz is not None else 0
    if not 0 < chunk <= _BATCH:
        return min(_BATCH, header.n_points)
    n_chunks = max(_BATCH // chunk, _CHUNKS_PER_CORE * (os.cpu_count() or 1))
    return min(n_chunks * chunk, header.n_points)


def _filler(file: io.BufferedReader, header: LasHeader) -> Callable[[AnyArray], None]:
    """Return a function that fills a byte buffer with the next records."""
    file.seek(header.point_offset)
    if header.laz is None:

        def fill(view: AnyArray) -> None:
            if file.readinto(view.data) != len(view):
                raise EOFError("cut off")

        return fill
    selection = lazrs.DecompressionSelection(
        lazrs.SELECTIVE_DECOMPRESS_XY_RETURNS_CHANNEL | lazrs.SELECTIVE_DECOMPRESS_Z
        | lazrs.SELECTIVE_DECOMPRESS_INTENSITY | lazrs.SELECTIVE_DECOMPRESS_GPS_TIME
        | lazrs.SELECTIVE_DECOMPRESS_CLASSIFICATION | lazrs.SELECTIVE_DECOMPRESS_FLAGS
    )  # fmt: skip
    source: io.BufferedIOBase = file
    if header.laz.is_sound:
        decoder = lazrs.ParLasZipDecompressor(source, header.laz.vlr, selection)
    else:
        if header.laz.table_offset is not None:
            source = _without_chunk_table(file, header.laz.table_offset)
            source.seek(header.point_offset)
        decoder = lazrs.LasZipDecompressor(source, header.laz.vlr, selection)
    return decoder.decompress_many  # type: ignore[no-any-return]


def _without_chunk_table(file: io.BufferedReader, table_offset: int) -> io.BytesIO:
    """Return the file in memory with a chunk table of no chunks: decoders read it even where they need none."""
    file.seek(0)
    data = bytearray(file.read())
    data[table_offset : table_offset + 8] = bytes(8)
    return io.BytesIO(data)


def _time(
    time: FloatArray | None, header: LasHeader, warnings: list[str]
) -> tuple[FloatArray | None, TimeKind, AnyArray | None]:
    """Return the GPS times, their kind, and which are not finite; the values decide, the header's bit is often wrong."""
    if time is None:
        return None, "none", None
    finite = np.isfinite(time)
    bad = None if finite.all() else ~finite
    sound = time if bad is None else time[finite]
    if len(sound) == 0 or not sound.any():
        warnings.append("no GPS time (0 for all points)")
        return None, "none", None
    low, high = float(sound.min()), float(sound.max())
    if high > _LAST_S or low < -_LEAST_GPS_S:
        warnings.append(f"GPS times from {low:g} to {high:g} are not in seconds: left out")
        return None, "none", None
    kind: TimeKind = "week" if low >= 0.0 and high <= _WEEK_S else "gps" if low > _LEAST_GPS_S else "adjusted"
    if kind == "gps" or (kind == "adjusted") != header.has_adjusted_time:
        said = "adjusted standard time" if header.has_adjusted_time else "seconds of the week"
        warnings.append(
            f"GPS times from {low:.0f} to {high:.0f}, though the header says {said}: taken as '{kind}'"
        )
    return time, kind, bad
