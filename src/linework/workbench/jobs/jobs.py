"""Jobs: automatic extractions of the served survey, one at a time, each in a process of its own.

Separate from `routes`, because jobs live on without any request.
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from linework.errors import AbsentError, LineworkError, OutputExistsError, StaleError
from linework.model.changes import Change, Edit
from linework.workbench.edits.routes import changed_lines
from linework.workbench.jobs.orders import JobRequest, JobResult
from linework.workbench.server.app_state import AppState
from linework.workbench.server.documents import Document
from linework.workbench.server.problems import status_and_message
from linework.workbench.worker.conversation import SurveyWorker

#: Jobs, and reports, that are kept: a report takes some megabytes, in memory, so that no file has to be removed.
_MOST_JOBS, _MOST_REPORTS = 20, 3
_FAULT = "a fault of linework, not of your data"


class Job(Document):
    """State of a job, as the page gets it.

    Parameters
    ----------
    step
        Current step.
    done, total, unit
        Progress of the step; total 0: it has no amounts.
    seconds
        Since the step began; when the job is over, since the job began.
    message
        Why it failed; of a job that is done, what was left out.
    counts
        Number of lines by kind, once they are saved.
    report
        Whether there is one.
    """

    id: str
    state: Literal["running", "done", "failed", "cancelled"] = "running"
    step: str = ""
    done: int = 0
    total: int = 0
    unit: str = ""
    seconds: float = 0.0
    message: str = ""
    counts: dict[str, int] | None = None
    report: bool = False


class Jobs:
    """The jobs of the served survey. Every change of a job is sent to all pages."""

    def __init__(self, app_state: AppState) -> None:
        self._app_state = app_state
        self._jobs: dict[str, Job] = {}
        self._reports: dict[str, str] = {}
        self._worker: SurveyWorker | None = None
        self._task: asyncio.Task[None] | None = None

    @property
    def all(self) -> list[Job]:
        """All that are kept, the oldest first."""
        return list(self._jobs.values())

    def job(self, name: str) -> Job:
        """Return a job by its id.

        Raises
        ------
        AbsentError
            There is none.
        """
        if name not in self._jobs:
            raise AbsentError("there is no such job")
        return self._jobs[name]

    def report(self, name: str) -> str:
        """Return the report of a job, HTML.

        Raises
        ------
        AbsentError
            There is none, or it is no longer kept.
        """
        if name not in self._reports:
            raise AbsentError("there is no such report, or it is no longer kept")
        return self._reports[name]

    def start(self, request: JobRequest) -> Job:
        """Start a job.

        Raises
        ------
        OutputExistsError
            One is running.
        """
        if self._task is not None and not self._task.done():
            raise OutputExistsError("an extraction is running", advice="wait for it, or cancel it")
        job = Job(id=secrets.token_hex(6), step="start")
        self._jobs[job.id] = job
        for old in list(self._jobs)[:-_MOST_JOBS]:
            del self._jobs[old]
        self._worker = SurveyWorker(self._app_state.order)
        request = replace(request, name=str(self._app_state.line_file.path))
        self._task = asyncio.create_task(self._run(job.id, request, self._worker))
        return job

    async def cancel(self, name: str) -> Job:
        """Cancel a job and return it: all its processes have ended. A job that is over stays as it is."""
        job, task, worker = self.job(name), self._task, self._worker
        if job.state == "running" and task is not None and worker is not None:
            # The process first: nothing is written while the task ends
            worker.kill()
            task.cancel()
            await asyncio.wait({task})
            if self._jobs[name].state == "running":  # the task had not begun
                self._change(name, state="cancelled")
        return self._jobs[name]

    async def _run(self, name: str, request: JobRequest, worker: SurveyWorker) -> None:
        began = time.monotonic()

        def end(state: str, message: str, **more: Any) -> None:
            self._change(name, state=state, message=message, seconds=time.monotonic() - began, **more)

        try:
            report = await self._extracted(name, request, worker)
        except asyncio.CancelledError:
            # Lines that were saved stay: only the report is missing then
            is_saved = self._jobs[name].counts is not None
            end("done" if is_saved else "cancelled", "ended before its report was written" * is_saved)
        except LineworkError as error:
            end("failed", status_and_message(error)[1])
        except Exception:
            end("failed", _FAULT)
        else:
            self._keep(name, report)
            end("done", self._jobs[name].message, report=True)
        finally:
            worker.kill()

    async def _extracted(self, name: str, request: JobRequest, worker: SurveyWorker) -> str:
        """Save the lines that the job's process finds, sending its progress; return its report."""
        step, began = "", time.monotonic()
        async with worker.request("linework.workbench.jobs.extract:extract_in_worker", request) as extraction:
            async for message in extraction:
                if isinstance(message, JobResult):
                    await self._take(name, request, message)
                    continue
                now, done, total, unit = message
                if now != step:
                    step, began = now, time.monotonic()
                seconds = round(time.monotonic() - began, 2)
                self._change(name, step=step, done=done, total=total, unit=unit, seconds=seconds)
        return str(extraction.result)

    def _keep(self, name: str, report: str) -> None:
        """Keep a report, and drop the oldest ones."""
        self._reports[name] = report
        for old in list(self._reports)[:-_MOST_REPORTS]:
            del self._reports[old]
            self._change(old, report=False)

    async def _take(self, name: str, request: JobRequest, found: JobResult) -> None:
        """Save the lines found; a job that is cancelled meanwhile ends when they are saved."""
        saving = asyncio.ensure_future(self._saved(found, request))
        try:
            await asyncio.shield(saving)
        except asyncio.CancelledError:
            await asyncio.wait({saving})
            raise
        finally:
            if saving.done() and saving.exception() is None:
                self._change(name, counts=found.counts, message=found.message)

    async def _saved(self, found: JobResult, request: JobRequest) -> None:
        """Save the lines found as one change; if a person changed lines meanwhile, try again with theirs."""
        is_saved = False
        while not is_saved:
            with contextlib.suppress(StaleError):
                await save_job_result(self._app_state, found)
                is_saved = True
        await asyncio.to_thread(_discard, Path(self._app_state.facts.work), request)

    def _change(self, name: str, **changes: Any) -> None:
        """Change the state of a job, and send it to all pages."""
        if name not in self._jobs:
            return  # no longer kept
        job = self._jobs[name] = self._jobs[name].model_copy(update=changes)
        self._app_state.broadcaster.send({"type": "job", **job.model_dump()})


