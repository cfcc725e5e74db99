"""Workers forked from one process that has loaded what all of them need: its processor time and memory are taken once.

A fork of this program itself would inherit the locks of its threads. The process that is forked here is started for it,
has one thread, and does nothing else; where that does not hold, its workers are started as programs of their own.

Separate from `pool`, which hands out tasks and does not know how a worker came to be.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NoReturn

from linework.processes.channel import Channel, wait_readable
from linework.processes.child import Child
from linework.processes.connection import Offer, connect_to_parent, offer_connection
from linework.processes.system import (
    KILLED_CODE,
    ProcessHandle,
    die_with_parent,
    fork_process,
    has_one_thread,
)

#: Workers that are killed are gone within milliseconds. Where the process that they were forked from does not say so (it
#: stands still), it is killed after this, and they with it. [s]
_ALL_END_S = 1.0
#: The longest message names the processes of all workers; what is longer makes no sense. [bytes]
_LONGEST_BYTES = 1 << 20


class ForkServer:
    """A process that loads modules, and then is forked into workers.

    Parameters
    ----------
    target
        ``module:function`` that the workers run, with their channel and the modules.
    modules
        What is imported before the workers are there.
    prepare
        ``module:function`` that is called then, and its arguments; (): nothing.

    Notes
    -----
    The workers end with it, and it ends with this process. To be used by one thread, which lives as long as it.
    """

    def __init__(
        self, target: str, n_workers: int, *, modules: Sequence[str], prepare: Sequence[str] = ()
    ) -> None:
        self._pids: list[int] = []
        self._codes: dict[int, int] = {}
        self._n_workers = n_workers
        with contextlib.ExitStack() as held:
            offers = [held.enter_context(contextlib.closing(offer_connection())) for _ in range(n_workers)]
            addresses = ",".join(offer.address for offer in offers)
            self._child = Child(
                "linework.processes.forked:fork_server_main", target, addresses, " ".join(prepare), *modules,
                longest_bytes=_LONGEST_BYTES, hands_on=offers,
            )  # fmt: skip
            self.workers: list[Child] = [_ForkedChild(self, n, offer) for n, offer in enumerate(offers)]

    @property
    def is_running(self) -> bool:
        """Whether it has not ended yet, and its workers with it."""
        return self._child.is_running

    def pid_of(self, number: int) -> int:
        """Return the number of a worker's process once it is there, or of its server if it will not be."""
        self._hear(lambda: bool(self._pids or self._codes))
        return self._pids[number] if self._pids else self._child.pid

    def code_of(self, number: int, timeout_s: float | None = None) -> int | None:
        """Return the exit code of a worker, once it has ended; None: it has not within a time [s]."""
        self._hear(lambda: number in self._codes, timeout_s)
        return self._codes.get(number)

    def kill(self, number: int) -> None:
        """End a worker by force."""
        if number in self._codes:
            return
        self._hear(lambda: bool(self._pids), 0.0)
        if self._pids:
            self._child.send_object(number)
        else:  # nobody waits for what is still being loaded
            self._child.kill()

    def end(self) -> None:
        """End the process, and all its workers with it."""
        for number in range(self._n_workers):
            self.kill(number)
        self._hear(lambda: len(self._codes) == self._n_workers, _ALL_END_S)
        self._child.end()
        self._note_end()

    def _hear(self, has_heard: Callable[[], bool], timeout_s: float | None = None) -> None:
        """Take in what the process says until something is known, it has ended, or a time [s] is over."""
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        while not has_heard():
            left_s = None if deadline is None else max(deadline - time.monotonic(), 0.0)
            try:
                self._take_in(self._child.channel.receive_object(left_s))
            except TimeoutError:
                return
            except Exception as error:  # it has ended, or damaged memory has left it with nonsense to say
                if isinstance(error, EOFError | OSError):
                    self._child.wait()
                self._child.kill()
                self._note_end()
                return

    def _take_in(self, said: Any) -> None:
        """Keep what the process says: the numbers of the processes, or the number and the exit code of a worker."""
        if isinstance(said, list):
            self._pids = said
        else:
            number, code = said
            self._codes[number] = code

    def _note_end(self) -> None:
        """Note that the workers have ended with the process, and as it did."""
        code = self._child.code
        ended = dict.fromkeys(range(self._n_workers), KILLED_CODE if code is None else code)
        self._codes = ended | self._codes


