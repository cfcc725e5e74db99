"""The guard in front of the application: checks session, origin and body before any route runs."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import mimetypes
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, NoReturn
from urllib.parse import parse_qs

from starlette.datastructures import Headers
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from linework.workbench.server.problems import problem_document
from linework.workbench.server.sessions import Sessions

#: WebSockets that are open at once: 16 pages, each with one for changes and one for following lines.
MOST_SOCKETS = 32
#: Methods that change nothing (RFC 9110, section 9.2.1).
_SAFE = ("GET", "HEAD", "OPTIONS")
_NO_SESSION = "no session: open the link that linework printed"
_USED = "This link has been used, or belongs to another run. Open the newest link that linework printed.\n"
#: Headers that are dropped: a part of an answer costs more than the whole one, which is sent instead.
_DROPPED = (b"range", b"if-range")


class Guard:
    """An ASGI application that passes requests from the page on to another one, and refuses all others.

    Parameters
    ----------
    app
        Gets only requests of an open session, from this very origin, with a body that was read whole.
    port
        Of this server on 127.0.0.1.
    page
        Files that anyone may get: the page without any data.
    save_log
        Called with faults of the application.

    Notes
    -----
    Sites on other ports of this machine are "same-site", so that SameSite alone does not keep them out: Origin and
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
        """Answer a request, or pass it on."""
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
                body = await read_body(receive)
                if body:
                    check_json(body)
                receive = replay_body(body, receive)
            except BodyError as error:
                answer = _refused(error.status, error.problem)
        if answer is not None:
            if body is None:
                await drain_body(headers, receive)
            await answer(scope, receive, send)
            return
        kept = [(name, value) for name, value in scope["headers"] if name not in _DROPPED]
        with self._faults():
            await self._app({**scope, "headers": kept}, receive, send)

    def knows(self, headers: Headers) -> bool:
        """Return whether a request belongs to an open session."""
        return self._sessions.knows(headers.get("cookie", ""))

    def _without_session(self, scope: Scope, headers: Headers) -> Response | None:
        """Return the answer to a request that needs no session, or is refused; None: pass it on."""
        method, path = scope["method"], scope["path"]
        if headers.getlist("host") not in [[host] for host in self._hosts]:
            return _refused(403, "the Host header does not name this server")
        if path == "/" and method == "GET" and b"token=" in scope["query_string"]:
            return self._entrance(scope, headers)
        if path in self._page and method in ("GET", "HEAD"):
            file = self._page[path]
            return Response(file.content, headers={"content-type": file.content_type})
        if not self._sessions.knows(headers.get("cookie", "")):
            return _refused(401, _NO_SESSION)
        if not self._is_from_page(headers, must_say=method not in _SAFE):
            return _refused(403, "only the workbench's own page may send this request")
        return None

    def _entrance(self, scope: Scope, headers: Headers) -> Response:
        """Return a session's cookie for a token, and a redirect to the page, always to the same URL."""
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
        """Return whether a request comes from our own page, by headers that only the browser can set."""
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
        """Save the log of a fault; the page was answered by then, or its socket closes."""
        try:
            yield
        except Exception as error:
            self._save_log(error)


def _refused(status: int, problem: str) -> Response:
    """Return a refusal, after which the connection closes: the body may have no end."""
    return JSONResponse(problem_document(problem, status), status, headers={"connection": "close"})


# Request bodies: JSON of limited size, received in limited time

#: Longest body: twice a line of ten thousand vertices. [bytes]
MOST_BODY_BYTES = 1 << 20
#: Time from the head of a request to the end of its body, from a client on the same machine. [s]
MOST_S = 10.0
#: Part of a refused body that is read before the answer [bytes], and time for that [s]: a connection closed with data
#: unread would be reset, and the answer lost.
_DRAINED_BYTES, _DRAINED_S = 4 << 20, 1.0


class BodyError(Exception):
    """A refused body: the HTTP status, and why."""

    def __init__(self, status: int, problem: str) -> None:
        super().__init__(problem)
        self.status, self.problem = status, problem


def check_body_headers(headers: Mapping[str, str]) -> None:
    """Refuse a body by its headers.

    Raises
    ------
    BodyError
        Too long, compressed, or not JSON.
    """
    length = headers.get("content-length", "0")
    has_body = "transfer-encoding" in headers or length != "0"
    if not length.isascii() or not length.isdigit():
        raise BodyError(400, "the length of the body is not a number")
    if int(length[:20]) > MOST_BODY_BYTES:
        raise BodyError(413, f"the body is longer than {MOST_BODY_BYTES:,} bytes")
    if headers.get("content-encoding", "identity").lower() != "identity":
        raise BodyError(415, "compressed bodies are not accepted: send plain JSON")
    content_type = headers.get("content-type", "").partition(";")[0].strip().lower()
    if has_body and content_type != "application/json":
        raise BodyError(415, "only bodies of type application/json are accepted")


