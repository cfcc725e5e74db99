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
    k = len(moves)
    if not k:
        return np.zeros(0, dtype=np.int64)
    trees = {str(k): shapely.STRtree(shapely.points(still[kinds == k])) for k in np.unique(kinds)}
    ends = np.array([one.line.xyz[[0, -1], :2] for one in moves])
    chord = ends[:, 1] - ends[:, 0]
    way = chord / np.maximum(np.linalg.norm(chord, axis=1, keepdims=True), 1e-9)
    left = np.column_stack([-way[:, 1], way[:, 0]])
    shift = np.column_stack(
        [np.array([one.across_m for one in moves])[:, None] * left, [one.up_m for one in moves]]
    )
    sigma = np.array([[one.sigma_across_m, one.sigma_across_m, one.sigma_up_m] for one in moves])
    heading = np.array([_headings(one.line.xyz[:, :2]) for one in moves])
    length = np.array([one.length_m for one in moves])
    kind = np.array([str(one.line.kind[0]) for one in moves])
    joined = np.eye(k, dtype=bool)
    for i in range(k - 1):
        others = i + 1 + np.flatnonzero(kind[i + 1 :] == kind[i])
        away = np.abs(shift[others] - shift[i])
        is_same = np.all(away <= _SAME_DEVIATIONS * np.hypot(sigma[others], sigma[i]), axis=1)
        for j in others[is_same].tolist():
            between = ends[j][None, :] - ends[i][:, None]
            gap = np.linalg.norm(between, axis=2)
            a, b = np.unravel_index(int(np.argmin(gap)), (2, 2))
            # Along an arc the way from end to end is that of both ends on average
            ahead = heading[i, a] + np.sign(float(heading[i, a] @ heading[j, b])) * heading[j, b]
            across = ahead[0] * between[a, b, 1] - ahead[1] * between[a, b, 0]
            beside = abs(float(across)) / max(float(np.linalg.norm(ahead)), 1e-9)
            if gap[a, b] > max(length[i], length[j]) or beside > _GOES_ON_M:
                continue
            # A little short of both ends, where what has not moved begins at once
            line = shapely.linestrings(ends[i][a] + np.array([[0.02], [0.98]]) * between[a, b])
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
