"""Where the van was: its trajectory, of the vehicle's origin, and its images on the same clock."""

from __future__ import annotations

from dataclasses import dataclass

from linework.files.survey_trajectory import read_survey_trajectory_content, stereo_on_clock_of
from linework.model.images import StereoSeries
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory
from linework.navigation.lever import at_vehicle_origin


@dataclass(frozen=True, slots=True)
class VanPath:
    """Path of the vehicle's origin, or None; the stereo pairs on its clock; what was odd about the file."""

    trajectory: Trajectory | None
    series: StereoSeries | None
    warnings: tuple[str, ...] = ()


def read_van_path(survey: Survey, series: StereoSeries | None) -> VanPath:
    """Read the trajectory of a survey whose points are not wanted.

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
