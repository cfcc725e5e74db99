"""Lines that belong together: a marking and its dashes, a kerb and its top, the wires of one line of poles.

Separate from the methods that find them, because the workbench's server keeps them together without importing any.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.model.lines import LineSet

#: Largest distance of a companion from its line: dashes lie on it, a kerb's top within the width of a kerb stone. [m]
COMPANION_BESIDE_M = {"lane_marking_dash": 0.05, "kerb_top": 0.45}
#: Largest distance of the two ends of a ring. [m]
_RING_M = 1.0
#: What stands on a median.
MEDIAN_KINDS = ("guardrail", "barrier")


@dataclass(frozen=True, slots=True)
class HungWires:
    """Wires that hang over the same poles.

    Parameters
    ----------
    lines
        A wire in each span, and those beside it, with their `network`, `circuit` and `span`.
    is_own
        (m,) bool: those of the conductor that was asked for.
    """

    lines: LineSet
    is_own: BoolArray


def nearest_vertex(line: FloatArray, xy: FloatArray) -> tuple[int, float]:
    """Return the vertex of a line (n, 2) before its point nearest to a place (2,), and that point's distance [m].

    >>> nearest_vertex(np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 0.0]]), np.array([12.0, 2.0]))
    (1, 2.0)
    """
    a, step = line[:-1], np.diff(line, axis=0)
    length2 = np.maximum(np.sum(step * step, axis=1), 1e-12)
    share = np.clip(np.sum((xy - a) * step, axis=1) / length2, 0.0, 1.0)
    distance = np.linalg.norm(a + share[:, None] * step - xy, axis=1)
    i = int(np.argmin(distance))
    return i, float(distance[i])


def companions_of(lines: LineSet, line: FloatArray, kind: str) -> IntArray:
    """Return the lines of a kind of `COMPANION_BESIDE_M` that belong to a line (n, 3): its dashes, its kerb's top."""
    own = []
    for i in np.flatnonzero(lines.kind == kind).tolist():
        xyz = lines[i].xyz
        some = xyz[[0, len(xyz) // 2, -1], :2]
        if max(nearest_vertex(line[:, :2], place)[1] for place in some) <= COMPANION_BESIDE_M[kind]:
            own.append(i)
    return np.array(own, dtype=np.int64)


def closes_on_itself(line: FloatArray) -> bool:
    """Return whether a line (n, 3) ends where it starts, as the kerb of an island does."""
    return len(line) > 4 and float(np.hypot(*(line[0, :2] - line[-1, :2]))) <= _RING_M
