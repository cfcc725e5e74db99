"""What the fine cells around a place tell before their points are looked at: which way it rises, gets rough, bright.

Positions are local: from the survey's origin. [m]
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.boundaries.profiles import CLIP_M
from linework.kernels.cells.floor import FINE_M
from linework.kernels.cells.places import AREA_M

#: Channels: height over the plane; whether there is a rise at all, of a low kerb or a high wall; roughness;
#: brightness.
CHANNEL_HEIGHT, RISE, ROUGH, CHANNEL_BRIGHT = 0, 1, 2, 3
#: What counts as a rise; and the roughest verge. [m]
LOW_KERB_M, ROUGHEST_M = 0.05, 0.06
#: Cells of one point know little, of many not ever more: weights of channels by number of points.
MOST_WEIGHT = 5.0


@njit(cache=True, nogil=True)
def fit_surroundings(
    sums: FloatArray,
    span: IntArray,
    place: tuple[float, float],
    plane: FloatArray,
    noise: float,
    out: FloatArray,
) -> tuple[float, float]:
    """Fit a slope to each channel over the fine cells of the search area.

    out: (4, 4) per channel slopes east and north, the share they explain, and the mean.

    Returns
    -------
    rise
        Between the lowest and the highest cell, beyond their noise [m]; -1 with too few cells.
    floor
        Share of the cells that are floor: as high and as smooth as the plane.
    """
    x, y = place
    c0, r0 = int(np.floor(x / FINE_M)) - span[0], int(np.floor(y / FINE_M)) - span[1]
    n, sx, sy, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    t = np.zeros((4, 4))
    f = np.empty(4)
    low, high, cells, flat = 1e9, -1e9, 0.0, 0.0
    a, b = plane[1], plane[2]
    out[:] = 0.0
    for r in range(max(r0 - 3, 0), min(r0 + 3, span[3])):
        for c in range(max(c0 - 3, 0), min(c0 + 3, span[2])):
            s = sums[r * span[2] + c]
            if s[0] == 0.0:
                continue
            m = 1.0 / s[0]
            ox, oy = (span[0] + c + 0.5) * FINE_M - x, (span[1] + r + 0.5) * FINE_M - y
            dx, dy = s[1] * m + ox, s[2] * m + oy
            if dx * dx + dy * dy > AREA_M**2:
                continue
            # Mean and mean square of the heights over the plane, from the sums
            p = plane[0] + a * ox + b * oy
            d = s[3] * m - p - (a * s[1] + b * s[2]) * m
            square = s[9] + s[0] * p * p + a * a * s[4] + b * b * s[6] + 2.0 * a * b * s[5]
            square += 2.0 * (p * (a * s[1] + b * s[2]) - p * s[3] - a * s[7] - b * s[8])
            rough = np.sqrt(max(square * m, 0.0))
            doubt = 2.0 * noise * np.sqrt(m)
            low, high = min(low, d + doubt), max(high, d - doubt)
            cells += 1.0
            flat += 1.0 if rough <= 2.0 * noise + 0.001 else 0.0
            if abs(d) > CLIP_M:
                continue
            w = min(s[0], MOST_WEIGHT)
            n += w
            sx += w * dx
            sy += w * dy
            xx += w * dx * dx
            xy += w * dx * dy
            yy += w * dy * dy
            f[0], f[1] = d, min(max(d, -LOW_KERB_M), LOW_KERB_M)
            f[2], f[3] = min(rough, ROUGHEST_M), s[10] * m
            for k in range(4):
                t[k, 0] += w * f[k]
                t[k, 1] += w * dx * f[k]
                t[k, 2] += w * dy * f[k]
                t[k, 3] += w * f[k] * f[k]
    if n < 6.0:
        return -1.0, 0.0
    mx, my = sx / n, sy / n
    xx, xy, yy = xx / n - mx * mx, xy / n - mx * my, yy / n - my * my
    det = xx * yy - xy * xy
    if det <= 1e-6:
        return -1.0, 0.0
    for k in range(4):
        mean = t[k, 0] / n
        fx, fy, ff = t[k, 1] / n - mx * mean, t[k, 2] / n - my * mean, t[k, 3] / n - mean * mean
        gx, gy = (fx * yy - fy * xy) / det, (fy * xx - fx * xy) / det
        if ff > 0.0:
            out[k, 0], out[k, 1], out[k, 2], out[k, 3] = gx, gy, (gx * fx + gy * fy) / ff, mean
    return high - low, flat / cells
