"""Requests to the tracing worker: follow a line from a place or a pixel, and on beyond a gap.

Separate from `routes`, because it runs in the worker and imports the tracers.
"""

from __future__ import annotations

import contextlib
import itertools
import time
from collections.abc import Generator, Iterator
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from linework.arrays import FloatArray
from linework.errors import AbsentError, LineworkError, RefusedPickError
from linework.methods.obb.trace import PICK_M, TRACKED_AS
from linework.methods.picked_edge.method import SIDES, EdgeStep
from linework.methods.templates.parallel import TemplateLines
from linework.methods.templates.template import CrossTemplate
from linework.model.lines import LineSet
from linework.tracing.in_images import ImageTracer
from linework.tracing.trace import Trace, Tracer, check_pick_kind
from linework.workbench.following.beside import template_beside
from linework.workbench.following.messages import (
    FollowPixel,
    FollowPlace,
    area_message,
    growth_message,
    refusal_message,
    sighting_message,
    stopped_message,
)
from linework.workbench.following.traces import INTERRUPT, FollowMessage, KeptTrace
from linework.workbench.worker.session import SurveySession

#: Shortest time between two messages about a growing line: ten a second look smooth. [s]
LEAST_S = 0.1


#: Reported at steps that come too fast to be shown, so that the request can be interrupted there.
_NOTHING = FollowMessage("")
Telling = Generator[FollowMessage, Any, None]
Step = TypeVar("Step")
Found = TypeVar("Found")


def follow_in_worker(
    session: SurveySession, order: FollowPlace, template: CrossTemplate | None, trace_id: str
) -> Telling:
    """Follow the line at a place, reporting how it grows; once it has stopped, the lines of a template beside it."""
    yield FollowMessage(area_message(_area(order.at)))
    try:
        check_pick_kind(order.kind)
        toward = None if order.toward == order.at else order.toward
        steps = tracer_of(session).trace(order.at, kind=order.kind, toward=toward)
        found, is_interrupted = yield from _streamed(steps, lambda lines: _grown(trace_id, lines))
    except LineworkError as error:
        yield FollowMessage(refusal_message(error))
        return
    trace = yield from _with_template(session, KeptTrace(found.lines, stops=found.stops), template)
    yield _stopped(trace_id, trace, found.distance_m, is_interrupted=is_interrupted)


def bridge_in_worker(
    session: SurveySession, trace: KeptTrace, end: int, template: CrossTemplate | None, trace_id: str
) -> Telling:
    """Follow a line on beyond the gap at its start (0) or its end (1), reporting how it grows."""
    try:
        steps = tracer_of(session).bridge(trace.lines, end, trace.stops)
        found, is_interrupted = yield from _streamed(steps, lambda lines: _grown(trace_id, lines))
    except LineworkError as error:
        yield FollowMessage(refusal_message(error))
        # The line stays as it was, and its stop says that trying again is of no use
        why = error.reason if isinstance(error, RefusedPickError) else error.problem
        stops = (why, trace.stops[1]) if end == 0 else (trace.stops[0], why)
        kept = replace(trace, stops=stops)
        yield FollowMessage(stopped_message(trace_id, kept, distance_m=0.0, is_interrupted=False), kept)
        return
    trace = yield from _with_template(session, KeptTrace(found.lines, stops=found.stops), template)
    yield _stopped(trace_id, trace, found.distance_m, is_interrupted=is_interrupted)


def follow_image_in_worker(session: SurveySession, order: FollowPixel, trace_id: str) -> Telling:
    """Follow the edge at a pixel through the stereo pairs, reporting where each pair shows it."""
    try:
        tracer = image_tracer_of(session)

        def shown(step: EdgeStep) -> Generator[FollowMessage, Any, Any]:
            left, right = tracer.original(step)
            yield FollowMessage(sighting_message(trace_id, step.number, left, right))
            return (yield _grown(trace_id, _course(step, order.kind), in_images=True))

        side = SIDES.index(order.side)
        steps = tracer.trace_pair(tracer.pair(order.pair), side, order.at_px, kind=order.kind)
        found, is_interrupted = yield from _streamed(steps, shown, least_s=0.0)
    except LineworkError as error:
        yield FollowMessage(refusal_message(error, in_image=True))
        return
    trace = KeptTrace(found.lines, in_images=True, stops=found.stops)
    yield _stopped(trace_id, trace, 0.0, is_interrupted=is_interrupted)


