"""Serve a survey and its lines until a signal ends it."""

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
from types import FrameType
from typing import Any

import h11
import uvicorn
from fastapi import FastAPI
from starlette.datastructures import Headers
from uvicorn.protocols.http.h11_impl import H11Protocol

from linework.errors import MachineError, argument
from linework.files.line_file.file import LineFile
from linework.processes.child import Child
from linework.processes.forced_end import wait_until_saved
from linework.processes.system import end_on_second
from linework.runs.steps import Watcher
from linework.workbench.server.app import create_app
from linework.workbench.server.app_state import AppState
from linework.workbench.server.guard import Guard, page_files
from linework.workbench.server.sessions import Sessions
from linework.workbench.worker.conversation import SurveyWorker
from linework.workbench.worker.open import SurveyFacts, open_in_worker, read_folder_and_crs
from linework.workbench.worker.order import SurveyOrder
from linework.workbench.worker.warm_up import StartupProgress, warm_up

#: File of the lines in the survey's folder, unless another one is named.
LINES_NAME = "lines.gpkg"


@dataclass(frozen=True, slots=True, kw_only=True)
class RunningServer:
    """What to serve, and callbacks for what happens.

    Parameters
    ----------
    order, lines
        The survey, and the file of its lines; None: `LINES_NAME` in its folder.
    process
        For the worker that opens the survey (`start_worker_process`); it ends with the server.
    port
        0: the survey's usual port, or any that is free.
    who
        Name of the person who edits, for the record.
    watcher
        Shows the steps of opening.
    ready
        Called once with the state of the server and the URL that opens it.
    renewed
        Called with the next URL when one has been used.
    save_log
        Called with faults.
    """

    order: SurveyOrder
    lines: Path | None
    process: Child
    port: int
    who: str
    watcher: Watcher
    ready: Callable[[AppState, str], None]
    renewed: Callable[[str], None]
    save_log: Callable[[BaseException], Any]


async def run_server(serving: RunningServer) -> int:
    """Serve until SIGINT or SIGTERM comes, and return its number.

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
        # First of all: its process runs already
        pictures = held.enter_context(_worker(serving.order, serving.process))
        stopped = held.enter_context(_signals())
        opening = asyncio.ensure_future(_opened(serving, pictures, held))
        if await _first(opening, stopped):
            await _cancelled(opening)
            return stopped.result()
        app_state, listener = opening.result()
        app = create_app(app_state)
        server = _server(serving, app_state, app, listener)
        running = asyncio.ensure_future(server.serve([listener]))
        held.callback(asyncio.ensure_future(warm_up(app_state, _progress(app_state, app))).cancel)
        await _first(running, stopped)
        server.should_exit = True
        await running
        # Jobs and prefetched pictures too: none may use the lines when they are closed
        tasks = asyncio.all_tasks() - {asyncio.current_task()}
        for task in tasks:
            task.cancel()
        # The workers are not waited for
        app_state.pictures.kill()
        app_state.tracing.kill()
        for task in tasks:
            await _cancelled(task)
        return stopped.result()


async def _opened(
    serving: RunningServer, pictures: SurveyWorker, held: contextlib.AsyncExitStack
) -> tuple[AppState, socket.socket]:
    """Open the survey and its lines; what may fail at once is tried first."""
    listener = held.enter_context(listener_at(serving.port, usual_port(serving.order.inputs[0])))
    tracing = held.enter_context(_worker(serving.order))
    root, crs = await pictures.ask(read_folder_and_crs)
    lines = serving.lines or Path(root) / LINES_NAME
    line_file = held.enter_context(LineFile.opened(lines, crs=crs))
    facts = await _watched(pictures, serving.watcher)
    app_state = AppState(
        order=serving.order,
        facts=facts,
        line_file=line_file,
        pictures=pictures,
        tracing=tracing,
        who=serving.who,
    )
    return app_state, listener


async def _watched(worker: SurveyWorker, watcher: Watcher) -> SurveyFacts:
    """Open the survey in a worker and show the progress."""
    async with worker.request(open_in_worker) as request:
        async for step, *amounts in request:
            getattr(watcher, step)(*amounts)
    facts: SurveyFacts = request.result
    return facts


def _progress(app_state: AppState, app: FastAPI) -> StartupProgress:
    """Return the progress of starting up, which is sent to all pages."""

    def report(text: str) -> None:
        app.state.busy = text
        app_state.broadcaster.send({"type": "busy", "busy": text})

    return StartupProgress(report)


def _server(
    serving: RunningServer, app_state: AppState, app: FastAPI, listener: socket.socket
) -> uvicorn.Server:
    port = listener.getsockname()[1]

    def url(token: str) -> str:
        return f"http://{HOST}:{port}/?token={token}"

    sessions = Sessions(port, lambda token: serving.renewed(url(token)))
    guard = Guard(app, sessions, port, page_files(), serving.save_log)
    return ReadyServer(
        uvicorn.Config(guard, **uvicorn_settings()), lambda: serving.ready(app_state, url(sessions.token))
    )


class ReadyServer(uvicorn.Server):
    """A server that reports when it is ready, and leaves signals to its caller."""

    def __init__(self, config: uvicorn.Config, ready: Callable[[], None]) -> None:
        super().__init__(config)
        self._ready = ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to listen, and report it."""
        await super().startup(sockets)
        self._ready()

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Install no signal handlers."""
        yield


async def _first(task: asyncio.Future[Any], stopped: asyncio.Future[int]) -> bool:
    """Wait for a task to end or for a signal; return whether a signal came."""
    await asyncio.wait({task, stopped}, return_when=asyncio.FIRST_COMPLETED)
    return stopped.done()


async def _cancelled(task: asyncio.Future[Any]) -> None:
    """Cancel a task and wait for it to end."""
    task.cancel()
    await asyncio.wait({task})


@contextlib.contextmanager
def _signals() -> Iterator[asyncio.Future[int]]:
    """Give a future that SIGINT or SIGTERM sets; the earlier handlers are restored at the end."""
    loop = asyncio.get_running_loop()
    stopped: asyncio.Future[int] = loop.create_future()

    def stop(number: int) -> None:
        if not stopped.done():
            stopped.set_result(number)

    def handle(number: int, _frame: FrameType | None) -> None:
        wait_until_saved()
        loop.call_soon_threadsafe(stop, number)

    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        # Not the loop's own handlers: they would take the notice of signals from `linework.processes.forced_end`
        signal.signal(number, handle)
        end_on_second(number)
    try:
        yield stopped
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
            end_on_second(number)


@contextlib.contextmanager
def _worker(order: SurveyOrder, process: Child | None = None) -> Iterator[SurveyWorker]:
    worker = SurveyWorker(order, process)
    try:
        yield worker
    finally:
        worker.kill()


# The address to listen on: of this machine alone, and always the same for a survey if it is free

#: The only address to listen on: the workbench is not for the network.
HOST = "127.0.0.1"
#: First port, and number, of those that are neither assigned to a service (49152 and up: RFC 6335, section 6) nor
#: handed out by Linux to outgoing connections (32768 to 60999), one of which may hold the port of a survey by chance.
_FIRST_PORT, _N_PORTS = 61_000, 4_536


def usual_port(survey: Path) -> int:
    """Return the port of a survey's workbench if none is requested.

    A page that was left open with unsaved edits finds the next server of its survey there.
    """
    return _FIRST_PORT + zlib.crc32(os.fsencode(survey.resolve())) % _N_PORTS


@contextlib.contextmanager
def listener_at(port: int, usual: int) -> Iterator[socket.socket]:
    """Give a socket that is bound to a port of this machine alone.

    Parameters
    ----------
    port
        Requested port; 0: `usual` if it is free, else any that is free.

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
                    problem, where=argument("port", number), advice="give another, or 0 for any"
                ) from None
            break
        yield listener


