"""The web application: all routes, and the answers to errors.

Separate from `serve`, because tests build the application without a server.
"""

from __future__ import annotations

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from linework.errors import LineworkError
from linework.workbench.edits.routes import edits_router
from linework.workbench.following.routes import follow_router
from linework.workbench.jobs.routes import jobs_router
from linework.workbench.review.queue import review_router
from linework.workbench.server.app_state import AppState
from linework.workbench.server.problems import PROBLEMS, problem_document, status_and_message
from linework.workbench.server.routes import survey_router
from linework.workbench.views.routes import views_router

ROUTERS = (survey_router, views_router, edits_router, review_router, follow_router, jobs_router)

#: Answer to a fault of ours: the details are in the log, which the page does not get.
FAULT = "a fault of linework, not of your data; the log is saved, linework serve says where"


def create_app(app_state: AppState) -> FastAPI:
    """Return the application that serves a survey; `linework.workbench.server.guard.Guard` decides who may use it."""
    app = FastAPI(
        title="linework workbench", docs_url=None, redoc_url=None, openapi_url="/api/openapi.json",
        redirect_slashes=False, responses=PROBLEMS,
    )  # fmt: skip
    app.state.app_state, app.state.busy = app_state, ""
    for router in ROUTERS:
        app.include_router(router)
    app.add_exception_handler(LineworkError, _own)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(HTTPException, _status)
    app.add_exception_handler(Exception, _fault)
    return app


async def _own(_request: Request, error: Exception) -> JSONResponse:
    """Answer an error that was raised on purpose."""
    assert isinstance(error, LineworkError)
    status, line = status_and_message(error)
    return JSONResponse(problem_document(line, status), status)


async def _fault(_request: Request, _error: Exception) -> JSONResponse:
    """Answer a fault of ours; the guard gets the error too, and saves the log."""
    return JSONResponse(problem_document(FAULT, 500), 500)


async def _status(_request: Request, error: Exception) -> JSONResponse:
    """Answer a status raised by a route, or by the lack of one."""
    assert isinstance(error, HTTPException)
    document = problem_document(str(error.detail), error.status_code)
    return JSONResponse(document, error.status_code, headers=dict(error.headers or {}))


async def _invalid(_request: Request, error: Exception) -> JSONResponse:
    """Answer an invalid request with the first thing that is wrong with it."""
    assert isinstance(error, RequestValidationError)
    first = error.errors()[0]
    place = ".".join(str(part) for part in first["loc"][1:] or first["loc"])
    return JSONResponse(problem_document(f"{place}: {first['msg']}"[:300], 422), 422)
