"""Routes for what the page shows: tiles, points, sections, heights, and stereo pairs with their images."""

from __future__ import annotations

import asyncio
import math
import time
from contextlib import suppress
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Path, Query, Request, Response
from fastapi.responses import JSONResponse
from pydantic import Field

from linework.errors import LineworkError
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.workbench.server.app_state import AppState, CurrentState
from linework.workbench.server.documents import Document, lines_of
from linework.workbench.server.pictures import (
    CLASS_IMAGE,
    FARTHEST_OFFSET_M,
    FARTHEST_SNAP_M,
    LEAST_SNAP_M,
    MOST_SHOWN_POINTS,
    ROAD_IMAGE,
    THICKEST_M,
    WIDEST_M,
    CameraSide,
    no_such_pair_error,
)
from linework.workbench.views.pyramid import Lattice, MapTile

views_router = APIRouter(prefix="/api")

#: Zoom, column or row of a tile; those outside the survey are empty.
TileIndex = Annotated[int, Path(ge=-(2**31), le=2**31)]
#: Largest coordinate, as in the point store. [m]
FARTHEST_QUERY_M = 1e8
QueryMetres = Annotated[float, Query(ge=-FARTHEST_QUERY_M, le=FARTHEST_QUERY_M, allow_inf_nan=False)]
Coordinate = Annotated[float, Field(ge=-FARTHEST_QUERY_M, le=FARTHEST_QUERY_M, allow_inf_nan=False)]
#: Most places of one query: a line has a vertex a metre, and nobody drags two kilometres at once.
MOST_PLACES = 2000
_BINARY = "application/octet-stream"


class HeightsQuery(Document):
    """Query for the heights of a kind of line at places."""

    kind: Annotated[str, Field(max_length=40)]
    places: Annotated[
        list[Annotated[list[Coordinate], Field(min_length=2, max_length=3)]], Field(max_length=MOST_PLACES)
    ]


#: For OpenAPI.
NO_CONTENT: dict[int | str, dict[str, Any]] = {204: {"description": "Nothing there"}}


@views_router.get("/tiles/{image}/{z}/{col}/{row}", response_class=Response, responses=NO_CONTENT)
async def get_tile(
    request: Request,
    app_state: CurrentState,
    image: str,
    z: TileIndex,
    col: TileIndex,
    row: TileIndex,
) -> Response:
    """Return an image of a tile as PNG, or 204 for a tile without points."""
    prefetcher = prefetcher_of(request, app_state)
    prefetcher.note_request()
    wanted = Lattice.of(app_state.facts.bounds).tile(z, col, row)
    is_there = app_state.facts.n_pairs if image == ROAD_IMAGE else app_state.facts.n_points
    if wanted is None or not is_there:
        return Response(status_code=204)
    async with prefetcher.turn:
        # While the user pans fast, tiles that are no longer in view are not made
        if await request.is_disconnected():
            return Response(status_code=204)
        if image == ROAD_IMAGE:
            png: bytes = await app_state.pictures.ask(
                "linework.workbench.road_image.picture:road_tile_png", wanted
            )
        elif image == CLASS_IMAGE:
            near = await asyncio.to_thread(_lines_near_tile, app_state.line_file.lines, wanted)
            png = await app_state.pictures.ask(
                "linework.workbench.views.point_classes:class_tile_png", wanted, near
            )
        else:
            png = await app_state.pictures.ask("linework.workbench.views.tiles:tile_png", image, wanted)
    if not png:
        return Response(status_code=204)
    return Response(png, media_type="image/png", headers={"Cache-Control": "no-store"})


def _lines_near_tile(lines: LineSet, tile: MapTile) -> LineSet:
    # Imports what classifies points: only where classes are looked at
    from linework.workbench.views.point_classes import lines_near_tile

    return lines_near_tile(lines, tile)


@views_router.get("/points", response_class=Response)
async def get_points(
    app_state: CurrentState, west: QueryMetres, south: QueryMetres, east: QueryMetres, north: QueryMetres,
    most: Annotated[int, Query(ge=1, le=MOST_SHOWN_POINTS)], low: QueryMetres | None = None, high: QueryMetres | None = None,
) -> Response:  # fmt: skip
    """Return points of a rectangle, evenly thinned to `most`, between two heights if given."""
    heights = -math.inf if low is None else low, math.inf if high is None else high
    bounds = Bounds(west, south, east, north)
    return Response(
        await app_state.pictures.ask(
            "linework.workbench.views.points:points_of_place", bounds, most, heights
        ),
        media_type=_BINARY,
    )


