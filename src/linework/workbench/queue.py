"""The review queue: what is worth a look, until somebody has settled it."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Container, Iterable, Sequence
from typing import Any

from linework.files.drawing import DrawingFile
from linework.files.drawing_history import Entry
from linework.lines.suspected import Suspect
from linework.model.lines import LineSet

#: What the action of an edit begins with that says that there is nothing to do.
DISMISS = "dismiss "
#: So many things are shown: what comes after them is not worth a look today.
MOST_ITEMS = 500


class ReviewQueue:
    """What is worth a look in a drawing, found once for each of its revisions.

    Parameters
    ----------
    find
        Finds it, away from the server's loop.
    """

    def __init__(self, drawing: DrawingFile, find: Callable[[LineSet], Awaitable[Sequence[Suspect]]]) -> None:
        self._drawing, self._find = drawing, find
        self._turn = asyncio.Lock()
        self._revision = -1
        self._documents: list[dict[str, Any]] = []
        self._dismissed = Dismissed()

    async def documents(self) -> list[dict[str, Any]]:
        """Return the queue as the page gets it."""
        async with self._turn:
            revision = self._drawing.revision
            if revision != self._revision:
                lines = await asyncio.to_thread(lambda: self._drawing.lines)
                found = await self._find(lines)
                settled = await asyncio.to_thread(self._dismissed.keys, self._drawing)
                self._documents = queue_documents(found, settled)
                self._revision = revision
            return self._documents


class Dismissed:
    """What somebody said there is nothing to do about; only new edits are read each time."""

    def __init__(self) -> None:
        self._read = 0
        self._keys: dict[int, str] = {}

    def keys(self, drawing: DrawingFile) -> frozenset[str]:
        """Return the keys that are dismissed now."""
        revision = drawing.revision
        self._keys |= _dismissals(drawing.entries(revision - self._read) if revision > self._read else ())
        self._read = revision
        undone = drawing.undone if self._keys else frozenset()
        return frozenset(key for number, key in self._keys.items() if number not in undone)


def _dismissals(entries: Iterable[Entry]) -> dict[int, str]:
    return {
        entry.number: entry.action.removeprefix(DISMISS)
        for entry in entries
        if entry.action.startswith(DISMISS)
    }


def queue_documents(suspects: Iterable[Suspect], dismissed: Container[str]) -> list[dict[str, Any]]:
    """Return what is worth a look and not dismissed, as `QueueItem` of the page's types says it."""
    return [document_of(suspect) for suspect in suspects if suspect.key not in dismissed][:MOST_ITEMS]


def document_of(suspect: Suspect) -> dict[str, Any]:
    """Return one item of the queue."""
    return {
        "key": suspect.key,
        "type": suspect.type,
        "ids": list(suspect.ids),
        "kind": suspect.kind,
        "at": [round(v, 3) for v in suspect.at],
        "box": [round(v, 2) for v in suspect.box],
        "length_m": round(suspect.length_m, 2),
        "confidence": round(suspect.confidence, 3),
        "reason": suspect.reason,
        "proposal": _proposal(suspect),
    }


def _proposal(suspect: Suspect) -> dict[str, Any] | None:
    """Return the edit that would settle it."""
    action, ids = suspect.proposal, list(suspect.ids)
    if not action:
        return None
    return {"action": action, "ids": ids} | ({"kind": suspect.as_kind} if suspect.as_kind else {})
