"""Points and trajectories as every method uses them: on one clock, at the vehicle's origin."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from linework.errors import InputError, PartialError, UsageError, argument
from linework.files.logs.sensors import read_navigation_logs
from linework.files.store.in_memory import read_survey_points
from linework.library.opened import (
    GivenSource,
    given_survey,
    opened_source,
    temporary_work,
    trajectory_in_file,
)
from linework.library.progress import Progress, display_of
from linework.library.report import (
    OnProblem,
    check_on_problem,
    left_out_summary,
    report_of_recordings,
    warn_of,
)
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory
from linework.navigation.locate import locate_drive
from linework.navigation.located import LocatedDrive, NavigationConfig
from linework.runs.compile import compile_stage
from linework.runs.steps import RunSteps

#: Output rates and GNSS outages that make sense: lowest and highest. [Hz], [s]
RATE_HZ, OUTAGE_S = (0.1, 1000.0), (1.0, 3600.0)


def read_points(
    src: str | Path | Iterable[str | Path] | Survey,
    *,
    crs: Any = None,
    carry: str | Sequence[str] = (),
    allow_outside: bool = False,
    allow_remote: bool = False,
    progress: Progress = None,
) -> Points:
    """Return all points of laser files in memory.

    Parameters
    ----------
    src, crs, allow_outside, allow_remote, progress
        As for `linework.extract`.
    carry
        Fields and extra dimensions of the LAS files that become columns, by name: ``carry=["classification"]``.

    Returns
    -------
    Points
        In the survey's CRS, in an order that does not depend on the order in the files; coordinates are on a lattice
        of 0.1 mm. Points of noise classes and strays are left out.

    Raises
    ------
    LineworkError
        A file cannot be read, has no CRS, or lacks a column.

    Warns
    -----
    LineworkWarning
        Files that were left out among good ones, and what else was odd.
    """
    with display_of(progress) as display, RunSteps(display).step("read points", unit="points") as advance:
        survey = given_survey(
            src, crs=crs, carry=carry, allow_outside=allow_outside, allow_remote=allow_remote
        )
        read = read_survey_points(survey, progress=advance)
    warn_of([*(problem for _, problem in read.failures), *read.warnings])
    return read.points


def read_trajectory(
    src: GivenSource, *, crs: Any = None, allow_outside: bool = False, allow_remote: bool = False
) -> Trajectory:
    """Return the path of the vehicle's origin, exactly as `linework.extract` uses it.

    Parameters
    ----------
    src
        A survey: lever arm, boresight, epoch and clock offset of its trajectory are applied, and one that has logs
        instead is located. Or a trajectory file (CSV, SBET, OXTS, TUM, KITTI, NMEA): as it is in the file.
    crs
        CRS of a survey whose files do not state it; of a trajectory file in degrees, the CRS to transform it into.
    allow_outside
        As for `linework.extract`.

    Returns
    -------
    Trajectory
        Positions in the survey's CRS, times on the clock of its points.

    Raises
    ------
    LineworkError
        There is no trajectory, it cannot be read, or it does not fit the points.

    Warns
    -----
    LineworkWarning
        What was odd: points outside its time, a clock offset that would explain them.
    """
    if isinstance(src, str | Path) and _is_trajectory_file(Path(src)):
        return trajectory_in_file(src, crs)
    with contextlib.ExitStack() as held:
        work = held.enter_context(temporary_work(None))
        # Images are needed only where there are no points that the trajectory has to fit
        survey = (
            src
            if isinstance(src, Points)
            else given_survey(src, crs=crs, allow_outside=allow_outside, allow_remote=allow_remote)
        )
        images = isinstance(survey, Survey) and not survey.point_files
        found = held.enter_context(opened_source(survey, work, images=images))
        report = report_of_recordings(found, LineSet.empty(), (), {})
        warn_of([*report.warnings, *filter(None, [left_out_summary(report)])])
        if found.trajectory is None:
            raise InputError(
                "no trajectory", where=found.survey.name, advice="name one in survey.toml, or give its file"
            )
        return found.trajectory


def _is_trajectory_file(path: Path) -> bool:
    is_laser = path.suffix.lower() in (".las", ".laz", ".ply", ".pcd", ".e57", ".toml")
    return path.is_file() and not is_laser


def locate(
    src: str | Path | Survey,
    *,
    crs: Any = None,
    allow_outside: bool = False,
    allow_remote: bool = False,
    rate_hz: float = 50.0,
    longest_outage_s: float = 180.0,
    progress: Progress = None,
    on_problem: OnProblem = "raise",
) -> Trajectory:
    """Return the smoothed trajectory of a van from its GNSS, gyro and wheel logs, with standard deviations.

    Parameters
    ----------
    src
        A survey folder with [navigation] in its survey.toml, or the opened survey.
    crs, allow_outside, allow_remote, progress, on_problem
        As for `linework.extract`.
    rate_hz
        Output rate. [Hz]
    longest_outage_s
        Longest GNSS outage that is bridged in full; the middle of longer ones gets no poses. [s]

    Raises
    ------
    InputError
        The logs cannot be used.
    PartialError
        Some spans have no poses, and `on_problem` is "raise".
    """
    check_on_problem(on_problem)
    with display_of(progress) as display:
        survey = given_survey(src, crs=crs, allow_outside=allow_outside, allow_remote=allow_remote)
        located, remarks = located_drive(
            survey,
            rate_hz=rate_hz,
            longest_outage_s=longest_outage_s,
            steps=RunSteps(display),
        )
    warn_of(remarks)
    problem = spans_without_poses(located)
    if problem and on_problem == "raise":
        raise PartialError(
            problem, where=survey.name, advice=f"{argument('on_problem', 'warn')} returns the rest"
        )
    warn_of([problem] if problem else [])
    return located.trajectory


def located_drive(
    survey: Survey, *, rate_hz: float, longest_outage_s: float, steps: RunSteps
) -> tuple[LocatedDrive, tuple[str, ...]]:
    """Return the located drive of a survey, and warnings in one line each.

    Raises
    ------
    UsageError
        A rate or an outage out of its range.
    InputError
        The logs cannot be used.
    """
    for name, value, (low, high) in (
        ("rate_hz", rate_hz, RATE_HZ), ("longest_outage_s", longest_outage_s, OUTAGE_S)
    ):  # fmt: skip
        if not low <= value <= high:
            raise UsageError(f"{value:g} is not within {low:g} to {high:g}", where=argument(name))
    with steps.step("read the logs"):
        content = read_navigation_logs(survey)
    compile_stage(("trajectory",), steps)
    with steps.step("filter and smooth"):
        try:
            found = locate_drive(
                content.logs, NavigationConfig(longest_outage_s=longest_outage_s), rate_hz=rate_hz
            )
        except InputError as error:
            where = f"{survey.root} ({error.where})" if error.where else survey.root
            raise InputError(error.problem, where=where, advice=error.advice) from error
    return found, (*content.warnings, *found.warnings)


def spans_without_poses(located: LocatedDrive, most: int = 5) -> str:
    """Return the spans without poses in words, "" if there are none."""
    if not len(located.left_out_s):
        return ""
    spans = ", ".join(f"{a:.1f} to {b:.1f} s" for a, b in located.left_out_s[:most])
    return f"no poses from {spans}{' ...' if len(located.left_out_s) > most else ''}"
