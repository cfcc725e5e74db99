"""The address that is listened at: of this machine alone, and the same one for a survey where it is free."""

from __future__ import annotations

import contextlib
import errno
import os
import socket
import zlib
from collections.abc import Iterator
from pathlib import Path

from linework.errors import MachineError

#: The only address that is listened at: nothing of this is for the network.
HOST = "127.0.0.1"
#: Ports that nobody is given for long (RFC 6335, section 6).
_FIRST, _N = 49152, 16384


def usual_port(survey: Path) -> int:
    """Return the port of a survey's workbench where none is asked for.

    A page that was left open, with edits that are not saved yet, finds the next server of its survey there.
    """
    return _FIRST + zlib.crc32(os.fsencode(survey.resolve())) % _N


@contextlib.contextmanager
def listener_at(port: int, usual: int) -> Iterator[socket.socket]:
    """Give a socket that is bound to a port of this machine alone.

    Parameters
    ----------
    port
        0: the usual one if it is free, else any that is.

    Raises
    ------
    MachineError
        The port is taken.
    """
    with contextlib.ExitStack() as held:
        for number in (port,) if port else (usual, 0):
            listener = held.enter_context(socket.socket(socket.AF_INET, socket.SOCK_STREAM))
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                listener.bind((HOST, number))
                listener.listen()
            except OSError as error:
                if number == usual and not port:
                    continue
                is_taken = error.errno == errno.EADDRINUSE
                problem = "the port is taken" if is_taken else str(error.strerror).lower()
                raise MachineError(
                    problem, where=f"--port {number}", advice="give another, or 0 for any"
                ) from None
            break
        yield listener
