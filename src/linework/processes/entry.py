"""Entry point of every child process: limits what it may take, then runs one function of a module.

Run by `linework.processes.child.Child` as ``python -P -m linework.processes.entry``. Separate from `child`, because it runs
in the child and must import next to nothing before the limits hold.
"""

from __future__ import annotations

import ctypes
import importlib
import os
import resource
import signal
import socket
import sys

from linework.processes.channel import Channel

#: Option of prctl(2): the signal that this process gets when its parent ends.
_PR_SET_PDEATHSIG = 1


def child_main(arguments: list[str]) -> None:
    """Run a function in this process.

    Parameters
    ----------
    arguments
        File descriptor of its socket; process number of its parent; limit on its address space, 0: none [bytes];
        ``module:function``, called with a `Channel` and with what follows, a list of str.
    """
    descriptor, parent, address_bytes, target, *rest = arguments
    limit_process(int(parent), int(address_bytes))
    # Children of this process must not hold the socket open
    os.set_inheritable(int(descriptor), False)
    channel = Channel(socket.socket(fileno=int(descriptor)))
    module, _, function = target.partition(":")
    getattr(importlib.import_module(module), function)(channel, rest)


def limit_process(parent: int, address_bytes: int) -> None:
    """Let this process end with its parent, ignore SIGINT, dump no core, and take no more than its address space."""
    die_with_parent(parent)
    # Ctrl-C goes to the whole group: the parent handles it, and ends this process
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if address_bytes:
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        limit = address_bytes if hard == resource.RLIM_INFINITY else min(address_bytes, hard)
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def die_with_parent(parent: int) -> None:
    """Have the system kill this process when the one that started it ends, however it ends (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it ended before the call
        sys.exit(1)


if __name__ == "__main__":
    child_main(sys.argv[1:])
