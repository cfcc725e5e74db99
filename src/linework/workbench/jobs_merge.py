"""What a job found, put into the drawing as one change."""

from __future__ import annotations

import asyncio
from typing import Any

import numpy as np

from linework.model.changes import Change, Edit
from linework.model.lines import LineSet
from linework.workbench.bench import Bench
from linework.workbench.jobs_extract import Found
from linework.workbench.routes_edits import changed_document

#: A change of more vertices is not told line by line: pages ask for what they miss when they come to it.
_MOST_TOLD = 20_000


async def save_found(bench: Bench, found: Found) -> Edit:
    """Save what was found, and tell all pages.

    Raises
    ------
    StaleError
        A line that goes has changed meanwhile. Nothing was saved.
    """
    # In threads, so that the server answers meanwhile: some thousand lines are compared and written
    change = await asyncio.to_thread(_change, bench.drawing.lines, found)
    edit = await asyncio.to_thread(bench.drawing.commit, change, who=bench.who)
    bench.hub.tell(await asyncio.to_thread(_told, bench, edit))
    return edit


def _change(drawn: LineSet, found: Found) -> Change:
    is_old = np.isin(drawn.kind, np.array(list(found.counts), dtype=np.str_)) & (drawn.review == "")
    kept = set(drawn.id[~is_old].tolist())
    ids = np.array(["" if name in kept else name for name in found.lines.id.tolist()], dtype=np.str_)
    return Change("extract", drawn.take(is_old), found.lines.with_columns(id=ids))


def _told(bench: Bench, edit: Edit) -> dict[str, Any]:
    if len(edit.change.after.xyz) > _MOST_TOLD:
        return {"type": "behind"}
    can = {"can_undo": bench.drawing.can_undo, "can_redo": bench.drawing.can_redo}
    return {"type": "changed", **changed_document(edit, **can)}
