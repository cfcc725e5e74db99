"""Strip integrals of an image of few occupied cells, exactly; and the peaks of the result."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

Array = npt.NDArray[Any]


@njit(cache=True, nogil=True)
def below(t: float, outer: float, inner: float, top: float, curve: float) -> float:
    """Return the share of a cell's area that projects below `t` (its centre projects to 0).

    The projection is a trapezoid: `top` high for ``|t| <= inner``, falling to zero at ``outer``; its
    integral is a parabola there, `curve` times the squared distance from the foot.
    """
    if t <= -outer:
        return 0.0
    if t >= outer:
        return 1.0
    if t < -inner:
        return curve * (t + outer) * (t + outer)
    if t > inner:
        return 1.0 - curve * (outer - t) * (outer - t)
    return 0.5 + top * t


@njit(cache=True, nogil=True)
def radon(
    x: Array,
    y: Array,
    weights: Array,
    cell: tuple[float, float, float],
    angles: Array,
    step: float,
    n_half: int,
) -> Array:
    """Return (n_angles, 2 n_half + 1) strip integrals over the strip's width.

    `cell` is width, height and the turn of the cell's axes from x and y [rad]. Bin k covers
    ``(k - n_half - 1/2) step <= rho < (k - n_half + 1/2) step``; what projects beyond the bins is left out.
    Only occupied cells are visited, and per angle only the bins that each touches (two or three for bins
    as wide as a cell).
    """
    n_bins = 2 * n_half + 1
    values = np.zeros((angles.size, n_bins), np.float64)
    width, height, turn = cell
    area = width * height / step
    for i in range(angles.size):
        row = values[i]
        cos, sin = math.cos(angles[i]) / step, math.sin(angles[i]) / step
        a = abs(width * math.cos(angles[i] - turn)) / step
        b = abs(height * math.sin(angles[i] - turn)) / step
        outer, inner = 0.5 * (a + b), 0.5 * abs(a - b)
        top = 1.0 / (outer + inner)
        # Along an axis the trapezoid is a box and has no sloping sides
        curve = 0.5 * top / (outer - inner) if outer > inner else 0.0
        for j in range(x.size):
            # Everything in bins from here on; bin k lies between the edges k and k + 1
            centre = x[j] * cos + y[j] * sin + n_half + 0.5
            first = math.floor(centre - outer)
            last = math.floor(centre + outer)
            if last < 0 or first >= n_bins:
                continue
            amount = weights[j] * area
            low = 0.0
            if first < 0:
                low = below(-centre, outer, inner, top, curve)
                first = 0
            for k in range(first, min(last, n_bins - 1)):
                high = below(k + 1.0 - centre, outer, inner, top, curve)
                row[k] += amount * (high - low)
                low = high
            if last < n_bins:
                row[last] += amount * (1.0 - low)
            else:
                row[n_bins - 1] += amount * (below(n_bins - centre, outer, inner, top, curve) - low)
    return values
