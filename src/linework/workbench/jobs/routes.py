"""Routes for jobs: automatic extractions that run beside the workbench."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Path, Request, Response
from pydantic import Field

from linework.errors import InputError, UsageError
from linework.methods.kinds import ALL_KINDS, check_method, findable_kinds, kinds_of_method, parse_kinds
from linework.workbench.jobs.jobs import Job, Jobs
from linework.workbench.jobs.orders import JobRequest
from linework.workbench.server.app_state import state_of_request
from linework.workbench.server.documents import Document
from linework.workbench.server.guard import REPORT_POLICY

jobs_router = APIRouter(prefix="/api")


class JobOrder(Document):
    """Kinds to extract, all kinds of the method if none is named, and the method."""

    features: Annotated[
        tuple[Annotated[str, Field(max_length=40)], ...], Field(max_length=len(ALL_KINDS))
    ] = ()
    method: Literal["auto", "obb", "radon", "stereo"] = "auto"


def jobs_of(request: Request) -> Jobs:
    """Return the jobs of the application that got a request."""
    state = request.app.state
    if not hasattr(state, "jobs"):
        state.jobs = Jobs(state_of_request(request))
    jobs: Jobs = state.jobs
    return jobs


JobsState = Annotated[Jobs, Depends(jobs_of)]
Name = Annotated[str, Path(min_length=1, max_length=40)]


@jobs_router.get("/jobs")
async def get_jobs(jobs: JobsState) -> list[Job]:
    """Return the jobs since the server started, the oldest first."""
    return jobs.all


@jobs_router.post("/jobs")
async def start_job(order: JobOrder, request: Request, jobs: JobsState) -> Job:
    """Start an extraction; only one runs at a time."""
    facts = state_of_request(request).facts
    return jobs.start(_request_of(order, has_points=facts.n_points > 0))


@jobs_router.delete("/jobs/{name}")
async def cancel_job(name: Name, jobs: JobsState) -> Job:
    """Cancel a job; one that is over stays as it is."""
    return await jobs.cancel(name)


@jobs_router.get("/jobs/{name}/report", response_class=Response)
async def get_job_report(name: Name, jobs: JobsState) -> Response:
    """Return the report of a job that is done: a page of its own, without scripts."""
    return Response(
        jobs.report(name), media_type="text/html", headers={"Content-Security-Policy": REPORT_POLICY}
    )


def _request_of(order: JobOrder, *, has_points: bool) -> JobRequest:
    """Return the request of a page, checked.

    Raises
    ------
    InputError
        A kind that the method, or this survey, cannot give.
    """
    try:
        kinds = parse_kinds(",".join(order.features)) if order.features else kinds_of_method(order.method)
        check_method(order.method, kinds)
        kinds = findable_kinds(kinds, has_points=has_points, asked=False)
    except UsageError as error:
        # The error names options of the command line, which the page does not have
        raise InputError(error.problem, advice=error.advice) from error
    if not kinds or (order.method not in ("auto", "stereo") and not has_points):
        raise InputError("nothing of this can be found without laser points, and the survey has none",
                         advice="look for markings in the images")  # fmt: skip
    return JobRequest(kinds=kinds, method=order.method)
