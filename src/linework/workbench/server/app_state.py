"""State that the routes of the server share."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Annotated, Any

from fastapi import Depends, Request, WebSocket

from linework.files.line_file.file import LineFile
from linework.workbench.following.traces import KeptTraces
from linework.workbench.worker.conversation import SurveyWorker
from linework.workbench.worker.open import SurveyFacts
from linework.workbench.worker.order import SurveyOrder

#: Messages that wait for a page that does not read them; then it is told to reload everything.
MOST_WAITING = 1000


class Broadcaster:
    """Sends messages (plain values that become JSON) to all listening pages."""

    def __init__(self) -> None:
        self._queues: set[asyncio.Queue[dict[str, Any]]] = set()

    def send(self, message: dict[str, Any]) -> None:
        """Send a message to all listeners; called on the server's loop."""
        for queue in self._queues:
            if queue.qsize() < MOST_WAITING:
                queue.put_nowait(message)
            elif queue.qsize() == MOST_WAITING:
                queue.put_nowait({"type": "behind"})

    @contextmanager
    def listening(self) -> Iterator[asyncio.Queue[dict[str, Any]]]:
        """Give a queue of the messages sent from now on."""
        queue: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self._queues.add(queue)
        try:
            yield queue
        finally:
            self._queues.discard(queue)


@dataclass(frozen=True, slots=True, kw_only=True)
class AppState:
    """The served survey, its lines, and the workers.

    Parameters
    ----------
    order, facts
        The survey to serve, and what is known of it.
    line_file
        The lines, on disk.
    pictures
        Worker for what is looked at: tiles, points, sections, heights, images. Requests take milliseconds.
    tracing
        Worker for following lines, one at a time.
    broadcaster
        To all pages.
    traces
        The last lines that were followed: see `linework.workbench.following.traces.kept_trace`.
    who
        Name of the person who edits, for the record.
    """

    order: SurveyOrder
    facts: SurveyFacts
    line_file: LineFile
    pictures: SurveyWorker
    tracing: SurveyWorker
    broadcaster: Broadcaster = field(default_factory=Broadcaster)
    traces: KeptTraces = field(default_factory=KeptTraces)
    who: str = ""


def state_of_request(request: Request) -> AppState:
    """Return the state of the application that got a request."""
    app_state: AppState = request.app.state.app_state
    return app_state


#: Parameter of a route.
CurrentState = Annotated[AppState, Depends(state_of_request)]


def state_of_socket(socket: WebSocket) -> AppState:
    """Return the state of the application that got a WebSocket."""
    app_state: AppState = socket.app.state.app_state
    return app_state
