"""Routes of the workbench: stereo pairs, their images, and the lines in them; the operator's keys."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Depends, Path, Request, Response
from fastapi.responses import JSONResponse

from linework.workbench.bench import Bench, bench_of
from linework.workbench.pairs import (
    Side,
    image_at_desk,
    keys_at_desk,
    near,
    no_pair,
    pair_lines_at_desk,
    pairs_at_desk,
    thumbnail_at_desk,
)

router = APIRouter(prefix="/api")
#: No path from the page: pairs have numbers.
Number = Annotated[int, Path(ge=0, lt=2**31)]
Served = Annotated[Bench, Depends(bench_of)]


@router.get("/pairs")
async def pairs(request: Request, bench: Served) -> list[dict[str, Any]]:
    """Return the stereo pairs that can be used, in time order."""
    found: list[dict[str, Any]] | None = getattr(request.app.state, "pairs", None)
    if found is None:
        found = request.app.state.pairs = await bench.pictures.ask(pairs_at_desk)
    return found


@router.get("/keys")
async def keys(bench: Served) -> list[dict[str, Any]]:
    """Return the operator's keys, in time order."""
    found: list[dict[str, Any]] = await bench.pictures.ask(keys_at_desk)
    return found


@router.get("/pairs/{number}/thumbnail", response_class=Response)
async def thumbnail(number: Number, bench: Served) -> Response:
    """Return the left image of a pair, small."""
    return Response(await bench.pictures.ask(thumbnail_at_desk, number), media_type="image/jpeg")


@router.get("/pairs/{number}/lines", response_class=JSONResponse)
async def pair_lines(number: Number, request: Request, bench: Served) -> Response:
    """Return where both images of a pair show the lines."""
    pair = next((pair for pair in await pairs(request, bench) if pair["number"] == number), None)
    if pair is None:
        raise no_pair(number)
    lines = near(bench.drawing.lines, tuple(pair["at"]))
    shown = await bench.pictures.ask(pair_lines_at_desk, number, lines)
    return Response(shown, media_type="application/json")


@router.get("/pairs/{number}/{side}", response_class=Response)
async def image(number: Number, side: Side, bench: Served) -> Response:
    """Return an image as it was taken."""
    return Response(await bench.pictures.ask(image_at_desk, number, side), media_type="image/jpeg")
