"""When lines were measured: the times of the points they run through."""

from __future__ import annotations

import numpy as np

from linework.kernels.times import times_near
from linework.model.lines import LineSet
from linework.model.points import Points

#: Points this near to a vertex lie on the feature: the face of a beam reaches 0.31 m down from its top edge. [m]
REACH_M = 0.3


def with_times(lines: LineSet, points: Points) -> LineSet:
    """Return the lines with the time span of the points on them, where they have none yet.

    Parameters
    ----------
    points
        What the lines were found among; without times the lines stay as they are.

    Notes
    -----
    Points count within `REACH_M` of a vertex, in space: the ground below and branches above do not.

    Examples
    --------
    >>> xyz = np.array([[0.0, 0.1, 0.0], [1.0, 0.0, 0.2], [0.5, 0.0, 3.0]])
    >>> line = LineSet.from_lines([np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])])
    >>> timed = with_times(line, Points(xyz, time_s=np.array([7.0, 9.0, 11.0])))
    >>> timed.time_start_s.tolist(), timed.time_end_s.tolist()
    ([7.0], [9.0])
    """
    open_ = np.isnan(lines.time_start_s)
    owner = lines.line_of_vertex
    chosen = open_[owner]
    if points.time_s is None or not chosen.any():
        return lines
    start, end = times_near(points.xyz, points.time_s, lines.xyz[chosen], owner[chosen], len(lines), REACH_M)
    return lines.with_columns(
        time_start_s=np.where(open_, start, lines.time_start_s),
        time_end_s=np.where(open_, end, lines.time_end_s),
    )
