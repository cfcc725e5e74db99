"""Routes of the workbench: jobs, the automatic extractions that run beside it."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, Path, Request, Response
from pydantic import BaseModel, ConfigDict, Field

from linework.errors import InputError, UsageError
from linework.methods.kinds import ALL_KINDS, check_method, findable_kinds, kinds_of_method, parse_kinds
from linework.workbench.jobs.extract import JobRequest
from linework.workbench.jobs.jobs import Jobs
from linework.workbench.server.bench import state_of_request
from linework.workbench.server.guard import REPORT_POLICY

jobs_router = APIRouter(prefix="/api")


class JobOrder(BaseModel):
    """What to look for, all kinds of the method if none is named, and how."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    features: Annotated[list[Annotated[str, Field(max_length=40)]], Field(max_length=len(ALL_KINDS))] = []
    method: Literal["auto", "obb", "radon", "stereo"] = "auto"


def jobs_of(request: Request) -> Jobs:
    """Return the jobs of a bench."""
    state = request.app.state
    if not hasattr(state, "jobs"):
        state.jobs = Jobs(state_of_request(request))
    jobs: Jobs = state.jobs
    return jobs


JobsState = Annotated[Jobs, Depends(jobs_of)]
Name = Annotated[str, Path(min_length=1, max_length=40)]


@jobs_router.get("/jobs")
async def get_jobs(jobs: JobsState) -> list[dict[str, Any]]:
    """Return the jobs since the server started, the first one first."""
    return [job.document for job in jobs.all]


@jobs_router.post("/jobs")
async def start_job(order: JobOrder, request: Request, jobs: JobsState) -> dict[str, Any]:
    """Begin an extraction; there is one at a time."""
    facts = state_of_request(request).facts
    return jobs.start(_asked(order, has_points=facts.n_points > 0)).document


@jobs_router.delete("/jobs/{name}")
async def cancel_job(name: Name, jobs: JobsState) -> dict[str, Any]:
    """End a job at once; one that is over stays as it is."""
    return (await jobs.cancel(name)).document


@jobs_router.get("/jobs/{name}/report", response_class=Response)
async def get_job_report(name: Name, jobs: JobsState) -> Response:
    """Return the report of a job that is done: a page of its own, which may do nothing."""
    return Response(
        jobs.report(name), media_type="text/html", headers={"Content-Security-Policy": REPORT_POLICY}
    )


def _asked(order: JobOrder, *, has_points: bool) -> JobRequest:
    """Return what a page asks for, checked.

    Raises
    ------
    InputError
        A kind that the method, or this survey, does not show.
    """
    try:
        kinds = parse_kinds(",".join(order.features)) if order.features else kinds_of_method(order.method)
        check_method(order.method, kinds)
        kinds = findable_kinds(kinds, has_points=has_points, asked=False)
    except UsageError as error:
        # Its options are those of the command
        raise InputError(error.problem, advice=error.advice) from error
    if not kinds or (order.method not in ("auto", "stereo") and not has_points):
        raise InputError("nothing of this can be found without laser points, and the survey has none",
                         advice="look for markings in the images")  # fmt: skip
    return JobRequest(kinds=kinds, method=order.method)
