"""The server's side of a conversation with a worker process: requests, their messages, and time limits."""

from __future__ import annotations

import asyncio
import pickle
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from typing import TYPE_CHECKING, Any

from linework.errors import LineworkError, MachineError
from linework.processes.child import Child, Ending

if TYPE_CHECKING:
    from linework.workbench.worker.order import SurveyOrder

#: A function that runs in the worker: itself, or "module:name", so that only the worker imports what it needs.
WorkerFunction = Callable[..., Any] | str
#: A request that sends nothing for longer hangs: its process is killed, and the next request starts another one. [s]
SILENT_S = 120.0
#: The same while kernels are compiled, which takes a minute or two, and more on a slow, busy machine. [s]
COMPILE_S = 900.0
#: Time that a cancelled request has to end before its process is killed. [s]
LEAVE_S = 3.0


def start_worker_process() -> Child:
    """Start a process for a `SurveyWorker`, which takes two seconds to import all methods."""
    return Child("linework.workbench.worker.process:survey_worker_main")


class SurveyWorker:
    """A process that has the survey open and runs one request after the other; the server never waits for it.

    Parameters
    ----------
    process
        Started before (`start_worker_process`), for the first request; None: none was.

    Notes
    -----
    A process that dies, or is killed, fails the request it is running; the next request gets a new process, which opens
    the survey anew. Each process has a thread here that reads its messages. That thread alone closes the socket, when
    the process is gone: the descriptor of a socket closed under its reader may belong to another file by then.
    """

    def __init__(self, order: SurveyOrder, process: Child | None = None) -> None:
        self._order, self._process = order, process
        self._turn = asyncio.Lock()
        self._number = 0
        self._messages: asyncio.Queue[Any] = asyncio.Queue()
        self._child: Child | None = None
        #: Called when the process begins to compile kernels, and when it has compiled them.
        self.on_compiling: Callable[[bool], None] = lambda _is_compiling: None

    async def ask(self, function: WorkerFunction, *arguments: Any) -> Any:
        """Return what ``function(session, *arguments)`` returns in the process; what it reports is dropped.

        Parameters
        ----------
        function
            A function of a module, as "module:name" where the server does not import that module; it may be a generator
            function, see `request`.

        Raises
        ------
        LineworkError
            As the function raised it.
        MachineError
            The process died or hung.
        RuntimeError
            A fault of ours; its traceback.
        """
        async with self.request(function, *arguments) as request:
            async for _ in request:
                pass
        return request.result

    @asynccontextmanager
    async def request(self, function: WorkerFunction, *arguments: Any) -> AsyncIterator[WorkerRequest]:
        """Start a request once those before it have ended; its messages can be read while it runs.

        Leaving the block before the request has ended cancels it: a generator ends at its next ``yield``, and a request
        that does not end within `LEAVE_S` loses its process.
        """
        async with self._turn:
            self._start()
            self._number += 1
            self._messages = asyncio.Queue()
            request = WorkerRequest(self._messages, self._sender(self._number), self.kill)
            try:
                # In a thread: a process that is starting does not read yet, and the arguments may be large
                await asyncio.to_thread(self._send, ("do", self._number, function, arguments))
                yield request
            finally:
                if not request.is_over:
                    await self._cancel(request)

    async def _cancel(self, request: WorkerRequest) -> None:
        """Cancel a request and wait for it to end."""
        try:
            async with request.leaving():
                await asyncio.to_thread(self._send, ("leave", self._number, None))
                async for _ in request:
                    pass
        except TimeoutError:
            self.kill()
        except (LineworkError, RuntimeError):
            return

    def _sender(self, number: int) -> Callable[[Any], None]:
        return lambda value: self._send(("send", number, value))

    @property
    def pid(self) -> int:
        """Number of the process, 0 where none runs."""
        return 0 if self._child is None else self._child.pid

    def kill(self) -> None:
        """End the process, whatever it is doing; the request it is running fails."""
        child, self._child = self._child, None
        unused, self._process = self._process, None
        if unused is not None:
            unused.end()
        if child is not None:
            self._messages.put_nowait(("failed", _machine_error(child.kill())))
            self.on_compiling(False)

    def _start(self) -> None:
        """Start the process, if none runs."""
        if self._child is not None and self._child.is_running:
            return
        waiting, self._process = self._process, None
        self.kill()
        if waiting is not None and not waiting.is_running:
            waiting.end()
            waiting = None
        child = waiting or start_worker_process()
        self._child = child
        child.send_object(self._order)
        arguments = child, asyncio.get_running_loop()
        threading.Thread(target=self._read, args=arguments, name="worker", daemon=True).start()

    def _send(self, message: tuple[Any, ...]) -> None:
        child = self._child
        if child is not None:
            child.send_object(message)

    def _read(self, child: Child, loop: asyncio.AbstractEventLoop) -> None:
        """Hand the messages of a process to the server's loop, in a thread of its own; None when it has ended."""
        is_over = False
        while not is_over:
            try:
                message = pickle.loads(child.receive())
            except Exception:  # it ended, or sent what cannot be read: no further answer is to be expected
                message, is_over = None, True
                child.channel.close()
            with suppress(RuntimeError):  # the loop is closed
                loop.call_soon_threadsafe(self._take, child, message)

    def _take(self, child: Child, message: tuple[str, int, Any] | None) -> None:
        if child is not self._child:
            return
        if message is None:
            self.kill()
            return
        kind, number, value = message
        if kind == "compiling":
            self.on_compiling(value)
        if number == self._number:
            self._messages.put_nowait((kind, value))


