"""Routes for the survey, its lines, and a stream of changes.

Separate from `app`, like the routes of every other room.
"""

from __future__ import annotations

import asyncio
import json
from contextlib import suppress
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response, WebSocket, WebSocketDisconnect
from fastapi.responses import JSONResponse

from linework.editing.edits.attributes import CHOICES, choices_for
from linework.files.line_file.file import LineFile
from linework.files.vectors.fields import colour_of
from linework.model.lines import KINDS
from linework.workbench.server.app_state import AppState, CurrentState, state_of_socket
from linework.workbench.server.documents import line_documents
from linework.workbench.server.pictures import class_image, road_image
from linework.workbench.server.problems import hide_paths
from linework.workbench.views.pyramid import IMAGES, Lattice
from linework.workbench.worker.open import SurveyFacts

survey_router = APIRouter(prefix="/api")


@survey_router.get("/health")
async def get_health() -> dict[str, bool]:
    """Report that the server is running."""
    return {"well": True}


@survey_router.get("/survey")
async def get_survey(request: Request, app_state: CurrentState) -> dict[str, Any]:
    """Return the survey being served, with everything the page needs before it requests lines."""
    return survey_document(app_state, busy=request.app.state.busy)


@survey_router.get("/lines", response_class=JSONResponse)
async def get_lines(
    app_state: CurrentState,
    since: Annotated[int, Query(ge=0, le=2**53)] = 0,
) -> Response:
    """Return all lines, or with `since` those added or changed after that revision and the ids of those removed."""
    # In a thread: a million vertices take seconds to encode, which would block the event loop
    content = await asyncio.to_thread(_lines_content, app_state.line_file, since)
    return Response(content, media_type="application/json")


def _lines_content(line_file: LineFile, since: int) -> bytes:
    # Read first, so that a line saved meanwhile is sent twice rather than not at all
    revision = line_file.revision
    found, removed = line_file.since(since if since <= revision else 0)
    parts = (json.dumps(document, allow_nan=False) for document in line_documents(found))
    rest = {"removed": list(removed), "can_undo": line_file.can_undo, "can_redo": line_file.can_redo}
    text = f'{{"revision": {revision}, "lines": [{", ".join(parts)}], {json.dumps(rest)[1:]}'
    return text.encode()


@survey_router.websocket("/live")
async def stream_changes(socket: WebSocket) -> None:
    """Send all messages of the broadcaster to a page, until it disconnects."""
    app_state = state_of_socket(socket)
    await socket.accept()
    with app_state.broadcaster.listening() as messages:

        async def send_all() -> None:
            while True:
                await socket.send_json(await messages.get())

        sending = asyncio.create_task(send_all())
        try:
            # The page sends nothing here: receiving ends when it disconnects
            with suppress(WebSocketDisconnect):
                while True:
                    await socket.receive()
                    if socket.client_state.name == "DISCONNECTED":
                        break
        finally:
            sending.cancel()
            with suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
                await sending


#: Names of the kinds of line, for display.
_TITLES = {
    "lane_marking": "Lane marking",
    "lane_marking_dash": "Dash",
    "road_marking_other": "Other marking",
    "road_boundary": "Road boundary",
    "kerb_top": "Kerb top",
    "edge_other": "Other edge",
    "guardrail": "Guardrail",
    "barrier": "Barrier",
    "fence": "Fence",
    "cable": "Cable",
}
#: Kinds that can be followed from a click in the plan, and in an image.
_PICKED = ("lane_marking", "road_boundary", "guardrail", "barrier", "cable")
_PICKED_IN_IMAGES = ("lane_marking", "road_boundary")


def survey_document(app_state: AppState, *, busy: str) -> dict[str, Any]:
    """Return the survey as the page's type `Survey`."""
    facts, line_file = app_state.facts, app_state.line_file
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
        "lines_file": line_file.path.name,
        "who": app_state.who,
        "kinds": [_kind(kind) for kind in KINDS],
        "choices": {column: list(words) for column, words in CHOICES.items()},
        "choices_of": {
            column: {kind: list(choices_for(column, kind)) for kind in KINDS} for column in CHOICES
        },
        "images": _images(facts),
        "tiles": Lattice.of(facts.bounds).document(),
        "revision": line_file.revision,
        "busy": busy,
    }


def _images(facts: SurveyFacts) -> list[dict[str, Any]]:
    """Return the images of the plan view: of points, and of what the cameras saw."""
    road = [road_image()] if facts.n_pairs else []
    if not facts.n_points:
        return road
    plain: list[dict[str, Any]] = [
        dict(zip(("name", "title", "unit"), image, strict=True)) | {"classes": []} for image in IMAGES
    ]
    return [*plain, class_image(), *road]


def _kind(kind: str) -> dict[str, Any]:
    red, green, blue = colour_of(kind)
    return {
        "kind": kind,
        "title": _TITLES.get(kind, kind.replace("_", " ").capitalize()),
        "colour": f"#{red:02x}{green:02x}{blue:02x}",
        "picked": kind in _PICKED,
        "picked_in_images": kind in _PICKED_IN_IMAGES,
    }
