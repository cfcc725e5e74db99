"""Recorded places that nothing connects: each has a road of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from linework.arrays import AnyArray, IntArray

_AROUND = ((0, 0), (1, 0), (0, 1), (1, 1), (1, -1), (-1, 0), (0, -1), (-1, -1), (-1, 1))


@dataclass(frozen=True, slots=True)
class Islands:
    """Groups of blocks of 64 m that hold points and touch, also at their corners.

    Parameters
    ----------
    codes
        (n,) int64, rising: the blocks; `number` (n,) int32: the island of each.
    """

    codes: IntArray
    number: AnyArray

    @classmethod
    def of(cls, blocks: IntArray) -> Islands:
        """Return the islands of blocks (n, 2): their numbers east and north. They come back row by row.

        >>> Islands.of(np.array([[0, 0], [1, 1], [3, 0]])).number.tolist()
        [0, 1, 0]
        """
        codes = np.unique(_code(blocks[:, 0], blocks[:, 1]))
        east, north = codes & 0xFFFFFFFF, codes >> 32
        links = []
        for de, dn in _AROUND[1:5]:
            other = _code((east - 2**31) + de, north + dn)
            at = np.searchsorted(codes, other).clip(0, max(len(codes) - 1, 0))
            here = np.flatnonzero(codes[at] == other) if len(codes) else np.zeros(0, dtype=np.int64)
            links.append(np.stack([here, at[here]]))
        return cls(codes, united(len(codes), np.concatenate(links, axis=1).T))

    def at(self, east: IntArray, north: IntArray) -> AnyArray:
        """Return the island (n,) of each block (or of one beside it), -1 where there is none."""
        found = np.full(len(east), -1, dtype=np.int32)
        for de, dn in _AROUND:
            missing = np.flatnonzero(found < 0)
            if len(missing) == 0 or len(self.codes) == 0:
                break
            code = _code(east[missing] + de, north[missing] + dn)
            at = np.searchsorted(self.codes, code).clip(0, len(self.codes) - 1)
            found[missing] = np.where(self.codes[at] == code, self.number[at], -1)
        return found


def united(n: int, links: AnyArray) -> AnyArray:
    """Return the group (n,) int32 of each of n things of which the pairs (m, 2) belong together.

    >>> united(4, np.array([[0, 2], [2, 3]])).tolist()
    [0, 1, 0, 0]
    """
    if n == 0:
        return np.zeros(0, dtype=np.int32)
    graph = coo_array((np.ones(len(links), dtype=np.int8), (links[:, 0], links[:, 1])), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int32)


def _code(east: IntArray, north: IntArray) -> IntArray:
    return (np.asarray(north, dtype=np.int64) << 32) + (np.asarray(east, dtype=np.int64) + 2**31)
