"""Routes for edits of lines: save, undo, redo, and the history."""

from __future__ import annotations

import asyncio
from typing import Annotated, Any

from fastapi import APIRouter, Header

from linework.errors import UsageError
from linework.files.line_file.file import LineFile
from linework.files.line_file.history import HistoryEntry
from linework.model.changes import Edit
from linework.workbench.edits.orders import ChangeOrder
from linework.workbench.server.app_state import AppState, CurrentState
from linework.workbench.server.documents import Document, line_documents

edits_router = APIRouter(prefix="/api")
#: Idempotency key that the page makes for each edit.
Key = Annotated[str, Header(max_length=64, pattern="^[!-~]*$")]
#: Edits of the history that are shown.
MOST_SHOWN = 500


class ChangedLines(Document):
    """A saved edit, as the page gets it.

    Parameters
    ----------
    revision, number
        Of the line file after the edit, and of the edit in its history.
    lines, removed
        Lines that are new or changed (see `line_documents`), and ids of those that are gone.
    """

    revision: int
    lines: list[dict[str, Any]]
    removed: list[str]
    action: str
    number: int
    can_undo: bool
    can_redo: bool


class HistoryRecord(Document):
    """An edit of the history, as the page gets it; `undoes`: number of the edit that it undoes or redoes, 0: none."""

    number: int
    time_utc: str
    who: str
    action: str
    ids: list[str]
    undoes: int
    undone: bool


@edits_router.post("/changes")
async def save_edit(order: ChangeOrder, app_state: CurrentState, idempotency_key: Key = "") -> ChangedLines:
    """Save an edit; when this answers it is on the disk, and has been sent to all pages.

    A page that got no answer sends it again under the same key: it is saved once, and answered again.
    """
    done = await asyncio.to_thread(app_state.line_file.saved_as, idempotency_key)
    if done is not None:
        return changed_lines(app_state.line_file, done)
    await asyncio.to_thread(import_edits)
    from linework.workbench.edits.apply import change_of
    from linework.workbench.edits.measure import check_reach, inputs_for

    check_reach(order.edit, app_state.facts.bounds)
    inputs = await inputs_for(order.edit, app_state)

    def save() -> Edit:
        made = change_of(order.edit, app_state.line_file.lines, inputs)
        return app_state.line_file.commit(
            made, who=app_state.who, based_on=order.revision, key=idempotency_key
        )

    return _broadcast(app_state, await asyncio.to_thread(save))


def import_edits() -> None:
    """Import what makes edits, which takes two seconds the first time: no page waits for it before the first edit."""
    import linework.workbench.edits.measure  # noqa: F401


@edits_router.post("/undo")
async def undo_edit(app_state: CurrentState) -> ChangedLines:
    """Undo the last edit."""
    edit = await asyncio.to_thread(lambda: app_state.line_file.undo(who=app_state.who))
    if edit is None:
        raise UsageError("there is nothing to undo", where="undo", advice="edit something first")
    return _broadcast(app_state, edit)


@edits_router.post("/redo")
async def redo_edit(app_state: CurrentState) -> ChangedLines:
    """Redo the edit that was undone last."""
    edit = await asyncio.to_thread(lambda: app_state.line_file.redo(who=app_state.who))
    if edit is None:
        raise UsageError("there is nothing to redo", where="redo", advice="undo something first")
    return _broadcast(app_state, edit)


@edits_router.get("/history")
async def get_history(app_state: CurrentState) -> list[HistoryRecord]:
    """Return the last edits, the newest first."""

    def records() -> list[HistoryRecord]:
        undone = app_state.line_file.undone
        return [
            _history_record(entry, is_undone=entry.number in undone)
            for entry in app_state.line_file.entries(MOST_SHOWN)
        ]

    return await asyncio.to_thread(records)


def changed_lines(line_file: LineFile, edit: Edit) -> ChangedLines:
    """Return a saved edit as the page gets it."""
    before, after = edit.change.before, edit.change.after
    return ChangedLines(
        revision=edit.number,
        lines=line_documents(after),
        removed=sorted(set(before.id.tolist()) - set(after.id.tolist())),
        action=edit.change.action.partition(" ")[0],
        number=edit.number,
        can_undo=line_file.can_undo,
        can_redo=line_file.can_redo,
    )


def _broadcast(app_state: AppState, edit: Edit) -> ChangedLines:
    """Send an edit to all pages, and return what they get."""
    changed = changed_lines(app_state.line_file, edit)
    app_state.broadcaster.send({"type": "changed", **changed.model_dump()})
    return changed


def _history_record(entry: HistoryEntry, *, is_undone: bool) -> HistoryRecord:
    return HistoryRecord(
        number=entry.number,
        time_utc=entry.time_utc,
        who=entry.who,
        action=entry.action,
        ids=list(entry.ids),
        undoes=entry.undoes,
        undone=is_undone,
    )
