"""Straight lines fitted locally along places of an image line, at chosen rows."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray

#: Neighbouring rows see the same grain of asphalt and paint, and the same pixels after resampling: so many err as
#: one.
SHARED_ROWS = 2.0


@njit(cache=True, nogil=True)
def fit_at(
    along: FloatArray, value: FloatArray, sigma: FloatArray, at: FloatArray, half: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the value of a local straight line at chosen places, and its standard deviation.

    Parameters
    ----------
    along, value, sigma
        (n,) places in ascending order, what was measured there, and how well (NaN values count as not measured).
    at, half
        (m,) where, and half the window there, in the unit of `along`.

    Notes
    -----
    Weights fall off with the distance (tricube); a value more than 2 standard deviations off weighs less (Huber).
    Where less than 3 values are in a window, it is widened. The standard deviation is the larger one of that by
    the values' own and that by their scatter.
    """
    n, m = len(along), len(at)
    out, spread = np.full(m, np.nan), np.full(m, np.nan)
    for k in range(m):
        reach = max(half[k], 1e-6)
        for _ in range(6):
            count = 0
            for i in range(n):
                if abs(along[i] - at[k]) < reach and not math.isnan(value[i]):
                    count += 1
            if count >= 3:
                break
            reach *= 2.0
        a = b = 0.0
        scale = 1.0
        for turn in range(6):
            s = sx = sxx = sy = sxy = 0.0
            s2 = s2x = s2xx = 0.0
            for i in range(n):
                x = along[i] - at[k]
                if abs(x) >= reach or math.isnan(value[i]):
                    continue
                w = (1.0 - abs(x / reach) ** 3) ** 3 / sigma[i] ** 2
                if turn > 0:
                    off = abs(value[i] - a - b * x) / sigma[i]
                    if off > 2.0:
                        w *= 2.0 / off
                s, sx, sxx = s + w, sx + w * x, sxx + w * x * x
                sy, sxy = sy + w * value[i], sxy + w * x * value[i]
                v = w * w * sigma[i] ** 2
                s2, s2x, s2xx = s2 + v, s2x + v * x, s2xx + v * x * x
            if s <= 0.0:
                break
            det = s * sxx - sx * sx
            if det > 1e-6 * s * s * reach * reach * 0.01:
                a, b = (sxx * sy - sx * sxy) / det, (s * sxy - sx * sy) / det
                var = (sxx * sxx * s2 - 2.0 * sxx * sx * s2x + sx * sx * s2xx) / (det * det)
            else:
                a, b, var = sy / s, 0.0, s2 / (s * s)
            # The scatter says how well the values really are known
            total = weight = 0.0
            for i in range(n):
                x = along[i] - at[k]
                if abs(x) < reach and not math.isnan(value[i]):
                    w = (1.0 - abs(x / reach) ** 3) ** 3
                    off = min(abs(value[i] - a - b * x) / sigma[i], 3.0 * scale)
                    total, weight = total + w * off * off, weight + w
            scale = max(math.sqrt(total / weight), 1.0) if weight > 0.0 else 1.0
            out[k], spread[k] = a, math.sqrt(max(var, 0.0) * SHARED_ROWS) * scale
    return out, spread
