"""Pieces of the lines of a survey, by which points are classified: boundaries, paint, rails, barriers and wires."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, FloatArray
from linework.kernels.classes.near_lines import (
    BARRIER_PIECE,
    BOUNDARY_PIECE,
    MARKING_PIECE,
    PIECE_CELL_M,
    RAIL_PIECE,
    WIRE_PIECE,
    NearLines,
    cells_of_pieces,
)
from linework.kernels.classes.paint import BESIDE_TO_M
from linework.kernels.classes.points import BESIDE_BOUNDARY_M
from linework.model.grid import Bounds
from linework.model.lines import LineSet

#: What the pieces of each kind of line are; others decide nothing. The top of a kerb is a part of the kerb at its foot.
_PIECE_OF = {
    "road_boundary": BOUNDARY_PIECE,
    "lane_marking": MARKING_PIECE,
    "lane_marking_dash": MARKING_PIECE,
    "road_marking_other": MARKING_PIECE,
    "guardrail": RAIL_PIECE,
    "barrier": BARRIER_PIECE,
    "cable": WIRE_PIECE,
}
#: Distance from a line within which points belong to it [m]. The posts of a guardrail stand up to 0.3 m behind its beam,
#: whose line is on the other side; a concrete barrier is 0.6 m wide at its foot, and its line is an edge of its top;
#: a point on a wire is off by the noise of the scanner and of the fitted line.
_REACH_M = {RAIL_PIECE: 0.40, BARRIER_PIECE: 0.50, WIRE_PIECE: 0.25}
#: Half the width of paint without a width [m]: the usual line of 12 cm.
_HALF_PAINT_M = 0.06
#: Longest bar, arrow or symbol [m]: a stop line across six lanes. What is longer is not one.
_LONGEST_SYMBOL_M = 20.0
#: Width of a kerb's stone behind the foot of its face [m]: 12 to 15 cm (EN 1340), and the batter of its face.
_KERB_M = 0.17
#: Pieces are at most this long [m], so that those of long lines lie in few cells.
_LONGEST_M = 4.0
#: Boundaries that end opposite one another within this are one boundary, hidden in between [m]; if both point at each
#: other within this angle [rad]: a side street's kerbs turn away. A direction is that of the last metres [m].
_JOINED_M, _JOINED_RAD, _DIRECTION_M = 30.0, np.radians(15.0), 3.0


@dataclass(frozen=True, slots=True)
class RoadPieces:
    """Pieces of lines.

    Parameters
    ----------
    ends
        (n, 6) float64: both ends. [m, world]
    kind, number
        (n,) uint8 and uint32: what it is part of, and the number of its line, from 1; 0: of none.
    reach
        (n,) float64: distance within which points can belong to it; of a boundary the width of its kerb. [m]
    """

    ends: FloatArray
    kind: AnyArray
    number: AnyArray
    reach: FloatArray

    @classmethod
    def of(cls, lines: LineSet) -> RoadPieces:
        """Return the pieces of lines, and those that join boundaries across gaps.

        Of a dashed marking only its dashes are paint, where the set has any.

        >>> lines = LineSet.from_lines([[[0, 0, 1], [6, 0, 1]]], kind=["cable"])
        >>> pieces = RoadPieces.of(lines)
        >>> pieces.ends.tolist(), pieces.number.tolist()
        ([[0.0, 0.0, 1.0, 3.0, 0.0, 1.0], [3.0, 0.0, 1.0, 6.0, 0.0, 1.0]], [1, 1])
        """
        has_dashes = bool((lines.kind == "lane_marking_dash").any())
        ends, kind, number, reach = [np.zeros((0, 6))], list[int](), list[int](), list[float]()
        for i, line in enumerate(lines):
            piece = _PIECE_OF.get(line.kind)
            xyz = line.xyz
            is_gappy = line.kind == "lane_marking" and line.pattern == "dashed" and has_dashes
            is_odd = line.kind == "road_marking_other" and line.length_m > _LONGEST_SYMBOL_M
            if piece is None or is_gappy or is_odd or not np.isfinite(xyz).all():
                continue
            found = _split(np.hstack([xyz[:-1], xyz[1:]]))
            ends.append(found)
            kind += [piece] * len(found)
            number += [i + 1] * len(found)
            reach += [_reach_m(piece, line.form, line.width_m)] * len(found)
        joints = _split(_joints([line.xyz for line in lines if line.kind == "road_boundary"]))
        n = len(joints)
        return cls(
            np.concatenate([*ends, joints]),
            np.array([*kind, *[BOUNDARY_PIECE] * n], dtype=np.uint8),
            np.array([*number, *[0] * n], dtype=np.uint32),
            np.array([*reach, *[0.0] * n], dtype=np.float64),
        )

    def in_bounds(self, bounds: Bounds) -> RoadPieces:
        """Return the pieces whose ends' rectangle touches bounds."""
        low, high = (
            np.minimum(self.ends[:, :2], self.ends[:, 3:5]),
            np.maximum(self.ends[:, :2], self.ends[:, 3:5]),
        )
        inside = (low <= (bounds.east, bounds.north)) & (high >= (bounds.west, bounds.south))
        kept = inside.all(axis=1)
        return RoadPieces(self.ends[kept], self.kind[kept], self.number[kept], self.reach[kept])

    def middles(self, kind: int) -> FloatArray:
        """Return the middles in plan of the pieces of a kind, (n, 2) [m, world]."""
        ends = self.ends[self.kind == kind]
        return np.asarray(0.5 * (ends[:, :2] + ends[:, 3:5]))

    def near(self, bounds: Bounds) -> NearLines:
        """Return the pieces by the cells of bounds, without what points and the ground tell of them."""
        found = self.in_bounds(bounds.grown(BESIDE_BOUNDARY_M))
        west, south = np.floor([bounds.west, bounds.south]).tolist()
        n_cols = int(np.ceil((bounds.east - west) / PIECE_CELL_M)) + 1
        n_rows = int(np.ceil((bounds.north - south) / PIECE_CELL_M)) + 1
        margin = found.reach + np.where(found.kind == MARKING_PIECE, BESIDE_TO_M, 0.0)
        margin[found.kind == BOUNDARY_PIECE] = BESIDE_BOUNDARY_M
        start, item = cells_of_pieces(found.ends, margin, west, south, n_rows, n_cols)
        sides, least = np.zeros(len(found.kind), dtype=np.uint8), np.full(len(found.kind), -np.inf)
        return NearLines(
            found.ends,
            found.kind,
            sides,
            found.number,
            found.reach,
            least,
            start,
            item,
            west,
            south,
            n_rows,
            n_cols,
        )