class _Forked:
    """A process of which its server tells (see `linework.processes.child.Started`)."""

    def __init__(self, server: ForkServer, number: int) -> None:
        self._server, self._number = server, number

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._server.pid_of(self._number)

    def poll(self) -> int | None:
        """Return its exit code, None while it runs."""
        return self._server.code_of(self._number, 0.0)

    def wait(self, timeout: float | None = None) -> int:
        """Return its exit code once it has ended."""
        code = self._server.code_of(self._number, timeout)
        if code is None:
            raise subprocess.TimeoutExpired(str(self._number), timeout or 0.0)
        return code

    def kill(self) -> None:
        """End it."""
        self._server.kill(self._number)


class _ForkedChild(Child):
    """A worker that a server has forked, or will."""

    def __init__(self, server: ForkServer, number: int, offer: Offer) -> None:
        self._process = _Forked(server, number)
        self.channel = Channel(offer.accept(self._process))
        self._last_words, self._words_reader = b"", None


def fork_server_main(channel: Channel, arguments: list[str]) -> None:
    """Load modules, fork the workers, and tell how each ends until the channel closes.

    Parameters
    ----------
    arguments
        What the workers run; the addresses of their connections, between commas; what is called when all is loaded,
        and its arguments, between spaces; modules.
    """
    target, listed, prepare, *modules = arguments
    addresses = listed.split(",")
    gc.disable()
    for module in modules:
        importlib.import_module(module)
    if prepare:
        name, *rest = prepare.split()
        _function(name)(*rest)
    # What is there now is never freed: the collector would only copy the memory that the workers share
    gc.freeze()
    gc.enable()
    start, server = (_run if has_one_thread() else _start_anew), os.getpid()
    handles: dict[ProcessHandle, int] = {}
    for number, address in enumerate(addresses):
        pid = fork_process()
        if not pid:
            _end_with(partial(start, target, address, addresses, modules, server, channel, [*handles]))
        handles[ProcessHandle(pid)] = number
    for address in addresses:
        os.close(int(address))
    channel.send_object([handle.pid for handle in handles])
    _tell(channel, handles)


def _tell(channel: Channel, handles: dict[ProcessHandle, int]) -> None:
    """Tell the number and exit code of each process that ends, and end those that are asked for, until the channel closes."""
    while True:
        ends: list[Channel | ProcessHandle] = [channel, *handles]
        for ready in wait_readable(ends):
            if isinstance(ready, ProcessHandle):
                channel.send_object((handles.pop(ready), ready.take_code()))
                continue
            try:
                asked = channel.receive_object()
            except EOFError:
                return
            for handle, number in handles.items():
                if number == asked:
                    handle.kill()


def _end_with(run: Callable[[], None]) -> NoReturn:
    """Run a function in a process that was forked, and end the process."""
    code = 1
    try:
        run()
        code = 0
    finally:
        os._exit(code)


def _run(
    target: str, address: str, addresses: list[str], modules: list[str], server: int, channel: Channel,
    handles: list[ProcessHandle],
) -> None:  # fmt: skip
    """Be a worker: run its function."""
    die_with_parent(server)
    channel.close()
    for handle in handles:
        handle.close()
    for other in addresses:
        if other != address:
            os.close(int(other))
    _function(target)(Channel(connect_to_parent(address)), modules)


def _start_anew(
    target: str, address: str, addresses: list[str], modules: list[str], server: int, *_: object
) -> None:
    """Become a worker as a program of its own: another thread may have held a lock when this process was forked."""
    for other in addresses:
        os.set_inheritable(int(other), other == address)
    entry = [sys.executable, "-P", "-m", "linework.processes.entry"]
    os.execv(sys.executable, [*entry, address, str(server), "0", target, *modules])


def _function(name: str) -> Callable[..., object]:
    """Return the function that ``module:function`` names."""
    module, _, function = name.partition(":")
    found: Callable[..., object] = getattr(importlib.import_module(module), function)
    return found
