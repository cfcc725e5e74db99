"""What a job found, put into the drawing as one change."""

from __future__ import annotations

import asyncio
from typing import Any

from linework.lines.reviewed import extraction_change
from linework.model.changes import Change, Edit
from linework.workbench.bench import Bench
from linework.workbench.jobs_extract import Found
from linework.workbench.routes_edits import changed_document

#: A change of more vertices is not told line by line: pages ask for what they miss when they come to it.
_MOST_TOLD = 20_000


async def save_found(bench: Bench, found: Found) -> None:
    """Save what was found, and tell all pages; where it is what is there already, nothing is saved.

    Raises
    ------
    StaleError
        A line that goes has changed meanwhile. Nothing was saved.
    """
    # In threads, so that the server answers meanwhile: some thousand lines are compared and written
    change = await asyncio.to_thread(_change, bench, found)
    if len(change.before) + len(change.after):
        edit = await asyncio.to_thread(bench.drawing.commit, change, who=bench.who)
        bench.hub.tell(await asyncio.to_thread(_told, bench, edit))


def _change(bench: Bench, found: Found) -> Change:
    """Return the change to the drawing as it is now: what people accepted, rejected, edited or drew stays."""
    return extraction_change(bench.drawing.lines, found.lines, list(found.counts), bench.drawing.judged)


def _told(bench: Bench, edit: Edit) -> dict[str, Any]:
    if len(edit.change.after.xyz) > _MOST_TOLD:
        return {"type": "behind"}
    can = {"can_undo": bench.drawing.can_undo, "can_redo": bench.drawing.can_redo}
    return {"type": "changed", **changed_document(edit, **can)}
