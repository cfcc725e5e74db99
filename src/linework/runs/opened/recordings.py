"""The recordings of a survey, opened side by side: laser points, stereo pairs, navigation logs, the van's log."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Generic, TypeVar

from linework.errors import ConfigError, CrsError, InputError, LineworkError, MissingPackageError, check_extra
from linework.files.images.series import open_stereo
from linework.files.images.single import no_pairs_message, open_single_cameras
from linework.files.logs.keys import events_file
from linework.files.logs.photolog import van_log
from linework.files.logs.sensors import read_navigation_logs
from linework.files.output.record import hash_file
from linework.files.trajectories.of_survey import read_van_path, single_on_clock_of, stereo_on_clock_of
from linework.files.trajectories.read import write_trajectory
from linework.model.images import SingleCamera
from linework.model.logs import VanLog
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory
from linework.navigation.locate import locate_drive
from linework.runs.opened.made import STORES, claim
from linework.runs.opened.pairs import OpenedStereo, place_pairs
from linework.runs.opened.points import OpenedSurvey, hash_path, opened_survey
from linework.runs.steps import RunSteps

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Opened(Generic[T]):
    """A recording that was opened, or the error that says why it cannot be used; neither if it is not wanted.

    Parameters
    ----------
    name
        Of the recording, for messages: "laser points".
    """

    name: str
    value: T | None = None
    error: LineworkError | None = None


def tried(
    name: str,
    read: Callable[[], T],
    unusable: tuple[type[LineworkError], ...] = (InputError, ConfigError),
) -> Opened[T]:
    """Return what `read` returns, or its error if that is one of those that make a recording unusable."""
    try:
        return Opened(name, read())
    except unusable as error:
        return Opened(name, error=error)


class FileHashes(Mapping[Path, str]):
    """Hashes of files, made when the first is asked for."""

    def __init__(self, make: Callable[[], dict[Path, str]]) -> None:
        self._make = make

    @cached_property
    def _made(self) -> dict[Path, str]:
        return self._make()

    def __getitem__(self, path: Path) -> str:
        return self._made[path]

    def __iter__(self) -> Iterator[Path]:
        return iter(self._made)

    def __len__(self) -> int:
        return len(self._made)


@dataclass(frozen=True, slots=True, kw_only=True)
class Recordings:
    """The opened recordings of a survey.

    Parameters
    ----------
    points, stereo
        None where the survey has none, or none was asked for.
    single
        Cameras without a partner, on the clock of the trajectory; their images are for the photolog.
    messages
        One line each on how the trajectory was made, if the survey came without one.
    problems
        (what, problem) of recordings that cannot be used at all although others can.
    hashes
        SHA-256 of every input file that can be read, made when they are first asked for: runs record them, the
        workbench only opens the files.
    """

    survey: Survey
    points: OpenedSurvey | None
    stereo: OpenedStereo | None
    single: tuple[SingleCamera, ...] = ()
    messages: tuple[str, ...] = ()
    problems: tuple[tuple[str, str], ...] = ()
    hashes: Mapping[Path, str] = field(default_factory=dict)

    @property
    def trajectory(self) -> Trajectory | None:
        """Path of the vehicle's origin."""
        opened = self.stereo or self.points
        return None if opened is None else opened.trajectory

    @property
    def identity(self) -> dict[str, object]:
        """What the lines depend on besides the bytes of the files: settings, times of images, path, keys."""
        pairs = self.stereo.pairs if self.stereo else ()
        keys = events_file(self.survey)
        # Only where there are such images: the identity of other surveys stays
        images = [(camera.name, camera.files, camera.time_s.tolist()) for camera in self.single]
        alone = {"images": hashlib.sha256(repr(images).encode()).hexdigest()}
        return {
            **(alone if self.single else {}),
            "survey": self.survey.settings,
            "carry": self.survey.carry,
            "pairs": hashlib.sha256(repr(pairs).encode()).hexdigest(),
            "path": hash_path(self.trajectory) if self.trajectory is not None else None,
            "events": hash_file(keys) if keys is not None and keys.is_file() else None,
        }

    @property
    def warnings(self) -> tuple[str, ...]:
        """One line each."""
        of_points = self.points.warnings if self.points else ()
        of_pairs = self.stereo.warnings if self.stereo else ()
        return (*self.survey.warnings, *self.messages, *of_points, *of_pairs)

    def van_log(self) -> Opened[VanLog]:
        """Open the van's log: images and the operator's keys, placed on the trajectory."""
        series = self.stereo.series if self.stereo else None
        keys = events_file(self.survey)
        name = "" if keys is None else self.survey.settings.get("events", {}).get("file", keys.name)
        return tried(name, lambda: van_log(self.survey, series, self.trajectory, self.single))


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
    """Open the recordings of a survey that are asked for, and hold them open.

    Parameters
    ----------
    laser, images
        Whether to use the points, whether to use the stereo pairs, where the survey has them.

    Raises
    ------
    InputError
        Nothing can be used. If only one recording cannot be used, `Recordings.problems` names it.
    """
    steps = steps or RunSteps()
    with contextlib.ExitStack() as held:
        logs: Opened[tuple[Survey, tuple[str, ...]]] = Opened("navigation logs")
        points: Opened[OpenedSurvey] = Opened("laser points")
        pairs: Opened[OpenedStereo] = Opened("stereo pairs")
        wants_points = laser and bool(survey.point_files)
        wants_pairs = images and survey.has_pairs
        cameras: Opened[tuple[SingleCamera, ...]] = Opened("cameras")
        if wants_points or wants_pairs:
            # Points are processed without a trajectory; pairs cannot be, and say so
            errors = (InputError, ConfigError, CrsError)
            logs = tried(logs.name, lambda: located_survey(survey, work, steps), errors)
        found, messages = logs.value or (survey, ())
        if wants_points:
            files = opened_survey(found, work, n_threads=n_threads, steps=steps)
            # Settings or a CRS that are wrong are mended by whoever runs it, also where there are images
            points = tried(points.name, lambda: held.enter_context(files), (InputError,))
        if wants_pairs:
            faults = (InputError, ConfigError, MissingPackageError)
            pairs = tried(pairs.name, lambda: _opened_stereo(found, points.value, work, steps), faults)
        if images and survey.single_cameras:
            messages += no_pairs_message(survey)
            cameras = tried(cameras.name, lambda: open_single_cameras(survey))
        if points.value is None and pairs.value is None:
            if pairs.error is None and cameras.error is not None:
                pairs = Opened(pairs.name, error=cameras.error)
            raise _nothing_usable(survey, logs, points, pairs, laser=laser, images=images)
        opened = pairs.value or points.value
        single = single_on_clock_of(cameras.value or (), opened.trajectory if opened else None, survey)
        messages += tuple(text for camera in single for text in camera.warnings)
        yield Recordings(
            survey=found,
            points=points.value,
            stereo=pairs.value,
            single=single,
            messages=messages,
            problems=tuple((one.name, str(one.error)) for one in (logs, points, pairs, cameras) if one.error),
            hashes=FileHashes(lambda: _hashes(found, points.value, pairs.value)),
        )


