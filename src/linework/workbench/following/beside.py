"""Requests to a worker: the lines of a template beside a line.

Separate from `templates`, because it runs in the worker.
"""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from linework.arrays import FloatArray
from linework.errors import AbsentError
from linework.methods.templates.parallel import TemplateLines, template_steps
from linework.methods.templates.template import CrossTemplate
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.workbench.following.traces import INTERRUPT
from linework.workbench.worker.session import SurveySession


def template_beside(
    session: SurveySession, lines: LineSet, template: CrossTemplate | None
) -> Generator[None, object, TemplateLines | None]:
    """Find the lines of a template beside the first of some lines; None without either, or after `INTERRUPT`.

    It yields every metre or two of the line: a request that is silent is taken for hung.

    Raises
    ------
    AbsentError
        The survey has no points.
    """
    if template is None or not len(lines):
        return None
    opened = session.recordings.points
    if opened is None:
        raise AbsentError(
            "the survey has no points to find a template in",
            where=session.survey.name,
            advice="draw the lines",
        )
    store = opened.points

    def points_in(bounds: Bounds) -> tuple[FloatArray, FloatArray]:
        points = store.points(bounds, ordered=False, with_time=False, with_columns=False)
        bright = (
            np.zeros(len(points.xyz)) if points.intensity is None else points.intensity.astype(np.float64)
        )
        return points.xyz, bright

    steps = template_steps(lines.take([0]), template, points_in)
    while True:
        try:
            next(steps)
        except StopIteration as end:
            found: TemplateLines = end.value
            return found
        if (yield) == INTERRUPT:
            return None
