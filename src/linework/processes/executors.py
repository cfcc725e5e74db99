"""Where tasks are done: here one after the other, or in processes that may die without taking the run along.

A task carries names, paths and settings, never points; what comes back is a receipt. The same protocol
serves a cluster: `linework.processes.pool` is one way to do tasks elsewhere, Dask will be another.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from linework.errors import LineworkError, MachineError

Task = TypeVar("Task")
Receipt = TypeVar("Receipt")


@dataclass(frozen=True, slots=True)
class Outcome(Generic[Task, Receipt]):
    """What came of a task: a receipt, or the problem in one line and the traceback for the log."""

    task: Task
    receipt: Receipt | None
    problem: str = ""
    trace: str = ""


class Executor(Protocol):
    """Does tasks."""

    @property
    def n_workers(self) -> int:
        """How many tasks are done at a time."""
        ...

    def run(self, work: Callable[[Task], Receipt], tasks: Sequence[Task]) -> Iterator[Outcome[Task, Receipt]]:
        """Yield the outcome of each task as it comes, in any order; a task that fails stops no other.

        Parameters
        ----------
        work
            A function of a module, so that another process finds it by its name.

        Raises
        ------
        MachineError
            The machine refused (disk full): no fault of a task, so it ends the run.
        """
        ...


class Serial:
    """Does tasks one after the other, in this process."""

    n_workers = 1

    def run(self, work: Callable[[Task], Receipt], tasks: Sequence[Task]) -> Iterator[Outcome[Task, Receipt]]:
        """Yield the outcome of each task, in the tasks' order.

        >>> [outcome.receipt for outcome in Serial().run(abs, [-1, 2])]
        [1, 2]
        """
        for task in tasks:
            yield outcome_of(work, task)


def outcome_of(work: Callable[[Task], Receipt], task: Task) -> Outcome[Task, Receipt]:
    """Do a task here; whatever it raises is its problem, but for what the machine refuses."""
    try:
        return Outcome(task, work(task))
    except MachineError:
        raise
    except MemoryError:
        return Outcome(task, None, "needs more memory than there is")
    except LineworkError as error:
        return Outcome(task, None, str(error))
    except Exception as error:
        import traceback

        return Outcome(task, None, f"{type(error).__name__}: {error}", traceback.format_exc())
