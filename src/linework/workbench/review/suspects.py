"""Request to a worker for the suspects among lines, from the van's path, what was measured, and the paint.

Separate from `queue`, because it runs in the worker and needs the opened survey.
"""

from __future__ import annotations

from collections.abc import Container, Mapping

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
    path = driven_path(session)
    sight = session.keep("sight", lambda: _sight(session))
    paint: PaintOfLines = session.keep("paint of lines", PaintOfLines)
    return suspects(lines, path, sight, paint.of(session, lines), dismissed)


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
    there = lines.take((lines.review != "rejected") & (lines.kind != CANDIDATE))
    copies = [suspect for suspect in copied_lines(there) if suspect.key not in dismissed]
    found = [
        *copies,
        *unsure_lines(there, path),
        *gap_suspects(there, path, visible),
        *loose_wires(there, visible),
        *missing_dashes(there, paint),
    ]
    ranked = rank_suspects(found)
    listed = frozenset(name for suspect in ranked for name in suspect.ids if suspect.type in ("line", "copy"))
    ranked = rank_suspects([*ranked, *road_stretches(there, path, visible, listed)])
    # Nothing is accepted with others that may be there twice
    single = there.take(~np.isin(there.id, [name for suspect in copies for name in suspect.ids]))
    return ranked + unlisted_lines(single, ranked) + sure_lines(single)


def driven_path(session: SurveySession) -> DrivenPath:
    """Return the van's path, made once; an empty one without a trajectory."""

    def made() -> DrivenPath:
        trajectory = session.recordings.trajectory
        return DrivenPath.of(np.zeros((0, 3)) if trajectory is None else trajectory.xyz)

    return session.keep("path", made)


def _sight(session: SurveySession) -> Sight:
    """Return where ground was measured; in a survey without points, everywhere."""
    surface = session.surface
    return SurveySight(surface) if surface is not None else _everywhere


def _everywhere(xy: FloatArray) -> BoolArray:
    return np.ones(len(xy), dtype=np.bool_)
