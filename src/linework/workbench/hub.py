"""What happens at the workbench, told to every page that listens."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

#: A page that does not read falls behind so far; then it is told to ask for everything anew.
MOST_WAITING = 1000


class Hub:
    """Tells messages (plain values that become JSON) to all listeners."""

    def __init__(self) -> None:
        self._queues: set[asyncio.Queue[dict[str, Any]]] = set()

    def tell(self, message: dict[str, Any]) -> None:
        """Tell all listeners; called on the server's loop."""
        for queue in self._queues:
            if queue.qsize() < MOST_WAITING:
                queue.put_nowait(message)
            elif queue.qsize() == MOST_WAITING:
                queue.put_nowait({"type": "behind"})

    @contextmanager
    def listening(self) -> Iterator[asyncio.Queue[dict[str, Any]]]:
        """Give a queue of what is told from now on."""
        queue: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self._queues.add(queue)
        try:
            yield queue
        finally:
            self._queues.discard(queue)
