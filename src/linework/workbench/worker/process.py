"""The worker's side of a conversation: runs the requests that come over its channel, one after the other.

Separate from `conversation`, because it runs in the child process and imports the survey's readers and kernels.
"""

from __future__ import annotations

import importlib
import threading
import traceback
from collections import deque
from collections.abc import Callable, Generator
from typing import Any

from numba.core import event

from linework.errors import LineworkError
from linework.processes.channel import Channel
from linework.processes.child import OUT_OF_MEMORY
from linework.processes.system import release_free_memory
from linework.workbench.worker.conversation import WorkerFunction
from linework.workbench.worker.order import SurveyOrder
from linework.workbench.worker.session import SurveySession

#: A worker without a request for so long gives freed memory back to the system: after 5 million points were decoded and
#: tiles made, 80 MB of two workers, in 2 to 23 ms. [s]
_TRIM_AFTER_S = 1.0


def survey_worker_main(channel: Channel, _arguments: list[str]) -> None:
    """Run requests until the channel closes; its first message is the `SurveyOrder`."""
    order: SurveyOrder = channel.receive_object()
    _Requests(channel, order).run()


class _Requests:
    """The requests of one process.

    Messages come as ("do", number, function or "module:name", arguments), ("send", number, value) and ("leave", number, None). Of each
    request any number of ("reported", number, value) goes back, and then ("done", number, value) or
    ("failed", number, error). In between goes ("compiling", number, is_compiling): after an installation compiling
    takes a minute or two, in which the request itself sends nothing.
    """

    def __init__(self, channel: Channel, order: SurveyOrder) -> None:
        self._channel = channel
        self._waiting: deque[tuple[Any, ...]] = deque()
        self._number = 0
        self._session = SurveySession(order, self._report)
        self._compiling = CompilationMonitor(lambda is_compiling: self._send("compiling", is_compiling))

    def run(self) -> None:
        """Run what comes until the channel closes."""
        while True:
            try:
                message = self._waiting.popleft() if self._waiting else self._next_message()
            except EOFError:
                return
            if message[0] == "do":
                _, self._number, function, arguments = message
                self._run(function, arguments)

    def _next_message(self) -> Any:
        """Return the next message; give freed memory back where none comes for a while."""
        try:
            return self._channel.receive_object(_TRIM_AFTER_S)
        except TimeoutError:
            release_free_memory()
            return self._channel.receive_object()

    def _run(self, function: WorkerFunction, arguments: tuple[Any, ...]) -> None:
        try:
            value = worker_function(function)(self._session, *arguments)
            if isinstance(value, Generator):
                value = self._drained(value)
        except LineworkError as error:
            self._send("failed", error)
        except MemoryError:
            self._send("failed", OUT_OF_MEMORY)
        except Exception:
            self._send("failed", traceback.format_exc())
        else:
            self._send("done", value)

    def _drained(self, steps: Generator[Any, Any, Any]) -> Any:
        """Report every value that a request yields; what is sent to it meanwhile is the value of its `yield`."""
        received = None
        while True:
            try:
                self._report(steps.send(received))
            except StopIteration as end:
                return end.value
            received, must_leave = self._received()
            if must_leave:
                steps.close()
                return None

    def _received(self) -> tuple[Any, bool]:
        """Return the last value sent to the running request, None if there is none, and whether it has to end."""
        value, must_leave = None, False
        while self._channel.has_data():
            message = self._channel.receive_object()
            if message[0] == "do":
                self._waiting.append(message)
            elif message[1] == self._number:
                value, must_leave = message[2], must_leave or message[0] == "leave"
        return value, must_leave

    def _report(self, value: Any) -> None:
        self._send("reported", value)

    def _send(self, kind: str, value: Any) -> None:
        self._channel.send_object((kind, self._number, value))


def worker_function(function: WorkerFunction) -> Callable[..., Any]:
    """Return the function of a request; one that is named is imported."""
    if not isinstance(function, str):
        return function
    module, _, name = function.partition(":")
    named: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return named


class CompilationMonitor(event.Listener):
    """Reports when numba begins to compile and when it ends; kernels compiled for another one are part of that.

    Parameters
    ----------
    report
        Called with True and False in turn, on the thread that compiles. Threads other than the main one report
        nothing.
    """

    def __init__(self, report: Callable[[bool], None]) -> None:
        self._report_change, self._depth = report, 0
        event.register("numba:compile", self)  # type: ignore[no-untyped-call]

    def on_start(self, _event: event.Event) -> None:
        """Count a kernel that is being compiled."""
        self._change(1)

    def on_end(self, _event: event.Event) -> None:
        """Count a kernel that is compiled."""
        self._change(-1)

    def _change(self, step: int) -> None:
        if threading.current_thread() is not threading.main_thread():
            return
        before, self._depth = self._depth, self._depth + step
        if (before == 0) != (self._depth == 0):
            self._report_change(self._depth > 0)