@views_router.get("/section", response_class=Response)
async def get_section(
    app_state: CurrentState, east: QueryMetres, north: QueryMetres,
    heading_deg: Annotated[float, Query(ge=-720.0, le=720.0, allow_inf_nan=False)],
    half_width_m: Annotated[float, Query(gt=0.0, le=WIDEST_M, allow_inf_nan=False)],
    thickness_m: Annotated[float, Query(gt=0.0, le=THICKEST_M, allow_inf_nan=False)],
) -> Response:  # fmt: skip
    """Return the points of a section across a heading, from a place: x to the right, y along it."""
    section = (east, north), heading_deg, half_width_m, thickness_m
    return Response(
        await app_state.pictures.ask("linework.workbench.views.points:section_at", *section),
        media_type=_BINARY,
    )


@views_router.get("/straightened", response_class=Response)
async def get_straightened(
    app_state: CurrentState, from_m: QueryMetres, to_m: QueryMetres,
    half_width_m: Annotated[float, Query(gt=0.0, le=FARTHEST_OFFSET_M, allow_inf_nan=False)],
    line: Annotated[str, Query(max_length=200)] = "",
) -> Response:  # fmt: skip
    """Return the points along a stretch of a line, or without one of the van's path: x chainage, y offset to the right."""
    path = (
        lines_of(app_state.line_file.lines, [line]).xyz
        if line
        else np.array(app_state.facts.path).reshape(-1, 3)
    )
    stretch = path, from_m, to_m, half_width_m
    return Response(
        await app_state.pictures.ask("linework.workbench.views.straightened:straightened_points", *stretch),
        media_type=_BINARY,
    )


@views_router.get("/search-area")
async def get_search_area(app_state: CurrentState, east: QueryMetres, north: QueryMetres) -> dict[str, Any]:
    """Return what the search area about a place shows: its points, its floor, and the histogram of intensities."""
    found: dict[str, Any] = await app_state.pictures.ask(
        "linework.workbench.views.search_area:search_area_document", (east, north)
    )
    return found


@views_router.post("/heights")
async def get_heights(app_state: CurrentState, wanted: HeightsQuery) -> dict[str, list[float | None]]:
    """Return the height of a line of a kind at places, and its sigma [m]; null where it is unknown."""
    found = await app_state.pictures.ask(
        "linework.workbench.views.heights:heights_at", wanted.kind, wanted.places
    )
    height, sigma = ([None if np.isnan(v) else round(float(v), 4) for v in values] for values in found)
    return {"heights": height, "sigmas": sigma}


@views_router.get("/snap")
async def get_snapped(
    app_state: CurrentState, east: QueryMetres, north: QueryMetres,
    kind: Annotated[str, Query(max_length=40)],
    reach_m: Annotated[float, Query(ge=LEAST_SNAP_M, le=FARTHEST_SNAP_M, allow_inf_nan=False)],
    heading_deg: Annotated[float | None, Query(ge=-720.0, le=720.0, allow_inf_nan=False)] = None,
) -> dict[str, Any]:  # fmt: skip
    """Return the place on the edge near a place, for a line of a kind; `found` is null where none is visible."""
    found = await app_state.pictures.ask(
        "linework.workbench.views.snap:snapped_place", kind, (east, north), reach_m, heading_deg
    )
    return {"found": found}


def prefetcher_of(request: Request, app_state: AppState) -> TilePrefetcher:
    """Return the prefetcher of tiles, one for a server."""
    state = request.app.state
    if not hasattr(state, "prefetcher"):
        state.prefetcher = TilePrefetcher(app_state)
    prefetcher: TilePrefetcher = state.prefetcher
    return prefetcher


# Prefetching: tiles that no page has asked for yet are made while the pictures worker is idle

#: Time without a request after which the worker is idle. [s]
IDLE_S = 0.3
#: Shortest time between messages about the progress. [s]
REPORT_S = 1.0


