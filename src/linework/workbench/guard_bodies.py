"""What is sent to the server: JSON, so much of it, in so much time."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
from collections.abc import Mapping
from typing import NoReturn

from starlette.types import Message, Receive

#: A line of ten thousand vertices is half of it.
MOST_BYTES = 1 << 20
#: From the head of a request to the end of its body, on the same machine. [s]
MOST_S = 10.0
#: Of a body that is refused so much is read, in so much time, before the answer: closed with something unread, the
#: connection would be reset, and the answer lost.
_DRAINED_BYTES, _DRAINED_S = 4 << 20, 1.0


class BodyError(Exception):
    """A body that is not taken: the status, and why."""

    def __init__(self, status: int, problem: str) -> None:
        super().__init__(problem)
        self.status, self.problem = status, problem


def check_body_headers(headers: Mapping[str, str]) -> None:
    """Refuse a body by what its headers say of it.

    Raises
    ------
    BodyError
        Too long, packed, or not JSON.
    """
    length = headers.get("content-length", "0")
    has_body = "transfer-encoding" in headers or length != "0"
    if not length.isascii() or not length.isdigit():
        raise BodyError(400, "the length of the body is not a number")
    if int(length[:20]) > MOST_BYTES:
        raise BodyError(413, f"the body is longer than {MOST_BYTES:,} bytes")
    if headers.get("content-encoding", "identity").lower() != "identity":
        raise BodyError(415, "packed bodies are not taken: send plain JSON")
    content_type = headers.get("content-type", "").partition(";")[0].strip().lower()
    if has_body and content_type != "application/json":
        raise BodyError(415, "only bodies of the type application/json are taken")


async def whole_body(receive: Receive) -> bytes:
    """Return the body of a request, read to its end.

    Raises
    ------
    BodyError
        It is too long, or comes too slowly, or its sender has gone.
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
                if n_bytes > MOST_BYTES:
                    raise BodyError(413, f"the body is longer than {MOST_BYTES:,} bytes")
                if not message.get("more_body", False):
                    return b"".join(parts)
    except TimeoutError:
        raise BodyError(408, f"the body took longer than {MOST_S:.0f} s") from None


async def drained(headers: Mapping[str, str], receive: Receive) -> None:
    """Read what is there of a body that was refused, if it may have an end."""
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
    """Refuse a body that is not JSON, or holds numbers that no coordinate and no count can be.

    Raises
    ------
    BodyError
        With what is wrong. JSON itself knows no NaN and no infinity, Python's reader does.
    """
    try:
        json.loads(body, parse_constant=_refuse_number, parse_float=_finite, parse_int=_small)
    except (ValueError, RecursionError) as error:
        problem = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise BodyError(400, f"the body is not JSON that can be used: {problem}"[:200]) from None


def _finite(text: str) -> float:
    value = float(text)
    return value if math.isfinite(value) else _refuse_number(text)


def _small(text: str) -> int:
    value = int(text)
    return value if abs(value) < 2**63 else _refuse_number(text)


def _refuse_number(text: str) -> NoReturn:
    raise ValueError(f"{text[:20]} is no number that can be used")


def replayed(body: bytes, receive: Receive) -> Receive:
    """Return a `receive` that gives a body that was read already, and then what comes."""
    waiting: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]

    async def receiving() -> Message:
        return waiting.pop() if waiting else await receive()

    return receiving
