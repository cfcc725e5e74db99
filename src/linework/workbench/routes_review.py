"""Routes of the workbench: the review queue."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Depends, Request

from linework.workbench.bench import Bench, bench_of
from linework.workbench.queue import ReviewQueue
from linework.workbench.queue_at_desk import suspects_at_desk

router = APIRouter(prefix="/api")


@router.get("/queue")
async def queue(request: Request, bench: Annotated[Bench, Depends(bench_of)]) -> list[dict[str, Any]]:
    """Return what is worth a look, the most promising first."""
    kept: ReviewQueue | None = getattr(request.app.state, "queue", None)
    if kept is None:
        kept = request.app.state.queue = ReviewQueue(
            bench.drawing, lambda lines: bench.pictures.ask(suspects_at_desk, lines)
        )
    return await kept.documents()
