"""Routes of the workbench: what is served, its lines, and what happens to them."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query, Request, WebSocket, WebSocketDisconnect

from linework.workbench.bench import Bench, bench_of, bench_of_socket
from linework.workbench.survey_document import survey_document
from linework.workbench.wire import line_documents

router = APIRouter(prefix="/api")


@router.get("/health")
async def health() -> dict[str, bool]:
    """Say that the server answers."""
    return {"well": True}


@router.get("/survey")
async def survey(request: Request, bench: Annotated[Bench, Depends(bench_of)]) -> dict[str, Any]:
    """Return what is served, and all that the page needs to know before the first line."""
    return survey_document(bench, busy=request.app.state.busy)


@router.get("/lines")
async def lines(
    bench: Annotated[Bench, Depends(bench_of)], since: Annotated[int, Query(ge=0, le=2**53)] = 0
) -> dict[str, Any]:
    """Return all lines; after a revision, those that came or changed since, and the ids of those that went."""
    drawing = bench.drawing
    if 0 < since == drawing.revision:
        return {"revision": drawing.revision, "lines": [], "removed": []}
    return {"revision": drawing.revision, "lines": line_documents(drawing.lines), "removed": []}


@router.websocket("/live")
async def live(socket: WebSocket) -> None:
    """Tell a page what happens, until it leaves."""
    bench = bench_of_socket(socket)
    await socket.accept()
    with bench.hub.listening() as news:

        async def tell() -> None:
            while True:
                await socket.send_json(await news.get())

        telling = asyncio.create_task(tell())
        try:
            # The page says nothing here: what is waited for is that it leaves
            with suppress(WebSocketDisconnect):
                while True:
                    await socket.receive()
                    if socket.client_state.name == "DISCONNECTED":
                        break
        finally:
            telling.cancel()
            with suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
                await telling
