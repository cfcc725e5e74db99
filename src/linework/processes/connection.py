"""The connection of a process with its child: an inherited socket, or one on loopback that both prove a secret for.

The only file that knows whether a child of this system inherits sockets of Unix, by their descriptor. Where it does
not, as on Windows, the child connects to a port of this machine's loopback address; the secret is written to its standard input,
where no other user sees it, and serves for this one connection.
"""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from typing import Any, Protocol

#: The address of this machine alone.
_LOOPBACK = "127.0.0.1"
#: Length of the secret, and of the proof of it (SHA-256). [bytes]
_SECRET_BYTES = 32
#: A child connects within a second; a machine that is short of memory takes longer. [s]
_CONNECT_S = 60.0
#: Between two looks whether the child still runs; and what another program that connects has for its proof. [s]
_LOOK_S, _PROOF_S = 0.1, 2.0


class Offer(Protocol):
    """A connection that is offered to a child before it is started."""

    #: What the child is told, for `connect_to_parent`.
    address: str
    #: Arguments of `subprocess.Popen` without which the child cannot take it.
    popen: dict[str, Any]

    def accept(self, process: Any) -> socket.socket:
        """Return the connected socket; one that is at its end where the child ended before it connected."""
        ...

    def close(self) -> None:
        """Close what is left of the offer."""
        ...


def offer_connection() -> Offer:
    """Return a connection for a child that is to be started."""
    # Python for Windows may have AF_UNIX, but its children inherit no descriptors (`pass_fds`)
    return _Inherited() if inherits_connections() else _Loopback()


def inherits_connections() -> bool:
    """Return whether children of this system inherit connections."""
    return os.name == "posix" and hasattr(socket, "AF_UNIX")


def arguments_for(offer: Offer, hands_on: Sequence[Offer] = ()) -> dict[str, Any]:
    """Return arguments of `subprocess.Popen` for the child that an offer is for.

    Parameters
    ----------
    hands_on
        Offers that it hands on to children of its own, where these inherit them.
    """
    inherited = [descriptor for each in (offer, *hands_on) for descriptor in each.popen.get("pass_fds", ())]
    return offer.popen | ({"pass_fds": inherited} if inherited else {})


def connect_to_parent(address: str) -> socket.socket:
    """Return the socket that connects this process with the one that started it.

    Raises
    ------
    ConnectionError
        Nobody listens there, or not the parent.
    """
    if not address.startswith(_LOOPBACK):
        # Children of this process must not hold the socket open
        os.set_inheritable(int(address), False)
        return socket.socket(fileno=int(address))
    secret = sys.stdin.buffer.read(_SECRET_BYTES)
    connected = socket.create_connection((_LOOPBACK, int(address.rpartition(":")[2])), timeout=_CONNECT_S)
    connected.sendall(_proof(secret, b"child"))
    if not _has_proof(connected, secret, b"parent"):
        raise ConnectionError("another program answered")
    return _ready(connected)


class _Inherited:
    """A pair of sockets of Unix, of which the child inherits one."""

    def __init__(self) -> None:
        self._ours, self._theirs = socket.socketpair()
        self.address = str(self._theirs.fileno())
        self.popen: dict[str, Any] = {"pass_fds": [self._theirs.fileno()], "stdin": subprocess.DEVNULL}
        self._is_taken = False

    def accept(self, process: Any) -> socket.socket:
        """Return this end."""
        del process
        self._is_taken = True
        return self._ours

    def close(self) -> None:
        """Close the child's end, which it has inherited, and this one if no child was started."""
        self._theirs.close()
        if not self._is_taken:
            self._ours.close()


class _Loopback:
    """A port of the loopback address that takes one connection, of who knows the secret."""

    def __init__(self) -> None:
        import secrets

        self._listener = socket.create_server((_LOOPBACK, 0), backlog=1)
        self._listener.settimeout(_LOOK_S)
        self._secret = secrets.token_bytes(_SECRET_BYTES)
        self.address = f"{_LOOPBACK}:{self._listener.getsockname()[1]}"
        self.popen: dict[str, Any] = {"stdin": subprocess.PIPE}

    def accept(self, process: subprocess.Popen[bytes]) -> socket.socket:
        """Tell the child the secret and wait until it connects."""
        if process.stdin is not None:
            with contextlib.suppress(OSError), process.stdin:
                process.stdin.write(self._secret)
        deadline = time.monotonic() + _CONNECT_S
        while process.poll() is None and time.monotonic() < deadline:
            try:
                connected, _ = self._listener.accept()
            except TimeoutError:
                continue
            connected.settimeout(_PROOF_S)
            if _has_proof(connected, self._secret, b"child"):
                connected.sendall(_proof(self._secret, b"parent"))
                return _ready(connected)
            connected.close()
        process.kill()
        # Connected to nobody: whoever reads from it finds its end
        unanswered, nobody = socket.socketpair()
        nobody.close()
        return unanswered

    def close(self) -> None:
        """Close the port."""
        self._listener.close()


def _proof(secret: bytes, side: bytes) -> bytes:
    """Return what shows that a side knows the secret, without showing the secret."""
    import hmac

    return hmac.digest(secret, side, "sha256")


def _has_proof(connected: socket.socket, secret: bytes, side: bytes) -> bool:
    """Return whether the other end sends the proof of its side."""
    import hmac

    got = b""
    with contextlib.suppress(OSError):
        while len(got) < _SECRET_BYTES and (data := connected.recv(_SECRET_BYTES - len(got))):
            got += data
    return hmac.compare_digest(got, _proof(secret, side))


def _ready(connected: socket.socket) -> socket.socket:
    """Return a socket that waits without a limit, and sends short messages at once."""
    connected.settimeout(None)
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return connected
