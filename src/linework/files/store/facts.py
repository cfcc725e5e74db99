"""Facts about a tile store, kept in its index: its files, points left out, times."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from linework.files.las.tally import TimeCounts, TimeKind
from linework.files.store.read import PointStore
from linework.model.grid import Bounds

#: Reason for points outside the limits of the survey.
FAR = "far from all others"


@dataclass(frozen=True, slots=True)
class FileFacts:
    """Facts about one laser file; points used and rejected add up to those promised.

    Parameters
    ----------
    n_points
        Points used, before those far from all others of the survey are left out.
    point_format, version
        As in the header; -1 and "" for points that came as arrays.
    columns
        Names of the further columns that the file has, also of those that are not in the store.
    """

    path: Path
    n_promised: int
    n_points: int
    n_rejected: Mapping[str, int]
    bounds: Bounds
    gps_time_kind: TimeKind
    point_format: int
    version: str
    warnings: tuple[str, ...]
    columns: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreFacts:
    """Facts about all files of a survey; points used and rejected add up to those promised.

    Parameters
    ----------
    files
        Those in the store, in the survey's order.
    failures
        (file, error message) of files that could not be used.
    n_points, bounds
        Points in the store, and their extent. [m, world]
    rejected
        Points left out, by reason.
    warnings
        One line each, the file's name first.
    gps_time_kind
        Kind of the times of all files that have them.
    has_intensity, has_time
        Whether any file has intensities, and whether all have times.
    in_time_order
        Whether times never run backwards from file to file.
    times
        Points by time; empty without times.
    columns
        Names of the further columns, in their order.
    crs
        CRS of the points, WKT2 or "local".
    """

    files: tuple[FileFacts, ...]
    failures: tuple[tuple[Path, str], ...]
    n_points: int
    bounds: Bounds
    rejected: Mapping[str, int]
    warnings: tuple[str, ...]
    gps_time_kind: TimeKind
    has_intensity: bool
    has_time: bool
    in_time_order: bool
    times: TimeCounts
    columns: tuple[str, ...] = ()
    crs: str = "local"


def facts_document(
    files: tuple[FileFacts, ...],
    failures: tuple[tuple[Path, str], ...],
    warnings: tuple[str, ...],
    times: TimeCounts,
    **others: Any,
) -> dict[str, Any]:
    """Return the facts of a store as JSON; `facts_of_store` reads it.

    Parameters
    ----------
    others
        gps_time_kind, has_intensity, has_time, in_time_order, columns, crs of `StoreFacts`.
    """
    return {
        **others,
        "times": times.to_document(),
        "warnings": list(warnings),
        "failures": [{"file": _path_document(path), "problem": problem} for path, problem in failures],
        "files": [
            {name: getattr(f, name) for name in FileFacts.__dataclass_fields__ if name != "path"}
            | {"file": _path_document(f.path), "n_rejected": dict(f.n_rejected)}
            for f in files
        ],
    }


def facts_of_store(store: PointStore) -> StoreFacts:
    """Return the facts about a store made by `build_store`."""
    document = dict(store.facts)
    files = tuple(_file(f) for f in document.pop("files"))
    rejected: Counter[str] = sum((Counter(f.n_rejected) for f in files), Counter())
    warnings = tuple(document.pop("warnings"))
    n_far = sum(f.n_points for f in files) - store.n_points
    if n_far:
        rejected[FAR] = n_far
        warnings += (f"{n_far:,} points {FAR} left out",)
    return StoreFacts(
        files=files,
        failures=tuple((_path(f["file"]), f["problem"]) for f in document.pop("failures")),
        n_points=store.n_points,
        bounds=store.bounds,
        rejected=dict(rejected),
        warnings=warnings,
        times=TimeCounts.from_document(document.pop("times")),
        columns=tuple(document.pop("columns", ())),
        **document,
    )


def _file(document: Mapping[str, Any]) -> FileFacts:
    own = {
        "path": _path(document["file"]),
        "bounds": Bounds(*document["bounds"]),
        "warnings": tuple(document["warnings"]),
        "columns": tuple(document["columns"]),
    }
    return FileFacts(**{name: value for name, value in document.items() if name != "file"} | own)


def _path_document(path: Path) -> str | list[int]:
    """Return a path as JSON; as a list of bytes where it is not text."""
    try:
        return os.fsencode(path).decode()
    except UnicodeDecodeError:
        return list(os.fsencode(path))


def _path(document: str | list[int]) -> Path:
    return Path(document if isinstance(document, str) else os.fsdecode(bytes(document)))
