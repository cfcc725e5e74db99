"""Routes of the review: the evidence of an item of the queue, and the lines in which the same fault may be.

Separate from `evidence` and `alike`, which import the kernels that look at points: the server names them.
"""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from fastapi import APIRouter, Query, Request

from linework.workbench.server.app_state import CurrentState
from linework.workbench.server.documents import Document, lines_of

if TYPE_CHECKING:
    from linework.arrays import FloatArray

evidence_router = APIRouter(prefix="/api")
_Metres = Annotated[float, Query(ge=-1e8, le=1e8, allow_inf_nan=False)]


@evidence_router.get("/evidence")
async def get_evidence(
    app_state: CurrentState,
    kind: Annotated[str, Query(max_length=40)],
    east: _Metres,
    north: _Metres,
    line: Annotated[str, Query(max_length=200)] = "",
    beyond: bool = False,
) -> dict[str, Any]:
    """Return what the points show of a line about a place, or beyond its end there; without a line, of a missing one."""
    xyz = (
        lines_of(app_state.line_file.lines, [line]).xyz
        if line
        else np.array(app_state.facts.path).reshape(-1, 3)
    )
    if len(xyz) < 2 or not app_state.facts.n_points:
        return {"across": None, "along": None, "facts": []}
    found: dict[str, Any] = await app_state.pictures.ask(
        "linework.workbench.review.evidence:evidence_at", kind, xyz, (east, north), not line, beyond
    )
    return found


alike_router = APIRouter(prefix="/api")


class AlikeItem(Document):
    """A line in which the same fault may be, as the page gets it.

    Parameters
    ----------
    at, box
        East and north of its middle, and west, south, east, north around it. [m, world]
    reason
        In what it is like the example, in words.
    is_very
        It is very much like it (`VERY_LIKE_CHANCE`); no reason to take it in without a look, see decision 106.
    """

    id: str
    at: list[float]
    box: list[float]
    length_m: float
    reason: str
    is_very: bool


class AlikeLines(Document):
    """What an edit taught: `mend` is the edit for all, without ids; None: the edit teaches nothing."""

    edit: int
    kind: str
    mend: dict[str, Any] | None
    n_looked: int
    items: list[AlikeItem]


@alike_router.get("/alike")
async def get_alike(
    request: Request, app_state: CurrentState, edit: Annotated[int, Query(ge=1, le=2**53)]
) -> AlikeLines:
    """Return the lines in which the fault may be that an edit mended; none once the page that asked has gone."""
    await asyncio.to_thread(_import_alike)
    from linework.workbench.review import alike

    none = AlikeLines(edit=edit, kind="", mend=None, n_looked=0, items=[])
    taught = await asyncio.to_thread(alike.taught_by_edit, app_state.line_file, edit)
    if taught is None:
        return none
    lines, chosen = await asyncio.to_thread(lambda: alike.population_of(taught, app_state.line_file.lines))
    own = lines.take(chosen)
    parts: list[dict[str, FloatArray]] = []
    # The worker makes pictures, too, and gets no request that is long: pictures go between
    for first in range(0, len(own), alike.MEASURED_AT_ONCE):
        if await request.is_disconnected():
            return none
        part = own.take(range(first, min(first + alike.MEASURED_AT_ONCE, len(own))))
        parts.append(await app_state.pictures.ask("linework.workbench.review.alike:points_in_worker", part))
    measures = await app_state.pictures.ask("linework.workbench.review.alike:lines_in_worker", lines, chosen)
    measures |= {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    found = await asyncio.to_thread(alike.alike_of, taught, own, measures)
    items = [alike.alike_item(own.take([one.line]), one) for one in found[: alike.MOST_ALIKE]]
    return AlikeLines(edit=edit, kind=taught.kind, mend=taught.mend, n_looked=len(own), items=items)


def _import_alike() -> None:
    import linework.workbench.review.alike  # noqa: F401
