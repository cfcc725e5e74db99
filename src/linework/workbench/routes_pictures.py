"""Routes of the workbench: tiles of the plan view, points, cross-sections, heights."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Depends, Request, Response
from fastapi import Path as PathPart

from linework.workbench.bench import Bench, bench_of
from linework.workbench.pictures import tile_png
from linework.workbench.pictures_ahead import Ahead
from linework.workbench.tiles import Lattice

router = APIRouter(prefix="/api")

TheBench = Annotated[Bench, Depends(bench_of)]
#: Also where the page's numbers are no tile of the survey: no number is too large to be read.
Number = Annotated[int, PathPart(ge=-(2**53), le=2**53)]


@router.get("/tiles/{image}/{z}/{col}/{row}", response_class=Response)
async def tile(
    request: Request, bench: TheBench, image: str, z: Number, col: Number, row: Number
) -> Response:
    """Return an image of a tile as PNG, or 204 where there is nothing."""
    ahead_of(request, bench).asked()
    lattice = Lattice.of(bench.facts.bounds)
    wanted = lattice.tile(z, col, row)
    if wanted is None or not bench.facts.n_points:
        return Response(status_code=204)
    png: bytes = await bench.pictures.ask(tile_png, image, wanted, lattice.coarsest)
    if not png:
        return Response(status_code=204)
    return Response(png, media_type="image/png", headers={"Cache-Control": "no-store"})


def ahead_of(request: Request, bench: Bench) -> Ahead:
    """Return what makes the tiles that nobody has asked for yet, one for a server."""
    state = request.app.state
    if not hasattr(state, "ahead"):
        state.ahead = Ahead(bench)
    ahead: Ahead = state.ahead
    return ahead
