"""Requests as no browser and no library would send them."""

from __future__ import annotations

import socket
from dataclasses import dataclass
from typing import Any

from tests.workbench.serve_process import LONGEST_WAIT_S, Served


@dataclass(frozen=True)
class Raw:
    """An answer as it came."""

    status: int
    headers: dict[str, str]
    body: str


def exchange(port: int, request: bytes, *, timeout_s: float = LONGEST_WAIT_S) -> Raw | None:
    """Send bytes and return what is answered, None where the connection is only closed."""
    with socket.create_connection(("127.0.0.1", port), timeout=timeout_s) as connection:
        try:
            connection.sendall(request)
            return answer_on(connection)
        except (ConnectionResetError, BrokenPipeError):
            return None


def answer_on(connection: socket.socket) -> Raw | None:
    """Read one answer, to its end if it says how long it is."""
    data = b""
    while b"\r\n\r\n" not in data:
        part = connection.recv(65536)
        if not part:
            return None
        data += part
    head, _, body = data.partition(b"\r\n\r\n")
    first, *lines = head.decode("latin-1").split("\r\n")
    headers = {name.lower(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
    n_bytes = int(headers.get("content-length", 0))
    while len(body) < n_bytes:
        part = connection.recv(65536)
        if not part:
            break
        body += part
    return Raw(int(first.split()[1]), headers, body.decode("utf-8", "replace"))


def request(method: str, path: str, *headers: str, body: bytes = b"", version: str = "1.1") -> bytes:
    """Return a request with exactly these header lines."""
    lines = [f"{method} {path} HTTP/{version}", *headers, *([f"Content-Length: {len(body)}"] if body else [])]
    return "\r\n".join([*lines, "", ""]).encode("latin-1") + body


def handshake(served: Served, path: str, *headers: str) -> Raw | None:
    """Ask for a WebSocket; the status is 101 where it is opened."""
    given = (
        "Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
    )  # fmt: skip
    return exchange(served.port, request("GET", path, *given, *headers))


#: What stands for a parameter of a path.
_PLAUSIBLE = {"integer": "0", "number": "0", "string": "x"}


def routes(served: Served) -> list[tuple[str, str]]:
    """Return (method, path) of every route that the server says it has, with something in place of parameters."""
    document = served.get("/api/openapi.json")
    return [
        (method.upper(), _filled(path, operation))
        for path, operations in document["paths"].items()
        for method, operation in operations.items()
    ]


def _filled(path: str, operation: dict[str, Any]) -> str:
    for parameter in operation.get("parameters", ()):
        if parameter["in"] == "path":
            kind = parameter["schema"].get("type", "string")
            path = path.replace(f"{{{parameter['name']}}}", _PLAUSIBLE.get(kind, "x"))
    return path


def path_parameters(served: Served) -> list[tuple[str, str, str]]:
    """Return (method, path with {}, name) of every parameter in a path; the others are filled."""
    found = []
    for path, operations in served.get("/api/openapi.json")["paths"].items():
        for method, operation in operations.items():
            names = [p["name"] for p in operation.get("parameters", ()) if p["in"] == "path"]
            for name in names:
                others = [p for p in operation["parameters"] if p["name"] != name]
                filled = _filled(path, {"parameters": others}).replace(f"{{{name}}}", "{}")
                found.append((method.upper(), filled, name))
    return found


SOCKETS = ("/api/live", "/api/follow")
