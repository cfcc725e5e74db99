"""Where tasks are done: here one after the other, or elsewhere by the same protocol.

A task carries names, paths and settings, never points; its result is a small receipt. The protocol is the same for
processes of this machine (`linework.processes.pool.Processes`) and for a cluster (`linework.processes.cluster.Cluster`).
"""

from __future__ import annotations

import ctypes
import queue
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from linework.errors import LineworkError, MachineError, OwnCodeError
from linework.processes.child import OUT_OF_MEMORY

Task = TypeVar("Task")
Receipt = TypeVar("Receipt")


@dataclass(frozen=True, slots=True)
class Outcome(Generic[Task, Receipt]):
    """Result of a task: its receipt, or its problem in one line and the traceback for the log."""

    task: Task
    receipt: Receipt | None
    problem: str = ""
    trace: str = ""


class Executor(Protocol):
    """Runs tasks."""

    @property
    def n_workers(self) -> int:
        """Number of tasks that run at a time."""
        ...

    def run(self, work: Callable[[Task], Receipt], tasks: Sequence[Task]) -> Iterator[Outcome[Task, Receipt]]:
        """Yield the outcome of each task as it ends, in any order; a task that fails stops no other.

        Parameters
        ----------
        work
            A module-level function, so that another process finds it by its name.

        Raises
        ------
        MachineError
            The machine refused (disk full): not the fault of a task, so it ends the run.
        """
        ...


class Serial:
    """Runs tasks one after the other, in this process."""

    n_workers = 1

    def run(self, work: Callable[[Task], Receipt], tasks: Sequence[Task]) -> Iterator[Outcome[Task, Receipt]]:
        """Yield the outcome of each task, in the tasks' order.

        >>> [outcome.receipt for outcome in Serial().run(abs, [-1, 2])]
        [1, 2]
        """
        for task in tasks:
            yield outcome_of(work, task)


class _StoppedError(BaseException):
    """Ends a thread whose results nobody waits for; no ``except Exception`` holds it up."""


class Threads:
    """Runs tasks in threads of this process, which start at once and share what is loaded.

    Kernels run beside each other, the rest takes turns: on two idle cores a survey of one tile takes a fifth less time, and
    threads take neither the seconds nor the memory of processes. But a task that dies takes the run with it, as in `Serial`.

    Notes
    -----
    Where the run ends early, by an interruption or a full disk, threads end between two instructions of Python, which a
    kernel may put off for a second or two, as it puts off an interruption of this thread.
    """

    def __init__(self, n_workers: int) -> None:
        self.n_workers = n_workers

    def run(self, work: Callable[[Task], Receipt], tasks: Sequence[Task]) -> Iterator[Outcome[Task, Receipt]]:
        """Yield the outcome of each task as it ends.

        >>> sorted(outcome.receipt for outcome in Threads(2).run(abs, [-1, 2]))
        [1, 2]
        """
        if min(self.n_workers, len(tasks)) <= 1:
            yield from Serial().run(work, tasks)
            return
        waiting, done = queue.SimpleQueue[Task](), queue.SimpleQueue[Outcome[Task, Receipt] | BaseException]()
        for task in tasks:
            waiting.put(task)
        ending = _Ending(threading.Lock(), set())
        threads = [
            threading.Thread(target=_do_tasks, args=(work, waiting, done, ending), daemon=True)
            for _ in range(min(self.n_workers, len(tasks)))
        ]
        n_left = len(tasks)
        try:
            for thread in threads:
                thread.start()
            while n_left:
                outcome = done.get()
                if isinstance(outcome, BaseException):
                    raise outcome
                n_left -= 1
                yield outcome
        finally:
            for thread in threads:
                # One that ends by itself would say on the error stream that it was stopped meanwhile
                with ending.lock:
                    if (
                        n_left
                        and thread.ident is not None
                        and thread.is_alive()
                        and thread not in ending.threads
                    ):
                        ctypes.pythonapi.PyThreadState_SetAsyncExc(
                            ctypes.c_ulong(thread.ident), ctypes.py_object(_StoppedError)
                        )
            for thread in threads:
                if thread.ident is not None:
                    thread.join()


@dataclass(frozen=True)
class _Ending:
    """Threads that end by themselves and are stopped no more; the lock is held while one is stopped."""

    lock: threading.Lock
    threads: set[threading.Thread]


def _do_tasks(
    work: Callable[[Task], Receipt],
    waiting: queue.SimpleQueue[Task],
    done: queue.SimpleQueue[Outcome[Task, Receipt] | BaseException],
    ending: _Ending,
) -> None:
    """Do waiting tasks until there are none, or the machine refuses."""
    try:
        try:
            while True:
                done.put(outcome_of(work, waiting.get_nowait()))
        except queue.Empty:
            pass
        except _StoppedError:
            raise
        except BaseException as error:
            done.put(error)
        # What stops this thread came before, and shows in here, or does not come at all
        with ending.lock:
            ending.threads.add(threading.current_thread())
    except _StoppedError:
        return


def outcome_of(work: Callable[[Task], Receipt], task: Task) -> Outcome[Task, Receipt]:
    """Run a task in this process and return its outcome; an exception becomes its problem.

    Raises
    ------
    MachineError
        The machine refused.
    """
    try:
        return Outcome(task, _done(work, task))
    except MachineError:
        raise
    except MemoryError:
        return Outcome(task, None, OUT_OF_MEMORY)
    except OwnCodeError as error:  # with the user's line, for the log
        return Outcome(task, None, str(error), traceback.format_exc())
    except LineworkError as error:
        return Outcome(task, None, str(error))
    except Exception as error:
        return Outcome(task, None, f"{type(error).__name__}: {error}", traceback.format_exc())


def _done(work: Callable[[Task], Receipt], task: Task) -> Receipt:
    """Return a task's receipt; it is done once more where the interpreter itself failed.

    Threads in which numba compiles read Python's grammar at once, which CPython 3.11 may fail at
    (https://github.com/python/cpython/issues/106905).
    """
    try:
        return work(task)
    except SystemError:
        return work(task)
