"""Inputs of an edit beside the lines: heights measured at its places, and the followed line that it saves.

Separate from `apply`, because it waits for a worker; `apply` works on values alone.
"""

from __future__ import annotations

import asyncio

import numpy as np

from linework.arrays import FloatArray
from linework.editing.edits.new_lines import places_beside
from linework.errors import UsageError
from linework.lines.companions import MEDIAN_KINDS
from linework.workbench.edits.apply import EditInputs
from linework.workbench.edits.orders import (
    AddDashes,
    AddPartner,
    AddWires,
    DrawBeside,
    DrawLine,
    DrawWire,
    EditOrder,
    InsertVertex,
    KeepTrace,
    LinesBeside,
    MoveVertex,
    PlanPosition,
    SpacePosition,
    positions_of,
)
from linework.workbench.following.templates import template_of_survey
from linework.workbench.following.traces import INTERRUPT, kept_trace
from linework.workbench.server.app_state import AppState
from linework.workbench.server.documents import lines_of

#: Largest distance of a place from the survey: wires may lead out of it, by no more than scanners reach. [m]
SURVEY_REACH_M = 300.0
#: Range of heights of the earth's surface, and of what stands on it. [m]
LOWEST_ON_EARTH_M, HIGHEST_ON_EARTH_M = -1_000.0, 10_000.0


def check_reach(edit: EditOrder, bounds: tuple[float, float, float, float]) -> None:
    """Refuse places far from the survey, or at impossible heights.

    Parameters
    ----------
    bounds
        West, south, east, north of the survey. [m, world]

    Raises
    ------
    UsageError
        Names the distance or the height of the first such place.
    """
    west, south, east, north = bounds
    for place in positions_of(edit):
        away_m = max(west - place[0], place[0] - east, south - place[1], place[1] - north)
        if away_m > SURVEY_REACH_M:
            raise UsageError(
                f"the place is {away_m:.0f} m outside the survey, {SURVEY_REACH_M:.0f} m at most",
                where=edit.action,
                advice="choose a place on the plan",
            )
        if len(place) == 3 and not LOWEST_ON_EARTH_M <= place[-1] <= HIGHEST_ON_EARTH_M:
            raise UsageError(
                f"a height of {place[-1]:.0f} m is impossible",
                where=edit.action,
                advice=f"{LOWEST_ON_EARTH_M:.0f} to {HIGHEST_ON_EARTH_M:.0f} m",
            )


async def inputs_for(edit: EditOrder, app_state: AppState) -> EditInputs:
    """Return the inputs of an edit; heights are measured where it names none.

    Raises
    ------
    AbsentError
        The line does not exist.
    UsageError
        The followed line is no longer available.
    """
    if isinstance(edit, KeepTrace):
        trace = kept_trace(app_state, edit.trace)
        return EditInputs(kept=trace.lines, beside=trace.beside)
    if isinstance(edit, LinesBeside):
        line = lines_of(app_state.line_file.lines, [edit.id])
        template = await asyncio.to_thread(template_of_survey, app_state, edit.template)
        async with app_state.tracing.request(
            "linework.workbench.following.beside:template_beside", line, template
        ) as request:
            with app_state.traces.interruptible(lambda: request.send(INTERRUPT)):
                async for _ in request:
                    pass
        if request.result is None:
            raise UsageError(
                "interrupted: a line is followed", where=edit.action, advice="ask for the template again"
            )
        return EditInputs(beside=request.result.lines)
    if isinstance(edit, AddWires):
        line = lines_of(app_state.line_file.lines, [edit.id])
        if str(line.kind[0]) != "cable":
            raise UsageError(f"a {line.kind[0]} is not a wire", where=edit.action, advice="select a cable")
        return EditInputs(
            wires=await app_state.tracing.ask("linework.workbench.following.wires:wires_in_worker", line.xyz)
        )
    if isinstance(edit, AddPartner):
        line = lines_of(app_state.line_file.lines, [edit.id])
        if str(line.kind[0]) not in MEDIAN_KINDS:
            raise UsageError(
                f"a {line.kind[0]} has no partner on a median", where=edit.action,
                advice="select a guardrail or a barrier",
            )  # fmt: skip
        return EditInputs(
            beside=await app_state.tracing.ask(
                "linework.workbench.following.wires:partners_in_worker", line.xyz
            )
        )
    if isinstance(edit, AddDashes):
        return EditInputs(spans=await _dash_spans(edit, app_state))
    if isinstance(edit, DrawBeside):
        line = lines_of(app_state.line_file.lines, [edit.id])
        places = places_beside(line, edit.kind, np.array(edit.at))
        heights = await app_state.pictures.ask(
            "linework.workbench.views.heights:heights_at", edit.kind, places.tolist()
        )
        return EditInputs(heights=np.column_stack(heights))
    if not isinstance(edit, DrawLine | DrawWire | MoveVertex | InsertVertex):
        return EditInputs()
    return EditInputs(heights=await _heights(edit, app_state))


async def _dash_spans(edit: AddDashes, app_state: AppState) -> dict[str, FloatArray]:
    """Return (k, 2) spans of dashes that the paint along lines shows [m], by id."""
    chosen = lines_of(app_state.line_file.lines, edit.ids)
    return {
        str(chosen.id[k]): await app_state.pictures.ask(
            "linework.workbench.review.paint:dash_spans", chosen[k].xyz, float(chosen.width_m[k])
        )
        for k in np.flatnonzero(chosen.kind == "lane_marking").tolist()
    }


async def _heights(edit: DrawLine | DrawWire | MoveVertex | InsertVertex, app_state: AppState) -> FloatArray:
    """Return (k, 2) heights and sigmas at the places of an edit [m], NaN where it names the height itself."""
    places, kind, line = positions_of(edit), "cable", np.zeros((0, 3))
    if isinstance(edit, DrawLine):
        kind = edit.kind
    elif isinstance(edit, MoveVertex | InsertVertex):
        one = lines_of(app_state.line_file.lines, [edit.id])
        kind, line = str(one.kind[0]), one.xyz
    heights = np.full((len(places), 2), np.nan)
    missing = [i for i, place in enumerate(places) if len(place) == 2]
    if missing:
        wanted = [(*places[i], _height_near(line, places[i])) for i in missing]
        heights[missing] = np.column_stack(
            await app_state.pictures.ask("linework.workbench.views.heights:heights_at", kind, wanted)
        )
    return heights


def _height_near(line: FloatArray, place: PlanPosition | SpacePosition) -> float:
    """Return the height of a line (n, 3) near a place [m], to choose among cables above each other; NaN without a line."""
    if len(line) == 0:
        return float("nan")
    return float(line[int(np.argmin(np.hypot(line[:, 0] - place[0], line[:, 1] - place[1]))), 2])