class TilePrefetcher:
    """Makes all tiles of a survey, one by one, while no page asks for a picture.

    Pages get messages ``{"type": "pictures", "done": n, "total": m}``: when all are made, coarse tiles that were shown in
    part are complete.
    """

    def __init__(self, app_state: AppState) -> None:
        self._app_state = app_state
        self._task: asyncio.Task[None] | None = None
        self._requested_s = 0.0
        #: Held by the request for a tile; the others wait.
        self.turn = asyncio.Lock()

    def note_request(self) -> None:
        """Note a request, after which prefetching pauses; the first one starts it."""
        self._requested_s = time.monotonic()
        if self._task is None and self._app_state.facts.n_points:
            self._task = asyncio.create_task(self._run())

    async def _run(self) -> None:
        reported_s, done, total, n_made = 0.0, 0, 1, 0
        # Pictures work without prefetching, and a request for one reports what is wrong
        with suppress(LineworkError, RuntimeError):
            while total:
                while (idle_s := time.monotonic() - self._requested_s) < IDLE_S:
                    await asyncio.sleep(IDLE_S - idle_s)
                before, n_made = total, n_made + 1
                done, total = await self._app_state.pictures.ask(
                    "linework.workbench.views.tiles:prepare_tiles"
                )
                if total and time.monotonic() - reported_s >= REPORT_S:
                    reported_s = time.monotonic()
                    self._report(done, total)
            # The last step makes none; if all were made before, there is nothing to report
            if n_made > 1:
                self._report(before, before)

    def _report(self, done: int, total: int) -> None:
        self._app_state.broadcaster.send({"type": "pictures", "done": done, "total": total})


# Stereo pairs, their images, and the lines in them; the operator's keys

#: Number of a pair: the page names no files.
PairNumber = Annotated[int, Path(ge=0, lt=2**31)]


@views_router.get("/pairs")
async def get_pairs(request: Request, app_state: CurrentState) -> list[dict[str, Any]]:
    """Return the usable stereo pairs, in time order."""
    found: list[dict[str, Any]] | None = getattr(request.app.state, "pairs", None)
    if found is None:
        found = request.app.state.pairs = await app_state.pictures.ask(
            "linework.workbench.views.pairs:list_pairs"
        )
    return found


@views_router.get("/keys")
async def get_keys(app_state: CurrentState) -> list[dict[str, Any]]:
    """Return the operator's keys, in time order."""
    found: list[dict[str, Any]] = await app_state.pictures.ask("linework.workbench.views.pairs:list_keys")
    return found


@views_router.get("/pairs/{number}/thumbnail", response_class=Response)
async def get_thumbnail(number: PairNumber, app_state: CurrentState) -> Response:
    """Return a thumbnail of the left image of a pair."""
    return Response(
        await app_state.pictures.ask("linework.workbench.views.pairs:thumbnail_jpeg", number),
        media_type="image/jpeg",
    )


@views_router.get("/pairs/{number}/lines", response_class=JSONResponse)
async def get_pair_lines(number: PairNumber, request: Request, app_state: CurrentState) -> Response:
    """Return the lines projected into both images of a pair."""
    pair = next((pair for pair in await get_pairs(request, app_state) if pair["number"] == number), None)
    if pair is None:
        raise no_such_pair_error(number)
    lines = await asyncio.to_thread(_lines_near_camera, app_state.line_file.lines, tuple(pair["at"]))
    shown = await app_state.pictures.ask("linework.workbench.views.pairs:lines_in_pair", number, lines)
    return Response(shown, media_type="application/json")


def _lines_near_camera(lines: LineSet, place: tuple[float, float]) -> LineSet:
    # Imports what projects lines: only where images are looked at
    from linework.workbench.views.pairs import lines_near_camera

    return lines_near_camera(lines, place)


@views_router.get("/pairs/{number}/{side}", response_class=Response)
async def get_image(number: PairNumber, side: CameraSide, app_state: CurrentState) -> Response:
    """Return an image as it was taken."""
    return Response(
        await app_state.pictures.ask("linework.workbench.views.pairs:image_jpeg", number, side),
        media_type="image/jpeg",
    )
