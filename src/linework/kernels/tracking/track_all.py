"""Every line of a survey: boxes tracked forward and backward from each that no line has taken yet."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.tracking.track import FREE, JOINS_END, LINE_END, N_END, absorb, next_box


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
    """Follow the line through box path[0], forward and backward, into `path` and `way`.

    limits: as for `next_box`, and the width of what is taken out beside the line [m].

    Returns the number of boxes, the stop reasons at start and end, and the ends of other lines that it joins
    there (codes as in `owner`; 0: none).
    """
    path, way, owner, _ = state
    fit = np.zeros(11)
    gates = limits[:4]
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
            along = way[n - 1] * (boxes[i, 2] * boxes[j, 2] + boxes[i, 3] * boxes[j, 3])
            path[n], way[n] = j, 1.0 if along >= 0.0 else -1.0
            owner[j] = line
            n += 1
            absorb(boxes, codes, lattice, owner, (i, j), limits[4])
        # Backward from the start: the path turned round
        path[:n] = path[:n][::-1].copy()
        way[:n] = -way[:n][::-1].copy()
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
    """Follow lines from `seeds`, strongest first.

    Returns boxes and ways of all lines one after the other, (m + 1,) offsets, (m, 2) stop reasons and (m, 2)
    joins: at start and end of each line; 0, or 1 + 2 line + side of the end of an earlier line that goes on.
    """
    n_boxes = len(boxes)
    owner = np.full(n_boxes, FREE, dtype=np.int64)
    inward = np.zeros(n_boxes)
    path, way = np.empty(n_boxes + 1, dtype=np.int64), np.ones(n_boxes + 1)
    all_path, all_way = np.empty(n_boxes, dtype=np.int64), np.empty(n_boxes)
    offsets = np.zeros(n_boxes + 1, dtype=np.int64)
    reasons, joins = np.zeros((n_boxes, 2), dtype=np.int64), np.zeros((n_boxes, 2), dtype=np.int64)
    m = 0
    for seed in seeds:
        if owner[seed] != FREE:
            continue
        path[0], way[0] = seed, 1.0
        n, r0, r1, j0, j1 = track_one(boxes, codes, lattice, (path, way, owner, inward), m, limits, strength)
        if n < least_n and j0 == 0 and j1 == 0:
            for k in range(n):
                owner[path[k]] = FREE
            continue
        start = offsets[m]
        all_path[start : start + n], all_way[start : start + n] = path[:n], way[:n]
        offsets[m + 1] = start + n
        reasons[m, 0], reasons[m, 1] = r0, r1
        for side, code in ((0, j0), (1, j1)):
            if code == 0:
                for k in range(min(N_END, n)):
                    at = k if side == 0 else n - 1 - k
                    owner[path[at]] = LINE_END - 2 * m - side
                    inward[path[at]] = way[at] if side == 0 else -way[at]
                continue
            other = LINE_END - code
            joins[m, side] = 1 + other
            # That end is taken: its boxes are inside a line now
            first, last = offsets[other // 2], offsets[other // 2 + 1]
            for k in range(first, last):
                if owner[all_path[k]] == code:
                    owner[all_path[k]] = other // 2
        m += 1
    return all_path[: offsets[m]], all_way[: offsets[m]], offsets[: m + 1], reasons[:m], joins[:m]
