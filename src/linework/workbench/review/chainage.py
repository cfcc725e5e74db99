"""The report by chainage of the lines as they are saved now: a page of its own, without scripts.

Separate from the other routes of the review: it needs matplotlib, which is imported when it is asked for.
"""

from __future__ import annotations

import asyncio
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response

from linework.files.line_file.file import LineFile
from linework.model.lines import REJECTED_REVIEW
from linework.workbench.server.app_state import CurrentState
from linework.workbench.server.guard import REPORT_POLICY

chainage_router = APIRouter(prefix="/api")


@chainage_router.get("/chainage", response_class=Response)
async def get_chainage_report(
    app_state: CurrentState,
    every_m: Annotated[float, Query(ge=1.0, le=10_000.0)] = 10.0,
    standard: Literal["", "us", "uk", "de"] = "",
) -> Response:
    """Return the report of all lines that are not rejected, along the longest of them."""
    page = await asyncio.to_thread(chainage_page_of, app_state.line_file, every_m, standard)
    return Response(page, media_type="text/html", headers={"Content-Security-Policy": REPORT_POLICY})


def chainage_page_of(line_file: LineFile, every_m: float, standard: str) -> str:
    """Return the report by chainage, HTML.

    Raises
    ------
    InputError
        No line along a road is long enough to refer to.
    """
    from linework.crs import describe_crs
    from linework.evaluation.chainage.page import chainage_page
    from linework.evaluation.chainage.routes import own_routes
    from linework.evaluation.chainage.rows import chainage_report

    lines = line_file.lines
    lines = lines[lines.review != REJECTED_REVIEW]
    axes = own_routes(lines)
    result = chainage_report(lines, axes, every_m=every_m, standard=standard)
    named = ", ".join(axis.name for axis in axes)
    facts = {
        "lines": f"{line_file.path.name} ({len(lines):,})", "chainage along": f"the lines themselves: {named}",
        "interval": f"{every_m:g} m", "limits": standard or "none", "CRS": describe_crs(lines.crs),
    }  # fmt: skip
    return chainage_page(result, lines, facts, title=f"Report of {line_file.path.name}")
