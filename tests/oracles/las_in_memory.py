"""Read a whole LAS, LAZ or COPC file into memory: the obvious twin of the tile store's way through batches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.errors import InputError
from linework.files.las.batches import BATCH_POINTS, read_las_batches
from linework.files.las.crs import resolve_crs
from linework.files.las.header import LasHeader, read_las_header
from linework.files.las.tally import LasTally, TimeKind
from linework.model.points import Points


@dataclass(frozen=True, slots=True)
class LasContent:
    """The points of one file, and facts about it.

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


def read_las(
    path: Path,
    *,
    crs: str | None = None,
    progress: Callable[[int], None] | None = None,
    batch_points: int = BATCH_POINTS,
) -> LasContent:
    """Read all points of a LAS, LAZ or COPC file into memory.

    Parameters
    ----------
    crs
        What the file's CRS is where it does not say: "EPSG:...", WKT or "local".
    progress
        Called with the number of points read so far.
    batch_points
        Points decoded at a time; the result does not depend on it.

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
        raise InputError("no points (0 in the header)", where=path, advice="leave the file out")
    resolved = resolve_crs(header.projection, crs, where=path)
    columns = _Columns.for_points(path, header)
    tally = LasTally()
    _read(path, header, resolved.factors, (columns, tally), progress, batch_points)
    found = tally.verdict(header)
    if tally.must_go_without_time:
        tally = LasTally(uses_time=False)
        _read(path, header, resolved.factors, (columns, tally), progress, batch_points)
    tally.check(path, header)
    n = tally.n_kept
    points = Points(
        columns.xyz[:n],
        intensity=columns.intensity[:n] if tally.has_intensity else None,
        time_s=None if found.gps_time_kind == "none" else columns.time[:n],
    )
    return LasContent(
        points, resolved.crs, header.n_points, dict(tally.n_rejected), found.gps_time_kind, header.point_format,
        header.version_text, (*header.warnings, *resolved.warnings, *found.warnings),
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Columns:
    """Columns while they are filled."""

    xyz: FloatArray
    intensity: AnyArray
    time: FloatArray

    @classmethod
    def for_points(cls, path: Path, header: LasHeader) -> _Columns:
        n = header.n_points
        try:
            return cls(np.empty((n, 3)), np.empty(n, dtype=np.float32), np.empty(n))
        except MemoryError as error:
            raise InputError(
                f"{n:,} points need {n * 36 / 2**30:.0f} GiB of memory", where=path, advice="split the file"
            ) from error


def _read(
    path: Path,
    header: LasHeader,
    factors: tuple[float, float],
    into: tuple[_Columns, LasTally],
    progress: Callable[[int], None] | None,
    batch_points: int,
) -> None:
    """Fill the columns with the points that are used: one pass, no copy of the whole."""
    columns, tally = into
    for batch in read_las_batches(path, header, factors=factors, batch_points=batch_points):
        start = tally.n_kept
        xyz, intensity, time, _ = tally.add(batch)
        part = slice(start, start + len(xyz))
        columns.xyz[part], columns.intensity[part] = xyz, intensity
        if time is not None:
            columns.time[part] = time
        if progress is not None:
            progress(tally.n_read)
