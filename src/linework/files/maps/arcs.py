"""Circular arcs of drawings and designs as vertices.

Separate from `landxml`, whose reader uses it: arcs are geometry, the rest there is a format.
"""

from __future__ import annotations

import math

import numpy as np

from linework.arrays import FloatArray

#: Largest distance between an arc and its chords [m]: a tenth of what a survey resolves.
_SAGITTA_M = 0.001
#: Most vertices of one arc; a full circle of 100 km at the distance above has 44,000.
_MOST_VERTICES = 50_000


def arc_vertices(start: FloatArray, end: FloatArray, centre: FloatArray, *, is_left: bool) -> FloatArray:
    """Return the vertices of an arc, (n, 3) [m]: its ends as given, heights in proportion to the length.

    Parameters
    ----------
    start, end, centre
        (3,) east, north, up [m]; the height of the centre is not used.
    is_left
        Whether the arc turns to the left (anticlockwise).

    Examples
    --------
    >>> quarter = arc_vertices(np.array([1.0, 0, 5]), np.array([0.0, 1, 6]), np.zeros(3), is_left=True)
    >>> bool(np.allclose(np.hypot(quarter[:, 0], quarter[:, 1]), 1.0)), quarter[0].tolist(), quarter[-1].tolist()
    (True, [1.0, 0.0, 5.0], [0.0, 1.0, 6.0])
    """
    first, last = start[:2] - centre[:2], end[:2] - centre[:2]
    begin, stop = (math.atan2(v[1], v[0]) for v in (first, last))
    turn = (stop - begin) % (2 * math.pi) if is_left else -((begin - stop) % (2 * math.pi))
    radius_m = (math.hypot(*first) + math.hypot(*last)) / 2
    step = 2 * math.acos(max(1 - _SAGITTA_M / radius_m, 0.0)) if radius_m > 0 else math.pi
    n = min(max(math.ceil(abs(turn) / max(step, 1e-9)), 1), _MOST_VERTICES)
    share = np.linspace(0.0, 1.0, n + 1)
    radii = math.hypot(*first) * (1 - share) + math.hypot(*last) * share
    angle = begin + turn * share
    plan = centre[:2] + radii[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    found = np.column_stack([plan, start[2] * (1 - share) + end[2] * share])
    found[0], found[-1] = start, end
    return found
