"""Kernel that fits the slopes of height, roughness and brightness to the fine cells around a place.

Positions are local: from the survey's origin. [m]
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.boundaries.profiles import CLIP_M, PLANE_EAST, PLANE_HEIGHT, PLANE_NORTH
from linework.kernels.cells.floor import (
    FINE_M,
    SPAN_COLS,
    SPAN_ROWS,
    SPAN_SOUTH,
    SPAN_WEST,
    SUM_N,
    SUM_STRENGTH,
    SUM_X,
    SUM_XX,
    SUM_XY,
    SUM_XZ,
    SUM_Y,
    SUM_YY,
    SUM_YZ,
    SUM_Z,
    SUM_ZZ,
)
from linework.kernels.cells.places import AREA_M

#: Fields: height over the plane; the same clipped to a low kerb, so that a kerb and a wall count alike;
#: roughness; brightness.
FIELD_HEIGHT, RISE, ROUGH, FIELD_BRIGHT = 0, 1, 2, 3
#: Height at which a rise is clipped: a low kerb; and roughness at which it is clipped: the roughest verge. [m]
LOW_KERB_M, ROUGHEST_M = 0.05, 0.06
#: Largest weight of a cell, which is its number of points: neighbouring points are not independent.
MOST_WEIGHT = 5.0
#: Reach of the fine cells about a place: `AREA_M`. [cells]
_REACH_CELLS = 3
#: Noise of a cell's mean that a rise must exceed, and roughness that counts as floor, in noise of the floor.
_NOISE_SIGMAS = 2.0
#: Slack of the roughness that counts as floor, for floors without noise. [m]
_SLACK_M = 0.001
#: Least total weight, and least determinant [m4], that a slope is fitted with.
_LEAST_WEIGHT, _LEAST_DETERMINANT = 6.0, 1e-6
#: Elements of a slope: east, north, share of the variance that it explains, mean of the field.
SLOPE_EAST, SLOPE_NORTH, SLOPE_SHARE, SLOPE_MEAN = 0, 1, 2, 3
#: Number of fields, of elements of a slope, and of sums per field: weighted f, x f, y f, f f.
_FOUR = 4


@njit(cache=True, nogil=True)
def fit_surroundings(
    sums: FloatArray,
    span: IntArray,
    place: tuple[float, float],
    plane: FloatArray,
    noise: float,
    out: FloatArray,
) -> tuple[float, float]:
    """Fit a slope to each field over the fine cells of the search area.

    Parameters
    ----------
    sums, span
        (fine cells, 11) and (4,) int64; see `linework.kernels.cells.floor.cell_sums`.
    place
        x and y. [m]
    plane
        (3,) floor of the place, elements `PLANE_HEIGHT` to `PLANE_NORTH`.
    noise
        Rms distance of the floor's points. [m]
    out
        (4, 4), written: fields by elements `SLOPE_EAST` to `SLOPE_MEAN`.

    Returns
    -------
    rise
        Difference of the highest and the lowest cell, beyond their noise [m]; -1 with too few cells.
    floor
        Share of the cells that are floor: as smooth as the plane.
    """
    x, y = place
    c0, r0 = int(np.floor(x / FINE_M)) - span[SPAN_WEST], int(np.floor(y / FINE_M)) - span[SPAN_SOUTH]
    n, sx, sy, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    t = np.zeros((_FOUR, _FOUR))
    f = np.empty(_FOUR)
    low, high, cells, flat = 1e9, -1e9, 0.0, 0.0
    a, b = plane[PLANE_EAST], plane[PLANE_NORTH]
    out[:] = 0.0
    for r in range(max(r0 - _REACH_CELLS, 0), min(r0 + _REACH_CELLS, span[SPAN_ROWS])):
        for c in range(max(c0 - _REACH_CELLS, 0), min(c0 + _REACH_CELLS, span[SPAN_COLS])):
            at = r * span[SPAN_COLS] + c
            if sums[at, SUM_N] == 0.0:
                continue
            m = 1.0 / sums[at, SUM_N]
            ox, oy = (span[SPAN_WEST] + c + 0.5) * FINE_M - x, (span[SPAN_SOUTH] + r + 0.5) * FINE_M - y
            dx, dy = sums[at, SUM_X] * m + ox, sums[at, SUM_Y] * m + oy
            if dx * dx + dy * dy > AREA_M**2:
                continue
            # Mean and mean square of the heights over the plane, from the sums
            p = plane[PLANE_HEIGHT] + a * ox + b * oy
            tilted = a * sums[at, SUM_X] + b * sums[at, SUM_Y]
            d = sums[at, SUM_Z] * m - p - tilted * m
            square = (
                sums[at, SUM_ZZ]
                + sums[at, SUM_N] * p * p
                + a * a * sums[at, SUM_XX]
                + b * b * sums[at, SUM_YY]
            )
            square = square + 2.0 * a * b * sums[at, SUM_XY]
            square += 2.0 * (p * tilted - p * sums[at, SUM_Z] - a * sums[at, SUM_XZ] - b * sums[at, SUM_YZ])
            rough = np.sqrt(max(square * m, 0.0))
            doubt = _NOISE_SIGMAS * noise * np.sqrt(m)
            low, high = min(low, d + doubt), max(high, d - doubt)
            cells += 1.0
            flat += 1.0 if rough <= _NOISE_SIGMAS * noise + _SLACK_M else 0.0
            if abs(d) > CLIP_M:
                continue
            w = min(sums[at, SUM_N], MOST_WEIGHT)
            n += w
            sx += w * dx
            sy += w * dy
            xx += w * dx * dx
            xy += w * dx * dy
            yy += w * dy * dy
            f[FIELD_HEIGHT], f[RISE] = d, min(max(d, -LOW_KERB_M), LOW_KERB_M)
            f[ROUGH], f[FIELD_BRIGHT] = min(rough, ROUGHEST_M), sums[at, SUM_STRENGTH] * m
            for k in range(_FOUR):
                t[k, 0] += w * f[k]
                t[k, 1] += w * dx * f[k]
                t[k, 2] += w * dy * f[k]
                t[k, 3] += w * f[k] * f[k]
    if n < _LEAST_WEIGHT:
        return -1.0, 0.0
    mx, my = sx / n, sy / n
    xx, xy, yy = xx / n - mx * mx, xy / n - mx * my, yy / n - my * my
    det = xx * yy - xy * xy
    if det <= _LEAST_DETERMINANT:
        return -1.0, 0.0
    for k in range(_FOUR):
        mean = t[k, 0] / n
        fx, fy, ff = t[k, 1] / n - mx * mean, t[k, 2] / n - my * mean, t[k, 3] / n - mean * mean
        gx, gy = (fx * yy - fy * xy) / det, (fy * xx - fx * xy) / det
        if ff > 0.0:
            out[k, SLOPE_EAST], out[k, SLOPE_NORTH] = gx, gy
            out[k, SLOPE_SHARE], out[k, SLOPE_MEAN] = (gx * fx + gy * fy) / ff, mean
    return high - low, flat / cells
