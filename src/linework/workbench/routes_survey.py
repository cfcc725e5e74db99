"""Routes of the workbench: what is served, its lines, and what happens to them."""

from __future__ import annotations

import asyncio
import json
from contextlib import suppress
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query, Request, Response, WebSocket, WebSocketDisconnect
from fastapi.responses import JSONResponse

from linework.files.drawing import DrawingFile
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


@router.get("/lines", response_class=JSONResponse)
async def lines(
    bench: Annotated[Bench, Depends(bench_of)], since: Annotated[int, Query(ge=0, le=2**53)] = 0
) -> Response:
    """Return all lines; after a revision, those that came or changed since, and the ids of those that went."""
    # A drawing of a million vertices takes seconds to write down: not on the server's loop
    content = await asyncio.to_thread(_lines_content, bench.drawing, since)
    return Response(content, media_type="application/json")


def _lines_content(drawing: DrawingFile, since: int) -> bytes:
    # Asked for first: what is saved meanwhile comes twice rather than never
    revision = drawing.revision
    found, removed = drawing.since(since if since <= revision else 0)
    parts = (json.dumps(document, allow_nan=False) for document in line_documents(found))
    rest = {"removed": list(removed), "can_undo": drawing.can_undo, "can_redo": drawing.can_redo}
    text = f'{{"revision": {revision}, "lines": [{", ".join(parts)}], {json.dumps(rest)[1:]}'
    return text.encode()


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
