"""Calibration of a survey's cameras in one call."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from linework.library.opened import given_survey, temporary_work
from linework.library.progress import Progress, display_of
from linework.library.report import warn_of
from linework.model.survey import Survey
from linework.runs.cameras.calibrate import SurveyCalibration, calibrate_survey
from linework.runs.steps import RunSteps


def calibrate(
    src: str | Path | Survey,
    *,
    crs: Any = None,
    allow_outside: bool = False,
    allow_remote: bool = False,
    progress: Progress = None,
) -> SurveyCalibration:
    """Return the calibration of a survey's stereo cameras, adjusted by its images and its trajectory.

    Corners are followed over pairs; focal length, principal point, distortion, relative and boresight angles and the
    offset of the clock are corrected where the corners support it. Nothing is written, and the given survey stays as
    it is.

    Parameters
    ----------
    src
        A survey folder with two cameras, or the opened survey.
    crs, allow_outside, allow_remote, progress
        As for `linework.extract`.

    Returns
    -------
    SurveyCalibration
        ``survey`` has the new calibration and can be given to `linework.extract`; ``values`` has each parameter
        before and after, its sigma, and why it was corrected or not.

    Raises
    ------
    InputError
        No pairs, no trajectory, no movement, or too few corners.

    Warns
    -----
    LineworkWarning
        Images that could not be read, or what was odd about times.
    """
    survey = given_survey(src, crs=crs, allow_outside=allow_outside, allow_remote=allow_remote)
    with display_of(progress) as display, temporary_work(None) as work:
        found = calibrate_survey(survey, work, RunSteps(display))
    warn_of(found.warnings)
    return found
