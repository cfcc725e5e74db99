"""Circular arcs and clothoids of drawings and designs as vertices.

Separate from `landxml`, whose reader uses it: curves are geometry, the rest there is a format.
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


#: Nodes of the quadrature per piece between vertices: a clothoid turns little between them.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
#: Vertices of a clothoid are this far apart at most. [m]
_STEP_M = 1.0


def clothoid_vertices(
    start: FloatArray, ahead: FloatArray, length_m: float, curvature: tuple[float, float]
) -> FloatArray:
    """Return the vertices of a clothoid in plan, (n, 2) [m], its ends included.

    Parameters
    ----------
    start, ahead
        (2,) east, north of its start [m], and the direction in which it leaves.
    length_m
        Its length. [m]
    curvature
        At its start and end, positive to the left. [1/m]

    Examples
    --------
    A clothoid of constant curvature is an arc:

    >>> quarter = clothoid_vertices(np.zeros(2), np.array([1.0, 0.0]), 5.0 * math.pi, (0.1, 0.1))
    >>> quarter[-1].round(9).tolist()
    [10.0, 10.0]
    """
    n = min(max(math.ceil(length_m / _STEP_M), 1), _MOST_VERTICES)
    ends = np.linspace(0.0, length_m, n + 1)
    step = length_m / n
    inner = ends[:-1, None] + step * (_NODES + 1) / 2
    turn = curvature[0] * inner + (curvature[1] - curvature[0]) * inner**2 / (2 * length_m)
    angle = math.atan2(ahead[1], ahead[0]) + turn
    moves = np.column_stack([(f(angle) * _WEIGHTS).sum(axis=1) * step / 2 for f in (np.cos, np.sin)])
    return np.asarray(start[:2] + np.concatenate([np.zeros((1, 2)), np.cumsum(moves, axis=0)]))
