"""Fusion of line pieces measured in many stereo pairs, weighted by their variances, and pairs in view of a place."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.tracking.track import first_at

#: Columns of a table of pieces: middle [m], unit direction in plan, variances across and of the height [m^2].
PIECE_X, PIECE_Y, PIECE_Z, PIECE_UX, PIECE_UY, VAR, VAR_Z = range(7)
#: Columns of fused places: offset across from the seed [m], unit direction in plan, height [m], variances across and
#: of the height [m^2], mean squared offset of the pieces over their variance.
FUSED_OFFSET, FUSED_UX, FUSED_UY, FUSED_Z, FUSED_VAR, FUSED_VAR_Z, FUSED_SPREAD = range(7)
FUSED_COLUMNS = 7
#: Columns of a table of stations: the camera [m] and its unit direction of view, in plan.
STATION_X, STATION_Y, STATION_UX, STATION_UY = range(4)
#: Largest angle between pieces of one line, 15 degrees: cosine. How it was chosen is not recorded.
SAME_WAY = 0.966
#: Residual from which a piece weighs less than by its variance (Huber). [sigma]
HUBER_FUSED = 2.0
#: Gate across between two pieces, in standard deviations of their difference.
FUSED_GATE_SIGMAS = 3.0


@njit(cache=True, nogil=True)
def fuse(
    pieces: FloatArray, order: IntArray, codes: IntArray, lattice: tuple[float, float, float, int], along_m: float,
    across_m: tuple[float, float],
) -> tuple[IntArray, IntArray, FloatArray]:  # fmt: skip
    """Return the seed of each fused place, the place of each piece, and the fused values.

    Parameters
    ----------
    pieces
        (n, 7) in ascending order of cells; columns `PIECE_X` to `VAR_Z`.
    order
        (n,) int64: rows of `pieces`, the nearest ones first. Each piece that is still free seeds a place and takes all
        free pieces of the same direction near it.
    codes, lattice
        (n,) int64 cell of each piece, ascending; west and south edge and size of the cells [m], number of columns.
    along_m
        Half the length of a place. [m]
    across_m
        Largest distance across from the seed, beside 3 standard deviations of the difference; and in any case. [m]

    Returns
    -------
    seeds
        (m,) int64: the piece that each place was seeded from.
    place
        (n,) int64: the place of each piece.
    fused
        (m, 7): columns `FUSED_OFFSET` to `FUSED_SPREAD`.
    """
    n = len(pieces)
    west, south, cell, n_cols = lattice
    place = np.full(n, -1, dtype=np.int64)
    seeds = np.empty(n, dtype=np.int64)
    fused = np.empty((n, FUSED_COLUMNS))
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
                bound = across_m[0] + FUSED_GATE_SIGMAS * math.sqrt(pieces[i, VAR] + pieces[j, VAR])
                if abs(v) <= min(bound, across_m[1]):
                    near[count], off[count] = j, v
                    count += 1
        # Weighted mean, then two rounds with Huber weights
        mean = 0.0
        for _ in range(3):
            total = weight = 0.0
            for k in range(count):
                w = 1.0 / pieces[near[k], VAR]
                e = abs(off[k] - mean) * math.sqrt(w)
                if e > HUBER_FUSED:
                    w *= HUBER_FUSED / e
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
    """Return (m,) int64: the number of stations that have each place in view.

    Parameters
    ----------
    places
        (m, 2) in plan. [m]
    stations
        (k, 4) in ascending order of cells; columns `STATION_X` to `STATION_UY`.
    codes, lattice
        (k,) int64 cell of each station, ascending; west and south edge and size of the cells [m], number of columns.
        A cell is at least as large as the range of view, so that the neighbouring cells suffice.
    view
        Nearest and farthest distance ahead [m]; largest slope of the rays to the left and to the right.
    """
    west, south, cell, n_cols = lattice
    nearest, farthest, slope_left, slope_right = view
    out = np.zeros(len(places), dtype=np.int64)
    for i in range(len(places)):
        col, row = int((places[i, 0] - west) // cell), int((places[i, 1] - south) // cell)
        if col < 0 or col >= n_cols:
            continue
        for r in range(row - 1, row + 2):
            first = first_at(codes, r * n_cols + max(col - 1, 0))
            for k in range(first, first_at(codes, r * n_cols + min(col + 1, n_cols - 1) + 1)):
                ux, uy = stations[k, STATION_UX], stations[k, STATION_UY]
                dx, dy = places[i, 0] - stations[k, STATION_X], places[i, 1] - stations[k, STATION_Y]
                ahead = dx * ux + dy * uy
                if ahead < nearest or ahead > farthest:
                    continue
                left = dy * ux - dx * uy
                if -slope_right * ahead <= left <= slope_left * ahead:
                    out[i] += 1
    return out
