"""Do the tasks of a run that are not done yet, and note each in the journal as it comes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

from linework.files.journal import Entry
from linework.files.parts import part_is_whole
from linework.tiling.executors import Executor, Outcome
from linework.tiling.steps import Advance
from linework.tiling.unfinished import RunFolder


class NamedTask(Protocol):
    """A task that has a name in the journal and a file for its result."""

    @property
    def name(self) -> str:
        """The same in every run."""
        ...

    @property
    def result(self) -> Path:
        """Where what it finds goes."""
        ...


class NotedReceipt(Protocol):
    """What came of a task: enough to take it over from the journal."""

    @property
    def sha256(self) -> str:
        """Of the result's file."""
        ...

    def as_document(self) -> dict[str, Any]:
        """Return it for the journal."""
        ...


Task = TypeVar("Task", bound=NamedTask)
Receipt = TypeVar("Receipt", bound=NotedReceipt)


def work_all(
    work: Callable[[Task], Receipt],
    tasks: Sequence[Task],
    receipt_of: Callable[..., Receipt],
    run: RunFolder,
    executor: Executor,
    advance: Advance,
) -> tuple[dict[str, Receipt], list[Outcome[Task, Receipt]]]:
    """Work the tasks that are not done yet; return receipts by the tasks' names, and what failed.

    Parameters
    ----------
    receipt_of
        Makes a receipt of what the journal holds.
    """
    done, failed = _taken_over(run, tasks, receipt_of), list[Outcome[Task, Receipt]]()
    advance(len(done), len(tasks))
    for outcome in executor.run(work, [task for task in tasks if task.name not in done]):
        name = outcome.task.name
        if outcome.receipt is None:
            failed.append(outcome)
        else:
            done[name] = outcome.receipt
            run.journal.enter(Entry(name, outcome.receipt.sha256, outcome.receipt.as_document()))
        advance(len(done) + len(failed), len(tasks))
    return done, failed


def _taken_over(
    run: RunFolder, tasks: Sequence[Task], receipt_of: Callable[..., Receipt]
) -> dict[str, Receipt]:
    """Return the receipts of tasks that an earlier process has done, if their results are still what they were."""
    entries: Mapping[str, Entry] = run.journal.done()
    found = {}
    for task in tasks:
        entry = entries.get(task.name)
        if entry is not None and part_is_whole(task.result, entry.sha256):
            found[task.name] = receipt_of(**entry.receipt)
    return found
