"""The review queue, and its route: what is worth checking, without what people dismissed."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Awaitable, Callable, Container, Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from fastapi import APIRouter, Request

from linework.files.line_file.file import LineFile
from linework.files.line_file.history import HistoryEntry
from linework.model.lines import LineSet
from linework.workbench.server.app_state import CurrentState
from linework.workbench.server.documents import Document

if TYPE_CHECKING:
    from linework.editing.queue.suspects import Suspect

#: Functions of the worker that find what is listed, part by part, and rank it.
SUSPECTS_OF_PART = "linework.workbench.review.suspects:suspects_of_part"
RANKED = "linework.workbench.review.suspects:ranked_in_worker"
#: Start of the action of an edit that dismisses a suspect; its key follows.
DISMISS = "dismiss "
#: Longest queue that is shown: more than a person settles in a day.
MOST_ITEMS = 500

FindSuspects = Callable[[LineSet, frozenset[str]], Awaitable[Sequence["Suspect"]]]

review_router = APIRouter(prefix="/api")


class QueueItem(Document):
    """One item of the queue, as the page gets it.

    Parameters
    ----------
    key
        Stays the same while the lines around it do.
    at, box
        East, north, up of its place, and west, south, east, north around it. [m, world]
    proposal
        The edit that would settle it: its action, ids, and kind where it needs one; None: a person has to decide.
    """

    key: str
    type: str
    ids: list[str]
    kind: str
    at: list[float]
    box: list[float]
    length_m: float
    confidence: float
    reason: str
    proposal: dict[str, Any] | None


@review_router.get("/queue")
async def get_queue(request: Request, app_state: CurrentState) -> list[QueueItem]:
    """Return what is worth checking, the most promising first."""
    kept: ReviewQueue | None = getattr(request.app.state, "queue", None)
    if kept is None:
        kept = request.app.state.queue = ReviewQueue(
            app_state.line_file, partial(found_in_parts, app_state.pictures.ask)
        )
    return await kept.items()


async def found_in_parts(
    ask: Callable[..., Awaitable[Any]], lines: LineSet, dismissed: frozenset[str]
) -> Sequence[Suspect]:
    """Return the suspects that a worker finds, asked for part by part: it makes pictures, too, which go between."""
    found: list[Suspect] = []
    for part in itertools.count():
        some = await ask(SUSPECTS_OF_PART, lines, part, dismissed)
        if some is None:
            break
        found += some
    ranked: Sequence[Suspect] = await ask(RANKED, lines, found)
    return ranked


class ReviewQueue:
    """The queue of a line file, found once for each revision.

    Parameters
    ----------
    find
        Finds the suspects among lines, away from the server's loop, knowing the dismissed keys.
    """

    def __init__(self, line_file: LineFile, find: FindSuspects) -> None:
        self._line_file, self._find = line_file, find
        self._turn = asyncio.Lock()
        self._revision = -1
        self._items: list[QueueItem] = []
        self._dismissed = Dismissed()

    async def items(self) -> list[QueueItem]:
        """Return the queue."""
        async with self._turn:
            revision = self._line_file.revision
            if revision != self._revision:
                lines = await asyncio.to_thread(lambda: self._line_file.lines)
                dismissed = await asyncio.to_thread(self._dismissed.keys, self._line_file)
                found = await self._find(lines, dismissed)
                self._items = queue_items(found, dismissed)
                self._revision = revision
            return self._items


class Dismissed:
    """Keys of the dismissed suspects; only new edits are read each time."""

    def __init__(self) -> None:
        self._read = 0
        self._keys: dict[int, str] = {}

    def keys(self, line_file: LineFile) -> frozenset[str]:
        """Return the keys that are dismissed now."""
        revision = line_file.revision
        self._keys |= _dismissals(line_file.entries(revision - self._read) if revision > self._read else ())
        self._read = revision
        undone = line_file.undone if self._keys else frozenset()
        return frozenset(key for number, key in self._keys.items() if number not in undone)


def _dismissals(entries: Iterable[HistoryEntry]) -> dict[int, str]:
    return {
        entry.number: entry.action.removeprefix(DISMISS)
        for entry in entries
        if entry.action.startswith(DISMISS)
    }


def queue_items(suspects: Iterable[Suspect], dismissed: Container[str]) -> list[QueueItem]:
    """Return the items of suspects whose keys are not dismissed, `MOST_ITEMS` at most; items of many lines are never cut off."""
    open_ = [suspect for suspect in suspects if suspect.key not in dismissed]
    last = [suspect for suspect in open_ if suspect.is_of_many]
    others = [suspect for suspect in open_ if not suspect.is_of_many][: MOST_ITEMS - len(last)]
    return [queue_item(suspect) for suspect in (*others, *last)]


def queue_item(suspect: Suspect) -> QueueItem:
    """Return the item of a suspect."""
    return QueueItem(
        key=suspect.key,
        type=suspect.type,
        ids=list(suspect.ids),
        kind=suspect.kind,
        at=[round(v, 3) for v in suspect.at],
        box=[round(v, 2) for v in suspect.box],
        length_m=round(suspect.length_m, 2),
        confidence=round(suspect.confidence, 3),
        reason=suspect.reason,
        proposal=_proposal(suspect),
    )


def _proposal(suspect: Suspect) -> dict[str, Any] | None:
    action, ids = suspect.proposal, list(suspect.ids)
    if not action:
        return None
    return {"action": action, "ids": ids}
