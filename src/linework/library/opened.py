"""What the public functions are given, opened: files, a survey, or points in memory."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from linework.crs import LOCAL, parse_crs
from linework.errors import UsageError, argument
from linework.files.geodetic import EarthFrame
from linework.files.settings_file import read_settings_file
from linework.files.survey.open import open_survey
from linework.files.trajectories.read import TrajectorySettings, read_trajectory_content, write_trajectory
from linework.library.report import warn_of
from linework.model.points import Points
from linework.model.settings import settings_from
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory
from linework.processes.forced_end import removed_if_forced
from linework.processes.system import usable_cores
from linework.runs.compile import compile_stage, compiled_for
from linework.runs.opened.from_points import opened_points
from linework.runs.opened.made import STORES, claim
from linework.runs.opened.points import hash_path
from linework.runs.opened.recordings import Recordings, opened_recordings
from linework.runs.opened.work_folder import work_folder
from linework.runs.settings import RunSettings
from linework.runs.steps import RunSteps

#: A file, a folder, a pattern such as "points/*.laz", several of them, an opened survey, or points in memory.
GivenSource = str | Path | Iterable[str | Path] | Survey | Points
#: A trajectory file or a trajectory in memory, of the vehicle's origin.
GivenTrajectory = str | Path | Trajectory | None
#: Settings, a run file, or its tables: ``{"radon": {"cell_m": 0.1}}``.
GivenSettings = RunSettings | Mapping[str, Any] | str | Path | None


def given_survey(
    src: GivenSource,
    *,
    crs: Any = None,
    carry: str | Sequence[str] = (),
    allow_outside: bool = False,
    allow_remote: bool = False,
) -> Survey:
    """Return the survey that files belong to, or the survey itself.

    Raises
    ------
    UsageError
        `crs`, `carry` or `allow_outside` is given with an opened survey, which has them; or points are no survey of
        files.
    """
    if isinstance(src, Points):
        raise UsageError(
            "points in memory are not a survey of files", where=argument("src"), advice="give files"
        )
    if hasattr(src, "__array__"):
        raise UsageError(
            "an array is not a survey", where=argument("src"),
            advice="write linework.Points(array, crs=...), and read from that",
        )  # fmt: skip
    if not isinstance(src, Survey):
        return open_survey(src, crs=crs, carry=carry, allow_outside=allow_outside, allow_remote=allow_remote)
    for name, value in (
        ("crs", crs),
        ("carry", carry),
        ("allow_outside", allow_outside),
        ("allow_remote", allow_remote),
    ):
        if value not in (None, (), False):
            raise UsageError(
                "an opened survey has its own", where=argument(name), advice="give it to open_survey instead"
            )
    return src


def settings_given(settings: GivenSettings) -> RunSettings:
    """Return the settings of a run.

    Raises
    ------
    ConfigError, UsageError
        An unknown setting, another type, or a value out of its range; or something that holds no settings.
    """
    if settings is None:
        return RunSettings()
    if isinstance(settings, RunSettings):
        return settings
    if isinstance(settings, Mapping):
        return settings_from(RunSettings, settings, where=argument("settings"))
    if not isinstance(settings, str | Path):
        raise UsageError(
            f"{settings!r:.60} are no settings",
            where=argument("settings"),
            advice="give a run file or its tables",
        )
    return read_settings_file(RunSettings, Path(settings))


@contextlib.contextmanager
def temporary_work(work: str | Path | None) -> Iterator[Path]:
    """Open the folder of the tile store and of unfinished runs; a temporary one if none is given."""
    if work is not None:
        yield work_folder(Path(work), Path(work))
        return
    with tempfile.TemporaryDirectory(prefix="linework-") as temporary, removed_if_forced(Path(temporary)):
        yield work_folder(Path(temporary), Path(temporary))


@contextlib.contextmanager
def opened_source(
    src: GivenSource,
    work: Path,
    *,
    crs: Any = None,
    trajectory: GivenTrajectory = None,
    carry: str | Sequence[str] = (),
    allow_outside: bool = False,
    allow_remote: bool = False,
    laser: bool = True,
    images: bool = True,
    kinds: Iterable[str] = (),
    steps: RunSteps | None = None,
) -> Iterator[Recordings]:
    """Open the recordings of a source: those of files, or points in memory as if they came from a file.

    Parameters
    ----------
    kinds
        Kinds of line that will be looked for: what they need is compiled first.

    Raises
    ------
    LineworkError
        As for `opened_recordings` and `opened_points`.
    """
    steps = steps or RunSteps()
    if isinstance(src, Points):
        if crs is not None or carry:
            name = "crs" if crs is not None else "carry"
            raise UsageError(
                "points in memory have their own", where=argument(name), advice="give it to Points"
            )
        path = trajectory
        if isinstance(path, str | Path):
            path = trajectory_in_file(path, src.crs)
        elif path is not None and not isinstance(path, Trajectory):
            raise _no_trajectory(path)
        compile_stage((*kinds, "points", *(["columns"] if src.columns else [])), steps)
        with opened_points(src, work, trajectory=path, steps=steps) as recordings:
            yield recordings
        return
    survey = given_survey(src, crs=crs, carry=carry, allow_outside=allow_outside, allow_remote=allow_remote)
    if trajectory is not None:
        survey = survey.with_trajectory(_given_file(trajectory, work))
    compile_stage(compiled_for(survey, kinds, images=images), steps)
    with opened_recordings(
        survey, work, laser=laser, images=images, n_threads=usable_cores(), steps=steps
    ) as recordings:
        yield recordings


def _given_file(trajectory: str | Path | Trajectory, work: Path) -> Path:
    """Return the file of a given trajectory; one in memory is written to the work folder."""
    if isinstance(trajectory, str | Path):
        return Path(trajectory)
    if not isinstance(trajectory, Trajectory):
        raise _no_trajectory(trajectory)
    name = f"{STORES}/given-{hash_path(trajectory)[:16]}.csv"
    claim(work, name)
    path = work / name
    write_trajectory(trajectory, path, overwrite=True)
    return path


def _no_trajectory(value: object) -> UsageError:
    return UsageError(
        f"{value!r:.60} is not a trajectory",
        where=argument("trajectory"),
        advice="give a file or a Trajectory",
    )


def trajectory_in_file(path: str | Path, crs: Any = None) -> Trajectory:
    """Return the trajectory of a file as it is there; latitudes and longitudes are transformed into a CRS."""
    frame = EarthFrame(crs=LOCAL if crs is None else parse_crs(crs, where=argument("crs")))
    content = read_trajectory_content(Path(path), TrajectorySettings(frame=frame))
    warn_of(content.warnings)
    return content.trajectory
