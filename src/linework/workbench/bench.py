"""What the routes of the server share."""

from __future__ import annotations

from dataclasses import dataclass, field

from fastapi import Request, WebSocket

from linework.files.drawing import DrawingFile
from linework.workbench.desk import Desk
from linework.workbench.following_kept import KeptTraces
from linework.workbench.hub import Hub
from linework.workbench.opening import SurveyFacts
from linework.workbench.table import SurveyOrder


@dataclass(frozen=True, slots=True, kw_only=True)
class Bench:
    """One survey on the workbench.

    Parameters
    ----------
    order, facts
        Which survey, and what is known of it.
    drawing
        The lines, on disk.
    pictures
        Desk for what is looked at: tiles, points, sections, heights, images. Works there take milliseconds.
    tracing
        Desk for following lines: one at a time.
    hub
        Tells all pages what happens.
    traces
        The last lines that were followed: see `linework.workbench.following_kept.kept_trace`.
    who
        Who edits, for the record.
    """

    order: SurveyOrder
    facts: SurveyFacts
    drawing: DrawingFile
    pictures: Desk
    tracing: Desk
    hub: Hub = field(default_factory=Hub)
    traces: KeptTraces = field(default_factory=KeptTraces)
    who: str = ""


def bench_of(request: Request) -> Bench:
    """Return the bench of a request (for ``Depends``)."""
    bench: Bench = request.app.state.bench
    return bench


def bench_of_socket(socket: WebSocket) -> Bench:
    """Return the bench of a WebSocket."""
    bench: Bench = socket.app.state.bench
    return bench
