"""The guard before the server: who asks, from where, and what for, before any route hears of it."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any
from urllib.parse import parse_qs

from starlette.datastructures import Headers
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from linework.workbench.guard_bodies import (
    BodyError,
    check_body_headers,
    check_json,
    drained,
    replayed,
    whole_body,
)
from linework.workbench.guard_headers import with_headers
from linework.workbench.page_files import PageFile
from linework.workbench.problems import problem_document
from linework.workbench.sessions import Sessions

#: Pages that are open at once, twice: each has one socket for news and one for following lines.
MOST_SOCKETS = 32
_SAFE = ("GET", "HEAD", "OPTIONS")
_NO_SESSION = "no session: open the link that linework serve printed"
_USED = "This link has been used, or is of another run. Open the newest link that linework serve printed.\n"
#: Asked for a part of an answer a server does more work, not less: it is given whole.
_DROPPED = (b"range", b"if-range")


class Guard:
    """An ASGI application that lets through to another one what comes from the page and nothing else.

    Parameters
    ----------
    app
        Heard only of requests of an open session, from this very origin, with a body that was read whole.
    port
        Of this server on 127.0.0.1.
    page
        Files that anyone may have: the page without any data.
    save_log
        Called with faults of the application.

    Notes
    -----
    Sites of this machine's other ports are "same-site", so that SameSite alone does not keep them out: Origin and
    Sec-Fetch-Site are checked as well.
    """

    def __init__(
        self, app: ASGIApp, sessions: Sessions, port: int, page: Mapping[str, PageFile],
        save_log: Callable[[BaseException], Any],
    ) -> None:  # fmt: skip
        self._app, self._sessions, self._page, self._save_log = app, sessions, page, save_log
        self._hosts = (f"127.0.0.1:{port}", f"localhost:{port}")
        self._n_sockets = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or let it through."""
        if scope["type"] == "http":
            await self._request(scope, receive, with_headers(send))
        elif scope["type"] == "websocket":
            await self._socket(scope, receive, send)
        else:
            await self._app(scope, receive, send)

    async def _request(self, scope: Scope, receive: Receive, send: Send) -> None:
        headers = Headers(scope=scope)
        answer, body = self._without_session(scope, headers), None
        if answer is None:
            try:
                check_body_headers(headers)
                body = await whole_body(receive)
                if body:
                    check_json(body)
                receive = replayed(body, receive)
            except BodyError as error:
                answer = _refused(error.status, error.problem)
        if answer is not None:
            if body is None:
                await drained(headers, receive)
            await answer(scope, receive, send)
            return
        kept = [(name, value) for name, value in scope["headers"] if name not in _DROPPED]
        with self._faults():
            await self._app({**scope, "headers": kept}, receive, send)

    def _without_session(self, scope: Scope, headers: Headers) -> Response | None:
        """Return the answer to what needs no session, or is refused; None: it may go on."""
        method, path = scope["method"], scope["path"]
        if headers.getlist("host") not in [[host] for host in self._hosts]:
            return _refused(403, "this server answers only to its own name")
        if path == "/" and method == "GET" and b"token=" in scope["query_string"]:
            return self._entrance(scope, headers)
        if path in self._page and method in ("GET", "HEAD"):
            file = self._page[path]
            return Response(file.content, headers={"content-type": file.content_type})
        if not self._sessions.knows(headers.get("cookie", "")):
            return _refused(401, _NO_SESSION)
        if not self._is_from_page(headers, must_say=method not in _SAFE):
            return _refused(403, "only the workbench's own page may ask for this")
        return None

    def _entrance(self, scope: Scope, headers: Headers) -> Response:
        """Return a session's cookie for a token, and the way to the page, which is always the same."""
        token = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        home = Response(status_code=303, headers={"location": "/"})
        if self._sessions.knows(headers.get("cookie", "")):
            return home
        cookie = self._sessions.enter(token)
        if not cookie:
            return PlainTextResponse(_USED, 403)
        home.set_cookie(self._sessions.cookie_name, cookie, httponly=True, samesite="strict")
        return home

    def _is_from_page(self, headers: Headers, *, must_say: bool) -> bool:
        """Return whether a request comes from our own page, by what only the browser can have written."""
        origins = headers.getlist("origin")
        ours = [[f"http://{headers['host']}"]] + ([] if must_say else [[]])
        return origins in ours and headers.get("sec-fetch-site", "none") in ("same-origin", "none")

    async def _socket(self, scope: Scope, receive: Receive, send: Send) -> None:
        headers = Headers(scope=scope)
        may_enter = (
            headers.getlist("host") in [[host] for host in self._hosts]
            and self._sessions.knows(headers.get("cookie", ""))
            and self._is_from_page(headers, must_say=True)
            and self._n_sockets < MOST_SOCKETS
        )
        if not may_enter:
            # Closed before it is accepted: the browser sees a 403
            await receive()
            await send({"type": "websocket.close", "code": 1008})
            return
        self._n_sockets += 1
        try:
            with self._faults():
                await self._app(scope, receive, send)
        finally:
            self._n_sockets -= 1

    @contextlib.contextmanager
    def _faults(self) -> Iterator[None]:
        """Hand on what must never happen; the page was told that much, or its socket closes."""
        try:
            yield
        except Exception as error:
            self._save_log(error)


def _refused(status: int, problem: str) -> Response:
    """Return a refusal, after which nothing more is read: its body may have no end."""
    return JSONResponse(problem_document(problem, status), status, headers={"connection": "close"})
