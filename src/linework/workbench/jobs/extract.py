"""The work of a job: an automatic extraction of the served survey, as `linework extract` does it."""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from linework.errors import UsageError
from linework.methods.kinds import recordings_for
from linework.model.lines import LineSet
from linework.runs.opened.recordings import opened_recordings
from linework.runs.opened.store import executor_for, usable_cores
from linework.runs.opened.work_folder import RUNS
from linework.runs.steps import RunSteps
from linework.workbench.worker.session import SurveySession

#: Told so often: five times a second moves smoothly. [s]
_TELL_S = 0.2
#: A step that says nothing is told again after this, so that its desk is known to live. [s]
_ALIVE_S = 10.0
#: The page and the desks come first: this much nicer than they are.
_NICE = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class JobRequest:
    """What a job is to find.

    Parameters
    ----------
    kinds, method
        See `linework.methods.kinds`.
    name
        What tells its unfinished run from those of others: the same for the same drawing.
    """

    kinds: tuple[str, ...]
    method: str
    name: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class JobResult:
    """What a job found.

    Parameters
    ----------
    lines
        Lines of all kinds that were looked for.
    counts
        How many by kind, also of those of which there are none.
    message
        What was left out and why, on one line; "": nothing.
    """

    lines: LineSet
    counts: dict[str, int]
    message: str


def extract_in_worker(table: SurveySession, asked: JobRequest) -> str:
    """Extract the lines of the survey and return their report, HTML.

    Told are (step, done, total, unit), up to five times a second, and `JobResult` before the report is written.

    Notes
    -----
    The lines are published in the work folder, so that a run that was killed goes on where it was when the same is
    asked for again. `discard_job_lines` removes them.
    """
    # Here and not above: the server names this work, and has no use for what it needs
    from linework.evaluation.report.page import extraction_report
    from linework.files.vectors.read_write import read_lines
    from linework.runs.extract import extract_to, extraction_request
    from linework.runs.record import missing_summary

    os.nice(_NICE)
    survey, settings = table.survey, table.settings
    # One core is for the page and for whoever follows a line meanwhile
    n_workers = max(usable_cores() - 1, 1)
    with contextlib.ExitStack() as held:
        teller = held.enter_context(_teller(table.tell))
        steps = RunSteps(teller)
        executor = held.enter_context(executor_for(survey, n_workers, settings))
        recordings = held.enter_context(
            opened_recordings(
                survey,
                table.work,
                n_threads=n_workers,
                steps=steps,
                **recordings_for(asked.method, asked.kinds),
            )
        )
        output = _folder(table.work, asked) / "lines.gpkg"

        def extracted(*, resume: bool) -> dict[str, Any]:
            order = extraction_request(
                output, recordings.survey, asked.kinds, asked.method, settings,
                crs=table.order.crs, overwrite=True, resume=resume,
            )  # fmt: skip
            return extract_to(order, recordings, table.work, executor, steps)[0]

        try:
            record = extracted(resume=True)
        except UsageError:  # begun with other files, other settings or another version
            record = extracted(resume=False)
        lines = read_lines(output)
        teller.tell(JobResult(lines=lines, counts=record["counts"]["lines"], message=missing_summary(record)))
        with steps.step("write report"):
            return extraction_report(lines, recordings, record)


def discard_job_lines(work: Path, asked: JobRequest) -> None:
    """Remove the lines of a job from the work folder."""
    shutil.rmtree(_folder(work, asked), ignore_errors=True)


def _folder(work: Path, asked: JobRequest) -> Path:
    said = "\n".join((asked.name, asked.method, *asked.kinds))
    return work / RUNS / f"workbench-{hashlib.sha256(said.encode()).hexdigest()[:16]}"


@contextlib.contextmanager
def _teller(tell: Callable[[Any], None]) -> Iterator[_Teller]:
    teller = _Teller(tell)
    teller.start()
    try:
        yield teller
    finally:
        teller.end_all()


class _Teller(threading.Thread):
    """Watches the steps of a run and tells of them: not too often, and also where they are silent."""

    def __init__(self, tell: Callable[[Any], None]) -> None:
        super().__init__(daemon=True)
        self._tell, self._telling = tell, threading.Lock()
        self._wake, self._is_over = threading.Condition(), False
        self._now = self._told = ("", 0, 0, "")

    def begin(self, step: str, unit: str) -> None:
        """Tell that a step begins."""
        self._say((step, 0, 0, unit))

    def advance(self, done: int, total: int) -> None:
        """Tell how far it is."""
        step, _, _, unit = self._now
        self._say((step, done, total, unit))

    def end(self, step: str, seconds: float) -> None:
        """Say nothing: the next step begins."""

    def tell(self, value: Any) -> None:
        """Tell something else, now."""
        with self._telling:
            self._tell(value)

    def end_all(self) -> None:
        """Tell nothing any more; when this returns nothing is being told."""
        with self._wake:
            self._is_over = True
            self._wake.notify()
        self.join()

    def run(self) -> None:
        """Tell the last that was said, until it is over."""
        while not self._is_over:
            with self._wake:
                self._wake.wait_for(lambda: self._is_over or self._now is not self._told, timeout=_ALIVE_S)
                self._told = self._now
            if not self._is_over:
                self.tell(self._told)
            with self._wake:
                self._wake.wait_for(lambda: self._is_over, timeout=_TELL_S)

    def _say(self, now: tuple[str, int, int, str]) -> None:
        with self._wake:
            self._now = now
            self._wake.notify()
