"""Serving a survey: opened, with its lines, until somebody ends it."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import signal
import socket
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h11
import uvicorn
from fastapi import FastAPI
from uvicorn.protocols.http.h11_impl import H11Protocol

from linework.errors import MachineError
from linework.files.line_file.file import LineFile
from linework.runs.steps import Watcher
from linework.workbench.server.app import create_app
from linework.workbench.server.bench import AppState
from linework.workbench.server.guard import Guard, page_files
from linework.workbench.server.sessions import Sessions
from linework.workbench.worker.conversation import SurveyWorker
from linework.workbench.worker.open import SurveyFacts, open_in_worker, read_folder_and_crs
from linework.workbench.worker.session import SurveyOrder
from linework.workbench.worker.warm_up import StartupProgress, warm_up

#: Lines of a survey that names no other file, in its folder.
LINES_NAME = "lines.gpkg"


@dataclass(frozen=True, slots=True, kw_only=True)
class RunningServer:
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
    ready: Callable[[AppState, str], None]
    renewed: Callable[[str], None]
    save_log: Callable[[BaseException], Any]


async def run_server(serving: RunningServer) -> int:
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


async def _opened(serving: RunningServer, held: contextlib.AsyncExitStack) -> tuple[AppState, socket.socket]:
    """Open the survey and its lines; what could be refused at once is tried first."""
    listener = held.enter_context(listener_at(serving.port, usual_port(serving.order.inputs[0])))
    pictures = held.enter_context(_desk(serving.order))
    tracing = held.enter_context(_desk(serving.order))
    root, crs = await pictures.ask(read_folder_and_crs)
    lines = serving.lines or Path(root) / LINES_NAME
    drawing = held.enter_context(LineFile.opened(lines, crs=crs))
    facts = await _watched(pictures, serving.watcher)
    bench = AppState(
        order=serving.order, facts=facts, drawing=drawing, pictures=pictures, tracing=tracing, who=serving.who
    )
    return bench, listener


async def _watched(desk: SurveyWorker, watcher: Watcher) -> SurveyFacts:
    """Open the survey at a desk and show how far that is."""
    async with desk.doing(open_in_worker) as steps:
        async for step, *amounts in steps:
            getattr(watcher, step)(*amounts)
    facts: SurveyFacts = steps.value
    return facts


def _busy(bench: AppState, app: FastAPI) -> StartupProgress:
    """Return what tells all pages what the server is still doing."""

    def tell(words: str) -> None:
        app.state.busy = words
        bench.hub.tell({"type": "busy", "busy": words})

    return StartupProgress(tell)


def _server(serving: RunningServer, bench: AppState, app: FastAPI, listener: socket.socket) -> uvicorn.Server:
    port = listener.getsockname()[1]

    def url(token: str) -> str:
        return f"http://{HOST}:{port}/?token={token}"

    sessions = Sessions(port, lambda token: serving.renewed(url(token)))
    guard = Guard(app, sessions, port, page_files(), serving.save_log)
    return _Server(
        uvicorn.Config(guard, **uvicorn_settings()), lambda: serving.ready(bench, url(sessions.token))
    )


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
def _desk(order: SurveyOrder) -> Iterator[SurveyWorker]:
    desk = SurveyWorker(order)
    try:
        yield desk
    finally:
        desk.kill()


# The address that is listened at: of this machine alone, and the same one for a survey where it is free

#: The only address that is listened at: nothing of this is for the network.
HOST = "127.0.0.1"
#: Ports that nobody is given for long (RFC 6335, section 6).
_FIRST, _N = 49152, 16384


def usual_port(survey: Path) -> int:
    """Return the port of a survey's workbench where none is asked for.

    A page that was left open, with edits that are not saved yet, finds the next server of its survey there.
    """
    return _FIRST + zlib.crc32(os.fsencode(survey.resolve())) % _N


@contextlib.contextmanager
def listener_at(port: int, usual: int) -> Iterator[socket.socket]:
    """Give a socket that is bound to a port of this machine alone.

    Parameters
    ----------
    port
        0: the usual one if it is free, else any that is.

    Raises
    ------
    MachineError
        The port is taken.
    """
    with contextlib.ExitStack() as held:
        for number in (port,) if port else (usual, 0):
            listener = held.enter_context(socket.socket(socket.AF_INET, socket.SOCK_STREAM))
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                listener.bind((HOST, number))
                listener.listen()
            except OSError as error:
                if number == usual and not port:
                    continue
                is_taken = error.errno == errno.EADDRINUSE
                problem = "the port is taken" if is_taken else str(error.strerror).lower()
                raise MachineError(
                    problem, where=f"--port {number}", advice="give another, or 0 for any"
                ) from None
            break
        yield listener


# Connections to the server: so many, and none that holds a place without asking for anything

#: A browser opens six and two sockets; what is beyond is closed at once, so that files can still be opened.
MOST_CONNECTIONS = 200
#: From the connection to the end of the first request's head. [s]
HEAD_S = 10.0


class BoundedConnection(H11Protocol):
    """A connection that is closed if its request does not come."""

    _patience: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin, or end at once where there are too many."""
        super().connection_made(transport)
        if len(self.connections) > MOST_CONNECTIONS:
            transport.abort()
        else:
            self._wait()

    def handle_events(self) -> None:
        """Take what came; from a request's head on, the guard watches the time."""
        super().handle_events()
        is_awaited = self.conn.their_state is h11.IDLE and not self.transport.is_closing()
        if not is_awaited:
            self._forget()
        elif self._patience is None:
            self._wait()

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        self._forget()
        super().connection_lost(exc)

    def _wait(self) -> None:
        self._patience = self.loop.call_later(HEAD_S, self.transport.close)

    def _forget(self) -> None:
        patience, self._patience = self._patience, None
        if patience is not None:
            patience.cancel()


def uvicorn_settings() -> dict[str, Any]:
    """Return what uvicorn is told of connections."""
    return {
        "http": BoundedConnection,
        "ws": "websockets-sansio",
        "ws_max_size": 1 << 16,
        "ws_max_queue": 16,
        "ws_per_message_deflate": False,
        "timeout_keep_alive": 15,
        "timeout_graceful_shutdown": 3,
        "h11_max_incomplete_event_size": 1 << 16,
        "server_header": False,
        "proxy_headers": False,
        "access_log": False,
        "log_config": None,
        "log_level": "critical",
        "lifespan": "off",
    }
