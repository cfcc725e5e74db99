"""A pool of worker processes on this machine: one that dies or hangs costs its task, by name, and nothing else."""

from __future__ import annotations

import importlib
import pickle
import time
import traceback
from collections import deque
from collections.abc import Callable, Collection, Iterator, Sequence
from types import TracebackType
from typing import Any, Self

from linework.processes.channel import Channel, wait_readable
from linework.processes.child import Child, ChildEndedError, Ending
from linework.processes.executors import Outcome, Receipt, Task, outcome_of
from linework.processes.forked import ForkServer
from linework.processes.system import can_fork

#: Limit on the time of a task. A tile takes seconds, the densest ones minutes: what takes longer hangs. [s]
LIMIT_S = 900.0
#: What a worker runs.
_WORKER = "linework.processes.pool:tile_worker_main"


class Processes:
    """Runs tasks in `n_workers` processes, started at once, so that they are ready when tasks come.

    Parameters
    ----------
    modules
        What the processes import before their first task.
    prepare
        ``module:function`` that prepares the processes for their tasks, and its arguments: called where it is paid once
        for all of them; () nothing.
    limit_s
        A task that takes longer is given up and its process killed. [s]

    Notes
    -----
    A task whose process dies or hangs is run once more when all others are done, alone: it may have been killed for
    want of memory.
    """

    def __init__(
        self,
        n_workers: int,
        *,
        modules: Sequence[str] = (),
        prepare: Sequence[str] = (),
        limit_s: float = LIMIT_S,
    ) -> None:
        self.n_workers = n_workers
        self._modules, self._limit_s = tuple(modules), limit_s
        # Loading is paid once for all workers; one that replaces another loads for itself
        is_shared = n_workers > 1 and bool(modules) and can_fork()
        self._server = ForkServer(_WORKER, n_workers, modules=modules, prepare=prepare) if is_shared else None
        self._workers = (
            self._server.workers if self._server else [self._new_worker() for _ in range(n_workers)]
        )

    def run(self, work: Callable[[Task], Receipt], tasks: Sequence[Task]) -> Iterator[Outcome[Task, Receipt]]:
        """Yield the outcome of each task as it ends (see `linework.processes.executors.Executor`)."""
        waiting, alone = deque(tasks), deque[Task]()
        busy: dict[Child, tuple[Task, float]] = {}
        tried: list[Task] = []
        try:
            while waiting or alone or busy:
                self._hand_out(work, waiting, alone, busy)
                for worker, answer in self._answers(busy):
                    task, _ = busy.pop(worker)
                    if isinstance(answer, Ending):
                        self._replace(worker)
                        if task in tried:
                            yield Outcome(task, None, f"the worker {answer}")
                        else:
                            tried.append(task)
                            alone.append(task)
                    elif isinstance(answer, OSError):
                        raise answer
                    else:
                        yield Outcome(task, *answer)
        finally:
            for worker in busy:
                self._replace(worker)

    def _hand_out(
        self,
        work: Callable[[Task], Receipt],
        waiting: deque[Task],
        alone: deque[Task],
        busy: dict[Child, tuple[Task, float]],
    ) -> None:
        """Give every idle process a task; tasks whose process ended come last, and alone."""
        self._replace_lost(busy)
        for worker in self._workers:
            source = waiting or (alone if not busy else None)
            if worker not in busy and source:
                task = source.popleft()
                busy[worker] = task, time.monotonic() + self._limit_s
                worker.send_object((work, task))

    def _answers(self, busy: dict[Child, tuple[Task, float]]) -> Iterator[tuple[Child, Any]]:
        """Wait until a process answers, ends or exceeds its limit, and yield the answer or the `Ending`."""
        first = min(deadline for _, deadline in busy.values())
        ready = wait_readable(busy, max(first - time.monotonic(), 0.0))
        for worker, (_, deadline) in list(busy.items()):
            answer: Any = None
            if worker in ready:
                try:
                    answer = worker.read_object()
                except ChildEndedError as error:
                    answer = error.ending
            if answer is None and time.monotonic() >= deadline:
                answer = Ending.hung(self._limit_s)
            if answer is not None:
                yield worker, answer

    def _new_worker(self) -> Child:
        return Child(_WORKER, *self._modules)

    def _replace_lost(self, busy: Collection[Child]) -> None:
        """Replace idle processes that ended with the one they were forked from: a task tried again is not to meet them."""
        if self._server is not None and not self._server.is_running:
            for worker in self._server.workers:
                if worker in self._workers and worker not in busy:
                    self._replace(worker)

    def _replace(self, worker: Child) -> None:
        worker.end()
        self._workers[self._workers.index(worker)] = self._new_worker()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the processes."""
        if self._server is not None:
            self._server.end()
        for worker in self._workers:
            worker.end()


def tile_worker_main(channel: Channel, modules: list[str]) -> None:
    """Run tasks in a process of the pool until the pool closes the channel.

    Parameters
    ----------
    modules
        What to import before the first task comes.
    """
    for module in modules:
        importlib.import_module(module)
    while True:
        try:
            message = channel.receive()
        except EOFError:
            return
        try:
            work, task = pickle.loads(message)
        except Exception as error:  # of the user: a module that this process does not find
            problem = f"cannot be loaded in a worker process: {type(error).__name__}: {error}"
            channel.send_object((None, problem, traceback.format_exc()))
            continue
        try:
            outcome = outcome_of(work, task)
        except OSError as refusal:  # the machine's: it ends the run, there
            channel.send_object(refusal)
        else:
            channel.send_object((outcome.receipt, outcome.problem, outcome.trace))