async def read_body(receive: Receive) -> bytes:
    """Return the body of a request, read to its end.

    Raises
    ------
    BodyError
        It is too long or too slow, or its sender has gone.
    """
    parts: list[bytes] = []
    n_bytes = 0
    try:
        async with asyncio.timeout(MOST_S):
            while True:
                message = await receive()
                if message["type"] == "http.disconnect":
                    raise BodyError(400, "the body was cut off")
                part = message.get("body", b"")
                parts.append(part)
                n_bytes += len(part)
                if n_bytes > MOST_BODY_BYTES:
                    raise BodyError(413, f"the body is longer than {MOST_BODY_BYTES:,} bytes")
                if not message.get("more_body", False):
                    return b"".join(parts)
    except TimeoutError:
        raise BodyError(408, f"the body took longer than {MOST_S:.0f} s") from None


async def drain_body(headers: Mapping[str, str], receive: Receive) -> None:
    """Read the first part of a refused body, unless it may be endless."""
    length = headers.get("content-length", "0")
    if "transfer-encoding" not in headers and (not length.isdigit() or int(length[:20]) > _DRAINED_BYTES):
        return
    n_bytes, is_more = 0, True
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(_DRAINED_S):
            while is_more and n_bytes < _DRAINED_BYTES:
                message = await receive()
                n_bytes += len(message.get("body", b""))
                is_more = message.get("more_body", False)


def check_json(body: bytes) -> None:
    """Refuse a body that is not JSON, or holds numbers that cannot be a coordinate or a count.

    Raises
    ------
    BodyError
        Says what is wrong. NaN and infinity are not JSON, but Python's reader accepts them.
    """
    try:
        json.loads(body, parse_constant=_refuse_number, parse_float=_finite, parse_int=_small)
    except (ValueError, RecursionError) as error:
        problem = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise BodyError(400, f"the body cannot be read as JSON: {problem}"[:200]) from None


def _finite(text: str) -> float:
    value = float(text)
    return value if math.isfinite(value) else _refuse_number(text)


def _small(text: str) -> int:
    value = int(text)
    return value if abs(value) < 2**63 else _refuse_number(text)


def _refuse_number(text: str) -> NoReturn:
    raise ValueError(f"{text[:20]} is not a usable number")


def replay_body(body: bytes, receive: Receive) -> Receive:
    """Return a `receive` that gives a body that was read already, and then further messages."""
    waiting: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]

    async def receiving() -> Message:
        return waiting.pop() if waiting else await receive()

    return receiving


# Security headers of every answer: nothing from other origins, not in a frame, not cached

#: Content policy of the page. A report is a page of its own, see `REPORT_POLICY`.
PAGE_POLICY = (
    "default-src 'self'; img-src 'self' data: blob:; object-src 'none'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
#: Content policy of a report: only pictures and styles inside it, and not the page's origin.
REPORT_POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'; sandbox"
)
_ALWAYS = {
    b"content-security-policy": PAGE_POLICY.encode(),
    b"x-content-type-options": b"nosniff",
    b"x-frame-options": b"DENY",
    b"referrer-policy": b"no-referrer",
    b"cross-origin-opener-policy": b"same-origin",
    b"cross-origin-resource-policy": b"same-origin",
    b"cache-control": b"no-store",
}
#: The header that a route may set itself.
_OWN = b"content-security-policy"


def with_headers(send: Send) -> Send:
    """Return a `send` that adds the security headers to an answer."""

    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            there = [(name.lower(), value) for name, value in message.get("headers", ())]
            has_own = any(name == _OWN for name, _ in there)
            kept = [(name, value) for name, value in there if name not in _ALWAYS or name == _OWN]
            added = [(name, value) for name, value in _ALWAYS.items() if name != _OWN or not has_own]
            message = {**message, "headers": [*kept, *added]}
        await send(message)

    return sending


# Files of the page, read once at the start: no other file is served

#: Folder of the built page.
PAGE = Path(__file__).parents[1] / "page"
#: Served if the package holds no page, as in a clone before the page is built.
_NO_PAGE = b"<!doctype html><title>linework</title><p>This copy of linework was made without its page.</p>"


@dataclass(frozen=True, slots=True)
class PageFile:
    """A file of the page."""

    content: bytes
    content_type: str


def page_files(folder: Path = PAGE) -> Mapping[str, PageFile]:
    """Return the files of the page by their URL path; "/" is index.html."""
    found = {
        f"/{path.relative_to(folder).as_posix()}": PageFile(path.read_bytes(), _type_of(path))
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.is_symlink() and not path.name.startswith(".")
    }
    found["/"] = found.get("/index.html", PageFile(_NO_PAGE, "text/html; charset=utf-8"))
    return MappingProxyType(found)


def _type_of(path: Path) -> str:
    """Return the content type; of scripts always the same, whatever this machine's table of types says."""
    if path.suffix in (".js", ".mjs"):
        return "text/javascript; charset=utf-8"
    kind = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
    return f"{kind}; charset=utf-8" if kind.startswith("text/") else kind
