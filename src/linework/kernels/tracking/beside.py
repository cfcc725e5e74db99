"""Which stations of lines stand beside each other, of all pairs of stations that are near."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray


@njit(cache=True, nogil=True)
def stations_beside(
    pairs: IntArray, owner: IntArray, xy: FloatArray, normal: FloatArray, most: tuple[float, float, float]
) -> tuple[IntArray, FloatArray]:
    """Return which stations of other lines are beside stations of lines, of all pairs, each looked at from both.

    Parameters
    ----------
    pairs
        (p, 2) int64 stations that are near each other.
    owner, xy, normal
        (n,) int64 line of each station, (n, 2) its place [m] and (n, 2) the unit vector to its left.
    most
        Largest distance along a line, and across it [m]; the cosine of two normals is larger than the third.

    Returns
    -------
    found
        (k, 2) int64: a station, and the one beside it; all pairs in their order, then all turned round.
    how
        (k, 2): how far the other is to the left of the first [m], and the cosine of their normals.
    """
    most_along, most_across, least_cosine = most
    found, how = np.empty((2 * len(pairs), 2), np.int64), np.empty((2 * len(pairs), 2))
    k = 0
    for turn in range(2):
        for i in range(len(pairs)):
            a, b = pairs[i, turn], pairs[i, 1 - turn]
            if owner[a] == owner[b]:
                continue
            # Sums begin with 0, as numpy's do: none is -0
            facing = 0.0 + normal[a, 0] * normal[b, 0] + normal[a, 1] * normal[b, 1]
            if abs(facing) <= least_cosine:
                continue
            x, y = xy[b, 0] - xy[a, 0], xy[b, 1] - xy[a, 1]
            across = 0.0 + x * normal[a, 0] + y * normal[a, 1]
            if abs(normal[a, 1] * x - normal[a, 0] * y) <= most_along and abs(across) <= most_across:
                found[k, 0], found[k, 1] = a, b
                how[k, 0], how[k, 1] = across, facing
                k += 1
    return found[:k].copy(), how[:k].copy()
