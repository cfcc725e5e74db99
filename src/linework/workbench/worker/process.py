"""The process behind a desk: does the works that come over its socket, one after the other."""

from __future__ import annotations

import importlib
import traceback
from collections import deque
from collections.abc import Callable, Generator
from typing import Any

from linework.errors import LineworkError
from linework.processes.channel import Channel
from linework.processes.child import OUT_OF_MEMORY
from linework.workbench.worker.compiling import Compiling
from linework.workbench.worker.session import SurveyOrder, SurveySession


def survey_worker_main(channel: Channel, modules: list[str]) -> None:
    """Do works. `arguments`: socket, parent's process number, modules to import before the first comes."""
    order: SurveyOrder = channel.receive_object()
    for module in modules:
        importlib.import_module(module)
    _Process(channel, order).run()


class _Process:
    """The works of one process.

    Messages come as ("do", number, work, arguments) and ("say", number, value)
    or ("leave", number, None); they go as ("told", number, value)
    any number of times, and then ("done", number, value) or ("failed", number, error). In between goes
    ("compiling", number, is_so): after an installation that takes a minute or two, without a word of the work itself.
    """

    def __init__(self, channel: Channel, order: SurveyOrder) -> None:
        self._channel = channel
        self._waiting: deque[tuple[Any, ...]] = deque()
        self._number = 0
        self._table = SurveySession(order, self._tell)
        self._compiling = Compiling(
            lambda is_so: self._channel.send_object(("compiling", self._number, is_so))
        )

    def run(self) -> None:
        """Do what comes until the socket closes."""
        while True:
            try:
                message = self._waiting.popleft() if self._waiting else self._channel.receive_object()
            except EOFError:
                return
            if message[0] == "do":
                _, self._number, work, arguments = message
                self._do(work, arguments)

    def _do(self, work: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        try:
            value = work(self._table, *arguments)
            if isinstance(value, Generator):
                value = self._drained(value)
        except LineworkError as error:
            self._channel.send_object(("failed", self._number, error))
        except MemoryError:
            self._channel.send_object(("failed", self._number, OUT_OF_MEMORY))
        except Exception:
            self._channel.send_object(("failed", self._number, traceback.format_exc()))
        else:
            self._channel.send_object(("done", self._number, value))

    def _drained(self, steps: Generator[Any, Any, Any]) -> Any:
        """Tell every step of a work; what is said to it meanwhile comes out of its `yield`."""
        said = None
        while True:
            try:
                self._tell(steps.send(said))
            except StopIteration as end:
                return end.value
            said, must_leave = self._heard()
            if must_leave:
                steps.close()
                return None

    def _heard(self) -> tuple[Any, bool]:
        """Return what was last said to the work that is being done, None where nothing was; and whether it must end."""
        said, must_leave = None, False
        while self._channel.has_data():
            message = self._channel.receive_object()
            if message[0] == "do":
                self._waiting.append(message)
            elif message[1] == self._number:
                said, must_leave = message[2], must_leave or message[0] == "leave"
        return said, must_leave

    def _tell(self, value: Any) -> None:
        self._channel.send_object(("told", self._number, value))
