"""What the routes of the server share."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from fastapi import Request, WebSocket

from linework.files.line_file.file import LineFile
from linework.workbench.following.traces import KeptTraces
from linework.workbench.worker.conversation import SurveyWorker
from linework.workbench.worker.open import SurveyFacts
from linework.workbench.worker.session import SurveyOrder

# What happens at the workbench, told to every page that listens

#: A page that does not read falls behind so far; then it is told to ask for everything anew.
MOST_WAITING = 1000


class Broadcaster:
    """Tells messages (plain values that become JSON) to all listeners."""

    def __init__(self) -> None:
        self._queues: set[asyncio.Queue[dict[str, Any]]] = set()

    def tell(self, message: dict[str, Any]) -> None:
        """Tell all listeners; called on the server's loop."""
        for queue in self._queues:
            if queue.qsize() < MOST_WAITING:
                queue.put_nowait(message)
            elif queue.qsize() == MOST_WAITING:
                queue.put_nowait({"type": "behind"})

    @contextmanager
    def listening(self) -> Iterator[asyncio.Queue[dict[str, Any]]]:
        """Give a queue of what is told from now on."""
        queue: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self._queues.add(queue)
        try:
            yield queue
        finally:
            self._queues.discard(queue)


@dataclass(frozen=True, slots=True, kw_only=True)
class AppState:
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
        The last lines that were followed: see `linework.workbench.following.traces.kept_trace`.
    who
        Who edits, for the record.
    """

    order: SurveyOrder
    facts: SurveyFacts
    drawing: LineFile
    pictures: SurveyWorker
    tracing: SurveyWorker
    hub: Broadcaster = field(default_factory=Broadcaster)
    traces: KeptTraces = field(default_factory=KeptTraces)
    who: str = ""


def state_of_request(request: Request) -> AppState:
    """Return the bench of a request (for ``Depends``)."""
    bench: AppState = request.app.state.bench
    return bench


def state_of_socket(socket: WebSocket) -> AppState:
    """Return the bench of a WebSocket."""
    bench: AppState = socket.app.state.bench
    return bench
