"""Pieces of lines seen by many pairs, fused place by place: each weighs by how well it is known."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.tracking.track import first_at

#: Columns of a table of pieces: place and direction in plan, height, variances across and of the height.
PIECE_X, PIECE_Y, PIECE_Z, PIECE_UX, PIECE_UY, VAR, VAR_Z = range(7)
#: Pieces of one line have directions within this (cosine of 15 degrees).
SAME_WAY = 0.966


@njit(cache=True, nogil=True)
def fuse(
    pieces: FloatArray, order: IntArray, codes: IntArray, lattice: tuple[float, float, float, int], along_m: float,
    across_m: tuple[float, float],
) -> tuple[IntArray, IntArray, FloatArray]:  # fmt: skip
    """Return the seed of each fused place, the place of each piece, and the fused values.

    Parameters
    ----------
    pieces
        (n, 7) in order of cells.
    order
        (n,) the pieces, the best known first: each that is not yet in a place makes one of its own, with all
        free pieces near by of the same direction.
    codes, lattice
        Cell of each piece, ascending; west, south edge and size of the cells, number of columns.
    along_m
        Half the length of a place.
    across_m
        Pieces of one line differ across by less than the first and 3 of their own standard deviations, at most
        by the second.

    Returns
    -------
    (m,) seeds; (n,) places; (m, 7) fused offset across from the seed, direction (2), height, variance across and
    of the height, and the pieces' mean squared offset over their variance.
    """
    n = len(pieces)
    west, south, cell, n_cols = lattice
    place = np.full(n, -1, dtype=np.int64)
    seeds = np.empty(n, dtype=np.int64)
    fused = np.empty((n, 7))
    near = np.empty(n, dtype=np.int64)
    off = np.empty(n)
    reach = math.hypot(along_m, across_m[1])
    m = 0
    for i in order:
        if place[i] >= 0:
            continue
        x, y, ux, uy = pieces[i, PIECE_X], pieces[i, PIECE_Y], pieces[i, PIECE_UX], pieces[i, PIECE_UY]
        count = 0
        row0, row1 = int((y - reach - south) // cell), int((y + reach - south) // cell)
        col0, col1 = int((x - reach - west) // cell), int((x + reach - west) // cell)
        for row in range(row0, row1 + 1):
            for j in range(first_at(codes, row * n_cols + col0), first_at(codes, row * n_cols + col1 + 1)):
                if place[j] >= 0:
                    continue
                dx, dy = pieces[j, PIECE_X] - x, pieces[j, PIECE_Y] - y
                s, v = dx * ux + dy * uy, dy * ux - dx * uy
                cosine = ux * pieces[j, PIECE_UX] + uy * pieces[j, PIECE_UY]
                if abs(s) > along_m or abs(cosine) < SAME_WAY:
                    continue
                turn = (ux * pieces[j, PIECE_UY] - uy * pieces[j, PIECE_UX]) / cosine
                v -= s * turn
                bound = across_m[0] + 3.0 * math.sqrt(pieces[i, VAR] + pieces[j, VAR])
                if abs(v) <= min(bound, across_m[1]):
                    near[count], off[count] = j, v
                    count += 1
        # The mean, pieces that differ weighing less (Huber): twice
        mean = 0.0
        for _ in range(3):
            total = weight = 0.0
            for k in range(count):
                w = 1.0 / pieces[near[k], VAR]
                e = abs(off[k] - mean) * math.sqrt(w)
                if e > 2.0:
                    w *= 2.0 / e
                total, weight = total + w * off[k], weight + w
            mean = total / weight
        sx = sy = sz = wz = spread = 0.0
        for k in range(count):
            j = near[k]
            w = 1.0 / pieces[j, VAR]
            sign = 1.0 if ux * pieces[j, PIECE_UX] + uy * pieces[j, PIECE_UY] > 0.0 else -1.0
            sx, sy = sx + w * sign * pieces[j, PIECE_UX], sy + w * sign * pieces[j, PIECE_UY]
            sz, wz = sz + pieces[j, PIECE_Z] / pieces[j, VAR_Z], wz + 1.0 / pieces[j, VAR_Z]
            spread += (off[k] - mean) ** 2 * w
            place[j] = m
        length = math.hypot(sx, sy)
        seeds[m] = i
        fused[m] = (mean, sx / length, sy / length, sz / wz, 1.0 / weight, 1.0 / wz, spread / count)
        m += 1
    return seeds[:m].copy(), place, fused[:m].copy()


@njit(cache=True, nogil=True)
def looked_at(
    places: FloatArray, stations: FloatArray, codes: IntArray, lattice: tuple[float, float, float, int],
    view: tuple[float, float, float, float],
) -> IntArray:  # fmt: skip
    """Return (m,) how many of the stations looked at each place.

    Parameters
    ----------
    places : (m, 2)
    stations
        (k, 4) in order of cells: place of the camera and direction of its view, in plan.
    codes, lattice
        Cell of each station, ascending; west, south edge and size of the cells, number of columns. A cell is as
        large as what a station sees.
    view
        Nearest and farthest distance ahead [m]; largest slope of the rays to the left and to the right.
    """
    west, south, cell, n_cols = lattice
    out = np.zeros(len(places), dtype=np.int64)
    for i in range(len(places)):
        col, row = int((places[i, 0] - west) // cell), int((places[i, 1] - south) // cell)
        if col < 0 or col >= n_cols:
            continue
        for r in range(row - 1, row + 2):
            first = first_at(codes, r * n_cols + max(col - 1, 0))
            for k in range(first, first_at(codes, r * n_cols + min(col + 1, n_cols - 1) + 1)):
                dx, dy = places[i, 0] - stations[k, 0], places[i, 1] - stations[k, 1]
                ahead = dx * stations[k, 2] + dy * stations[k, 3]
                if ahead < view[0] or ahead > view[1]:
                    continue
                left = dy * stations[k, 2] - dx * stations[k, 3]
                if -view[3] * ahead <= left <= view[2] * ahead:
                    out[i] += 1
    return out
