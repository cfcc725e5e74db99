"""Requests for a worker whose behaviour is tested."""

import os
import time
from pathlib import Path

from linework.errors import InputError


def add(_session, a, b):
    return a + b


def count(_session, n):
    """Report 0 to n - 1; return what is received meanwhile."""
    received = []
    for i in range(n):
        value = yield i
        if value is not None:
            received.append(value)
        time.sleep(0.01)
    return received


def refuse(_session):
    raise InputError("no such thing", where="a.laz", advice="look")


def fault(_session):
    raise KeyError("a fault of ours")


def die(_session):
    os._exit(3)


def pid(_session):
    return os.getpid()


def sleep(_session, seconds):
    time.sleep(seconds)


def report_then_sleep(session, seconds):
    """Report one value and then nothing, without a ``yield`` at which it could be cancelled."""
    session.report("begun")
    time.sleep(seconds)


def free_memory(session):
    """Free 200 MB below memory that stays in use; return what the process holds then. [bytes]"""
    blocks = [bytearray(b"x" * 100_000) for _ in range(2000)]
    above = blocks.pop()
    session.keep("above", lambda: above)
    del blocks
    return resident_bytes(os.getpid())


def resident_bytes(pid):
    """Return the memory that a process holds."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def kept(session):
    """Return the number of calls in one process."""
    calls = session.keep("calls", list)
    calls.append(None)
    return len(calls)


def compile_for(_session, seconds):
    """Compile a kernel for so long, reporting nothing."""
    import numba
    from numba.core import event

    end = time.monotonic() + seconds

    class Slow(event.Listener):
        def on_start(self, _event):
            time.sleep(max(0.0, end - time.monotonic()))

        def on_end(self, _event):
            pass

    with event.install_listener("numba:compile", Slow()):
        return numba.njit(lambda x: x + 1)(1)


def report_then_compile(session, seconds):
    session.report("begun")
    return compile_for(session, seconds)
