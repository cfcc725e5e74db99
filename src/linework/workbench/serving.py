"""Serving a survey: opened, with its lines, until somebody ends it."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import socket
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import uvicorn
from fastapi import FastAPI

from linework.files.drawing import DrawingFile
from linework.tiling.steps import Watcher
from linework.workbench.bench import Bench
from linework.workbench.connections import settings
from linework.workbench.desk import Desk
from linework.workbench.guard import Guard
from linework.workbench.listener import HOST, listener_at, usual_port
from linework.workbench.opening import SurveyFacts, open_at_desk, place_at_desk
from linework.workbench.page_files import page_files
from linework.workbench.server import create_app
from linework.workbench.sessions import Sessions
from linework.workbench.table import SurveyOrder
from linework.workbench.warming import Busy, warm_up

#: Lines of a survey that names no other file, in its folder.
LINES_NAME = "lines.gpkg"


@dataclass(frozen=True, slots=True, kw_only=True)
class Serving:
    """What is served, and whom to tell of it.

    Parameters
    ----------
    order, lines
        The survey, and the file of its lines; None: `LINES_NAME` in its folder.
    port
        0: any that is free.
    who
        Who edits, for the record.
    watcher
        Shown the steps of opening.
    ready
        Called once with what is served and the URL that opens it.
    renewed
        Called with the next URL when one has been used.
    save_log
        Called with faults.
    """

    order: SurveyOrder
    lines: Path | None
    port: int
    who: str
    watcher: Watcher
    ready: Callable[[Bench, str], None]
    renewed: Callable[[str], None]
    save_log: Callable[[BaseException], Any]


async def serve(serving: Serving) -> int:
    """Serve until a signal comes, and return its number.

    Raises
    ------
    LineworkError
        The survey or the lines cannot be opened.
    OutputExistsError
        Another run holds the lines.
    MachineError
        The port is taken.
    """
    async with contextlib.AsyncExitStack() as held:
        stopped = held.enter_context(_signals())
        opening = asyncio.ensure_future(_opened(serving, held))
        if await _first(opening, stopped):
            await _left(opening)
            return stopped.result()
        bench, listener = opening.result()
        app = create_app(bench)
        server = _server(serving, bench, app, listener)
        running = asyncio.ensure_future(server.serve([listener]))
        held.callback(asyncio.ensure_future(warm_up(bench, _busy(bench, app))).cancel)
        await _first(running, stopped)
        server.should_exit = True
        await running
        # Jobs and pictures made ahead, too: nobody may reach for the lines when they are closed
        tasks = asyncio.all_tasks() - {asyncio.current_task()}
        for task in tasks:
            task.cancel()
        # Nobody waits until they are done with what they are at
        bench.pictures.kill()
        bench.tracing.kill()
        for task in tasks:
            await _left(task)
        return stopped.result()


async def _opened(serving: Serving, held: contextlib.AsyncExitStack) -> tuple[Bench, socket.socket]:
    """Open the survey and its lines; what could be refused at once is tried first."""
    listener = held.enter_context(listener_at(serving.port, usual_port(serving.order.inputs[0])))
    pictures = held.enter_context(_desk(serving.order))
    tracing = held.enter_context(_desk(serving.order))
    root, crs = await pictures.ask(place_at_desk)
    lines = serving.lines or Path(root) / LINES_NAME
    drawing = held.enter_context(DrawingFile.opened(lines, crs=crs))
    facts = await _watched(pictures, serving.watcher)
    bench = Bench(
        order=serving.order, facts=facts, drawing=drawing, pictures=pictures, tracing=tracing, who=serving.who
    )
    return bench, listener


async def _watched(desk: Desk, watcher: Watcher) -> SurveyFacts:
    """Open the survey at a desk and show how far that is."""
    async with desk.doing(open_at_desk) as steps:
        async for step, *amounts in steps:
            getattr(watcher, step)(*amounts)
    facts: SurveyFacts = steps.value
    return facts


def _busy(bench: Bench, app: FastAPI) -> Busy:
    """Return what tells all pages what the server is still doing."""

    def tell(words: str) -> None:
        app.state.busy = words
        bench.hub.tell({"type": "busy", "busy": words})

    return Busy(tell)


def _server(serving: Serving, bench: Bench, app: FastAPI, listener: socket.socket) -> uvicorn.Server:
    port = listener.getsockname()[1]

    def url(token: str) -> str:
        return f"http://{HOST}:{port}/?token={token}"

    sessions = Sessions(port, lambda token: serving.renewed(url(token)))
    guard = Guard(app, sessions, port, page_files(), serving.save_log)
    return _Server(uvicorn.Config(guard, **settings()), lambda: serving.ready(bench, url(sessions.token)))


class _Server(uvicorn.Server):
    """A server that says when it is ready, and leaves signals to who started it."""

    def __init__(self, config: uvicorn.Config, ready: Callable[[], None]) -> None:
        super().__init__(config)
        self._ready = ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to listen, and say so."""
        await super().startup(sockets)
        self._ready()

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Take no signals."""
        yield


async def _first(work: asyncio.Future[Any], stopped: asyncio.Future[int]) -> bool:
    """Wait for a work to end, or for a signal, in which case the work is left; return whether one came."""
    await asyncio.wait({work, stopped}, return_when=asyncio.FIRST_COMPLETED)
    return stopped.done()


async def _left(work: asyncio.Future[Any]) -> None:
    """Give up a work and wait until it has taken that in."""
    work.cancel()
    await asyncio.wait({work})


@contextlib.contextmanager
def _signals() -> Iterator[asyncio.Future[int]]:
    """Give a future that SIGINT or SIGTERM sets; the handlers that were there are set again at the end."""
    loop = asyncio.get_running_loop()
    stopped: asyncio.Future[int] = loop.create_future()

    def stop(number: int) -> None:
        if not stopped.done():
            stopped.set_result(number)

    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        loop.add_signal_handler(number, stop, int(number))
    try:
        yield stopped
    finally:
        for number, handler in before.items():
            loop.remove_signal_handler(number)
            signal.signal(number, handler)


@contextlib.contextmanager
def _desk(order: SurveyOrder) -> Iterator[Desk]:
    desk = Desk(order)
    try:
        yield desk
    finally:
        desk.kill()
