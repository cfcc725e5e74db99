"""Kernels of the pieces of lines near a place: in which cells they are, and which of them hide one place from another."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from linework.arrays import AnyArray, BoolArray, FloatArray

#: Side of the cells by which pieces of lines are looked up [m]: a cell beside a road has few of them.
PIECE_CELL_M = 1.0
#: What a piece is part of.
BOUNDARY_PIECE, MARKING_PIECE, RAIL_PIECE, BARRIER_PIECE, WIRE_PIECE = range(5)
#: Sides of a boundary that are road, as bits.
LEFT_IS_ROAD, RIGHT_IS_ROAD = 1, 2
#: Interval at which a line of sight looks for pieces [m]: pieces are listed in all cells within their reach, so that a
#: corner of a cell that is stepped over holds nothing that its neighbours do not.
_SIGHT_STEP_M = 0.5


class NearLines(NamedTuple):
    """Pieces of lines by the cells they are near to.

    Parameters
    ----------
    ends
        (n, 6) float64: both ends. [m, world]
    kind, sides, number
        (n,) uint8, uint8 and uint32: what it is part of, which sides are road, and the number of its line.
    reach
        (n,) float64: distance within which points can belong to it; of a boundary the width of its kerb. [m]
    least
        (n,) float64: least intensity of a point of it.
    start, item
        Pieces of cell i are ``item[start[i]:start[i + 1]]``, int32; row 0 is south.
    west, south
        Corner of the cells. [m, world]
    n_rows, n_cols
        Shape of the cells.
    """

    ends: FloatArray
    kind: AnyArray
    sides: AnyArray
    number: AnyArray
    reach: FloatArray
    least: FloatArray
    start: AnyArray
    item: AnyArray
    west: float
    south: float
    n_rows: int
    n_cols: int


@njit(cache=True, nogil=True)
def cells_of_pieces(
    ends: FloatArray, margin: FloatArray, west: float, south: float, n_rows: int, n_cols: int
) -> tuple[AnyArray, AnyArray]:
    """Return the pieces of each cell, as ``NearLines.start`` and ``NearLines.item``.

    Parameters
    ----------
    ends
        (n, 6) ends of the pieces. [m, world]
    margin
        (n,) distance from a piece within which cells list it. [m]
    """
    start = np.zeros(n_rows * n_cols + 1, dtype=np.int32)
    item = np.empty(0, dtype=np.int32)
    for is_filling in range(2):
        if is_filling:
            for i in range(n_rows * n_cols):
                start[i + 1] += start[i]
            item = np.empty(start[-1], dtype=np.int32)
        for i in range(len(ends)):
            m = margin[i]
            c0 = max(int(np.floor((min(ends[i, 0], ends[i, 3]) - m - west) / PIECE_CELL_M)), 0)
            c1 = min(int(np.floor((max(ends[i, 0], ends[i, 3]) + m - west) / PIECE_CELL_M)), n_cols - 1)
            r0 = max(int(np.floor((min(ends[i, 1], ends[i, 4]) - m - south) / PIECE_CELL_M)), 0)
            r1 = min(int(np.floor((max(ends[i, 1], ends[i, 4]) + m - south) / PIECE_CELL_M)), n_rows - 1)
            for r in range(r0, r1 + 1):
                for c in range(c0, c1 + 1):
                    at = r * n_cols + c
                    if is_filling:
                        item[start[at]] = i
                        start[at] += 1
                    else:
                        start[at + 1] += 1
    # Filling has moved each start to its end
    for i in range(n_rows * n_cols, 0, -1):
        start[i] = start[i - 1]
    start[0] = 0
    return start, item


@njit(cache=True, nogil=True)
def in_sight(places: FloatArray, seeds: FloatArray, near: NearLines) -> BoolArray:
    """Return which places (n, 2) are visible from seeds (n, 2) without a boundary between them, (n,) bool."""
    clear = np.ones(len(places), dtype=np.bool_)
    for i in range(len(places)):
        px, py, qx, qy = places[i, 0], places[i, 1], seeds[i, 0], seeds[i, 1]
        n_steps = int(np.hypot(qx - px, qy - py) / _SIGHT_STEP_M) + 1
        last = -1
        for k in range(n_steps + 1):
            x, y = px + (qx - px) * k / n_steps, py + (qy - py) * k / n_steps
            c, r = (
                int(np.floor((x - near.west) / PIECE_CELL_M)),
                int(np.floor((y - near.south) / PIECE_CELL_M)),
            )
            at = r * near.n_cols + c
            if c < 0 or r < 0 or c >= near.n_cols or r >= near.n_rows or at == last:
                continue
            last = at
            for j in near.item[near.start[at] : near.start[at + 1]]:
                if near.kind[j] == BOUNDARY_PIECE and _crosses(px, py, qx, qy, near.ends[j]):
                    clear[i] = False
                    break
            if not clear[i]:
                break
    return clear


@njit(cache=True, nogil=True)
def _crosses(px: float, py: float, qx: float, qy: float, piece: FloatArray) -> bool:
    """Return whether the line from p to q crosses a piece in plan."""
    ax, ay, bx, by = piece[0], piece[1], piece[3], piece[4]
    of_a = (qx - px) * (ay - py) - (qy - py) * (ax - px)
    of_b = (qx - px) * (by - py) - (qy - py) * (bx - px)
    of_p = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
    of_q = (bx - ax) * (qy - ay) - (by - ay) * (qx - ax)
    found: bool = (of_a > 0.0) != (of_b > 0.0) and (of_p > 0.0) != (of_q > 0.0)
    return found
