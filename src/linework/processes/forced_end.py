"""End a command that SIGTERM does not end, because a library's call does not return, and remove what it leaves.

Python runs its signal handlers between two of its own instructions: while a library computes in C, none of them runs,
and no thread of this process either if the library holds the interpreter's lock. A second process, which waits for the
signal, therefore ends this one. Run as a script, so it imports nothing of linework.

Separate from `system`, which is imported with all of `linework.processes.child`: this starts in 15 ms.
"""

from __future__ import annotations

import contextlib
import os
import select
import shutil
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

#: From SIGTERM until the command is ended by force: of the 2 s that are promised, the rest is for ending it. [s]
_UNTIL_FORCED_S = 1.5
#: The same for a command that ends by itself and saves what people did; only a hang takes so long. [s]
_UNTIL_SAVED_S = 60.0
#: How long the system may take to end it before SIGKILL follows. [s]
_UNTIL_KILLED_S = 0.2
_LOOK_S = 0.005
#: Messages up to this length reach a pipe whole (POSIX). [bytes]
_PIPE_BUF = 512 if not hasattr(select, "PIPE_BUF") else select.PIPE_BUF
#: What begins a message; a lone byte of another value is the number of a signal.
_ADD, _DROP, _SAVES, _END = b"+", b"-", b"=", b"\0"
#: After _ADD: a folder that is removed only if it is empty.
_IF_EMPTY = b"?"
#: The end of the pipe to the watching process, None: there is none.
_pipe: int | None = None


def watch_for_signals() -> None:
    """Start the process that ends this one if SIGTERM does not; it ends with this one. Once, from the main thread.

    Where processes cannot be started so (Windows), or not now, SIGTERM is left to Python.
    """
    global _pipe
    if _pipe is not None or not hasattr(os, "posix_spawn") or not sys.executable:
        return
    reading, writing = os.pipe()
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.posix_spawn(
            sys.executable, [sys.executable, "-I", "-S", __file__, str(os.getpid())], os.environ,
            file_actions=[(os.POSIX_SPAWN_DUP2, reading, 0), (os.POSIX_SPAWN_DUP2, null, 1)],
        )  # fmt: skip
    except OSError:  # the limit on processes, or on memory
        os.close(writing)
        return
    finally:
        os.close(reading)
        os.close(null)
    os.set_blocking(writing, False)
    _pipe = writing
    # The system's handler of Python writes the number of each signal there, whatever this process is doing
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)


@contextlib.contextmanager
def removed_if_forced(path: Path, *, only_empty: bool = False) -> Iterator[None]:
    """Have a file or folder removed if this process is ended by force during the context.

    Parameters
    ----------
    only_empty
        A folder is removed only if it is empty by then.
    """
    name = (_IF_EMPTY if only_empty else b"") + os.fsencode(path.absolute())
    _send(_ADD, name)
    try:
        yield
    finally:
        _send(_DROP, name)


def wait_until_saved() -> None:
    """Give this process time to end by itself: for the handler of SIGTERM of a command that saves what people did.

    That the handler runs shows that no library's call holds the interpreter; a second signal still ends the process.
    """
    _send(_SAVES, b"")


def _send(what: bytes, name: bytes) -> None:
    message = what + name + _END
    if _pipe is not None and len(message) <= _PIPE_BUF:
        with contextlib.suppress(OSError):  # the other process was killed: nothing is removed
            os.write(_pipe, message)


def _watch(watched: int) -> None:
    """Wait for a signal to the process `watched`, our parent, whose messages come from stdin; then see that it ends."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # they come to the whole group
    held: dict[bytes, None] = {}
    unread, until_forced_s, signalled_s = b"", _UNTIL_FORCED_S, None
    while True:
        left_s = None if signalled_s is None else max(signalled_s + until_forced_s - time.monotonic(), 0.0)
        if not select.select([0], [], [], left_s)[0]:
            break
        data = os.read(0, 1 << 16)
        if not data:
            return
        unread, numbers, saves = _heard(unread + data, held)
        if saves:
            until_forced_s = _UNTIL_SAVED_S
        if signal.SIGTERM in numbers and signalled_s is None:
            signalled_s = time.monotonic()
    _end(watched)
    for path in reversed(held):
        _remove(path)
    print("interrupted: nothing was written; run the same command again", file=sys.stderr, flush=True)


def _heard(data: bytes, held: dict[bytes, None]) -> tuple[bytes, set[int], bool]:
    """Note the messages about paths in `held`; return the rest that is not whole yet, the signals, and if it saves."""
    numbers, saves = set(), False
    while data:
        kind = data[:1]
        if kind not in (_ADD, _DROP, _SAVES):
            numbers.add(kind[0])
            data = data[1:]
            continue
        path, end, rest = data[1:].partition(_END)
        if not end:
            break
        if kind == _ADD:
            held[path] = None
        elif kind == _DROP:
            held.pop(path, None)
        else:
            saves = True
        data = rest
    return data, numbers, saves


def _end(watched: int) -> None:
    """End our parent: by SIGTERM, which it does not handle a second time, else by SIGKILL."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        until_s = time.monotonic() + _UNTIL_KILLED_S
        if os.getppid() == watched:
            os.kill(watched, number)
        while os.getppid() == watched and time.monotonic() < until_s:
            time.sleep(_LOOK_S)


def _remove(name: bytes) -> None:
    path = Path(os.fsdecode(name.removeprefix(_IF_EMPTY)))
    with contextlib.suppress(OSError):
        if name.startswith(_IF_EMPTY):
            path.rmdir()
        elif path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink()


if __name__ == "__main__":
    _watch(int(sys.argv[1]))
