"""Request to a worker for the suspects among lines, from the van's path, what was measured, and the paint.

Separate from `queue`, because it runs in the worker and needs the opened survey.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from functools import partial

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.editing.queue.copies import copied_lines
from linework.editing.queue.gaps import gap_suspects
from linework.editing.queue.stretches import road_stretches
from linework.editing.queue.suspects import (
    Suspect,
    loose_wires,
    missing_dashes,
    rank_suspects,
    sure_lines,
    unlisted_lines,
    unsure_lines,
)
from linework.lines.along import DrivenPath
from linework.methods.protocol import Sight
from linework.model.lines import CANDIDATE, LineSet
from linework.runs.opened.surface import SurveySight
from linework.workbench.review.paint import PaintOfLines
from linework.workbench.worker.session import SurveySession


def suspects_in_worker(
    session: SurveySession, lines: LineSet, dismissed: Container[str] = frozenset()
) -> list[Suspect]:
    """Return what is worth checking in the lines of the survey, the most promising first; see `suspects`."""
    found: list[Suspect] = []
    part = 0
    while (some := suspects_of_part(session, lines, part, dismissed)) is not None:
        found, part = [*found, *some], part + 1
    return ranked_in_worker(session, lines, found)


def suspects_of_part(
    session: SurveySession, lines: LineSet, part: int, dismissed: Container[str] = frozenset()
) -> list[Suspect] | None:
    """Return what one part of the search finds; None if there are no more parts.

    Pictures wait for a request: of 20,000 lines on one street all parts take 9 s of processor time, most of them 1.3 s each.
    """
    parts = _parts(_there(lines), driven_path(session), _sight_of(session), dismissed)
    if part < len(parts):
        return parts[part]()
    if part > len(parts):
        return None
    paint: PaintOfLines = session.keep("paint of lines", PaintOfLines)
    return missing_dashes(_there(lines), paint.of(session, lines))


def ranked_in_worker(session: SurveySession, lines: LineSet, found: list[Suspect]) -> list[Suspect]:
    """Return what all parts found with the stretches of road and the items of many lines, the most promising first."""
    return _ranked(_there(lines), driven_path(session), _sight_of(session), found)


def suspects(
    lines: LineSet,
    path: DrivenPath,
    visible: Sight,
    paint: Mapping[str, FloatArray] | None = None,
    dismissed: Container[str] = frozenset(),
) -> list[Suspect]:
    """Return what is worth checking, the most promising first; rejected lines and candidates do not count.

    Parameters
    ----------
    path
        The van's path.
    visible
        Says where ground was measured.
    paint
        By id of a marking, where along it the paint shows dashes: (k, 2) [m].
    dismissed
        Keys of items that a person has dismissed: a line that was no copy is a line like any other.
    """
    there = _there(lines)
    found = [suspect for find in _parts(there, path, visible, dismissed) for suspect in find()]
    return _ranked(there, path, visible, [*found, *missing_dashes(there, paint)])


def _there(lines: LineSet) -> LineSet:
    return lines.take((lines.review != "rejected") & (lines.kind != CANDIDATE))


def _parts(
    there: LineSet, path: DrivenPath, visible: Sight, dismissed: Container[str]
) -> list[Callable[[], list[Suspect]]]:
    """Return the parts of the search that need no paint; copies, which take longest, by kind."""

    def copies(kind: str) -> list[Suspect]:
        return [suspect for suspect in copied_lines(there[kind]) if suspect.key not in dismissed]

    return [
        *(partial(copies, kind) for kind in sorted(set(there.kind.tolist()))),
        lambda: unsure_lines(there, path),
        lambda: gap_suspects(there, path, visible),
        lambda: loose_wires(there, visible),
    ]


def _ranked(there: LineSet, path: DrivenPath, visible: Sight, found: list[Suspect]) -> list[Suspect]:
    ranked = rank_suspects(found)
    listed = frozenset(name for suspect in ranked for name in suspect.ids if suspect.type in ("line", "copy"))
    ranked = rank_suspects([*ranked, *road_stretches(there, path, visible, listed)])
    # Nothing is accepted with others that may be there twice
    copied = [name for suspect in found if suspect.type == "copy" for name in suspect.ids]
    single = there.take(~np.isin(there.id, copied))
    return ranked + unlisted_lines(single, ranked) + sure_lines(single)


def driven_path(session: SurveySession) -> DrivenPath:
    """Return the van's path, made once; an empty one without a trajectory."""

    def made() -> DrivenPath:
        trajectory = session.recordings.trajectory
        return DrivenPath.of(np.zeros((0, 3)) if trajectory is None else trajectory.xyz)

    return session.keep("path", made)


def _sight_of(session: SurveySession) -> Sight:
    """Return where ground was measured, made once; in a survey without points, everywhere."""

    def made() -> Sight:
        surface = session.surface
        return SurveySight(surface) if surface is not None else _everywhere

    return session.keep("sight", made)


def _everywhere(xy: FloatArray) -> BoolArray:
    return np.ones(len(xy), dtype=np.bool_)
