"""Jobs: automatic extractions of the served survey, one at a time, each in a process of its own."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

from linework.editing.queue.carried_over import extraction_change
from linework.errors import AbsentError, LineworkError, OutputExistsError, StaleError
from linework.model.changes import Change, Edit
from linework.workbench.edits.routes import changed_document
from linework.workbench.jobs.extract import JobRequest, JobResult, discard_job_lines, extract_in_worker
from linework.workbench.server.bench import AppState
from linework.workbench.server.problems import status_and_message
from linework.workbench.worker.conversation import SurveyWorker

#: Jobs that are remembered, and reports: some megabytes each, in memory, so that there is no file to clear away.
_MOST_JOBS, _MOST_REPORTS = 20, 3
_FAULT = "a fault of linework, not of your data"


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """How far a job is.

    Parameters
    ----------
    step
        What it is at.
    done, total, unit
        How much of the step is done; total 0: the step has no amounts.
    seconds
        Since the step began; when the job is over, since the job began.
    message
        Why it failed; of a job that is done, what was left out.
    counts
        Lines by kind, when it is done.
    report
        There is one.
    """

    id: str
    state: Literal["running", "done", "failed", "cancelled"] = "running"
    step: str = ""
    done: int = 0
    total: int = 0
    unit: str = ""
    seconds: float = 0.0
    message: str = ""
    counts: Mapping[str, int] | None = None
    report: bool = False

    @property
    def document(self) -> dict[str, Any]:
        """The job as the page gets it."""
        return asdict(self)


class Jobs:
    """The jobs of a bench. Every change of a job is told to all pages."""

    def __init__(self, bench: AppState) -> None:
        self._bench = bench
        self._jobs: dict[str, Job] = {}
        self._reports: dict[str, str] = {}
        self._desk: SurveyWorker | None = None
        self._task: asyncio.Task[None] | None = None

    @property
    def all(self) -> list[Job]:
        """All that are remembered, the first one first."""
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
            There is none, or it is of long ago.
        """
        if name not in self._reports:
            raise AbsentError("there is no such report, or it is no longer kept")
        return self._reports[name]

    def start(self, asked: JobRequest) -> Job:
        """Begin a job.

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
        self._desk = SurveyWorker(self._bench.order)
        asked = replace(asked, name=str(self._bench.drawing.path))
        self._task = asyncio.create_task(self._run(job.id, asked, self._desk))
        return job

    async def cancel(self, name: str) -> Job:
        """End a job: its process and those that work for it are gone when this returns. One that is over stays so."""
        job, task, desk = self.job(name), self._task, self._desk
        if job.state == "running" and task is not None and desk is not None:
            # The process first: nothing is written any more while the task takes in that it is over
            desk.kill()
            task.cancel()
            await asyncio.wait({task})
            if self._jobs[name].state == "running":  # it had not begun
                self._tell(name, state="cancelled")
        return self._jobs[name]

    async def _run(self, name: str, asked: JobRequest, desk: SurveyWorker) -> None:
        began = time.monotonic()

        def end(state: str, message: str, **more: Any) -> None:
            self._tell(name, state=state, message=message, seconds=time.monotonic() - began, **more)

        try:
            report = await self._worked(name, asked, desk)
        except asyncio.CancelledError:
            # What is saved is saved: then it is the report alone that there will not be
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
            desk.kill()

    async def _worked(self, name: str, asked: JobRequest, desk: SurveyWorker) -> str:
        """Save what the job's process finds, telling how far it is; return its report."""
        step, began = "", time.monotonic()
        async with desk.doing(extract_in_worker, asked) as steps:
            async for told in steps:
                if isinstance(told, JobResult):
                    await self._take(name, asked, told)
                    continue
                now, done, total, unit = told
                if now != step:
                    step, began = now, time.monotonic()
                seconds = round(time.monotonic() - began, 2)
                self._tell(name, step=step, done=done, total=total, unit=unit, seconds=seconds)
        return str(steps.value)

    def _keep(self, name: str, report: str) -> None:
        """Keep a report; of those long ago their jobs say that there is none any more."""
        self._reports[name] = report
        for old in list(self._reports)[:-_MOST_REPORTS]:
            del self._reports[old]
            self._tell(old, report=False)

    async def _take(self, name: str, asked: JobRequest, found: JobResult) -> None:
        """Save what was found; a job that is cancelled meanwhile ends when that is done."""
        saving = asyncio.ensure_future(self._saved(found, asked))
        try:
            await asyncio.shield(saving)
        except asyncio.CancelledError:
            await asyncio.wait({saving})
            raise
        finally:
            if saving.done() and saving.exception() is None:
                self._tell(name, counts=found.counts, message=found.message)

    async def _saved(self, found: JobResult, asked: JobRequest) -> None:
        """Save what was found as one change; if a person was quicker, once more with what they left."""
        is_saved = False
        while not is_saved:
            with contextlib.suppress(StaleError):
                await save_job_result(self._bench, found)
                is_saved = True
        await asyncio.to_thread(discard_job_lines, Path(self._bench.facts.work), asked)

    def _tell(self, name: str, **changes: Any) -> None:
        """Note how a job has changed, and tell all pages."""
        if name not in self._jobs:
            return  # of long ago
        job = self._jobs[name] = replace(self._jobs[name], **changes)
        self._bench.hub.tell({"type": "job", **job.document})


# What a job found, put into the drawing as one change

#: A change of more vertices is not told line by line: pages ask for what they miss when they come to it.
_MOST_TOLD = 20_000


async def save_job_result(bench: AppState, found: JobResult) -> None:
    """Save what was found, and tell all pages; where it is what is there already, nothing is saved.

    Raises
    ------
    StaleError
        A line that goes has changed meanwhile. Nothing was saved.
    """
    # In threads, so that the server answers meanwhile: some thousand lines are compared and written
    change = await asyncio.to_thread(_change, bench, found)
    if len(change.before) + len(change.after):
        edit = await asyncio.to_thread(bench.drawing.commit, change, who=bench.who)
        bench.hub.tell(await asyncio.to_thread(_told, bench, edit))


def _change(bench: AppState, found: JobResult) -> Change:
    """Return the change to the drawing as it is now: what people accepted, rejected, edited or drew stays."""
    return extraction_change(bench.drawing.lines, found.lines, list(found.counts), bench.drawing.judged)


def _told(bench: AppState, edit: Edit) -> dict[str, Any]:
    if len(edit.change.after.xyz) > _MOST_TOLD:
        return {"type": "behind"}
    can = {"can_undo": bench.drawing.can_undo, "can_redo": bench.drawing.can_redo}
    return {"type": "changed", **changed_document(edit, **can)}
