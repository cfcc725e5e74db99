"""What the page says and hears over /api/follow."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from websockets.sync.client import ClientConnection, connect

from linework.model.lines import LineSet

#: What takes longer hangs. [s]
LONGEST_S = 120.0


class Talk:
    """One page's socket."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket

    def say(self, **order: Any) -> None:
        self.socket.send(json.dumps(order))

    def hear(self) -> dict[str, Any]:
        return json.loads(self.socket.recv(timeout=LONGEST_S))

    def hear_all(self) -> list[dict[str, Any]]:
        """Return what is told until a line is whole or refused."""
        told = [self.hear()]
        while told[-1]["type"] not in ("stopped", "refused"):
            told.append(self.hear())
        return told

    def follow(self, **order: Any) -> list[dict[str, Any]]:
        self.say(**order)
        return self.hear_all()


@contextmanager
def talk_with(served: Any) -> Iterator[Talk]:
    headers = {"Cookie": served.cookie_header, "Origin": served.url}
    url = f"{served.socket_url}/api/follow"
    with connect(url, additional_headers=headers, open_timeout=LONGEST_S, max_size=None) as socket:
        yield Talk(socket)


def longest(lines: LineSet, kind: str) -> np.ndarray:
    """Return the vertices (n, 3) of the longest line of a kind."""
    own = lines[kind]
    return own[int(np.argmax(own.length_m))].xyz
