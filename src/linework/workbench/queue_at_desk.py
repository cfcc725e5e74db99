"""What is worth a look, found at the desk that has the survey: the van's way, and what was measured."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from linework.arrays import FloatArray
from linework.lines.along_way import Way
from linework.lines.suspected import Suspect, ranked, unsure_lines
from linework.lines.suspected_cables import loose_wires
from linework.lines.suspected_dashes import missing_dashes
from linework.lines.suspected_gaps import gaps
from linework.methods.sight import Sight
from linework.model.lines import LineSet
from linework.tiling.sight import SurveySight
from linework.workbench.paint_along import PaintOfLines
from linework.workbench.table import Table


def suspects_at_desk(table: Table, lines: LineSet) -> list[Suspect]:
    """Return what is worth a look in the lines of the survey, in order."""
    way = table.keep("way", lambda: _way(table))
    sight = table.keep("sight", lambda: _sight(table))
    paint: PaintOfLines = table.keep("paint of lines", PaintOfLines)
    return suspects(lines, way, sight, paint.of(table, lines))


def suspects(
    lines: LineSet, way: Way, seen: Sight, paint: Mapping[str, FloatArray] | None = None
) -> list[Suspect]:
    """Return what is worth a look, in order; rejected lines are no lines here."""
    there = lines.take(lines.review != "rejected")
    found = [
        *unsure_lines(there, way),
        *gaps(there, way, seen),
        *loose_wires(there),
        *missing_dashes(there, paint),
    ]
    return ranked(found)


def _way(table: Table) -> Way:
    trajectory = table.recordings.trajectory
    return Way.of(np.zeros((0, 3)) if trajectory is None else trajectory.xyz)


def _sight(table: Table) -> Sight:
    """Return where ground was measured; in a survey of images alone, everywhere along the way."""
    surface = table.surface
    return SurveySight(surface) if surface is not None else _everywhere


def _everywhere(xy: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    return np.ones(len(xy), dtype=np.bool_)
