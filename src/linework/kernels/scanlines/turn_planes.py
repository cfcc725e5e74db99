"""Kernels for the heights of turns: the normal equations of a plane for each, the height of each cell eliminated.

The matrix has a block of 3 x 3 for every two turns that see a cell: one pass over the cells makes all of them, where
products of sparse matrices look for the places of their numbers again and again. Sums are in the order of looks and cells.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from linework.arrays import BoolArray, FloatArray, IntArray

#: Sums of a block: of the looks of a turn, of what cells take away from that, and of their means.
OF_LOOKS, OF_CELLS, OF_MEANS = range(3)
#: Unknowns of a turn: its height and two slopes.
UNKNOWNS = 3


class Looks(NamedTuple):
    """What turns saw of cells.

    Parameters
    ----------
    order, starts
        (n,) int64: the looks cell by cell, ascending in each; (cells + 1,) int64: where each cell's begin.
    turn
        (n,) int64 number of the turn of each look.
    away
        (n, 2) place of each, from the middle of what its turn saw. [m]
    """

    order: IntArray
    starts: IntArray
    turn: IntArray
    away: FloatArray


@njit(cache=True, nogil=True)
def turns_that_meet(looks: Looks, n_turns: int) -> BoolArray:
    """Return which turns see the same cell, (turns, turns) bool."""
    meet = np.zeros((n_turns, n_turns), dtype=np.bool_)
    for c in range(len(looks.starts) - 1):
        for i in range(looks.starts[c], looks.starts[c + 1]):
            for j in range(looks.starts[c], looks.starts[c + 1]):
                meet[looks.turn[looks.order[i]], looks.turn[looks.order[j]]] = True
    return meet


@njit(cache=True, nogil=True)
def sum_of_turns(
    looks: Looks, z: FloatArray, weight: FloatArray, block: IntArray, n_blocks: int
) -> tuple[FloatArray, FloatArray]:
    """Return the sums of all blocks, (blocks, 3, 3, 3): which sum, row, column; and the right side, (turns, 3).

    Parameters
    ----------
    looks
        What turns saw.
    z, weight
        (n,) height [m] and weight of each look.
    block
        (turns, turns) int64: number of the block of two turns, for all that see the same cell.
    n_blocks
        Number of blocks.
    """
    order, starts, turn, away = looks
    n_turns = len(block)
    out, right, taken = (
        np.zeros((n_blocks, 3, UNKNOWNS, UNKNOWNS)),
        np.zeros((n_turns, UNKNOWNS)),
        np.zeros((n_turns, UNKNOWNS)),
    )
    row = np.ones(UNKNOWNS)
    for i in range(len(z)):
        t = turn[i]
        at, w = block[t, t], weight[i]
        row[1], row[2] = away[i, 0], away[i, 1]
        for a in range(UNKNOWNS):
            right[t, a] += row[a] * (w * z[i])
            for b in range(UNKNOWNS):
                out[at, OF_LOOKS, a, b] += row[b] * (w * row[a])
    most = np.max(np.diff(starts))
    which, seen, mean = np.empty(most, np.int64), np.empty((most, UNKNOWNS)), np.empty((most, UNKNOWNS))
    place = np.full(n_turns, -1)
    for c in range(len(starts) - 1):
        n, total, height = 0, 0.0, 0.0
        for j in range(starts[c], starts[c + 1]):
            i = order[j]
            t, w = turn[i], weight[i]
            total += w
            height += w * z[i]
            if place[t] < 0:
                place[t], which[n] = n, t
                seen[n, 0], seen[n, 1], seen[n, 2] = w, w * away[i, 0], w * away[i, 1]
                n += 1
            else:
                k = place[t]
                seen[k, 0] += w
                seen[k, 1] += w * away[i, 0]
                seen[k, 2] += w * away[i, 1]
        per = 1.0 / total
        for k in range(n):
            place[which[k]] = -1
            for a in range(UNKNOWNS):
                mean[k, a] = per * seen[k, a]
                taken[which[k], a] += mean[k, a] * height
        _add_cell(which[:n], seen, mean, block, out)
    return out, right - taken


@njit(cache=True, nogil=True)
def _add_cell(which: IntArray, seen: FloatArray, mean: FloatArray, block: IntArray, out: FloatArray) -> None:
    """Add what a cell gives to the blocks of the turns that see it; arguments as in `sum_of_turns`."""
    for p in range(len(which)):
        for q in range(len(which)):
            at = block[which[p], which[q]]
            for a in range(UNKNOWNS):
                for b in range(UNKNOWNS):
                    out[at, OF_CELLS, a, b] += seen[q, b] * mean[p, a]
                    out[at, OF_MEANS, a, b] += mean[q, b] * mean[p, a]
