"""Routes of the workbench: tiles of the plan view, points, cross-sections, heights."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi import Path as PathPart
from pydantic import BaseModel, ConfigDict, Field

from linework.model.grid import Bounds
from linework.workbench.bench import Bench, bench_of
from linework.workbench.heights import heights_at
from linework.workbench.pictures import tile_png
from linework.workbench.pictures_ahead import Ahead
from linework.workbench.point_detail import MOST_POINTS, points_of_place
from linework.workbench.sections import THICKEST_M, WIDEST_M, section_at
from linework.workbench.tiles import Lattice

router = APIRouter(prefix="/api")

TheBench = Annotated[Bench, Depends(bench_of)]
#: Also where the page's numbers are no tile of the survey: they are numbers all the same.
Number = Annotated[int, PathPart(ge=-(2**31), le=2**31)]
#: Coordinates lie within this, as in the point store. [m]
FARTHEST_M = 1e8
Metres = Annotated[float, Query(ge=-FARTHEST_M, le=FARTHEST_M, allow_inf_nan=False)]
Coordinate = Annotated[float, Field(ge=-FARTHEST_M, le=FARTHEST_M, allow_inf_nan=False)]
#: A line has a vertex a metre; nobody drags more than a kilometre at once.
MOST_PLACES = 2000
_BINARY = "application/octet-stream"


class Places(BaseModel):
    """Places whose heights are asked for, for a kind of line."""

    model_config = ConfigDict(extra="forbid")
    kind: Annotated[str, Field(max_length=40)]
    places: Annotated[
        list[Annotated[list[Coordinate], Field(min_length=2, max_length=3)]], Field(max_length=MOST_PLACES)
    ]


#: For OpenAPI.
NOTHING: dict[int | str, dict[str, Any]] = {204: {"description": "Nothing there"}}


@router.get("/tiles/{image}/{z}/{col}/{row}", response_class=Response, responses=NOTHING)
async def tile(
    request: Request, bench: TheBench, image: str, z: Number, col: Number, row: Number
) -> Response:
    """Return an image of a tile as PNG, or 204 where there is nothing."""
    ahead = ahead_of(request, bench)
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


@router.get("/points", response_class=Response)
async def points(
    bench: TheBench, west: Metres, south: Metres, east: Metres, north: Metres,
    most: Annotated[int, Query(ge=1, le=MOST_POINTS)], low: Metres | None = None, high: Metres | None = None,
) -> Response:  # fmt: skip
    """Return points of a rectangle, evenly thinned to `most`, between two heights if they are given."""
    heights = -math.inf if low is None else low, math.inf if high is None else high
    bounds = Bounds(west, south, east, north)
    return Response(await bench.pictures.ask(points_of_place, bounds, most, heights), media_type=_BINARY)


@router.get("/section", response_class=Response)
async def section(
    bench: TheBench, east: Metres, north: Metres,
    heading_deg: Annotated[float, Query(ge=-720.0, le=720.0, allow_inf_nan=False)],
    half_width_m: Annotated[float, Query(gt=0.0, le=WIDEST_M, allow_inf_nan=False)],
    thickness_m: Annotated[float, Query(gt=0.0, le=THICKEST_M, allow_inf_nan=False)],
) -> Response:  # fmt: skip
    """Return the points of a slice across a heading: x to the right of it, y along it, from the place."""
    slice_ = (east, north), heading_deg, half_width_m, thickness_m
    return Response(await bench.pictures.ask(section_at, *slice_), media_type=_BINARY)


@router.post("/heights")
async def heights(bench: TheBench, wanted: Places) -> dict[str, list[float | None]]:
    """Return how high a line of a kind is at places, and how sure that is; null where no point tells."""
    found = await bench.pictures.ask(heights_at, wanted.kind, wanted.places)
    height, sigma = ([None if np.isnan(v) else round(float(v), 4) for v in values] for values in found)
    return {"heights": height, "sigmas": sigma}


def ahead_of(request: Request, bench: Bench) -> Ahead:
    """Return what makes the tiles that nobody has asked for yet, one for a server."""
    state = request.app.state
    if not hasattr(state, "ahead"):
        state.ahead = Ahead(bench)
    ahead: Ahead = state.ahead
    return ahead
