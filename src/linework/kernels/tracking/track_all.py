"""All lines of a survey: boxes tracked forward and backward from each box that belongs to no line yet."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.tracking.track import (
    FREE,
    JOINS_END,
    LEAD_COLUMNS,
    LINE_END,
    N_END,
    TRACK_UX,
    TRACK_UY,
    absorb,
    next_box,
)


@njit(cache=True, nogil=True)
def track_one(
    boxes: FloatArray,
    codes: IntArray,
    lattice: tuple[float, float, float, int],
    state: tuple[IntArray, FloatArray, IntArray, FloatArray],
    line: int,
    limits: tuple[float, float, float, bool, float],
    strength: FloatArray,
) -> tuple[int, int, int, int, int]:
    """Track the line through box path[0], forward and backward.

    Parameters
    ----------
    boxes, codes, lattice, state, strength
        (k, 8), (k,), tuple, tuple, (k,): as for `linework.kernels.tracking.track.next_box`; path and sense in `state`
        are output.
    line
        The number of the line.
    limits
        As for `next_box`, and the width within which boxes beside the line are absorbed [m].

    Returns
    -------
    The number of boxes, the stop reasons at start and end, and the ends of other lines that it joins there (codes
    as in `owner`; 0: none).
    """
    path, sense, owner, _ = state
    fit = np.zeros(LEAD_COLUMNS)
    longest, widest, least_strength, is_sided, width = limits
    gates = (longest, widest, least_strength, is_sided)
    owner[path[0]] = line
    n = 1
    reasons, joins = np.zeros(2, dtype=np.int64), np.zeros(2, dtype=np.int64)
    for side in range(2):
        fit[:] = 0.0
        while True:
            j, reason = next_box(boxes, codes, lattice, state, n, gates, strength, fit)
            if j < 0:
                reasons[side] = reason
                break
            if owner[j] <= LINE_END:
                reasons[side], joins[side] = JOINS_END, owner[j]
                break
            i = path[n - 1]
            along = sense[n - 1] * (
                boxes[i, TRACK_UX] * boxes[j, TRACK_UX] + boxes[i, TRACK_UY] * boxes[j, TRACK_UY]
            )
            path[n], sense[n] = j, 1.0 if along >= 0.0 else -1.0
            owner[j] = line
            n += 1
            absorb(boxes, codes, lattice, owner, (i, j), width)
        # Backward from the start: the path is reversed
        path[:n] = path[:n][::-1].copy()
        sense[:n] = -sense[:n][::-1].copy()
    return n, reasons[1], reasons[0], joins[1], joins[0]


@njit(cache=True, nogil=True)
def track_all(
    boxes: FloatArray,
    codes: IntArray,
    lattice: tuple[float, float, float, int],
    seeds: IntArray,
    limits: tuple[float, float, float, bool, float],
    strength: FloatArray,
    least_n: int,
) -> tuple[IntArray, FloatArray, IntArray, IntArray, IntArray]:
    """Track lines from seeds, strongest first.

    Parameters
    ----------
    boxes, codes, lattice, strength
        As for `linework.kernels.tracking.track.next_box`.
    seeds
        (k,) int64: boxes to begin at, in this order.
    limits
        As for `track_one`.
    least_n
        Fewest boxes of a line that joins no other.

    Returns
    -------
    path, sense
        (n,) int64, (n,): boxes of all lines, line after line; +1 where a line runs along the box's u-axis, else -1.
    offsets
        (m + 1,) int64: first box of each line.
    reasons
        (m, 2) int64: why a line stops at its start and at its end.
    joins
        (m, 2) int64: 0, or 1 + 2 line + side of the end of an earlier line that continues it.
    """
    n_boxes = len(boxes)
    owner = np.full(n_boxes, FREE, dtype=np.int64)
    inward = np.zeros(n_boxes)
    path, sense = np.empty(n_boxes + 1, dtype=np.int64), np.ones(n_boxes + 1)
    all_path, all_sense = np.empty(n_boxes, dtype=np.int64), np.empty(n_boxes)
    offsets = np.zeros(n_boxes + 1, dtype=np.int64)
    reasons, joins = np.zeros((n_boxes, 2), dtype=np.int64), np.zeros((n_boxes, 2), dtype=np.int64)
    m = 0
    for seed in seeds:
        if owner[seed] != FREE:
            continue
        path[0], sense[0] = seed, 1.0
        n, r0, r1, j0, j1 = track_one(
            boxes, codes, lattice, (path, sense, owner, inward), m, limits, strength
        )
        if n < least_n and j0 == 0 and j1 == 0:
            for k in range(n):
                owner[path[k]] = FREE
            continue
        start = offsets[m]
        all_path[start : start + n], all_sense[start : start + n] = path[:n], sense[:n]
        offsets[m + 1] = start + n
        reasons[m, 0], reasons[m, 1] = r0, r1
        for side, code in ((0, j0), (1, j1)):
            if code == 0:
                for k in range(min(N_END, n)):
                    at = k if side == 0 else n - 1 - k
                    owner[path[at]] = LINE_END - 2 * m - side
                    inward[path[at]] = sense[at] if side == 0 else -sense[at]
                continue
            other = LINE_END - code
            joins[m, side] = 1 + other
            # That end is joined: its boxes are inside a line now
            first, last = offsets[other // 2], offsets[other // 2 + 1]
            for k in range(first, last):
                if owner[all_path[k]] == code:
                    owner[all_path[k]] = other // 2
        m += 1
    return all_path[: offsets[m]], all_sense[: offsets[m]], offsets[: m + 1], reasons[:m], joins[:m]
