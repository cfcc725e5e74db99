"""Pairs of followed lines of which one passes the place where the other was begun."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray

#: Columns of a node: place [m] and direction [rad].
NODE_X, NODE_Y, NODE_ANGLE = range(3)
#: Columns of how one line passes another.
PASS_ALONG, PASS_SENSE, PASS_ACROSS = range(3)
#: Lines are parallel within 20 degrees: sine.
PARALLEL_SINE = 0.34


@njit(cache=True, nogil=True)
def passing(
    nodes: FloatArray,
    offsets: IntArray,
    middle: IntArray,
    frame: tuple[int, int, float],
    reach: tuple[float, float],
) -> tuple[IntArray, FloatArray]:
    """Return the pairs of lines of which one passes the begin of the other, near and parallel.

    Parameters
    ----------
    nodes
        (k, 3) nodes of all lines, line after line: `NODE_X`, `NODE_Y` [m], `NODE_ANGLE` [rad].
    offsets
        (m + 1,): first node of each line.
    middle
        (m,): the node at which each line was begun, in both directions.
    frame
        Columns and rows of the cells that nodes are looked up in, from (0, 0), and their size [m].
    reach
        Largest distance along and across. [m]

    Returns
    -------
    pairs
        (n, 2) int64: the line that passes, and the line whose middle it passes.
    how
        (n, 3): `PASS_ALONG`, arc length from the middle of the one to that of the other [m] (negative: before it);
        `PASS_SENSE`, 1 where both run the same way, else -1; `PASS_ACROSS`, distance across [m].
    """
    along, across = reach
    n_x, n_y, cell = frame
    n_lines = len(middle)
    heads = np.full(n_x * n_y, -1, dtype=np.int64)
    following, entry = np.full(n_lines, -1, dtype=np.int64), np.full(n_lines, -1, dtype=np.int64)
    nearest = np.empty(n_lines)
    for j in range(n_lines):
        c, r = int(np.floor(nodes[middle[j], NODE_X] / cell)), int(np.floor(nodes[middle[j], NODE_Y] / cell))
        if c >= 0 and c < n_x and r >= 0 and r < n_y:
            following[j] = heads[r * n_x + c]
            heads[r * n_x + c] = j
    pairs, how = np.empty((256, 2), dtype=np.int64), np.empty((256, 3))
    n = 0
    for i in range(n_lines):
        first = n
        begin = 0.0  # arc length of the middle of this line
        s = 0.0
        for k in range(offsets[i], offsets[i + 1]):
            x, y, angle = nodes[k, NODE_X], nodes[k, NODE_Y], nodes[k, NODE_ANGLE]
            if k > offsets[i]:
                s += np.hypot(x - nodes[k - 1, NODE_X], y - nodes[k - 1, NODE_Y])
            if k == middle[i]:
                begin = s
            cos, sin = np.cos(angle), np.sin(angle)
            c, r = int(np.floor(x / cell)), int(np.floor(y / cell))
            for rr in range(max(r - 1, 0), min(r + 2, n_y)):
                for cc in range(max(c - 1, 0), min(c + 2, n_x)):
                    j = heads[rr * n_x + cc]
                    while j >= 0:
                        other = nodes[middle[j]]
                        ds = (other[NODE_X] - x) * cos + (other[NODE_Y] - y) * sin
                        du = (other[NODE_Y] - y) * cos - (other[NODE_X] - x) * sin
                        turn = other[NODE_ANGLE] - angle
                        if (
                            j != i
                            and abs(ds) <= along
                            and abs(du) <= across
                            and abs(np.sin(turn)) < PARALLEL_SINE
                        ):
                            if entry[j] < first:
                                if n == len(pairs):
                                    pairs = np.concatenate((pairs, np.empty_like(pairs)))
                                    how = np.concatenate((how, np.empty_like(how)))
                                entry[j] = n
                                nearest[j] = np.inf
                                pairs[n, 0], pairs[n, 1] = i, j
                                n += 1
                            if abs(ds) < nearest[j]:
                                e = entry[j]
                                nearest[j] = abs(ds)
                                how[e, PASS_ALONG] = s + ds
                                how[e, PASS_SENSE] = 1.0 if np.cos(turn) > 0 else -1.0
                                how[e, PASS_ACROSS] = du
                        j = following[j]
        for e in range(first, n):
            how[e, PASS_ALONG] -= begin
    return pairs[:n].copy(), how[:n].copy()