def _reach_m(piece: int, form: str, width_m: float) -> float:
    if piece == BOUNDARY_PIECE:
        return _KERB_M if form == "kerb" else 0.0
    if piece == MARKING_PIECE:
        return 0.5 * width_m if np.isfinite(width_m) else _HALF_PAINT_M
    return _REACH_M[piece]


def _split(ends: FloatArray) -> FloatArray:
    """Return pieces (n, 6) of equal length, none longer than 4 m in plan."""
    length = np.hypot(ends[:, 3] - ends[:, 0], ends[:, 4] - ends[:, 1])
    n = np.maximum(np.ceil(length / _LONGEST_M), 1).astype(np.int64)
    which = np.repeat(np.arange(len(ends)), n)
    k = np.arange(len(which)) - np.repeat(np.cumsum(n) - n, n)
    a, b = ends[which, :3], ends[which, 3:]
    first, last = (k / n[which])[:, None], ((k + 1) / n[which])[:, None]
    return np.hstack([a + (b - a) * first, a + (b - a) * last])


def _joints(boundaries: list[FloatArray]) -> FloatArray:
    """Return pieces (n, 6) between boundaries that end opposite one another: each end joins its best one, if mutual."""
    place, outward, of = list[FloatArray](), list[FloatArray](), list[int]()
    for i, xyz in enumerate(boundaries):
        for line in (xyz, xyz[::-1]):
            far = np.hypot(*(line[:, :2] - line[0, :2]).T)
            beyond = np.flatnonzero(far >= _DIRECTION_M)
            inner = line[beyond[0] if len(beyond) else -1, :2]
            length = float(np.hypot(*(line[0, :2] - inner)))
            if length > 0.0:
                place.append(line[0])
                outward.append((line[0, :2] - inner) / length)
                of.append(i)
    if len(place) < 2:
        return np.zeros((0, 6))
    at, way = np.stack(place), np.stack(outward)
    best: dict[int, tuple[float, int]] = {}
    for a, b in sorted(cKDTree(at[:, :2]).query_pairs(_JOINED_M)):
        chord = at[b, :2] - at[a, :2]
        length = float(np.hypot(*chord))
        least = length * np.cos(_JOINED_RAD)
        if of[a] != of[b] and length > 0.0 and chord @ way[a] >= least and -chord @ way[b] >= least:
            for one, two in ((a, b), (b, a)):
                best[one] = min(best.get(one, (np.inf, -1)), (length, two))
    pairs = [(a, b) for a, (_, b) in sorted(best.items()) if a < b and best[b][1] == a]
    return np.array([[*at[a], *at[b]] for a, b in pairs]).reshape(-1, 6)