def _discard(work: Path, request: JobRequest) -> None:
    # Here and not above, as in `_change_of`: only who extracts needs what these import
    from linework.workbench.jobs.extract import discard_job_lines

    discard_job_lines(work, request)


#: Vertices of the largest change that is sent line by line: after a larger one pages reload what they miss.
_MOST_SENT = 20_000


async def save_job_result(app_state: AppState, found: JobResult) -> None:
    """Save the lines found as one change, and send it to all pages; nothing is saved if nothing changes.

    Raises
    ------
    StaleError
        A line to be replaced has changed meanwhile. Nothing was saved.
    """
    # In threads, so that the server answers while some thousand lines are compared and written
    change = await asyncio.to_thread(_change_of, app_state, found)
    if len(change.before) + len(change.after):
        edit = await asyncio.to_thread(app_state.line_file.commit, change, who=app_state.who)
        app_state.broadcaster.send(await asyncio.to_thread(_message, app_state, edit))


def _change_of(app_state: AppState, found: JobResult) -> Change:
    """Return the change to the lines as they are now: what people accepted, rejected, edited or drew stays."""
    from linework.editing.queue.carried_over import extraction_change

    return extraction_change(
        app_state.line_file.lines, found.lines, list(found.counts), app_state.line_file.judged
    )


def _message(app_state: AppState, edit: Edit) -> dict[str, Any]:
    if len(edit.change.after.xyz) > _MOST_SENT:
        return {"type": "behind"}
    return {"type": "changed", **changed_lines(app_state.line_file, edit).model_dump()}
