"""Routes of the workbench: what is served, its lines, and what happens to them."""

from __future__ import annotations

import asyncio
import json
from contextlib import suppress
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query, Request, Response, WebSocket, WebSocketDisconnect
from fastapi.responses import JSONResponse

from linework.editing.edits.attributes import CHOICES
from linework.files.line_file.file import LineFile
from linework.files.vectors.fields import colour_of
from linework.model.lines import KINDS
from linework.workbench.server.bench import AppState, state_of_request, state_of_socket
from linework.workbench.server.documents import line_documents
from linework.workbench.server.problems import hide_paths
from linework.workbench.views.pyramid import IMAGES, Lattice
from linework.workbench.worker.open import SurveyFacts

survey_router = APIRouter(prefix="/api")


@survey_router.get("/health")
async def get_health() -> dict[str, bool]:
    """Say that the server answers."""
    return {"well": True}


@survey_router.get("/survey")
async def get_survey(
    request: Request, bench: Annotated[AppState, Depends(state_of_request)]
) -> dict[str, Any]:
    """Return what is served, and all that the page needs to know before the first line."""
    return survey_document(bench, busy=request.app.state.busy)


@survey_router.get("/lines", response_class=JSONResponse)
async def get_lines(
    bench: Annotated[AppState, Depends(state_of_request)], since: Annotated[int, Query(ge=0, le=2**53)] = 0
) -> Response:
    """Return all lines; after a revision, those that came or changed since, and the ids of those that went."""
    # A drawing of a million vertices takes seconds to write down: not on the server's loop
    content = await asyncio.to_thread(_lines_content, bench.drawing, since)
    return Response(content, media_type="application/json")


def _lines_content(drawing: LineFile, since: int) -> bytes:
    # Asked for first: what is saved meanwhile comes twice rather than never
    revision = drawing.revision
    found, removed = drawing.since(since if since <= revision else 0)
    parts = (json.dumps(document, allow_nan=False) for document in line_documents(found))
    rest = {"removed": list(removed), "can_undo": drawing.can_undo, "can_redo": drawing.can_redo}
    text = f'{{"revision": {revision}, "lines": [{", ".join(parts)}], {json.dumps(rest)[1:]}'
    return text.encode()


@survey_router.websocket("/live")
async def stream_changes(socket: WebSocket) -> None:
    """Tell a page what happens, until it leaves."""
    bench = state_of_socket(socket)
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


# What the page is told of the survey before anything else

#: Kinds as the trade calls them.
_TITLES = {
    "lane_marking": "Lane marking",
    "lane_marking_dash": "Dash",
    "road_marking_other": "Other marking",
    "road_boundary": "Road boundary",
    "kerb_top": "Kerb top",
    "guardrail": "Guardrail",
    "barrier": "Barrier",
    "fence": "Fence",
    "cable": "Cable",
}
#: Kinds that a place can be picked on: in points, and in images.
_PICKED = ("lane_marking", "road_boundary", "guardrail", "barrier", "cable")
_PICKED_IN_IMAGES = ("lane_marking", "road_boundary")


def survey_document(bench: AppState, *, busy: str) -> dict[str, Any]:
    """Return the survey as `Survey` of the page's types says it."""
    facts, drawing = bench.facts, bench.drawing
    return {
        "name": facts.name,
        "crs": facts.crs_name,
        "bounds": list(facts.bounds),
        "middle": list(facts.middle),
        "heights": list(facts.heights),
        "n_points": facts.n_points,
        "n_pairs": facts.n_pairs,
        "path": [list(place) for place in facts.path],
        "warnings": [hide_paths(warning) for warning in facts.warnings],
        "lines_file": drawing.path.name,
        "who": bench.who,
        "kinds": [_kind(kind) for kind in KINDS],
        "choices": {column: list(words) for column, words in CHOICES.items()},
        "images": [dict(zip(("name", "title", "unit"), image, strict=True)) for image in _images(facts)],
        "tiles": Lattice.of(facts.bounds).document(),
        "revision": drawing.revision,
        "busy": busy,
    }


def _images(facts: SurveyFacts) -> tuple[tuple[str, str, str], ...]:
    """Return what the plan view can show: images are made of points."""
    return IMAGES if facts.n_points else ()


def _kind(kind: str) -> dict[str, Any]:
    red, green, blue = colour_of(kind)
    return {
        "kind": kind,
        "title": _TITLES[kind],
        "colour": f"#{red:02x}{green:02x}{blue:02x}",
        "picked": kind in _PICKED,
        "picked_in_images": kind in _PICKED_IN_IMAGES,
    }
