"""The web application: all routes, and the answers to errors.

Separate from `serve`, because tests build the application without a server.
"""

from __future__ import annotations

from fastapi import FastAPI

from linework.workbench.edits.routes import edits_router
from linework.workbench.following.routes import follow_router
from linework.workbench.following.templates import template_router
from linework.workbench.jobs.routes import jobs_router
from linework.workbench.review.chainage import chainage_router
from linework.workbench.review.export import export_router
from linework.workbench.review.queue import review_router
from linework.workbench.review.routes import alike_router, evidence_router
from linework.workbench.server.answers import answer_errors
from linework.workbench.server.app_state import AppState
from linework.workbench.server.problems import PROBLEMS
from linework.workbench.server.routes import survey_router
from linework.workbench.views.routes import views_router

ROUTERS = (
    survey_router,
    views_router,
    edits_router,
    review_router,
    evidence_router,
    alike_router,
    follow_router,
    jobs_router,
    chainage_router,
    export_router,
    template_router,
)


def create_app(app_state: AppState) -> FastAPI:
    """Return the application that serves a survey; `linework.workbench.server.guard.Guard` decides who may use it."""
    app = FastAPI(
        title="linework workbench", docs_url=None, redoc_url=None, openapi_url="/api/openapi.json",
        redirect_slashes=False, responses=PROBLEMS,
    )  # fmt: skip
    app.state.app_state, app.state.busy = app_state, ""
    for router in ROUTERS:
        app.include_router(router)
    answer_errors(app)
    return app
