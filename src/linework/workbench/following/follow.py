"""Works at a desk that follow lines: from a place, from a pixel, and on beyond a gap."""

from __future__ import annotations

import contextlib
import itertools
import time
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from linework.arrays import FloatArray
from linework.errors import AbsentError, LineworkError
from linework.methods.obb.trace import PICK_M, TRACKED_AS
from linework.methods.picked_edge.method import SIDES, EdgeStep
from linework.model.lines import LineSet
from linework.tracing.in_images import ImageTracer, TracedEdge
from linework.tracing.trace import RefusedPickError, Trace, TracedLine, Tracer, check_pick_kind
from linework.workbench.following.messages import (
    FollowPixel,
    FollowPlace,
    area_message,
    growth_message,
    refusal_message,
    sighting_message,
    stopped_message,
)
from linework.workbench.following.traces import KeptTrace
from linework.workbench.worker.session import SurveySession

#: Said to a work: stop at the next step, and give what there is.
INTERRUPT = "interrupt"
#: A line is not drawn more often than this: ten times a second is smooth. [s]
LEAST_S = 0.1


@dataclass(frozen=True, slots=True)
class FollowMessage:
    """What a work tells: the words for the page ("": none), and the line that the page knows then (None: as before)."""

    text: str
    trace: KeptTrace | None = None


#: Told at steps that come too fast to be shown: somebody may stop it there.
_NOTHING = FollowMessage("")
Telling = Generator[FollowMessage, Any, None]
Step = TypeVar("Step")
Found = TypeVar("Found")


def follow_in_worker(table: SurveySession, order: FollowPlace, trace_id: str) -> Telling:
    """Follow the line at a place, telling how it grows."""
    yield FollowMessage(area_message(_area(order.at)))
    try:
        check_pick_kind(order.kind)
        toward = None if order.toward == order.at else order.toward
        steps = tracer_of(table).trace(order.at, kind=order.kind, toward=toward)
        found, is_interrupted = yield from _streamed(steps, lambda lines: _grown(trace_id, lines))
    except LineworkError as error:
        yield FollowMessage(refusal_message(error))
        return
    yield _stopped(trace_id, found, is_interrupted=is_interrupted)


def bridge_in_worker(table: SurveySession, trace: KeptTrace, end: int, trace_id: str) -> Telling:
    """Follow a line on beyond the gap at its start (0) or its end (1), telling how it grows."""
    try:
        steps = tracer_of(table).bridge(trace.lines, end, trace.stops)
        found, is_interrupted = yield from _streamed(steps, lambda lines: _grown(trace_id, lines))
    except LineworkError as error:
        yield FollowMessage(refusal_message(error))
        # The line is what it was, and nobody need try again
        why = error.reason if isinstance(error, RefusedPickError) else error.problem
        stops = (why, trace.stops[1]) if end == 0 else (trace.stops[0], why)
        kept = KeptTrace(trace.lines, stops=stops)
        yield FollowMessage(stopped_message(trace_id, kept, distance_m=0.0, is_interrupted=False), kept)
        return
    yield _stopped(trace_id, found, is_interrupted=is_interrupted)


def follow_image_in_worker(table: SurveySession, order: FollowPixel, trace_id: str) -> Telling:
    """Follow the edge at a pixel through the pairs, telling what each pair shows."""
    try:
        tracer = image_tracer_of(table)

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
    yield _stopped(trace_id, found, is_interrupted=is_interrupted)


def _streamed(
    steps: Generator[Step, bool | None, Found], shown: Any, *, least_s: float = LEAST_S
) -> Generator[FollowMessage, Any, tuple[Found, bool]]:
    """Tell the steps of a trace as `shown`; return it whole, and whether somebody stopped it."""
    said: bool | None = None
    is_interrupted, told_s = False, -np.inf
    while True:
        try:
            step = steps.send(said)
        except StopIteration as end:
            return end.value, is_interrupted
        said = None
        if time.monotonic() - told_s >= least_s:
            told = shown(step)
            heard = (yield told) if isinstance(told, FollowMessage) else (yield from told)
            told_s = time.monotonic()
        else:
            heard = yield _NOTHING
        if heard == INTERRUPT:
            said = is_interrupted = True


def tracer_of(table: SurveySession) -> Tracer:
    """Return the survey's points as lines are picked in them.

    Raises
    ------
    AbsentError
        There are none.
    """
    points, surface = table.recordings.points, table.surface
    if points is None or surface is None:
        raise AbsentError("the survey has no points to follow a line in", where=table.survey.name,
                          advice="pick in an image")  # fmt: skip
    return table.keep("tracer", lambda: Tracer(points, surface, table.settings))


def image_tracer_of(table: SurveySession) -> ImageTracer:
    """Return the survey's images as lines are picked in them.

    Raises
    ------
    AbsentError
        There are none.
    """
    stereo = table.recordings.stereo
    if stereo is None:
        raise AbsentError("the survey has no images to follow a line in", where=table.survey.name,
                          advice="pick in the plan")  # fmt: skip
    return table.keep("image tracer", lambda: ImageTracer(stereo))


def _area(at: tuple[float, float]) -> FloatArray:
    """Return the corners (4, 2) of where a line has to pass."""
    return np.asarray(at) + PICK_M * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def _grown(trace_id: str, lines: LineSet, *, in_images: bool = False) -> FollowMessage:
    return FollowMessage(growth_message(trace_id, lines), KeptTrace(lines, in_images))


def _stopped(trace_id: str, found: TracedLine | TracedEdge, *, is_interrupted: bool) -> FollowMessage:
    trace = KeptTrace(found.lines, isinstance(found, TracedEdge), found.stops)
    distance_m = found.distance_m if isinstance(found, TracedLine) else 0.0
    text = stopped_message(trace_id, trace, distance_m=distance_m, is_interrupted=is_interrupted)
    return FollowMessage(text, trace)


def _course(step: EdgeStep, kind: str) -> LineSet:
    """Return an edge as it has been seen so far."""
    if len(step.course) < 2:
        return LineSet.empty()
    return LineSet.from_lines([step.course], kind=[kind or "lane_marking"], method=["stereo"])


# Warming up: lines are followed for nobody, so that code and survey are at hand when somebody clicks

#: Beside the van's way there is a line within a lane or two. [m]
_BESIDE_M = (-5.0, -1.75, 1.75, 5.0)
#: A line of each kind is followed by so many steps: each part of the code has run then.
_STEPS = 4


def warm_up_in_worker(table: SurveySession) -> Generator[None, Any, None]:
    """Follow a line of each kind beside the van's way for a few steps; what is said to it ends it."""
    path = None if table.recordings.trajectory is None else table.recordings.trajectory.xyz
    if table.recordings.points is None or path is None or len(path) < 2:
        return
    tracer = tracer_of(table)
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
    """Run some steps of a trace, and what comes when it is stopped then."""
    with contextlib.suppress(StopIteration, LineworkError):
        for number in itertools.count():
            steps.send(None if number == 0 else number >= _STEPS)
            yield


def _places(path: FloatArray) -> Iterator[FloatArray]:
    """Yield places beside the middle of a van's way."""
    i = len(path) // 2
    before = path[max(i - 20, 0), :2]
    way = path[i, :2] - before
    length = float(np.hypot(*way))
    if length == 0.0:
        return
    right = np.array([way[1], -way[0]]) / length
    for across_m in _BESIDE_M:
        yield path[i, :2] + across_m * right
