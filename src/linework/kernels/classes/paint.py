"""Kernel of the points on and beside paint, from whose intensities it is known how bright the paint is.

Separate from `near_lines`, whose pieces it looks at: it needs points, and is called for markings alone.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import AnyArray, FloatArray, IntArray
from linework.kernels.classes.near_lines import MARKING_PIECE, PIECE_CELL_M, NearLines

#: Where points beside paint begin and end, from its edge [m]: beyond the spot of a beam, and as far as a lane has road.
_BESIDE_FROM_M, BESIDE_TO_M = 0.05, 0.35


@njit(cache=True, nogil=True)
def on_and_beside(xyz: FloatArray, index: IntArray, near: NearLines) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Return pairs of points and pieces of markings: (k,) int64 point, (k,) int32 piece, (k,) bool on it, not beside it.

    Parameters
    ----------
    xyz
        (n, 3) points. [m, world]
    index
        (m,) int64: those that are on the ground.
    """
    room, n = max(len(index), 1), 0
    point, piece = np.empty(room, dtype=np.int64), np.empty(room, dtype=np.int32)
    is_on = np.empty(room, dtype=np.bool_)
    for i in index:
        x, y = xyz[i, 0], xyz[i, 1]
        c, r = int(np.floor((x - near.west) / PIECE_CELL_M)), int(np.floor((y - near.south) / PIECE_CELL_M))
        if c < 0 or r < 0 or c >= near.n_cols or r >= near.n_rows:
            continue
        at = r * near.n_cols + c
        for j in near.item[near.start[at] : near.start[at + 1]]:
            if near.kind[j] != MARKING_PIECE:
                continue
            ax, ay = near.ends[j, 0], near.ends[j, 1]
            ux, uy = near.ends[j, 3] - ax, near.ends[j, 4] - ay
            length2, along = ux * ux + uy * uy, (x - ax) * ux + (y - ay) * uy
            if along < 0.0 or along > length2 or length2 == 0.0:
                continue
            d = abs(ux * (y - ay) - uy * (x - ax)) / np.sqrt(length2)
            on = d <= near.reach[j]
            if not on and not near.reach[j] + _BESIDE_FROM_M <= d <= near.reach[j] + BESIDE_TO_M:
                continue
            if n == room:
                # A point may be near several pieces
                point = np.concatenate((point, np.empty(room, dtype=np.int64)))
                piece = np.concatenate((piece, np.empty(room, dtype=np.int32)))
                is_on = np.concatenate((is_on, np.empty(room, dtype=np.bool_)))
                room *= 2
            point[n], piece[n], is_on[n] = i, j, on
            n += 1
    return point[:n], piece[:n], is_on[:n]
