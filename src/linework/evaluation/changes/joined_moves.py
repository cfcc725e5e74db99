"""Which moved stretches are one move: a kerb in pieces, between parked cars, has moved once.

Separate from `same_lines`, which finds them line by line: pieces of one kerb are lines of their own.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from linework.arrays import AnyArray, FloatArray, IntArray, distance_along
from linework.evaluation.changes.epoch_change import EpochChange

#: The next piece goes on this near to where the one before points. [m]
_GOES_ON_M = 0.5
#: Length of its ends that tells where it points. [m]
_END_M = 5.0
#: Shifts that differ by fewer deviations are one: 95 % of those that are.
_SAME_DEVIATIONS = 1.96


def moved_together(moves: Sequence[EpochChange], still: FloatArray, kinds: AnyArray) -> IntArray:
    """Return the number (k,) of the move that each stretch is of, counted from 0.

    Parameters
    ----------
    moves
        Stretches that have moved, with their shifts.
    still, kinds
        (n, 2) places of lines that have not moved [m, world], and (n,) kinds of these lines.

    Notes
    -----
    Two stretches of one kind are one move where the second goes on where the first points, no farther off than the longer
    of both is long, with the same shift within its deviations, and nothing of that kind between them has stayed.
    """
    n = len(moves)
    if not n:
        return np.zeros(0, dtype=np.int64)
    trees = {str(name): shapely.STRtree(shapely.points(still[kinds == name])) for name in np.unique(kinds)}
    ends = np.array([one.line.xyz[[0, -1], :2] for one in moves])
    heading = np.array([_headings(one.line.xyz[:, :2]) for one in moves])
    across = np.array([one.across_m for one in moves])
    up = np.array([one.up_m for one in moves])
    sigma = np.array([[one.sigma_across_m, one.sigma_up_m] for one in moves])
    length = np.array([one.length_m for one in moves])
    kind = np.array([str(one.line.kind[0]) for one in moves])
    joined = np.eye(n, dtype=bool)
    for i in range(n - 1):
        others = i + 1 + np.flatnonzero(kind[i + 1 :] == kind[i])
        # The two ends that are nearest to each other, and the shift there: left is left of where each line goes
        apart = np.linalg.norm(ends[others][:, None] - ends[i][None, :, None], axis=3).reshape(-1, 4)
        near, away_m = np.argmin(apart, axis=1), apart.min(axis=1, initial=np.inf)
        same_way = np.where(np.sum(heading[i, near // 2] * heading[others, near % 2], axis=1) < 0, -1.0, 1.0)
        off = np.abs(np.column_stack([same_way * across[others] - across[i], up[others] - up[i]]))
        is_same = np.all(off <= _SAME_DEVIATIONS * np.hypot(sigma[others], sigma[i]), axis=1)
        is_near = away_m <= np.maximum(length[i], length[others])
        for j, meets, way in zip(
            *(v[is_same & is_near].tolist() for v in (others, near, same_way)), strict=True
        ):
            a, b = meets // 2, meets % 2
            between = ends[j, b] - ends[i, a]
            # Along an arc the way from end to end is that of both ends on average
            ahead = heading[i, a] + way * heading[j, b]
            beside = float(ahead[0] * between[1] - ahead[1] * between[0])
            if abs(beside) > _GOES_ON_M * max(float(np.linalg.norm(ahead)), 1e-9):
                continue
            # A little short of both ends, where what has not moved begins at once
            line = shapely.linestrings(ends[i, a] + np.array([[0.02], [0.98]]) * between)
            tree = trees.get(kind[i])
            joined[i, j] = tree is None or not len(tree.query(line, predicate="dwithin", distance=_GOES_ON_M))
    return np.asarray(connected_components(coo_array(joined), directed=False)[1], dtype=np.int64)


def _headings(xy: FloatArray) -> FloatArray:
    """Return unit vectors (2, 2) along a line at its first and its last end."""
    along = distance_along(xy)
    inner = [min(_END_M, float(along[-1])), max(float(along[-1]) - _END_M, 0.0)]
    at = np.column_stack([np.interp(inner, along, column) for column in xy.T])
    ways = np.stack([at[0] - xy[0], xy[-1] - at[1]])
    return np.asarray(ways / np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-9))
