"""Where the van was: its trajectory, of the vehicle's origin, on the clock of its images."""

from __future__ import annotations

from dataclasses import dataclass

from linework.files.survey_trajectory import on_clock_of, read_survey_trajectory_content
from linework.model.images import StereoSeries
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory
from linework.navigation.lever import at_vehicle_origin


@dataclass(frozen=True, slots=True)
class VanPath:
    """Path of the vehicle's origin, or None, and what was odd about its file."""

    trajectory: Trajectory | None
    warnings: tuple[str, ...] = ()


def read_van_path(survey: Survey, series: StereoSeries | None) -> VanPath:
    """Read the trajectory of a survey that has no points, or whose points are not wanted.

    Parameters
    ----------
    series
        Its stereo pairs: times that are of another epoch than theirs are put on their clock.

    Raises
    ------
    InputError, CrsError, ConfigError
        As for `read_survey_trajectory_content`.
    """
    content = read_survey_trajectory_content(survey)
    if content is None or survey.trajectory_file is None:
        return VanPath(None)
    if series is not None and series.pairs:
        span = series.pairs[0].time_s, series.pairs[-1].time_s
        content = on_clock_of(content, span, str(survey.settings.get("time", {}).get("epoch", "")), survey)
    path = at_vehicle_origin(content.trajectory, survey.trajectory_lever_m, survey.trajectory_boresight_deg)
    return VanPath(path, tuple(f"{survey.trajectory_file.name}: {text}" for text in content.warnings))
