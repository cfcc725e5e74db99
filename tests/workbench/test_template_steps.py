"""The search for the lines of a template speaks while it lasts, and hears when it is to end."""

from __future__ import annotations

import asyncio
import json
import pkgutil
from contextlib import asynccontextmanager
from types import SimpleNamespace

import numpy as np
import pytest
from pydantic import TypeAdapter

from linework.errors import UsageError
from linework.methods.templates.template import CrossTemplate, TemplateNode
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.workbench.edits import measure
from linework.workbench.edits.orders import EditOrder
from linework.workbench.following import follow
from linework.workbench.following.messages import FollowPlace
from linework.workbench.following.traces import INTERRUPT, KeptTraces

TEMPLATE = CrossTemplate("beside", (TemplateNode("verge", "fixed", 1.0, 0.0, "edge_other"),))
LENGTH_M = 60.0
LINE = LineSet.from_lines([[[0.0, 0.0, 0.0], [LENGTH_M, 0.0, 0.0]]], kind=["road_boundary"], id=["a"])


class Tracer:
    """Follows `LINE` in one step."""

    def trace(self, _at, **_):
        yield LINE
        return SimpleNamespace(lines=LINE, stops=("there", "there"), distance_m=0.0)


@pytest.fixture
def session():
    store = SimpleNamespace(points=lambda *_, **__: Points(np.zeros((0, 3))))
    return SimpleNamespace(
        recordings=SimpleNamespace(points=SimpleNamespace(points=store)), survey=SimpleNamespace(name="x")
    )


def messages_of(session, monkeypatch, *, interrupts_after):
    """Return the messages about a line with a template."""
    monkeypatch.setattr(follow, "tracer_of", lambda _: Tracer())
    order = FollowPlace(type="pick", at=(1.0, 0.0), kind="road_boundary", template="beside")
    steps = follow.follow_in_worker(session, order, TEMPLATE, "trace-1")
    told = [next(steps)]
    while True:
        try:
            told.append(steps.send(INTERRUPT if len(told) == interrupts_after else None))
        except StopIteration:
            return told


def test_the_worker_speaks_every_few_metres(session, monkeypatch):
    told = messages_of(session, monkeypatch, interrupts_after=0)
    assert len(told) > LENGTH_M / 2.0
    assert told[-1].trace.left_out == ""
    assert len(told[-1].trace.beside) == 1


def test_a_template_that_is_interrupted_is_left_out_and_that_is_said(session, monkeypatch):
    told = messages_of(session, monkeypatch, interrupts_after=6)
    assert len(told) == 7
    stopped = json.loads(told[-1].text)
    assert stopped["type"] == "stopped" and stopped["left_out"] == "beside"
    assert not stopped["interrupted"]
    assert len(stopped["lines"]) == 1
    assert told[-1].trace.beside is None


def test_an_edit_that_looks_for_a_template_can_be_interrupted(session, monkeypatch):
    traces = KeptTraces()
    sent = []

    class Request:
        def __init__(self, steps):
            self.steps, self.result = steps, None

        async def __aiter__(self):
            try:
                yield next(self.steps)
                traces.interrupt()
                while True:
                    yield self.steps.send(sent.pop() if sent else None)
            except StopIteration as end:
                self.result = end.value

        def send(self, value):
            sent.append(value)

    class Tracing:
        @asynccontextmanager
        async def request(self, function, *arguments):
            yield Request(pkgutil.resolve_name(function)(session, *arguments))

    monkeypatch.setattr(measure, "template_of_survey", lambda *_: TEMPLATE)
    state = SimpleNamespace(traces=traces, tracing=Tracing(), line_file=SimpleNamespace(lines=LINE))
    edit = TypeAdapter(EditOrder).validate_python({"action": "template", "id": "a", "template": "beside"})
    with pytest.raises(UsageError, match="interrupted"):
        asyncio.run(measure.inputs_for(edit, state))
