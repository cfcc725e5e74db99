"""A worker process: does the tasks that come over its socket until the socket closes or its parent dies."""

from __future__ import annotations

import ctypes
import importlib
import os
import resource
import signal
import sys
from multiprocessing.connection import Connection

_PR_SET_PDEATHSIG = 1


def tile_worker_main(arguments: list[str]) -> None:
    """Do tasks. `arguments`: socket, parent's process number, modules to import before the first task comes."""
    socket, parent, *modules = arguments
    die_with_parent(int(parent))
    # The parent is asked to stop, and stops us
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for module in modules:
        importlib.import_module(module)
    from linework.processes.executors import outcome_of

    with Connection(int(socket)) as connection:
        while True:
            try:
                work, task = connection.recv()
            except EOFError:
                return
            try:
                outcome = outcome_of(work, task)
            except OSError as refusal:  # the machine's: it ends the run, there
                connection.send(refusal)
            else:
                connection.send((outcome.receipt, outcome.problem, outcome.trace))


def die_with_parent(parent: int) -> None:
    """Have the system kill this process when the one that started it ends, however it ends (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        sys.exit(1)


if __name__ == "__main__":
    tile_worker_main(sys.argv[1:])
