"""The server: its routes, put together."""

from __future__ import annotations

from fastapi import FastAPI

from linework.workbench import (
    routes_edits,
    routes_follow,
    routes_jobs,
    routes_pairs,
    routes_pictures,
    routes_review,
    routes_survey,
)
from linework.workbench.bench import Bench

ROUTERS = (
    routes_survey.router, routes_pictures.router, routes_edits.router, routes_review.router,
    routes_follow.router, routes_pairs.router, routes_jobs.router,
)  # fmt: skip


def create_app(bench: Bench) -> FastAPI:
    """Return the application that serves a bench."""
    app = FastAPI(title="linework workbench", docs_url=None, redoc_url=None)
    app.state.bench = bench
    for router in ROUTERS:
        app.include_router(router)
    return app
