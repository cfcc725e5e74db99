"""Where tasks are done: here one after the other, or elsewhere by the same protocol.

A task carries names, paths and settings, never points; its result is a small receipt. The protocol is the same for
processes of this machine (`linework.processes.pool.Processes`) and for a cluster (`linework.processes.cluster.Cluster`).
"""

from __future__ import annotations

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


def outcome_of(work: Callable[[Task], Receipt], task: Task) -> Outcome[Task, Receipt]:
    """Run a task in this process and return its outcome; an exception becomes its problem.

    Raises
    ------
    MachineError
        The machine refused.
    """
    try:
        return Outcome(task, work(task))
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
