"""Requests to a worker: the wires that hang with a saved wire from pole to pole, and the other rail of a median.

Separate from `follow`, which follows one line from a click.
"""

from __future__ import annotations

from linework.arrays import FloatArray
from linework.errors import AbsentError
from linework.lines.companions import HungWires
from linework.model.lines import LineSet
from linework.workbench.following.follow import tracer_of
from linework.workbench.worker.session import SurveySession


def wires_in_worker(session: SurveySession, wire: FloatArray) -> HungWires:
    """Return the wires that hang with a wire (n, 3) [m, world] from pole to pole.

    Raises
    ------
    AbsentError
        The points show no such wire.
    """
    found = tracer_of(session).wires_along(wire)
    if found is None:
        raise AbsentError(
            "the points show no wire where the line is", where="wires", advice="follow it again from a click"
        )
    return found


def partners_in_worker(session: SurveySession, rail: FloatArray) -> LineSet:
    """Return the lines of the rail or barrier that shares a median with one (n, 3) [m, world]; empty where none does."""
    return tracer_of(session).partners_of(rail)