class WorkerRequest:
    """A running request: ``async for`` gives what it reports, `result` what it returned.

    Parameters
    ----------
    messages
        From its process: ("reported", value), ("compiling", is_compiling), and at last ("done", value) or
        ("failed", error).
    send
        Sends a value to the request.
    kill
        Kills its process.
    """

    def __init__(
        self, messages: asyncio.Queue[Any], send: Callable[[Any], None], kill: Callable[[], None]
    ) -> None:
        self._messages, self._send, self._kill = messages, send, kill
        self.result: Any = None
        self.is_over = self.is_compiling = False
        self._limit: asyncio.Timeout | None = None

    def send(self, value: Any) -> None:
        """Send a value to the request: it is the value of its next ``yield``."""
        self._send(value)

    def __aiter__(self) -> AsyncIterator[Any]:
        return self

    async def __anext__(self) -> Any:
        kind, value = await self._message()
        while kind == "compiling":
            self._set_compiling(value)
            kind, value = await self._message()
        if kind == "reported":
            return value
        self.is_over = True
        if kind == "done":
            self.result = value
            raise StopAsyncIteration
        if isinstance(value, LineworkError):
            raise value
        raise RuntimeError(value)

    async def _message(self) -> tuple[str, Any]:
        """Wait for the next message; a process that is silent for too long is killed."""
        limit_s = COMPILE_S if self.is_compiling else SILENT_S
        try:
            # Not wait_for: up to Python 3.11 it loses a cancellation that comes at the same time as an answer
            async with asyncio.timeout(limit_s):
                message: tuple[str, Any] = await self._messages.get()
                return message
        except TimeoutError:
            self._kill()
            self.is_over = True
            raise _machine_error(Ending.hung(limit_s)) from None

    @asynccontextmanager
    async def leaving(self) -> AsyncIterator[None]:
        """Limit the time to the end of the request to `LEAVE_S`, without the time in which it compiles.

        Compiling is not cut short, because the next request would have to begin it anew.

        Raises
        ------
        TimeoutError
            It has not ended.
        """
        async with asyncio.timeout(None) as self._limit:
            self._set_compiling(self.is_compiling)
            yield

    def _set_compiling(self, is_compiling: bool) -> None:
        self.is_compiling = is_compiling
        if self._limit is not None:
            now_s = asyncio.get_running_loop().time()
            self._limit.reschedule(None if is_compiling else now_s + LEAVE_S)


def _machine_error(ending: Ending) -> MachineError:
    return MachineError(f"the worker {ending}", where="workbench", advice="try again")
