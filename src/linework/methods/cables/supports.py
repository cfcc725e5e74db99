"""Which wires hang side by side between the same two supports, and which ends are at one support.

Shared by `poles`, which looks for what stands there, and `networks`, which follows wires from pole to pole.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from linework.arrays import FloatArray, IntArray

#: Ends within this distance in plan are at one support: the fixings of a drop line on both sides of a pole. [m]
ONE_SUPPORT_M = 1.2
#: Largest distance in plan of neighbouring wires of a span: at least this [m], the crossarm of a wooden pole; and at least
#: this share of the span. The distance that conductors need grows with the sag, hence with the span (EN 50341-1, 5.8):
#: 17 m between the arms of both sides of a lattice tower at 334 m.
NEIGHBOUR_M, NEIGHBOUR_SHARE = 2.5, 0.05
#: Wires of a span end within this distance along it [m], and within this share of their distance across more: a crossarm
#: halves the angle of the line, which turns by less than 53 degrees over one.
SAME_END_M, SAME_END_SHARE = 1.0, 0.5
#: Least share of the shorter of two wires of a span that is beside the other: pieces may overlap, spans only meet.
LEAST_OVERLAP = 0.5
#: Largest turn between wires of a span, from its crossarms of different widths. [rad]
SIDE_BY_SIDE_RAD = math.radians(3.0)
#: Distance of the places by which neighbouring wires are looked for. [m]
_STEP_M = 10.0


@dataclass(frozen=True, slots=True)
class Hanging:
    """What m wires hang on.

    Parameters
    ----------
    support
        (m, 2) int64: number of the support at each end.
    span
        (m,) int64: number of the span; wires side by side have the same.
    """

    support: IntArray
    span: IntArray


def hanging(ends: FloatArray) -> Hanging:
    """Return supports and spans of wires by their ends (m, 2, 3) [m]; wires do not depend on their order.

    A piece of which half is beside another wire belongs to its span, and shares the support that it reaches.
    """
    m = len(ends)
    if m == 0:
        return Hanging(np.zeros((0, 2), dtype=np.int64), np.zeros(0, dtype=np.int64))
    places = ends[:, :, :2].reshape(-1, 2)
    one = list(cKDTree(places).query_pairs(ONE_SUPPORT_M))
    beside = []
    for i, j in _candidates(ends):
        shared = _side_by_side(ends[i, :, :2], ends[j, :, :2])
        if shared is not None:
            beside.append((i, j))
            one += [(2 * i + a, 2 * j + b) for a, b in shared]
    return Hanging(groups_of_pairs(2 * m, one).reshape(m, 2), groups_of_pairs(m, beside))


def groups_of_pairs(n: int, pairs: Iterable[tuple[int, int]]) -> IntArray:
    """Return the group (n,) int64 of things of which some pairs belong together.

    >>> groups_of_pairs(4, [(0, 2)]).tolist()
    [0, 1, 0, 2]
    """
    links = np.array([*pairs], dtype=np.int64).reshape(-1, 2)
    graph = coo_array((np.ones(len(links), dtype=np.int8), (links[:, 0], links[:, 1])), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _candidates(ends: FloatArray) -> list[tuple[int, int]]:
    """Return the pairs of wires that pass within the distance of neighbours, the lower number first."""
    lengths = np.hypot(*(ends[:, 1, :2] - ends[:, 0, :2]).T)
    places, owner = [], []
    for i, (a, b) in enumerate(ends[:, :, :2]):
        shares = np.linspace(0.0, 1.0, int(lengths[i] // _STEP_M) + 2)
        places.append(a + shares[:, None] * (b - a))
        owner += [i] * len(shares)
    xy, wire = np.concatenate(places), np.array(owner)
    reach = np.maximum(NEIGHBOUR_M, NEIGHBOUR_SHARE * lengths[wire]) + _STEP_M
    near = cKDTree(xy).query_ball_point(xy, reach)
    found = {
        (min(int(wire[k]), int(wire[n])), max(int(wire[k]), int(wire[n])))
        for k, others in enumerate(near)
        for n in others
        if wire[k] != wire[n]
    }
    return sorted(found)


def _side_by_side(first: FloatArray, second: FloatArray) -> list[tuple[int, int]] | None:
    """Return the ends that two wires of a span share, by their ends (2, 2) in plan [m]; None if of different spans."""
    lengths = [float(np.hypot(*(w[1] - w[0]))) for w in (first, second)]
    if min(lengths) == 0.0:
        return None
    swapped = lengths[1] > lengths[0]
    long, short = (second, first) if swapped else (first, second)
    length = max(lengths)
    along = (long[1] - long[0]) / length
    across = np.array([-along[1], along[0]])
    way = (short[1] - short[0]) / min(lengths)
    if abs(float(way @ across)) > math.sin(SIDE_BY_SIDE_RAD):
        return None
    s, o = (short - long[0]) @ along, (short - long[0]) @ across
    apart = float(np.abs(o).max())
    reach = SAME_END_M + SAME_END_SHARE * apart
    overlap = min(float(s.max()), length) - max(float(s.min()), 0.0)
    if apart > max(NEIGHBOUR_M, NEIGHBOUR_SHARE * length) or overlap < LEAST_OVERLAP * min(lengths):
        return None
    pairs = itertools.product((0, 1), (0, 1))
    shared = [(a, b) for a, b in pairs if abs(float(s[b]) - length * a) <= reach]
    return [(b, a) for a, b in shared] if swapped else shared
