"""The review queue: what is worth a look, until somebody has settled it."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Container, Iterable, Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Depends, Request
from scipy.spatial import cKDTree

from linework.arrays import FloatArray
from linework.editing.edits.dashes import dashes_in_paint
from linework.editing.queue.gaps import gap_suspects
from linework.editing.queue.suspects import Suspect, loose_wires, missing_dashes, rank_suspects, unsure_lines
from linework.files.line_file.file import LineFile
from linework.files.line_file.history import HistoryEntry
from linework.lines.along import DrivenPath
from linework.methods.protocol import Sight
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.runs.opened.sight import SurveySight
from linework.workbench.server.bench import AppState, state_of_request
from linework.workbench.views.patches import PatchReader
from linework.workbench.views.tiles import patch_reader
from linework.workbench.worker.session import SurveySession

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

    def __init__(self, drawing: LineFile, find: Callable[[LineSet], Awaitable[Sequence[Suspect]]]) -> None:
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

    def keys(self, drawing: LineFile) -> frozenset[str]:
        """Return the keys that are dismissed now."""
        revision = drawing.revision
        self._keys |= _dismissals(drawing.entries(revision - self._read) if revision > self._read else ())
        self._read = revision
        undone = drawing.undone if self._keys else frozenset()
        return frozenset(key for number, key in self._keys.items() if number not in undone)


def _dismissals(entries: Iterable[HistoryEntry]) -> dict[int, str]:
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


# What is worth a look, found at the desk that has the survey: the van's way, and what was measured


def suspects_in_worker(table: SurveySession, lines: LineSet) -> list[Suspect]:
    """Return what is worth a look in the lines of the survey, in order."""
    way = table.keep("way", lambda: _way(table))
    sight = table.keep("sight", lambda: _sight(table))
    paint: PaintOfLines = table.keep("paint of lines", PaintOfLines)
    return suspects(lines, way, sight, paint.of(table, lines))


def suspects(
    lines: LineSet, way: DrivenPath, seen: Sight, paint: Mapping[str, FloatArray] | None = None
) -> list[Suspect]:
    """Return what is worth a look, in order; rejected lines are no lines here."""
    there = lines.take(lines.review != "rejected")
    found = [
        *unsure_lines(there, way),
        *gap_suspects(there, way, seen),
        *loose_wires(there),
        *missing_dashes(there, paint),
    ]
    return rank_suspects(found)


def _way(table: SurveySession) -> DrivenPath:
    trajectory = table.recordings.trajectory
    return DrivenPath.of(np.zeros((0, 3)) if trajectory is None else trajectory.xyz)


def _sight(table: SurveySession) -> Sight:
    """Return where ground was measured; in a survey of images alone, everywhere along the way."""
    surface = table.surface
    return SurveySight(surface) if surface is not None else _everywhere


def _everywhere(xy: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    return np.ones(len(xy), dtype=np.bool_)


# Routes of the workbench: the review queue

review_router = APIRouter(prefix="/api")


@review_router.get("/queue")
async def get_queue(
    request: Request, bench: Annotated[AppState, Depends(state_of_request)]
) -> list[dict[str, Any]]:
    """Return what is worth a look, the most promising first."""
    kept: ReviewQueue | None = getattr(request.app.state, "queue", None)
    if kept is None:
        kept = request.app.state.queue = ReviewQueue(
            bench.drawing, lambda lines: bench.pictures.ask(suspects_in_worker, lines)
        )
    return await kept.documents()


# A work of the desk of pictures: how bright the points along a line are

#: Stations along a line. [m]
BRIGHTNESS_STATION_M = 0.1
#: Points this near to a line are on it: a stripe's half width, or the least where it is not known. [m]
LEAST_HALF_M = 0.06
#: Points this near to the road lie on it. [m]
_ON_ROAD_M = 0.10
#: Brighter than this many times asphalt is no paint, but a reflector.
_BRIGHTEST = 6.0
_PIECE = 320
#: Measuring so much takes half a second. [m]
MOST_NEW_M = 2000.0


def brightness_along(table: SurveySession, xyz: FloatArray, width_m: float) -> tuple[FloatArray, FloatArray]:
    """Return the mean brightness (asphalt: 1) of the points at stations along a line, and how many they are.

    Parameters
    ----------
    xyz
        (n, 3) the line. [m, world]
    width_m
        Of its stripe; NaN: not known.

    Returns
    -------
    brightness, weight
        (k,) every `BRIGHTNESS_STATION_M`; brightness 0 where weight is.
    """
    half_m = float(np.fmax(0.5 * width_m, LEAST_HALF_M))
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xyz[:, :2], axis=0).T))])
    at = (np.arange(max(int(along[-1] / BRIGHTNESS_STATION_M), 1)) + 0.5) * BRIGHTNESS_STATION_M
    places = np.stack([np.interp(at, along, column) for column in xyz[:, :2].T], axis=1)
    total, count = np.zeros(len(at)), np.zeros(len(at))
    reader = patch_reader(table)
    if reader is not None:
        for piece in (slice(k, k + _PIECE) for k in range(0, len(at), _PIECE)):
            total[piece], count[piece] = _along_piece(reader, places[piece], half_m)
    return np.where(count > 0.0, total / np.maximum(count, 1.0), 0.0), count


def _along_piece(reader: PatchReader, places: FloatArray, half_m: float) -> tuple[FloatArray, FloatArray]:
    """Return the sum of brightness and the number of points at places."""
    bounds = Bounds(*places.min(axis=0), *places.max(axis=0)).grown(half_m)
    tree = cKDTree(places - places[0])
    total, count = np.zeros(len(places)), np.zeros(len(places))
    for patch in reader.patches(bounds):
        east, north = patch.x + (patch.corner[0] - places[0, 0]), patch.y + (patch.corner[1] - places[0, 1])
        low, high = np.array(bounds[:2]) - places[0], np.array(bounds[2:]) - places[0]
        near = (east >= low[0]) & (east <= high[0]) & (north >= low[1]) & (north <= high[1])
        near &= ~(np.abs(patch.above) > _ON_ROAD_M)
        chosen = np.flatnonzero(near)
        distance, k = tree.query(
            np.stack([east[chosen], north[chosen]], axis=1),
            distance_upper_bound=float(np.hypot(half_m, 0.5 * BRIGHTNESS_STATION_M)),
        )
        on = np.isfinite(distance)
        bright = np.minimum(patch.intensity[chosen[on]] / 1000.0, _BRIGHTEST)
        total += np.bincount(k[on], weights=bright, minlength=len(places))
        count += np.bincount(k[on], minlength=len(places))
    return total, count


def dash_spans(table: SurveySession, xyz: FloatArray, width_m: float) -> FloatArray:
    """Return where along a line (n, 3) the paint shows dashes, as `dashes_in_paint` does."""
    return dashes_in_paint(BRIGHTNESS_STATION_M, *brightness_along(table, xyz, width_m))


class PaintOfLines:
    """Where the paint along the markings of a drawing shows dashes, measured once for each shape of a line."""

    def __init__(self) -> None:
        self._spans: dict[int, FloatArray] = {}

    def of(self, table: SurveySession, lines: LineSet) -> dict[str, FloatArray]:
        """Return it by id, of markings that nobody rejected, as far as is known now.

        Each time some more is measured, `MOST_NEW_M` at most: pictures wait meanwhile.
        """
        found, new_m, length_m = {}, 0.0, lines.length_m
        for i in np.flatnonzero((lines.kind == "lane_marking") & (lines.review != "rejected")).tolist():
            xyz = lines.line(i)
            shape = hash(xyz.tobytes())
            if shape not in self._spans and new_m < MOST_NEW_M:
                new_m += float(length_m[i])
                self._spans[shape] = dash_spans(table, xyz, float(lines.width_m[i]))
            if shape in self._spans:
                found[str(lines.id[i])] = self._spans[shape]
        return found
