"""Read the ready-made trajectory of a survey and convert it to the clock of its other recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from linework.errors import UsageError, argument
from linework.files.geodetic import EarthFrame
from linework.files.logs.clock import fitted_times, to_survey_time
from linework.files.trajectories.content import TrajectoryContent
from linework.files.trajectories.read import TrajectorySettings, read_trajectory_content
from linework.model.images import SingleCamera, StereoSeries
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory
from linework.navigation.lever import at_vehicle_origin


def read_survey_trajectory_content(survey: Survey) -> TrajectoryContent | None:
    """Read the trajectory that a survey names, of the point it describes; None where it names none.

    Where the file and the survey both state an epoch, times are converted to that of [time] epoch.

    Raises
    ------
    InputError, CrsError, ConfigError
        As for `read_trajectory_content`.
    UsageError
        It is the survey's own log of fixes, which are the antenna's.
    """
    if survey.trajectory_file is None:
        return None
    log = survey.settings.get("navigation", {}).get("gnss")
    if log and (survey.root / log).resolve() == survey.trajectory_file.resolve():
        raise UsageError(
            f"{survey.trajectory_file.name} is the log of the antenna, not the path of the vehicle",
            where=argument("trajectory"),
            advice="leave it out: the path is computed from the survey's logs",
        )
    table, time = (survey.settings.get(name, {}) for name in ("trajectory", "time"))
    settings = TrajectorySettings(
        frame=EarthFrame.of(survey),
        times_file=survey.root / table["times"] if "times" in table else None,
        rate_hz=table.get("rate_hz"),
    )
    content = read_trajectory_content(survey.trajectory_file, settings)
    stated, week = str(time.get("epoch", "")), time.get("week")
    is_known = content.epoch in ("gps", "unix") or (content.epoch == "gps_week" and week is not None)
    if not stated or not is_known:
        return replace(content, epoch=content.epoch or stated)
    time_s = to_survey_time(content.trajectory.time_s, content.epoch, stated, week=week)
    return replace(content, trajectory=replace(content.trajectory, time_s=time_s), epoch=stated)


def on_clock_of(
    content: TrajectoryContent, span_s: tuple[float, float], span_epoch: str, survey: Survey
) -> TrajectoryContent:
    """Return a trajectory on the clock of another recording, with warnings about its times.

    Parameters
    ----------
    span_s, span_epoch
        First and last time of the recording, and its epoch ("": by its range).
    """
    time_s, remarks = fitted_times(
        content.trajectory.time_s, content.epoch, span_s, span_epoch,
        week=survey.settings.get("time", {}).get("week"),
    )  # fmt: skip
    if not remarks:
        return content
    moved = replace(content.trajectory, time_s=time_s)
    return replace(content, trajectory=moved, warnings=(*content.warnings, *remarks), epoch=span_epoch)


def stereo_on_clock_of(series: StereoSeries, trajectory: Trajectory, survey: Survey) -> StereoSeries:
    """Return the stereo pairs of a survey on the clock of its trajectory, with warnings about their times.

    Times within the trajectory's stay unchanged; others are converted from [time] epoch, or from the epoch that their
    range shows.
    """
    if not series.pairs or not len(trajectory):
        return series
    time = survey.settings.get("time", {})
    span = float(trajectory.time_s[0]), float(trajectory.time_s[-1])
    times = np.array([pair.time_s for pair in series.pairs])
    moved, remarks = fitted_times(times, str(time.get("epoch", "")), span, "", week=time.get("week"))
    if not remarks:
        return series
    pairs = tuple(replace(pair, time_s=t) for pair, t in zip(series.pairs, moved.tolist(), strict=True))
    return replace(
        series, pairs=pairs, warnings=(*series.warnings, *(f"cameras: {text}" for text in remarks))
    )


def single_on_clock_of(
    cameras: Sequence[SingleCamera], trajectory: Trajectory | None, survey: Survey
) -> tuple[SingleCamera, ...]:
    """Return cameras without a partner on the clock of a trajectory, as `stereo_on_clock_of` does."""
    if trajectory is None or not len(trajectory):
        return tuple(cameras)
    time = survey.settings.get("time", {})
    span = float(trajectory.time_s[0]), float(trajectory.time_s[-1])
    found = []
    for camera in cameras:
        moved, remarks = fitted_times(
            camera.time_s, str(time.get("epoch", "")), span, "", week=time.get("week")
        )
        said = tuple(f"cameras.{camera.name}: {text}" for text in remarks)
        found.append(replace(camera, time_s=moved, warnings=(*camera.warnings, *said)))
    return tuple(found)


@dataclass(frozen=True, slots=True)
class VanPath:
    """Trajectory of the vehicle's origin, or None; the stereo pairs on its clock; warnings about the file."""

    trajectory: Trajectory | None
    series: StereoSeries | None
    warnings: tuple[str, ...] = ()


def read_van_path(survey: Survey, series: StereoSeries | None) -> VanPath:
    """Read the trajectory of a survey whose points are not used.

    Parameters
    ----------
    series
        Its stereo pairs (`open_stereo`), or None.

    Raises
    ------
    InputError, CrsError, ConfigError
        As for `read_survey_trajectory_content`.
    """
    content = read_survey_trajectory_content(survey)
    if content is None or survey.trajectory_file is None:
        return VanPath(None, series)
    path = at_vehicle_origin(content.trajectory, survey.trajectory_lever_m, survey.trajectory_boresight_deg)
    warnings = tuple(f"{survey.trajectory_file.name}: {text}" for text in content.warnings)
    if series is not None:
        series = stereo_on_clock_of(series, path, survey)
    return VanPath(path, series, warnings)
