"""The request of a job: an automatic extraction of the served survey, as `linework extract` does it.

Separate from `jobs`, because it runs in the process of the job and imports all methods.
"""

from __future__ import annotations

import contextlib
import hashlib
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from linework.errors import UsageError
from linework.methods.kinds import recordings_for
from linework.processes.system import give_way, usable_cores
from linework.runs.compile import compiled_for
from linework.runs.opened.made import RUNS, claim, remove_made
from linework.runs.opened.recordings import opened_recordings
from linework.runs.opened.store import executor_for, promised_points
from linework.runs.steps import RunSteps
from linework.workbench.jobs.orders import JobRequest, JobResult
from linework.workbench.worker.session import SurveySession

#: Shortest time between reports of progress: five a second move smoothly. [s]
_REPORT_S = 0.2
#: A step without progress is reported again after this, so that its worker is known to live. [s]
_ALIVE_S = 10.0
#: Increment of the process's niceness (nice(2)): the page and its workers come first.
_NICE = 10


def extract_in_worker(session: SurveySession, request: JobRequest) -> str:
    """Extract the lines of the survey and return their report, HTML.

    Reports (step, done, total, unit), up to five times a second, and a `JobResult` before the report is written.

    Raises
    ------
    LineworkError
        As `linework extract` raises it.

    Notes
    -----
    The lines are published in the work folder, so that a run that was killed goes on where it was when the same is
    asked for again. `discard_job_lines` removes them.
    """
    # Here and not above: the server names this function, and does not need what it imports
    from linework.evaluation.report.page import extraction_report
    from linework.files.vectors.read_write import read_lines
    from linework.runs.extract import extract_to, extraction_request
    from linework.runs.record import missing_summary

    give_way(_NICE)
    survey, settings = session.survey, session.settings
    # One core is for the page and for following lines meanwhile
    n_workers = max(usable_cores() - 1, 1)
    with contextlib.ExitStack() as held:
        reporter = held.enter_context(_reporter(session.report))
        steps = RunSteps(reporter)
        wanted = recordings_for(request.method, request.kinds)
        executor = held.enter_context(
            executor_for(
                promised_points(survey),
                n_workers,
                settings,
                has_images=survey.has_pairs,
                names=compiled_for(survey, request.kinds, images=wanted["images"]),
            )
        )
        recordings = held.enter_context(
            opened_recordings(survey, session.work, n_threads=n_workers, steps=steps, **wanted)
        )
        name = _folder_name(request)
        claim(session.work, name)
        output = session.work / name / "lines.gpkg"

        def extracted(*, resume: bool) -> dict[str, Any]:
            order = extraction_request(
                output, recordings.survey, request.kinds, request.method, settings,
                crs=session.order.crs, overwrite=True, resume=resume,
            )  # fmt: skip
            return extract_to(order, recordings, session.work, executor, steps)[0]

        try:
            record = extracted(resume=True)
        except UsageError:  # begun with other files, other settings or another version
            record = extracted(resume=False)
        lines = read_lines(output)
        reporter.report(
            JobResult(lines=lines, counts=record["counts"]["lines"], message=missing_summary(record))
        )
        with steps.step("write report"):
            return extraction_report(lines, recordings, record)


def discard_job_lines(work: Path, request: JobRequest) -> None:
    """Remove the lines of a job from the work folder."""
    remove_made(work, _folder_name(request))


def _folder_name(request: JobRequest) -> str:
    content = "\n".join((request.name, request.method, *request.kinds))
    return f"{RUNS}/workbench-{hashlib.sha256(content.encode()).hexdigest()[:16]}"


@contextlib.contextmanager
def _reporter(report: Callable[[Any], None]) -> Iterator[_Reporter]:
    reporter = _Reporter(report)
    reporter.start()
    try:
        yield reporter
    finally:
        reporter.end_all()


class _Reporter(threading.Thread):
    """Watcher of a run's steps that reports them: not too often, and also while they make no progress."""

    def __init__(self, report: Callable[[Any], None]) -> None:
        super().__init__(daemon=True)
        self._report, self._reporting = report, threading.Lock()
        self._wake, self._is_over = threading.Condition(), False
        self._now = self._reported = ("", 0, 0, "")

    def begin(self, step: str, unit: str) -> None:
        """Report that a step begins."""
        self._set((step, 0, 0, unit))

    def advance(self, done: int, total: int) -> None:
        """Report its progress."""
        step, _, _, unit = self._now
        self._set((step, done, total, unit))

    def end(self, step: str, seconds: float) -> None:
        """Report nothing: the next step begins."""

    def report(self, value: Any) -> None:
        """Report something else, at once."""
        with self._reporting:
            self._report(value)

    def end_all(self) -> None:
        """End the thread; when this returns nothing is being reported."""
        with self._wake:
            self._is_over = True
            self._wake.notify()
        self.join()

    def run(self) -> None:
        """Report the last progress until it is over."""
        while not self._is_over:
            with self._wake:
                self._wake.wait_for(
                    lambda: self._is_over or self._now is not self._reported, timeout=_ALIVE_S
                )
                self._reported = self._now
            if not self._is_over:
                self.report(self._reported)
            with self._wake:
                self._wake.wait_for(lambda: self._is_over, timeout=_REPORT_S)

    def _set(self, now: tuple[str, int, int, str]) -> None:
        with self._wake:
            self._now = now
            self._wake.notify()
