"""The page of the operator: served to this machine alone, from a thread beside the drive."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import uvicorn
from fastapi import APIRouter, FastAPI, Request
from pydantic import BaseModel, ConfigDict, Field

from linework.files.live.events import Press
from linework.live.drive import LiveDrive
from linework.live.keys import Operator
from linework.workbench.server.answers import answer_errors
from linework.workbench.server.guard import Guard, page_files
from linework.workbench.server.problems import PROBLEMS, hide_paths
from linework.workbench.server.serve import HOST, ReadyServer, listener_at, usual_port, uvicorn_settings
from linework.workbench.server.sessions import Sessions

#: Folder of the page's files.
LIVE_PAGE = Path(__file__).parent / "page"
#: Longest time that the page may have kept a press: it sends one again while the server restarts. [s]
_LONGEST_AGO_S = 600.0
#: How long the server may take to end. [s]
_END_S = 5.0

live_router = APIRouter(prefix="/api/live")


class PressOrder(BaseModel):
    """A press as the page sends it."""

    model_config = ConfigDict(extra="forbid")
    key: str = Field(max_length=100)
    press: str = Field(min_length=8, max_length=64, pattern=r"^[A-Za-z0-9-]+$")
    ago_s: float = Field(default=0.0, ge=0.0, le=_LONGEST_AGO_S, allow_inf_nan=False)


class UndoOrder(BaseModel):
    """The press that is undone."""

    model_config = ConfigDict(extra="forbid")
    press: str = Field(min_length=8, max_length=64, pattern=r"^[A-Za-z0-9-]+$")


@live_router.get("")
def live_state(request: Request) -> dict[str, Any]:
    """Return the state of the drive, the keys, and the newest presses."""
    drive: LiveDrive = request.app.state.drive
    operator = drive.operator
    status = drive.status(drive.now_s)
    newest, open_ = operator.newest()
    places = drive.places
    return {
        "survey": drive.survey.name,
        "keys": [{"name": key.name, "span": key.is_span, "open": key.name in open_} for key in operator.keys],
        "presses": [_press_document(press, places.get(press.press)) for press in newest],
        "pairs": status.counts,
        "waiting": status.waiting,
        "pairs_per_s": round(status.pairs_per_s, 1),
        "lag_s": round(status.lag_s, 2),
        "time_s": status.newest_s,
        "position": status.position,
        "sigma_m": None if status.sigma_m is None else round(status.sigma_m, 3),
        "driven_m": round(status.chainage_m, 1),
        "saved_pairs": status.saved_pairs,
        "saved_s_ago": round(status.saved_s_ago, 2),
        "notices": [{"text": hide_paths(text), "lasts": lasts} for text, lasts in status.notices],
    }


@live_router.post("/presses", responses=PROBLEMS)
def live_press(order: PressOrder, request: Request) -> dict[str, Any]:
    """Note a press; it is on the disk when this answers."""
    operator: Operator = request.app.state.drive.operator
    return _press_document(operator.press(order.key, order.press, order.ago_s), None)


@live_router.post("/undo", responses=PROBLEMS)
def live_undo(order: UndoOrder, request: Request) -> dict[str, Any]:
    """Undo a press; that is on the disk when this answers."""
    operator: Operator = request.app.state.drive.operator
    return _press_document(operator.undo(order.press), None)


def _press_document(press: Press, place: tuple[float, ...] | None) -> dict[str, Any]:
    return {
        "press": press.press, "key": press.key, "span": press.span, "time_s": press.time_s, "place": place,
    }  # fmt: skip


def live_app(drive: LiveDrive) -> FastAPI:
    """Return the application that the page talks to; `Guard` decides who may use it."""
    app = FastAPI(
        title="linework live", docs_url=None, redoc_url=None, openapi_url=None, redirect_slashes=False
    )
    app.state.drive = drive
    app.include_router(live_router)
    answer_errors(app)
    return app


class LiveServer:
    """The server of the page; runs while it is entered as a context.

    Parameters
    ----------
    port
        0: the survey's usual port, or any that is free.
    ready, renewed
        Called with the link that opens the page, and with the next one when it has been used.
    save_log
        Called with faults.

    Raises
    ------
    MachineError
        The port is taken.
    """

    def __init__(
        self,
        drive: LiveDrive,
        port: int,
        *,
        ready: Callable[[str], None],
        renewed: Callable[[str], None],
        save_log: Callable[[BaseException], Any],
    ) -> None:
        self._listening = listener_at(port, usual_port(drive.survey.root))
        self._drive, self._ready, self._renewed, self._save_log = drive, ready, renewed, save_log
        self._server: uvicorn.Server | None = None
        self._thread: threading.Thread | None = None
        self._started = threading.Event()

    def __enter__(self) -> Self:
        listener = self._listening.__enter__()
        number = listener.getsockname()[1]

        def url(token: str) -> str:
            return f"http://{HOST}:{number}/?token={token}"

        sessions = Sessions(number, lambda token: self._renewed(url(token)))
        guard = Guard(live_app(self._drive), sessions, number, page_files(LIVE_PAGE), self._save_log)
        server = ReadyServer(uvicorn.Config(guard, **uvicorn_settings()), self._started.set)
        self._server = server
        self._thread = threading.Thread(
            target=lambda: asyncio.run(server.serve([listener])), name="page", daemon=True
        )
        self._thread.start()
        self._started.wait()
        self._ready(url(sessions.token))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._server is not None and self._thread is not None
        self._server.should_exit = True
        self._thread.join(_END_S)
        self._listening.__exit__(kind, error, trace)