def _nothing_usable(
    survey: Survey,
    logs: Opened[tuple[Survey, tuple[str, ...]]],
    points: Opened[OpenedSurvey],
    pairs: Opened[OpenedStereo],
    *,
    laser: bool,
    images: bool,
) -> LineworkError:
    """Return the error of a survey of which no recording can be used."""
    if points.error is None and pairs.error is None:
        if images and survey.single_cameras and not survey.has_pairs:
            return InputError("one camera takes no stereo pairs, and there are no laser points to find lines in",
                              where=survey.name, advice="see its images with linework photolog")  # fmt: skip
        asked = " and no ".join([*["laser points"] * laser, *["stereo images ([cameras])"] * images])
        return InputError(f"no {asked} in this survey", where=survey.name,
                          advice="see what there is with linework info")  # fmt: skip
    if isinstance(pairs.error, MissingPackageError):
        return pairs.error
    if pairs.error is None:
        assert points.error is not None
        return points.error
    other = logs.error or points.error
    if other is not None:
        problem = f"{pairs.error.problem}; {str(other).rstrip('.')}"
        return InputError(problem, where=pairs.error.where)
    # An error of the input, also where a setting is wrong: nothing usable is left
    return InputError(pairs.error.problem, where=pairs.error.where, advice=pairs.error.advice)


def _hashes(survey: Survey, points: OpenedSurvey | None, stereo: OpenedStereo | None) -> dict[Path, str]:
    """Return the SHA-256 of every input file that can be read."""
    hashes = dict(points.hashes) if points else {}
    if stereo is not None:
        hashes |= stereo.hashes()
        if survey.trajectory_file is not None and survey.trajectory_file.is_file():
            hashes[survey.trajectory_file] = hash_file(survey.trajectory_file)
    return hashes


def _opened_stereo(survey: Survey, points: OpenedSurvey | None, work: Path, steps: RunSteps) -> OpenedStereo:
    """Return the stereo pairs with their poses, on the trajectory of the points where there are any."""
    check_extra("stereo")
    series = open_stereo(survey)
    assert series is not None, "the survey has [cameras]"
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
        return placed.checked(work)


# A survey that has logs and no trajectory: its trajectory is made from them, as `linework locate` does


def located_survey(survey: Survey, work: Path, steps: RunSteps) -> tuple[Survey, tuple[str, ...]]:
    """Return the survey with a trajectory, its own or one made from its logs, and messages about the latter.

    Parameters
    ----------
    work
        The work folder: a trajectory that is made stays there, in a file named by the hash of its content.

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
        name = f"{STORES}/located-{hash_path(found.trajectory)[:16]}.csv"
        claim(work, name)
        path = work / name
        if not path.is_file():
            write_trajectory(found.trajectory, path, overwrite=True)
    settings = {name: table for name, table in survey.settings.items() if name != "trajectory"}
    located = replace(
        survey, trajectory_file=path, trajectory_lever_m=(0.0, 0.0, 0.0), trajectory_boresight_deg=(0.0, 0.0, 0.0),
        settings=settings,
    )  # fmt: skip
    message = f"{survey.name}: no trajectory: made from the logs, as linework locate does"
    return located, (message, *content.warnings, *found.warnings)
