"""Routes of the workbench: changes of lines, undone and done again, and who made them."""

from __future__ import annotations

import asyncio
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header

from linework.errors import UsageError
from linework.files.line_file.history import HistoryEntry
from linework.model.changes import Edit
from linework.workbench.edits.apply import change_of
from linework.workbench.edits.measure import check_reach, inputs_for
from linework.workbench.edits.orders import ChangeOrder
from linework.workbench.server.bench import AppState, state_of_request
from linework.workbench.server.documents import line_documents

edits_router = APIRouter(prefix="/api")
EditState = Annotated[AppState, Depends(state_of_request)]
#: Made by the page for each edit.
Key = Annotated[str, Header(max_length=64, pattern="^[!-~]*$")]
#: So many edits are shown of the history.
MOST_SHOWN = 500


@edits_router.post("/changes")
async def save_edit(order: ChangeOrder, bench: EditState, idempotency_key: Key = "") -> dict[str, Any]:
    """Save an edit; when this answers it is on the disk, and all pages have been told.

    Whoever got no answer sends it again under the same key, and is told what was saved, once.
    """
    done = await asyncio.to_thread(bench.drawing.saved_as, idempotency_key)
    if done is not None:
        return _document(bench, done)
    check_reach(order.edit, bench.facts.bounds)
    given = await inputs_for(order.edit, bench)

    def save() -> Edit:
        made = change_of(order.edit, bench.drawing.lines, given)
        return bench.drawing.commit(made, who=bench.who, based_on=order.revision, key=idempotency_key)

    return _told(bench, await asyncio.to_thread(save))


@edits_router.post("/undo")
async def undo_edit(bench: EditState) -> dict[str, Any]:
    """Take back the last edit."""
    edit = await asyncio.to_thread(lambda: bench.drawing.undo(who=bench.who))
    if edit is None:
        raise UsageError("there is nothing to undo", where="undo", advice="edit something first")
    return _told(bench, edit)


@edits_router.post("/redo")
async def redo_edit(bench: EditState) -> dict[str, Any]:
    """Do again what was undone last."""
    edit = await asyncio.to_thread(lambda: bench.drawing.redo(who=bench.who))
    if edit is None:
        raise UsageError("there is nothing to do again", where="redo", advice="undo something first")
    return _told(bench, edit)


@edits_router.get("/history")
async def get_history(bench: EditState) -> list[dict[str, Any]]:
    """Return the last edits, the newest first."""

    def documents() -> list[dict[str, Any]]:
        undone = bench.drawing.undone
        return [
            _record(entry, is_undone=entry.number in undone) for entry in bench.drawing.entries(MOST_SHOWN)
        ]

    return await asyncio.to_thread(documents)


def changed_document(edit: Edit, *, can_undo: bool, can_redo: bool) -> dict[str, Any]:
    """Return a saved edit as `Changed` of the page's types says it."""
    before, after = edit.change.before, edit.change.after
    return {
        "revision": edit.number,
        "lines": line_documents(after),
        "removed": sorted(set(before.id.tolist()) - set(after.id.tolist())),
        "action": edit.change.action.partition(" ")[0],
        "number": edit.number,
        "can_undo": can_undo,
        "can_redo": can_redo,
    }


def _told(bench: AppState, edit: Edit) -> dict[str, Any]:
    """Tell all pages of an edit; return what they are told."""
    document = _document(bench, edit)
    bench.hub.tell({"type": "changed", **document})
    return document


def _document(bench: AppState, edit: Edit) -> dict[str, Any]:
    return changed_document(edit, can_undo=bench.drawing.can_undo, can_redo=bench.drawing.can_redo)


def _record(entry: HistoryEntry, *, is_undone: bool) -> dict[str, Any]:
    return {
        "number": entry.number,
        "time_utc": entry.time_utc,
        "who": entry.who,
        "action": entry.action,
        "ids": list(entry.ids),
        "undoes": entry.undoes,
        "undone": is_undone,
    }
