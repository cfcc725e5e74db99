"""The report of an extraction: its lines over the points and in the images they were found in."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from linework.evaluation.report import Report, report_html
from linework.evaluation.stereo_views import StereoViews
from linework.model.lines import LineSet
from linework.tiling.overview import points_for_pictures
from linework.tiling.record import facts_of
from linework.tiling.recordings import Recordings


def extraction_report(lines: LineSet, recordings: Recordings, record: Mapping[str, Any]) -> str:
    """Return the page as HTML (see `report_html`): the lines drawn over the points, and listed.

    Parameters
    ----------
    record
        Of the run that found the lines.
    """
    store, stereo = recordings.points.points if recordings.points else None, recordings.stereo
    return report_html(
        Report(
            title=f"Lines of {recordings.survey.name}",
            lines=lines,
            points=points_for_pictures(store) if store else None,
            points_in=store.points if store else None,
            views=StereoViews(stereo.poses, stereo.numbers, stereo.pair) if stereo else None,
            facts=facts_of(record),
        )
    )
