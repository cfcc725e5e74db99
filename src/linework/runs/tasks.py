"""Tasks of a run: a method looks at the pieces of a task, and what it finds is written to a part file."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from linework.files.output.journal import JournalEntry
from linework.files.output.parts import part_is_whole, read_part, write_part
from linework.methods.protocol import Evidence, Method, look_at
from linework.processes.executors import Executor, Outcome
from linework.processes.own_code import SentCode
from linework.runs.extraction import Failure
from linework.runs.pieces import Pieces
from linework.runs.resume import RunFolder
from linework.runs.steps import Advance


@dataclass(frozen=True, slots=True)
class RunTask:
    """Pieces that a method looks at in one go.

    Parameters
    ----------
    name
        In the journal: the same in every run of the survey.
    method
        Looks at the pieces.
    pieces
        A tile of points, or a window of stereo pairs.
    results
        Folder for what is found.
    sent
        The method as bytes for other processes, made once for a run; None: it has no own code.
    """

    name: str
    method: Method
    pieces: Pieces
    results: Path
    sent: SentCode | None = None

    @property
    def result(self) -> Path:
        """File for what is found."""
        return self.results / f"{self.name}.arrays"

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how another process makes the same task; own code of its method goes as bytes."""
        return _task_of, (self.name, self.sent or self.method, self.pieces, self.results)


def _task_of(name: str, method: Method | SentCode, pieces: Pieces, results: Path) -> RunTask:
    return RunTask(name, method.load() if isinstance(method, SentCode) else method, pieces, results)


@dataclass(frozen=True, slots=True)
class RunReceipt:
    """Result of a task that was done.

    Parameters
    ----------
    name
        Of the task.
    n_seen
        Points in the tile, core and buffer; or pairs that were looked at.
    n_found
        Boxes, lines or sightings.
    sha256
        Of the result's file.
    left_out
        Pieces that could not be read.
    """

    name: str
    n_seen: int
    n_found: int
    seconds: float
    sha256: str
    left_out: tuple[Failure, ...] = ()

    def as_document(self) -> dict[str, Any]:
        """Return it for the journal."""
        return asdict(self)

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> RunReceipt:
        """Return a receipt of the journal, in which tuples are lists."""
        left_out = tuple(Failure(*failure) for failure in document["left_out"])
        return cls(**{**document, "left_out": left_out})


def process_task(task: RunTask) -> RunReceipt:
    """Look at the pieces of a task and write what is found; runs in any process."""
    start = time.perf_counter()
    left_out, sizes, found = list[Failure](), list[int](), list[Evidence]()
    for piece, size, failure in task.pieces.load():
        if failure:
            left_out.append(failure)
        else:
            found.append(look_at(task.method, piece))
        sizes.append(size)
    evidence = task.method.evidence.concatenate(found)
    sha256 = write_part(evidence, task.result)
    seconds = time.perf_counter() - start
    return RunReceipt(task.name, sum(sizes), len(evidence), seconds, sha256, tuple(left_out))


@dataclass(frozen=True, slots=True)
class TasksDone:
    """Receipts by name of their task, and the outcomes of the tasks that failed."""

    receipts: dict[str, RunReceipt]
    failed: Sequence[Outcome[RunTask, RunReceipt]]

    def evidence_of(self, method: Method, tasks: Sequence[RunTask]) -> Evidence:
        """Return what a method found, in the order of its tasks.

        Raises
        ------
        RuntimeError
            A result is not what the task has written.
        """
        parts = []
        for task in tasks:
            if task.method is method and task.name in self.receipts:
                part = read_part(method.evidence, task.result, self.receipts[task.name].sha256)
                if part is None:
                    raise RuntimeError(
                        f"{task.result}: the result of a task was changed after it was written"
                    )
                parts.append(part)
        found: Evidence = method.evidence.concatenate(parts)
        return found

    @property
    def failures(self) -> list[Failure]:
        """What was left out, by name."""
        found = [failure for receipt in self.receipts.values() for failure in receipt.left_out]
        for outcome in self.failed:
            task = outcome.task
            found += task.pieces.failures(task.name, outcome.problem, outcome.trace)
        return sorted(found)


def run_tasks(tasks: Sequence[RunTask], run: RunFolder, executor: Executor, advance: Advance) -> TasksDone:
    """Do the tasks that the journal does not list as done, and enter each when its receipt comes."""
    entries = run.journal.done()
    done = {}
    for task in tasks:
        entry = entries.get(task.name)
        if entry is not None and part_is_whole(task.result, entry.sha256):
            done[task.name] = RunReceipt.from_document(dict(entry.receipt))
    failed = list[Outcome[RunTask, RunReceipt]]()
    advance(len(done), len(tasks))
    for outcome in executor.run(process_task, [task for task in tasks if task.name not in done]):
        name, receipt = outcome.task.name, outcome.receipt
        if receipt is None:
            failed.append(outcome)
        else:
            done[name] = receipt
            run.journal.enter(JournalEntry(name, receipt.sha256, receipt.as_document()))
        advance(len(done) + len(failed), len(tasks))
    return TasksDone(done, failed)
