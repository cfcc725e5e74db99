"""What is sent to the workbench: too much, too slow, packed, or not what it says (J14 to J16)."""

from __future__ import annotations

import asyncio
import contextlib
import gzip
import json
import socket
import threading
import time
from pathlib import Path

import pytest
import uvicorn
import websockets.sync.client
from tests.workbench.safety.raw_http import Raw, answer_on, exchange, request, routes
from tests.workbench.serve_process import LONGEST_WAIT_S, Served, wait_until
from websockets.exceptions import ConnectionClosed, InvalidStatus

from linework.workbench.server import guard as guard_bodies
from linework.workbench.server import serve as connections
from linework.workbench.server.guard import MOST_BODY_BYTES, MOST_SOCKETS, Guard
from linework.workbench.server.sessions import Sessions


def memory_mb(served: Served) -> float:
    status = Path(f"/proc/{served.process.pid}/status").read_text()
    return int(status.split("VmRSS:")[1].split()[0]) / 1024


def headers(served: Served, *more: str) -> tuple[str, ...]:
    return (
        f"Host: {served.host}", f"Cookie: {served.cookie_header}", f"Origin: {served.url}",
        "Content-Type: application/json", *more,
    )  # fmt: skip


def posts(served: Served) -> list[str]:
    return [path for method, path in routes(served) if method == "POST"]


def test_a_body_that_says_it_is_long_is_not_read(served):
    """J14: 10 GB are promised."""
    for path in posts(served):
        answer = exchange(served.port, request("POST", path, *headers(served, "Content-Length: 10000000000")))
        assert answer.status == 413
        assert json.loads(answer.body)["status"] == 413


def test_a_body_without_end(served):
    """J14: chunk after chunk; it is cut off at the limit, and no memory goes into it."""
    before = memory_mb(served)
    chunk = b"10000\r\n" + b" " * 0x10000 + b"\r\n"
    for path in ("/api/changes", "/api/nothing"):
        with socket.create_connection(("127.0.0.1", served.port), timeout=LONGEST_WAIT_S) as connection:
            connection.sendall(request("POST", path, *headers(served, "Transfer-Encoding: chunked")))
            n_sent = 0
            with contextlib.suppress(ConnectionError):
                while n_sent < 64 * MOST_BODY_BYTES:
                    connection.sendall(chunk)
                    n_sent += len(chunk)
            assert n_sent < 32 * MOST_BODY_BYTES, path
    assert memory_mb(served) - before < 50
    assert served.client.get("/api/health").status_code == 200


def test_a_chunked_body_is_answered_at_the_limit(served):
    with socket.create_connection(("127.0.0.1", served.port), timeout=LONGEST_WAIT_S) as connection:
        connection.sendall(request("POST", "/api/changes", *headers(served, "Transfer-Encoding: chunked")))
        size = MOST_BODY_BYTES + 1
        connection.sendall(f"{size:x}\r\n".encode() + b" " * size + b"\r\n")
        assert answer_on(connection).status == 413


