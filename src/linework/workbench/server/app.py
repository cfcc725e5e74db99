"""The server: its routes, put together, and what it answers when something goes wrong."""

from __future__ import annotations

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from linework.errors import LineworkError
from linework.workbench.edits import routes as routes_edits
from linework.workbench.following import routes as routes_follow
from linework.workbench.jobs import routes as routes_jobs
from linework.workbench.review import queue as routes_review
from linework.workbench.server import routes as routes_survey
from linework.workbench.server.bench import AppState
from linework.workbench.server.problems import PROBLEMS, problem_document, status_and_message
from linework.workbench.views import routes as routes_pairs
from linework.workbench.views import routes as routes_pictures

ROUTERS = (
    routes_survey.survey_router, routes_pictures.views_router, routes_edits.edits_router, routes_review.review_router,
    routes_follow.follow_router, routes_pairs.views_router, routes_jobs.jobs_router,
)  # fmt: skip

#: Said of a fault of ours: what it is is in the log, which does not go to the page.
FAULT = "a fault of linework, not of your data; the log is saved, linework serve says where"


def create_app(bench: AppState) -> FastAPI:
    """Return the application that serves a bench; who may ask it is for `guard.Guard` to say."""
    app = FastAPI(
        title="linework workbench", docs_url=None, redoc_url=None, openapi_url="/api/openapi.json",
        redirect_slashes=False, responses=PROBLEMS,
    )  # fmt: skip
    app.state.bench, app.state.busy = bench, ""
    for router in ROUTERS:
        app.include_router(router)
    app.add_exception_handler(LineworkError, _own)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(HTTPException, _told)
    app.add_exception_handler(Exception, _fault)
    return app


async def _own(_request: Request, error: Exception) -> JSONResponse:
    """Answer what was raised on purpose."""
    assert isinstance(error, LineworkError)
    status, line = status_and_message(error)
    return JSONResponse(problem_document(line, status), status)


async def _fault(_request: Request, _error: Exception) -> JSONResponse:
    """Answer what must never happen; the error itself goes on to the guard, which saves the log."""
    return JSONResponse(problem_document(FAULT, 500), 500)


async def _told(_request: Request, error: Exception) -> JSONResponse:
    """Answer what a route, or the lack of one, says by a status."""
    assert isinstance(error, HTTPException)
    document = problem_document(str(error.detail), error.status_code)
    return JSONResponse(document, error.status_code, headers=dict(error.headers or {}))


async def _invalid(_request: Request, error: Exception) -> JSONResponse:
    """Answer a request that is not as the route wants it: what is first wrong with it."""
    assert isinstance(error, RequestValidationError)
    first = error.errors()[0]
    place = ".".join(str(part) for part in first["loc"][1:] or first["loc"])
    return JSONResponse(problem_document(f"{place}: {first['msg']}"[:300], 422), 422)
