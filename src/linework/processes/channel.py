"""Messages over a socket, each framed by its length, received with a time limit."""

from __future__ import annotations

import pickle
import selectors
import socket
import struct
import threading
import time
from collections.abc import Iterable
from typing import Any, Protocol, TypeVar

#: Before each message goes its length in bytes, unsigned, big-endian.
_LENGTH = struct.Struct("!Q")
#: Bytes asked of the socket at once: more than its buffer holds. [bytes]
_READ_BYTES = 1 << 20


#: Not select(2) where there is another: it takes no descriptor above 1023. Windows has nothing else.
_Selector: type[selectors.BaseSelector] = getattr(selectors, "PollSelector", selectors.SelectSelector)


class HasDescriptor(Protocol):
    """What has the descriptor of a socket."""

    def fileno(self) -> int:
        """Return the descriptor."""
        ...


HasDescriptorT = TypeVar("HasDescriptorT", bound=HasDescriptor)


def wait_readable(ends: Iterable[HasDescriptorT], timeout_s: float | None = None) -> list[HasDescriptorT]:
    """Return those connections that have data or are at their end, once one of them has or the time [s] is over."""
    with _Selector() as selector:
        for end in ends:
            selector.register(end, selectors.EVENT_READ, end)
        return [key.data for key, _ in selector.select(timeout_s)]


class Channel:
    """One end of a connection between a process and its child.

    Parameters
    ----------
    connected
        A connected stream socket; it is closed with the channel.
    longest_bytes
        Longer messages are refused: a sender whose memory is damaged may announce any length. None: no limit.

    Notes
    -----
    Several threads may send. Only one may receive.
    """

    def __init__(self, connected: socket.socket, longest_bytes: int | None = None) -> None:
        self._socket, self._longest_bytes = connected, longest_bytes
        self._unread = bytearray()
        self._sending = threading.Lock()

    def fileno(self) -> int:
        """Return the file descriptor, -1 once it is closed."""
        return self._socket.fileno()

    def send(self, message: bytes) -> None:
        """Send a message.

        Raises
        ------
        OSError
            The other end, or this one, is closed.
        """
        with self._sending:
            self._socket.sendall(_LENGTH.pack(len(message)))
            self._socket.sendall(message)

    def send_object(self, value: Any) -> None:
        """Send an object, pickled (see `send`); only between processes that trust each other."""
        self.send(pickle.dumps(value, pickle.HIGHEST_PROTOCOL))

    def receive(self, timeout_s: float | None = None) -> bytes:
        """Return the next message.

        Parameters
        ----------
        timeout_s
            For the whole message; None: no limit. [s]

        Raises
        ------
        TimeoutError
            It has not come within `timeout_s`.
        EOFError
            The other end closed.
        ValueError
            It is longer than the channel takes.
        """
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        while True:
            remaining_s = None if deadline is None else max(deadline - time.monotonic(), 0.0)
            if (message := self._next()) is not None:
                return message
            if not self._is_readable(remaining_s):
                raise TimeoutError(f"no message within {timeout_s} s")
            self._fill()

    def receive_object(self, timeout_s: float | None = None) -> Any:
        """Return the next message unpickled (see `receive`); only between processes that trust each other."""
        return pickle.loads(self.receive(timeout_s))

    def read(self) -> bytes | None:
        """Return the next message if it is whole after one read of the socket, which has to be readable.

        Raises
        ------
        EOFError
            The other end closed.
        ValueError
            It is longer than the channel takes.
        """
        message = self._next()
        if message is None:
            self._fill()
            message = self._next()
        return message

    def has_data(self) -> bool:
        """Return whether `receive` would find at least a part of a message."""
        return bool(self._unread) or self._is_readable(0.0)

    def close(self) -> None:
        """Close this end; not while another thread sends, whose descriptor could be another file's by then."""
        with self._sending:
            self._socket.close()

    def _is_readable(self, timeout_s: float | None) -> bool:
        return bool(wait_readable([self], timeout_s))

    def _fill(self) -> None:
        try:
            data = self._socket.recv(_READ_BYTES)
        except ConnectionResetError:
            data = b""
        if not data:
            raise EOFError
        self._unread += data

    def _next(self) -> bytes | None:
        """Take the next whole message from what was read, None if there is none yet."""
        if len(self._unread) < _LENGTH.size:
            return None
        (n_bytes,) = _LENGTH.unpack_from(self._unread)
        if self._longest_bytes is not None and n_bytes > self._longest_bytes:
            raise ValueError(f"a message of {n_bytes} bytes")
        end = _LENGTH.size + n_bytes
        if len(self._unread) < end:
            return None
        message = bytes(memoryview(self._unread)[_LENGTH.size : end])
        del self._unread[:end]
        return message