def test_the_largest_body_is_taken(served):
    body = b'{"a": "' + b"x" * (MOST_BODY_BYTES - 9) + b'"}'
    assert len(body) == MOST_BODY_BYTES
    answer = served.client.post("/api/changes", content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code == 422
    more = served.client.post(
        "/api/changes", content=body + b" ", headers={"Content-Type": "application/json"}
    )
    assert more.status_code == 413


@pytest.mark.parametrize(
    "content_type",
    ["text/plain", "multipart/form-data; boundary=x", "application/x-www-form-urlencoded", "application/xml",
     "application/octet-stream", "application/json2", ""],
)  # fmt: skip
def test_only_json_is_taken(served, content_type):
    """J03, J14: what a page of another site can send without asking is refused unread; so is any upload (J16)."""
    part = b'--x\r\nContent-Disposition: form-data; name="a"\r\n\r\n1\r\n'
    for path in posts(served):
        answer = served.client.post(path, content=part * 10_000, headers={"Content-Type": content_type})
        assert answer.status_code == 415, path


def test_packed_bodies_are_refused(served):
    """J15."""
    packed = gzip.compress(b" " * 10**8)
    assert len(packed) < MOST_BODY_BYTES
    before = memory_mb(served)
    for encoding in ("gzip", "deflate", "br", "gzip, identity", "x"):
        answer = served.client.post(
            "/api/changes", content=packed,
            headers={"Content-Type": "application/json", "Content-Encoding": encoding},
        )  # fmt: skip
        assert answer.status_code == 415
    assert memory_mb(served) - before < 50


def test_ranges_are_ignored(served):
    """J14: a hundred thousand of them are too long a head; those that fit change nothing."""
    many = "bytes=" + ",".join(f"{i}-{i}" for i in range(100_000))
    assert exchange(served.port, request("GET", "/", *headers(served, f"Range: {many}"))).status == 400
    some = "bytes=" + ",".join(f"{i}-{i}" for i in range(5000))
    for path in ("/", "/api/survey", "/api/pairs/0/left"):
        whole = served.client.get(path)
        ranged = served.client.get(path, headers={"Range": some, "If-Range": "x"})
        assert (ranged.status_code, ranged.content) == (whole.status_code, whole.content)
        assert "content-range" not in ranged.headers


@pytest.mark.parametrize(
    "lines",
    [
        ("Content-Length: -1",),
        ("Content-Length: 1e9",),
        ("Content-Length: 2", "Content-Length: 3"),
        ("Content-Length: 2", "Transfer-Encoding: chunked, identity"),
        ("Transfer-Encoding: gzip",),
        ("Content-Length: " + "9" * 5000,),
        (" folded: x",),
        ("no colon",),
        ("X: " + "x" * 100_000,),
        ("X: y",) * 3000,
    ],
)
def test_broken_heads(served, lines):
    answer = exchange(served.port, request("POST", "/api/changes", *headers(served, *lines)) + b"{}")
    assert answer is None or answer.status in (400, 413, 422, 501), answer


NONSENSE = [
    b"", b"{", b"nul", b"NaN", b'{"a": Infinity}', b'{"revision": 1e999}', b'{"a": ' + b"9" * 5000 + b"}",
    b"[" * 100_000, b'{"a":' * 50_000, b"\xff\xfe", b'"\\ud800"', b"\x00", b'{"revision": 9223372036854775808}',
    b"[]", b"1", b'""', b"null", b"true", b'{"edit": null, "revision": null}',
    b'{"edit": {"action": "\\u0000"}, "revision": 0}', b'{"revision": 0, "edit": {"action": "delete", "ids": []}}',
    b'{"revision": 0, "edit": {"action": "draw", "kind": "cable", "xyz": [[1e308, -1e308], [0, 0]]}}',
    b'{"kind": "x", "places": [[1e300, 1e300]]}', b'{"features": ["x"], "method": "\\ud800"}',
]  # fmt: skip


@pytest.mark.parametrize("body", NONSENSE, ids=range(len(NONSENSE)))
def test_nonsense_is_told_in_one_line(served, body):
    """J16: whatever is sent, it is refused as a problem of one line, and the server lives."""
    for path in ("/api/changes", "/api/heights", "/api/jobs"):
        answer = served.client.post(path, content=body, headers={"Content-Type": "application/json"})
        assert 400 <= answer.status_code < 500, (path, answer.text)
        document = answer.json()
        assert document["status"] == answer.status_code
        assert document["problem"]
        assert "\n" not in document["problem"]
        assert len(document["problem"]) < 400
    assert served.client.get("/api/health").status_code == 200


def test_more_connections_than_a_browser_opens(served):
    with contextlib.ExitStack() as held:
        for _ in range(connections.MOST_CONNECTIONS + 50):
            held.enter_context(socket.create_connection(("127.0.0.1", served.port), timeout=LONGEST_WAIT_S))
        n_open = len(list(Path(f"/proc/{served.process.pid}/fd").iterdir()))
        assert n_open < connections.MOST_CONNECTIONS + 60
    wait_until(lambda: exchange(served.port, request("GET", "/", f"Host: {served.host}")) is not None)
    assert served.client.get("/api/health").status_code == 200


def connected(served: Served, path: str = "/api/live"):
    return websockets.sync.client.connect(
        f"{served.socket_url}{path}", origin=served.url, additional_headers={"Cookie": served.cookie_header},
        proxy=None, compression=None,
    )  # fmt: skip


def test_messages_of_sockets_are_bounded(served):
    for path in ("/api/live", "/api/follow"):
        with connected(served, path) as open_socket, pytest.raises(ConnectionClosed) as closed:
            for _ in range(4):
                open_socket.send("x" * 10**6)
                open_socket.recv(timeout=LONGEST_WAIT_S)
        assert closed.value.rcvd.code == 1009


def test_sockets_are_bounded(served):
    with contextlib.ExitStack() as held:
        with pytest.raises(InvalidStatus) as refused:
            for _ in range(MOST_SOCKETS + 1):
                held.enter_context(connected(served))
        assert refused.value.response.status_code == 403

    # Those that left make room
    def has_room() -> bool:
        with contextlib.suppress(InvalidStatus), connected(served):
            return True
        return False

    wait_until(has_room)


@contextlib.contextmanager
def impatient_server(monkeypatch, *, patience_s=1.0):
    """Give the port of a server that has little patience, and a session's headers."""
    monkeypatch.setattr(connections, "HEAD_S", patience_s)
    monkeypatch.setattr(guard_bodies, "MOST_S", patience_s)

    async def app(scope, receive, send):
        await receive()
        await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"0")]})
        await send({"type": "http.response.body"})

    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
        sessions = Sessions(port)
        cookie = f"{sessions.cookie_name}={sessions.enter(sessions.token)}"
        guard = Guard(app, sessions, port, {}, save_log=lambda error: None)
        server = uvicorn.Server(uvicorn.Config(guard, **connections.uvicorn_settings()))
        thread = threading.Thread(target=lambda: asyncio.run(server.serve([listener])))
        thread.start()
        try:
            wait_until(lambda: server.started)
            yield port, (f"Host: 127.0.0.1:{port}", f"Cookie: {cookie}", f"Origin: http://127.0.0.1:{port}")
        finally:
            server.should_exit = True
            thread.join()


