"""Heights of a hanging wire, what points lie off it, and its least-squares fit; see `linework.lines.catenary`."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import AnyArray

#: Reference station and height there [m], slope, curvature [1/m].
Curve = tuple[float, float, float, float]

#: Below this |k u| the closed forms lose digits and their series (next term 1e-9 relative) take over.
SERIES_BELOW = 1e-3


@njit(cache=True, nogil=True)
def terms(u: float, k: float) -> tuple[float, float]:
    """Return sinh(k u) / k and (cosh(k u) - 1) / k, right for k = 0 too."""
    x = k * u
    if abs(x) < SERIES_BELOW:
        return u * (1.0 + x * x / 6.0), u * (x / 2.0 * (1.0 + x * x / 12.0))
    half = math.sinh(x / 2.0)
    return u * (math.sinh(x) / x), u * (2.0 * (half * half) / x)


@njit(cache=True, nogil=True)
def wire_height(station: float, curve: Curve) -> float:
    """Return the height of a wire at one station [m]."""
    odd, even = terms(station - curve[0], curve[3])
    return curve[1] + curve[2] * odd + math.hypot(1.0, curve[2]) * even


@njit(cache=True, nogil=True)
def wire_heights(station: AnyArray, curve: Curve) -> AnyArray:
    """Return the heights of a wire at (n,) stations [m]."""
    out = np.empty(len(station))
    for i in range(len(station)):
        out[i] = wire_height(station[i], curve)
    return out


@njit(cache=True, nogil=True)
def residuals(xyz: AnyArray, line: Curve, curve: Curve) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Return (n,) stations, offsets and heights above a wire [m] of (n, 3) points.

    `line` is the wire's line in plan: a point and a unit direction.
    """
    n = len(xyz)
    s, o, dz = np.empty(n), np.empty(n), np.empty(n)
    x0, y0, ux, uy = line
    for i in range(n):
        dx, dy = xyz[i, 0] - x0, xyz[i, 1] - y0
        s[i], o[i] = dx * ux + dy * uy, dy * ux - dx * uy
        dz[i] = xyz[i, 2] - wire_height(s[i], curve)
    return s, o, dz


@njit(cache=True, nogil=True)
def derivatives(u: float, m: float, k: float) -> tuple[float, float, float]:
    """Return the derivatives of the height by z_c, m and k, `u` [m] from the reference station."""
    odd, even = terms(u, k)
    stretch = math.hypot(1.0, m)
    x = k * u
    if abs(x) < SERIES_BELOW:
        d_odd, d_even = x * u * u / 3.0, u * u / 2.0 * (1.0 + x * x / 4.0)
    else:
        d_odd, d_even = (u * math.cosh(x) - odd) / k, (u * math.sinh(x) - even) / k
    return 1.0, odd + m / stretch * even, m * d_odd + stretch * d_even


@njit(cache=True, nogil=True)
def fit(
    s: AnyArray, z: AnyArray, w: AnyArray, n_unknowns: int, most_steps: int
) -> tuple[Curve, AnyArray, float]:
    """Return curve, (3, 3) cofactors and the weighted squares about it over the sum of weights."""
    total = w.sum()
    middle, mean = (w * s).sum() / total, (w * z).sum() / total
    reach = max(np.abs(s - middle).max(), 1e-3)
    scale = (1.0, 1.0 / reach, 2.0 / (reach * reach))
    curve = (middle, mean, 0.0, 0.0)
    cofactor = np.zeros((3, 3))
    for _ in range(most_steps):
        normal, right = np.zeros((n_unknowns, n_unknowns)), np.zeros(n_unknowns)
        for i in range(len(s)):
            if w[i] == 0.0:
                continue
            v = derivatives(s[i] - middle, curve[2], curve[3])
            off = z[i] - wire_height(s[i], curve)
            for a in range(n_unknowns):
                wv = w[i] * v[a] * scale[a]
                right[a] += wv * off
                for b in range(n_unknowns):
                    normal[a, b] += wv * v[b] * scale[b]
        for a in range(n_unknowns):
            normal[a, a] += 1e-9 * total
        inverse = np.linalg.inv(normal)
        step = np.zeros(3)
        for a in range(n_unknowns):
            for b in range(n_unknowns):
                step[a] += inverse[a, b] * right[b]
                cofactor[a, b] = inverse[a, b] * scale[a] * scale[b]
        curve = (
            middle,
            curve[1] + step[0] * scale[0],
            curve[2] + step[1] * scale[1],
            curve[3] + step[2] * scale[2],
        )
        if np.abs(step).max() < 1e-10:
            break
    squares = 0.0
    for i in range(len(s)):
        if w[i] > 0.0:
            squares += w[i] * (z[i] - wire_height(s[i], curve)) ** 2
    return curve, cofactor, squares / total
