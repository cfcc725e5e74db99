"""Where tasks are done: here one after the other, or in processes that may die without taking the run along.

A task carries names, paths and settings, never points; what comes back is a receipt. The same protocol
serves a cluster.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from linework.errors import MachineError

Task = TypeVar("Task")
Receipt = TypeVar("Receipt")


@dataclass(frozen=True, slots=True)
class Outcome(Generic[Task, Receipt]):
    """What came of a task: a receipt, or the problem in one line."""

    task: Task
    receipt: Receipt | None
    problem: str = ""


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
            yield _outcome(work, task)


def _outcome(work: Callable[[Task], Receipt], task: Task) -> Outcome[Task, Receipt]:
    """Return what came of a task; the machine's refusals (disk full) end the run, they are no fault of the task."""
    try:
        return Outcome(task, work(task))
    except MachineError:
        raise
    except Exception as error:
        return Outcome(task, None, str(error) or type(error).__name__)


Item = TypeVar("Item")
Result = TypeVar("Result")


def in_order(work: Callable[[Item], Result], items: Iterable[Item], n_workers: int) -> Iterator[Result]:
    """Yield ``work(item)`` for each item, in the items' order, whatever the number of workers."""
    if n_workers == 1:
        yield from map(work, items)
        return
    with ThreadPoolExecutor(max_workers=n_workers) as pool:
        yield from pool.map(work, items)