def test_a_head_that_does_not_come(monkeypatch):
    """J14: byte by byte, or never; also after a request that was a good one."""
    with impatient_server(monkeypatch) as (port, own):
        good = request("GET", "/", *own)
        for first in (b"", b"GET / HT", good, good + b"G"):
            with socket.create_connection(("127.0.0.1", port), timeout=LONGEST_WAIT_S) as connection:
                connection.sendall(first)
                if first.startswith(good):
                    assert answer_on(connection).status == 200
                # Until the server closes it
                with contextlib.suppress(ConnectionError):
                    while connection.recv(1024):
                        pass
        # Who is slow does not stand in the way of others, nor does dripping buy time
        with socket.create_connection(("127.0.0.1", port), timeout=LONGEST_WAIT_S) as dripping:
            end = time.monotonic() + LONGEST_WAIT_S
            with pytest.raises(ConnectionError):
                while time.monotonic() < end:
                    dripping.sendall(b"G")
                    assert exchange(port, good).status == 200
                    time.sleep(0.05)


def test_strangers_who_hold_all_connections_lock_nobody_out(monkeypatch):
    """Hundreds that say nothing, or ask without a session, and come again as soon as they are closed."""
    with contextlib.ExitStack() as held:
        port, own = held.enter_context(impatient_server(monkeypatch, patience_s=300.0))
        kept = held.enter_context(socket.create_connection(("127.0.0.1", port), timeout=LONGEST_WAIT_S))
        kept.sendall(request("GET", "/", *own))
        assert answer_on(kept).status == 200
        said = (
            b"",
            b"GET / HT",
            request("GET", "/", own[0]),
            request("GET", "/", own[0]) + b"GET",
            b"\x16\x03\x01",
        )
        for i in range(3 * connections.MOST_CONNECTIONS):
            idle = held.enter_context(socket.create_connection(("127.0.0.1", port), timeout=LONGEST_WAIT_S))
            with contextlib.suppress(ConnectionError):
                idle.sendall(said[i % len(said)])
            if i % 50 == 49:
                # A page that is opened now, and one that has been open all the time
                assert exchange(port, request("GET", "/", *own)).status == 200
                kept.sendall(request("GET", "/", *own))
                assert answer_on(kept).status == 200


def test_sessions_share_the_connections_that_there_are(monkeypatch):
    """Nobody with a session is turned out for another: then the newest has to wait."""
    with contextlib.ExitStack() as held:
        port, own = held.enter_context(impatient_server(monkeypatch, patience_s=300.0))
        opened = []
        for _ in range(connections.MOST_CONNECTIONS):
            opened.append(
                held.enter_context(socket.create_connection(("127.0.0.1", port), timeout=LONGEST_WAIT_S))
            )
            opened[-1].sendall(request("GET", "/", *own))
            assert answer_on(opened[-1]).status == 200
        assert exchange(port, request("GET", "/", *own)) is None
        for connection in (opened[0], opened[-1]):
            connection.sendall(request("GET", "/", *own))
            assert answer_on(connection).status == 200


def test_a_body_that_does_not_come(monkeypatch):
    with impatient_server(monkeypatch) as (port, own):
        body = request("POST", "/", *own, "Content-Type: application/json", "Content-Length: 100") + b"{"
        answer = exchange(port, body)
        assert isinstance(answer, Raw)
        assert answer.status == 408


def test_a_kept_connection_answers_again(monkeypatch):
    """The patience is with heads that do not come: who asks again in time is answered."""
    with (
        impatient_server(monkeypatch, patience_s=2.0) as (port, own),
        socket.create_connection(("127.0.0.1", port), timeout=LONGEST_WAIT_S) as connection,
    ):
        for _ in range(5):
            connection.sendall(request("GET", "/", *own))
            assert answer_on(connection).status == 200
            # All in all longer than the patience, each time much shorter
            time.sleep(0.5)


def test_a_refusal_is_read_by_who_is_still_sending(served):
    """Not reset before it was answered: the page shows why."""
    body = b" " * (MOST_BODY_BYTES + 1000)
    own = (f"Host: {served.host}", f"Origin: {served.url}", "Content-Type: application/json")
    for _ in range(10):
        assert exchange(served.port, request("POST", "/api/changes", *own, body=body)).status == 401
        session = (*own, f"Cookie: {served.cookie_header}")
        assert exchange(served.port, request("POST", "/api/changes", *session, body=body)).status == 413
