"""Classify the points of a survey by its surface and its lines."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from linework.arrays import AnyArray
from linework.errors import PartialError, UsageError, argument
from linework.files.output.locks import reserve_folder
from linework.files.output.publish import publish_folder
from linework.files.output.record import hash_file, write_json
from linework.files.remote.address import address_text
from linework.files.vectors.read_write import read_usable_lines
from linework.library.opened import (
    GivenSettings,
    GivenSource,
    GivenTrajectory,
    given_survey,
    opened_source,
    settings_given,
    temporary_work,
)
from linework.library.progress import Progress, display_of
from linework.library.report import warn_of
from linework.methods.classes.pieces import RoadPieces
from linework.methods.classes.point_class import ASPRS_CLASSES, PointClass
from linework.methods.classes.tile import tile_classes
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.model.trajectory import Trajectory
from linework.processes.system import usable_cores
from linework.runs.classify import ClassifiedFiles, copy_files, make_tiles, usable_lines
from linework.runs.opened.points import OpenedSurvey, surface_of
from linework.runs.opened.recordings import Recordings
from linework.runs.opened.store import executor_for
from linework.runs.record import versions
from linework.runs.resume import describe_run, run_folder
from linework.runs.settings import RunSettings
from linework.runs.steps import RunSteps
from linework.scanlines.sampled import gains_of_points
from linework.surface.cells import path_samples
from linework.surface.road import RoadConfig, find_ground

#: Name of the record beside the copies.
RECORD = "classes.json"
#: Samples of the vehicle's path [m], and what the bounds of points are grown by so that all lie in them. [m]
_PATH_STEP_M, _BEYOND_M = 0.5, 1e-3
#: Surveys with fewer points are looked at in this process: others take seconds to begin, a point 0.2 microseconds.
_WORTH_PROCESSES = 100_000_000


@dataclass(frozen=True, slots=True)
class ClassifiedPoints:
    """Classes of points.

    Parameters
    ----------
    classes
        (n,) uint8: `linework.methods.classes.point_class.PointClass`.
    line
        (n,) uint32: number of the line that a point lies on, from 1; 0: none.
    """

    classes: AnyArray
    line: AnyArray


def classify_points(
    points: Points, lines: LineSet, trajectory: Trajectory | None = None, *, road: RoadConfig | None = None
) -> ClassifiedPoints:
    """Return the class of each point, and the line that it lies on.

    Parameters
    ----------
    points
        In memory, in any order; with intensities, paint that is worn away is road.
    lines
        In the CRS of the points: boundaries, markings, guardrails, barriers and cables are used.
    trajectory
        Path of the vehicle; None: the road is the widest even ground between boundaries.
    road
        Settings of the surface.

    Examples
    --------
    >>> import numpy as np, linework
    >>> east, north = (v.ravel() for v in np.meshgrid(np.arange(0.05, 40, 0.1), np.arange(0.05, 12, 0.1)))
    >>> points = linework.Points(np.stack([east, north, np.where(north > 8, 5.12, 5.0)], axis=1))
    >>> kerb = linework.LineSet.from_lines([[[0, 8, 5], [40, 8, 5]]], kind=["road_boundary"], form=["kerb"])
    >>> path = linework.Trajectory(np.array([0.0, 4.0]), np.array([[0.0, 4.0, 5.0], [40.0, 4.0, 5.0]]))
    >>> found = classify_points(points, kerb, path)
    >>> np.bincount(found.classes[north < 7.9]).tolist(), found.line[(north > 8.01) & (north < 8.1)].min()
    ([0, 31600], np.uint32(1))
    """
    points = gains_of_points(points).without(points)
    ground = find_ground(points, trajectory, road)
    path = np.zeros((0, 2)) if trajectory is None else path_samples(trajectory, _PATH_STEP_M)[:, :2]
    box = points.bounds
    core = Bounds(box.west, box.south, box.east + _BEYOND_M, box.north + _BEYOND_M)
    tile = tile_classes(
        core,
        ground,
        points,
        RoadPieces.of(lines),
        np.ascontiguousarray(path),
        has_path=trajectory is not None,
    )
    out, line = np.zeros(len(points), dtype=np.uint8), np.zeros(len(points), dtype=np.uint32)
    intensity = points.intensity if points.intensity is not None else np.zeros(len(points), dtype=np.float32)
    tile.classify(np.ascontiguousarray(points.xyz), intensity, np.arange(len(points)), out, line)
    return ClassifiedPoints(out, line)


def classify_files(
    src: GivenSource,
    lines: str | Path | LineSet,
    output: str | Path,
    *,
    crs: Any = None,
    trajectory: GivenTrajectory = None,
    allow_outside: bool = False,
    allow_remote: bool = False,
    settings: GivenSettings = None,
    workers: int | None = None,
    work: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = None,
) -> dict[str, Any]:
    """Write copies of the laser files of a survey in which each point has its class and the number of its line.

    Parameters
    ----------
    src
        As for `linework.extract`; not points in memory, for which there is `classify_points`.
    lines
        File of the survey's lines, or the lines.
    output
        Folder for the copies, and for a record of them, ``classes.json``.
    crs, trajectory, allow_outside, allow_remote, settings, workers, work, progress
        As for `linework.extract`.
    overwrite
        Replace files of the same names in the folder.

    Returns
    -------
    dict
        The content of ``classes.json``.

    Raises
    ------
    PartialError
        Files or tiles were left out; the others are written.
    LineworkError
        One line: which file or argument, what is wrong, what to do.
    """
    if isinstance(src, Points):
        raise UsageError(
            "points in memory have no files", where=argument("src"), advice="use classify_points"
        )
    folder, chosen = Path(output), settings_given(settings)
    named = lines if isinstance(lines, str | Path) else argument("lines")
    inputs = [Path(lines)] if isinstance(lines, str | Path) else []
    inputs += [Path(trajectory)] if isinstance(trajectory, str | Path) else []
    with contextlib.ExitStack() as held:
        steps = RunSteps(held.enter_context(display_of(progress)))
        work_path = held.enter_context(temporary_work(work))
        survey = given_survey(src, crs=crs, allow_outside=allow_outside, allow_remote=allow_remote)
        recordings = held.enter_context(
            opened_source(
                survey,
                work_path,
                trajectory=trajectory,
                images=False,
                kinds=["classes"],
                steps=steps,
            )
        )
        held.enter_context(reserve_folder(folder, overwrite=overwrite, inputs=inputs))
        given, left_out = _lines_of(lines, recordings)
        given = usable_lines(given, named)
        warn_of([*recordings.warnings, *([left_out] if left_out else [])])
        record = classify_recordings(
            recordings,
            given,
            folder,
            work_path,
            settings=chosen,
            workers=workers,
            overwrite=overwrite,
            steps=steps,
        )
    problem = classified_problem(record)
    if problem:
        raise PartialError(problem, where=folder, advice=f"see {RECORD}")
    return record


def _lines_of(lines: str | Path | LineSet, recordings: Recordings) -> tuple[LineSet, str]:
    """Return the lines in the CRS of the survey, and a line on those that were left out."""
    crs = recordings.survey.crs
    if isinstance(lines, str | Path):
        return read_usable_lines(lines, crs=crs)
    if lines.crs not in (crs, "local"):
        raise UsageError(
            "are in another CRS than the survey", where=argument("lines"), advice="transform them"
        )
    return lines, ""


def classify_recordings(
    recordings: Recordings,
    lines: LineSet,
    folder: Path,
    work: Path,
    *,
    settings: RunSettings,
    workers: int | None,
    overwrite: bool,
    steps: RunSteps,
) -> dict[str, Any]:
    """Write the copies of an opened survey, whole or not at all, and return their record.

    Raises
    ------
    LineworkError
        No file can be copied, or the folder cannot be written.
    """
    opened = recordings.points
    assert opened is not None, "recordings were opened with their points"
    described = describe_run({"command": "classify"}, recordings.hashes)
    record: dict[str, Any] = {}
    with contextlib.ExitStack() as held:
        run = held.enter_context(run_folder(work, folder, described))
        is_large = opened.facts.n_points >= _WORTH_PROCESSES
        n_workers = (workers or usable_cores()) if is_large else 1
        executor = held.enter_context(executor_for(opened.facts.n_points, n_workers, settings))
        surface = surface_of(opened, settings.road, executor, steps)
        with steps.step("look around points", unit="tiles") as advance:
            tiles = make_tiles(opened, surface, lines, run.results, executor, advance)

        def write(part: Path) -> None:
            with steps.step("classify points", unit="points") as progress:
                found = copy_files(opened, tiles, part, progress)
            record.update(_record(opened, lines, found, steps))
            failures = [*found.failures, *tiles.failures]
            record["failures"] = [{"what": f.what, "name": f.name, "problem": f.problem} for f in failures]
            record["failures"] += [
                {"what": "file", "name": str(path), "problem": problem}
                for path, problem in opened.facts.failures
            ]
            write_json(record, part / RECORD)

        def verify(part: Path) -> None:
            for copy in record["files"]:
                if not (part / copy["copy"]).is_file():
                    raise OSError(f"{copy['copy']} is missing")

        publish_folder(folder, write, verify, overwrite=overwrite)
    return record


def _record(opened: OpenedSurvey, lines: LineSet, found: ClassifiedFiles, steps: RunSteps) -> dict[str, Any]:
    """Return the content of the record beside the copies."""
    total = {kind: sum(copied.counts[kind] for _, copied in found.copies.values()) for kind in PointClass}
    return {
        "command": "classify",
        "versions": versions(),
        "classes": [
            {"name": kind.name.lower(), "number": number, "label": label, "points": total[kind]}
            for kind, (number, label) in ASPRS_CLASSES.items()
        ],
        "files": [
            {
                "file": address_text(path),
                "sha256": opened.hashes.get(path) or hash_file(path),
                "copy": name,
                "points": {kind.name.lower(): n for kind, n in copied.counts.items()},
                "kept_class": copied.n_kept,
                "left_out": list(copied.left_out),
            }
            for name, (path, copied) in found.copies.items()
        ],
        "lines": [
            {"number": i, "id": str(line.id), "kind": str(line.kind)} for i, line in enumerate(lines, start=1)
        ],
        "warnings": [
            f"{name}: left out {' and '.join(copied.left_out)}"
            for name, (_, copied) in found.copies.items()
            if copied.left_out
        ],
        "timings_s": {name: round(seconds, 3) for name, seconds in steps.timings_s.items()},
    }


def classified_problem(record: Mapping[str, Any]) -> str:
    """Return a line on what was left out, "" if nothing was."""
    failures = record["failures"]
    if not failures:
        return ""
    first = str(failures[0]["problem"]).rstrip(".")
    return f"{len(failures)} files or tiles left out, the first: {first}"
