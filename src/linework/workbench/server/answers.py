"""Answers to errors: one place for all applications.

Separate from `problems`, which worker processes import: they need none of the server's packages.
"""

from __future__ import annotations

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from linework.errors import LineworkError
from linework.workbench.server.problems import FAULT, problem_document, status_and_message


def answer_errors(app: FastAPI) -> None:
    """Let an application answer every error with a problem document."""
    app.add_exception_handler(LineworkError, _own)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(HTTPException, _status)
    app.add_exception_handler(Exception, _fault)


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
