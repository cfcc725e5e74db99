"""What operating systems do differently for processes: limits, ending with the parent, whether one runs.

The only file that uses the module `resource`, prctl(2) and malloc_trim(3). Where a system has none of them, nothing
limits the memory of a child, a thread of the child watches for the end of its parent, and what is freed may stay with the
process.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import socket
import sys
import threading
import time
from pathlib import Path

from linework.processes.connection import inherits_connections

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

#: Option of prctl(2): the signal that this process gets when its parent ends.
_PR_SET_PDEATHSIG = 1
#: Exit code of a process that was ended by force.
KILLED_CODE = -9
#: Linux alone kills a process with its parent.
_ENDS_WITH_PARENT = sys.platform == "linux"
#: Between two looks whether the parent is still there: a child that computes ends that much later. [s]
_LOOK_S = 1.0
#: Windows: the right to ask a process whether it runs, and the exit code of one that does.
_QUERY_LIMITED_INFORMATION, _STILL_ACTIVE = 0x1000, 259


def limit_process(address_bytes: int) -> None:
    """Let this process ignore SIGINT, dump no core, and take no more than its address space, where that can be limited.

    Parameters
    ----------
    address_bytes
        Limit on the address space, 0: none. [bytes]
    """
    # Ctrl-C goes to the whole group: the parent handles it, and ends this process
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if resource is None:
        return
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if address_bytes:
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        limit = address_bytes if hard == resource.RLIM_INFINITY else min(address_bytes, hard)
        # macOS refuses limits below what the process has mapped already
        with contextlib.suppress(ValueError) if sys.platform == "darwin" else contextlib.nullcontext():
            resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def end_on_second(number: int) -> None:
    """Have the system end this process by the second signal of a number, whatever it is doing (Linux with glibc only).

    Call it after `signal.signal`, which undoes it. Elsewhere the second signal is handled as the first.

    Parameters
    ----------
    number
        Signal that has a handler.
    """
    libc = ctypes.CDLL(None) if _ENDS_WITH_PARENT else None
    if not hasattr(libc, "sysv_signal"):
        return
    assert libc is not None
    for function in (libc.signal, libc.sysv_signal):
        function.argtypes, function.restype = (ctypes.c_int, ctypes.c_void_p), ctypes.c_void_p
    # That of Python, which is in C. System V's signal(2) lets a handler serve once
    libc.sysv_signal(number, libc.signal(number, None))


def release_free_memory() -> None:
    """Give memory that was freed back to the system (Linux with glibc only): it keeps what lies below memory in use."""
    libc = ctypes.CDLL(None) if _ENDS_WITH_PARENT else None
    if hasattr(libc, "malloc_trim"):
        assert libc is not None
        libc.malloc_trim(0)


def give_way(niceness: int) -> None:
    """Let processes that people wait for come first, where the system has nice(2): increase the niceness of this one."""
    if hasattr(os, "nice"):
        os.nice(niceness)


def die_with_parent(parent: int) -> None:
    """Have the system kill this process when the one that started it ends, however it ends (Linux only).

    Parameters
    ----------
    parent
        Number of the process that started this one.
    """
    if _ENDS_WITH_PARENT:
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it ended before the call
            sys.exit(1)


def watch_parent(connected: socket.socket) -> None:
    """Start a thread that ends this process once its parent has closed their connection, where the system does not.

    Parameters
    ----------
    connected
        The connection with the parent. What was sent before the parent ended has to be read before its end shows.
    """
    if _ENDS_WITH_PARENT:
        return
    threading.Thread(target=_end_when_closed, args=(connected,), name="parent", daemon=True).start()


def _end_when_closed(connected: socket.socket) -> None:
    """End this process when nothing more can come over a connection."""
    while True:
        try:
            is_open = bool(connected.recv(1, socket.MSG_PEEK))
        except OSError:
            is_open = False
        if not is_open:
            os._exit(1)
        time.sleep(_LOOK_S)


def can_fork() -> bool:
    """Return whether processes can be forked here that end with their parent, and whose end it hears of (Linux from 5.3)."""
    if not (
        _ENDS_WITH_PARENT and inherits_connections() and hasattr(os, "fork") and hasattr(os, "pidfd_open")
    ):
        return False
    with contextlib.suppress(OSError):
        os.close(os.pidfd_open(os.getpid()))
        return True
    return False


def fork_process() -> int:
    """Return the number of a new process that is a copy of this one; 0 in the copy, which has this thread alone."""
    return os.fork()


def has_one_thread() -> bool:
    """Return whether this process has no other thread, of Python or of a library (where it can be forked)."""
    return len(list(Path("/proc/self/task").iterdir())) == 1


class ProcessHandle:
    """A child process that was forked: readable when it has ended, and never mistaken for one that came after it.

    Parameters
    ----------
    pid
        Number of the process.
    """

    def __init__(self, pid: int) -> None:
        self.pid, self._descriptor = pid, os.pidfd_open(pid)

    def fileno(self) -> int:
        """Return its descriptor."""
        return self._descriptor

    def kill(self) -> None:
        """End it, whatever it is doing."""
        with contextlib.suppress(ProcessLookupError):
            signal.pidfd_send_signal(self._descriptor, signal.SIGKILL)

    def take_code(self) -> int:
        """Return the exit code of the process, which has ended, and close the handle; below 0: a signal."""
        code = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        self.close()
        return code

    def close(self) -> None:
        """Close its descriptor."""
        os.close(self._descriptor)


def is_alive(pid: int) -> bool:
    """Return whether a process with this number runs on this machine.

    >>> is_alive(os.getpid())
    True
    """
    if sys.platform == "win32":  # there os.kill(pid, 0) ends the process
        return _is_alive_on_windows(pid)
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        return True
    return True


def _is_alive_on_windows(pid: int) -> bool:
    kernel32 = ctypes.WinDLL("kernel32", use_last_error=True)  # type: ignore[attr-defined,unused-ignore]
    kernel32.OpenProcess.restype = ctypes.c_void_p
    handle = ctypes.c_void_p(kernel32.OpenProcess(_QUERY_LIMITED_INFORMATION, False, pid))
    if not handle:
        return False
    try:
        code = ctypes.c_ulong()
        return bool(kernel32.GetExitCodeProcess(handle, ctypes.byref(code))) and code.value == _STILL_ACTIVE
    finally:
        kernel32.CloseHandle(handle)


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
