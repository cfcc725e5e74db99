"""A survey with all its points in memory, for what looks at all of them at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from linework.files.survey_points import SurveyPoints
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory
from linework.tiling.opened import OpenedSurvey


@dataclass(frozen=True, slots=True)
class SurveyRead:
    """A survey with its points and its trajectory in memory.

    Parameters
    ----------
    points
        Points used and left out, file by file.
    trajectory
        Path of the vehicle's origin, or None.
    warnings
        One line each.
    hashes
        SHA-256 of every input file that can be read.
    """

    survey: Survey
    points: SurveyPoints
    trajectory: Trajectory | None
    warnings: tuple[str, ...]
    hashes: Mapping[Path, str]


def in_memory(opened: OpenedSurvey) -> SurveyRead:
    """Return a survey with all its points read from the tile store."""
    points = SurveyPoints(opened.points.points(), opened.facts)
    return SurveyRead(opened.survey, points, opened.trajectory, opened.warnings, opened.hashes)
