"""Works for a desk whose behaviour is tested."""

import os
import time

from linework.errors import InputError


def add(_table, a, b):
    return a + b


def count(_table, n):
    """Tell 0 to n - 1; what is said meanwhile is returned."""
    heard = []
    for i in range(n):
        said = yield i
        if said is not None:
            heard.append(said)
        time.sleep(0.01)
    return heard


def refuse(_table):
    raise InputError("no such thing", where="a.laz", advice="look")


def fault(_table):
    raise KeyError("a fault of ours")


def die(_table):
    os._exit(3)


def pid(_table):
    return os.getpid()


def sleep(_table, seconds):
    time.sleep(seconds)


def tell_then_sleep(table, seconds):
    """Tell one thing and then nothing, without a ``yield`` at which it could be told to leave."""
    table.tell("begun")
    time.sleep(seconds)


def kept(table):
    """Count the calls that one process has seen."""
    calls = table.keep("calls", list)
    calls.append(None)
    return len(calls)


def compile_for(_table, seconds):
    """Compile a kernel for so long, without a word."""
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


def tell_then_compile(table, seconds):
    table.tell("begun")
    return compile_for(table, seconds)
