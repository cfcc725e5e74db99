"""One line from one picked place, in laser points or in an image."""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from linework.errors import InputError, UsageError, argument
from linework.library.opened import (
    GivenSettings,
    GivenSource,
    GivenTrajectory,
    opened_source,
    settings_given,
    temporary_work,
)
from linework.library.progress import Progress, display_of
from linework.library.report import OnProblem, check_on_problem, lose_nothing, report_of_recordings
from linework.model.lines import LineSet
from linework.processes.executors import Serial
from linework.runs.opened.points import OpenedSurvey, surface_of
from linework.runs.opened.recordings import Recordings
from linework.runs.settings import RunSettings
from linework.runs.steps import RunSteps
from linework.tracing.as_published import (
    SearchAreaFound,
    check_trace_method,
    explain_search_area,
    follow_as_published,
)
from linework.tracing.in_images import ImageTracer, TracedEdge
from linework.tracing.trace import PICKED_KINDS, TracedLine, Tracer, check_pick_kind

TracedT = TypeVar("TracedT")


def trace(
    src: GivenSource,
    at: Sequence[float],
    *,
    kind: str | None = None,
    toward: Sequence[float] | None = None,
    image: str | Path | None = None,
    method: str = "auto",
    crs: Any = None,
    trajectory: GivenTrajectory = None,
    allow_outside: bool = False,
    allow_remote: bool = False,
    settings: GivenSettings = None,
    work: str | Path | None = None,
    progress: Progress = None,
    on_problem: OnProblem = "raise",
) -> LineSet:
    """Return the line at one picked place, followed both ways.

    Parameters
    ----------
    src
        As for `extract`.
    at
        (2,) east, north, or (3,) with a height, which does not matter, within 0.5 m of the line [m, world]; with `image` column, row within 4 pixels of it [px].
    kind
        Kind of line; None: that of the nearest one.
    toward
        (2,) place towards which the line is followed [m, world]; None: both ways.
    image
        An image of the survey, or the end of its path, such as "left/000123.png": an edge is followed in the stereo
        pairs (He and Novak 1992) instead of the points.
    method
        "auto", or "obb-2023": lane markings and road boundaries as published, with the settings ``obb_2023``.
    crs, trajectory, allow_outside, allow_remote, settings, work, progress, on_problem
        As for `extract`.

    Returns
    -------
    LineSet
        The line; its dashes, or the top of its kerb, come after it.

    Raises
    ------
    InputError
        There is no line at the place; the message says why, and where the nearest one is.
    PartialError
        Files or recordings were left out, and `on_problem` is "raise".
    UsageError
        A kind that cannot be picked, or a place that is not two finite numbers.
    """
    # A place picked in 3-D has a height too; a pixel has not
    place = place_of("at", at[:2] if image is None and np.shape(at) == (3,) else at)
    target = None if toward is None else place_of("toward", toward)
    if image is not None and target is not None:
        raise UsageError("only valid in laser points", where=argument("toward"), advice="omit it")
    chosen = settings_given(settings)
    check_on_problem(on_problem)
    check_trace_method(method)
    if image is None:
        check_pick_kind(kind or "")
    elif method != "auto":
        raise UsageError("only valid in laser points", where=argument("method"), advice="omit it")
    with contextlib.ExitStack() as held:
        steps = RunSteps(held.enter_context(display_of(progress)))
        folder = held.enter_context(temporary_work(work))
        recordings = held.enter_context(
            opened_source(
                src, folder, crs=crs, trajectory=trajectory, allow_outside=allow_outside, allow_remote=allow_remote, laser=image is None,
                images=image is not None,
                kinds=kinds_to_compile(kind or "", in_image=image is not None), steps=steps,
            )
        )  # fmt: skip
        found: TracedLine | TracedEdge
        if image is not None:
            found = traced_edge(recordings, Path(image), place, kind=kind or "", steps=steps)
        else:
            found = traced_line(
                recordings, place, kind=kind or "", toward=target, settings=chosen, steps=steps, method=method
            )
    report = report_of_recordings(recordings, found.lines, [found.kind], steps.timings_s)
    return lose_nothing(found.lines, report, on_problem)


def kinds_to_compile(kind: str, *, in_image: bool) -> tuple[str, ...]:
    """Return the kinds whose kernels a trace comes to: all that can be picked if none is named."""
    if in_image:
        return ()
    return (kind,) if kind else PICKED_KINDS


def traced_line(
    recordings: Recordings,
    at: tuple[float, float],
    *,
    kind: str,
    toward: tuple[float, float] | None,
    settings: RunSettings,
    steps: RunSteps,
    method: str = "auto",
) -> TracedLine:
    """Return the line at a place (east, north) [m, world] in the points of a survey, as `Tracer.trace` does."""
    opened = _points_of(recordings)
    if method == "obb-2023":
        with steps.step("trace line"):
            return follow_as_published(opened, at, kind=kind, toward=toward, config=settings.obb_2023)
    surface = surface_of(opened, settings.road, Serial(), steps)
    with steps.step("trace line"):
        return _drained(Tracer(opened, surface, settings).trace(at, kind=kind, toward=toward))


def search_area_at(recordings: Recordings, at: tuple[float, float], settings: RunSettings) -> SearchAreaFound:
    """Return what the search area about a place (east, north) [m, world] shows."""
    return explain_search_area(_points_of(recordings).points, at, settings.obb_2023)


def _points_of(recordings: Recordings) -> OpenedSurvey:
    """Return the opened points of a survey; one without points is refused."""
    if recordings.points is None:
        raise InputError("no laser points in this survey", where=recordings.survey.name)
    return recordings.points


def traced_edge(
    recordings: Recordings, image: Path, at_px: tuple[float, float], *, kind: str, steps: RunSteps
) -> TracedEdge:
    """Return the edge at a pixel (column, row) of an image of a survey, as `ImageTracer.trace` does."""
    stereo = recordings.stereo
    if stereo is None:
        raise InputError("no stereo images in this survey", where=recordings.survey.name)
    with steps.step("trace edge", unit="pairs") as advance:
        return _drained(
            ImageTracer(stereo).trace(image, at_px, kind=kind),
            lambda n_done: advance(n_done, len(stereo.pairs)),
        )


def _drained(tracing: Generator[Any, Any, TracedT], advance: Any = None) -> TracedT:
    """Return the result of a trace that runs to its end."""
    n_done = 0
    while True:
        try:
            next(tracing)
        except StopIteration as end:
            found: TracedT = end.value
            return found
        n_done += 1
        if advance is not None:
            advance(n_done)


def place_of(name: str, place: Sequence[float]) -> tuple[float, float]:
    """Return a place of two finite numbers.

    Raises
    ------
    UsageError
        It is something else.
    """
    try:
        east, north = (float(value) for value in np.asarray(place, dtype=np.float64).ravel())
    except (TypeError, ValueError):
        east = north = np.nan
    if not (np.isfinite(east) and np.isfinite(north)):
        raise UsageError(
            f"{place!r} is not a place", where=argument(name), advice="give two numbers, such as (500123.45, 5400678.90)"
        )  # fmt: skip
    return east, north
