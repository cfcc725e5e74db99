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
from linework.workbench.worker.process import LEAVE
from linework.workbench.worker.session import SurveyOrder

#: Libraries that start threads of their own only disturb the other desks.
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


class SurveyWorker:
    """A process that does one work after the other.

    Parameters
    ----------
    modules
        What it imports at once, so that the first work need not wait.

    Notes
    -----
    A process that dies, or is killed, fails the work it was at; the next work gets a new process, which opens the
    survey anew. Each process has a thread here that reads what it says. That thread alone closes the socket, when
    the process is gone: a number of a socket that is closed under a reader may be another's by then.
    """

    def __init__(self, order: SurveyOrder, modules: Sequence[str] = ()) -> None:
        self._order, self._modules = order, tuple(modules)
        self._turn = asyncio.Lock()
        self._number = 0
        self._told: asyncio.Queue[Any] = asyncio.Queue()
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection | None = None
        self._writing = threading.Lock()
        #: Called when the process begins to compile kernels, and when it is done with that.
        self.on_compiling: Callable[[bool], None] = lambda _is_so: None

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
    async def doing(self, work: Callable[..., Any], *arguments: Any) -> AsyncIterator[WorkerRequest]:
        """Begin a work when those before it are done, and give it; what it tells can be read while it is done.

        A work that is left before its end is told so, and ends at its next ``yield``; if it does not, its process is
        killed.
        """
        async with self._turn:
            self._start()
            self._number += 1
            self._told = asyncio.Queue()
            steps = WorkerRequest(self._told, self._sayer(self._number), self.kill)
            try:
                # In a thread: a process that is just starting does not read yet, and lines may be many
                await asyncio.to_thread(self._send, ("do", self._number, work, arguments))
                yield steps
            finally:
                if not steps.is_over:
                    await self._leave(steps)

    async def _leave(self, steps: WorkerRequest) -> None:
        """Tell a work that nobody waits for it, and wait until it has taken that in."""
        try:
            async with steps.leaving():
                await asyncio.to_thread(steps.say, LEAVE)
                async for _ in steps:
                    pass
        except TimeoutError:
            self.kill()
        except (LineworkError, RuntimeError):
            return

    def _sayer(self, number: int) -> Callable[[Any], None]:
        return lambda value: self._send(("say", number, value))

    @property
    def memory_pid(self) -> int:
        """Number of the process, 0 where none runs."""
        return self._process.pid if self._process is not None else 0

    def kill(self) -> None:
        """End the process, whatever it is doing; the work it is at fails."""
        process, self._process, self._connection = self._process, None, None
        if process is not None:
            process.kill()
            process.wait()
            died = MachineError("the process at work died", where="workbench", advice="try again")
            self._told.put_nowait(("failed", died))
            self.on_compiling(False)

    def _start(self) -> None:
        """Start the process, if none runs."""
        if self._process is not None and self._process.poll() is None:
            return
        self.kill()
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "linework.workbench.worker.process", str(theirs.fileno()),
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
        connection = self._connection
        if connection is not None:
            with self._writing, suppress(OSError):
                connection.send(message)

    def _read(self, connection: Connection, loop: asyncio.AbstractEventLoop) -> None:
        """Hand on what the process says, in a thread of its own."""
        while True:
            try:
                kind, number, value = connection.recv()
            except Exception:  # its end, or the half of a message that it died in
                with self._writing:
                    connection.close()
                with suppress(RuntimeError):
                    loop.call_soon_threadsafe(self._hear, connection, None, None)
                return
            with suppress(RuntimeError):
                loop.call_soon_threadsafe(self._hear, connection, number, (kind, value))

    def _hear(self, connection: Connection, number: int | None, message: tuple[str, Any] | None) -> None:
        if connection is not self._connection:
            return
        if message is None:
            self.kill()
            return
        if message[0] == "compiling":
            self.on_compiling(message[1])
        if number == self._number:
            self._told.put_nowait(message)


# A work at a desk, as the server sees it: what it tells, and how long one waits for that

#: What takes longer without a word hangs: the process is killed, and another one started. [s]
SILENT_S = 120.0
#: Compiling the kernels that one of them needs takes no longer, on a slow machine that has more to do. [s]
COMPILE_S = 900.0
#: A work that nobody waits for any more has so long to end.
LEAVE_S = 3.0


class WorkerRequest:
    """A work that is being done: what it tells comes by ``async for``, what it ends with is `value`.

    Parameters
    ----------
    told
        What its process says: ("told", value), ("compiling", is_so), and at last ("done", value) or ("failed", error).
    say
        Says something to the process.
    kill
        Kills it.
    """

    def __init__(
        self, told: asyncio.Queue[Any], say: Callable[[Any], None], kill: Callable[[], None]
    ) -> None:
        self._told, self._say, self._kill = told, say, kill
        self.value: Any = None
        self.is_over = self.is_compiling = False
        self._limit: asyncio.Timeout | None = None

    def say(self, value: Any) -> None:
        """Say something to the work: it comes out of its next ``yield``."""
        self._say(value)

    def __aiter__(self) -> AsyncIterator[Any]:
        return self

    async def __anext__(self) -> Any:
        kind, value = await self._heard()
        while kind == "compiling":
            self._compiles(value)
            kind, value = await self._heard()
        if kind == "told":
            return value
        self.is_over = True
        if kind == "done":
            self.value = value
            raise StopAsyncIteration
        if isinstance(value, LineworkError):
            raise value
        raise RuntimeError(value)

    async def _heard(self) -> tuple[str, Any]:
        """Wait for the next message; a process that is silent for too long is killed."""
        limit_s = COMPILE_S if self.is_compiling else SILENT_S
        try:
            # Not wait_for: up to Python 3.11 it forgets that it is cancelled where an answer comes at the same time
            async with asyncio.timeout(limit_s):
                message: tuple[str, Any] = await self._told.get()
                return message
        except TimeoutError:
            self._kill()
            self.is_over = True
            raise MachineError(
                f"no answer for {limit_s:.0f} s", where="workbench", advice="try again"
            ) from None

    @asynccontextmanager
    async def leaving(self) -> AsyncIterator[None]:
        """Give the work `LEAVE_S` to end, but not while it compiles: the next would have to begin that anew.

        Raises
        ------
        TimeoutError
            It has not ended.
        """
        async with asyncio.timeout(None) as self._limit:
            self._compiles(self.is_compiling)
            yield

    def _compiles(self, is_so: bool) -> None:
        self.is_compiling = is_so
        if self._limit is not None:
            self._limit.reschedule(None if is_so else asyncio.get_running_loop().time() + LEAVE_S)
