"""Connections to the server: so many, and none that holds a place without asking for anything."""

from __future__ import annotations

import asyncio
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

#: A browser opens six and two sockets; what is beyond is closed at once, so that files can still be opened.
MOST_CONNECTIONS = 200
#: From the connection to the end of the first request's head. [s]
HEAD_S = 10.0


class BoundedConnection(H11Protocol):
    """A connection that is closed if its request does not come."""

    _patience: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin, or end at once where there are too many."""
        super().connection_made(transport)
        if len(self.connections) > MOST_CONNECTIONS:
            transport.abort()
        else:
            self._wait()

    def handle_events(self) -> None:
        """Take what came; from a request's head on, the guard watches the time."""
        super().handle_events()
        is_awaited = self.conn.their_state is h11.IDLE and not self.transport.is_closing()
        if not is_awaited:
            self._forget()
        elif self._patience is None:
            self._wait()

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        self._forget()
        super().connection_lost(exc)

    def _wait(self) -> None:
        self._patience = self.loop.call_later(HEAD_S, self.transport.close)

    def _forget(self) -> None:
        patience, self._patience = self._patience, None
        if patience is not None:
            patience.cancel()


def settings() -> dict[str, Any]:
    """Return what uvicorn is told of connections."""
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
