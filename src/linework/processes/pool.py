"""Tasks done in processes of this machine: one that dies or hangs costs its task, by name, and nothing else."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from types import TracebackType
from typing import Any, Self

from linework.processes.executors import Outcome, Receipt, Task

#: A tile takes seconds. What takes longer than this hangs, and would for ever. [s]
LIMIT_S = 900.0
#: Kernels are serial and tiles are done side by side: libraries that start threads of their own only disturb.
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


class Processes:
    """Does tasks in `n_workers` processes, started at once, so that they are ready when tasks come.

    Parameters
    ----------
    modules
        What the processes import before their first task.
    limit_s
        A task that takes longer is given up and its process killed. [s]

    Notes
    -----
    The processes are of this one's group and die with it, however it dies. A task whose process dies is
    done once more when all others are done, alone: it may have died for want of memory.
    """

    def __init__(self, n_workers: int, *, modules: Sequence[str] = (), limit_s: float = LIMIT_S) -> None:
        self.n_workers = n_workers
        self._modules, self._limit_s = tuple(modules), limit_s
        self._workers = [_Worker(self._modules) for _ in range(n_workers)]

    def run(self, work: Callable[[Task], Receipt], tasks: Sequence[Task]) -> Iterator[Outcome[Task, Receipt]]:
        """Yield the outcome of each task as it comes."""
        waiting, alone = deque(tasks), deque[Task]()
        busy: dict[_Worker, tuple[Task, float]] = {}
        tried: list[Task] = []
        try:
            while waiting or alone or busy:
                self._hand_out(work, waiting, alone, busy)
                for worker, message in self._messages(busy):
                    task, _ = busy.pop(worker)
                    if isinstance(message, str):  # it died of the task
                        self._replace(worker)
                        if task in tried:
                            yield Outcome(task, None, message)
                        else:
                            tried.append(task)
                            alone.append(task)
                    elif isinstance(message, OSError):
                        raise message
                    else:
                        yield Outcome(task, *message)
        finally:
            for worker in busy:
                self._replace(worker)

    def _hand_out(
        self,
        work: Callable[[Task], Receipt],
        waiting: deque[Task],
        alone: deque[Task],
        busy: dict[_Worker, tuple[Task, float]],
    ) -> None:
        """Give every idle process a task; what killed one comes last, and alone."""
        for worker in self._workers:
            source = waiting or (alone if not busy else None)
            if worker not in busy and source:
                task = source.popleft()
                busy[worker] = task, time.monotonic() + self._limit_s
                worker.give(work, task)

    def _messages(self, busy: dict[_Worker, tuple[Task, float]]) -> Iterator[tuple[_Worker, Any]]:
        """Wait until something happens, and yield what: what a process says, or how it died."""
        first = min(deadline for _, deadline in busy.values())
        ready = wait([worker.connection for worker in busy], timeout=max(first - time.monotonic(), 0.0))
        for worker, (_, deadline) in list(busy.items()):
            if worker.connection in ready:
                yield worker, worker.answer()
            elif time.monotonic() >= deadline:
                yield worker, f"took longer than {self._limit_s:.0f} s"

    def _replace(self, worker: _Worker) -> None:
        worker.kill()
        self._workers[self._workers.index(worker)] = _Worker(self._modules)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the processes."""
        for worker in self._workers:
            worker.kill()


class _Worker:
    """A process and this end of its socket."""

    def __init__(self, modules: Sequence[str]) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            # Its own words would get between the progress; what a task raises comes back as a message
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "linework.processes.worker", str(theirs.fileno()), str(os.getpid()), *modules],
                pass_fds=[theirs.fileno()],
                env=os.environ | _ONE_THREAD,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )  # fmt: skip
        self.connection = Connection(ours.detach())

    def give(self, work: Callable[[Task], Receipt], task: Task) -> None:
        """Send a task; that a dead process cannot take it shows when its answer is read."""
        try:
            self.connection.send((work, task))
        except (BrokenPipeError, ConnectionResetError):
            return

    def answer(self) -> Any:
        """Return what came of the task, or in words how the process died."""
        try:
            return self.connection.recv()
        except (EOFError, ConnectionResetError):
            return f"the worker died ({_how(self.process.wait())})"

    def kill(self) -> None:
        """End the process, whatever it is doing."""
        self.process.kill()
        self.process.wait()
        self.connection.close()


def _how(code: int) -> str:
    """Return how a process ended, in words.

    >>> _how(-9), _how(3)
    ('SIGKILL', 'exit code 3')
    """
    if code >= 0:
        return f"exit code {code}"
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"signal {-code}"
