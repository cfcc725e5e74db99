"""The process behind a desk: does the works that come over its socket, one after the other."""

from __future__ import annotations

import importlib
import resource
import signal
import sys
import traceback
from collections import deque
from collections.abc import Callable, Generator
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any

from linework.errors import LineworkError
from linework.processes.worker import die_with_parent

if TYPE_CHECKING:
    from linework.workbench.worker.session import SurveyOrder

#: Said to a work that nobody waits for any more: its generator is closed.
LEAVE = "leave"


def survey_worker_main(arguments: list[str]) -> None:
    """Do works. `arguments`: socket, parent's process number, modules to import before the first comes."""
    socket, parent, *modules = arguments
    die_with_parent(int(parent))
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with Connection(int(socket)) as connection:
        order: SurveyOrder = connection.recv()
        for module in modules:
            importlib.import_module(module)
        _Process(connection, order).run()


class _Process:
    """The works of one process.

    Messages come as ("do", number, work, arguments) and ("say", number, value); they go as ("told", number, value)
    any number of times, and then ("done", number, value) or ("failed", number, error). In between goes
    ("compiling", number, is_so): after an installation that takes a minute or two, without a word of the work itself.
    """

    def __init__(self, connection: Connection, order: SurveyOrder) -> None:
        # Here and not above: seconds, in which the process would not notice that its parent has died
        from linework.processes.compiling import CompilationMonitor
        from linework.workbench.worker.session import SurveySession

        self._connection = connection
        self._waiting: deque[tuple[Any, ...]] = deque()
        self._number = 0
        self._table = SurveySession(order, self._tell)
        self._compiling = CompilationMonitor(
            lambda is_so: self._connection.send(("compiling", self._number, is_so))
        )

    def run(self) -> None:
        """Do what comes until the socket closes."""
        while True:
            try:
                message = self._waiting.popleft() if self._waiting else self._connection.recv()
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
            self._connection.send(("failed", self._number, error))
        except MemoryError:
            self._connection.send(("failed", self._number, "needs more memory than there is"))
        except Exception:
            self._connection.send(("failed", self._number, traceback.format_exc()))
        else:
            self._connection.send(("done", self._number, value))

    def _drained(self, steps: Generator[Any, Any, Any]) -> Any:
        """Tell every step of a work; what is said to it meanwhile comes out of its `yield`."""
        said = None
        while True:
            try:
                self._tell(steps.send(said))
            except StopIteration as end:
                return end.value
            said = self._heard()
            if isinstance(said, str) and said == LEAVE:
                steps.close()
                return None

    def _heard(self) -> Any:
        """Return what was last said to the work that is being done, None where nothing was."""
        said = None
        while self._connection.poll():
            message = self._connection.recv()
            if message[0] == "do":
                self._waiting.append(message)
            elif message[1] == self._number:
                said = message[2]
        return said

    def _tell(self, value: Any) -> None:
        self._connection.send(("told", self._number, value))


if __name__ == "__main__":
    survey_worker_main(sys.argv[1:])
