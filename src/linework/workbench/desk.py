"""A desk: a process that has the survey open, asked from the server, which never waits for it."""

from __future__ import annotations

import asyncio
import os
import socket
import subprocess
import sys
import threading
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from multiprocessing.connection import Connection
from typing import Any

from linework.errors import LineworkError, MachineError
from linework.workbench.desk_process import LEAVE
from linework.workbench.table import SurveyOrder

#: What takes longer without a word hangs: the process is killed, and another one started. [s]
SILENT_S = 120.0
#: Libraries that start threads of their own only disturb the other desks.
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
#: A work that nobody waits for any more has so long to end.
LEAVE_S = 3.0


class Work:
    """A work that is being done: what it tells comes by ``async for``, what it ends with is `value`."""

    def __init__(self, desk: Desk, number: int, told: asyncio.Queue[Any]) -> None:
        self._desk, self._number, self._told = desk, number, told
        self.value: Any = None

    def say(self, value: Any) -> None:
        """Say something to the work: it comes out of its next ``yield``."""
        self._desk._send(("say", self._number, value))

    def __aiter__(self) -> AsyncIterator[Any]:
        return self

    async def __anext__(self) -> Any:
        try:
            kind, value = await asyncio.wait_for(self._told.get(), SILENT_S)
        except TimeoutError:
            self._desk.kill()
            raise MachineError(
                f"no answer for {SILENT_S:.0f} s", where="workbench", advice="try again"
            ) from None
        if kind == "told":
            return value
        if kind == "done":
            self.value = value
            raise StopAsyncIteration
        if isinstance(value, LineworkError):
            raise value
        raise RuntimeError(value)


class Desk:
    """A process that does one work after the other.

    Parameters
    ----------
    modules
        What it imports at once, so that the first work need not wait.

    Notes
    -----
    A process that dies fails the work it was at; the next work gets a new process, which opens the survey anew.
    """

    def __init__(self, order: SurveyOrder, modules: Sequence[str] = ()) -> None:
        self._order, self._modules = order, tuple(modules)
        self._turn = asyncio.Lock()
        self._number = 0
        self._told: asyncio.Queue[Any] = asyncio.Queue()
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection | None = None

    async def ask(self, work: Callable[..., Any], *arguments: Any) -> Any:
        """Return what ``work(table, *arguments)`` returns, in the process; what it tells is dropped.

        Raises
        ------
        LineworkError
            As the work raised it.
        MachineError
            The process died.
        RuntimeError
            A fault of ours; its traceback.
        """
        async with self.doing(work, *arguments) as steps:
            async for _ in steps:
                pass
        return steps.value

    @asynccontextmanager
    async def doing(self, work: Callable[..., Any], *arguments: Any) -> AsyncIterator[Work]:
        """Begin a work when those before it are done, and give it; what it tells can be read while it is done.

        A work that is left before its end is told so, and ends at its next ``yield``; if it does not, its process is
        killed.
        """
        async with self._turn:
            self._start()
            self._number += 1
            self._told = asyncio.Queue()
            steps = Work(self, self._number, self._told)
            self._send(("do", self._number, work, arguments))
            is_over = False
            try:
                yield steps
                is_over = True
            except (LineworkError, RuntimeError):
                is_over = True
                raise
            finally:
                if not is_over:
                    await self._leave(steps)

    async def _leave(self, steps: Work) -> None:
        steps.say(LEAVE)
        try:
            async with asyncio.timeout(LEAVE_S):
                async for _ in steps:
                    pass
        except TimeoutError:
            self.kill()
        except (LineworkError, RuntimeError):
            return

    @property
    def memory_pid(self) -> int:
        """Number of the process, 0 where none runs."""
        return self._process.pid if self._process is not None else 0

    def kill(self) -> None:
        """End the process, whatever it is doing."""
        process, self._process = self._process, None
        connection, self._connection = self._connection, None
        if process is not None:
            process.kill()
            process.wait()
        if connection is not None:
            connection.close()

    def _start(self) -> None:
        """Start the process, if none runs."""
        if self._process is not None and self._process.poll() is None:
            return
        self.kill()
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "linework.workbench.desk_process", str(theirs.fileno()),
                 str(os.getpid()), *self._modules],
                pass_fds=[theirs.fileno()],
                env=os.environ | _ONE_THREAD,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )  # fmt: skip
        self._connection = Connection(ours.detach())
        self._connection.send(self._order)
        reader = threading.Thread(
            target=self._read, args=(self._connection, asyncio.get_running_loop()), daemon=True
        )
        reader.start()

    def _send(self, message: tuple[Any, ...]) -> None:
        """Send a message; that a dead process cannot take it shows when its answer is read."""
        if self._connection is not None:
            with suppress(OSError):
                self._connection.send(message)

    def _read(self, connection: Connection, loop: asyncio.AbstractEventLoop) -> None:
        """Hand on what the process says, in a thread of its own."""
        while True:
            try:
                kind, number, value = connection.recv()
            except (EOFError, OSError, TypeError):
                died = MachineError("the process at work died", where="workbench", advice="try again")
                with suppress(RuntimeError):
                    loop.call_soon_threadsafe(self._hear, connection, None, ("failed", died))
                return
            with suppress(RuntimeError):
                loop.call_soon_threadsafe(self._hear, connection, number, (kind, value))

    def _hear(self, connection: Connection, number: int | None, message: tuple[str, Any]) -> None:
        if connection is self._connection and number in (None, self._number):
            self._told.put_nowait(message)
