"""All that a survey's van recorded, opened: laser points, stereo pairs, or both."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from linework.errors import ConfigError, CrsError, InputError
from linework.files.images.series import open_stereo
from linework.files.logs.sensors import read_navigation_logs
from linework.files.output.record import hash_file
from linework.files.trajectories.of_survey import read_van_path, stereo_on_clock_of
from linework.files.trajectories.read import write_trajectory
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory
from linework.navigation.locate import locate_drive
from linework.runs.opened.pairs import OpenedStereo, place_pairs
from linework.runs.opened.points import OpenedSurvey, hash_path, opened_survey
from linework.runs.opened.work_folder import STORES
from linework.runs.steps import RunSteps


@dataclass(frozen=True, slots=True, kw_only=True)
class Recordings:
    """What there is to find lines in.

    Parameters
    ----------
    points, stereo
        None where the survey has none, or none was asked for.
    told
        One line each about what was done before the recordings were opened.
    problems
        (what, problem) of what cannot be used at all although the rest can.
    hashes
        SHA-256 of every input file that can be read.
    """

    survey: Survey
    points: OpenedSurvey | None
    stereo: OpenedStereo | None
    told: tuple[str, ...] = ()
    problems: tuple[tuple[str, str], ...] = ()
    hashes: Mapping[Path, str] = field(default_factory=dict)

    @property
    def trajectory(self) -> Trajectory | None:
        """Path of the vehicle's origin."""
        opened = self.stereo or self.points
        return None if opened is None else opened.trajectory

    @property
    def identity(self) -> dict[str, object]:
        """What the lines depend on beside the bytes of the files: settings, times of images, the path, the keys."""
        pairs = self.stereo.pairs if self.stereo else ()
        events = self.survey.settings.get("events", {}).get("file")
        keys = self.survey.root / events if events else None
        return {
            "survey": self.survey.settings,
            "pairs": hashlib.sha256(repr(pairs).encode()).hexdigest(),
            "path": hash_path(self.trajectory) if self.trajectory is not None else None,
            "events": hash_file(keys) if keys is not None and keys.is_file() else None,
        }

    @property
    def warnings(self) -> tuple[str, ...]:
        """One line each."""
        of_points = self.points.warnings if self.points else ()
        return (*self.survey.warnings, *self.told, *of_points, *(self.stereo.warnings if self.stereo else ()))


@contextlib.contextmanager
def opened_recordings(
    survey: Survey,
    work: Path,
    *,
    laser: bool = True,
    images: bool = True,
    n_threads: int = 1,
    steps: RunSteps | None = None,
) -> Iterator[Recordings]:
    """Give the recordings of a survey that are asked for.

    Parameters
    ----------
    laser, images
        Whether points, whether stereo pairs are to be used where the survey has them.

    Raises
    ------
    InputError
        There is nothing that can be used. Where one kind of recording can be used and the other cannot, that is
        no error here: `Recordings.problems` tells.
    """
    has_points, has_images = (
        laser and bool(survey.point_files),
        images and bool(survey.settings.get("cameras")),
    )
    if not has_points and not has_images:
        asked = " and no ".join([*["laser points"] * laser, *["stereo images ([cameras])"] * images])
        raise InputError(f"no {asked} in this survey", where=survey.name,
                         advice="see what there is with linework info")  # fmt: skip
    steps = steps or RunSteps()
    with contextlib.ExitStack() as held:
        points, told, problems = None, tuple[str, ...](), list[tuple[str, str]]()
        try:
            survey, told = located_survey(survey, work, steps)
        except (InputError, ConfigError, CrsError) as error:
            # Points are worked without a trajectory; images cannot be, and say so
            problems.append(("navigation logs", str(error)))
        if has_points:
            try:
                points = held.enter_context(opened_survey(survey, work, n_threads=n_threads, steps=steps))
            except InputError as error:
                if not has_images:
                    raise
                problems.append(("laser points", str(error)))
        stereo: OpenedStereo | None = None
        if has_images:
            try:
                stereo = _opened_stereo(survey, points, steps)
            except (InputError, ConfigError) as error:
                if points is None and problems:
                    also = problems[0][1].rstrip(".")
                    raise InputError(f"{error.problem}; {also}", where=error.where) from error
                if points is None:  # nothing usable, whatever it is that is wrong
                    raise InputError(error.problem, where=error.where, advice=error.advice) from error
                problems.append(("stereo pairs", str(error)))
        hashes = dict(points.hashes) if points else {}
        if stereo is not None:
            hashes |= stereo.hashes()
            if survey.trajectory_file is not None and survey.trajectory_file.is_file():
                hashes[survey.trajectory_file] = hash_file(survey.trajectory_file)
        yield Recordings(
            survey=survey, points=points, stereo=stereo, told=told, problems=tuple(problems), hashes=hashes
        )


def _opened_stereo(survey: Survey, points: OpenedSurvey | None, steps: RunSteps) -> OpenedStereo | None:
    """Return the stereo pairs with their poses; the trajectory is the one that the points have, where there are any."""
    series = open_stereo(survey)
    if series is None:
        return None
    if points is None:
        van = read_van_path(survey, series)
        trajectory, series = van.trajectory, van.series or series
        series = replace(series, warnings=(*series.warnings, *van.warnings))
    else:
        trajectory = points.trajectory
        if trajectory is not None:
            series = stereo_on_clock_of(series, trajectory, survey)
    placed = place_pairs(survey, series, trajectory)
    with steps.step("check stereo pairs"):
        return placed.checked()


# A survey that has logs and no trajectory: the trajectory is made from them, as `linework locate` does


def located_survey(survey: Survey, work: Path, steps: RunSteps) -> tuple[Survey, tuple[str, ...]]:
    """Return the survey with a trajectory, its own or one made from its logs, and what is to be told of that.

    Parameters
    ----------
    work
        The work folder: a trajectory that is made stays there, under the name of what it holds.

    Raises
    ------
    InputError, ConfigError, CrsError
        The logs cannot be used.
    """
    if survey.trajectory_file is not None or not survey.settings.get("navigation"):
        return survey, ()
    with steps.step("locate", unit="stretches") as advance:
        content = read_navigation_logs(survey)
        found = locate_drive(content.logs, progress=advance)
        path = work / STORES / f"located-{hash_path(found.trajectory)[:16]}.csv"
        if not path.is_file():
            write_trajectory(found.trajectory, path, overwrite=True)
    settings = {name: table for name, table in survey.settings.items() if name != "trajectory"}
    located = replace(
        survey, trajectory_file=path, trajectory_lever_m=(0.0, 0.0, 0.0), trajectory_boresight_deg=(0.0, 0.0, 0.0),
        settings=settings,
    )  # fmt: skip
    told = f"{survey.name}: no trajectory: made from the logs, as linework locate does"
    return located, (told, *content.warnings, *found.warnings)