def _streamed(
    steps: Generator[Step, bool | None, Found], shown: Any, *, least_s: float = LEAST_S
) -> Generator[FollowMessage, Any, tuple[Found, bool]]:
    """Report the steps of a trace as `shown`; return the whole trace, and whether it was interrupted."""
    stop: bool | None = None
    is_interrupted, shown_s = False, -np.inf
    while True:
        try:
            step = steps.send(stop)
        except StopIteration as end:
            return end.value, is_interrupted
        stop = None
        if time.monotonic() - shown_s >= least_s:
            message = shown(step)
            received = (yield message) if isinstance(message, FollowMessage) else (yield from message)
            shown_s = time.monotonic()
        else:
            received = yield _NOTHING
        if received == INTERRUPT:
            stop = is_interrupted = True


def tracer_of(session: SurveySession) -> Tracer:
    """Return the tracer of lines in the survey's points, made once.

    Raises
    ------
    AbsentError
        The survey has none.
    """
    points, surface = session.recordings.points, session.surface
    if points is None or surface is None:
        raise AbsentError("the survey has no points to follow a line in", where=session.survey.name,
                          advice="pick in an image")  # fmt: skip
    return session.keep("tracer", lambda: Tracer(points, surface, session.settings))


def image_tracer_of(session: SurveySession) -> ImageTracer:
    """Return the tracer of lines in the survey's images, made once.

    Raises
    ------
    AbsentError
        The survey has none.
    """
    stereo = session.recordings.stereo
    if stereo is None:
        raise AbsentError("the survey has no images to follow a line in", where=session.survey.name,
                          advice="pick in the plan")  # fmt: skip
    return session.keep("image tracer", lambda: ImageTracer(stereo))


def _area(at: tuple[float, float]) -> FloatArray:
    """Return the corners (4, 2) [m, world] of the square that a line has to cross."""
    return np.asarray(at) + PICK_M * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def _grown(trace_id: str, lines: LineSet, *, in_images: bool = False) -> FollowMessage:
    return FollowMessage(growth_message(trace_id, lines), KeptTrace(lines, in_images))


def _with_template(
    session: SurveySession, trace: KeptTrace, template: CrossTemplate | None
) -> Generator[FollowMessage, Any, KeptTrace]:
    """Find the lines of a template beside a line that has stopped; an interrupt leaves them out."""
    steps = template_beside(session, trace.lines, template)
    received = None
    while True:
        try:
            steps.send(received)
        except StopIteration as end:
            beside: TemplateLines | None = end.value
            break
        received = yield _NOTHING
    if beside is not None:
        return replace(trace, beside=beside.lines, unseen=beside.unseen)
    if template is not None and received == INTERRUPT:
        return replace(trace, left_out=template.name)
    return trace


def _stopped(trace_id: str, trace: KeptTrace, distance_m: float, *, is_interrupted: bool) -> FollowMessage:
    text = stopped_message(trace_id, trace, distance_m=distance_m, is_interrupted=is_interrupted)
    return FollowMessage(text, trace)


def _course(step: EdgeStep, kind: str) -> LineSet:
    """Return an edge as far as it has been followed."""
    if len(step.course) < 2:
        return LineSet.empty()
    return LineSet.from_lines([step.course], kind=[kind or "lane_marking"], method=["stereo"])


# Warming up: lines are followed once, so that code and survey are in memory at the first click

#: Distances right of the path at which a line is looked for: one is within a lane or two. [m]
_BESIDE_M = (-5.0, -1.75, 1.75, 5.0)
#: Steps for which a line of each kind is followed: each part of the code has run then.
_STEPS = 4
#: Vertices of the path over which its direction is taken.
_DIRECTION_VERTICES = 20


def warm_up_in_worker(session: SurveySession) -> Generator[None, Any, None]:
    """Follow a line of each kind beside the van's path for a few steps; `INTERRUPT` ends it."""
    path = None if session.recordings.trajectory is None else session.recordings.trajectory.xyz
    if session.recordings.points is None or path is None or len(path) < 2:
        return
    tracer = tracer_of(session)
    for kind in TRACKED_AS:
        for place in _places(path):
            steps = tracer.trace((float(place[0]), float(place[1])), kind=kind)
            followed = 0
            for _ in _drained(steps):
                followed += 1
                if (yield) == INTERRUPT:
                    return
            if followed:
                break


def _drained(steps: Trace) -> Iterator[None]:
    """Run some steps of a trace and its end, one step at a time."""
    with contextlib.suppress(StopIteration, LineworkError):
        for number in itertools.count():
            steps.send(None if number == 0 else number >= _STEPS)
            yield


def _places(path: FloatArray) -> Iterator[FloatArray]:
    """Yield places (2,) beside the middle of a path (n, 3) [m, world]."""
    i = len(path) // 2
    before = path[max(i - _DIRECTION_VERTICES, 0), :2]
    direction = path[i, :2] - before
    length = float(np.hypot(*direction))
    if length == 0.0:
        return
    right = np.array([direction[1], -direction[0]]) / length
    for across_m in _BESIDE_M:
        yield path[i, :2] + across_m * right
