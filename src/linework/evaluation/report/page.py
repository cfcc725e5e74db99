"""The report: one self-contained page of the extracted lines and, given a reference, their scores."""

from __future__ import annotations

import base64
import contextlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from linework.arrays import BoolArray
from linework.errors import InputError, extra_needed
from linework.evaluation.report.cuts import kerb_cuts, kerb_figure, marking_cuts, marking_figure
from linework.evaluation.report.plan import PointsIn, close_up_figure, plan_figure
from linework.evaluation.report.scores_figure import hits_figure, plot_png, tolerance_figure
from linework.evaluation.report.sections import cable_figure, cable_section, rail_figure, rail_sections
from linework.evaluation.report.stereo_views import StereoViews, chosen_numbers, views_figure
from linework.evaluation.report.tables import ReportTable, kinds_table, lines_table, score_tables
from linework.evaluation.tolerance import KindMatch
from linework.evaluation.values import Scores
from linework.model.grid import Bounds, holds
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.runs.opened.points import points_for_pictures
from linework.runs.opened.recordings import Recordings
from linework.runs.record import facts_of_run

with extra_needed("reports"):
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from matplotlib.figure import Figure

#: Tables with more rows than fit a screen are collapsed.
_LONG_TABLE = 25


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportContent:
    """The content of a report.

    Parameters
    ----------
    title
        Heading of the page.
    lines
        The extracted lines.
    points
        The laser points, or an even sample of them; None: no points in the plan, and no sections.
    points_in
        Reads all points within bounds, for close-ups; None: `points` are all there are.
    facts
        Names and values for the head of the page: survey, CRS, timings, versions.
    reference
        Reference lines, or None.
    parts, scores
        The comparison with the reference (`match_lines`, `scores_of`); empty and None without one.
    views
        Stereo pairs to draw the lines into, or None.
    """

    title: str
    lines: LineSet
    points: Points | None = None
    points_in: PointsIn | None = None
    facts: Mapping[str, str] = field(default_factory=dict)
    reference: LineSet | None = None
    parts: Sequence[KindMatch] = ()
    scores: Scores | None = None
    views: StereoViews | None = None


def report_html(report: ReportContent) -> str:
    """Return the page as self-contained HTML: figures are embedded, nothing is fetched.

    Notes
    -----
    The same content gives the same text. Names from files are escaped.
    """
    environment = Environment(
        loader=PackageLoader("linework", "evaluation"), autoescape=True, undefined=StrictUndefined
    )
    template = environment.get_template("report.html.j2")
    # Lines as measured in stereo images are drawn into the images only: in plan they coincide with those kept
    kept = replace(report, lines=report.lines.take(~_is_as_measured(report.lines)))
    views = _view_figures(report.lines, report.views) if report.views is not None else ()
    figures = [
        {"title": title, "caption": caption, "base64": base64.b64encode(plot_png(figure)).decode("ascii")}
        for title, caption, figure in (*_figures(kept), *views)
    ]
    tables = [
        {
            "title": table.title, "columns": table.columns, "rows": table.rows, "note": table.note,
            "is_long": len(table.rows) > _LONG_TABLE,
        }
        for table in _tables(report)
    ]  # fmt: skip
    page: str = template.render(
        title=report.title, facts=list(report.facts.items()), figures=figures, tables=tables
    )
    return page


def _figures(report: ReportContent) -> Iterator[tuple[str, str, Figure]]:
    """Yield title, caption and figure of whatever the report has to show."""
    over = "normalised intensity of the ground" if _has_intensity(report) else "point density"
    has_points = report.points is not None and len(report.points) > 0
    yield (
        "Lines over the point cloud" if has_points else "Lines",
        f"Plan{f'; grey: {over}' if has_points else ''}. Rotated so that the road runs from left to right.",
        plan_figure(report.lines, report.points),
    )
    if report.points is not None and len(report.points):
        yield from _close_figures(report, report.points, report.points_in or _reader(report.points))
        yield from _section_figures(report, report.points)
    if report.parts and report.scores is not None:
        yield (
            "Found, missed and wrong",
            f"Plan by kind, within {report.scores.tolerance_m:g} m (cables in space).",
            hits_figure(report.parts, report.scores.tolerance_m),
        )
        yield "Scores by tolerance", "", tolerance_figure(report.scores)


def _close_figures(
    report: ReportContent, points: Points, points_in: PointsIn
) -> Iterator[tuple[str, str, Figure]]:
    """Yield the figures at single stations along the lines: plan, kerbs, markings."""
    near = close_up_figure(report.lines, points, points_in)
    if near is not None:
        yield "Close-ups", "The same plan at three stations along the road.", near
    kerbs = kerb_cuts(report.lines, points_in, report.reference)
    if kerbs:
        yield (
            "Across the road boundary",
            "Slices 0.5 m thick. The line is the foot of the kerb, or the edge of the pavement.",
            kerb_figure(kerbs),
        )
    markings = marking_cuts(report.lines, points_in, report.reference) if _has_intensity(report) else ()
    if markings:
        yield (
            "Across markings",
            "Intensity in slices 1.5 m thick. The line is the centreline of the paint.",
            marking_figure(markings),
        )


def _section_figures(report: ReportContent, points: Points) -> Iterator[tuple[str, str, Figure]]:
    """Yield the sections across a guardrail and along a cable span."""
    sections = rail_sections(points, report.lines, report.reference)
    if sections:
        yield (
            "Across a guardrail",
            "Slices 0.6 m thick. The line is the top edge of the beam, in plan midway between crest and valley.",
            rail_figure(sections),
        )
    section = cable_section(points, report.lines, report.reference)
    if section is not None:
        yield "Along a cable span", "Vertical slice 6 m thick.", cable_figure(section)


def _view_figures(lines: LineSet, views: StereoViews) -> Iterator[tuple[str, str, Figure]]:
    """Yield the lines in some stereo pairs; the run has already reported pairs that cannot be read."""
    as_measured = lines.take(_is_as_measured(lines))
    shown = as_measured if len(as_measured) else lines
    with contextlib.suppress(InputError):
        yield (
            "Lines in the images",
            "Left and right rectified images, with the lines as measured in images projected into both.",
            views_figure(views, shown, chosen_numbers(shown, views)),
        )


def _is_as_measured(lines: LineSet) -> BoolArray:
    return np.array([str(kind).endswith("_stereo") for kind in lines.kind], dtype=bool)


def _has_intensity(report: ReportContent) -> bool:
    return report.points is not None and report.points.intensity is not None


def _reader(points: Points) -> PointsIn:
    """Return a reader of the points within bounds, out of points in memory."""

    def points_in(bounds: Bounds) -> Points:
        return points.take(holds(bounds, points.xyz))

    return points_in


def _tables(report: ReportContent) -> Iterator[ReportTable]:
    if report.scores is not None:
        yield from score_tables(report.scores)
    yield kinds_table(report.lines)
    yield lines_table(report.lines)


def extraction_report(lines: LineSet, recordings: Recordings, record: Mapping[str, Any]) -> str:
    """Return the report of an extraction as HTML: its lines over points and images, and in tables.

    Parameters
    ----------
    record
        The record of the run that found the lines.
    """
    store, stereo = recordings.points.points if recordings.points else None, recordings.stereo
    return report_html(
        ReportContent(
            title=f"Lines of {recordings.survey.name}",
            lines=lines,
            points=points_for_pictures(store) if store else None,
            points_in=store.points if store else None,
            views=StereoViews(stereo.poses, stereo.numbers, stereo.pair) if stereo else None,
            facts=facts_of_run(record),
        )
    )
