"""Read the points and the trajectory of a survey, all files together, with everything left out counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from linework.errors import CrsError, InputError
from linework.files.las import LasContent, NoPointsError, TimeKind, read_las
from linework.files.run_record import hash_file
from linework.files.trajectories import read_trajectory
from linework.model.arrays import AnyArray, FloatArray
from linework.model.grid import Bounds
from linework.model.points import Points
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory

#: Points used to see where the survey lies; more changes the 0.1 % quantiles of a million points by little.
_SAMPLE = 100_000
#: Of the points, how many may lie outside the box that says where the survey is.
_TAIL = 0.001
#: How far beyond that box points may lie, in sizes of the box and at least in metres: a stray point in the
#: sky is 1e3 to 1e8 m away, a side street or a mast is not.
_REACH_SIZES, _REACH_M = 3.0, 1000.0
#: A van and what it scans are within some 300 m; farther apart is another place or another CRS.
_MAX_APART_M = 1000.0
#: Degrees taken for metres: 50 km of road are 0.5, and what stands along them is hundreds of times as high (10 m
#: over 0.01 for a kilometre). In metres that would be a thread: a mast cut out alone is 30 times as high as wide.
_DEGREES_SIZE, _DEGREES_SLENDER = 0.5, 50.0
#: Where all are within half a metre of height, or so few, there is nothing to compare.
_DEGREES_HEIGHT_M, _DEGREES_LEAST = 0.5, 100


@dataclass(frozen=True, slots=True)
class FileFacts:
    """What one laser file held."""

    path: Path
    n_promised: int
    n_points: int
    n_rejected: Mapping[str, int]
    bounds: Bounds
    gps_time_kind: TimeKind
    point_format: int
    version: str
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SurveyPoints:
    """All points of a survey and the account of what was left out.

    Parameters
    ----------
    rejected
        Points left out, by reason.
    warnings
        One line each, the file's name first.
    failures
        (file, error message) of files that could not be used.
    """

    points: Points
    rejected: Mapping[str, int]
    warnings: tuple[str, ...]
    files: tuple[FileFacts, ...]
    gps_time_kind: TimeKind = "none"
    failures: tuple[tuple[Path, str], ...] = field(default=())


def read_survey_points(survey: Survey, *, progress: Callable[[int], None] | None = None) -> SurveyPoints:
    """Read the points of all files; damaged files among good ones are left out and listed.

    Parameters
    ----------
    progress
        Called with the number of points read so far, over all files.

    Raises
    ------
    InputError
        No file can be used (the first file's error), or the files' GPS times are of different kinds.
    CrsError
        A file's CRS is missing or contradicts the survey's, or the coordinates are degrees.
    """
    if not survey.point_files:
        raise InputError(
            "no laser files in this survey", where=survey.root, advice="name them in survey.toml"
        )
    contents: list[tuple[Path, LasContent]] = []
    failures: list[tuple[Path, InputError]] = []
    warnings, n_done = [], 0
    repeated, empty = _repeated(survey.point_files), None
    for path in survey.point_files:
        if path in repeated:
            warnings.append(f"{path.name}: the same bytes as {repeated[path].name}, left out")
            continue
        start = n_done
        report = None if progress is None else (lambda n, start=start: progress(start + n))
        try:
            content = read_las(path, crs=survey.settings.get("crs"), progress=report)
        except NoPointsError as error:
            warnings.append(f"{path.name}: {error.problem}, left out")
            empty = empty or error
            continue
        except InputError as error:
            failures.append((path, error))
            continue
        n_done += content.n_promised
        contents.append((path, content))
        warnings += [f"{path.name}: {text}" for text in content.warnings]
    if not contents:
        raise failures[0][1] if failures else empty or InputError("no points", where=survey.root)
    kind = _common_kind(contents)
    points = _joined([content.points for _, content in contents], warnings)
    _refuse_degrees(points, where=contents[0][0])
    points, n_far = _without_far(points)
    rejected = sum((Counter(content.n_rejected) for _, content in contents), Counter())
    if n_far:
        rejected["far from all others"] += n_far
        warnings.append(f"{n_far:,} points far from all others left out")
    facts = tuple(_facts(path, content) for path, content in contents)
    return SurveyPoints(
        points, dict(rejected), tuple(warnings), facts, kind, tuple((p, str(e)) for p, e in failures)
    )


def _facts(path: Path, content: LasContent) -> FileFacts:
    return FileFacts(
        path, content.n_promised, len(content.points), content.n_rejected, content.points.bounds,
        content.gps_time_kind, content.point_format, content.version, content.warnings,
    )  # fmt: skip


def _repeated(files: Sequence[Path]) -> dict[Path, Path]:
    """Return the files whose bytes are those of an earlier one."""
    first: dict[tuple[int, str], Path] = {}
    sizes = Counter(path.stat().st_size for path in files)
    found = {}
    for path in files:
        size = path.stat().st_size
        if sizes[size] < 2 or size == 0:
            continue
        key = (size, hash_file(path))
        if key in first:
            found[path] = first[key]
        else:
            first[key] = path
    return found


def _common_kind(contents: Sequence[tuple[Path, LasContent]]) -> TimeKind:
    kinds = {content.gps_time_kind: path for path, content in contents if content.gps_time_kind != "none"}
    if len(kinds) > 1:
        said = ", ".join(f"{path.name} {kind}" for kind, path in sorted(kinds.items()))
        raise InputError(
            f"GPS times of {len(kinds)} kinds: {said}", where=next(iter(kinds.values())),
            advice="convert them to adjusted standard GPS time, or extract the files one by one",
        )  # fmt: skip
    return next(iter(kinds), "none")


def _joined(parts: Sequence[Points], warnings: list[str]) -> Points:
    """Return all points as one set; a column that only some files have is 0 (intensity) or left out (time)."""
    if len(parts) == 1:
        return parts[0]
    intensity: AnyArray | None = None
    n_without = sum(part.intensity is None for part in parts)
    if n_without < len(parts):
        if n_without:
            warnings.append(f"{n_without} of {len(parts)} files have no intensity: taken as 0 there")
        intensity = np.concatenate(
            [np.zeros(len(p), np.float32) if p.intensity is None else p.intensity for p in parts]
        )
    times = [part.time_s for part in parts if part.time_s is not None]
    if 0 < len(times) < len(parts):
        warnings.append(f"{len(parts) - len(times)} of {len(parts)} files have no GPS time: times not used")
    time = np.concatenate(times) if len(times) == len(parts) else None
    return Points(np.concatenate([part.xyz for part in parts]), intensity, time)


def _refuse_degrees(points: Points, where: Path) -> None:
    """Refuse longitudes and latitudes with heights in metres, whatever the files or the user call them."""
    low, high = _middle_extent(points)
    plan, height = float((high - low)[:2].max()), float((high - low)[2])
    in_range = np.all(np.abs([low[0], high[0]]) <= 180.0) and np.all(np.abs([low[1], high[1]]) <= 90.0)
    slender = height > max(_DEGREES_SLENDER * plan, _DEGREES_HEIGHT_M)
    if len(points) >= _DEGREES_LEAST and in_range and plan < _DEGREES_SIZE and slender:
        raise CrsError(
            f"coordinates are geographic (degrees), lengths need metres: {low[0]:.5f} to {high[0]:.5f} and {low[1]:.5f}"
            f" to {high[1]:.5f}, with heights over {height:.1f} m",
            where=where,
            advice="transform to a projected CRS",
        )


def _middle_extent(points: Points) -> tuple[FloatArray, FloatArray]:
    """Return the box (low, high), (3,) each, that holds all points but a tail at either side of each axis."""
    step = max(1, len(points) // _SAMPLE)
    low, high = np.quantile(points.xyz[::step], [_TAIL, 1.0 - _TAIL], axis=0)
    return low, high


def _without_far(points: Points) -> tuple[Points, int]:
    """Return the points without those far from where nearly all others are, and how many were left out."""
    low, high = _middle_extent(points)
    # Plan is one place: a long road east-west may bend north by as much.
    size = high - low
    size[:2] = size[:2].max()
    reach = np.maximum(_REACH_SIZES * size, _REACH_M)
    low, high = low - reach, high + reach
    near: AnyArray | None = None
    for axis in range(3):
        column = points.xyz[:, axis]
        if column.min() < low[axis] or column.max() > high[axis]:
            inside = (column >= low[axis]) & (column <= high[axis])
            near = inside if near is None else near & inside
    if near is None:
        return points, 0
    return points.take(near), int(np.count_nonzero(~near))


def read_survey_trajectory(survey: Survey) -> Trajectory | None:
    """Read the survey's trajectory, or return None where it names none.

    Raises
    ------
    InputError
        As for `read_trajectory`.
    """
    return None if survey.trajectory_file is None else read_trajectory(survey.trajectory_file)


def check_trajectory_covers(
    trajectory: Trajectory, points: Points, *, where: object = None
) -> tuple[str, ...]:
    """Compare where and when the van drove with where and when the points are.

    Returns
    -------
    tuple of str
        Warnings: part of the points outside the trajectory's time.

    Raises
    ------
    InputError
        More than 1 km apart, or at no common time; with both extents.
    """
    driven, scanned = _extent(trajectory.xyz), _extent(points.xyz)
    apart = np.maximum(np.maximum(driven[0] - scanned[1], scanned[0] - driven[1]), 0.0)
    if float(np.hypot(*apart)) > _MAX_APART_M:
        raise InputError(
            f"trajectory and points are {float(np.hypot(*apart)) / 1000.0:,.1f} km apart: east {_range(driven, 0)},"
            f" north {_range(driven, 1)} against east {_range(scanned, 0)}, north {_range(scanned, 1)}",
            where=where,
            advice="check that both are in the same CRS, and east before north",
        )
    if points.time_s is None:
        return ()
    start, end = float(trajectory.time_s[0]), float(trajectory.time_s[-1])
    share = float(np.mean((points.time_s >= start) & (points.time_s <= end)))
    if share == 0.0:
        raise InputError(
            f"trajectory from {start:.1f} to {end:.1f} s, points from {points.time_s.min():.1f} to"
            f" {points.time_s.max():.1f} s: no common time",
            where=where,
            advice="check the epochs (GPS week seconds, adjusted, unix)",
        )
    return (
        ()
        if share > 0.99
        else (f"{100.0 * (1.0 - share):.0f} % of the points are outside the trajectory's time",)
    )


def _extent(xyz: FloatArray) -> tuple[FloatArray, FloatArray]:
    # Column by column: ten times as fast as along the first axis of all
    east, north = xyz[:, 0], xyz[:, 1]
    return np.array([east.min(), north.min()]), np.array([east.max(), north.max()])


def _range(extent: tuple[FloatArray, FloatArray], axis: int) -> str:
    return f"{extent[0][axis]:.0f} to {extent[1][axis]:.0f}"
