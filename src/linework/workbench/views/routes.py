"""Routes of the workbench: tiles of the plan view, points, cross-sections, heights."""

from __future__ import annotations

import asyncio
import math
import time
from contextlib import suppress
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Depends, Path, Query, Request, Response
from fastapi import Path as PathPart
from fastapi.responses import JSONResponse
from pydantic import BaseModel, ConfigDict, Field

from linework.errors import LineworkError
from linework.model.grid import Bounds
from linework.workbench.server.bench import AppState, state_of_request
from linework.workbench.views.heights import heights_at
from linework.workbench.views.pairs import (
    CameraSide,
    image_jpeg,
    lines_in_pair,
    lines_near_camera,
    list_keys,
    list_pairs,
    no_such_pair_error,
    thumbnail_jpeg,
)
from linework.workbench.views.points import (
    MOST_SHOWN_POINTS,
    THICKEST_M,
    WIDEST_M,
    points_of_place,
    section_at,
)
from linework.workbench.views.pyramid import Lattice
from linework.workbench.views.tiles import prepare_tiles, tile_png

views_router = APIRouter(prefix="/api")

CurrentState = Annotated[AppState, Depends(state_of_request)]
#: Also where the page's numbers are no tile of the survey: they are numbers all the same.
MapTileNumber = Annotated[int, PathPart(ge=-(2**31), le=2**31)]
#: Coordinates lie within this, as in the point store. [m]
FARTHEST_QUERY_M = 1e8
QueryMetres = Annotated[float, Query(ge=-FARTHEST_QUERY_M, le=FARTHEST_QUERY_M, allow_inf_nan=False)]
Coordinate = Annotated[float, Field(ge=-FARTHEST_QUERY_M, le=FARTHEST_QUERY_M, allow_inf_nan=False)]
#: A line has a vertex a metre; nobody drags more than a kilometre at once.
MOST_PLACES = 2000
_BINARY = "application/octet-stream"


class HeightsQuery(BaseModel):
    """Places whose heights are asked for, for a kind of line."""

    model_config = ConfigDict(extra="forbid")
    kind: Annotated[str, Field(max_length=40)]
    places: Annotated[
        list[Annotated[list[Coordinate], Field(min_length=2, max_length=3)]], Field(max_length=MOST_PLACES)
    ]


#: For OpenAPI.
NO_CONTENT: dict[int | str, dict[str, Any]] = {204: {"description": "Nothing there"}}


@views_router.get("/tiles/{image}/{z}/{col}/{row}", response_class=Response, responses=NO_CONTENT)
async def get_tile(
    request: Request,
    bench: CurrentState,
    image: str,
    z: MapTileNumber,
    col: MapTileNumber,
    row: MapTileNumber,
) -> Response:
    """Return an image of a tile as PNG, or 204 where there is nothing."""
    ahead = prefetcher_of(request, bench)
    ahead.asked()
    wanted = Lattice.of(bench.facts.bounds).tile(z, col, row)
    if wanted is None or not bench.facts.n_points:
        return Response(status_code=204)
    async with ahead.turn:
        # Who pans fast has long gone on: what is no longer looked at is not made
        if await request.is_disconnected():
            return Response(status_code=204)
        png: bytes = await bench.pictures.ask(tile_png, image, wanted)
    if not png:
        return Response(status_code=204)
    return Response(png, media_type="image/png", headers={"Cache-Control": "no-store"})


@views_router.get("/points", response_class=Response)
async def get_points(
    bench: CurrentState, west: QueryMetres, south: QueryMetres, east: QueryMetres, north: QueryMetres,
    most: Annotated[int, Query(ge=1, le=MOST_SHOWN_POINTS)], low: QueryMetres | None = None, high: QueryMetres | None = None,
) -> Response:  # fmt: skip
    """Return points of a rectangle, evenly thinned to `most`, between two heights if they are given."""
    heights = -math.inf if low is None else low, math.inf if high is None else high
    bounds = Bounds(west, south, east, north)
    return Response(await bench.pictures.ask(points_of_place, bounds, most, heights), media_type=_BINARY)


@views_router.get("/section", response_class=Response)
async def get_section(
    bench: CurrentState, east: QueryMetres, north: QueryMetres,
    heading_deg: Annotated[float, Query(ge=-720.0, le=720.0, allow_inf_nan=False)],
    half_width_m: Annotated[float, Query(gt=0.0, le=WIDEST_M, allow_inf_nan=False)],
    thickness_m: Annotated[float, Query(gt=0.0, le=THICKEST_M, allow_inf_nan=False)],
) -> Response:  # fmt: skip
    """Return the points of a slice across a heading: x to the right of it, y along it, from the place."""
    slice_ = (east, north), heading_deg, half_width_m, thickness_m
    return Response(await bench.pictures.ask(section_at, *slice_), media_type=_BINARY)