# Limits on open connections: a maximum number and an idle timeout

#: Open connections, so that files can still be opened; for a further one, the oldest without a session is closed. A
#: browser opens six and two WebSockets.
MOST_CONNECTIONS = 200
#: Time from the connection to the end of the first request's head. [s]
HEAD_S = 10.0


class BoundedConnection(H11Protocol):
    """A connection that is closed if no request comes in time, or one of a session needs its place."""

    _timer: asyncio.TimerHandle | None = None
    _is_of_session = False
    _opened_s = 0.0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the timer; if there are too many connections, close the oldest without a session, or else this one."""
        super().connection_made(transport)
        self._opened_s = self.loop.time()
        self._start_timer()
        if len(self.connections) > MOST_CONNECTIONS:
            # Who only knows the port could hold all places: whoever has a session is never turned out
            strangers = [
                other
                for other in self.connections
                if isinstance(other, BoundedConnection)
                and not other._is_of_session
                and not other.transport.is_closing()
            ]
            min(strangers, key=lambda other: other._opened_s, default=self).transport.abort()

    def handle_events(self) -> None:
        """Handle what came; after a request's head the guard limits the time."""
        super().handle_events()
        if not self._is_of_session and self.scope is not None:
            self._is_of_session = isinstance(self.config.app, Guard) and self.config.app.knows(
                Headers(raw=list(self.scope["headers"]))
            )
        is_awaited = self.conn.their_state is h11.IDLE and not self.transport.is_closing()
        if not is_awaited:
            self._stop_timer()
        elif self._timer is None:
            self._start_timer()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the timer."""
        self._stop_timer()
        super().connection_lost(exc)

    def _start_timer(self) -> None:
        self._timer = self.loop.call_later(HEAD_S, self.transport.close)

    def _stop_timer(self) -> None:
        timer, self._timer = self._timer, None
        if timer is not None:
            timer.cancel()


def uvicorn_settings() -> dict[str, Any]:
    """Return uvicorn's settings, as keywords of `uvicorn.Config`."""
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
