"""A server of files by ranges on loopback, sound or with a fault: the first folder of an address names the fault."""

from __future__ import annotations

import contextlib
import http.server
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote

#: Faults that answer every request with a number alone.
NUMBERED = {"missing": 404, "forbidden": 403, "unknown": 401, "gone": 410, "broken": 500, "busy": 503}


@dataclass
class FileServer:
    """What a server has, and what it was asked.

    Parameters
    ----------
    other
        Port of the server that the fault "led" leads to.
    asked
        (path, first byte, byte after the last) of each request for a part.
    signed
        What each request said of who sends it, "" for nothing.
    n_sent
        Bytes of files sent. [bytes]
    stall_s
        How long the faults "slow" and "stuck" stay silent. [s]
    down_after
        Number of requests after which every one is answered with 503.
    """

    folder: Path
    port: int = 0
    other: int = 0
    asked: list[tuple[str, int, int]] = field(default_factory=list)
    signed: list[str] = field(default_factory=list)
    at_once: int = 0
    most_at_once: int = 0
    n_sent: int = 0
    stall_s: float = 3.0
    down_after: int | None = None
    lock: threading.Lock = field(default_factory=threading.Lock)

    def address(self, name: str, fault: str = "sound") -> str:
        return f"http://127.0.0.1:{self.port}/{fault}/{name}"


@contextlib.contextmanager
def file_server(folder: Path, tls: object = None) -> Iterator[FileServer]:
    """Serve a folder on a free port of loopback; `tls`: an `ssl.SSLContext`."""
    state = FileServer(folder)

    class Handler(_Handler):
        server_state = state

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    # What a client that breaks off leaves on stderr is no concern of a test
    server.handle_error = lambda request, client_address: None  # type: ignore[method-assign]
    if tls is not None:
        server.socket = tls.wrap_socket(server.socket, server_side=True)  # type: ignore[attr-defined]
    state.port = server.server_port
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
    thread.start()
    try:
        yield state
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


class _Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server_state: FileServer

    def log_message(self, format: str, *args: object) -> None:
        pass

    def do_GET(self) -> None:
        state = self.server_state
        _, fault, *rest = unquote(self.path).split("/")
        path = state.folder / "/".join(rest)
        asked = self.headers.get("Range", "")
        first, _, last = asked.removeprefix("bytes=").partition("-")
        with state.lock:
            n_before = len(state.asked)
            n_same = sum(there == self.path and end == int(last or -1) + 1 for there, _, end in state.asked)
            state.asked.append((self.path, int(first or 0), int(last or -1) + 1))
            state.signed.append(self.headers.get("Authorization", ""))
            state.at_once += 1
            state.most_at_once = max(state.most_at_once, state.at_once)
        try:
            is_down = state.down_after is not None and n_before >= state.down_after
            self._answer("busy" if is_down else fault, path, asked, n_before, n_same)
        finally:
            with state.lock:
                state.at_once -= 1

    def _answer(self, fault: str, path: Path, asked: str, n_before: int, n_same: int) -> None:
        if fault in NUMBERED:
            self._send(NUMBERED[fault])
        elif fault == "flaky" and n_same < 2:
            self._send(500)
        elif fault == "led":
            self._send(302, Location=f"http://localhost:{self.server_state.other}/sound/{path.name}")
        elif fault == "round":
            self._send(302, Location=self.path)
        elif fault == "page":
            self._part(b"<!DOCTYPE html><html><body>Please sign in</body></html>" * 10, asked, '"p"', fault)
        elif not path.is_file():
            self._send(404)
        elif fault == "whole":
            self._send(200, path.read_bytes())
        elif fault == "none":
            self._part(b"", asked, '"n"', fault)
        else:
            data, tag = path.read_bytes(), '"1"'
            if fault == "changing":
                tag = f'"{n_before}"'
            if fault == "growing":
                data += bytes(n_before)
            self._part(
                data,
                asked,
                {"weak": 'W/"1"', "untagged": "", "bare": ""}.get(fault, tag),
                fault,
                n_same,
            )

    def _part(self, data: bytes, asked: str, tag: str, fault: str, n_same: int = 0) -> None:
        first, last = (int(number) for number in asked.removeprefix("bytes=").split("-"))
        if first >= len(data):
            self._send(416)
            return
        if tag and self.headers.get("If-Match", tag) != tag:
            self._send(412)
            return
        last = min(last, len(data) - 1)
        part = data[first : last + 1]
        shown = first + 1 if fault == "shifted" else first
        self.send_response(206)
        self.send_header("Content-Length", str(len(part)))
        self.send_header("Content-Range", f"bytes {shown}-{shown + len(part) - 1}/{len(data)}")
        if tag:
            self.send_header("ETag", tag)
        self.end_headers()
        is_cut = fault == "cut" or (fault in ("torn", "bare") and n_same == 0)
        if is_cut or fault == "stuck" or (fault == "slow" and n_same == 0):
            self.wfile.write(part[: len(part) // 2])
            self.wfile.flush()
            if not is_cut:
                time.sleep(self.server_state.stall_s)
            self.close_connection = True
            return
        self.wfile.write(part)
        with self.server_state.lock:
            self.server_state.n_sent += len(part)

    def _send(self, number: int, body: bytes = b"", **headers: str) -> None:
        self.send_response(number)
        self.send_header("Content-Length", str(len(body)))
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)
