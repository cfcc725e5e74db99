"""Which followed lines pass where others were begun."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray


@njit(cache=True, nogil=True)
def passing(
    nodes: FloatArray,
    offsets: IntArray,
    middle: IntArray,
    frame: tuple[int, int, float],
    reach: tuple[float, float],
) -> tuple[IntArray, FloatArray]:
    """Return which lines of `follow_all` pass where which others were begun, near and parallel.

    Returns
    -------
    pairs
        (n, 2): the line that passes, and the line whose middle it passes.
    how
        (n, 3): arc length from the one's middle to the other's (negative: before it); 1 where both have one
        direction, else -1; distance across.
    """
    along, across = reach
    n_x, n_y, cell = frame
    n_lines = len(middle)
    heads = np.full(n_x * n_y, -1, dtype=np.int64)
    following, entry = np.full(n_lines, -1, dtype=np.int64), np.full(n_lines, -1, dtype=np.int64)
    nearest = np.empty(n_lines)
    for j in range(n_lines):
        c, r = int(np.floor(nodes[middle[j], 0] / cell)), int(np.floor(nodes[middle[j], 1] / cell))
        if c >= 0 and c < n_x and r >= 0 and r < n_y:
            following[j] = heads[r * n_x + c]
            heads[r * n_x + c] = j
    pairs, how = np.empty((256, 2), dtype=np.int64), np.empty((256, 3))
    n = 0
    for i in range(n_lines):
        first = n
        begin = 0.0  # arc length of the line's own middle
        s = 0.0
        for k in range(offsets[i], offsets[i + 1]):
            x, y, angle = nodes[k, 0], nodes[k, 1], nodes[k, 2]
            if k > offsets[i]:
                s += np.hypot(x - nodes[k - 1, 0], y - nodes[k - 1, 1])
            if k == middle[i]:
                begin = s
            cos, sin = np.cos(angle), np.sin(angle)
            c, r = int(np.floor(x / cell)), int(np.floor(y / cell))
            for rr in range(max(r - 1, 0), min(r + 2, n_y)):
                for cc in range(max(c - 1, 0), min(c + 2, n_x)):
                    j = heads[rr * n_x + cc]
                    while j >= 0:
                        other = nodes[middle[j]]
                        ds = (other[0] - x) * cos + (other[1] - y) * sin
                        du = (other[1] - y) * cos - (other[0] - x) * sin
                        turn = other[2] - angle
                        if (
                            j != i
                            and abs(ds) <= along
                            and abs(du) <= across
                            and abs(np.sin(turn)) < 0.34  # 20 degrees
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
                                how[e, 0] = s + ds
                                how[e, 1] = 1.0 if np.cos(turn) > 0 else -1.0
                                how[e, 2] = du
                        j = following[j]
        for e in range(first, n):
            how[e, 0] -= begin
    return pairs[:n].copy(), how[:n].copy()
