"""What the search area about a clicked place shows, for the card that says why no line is followed from there.

Separate from `points`, which sends points to be drawn.
"""

from __future__ import annotations

from typing import Any

from linework.errors import InputError
from linework.tracing.as_published import explain_search_area
from linework.workbench.worker.session import SurveySession


def search_area_document(session: SurveySession, at: tuple[float, float]) -> dict[str, Any]:
    """Return the search area about a place (east, north) [m, world], as the page's type `SearchArea`.

    The steps are those of the published method: normals, floor, and the histogram of intensities with the range of
    paint that it proposes.

    Raises
    ------
    InputError
        The survey has no laser points.
    """
    points = session.recordings.points
    if points is None:
        raise InputError("no laser points in this survey", where=session.survey.name)
    found: dict[str, Any] = explain_search_area(points.points, at, session.settings.obb_2023).as_json()
    return found