@views_router.post("/heights")
async def get_heights(bench: CurrentState, wanted: HeightsQuery) -> dict[str, list[float | None]]:
    """Return how high a line of a kind is at places, and how sure that is; null where no point tells."""
    found = await bench.pictures.ask(heights_at, wanted.kind, wanted.places)
    height, sigma = ([None if np.isnan(v) else round(float(v), 4) for v in values] for values in found)
    return {"heights": height, "sigmas": sigma}


def prefetcher_of(request: Request, bench: AppState) -> TilePrefetcher:
    """Return what makes the tiles that nobody has asked for yet, one for a server."""
    state = request.app.state
    if not hasattr(state, "ahead"):
        state.ahead = TilePrefetcher(bench)
    ahead: TilePrefetcher = state.ahead
    return ahead


# Tiles that nobody has asked for yet: made at the desk of pictures while it has nothing else to do

#: Nobody has asked for so long: then the desk is idle. [s]
IDLE_S = 0.3
#: Pages are told how far it is so often. [s]
TOLD_S = 1.0


class TilePrefetcher:
    """Makes all tiles of a survey, one by one, whenever nobody asks for a picture.

    Pages are told ``{"type": "pictures", "done": n, "total": m}``: when all are there, also those of the coarse tiles
    that were shown in part are whole.
    """

    def __init__(self, bench: AppState) -> None:
        self._bench = bench
        self._task: asyncio.Task[None] | None = None
        self._asked_s = 0.0
        #: Held by whoever asks for a tile; the others wait.
        self.turn = asyncio.Lock()

    def asked(self) -> None:
        """Note that somebody asks now; the first who asks starts it."""
        self._asked_s = time.monotonic()
        if self._task is None and self._bench.facts.n_points:
            self._task = asyncio.create_task(self._run())

    async def _run(self) -> None:
        told_s, done, total, n_made = 0.0, 0, 1, 0
        # Without them there are pictures all the same: whoever asks for one is told what is wrong
        with suppress(LineworkError, RuntimeError):
            while total:
                while (idle_s := time.monotonic() - self._asked_s) < IDLE_S:
                    await asyncio.sleep(IDLE_S - idle_s)
                before, n_made = total, n_made + 1
                done, total = await self._bench.pictures.ask(prepare_tiles)
                if total and time.monotonic() - told_s >= TOLD_S:
                    told_s = time.monotonic()
                    self._tell(done, total)
            # The last step makes none: of what was there already nobody need be told
            if n_made > 1:
                self._tell(before, before)

    def _tell(self, done: int, total: int) -> None:
        self._bench.hub.tell({"type": "pictures", "done": done, "total": total})


# Routes of the workbench: stereo pairs, their images, and the lines in them; the operator's keys

#: No path from the page: pairs have numbers.
PairNumber = Annotated[int, Path(ge=0, lt=2**31)]
PairState = Annotated[AppState, Depends(state_of_request)]


@views_router.get("/pairs")
async def get_pairs(request: Request, bench: PairState) -> list[dict[str, Any]]:
    """Return the stereo pairs that can be used, in time order."""
    found: list[dict[str, Any]] | None = getattr(request.app.state, "pairs", None)
    if found is None:
        found = request.app.state.pairs = await bench.pictures.ask(list_pairs)
    return found


@views_router.get("/keys")
async def get_keys(bench: PairState) -> list[dict[str, Any]]:
    """Return the operator's keys, in time order."""
    found: list[dict[str, Any]] = await bench.pictures.ask(list_keys)
    return found


@views_router.get("/pairs/{number}/thumbnail", response_class=Response)
async def get_thumbnail(number: PairNumber, bench: PairState) -> Response:
    """Return the left image of a pair, small."""
    return Response(await bench.pictures.ask(thumbnail_jpeg, number), media_type="image/jpeg")


@views_router.get("/pairs/{number}/lines", response_class=JSONResponse)
async def get_pair_lines(number: PairNumber, request: Request, bench: PairState) -> Response:
    """Return where both images of a pair show the lines."""
    pair = next((pair for pair in await get_pairs(request, bench) if pair["number"] == number), None)
    if pair is None:
        raise no_such_pair_error(number)
    lines = lines_near_camera(bench.drawing.lines, tuple(pair["at"]))
    shown = await bench.pictures.ask(lines_in_pair, number, lines)
    return Response(shown, media_type="application/json")


@views_router.get("/pairs/{number}/{side}", response_class=Response)
async def get_image(number: PairNumber, side: CameraSide, bench: PairState) -> Response:
    """Return an image as it was taken."""
    return Response(await bench.pictures.ask(image_jpeg, number, side), media_type="image/jpeg")
