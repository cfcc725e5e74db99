"""Kernels for a hanging wire: heights, residuals of points, least-squares fit; see `linework.lines.catenary`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from linework.arrays import AnyArray

#: |k u| below which the closed forms lose digits and their series are used, whose next term is 1e-9 relative.
SERIES_BELOW = 1e-3
#: Ridge of the normal equations, as a share of the weight: keeps wires of few stations solvable.
_RIDGE = 1e-9
#: Gauss-Newton stops when no scaled unknown moves farther than this. [m]
_AT_REST = 1e-10
#: Least extent that the unknowns are scaled by. [m]
_LEAST_EXTENT_M = 1e-3


class WireCurve(NamedTuple):
    """A catenary: reference station [m], height there [m], slope there, curvature [1/m]."""

    station: float
    height: float
    slope: float
    curvature: float


@njit(cache=True, nogil=True)
def terms(u: float, k: float) -> tuple[float, float]:
    """Return sinh(k u) / k and (cosh(k u) - 1) / k, also for k = 0."""
    x = k * u
    if abs(x) < SERIES_BELOW:
        return u * (1.0 + x * x / 6.0), u * (x / 2.0 * (1.0 + x * x / 12.0))
    half = math.sinh(x / 2.0)
    return u * (math.sinh(x) / x), u * (2.0 * (half * half) / x)


@njit(cache=True, nogil=True)
def wire_height(station: float, curve: WireCurve) -> float:
    """Return the height of a wire at one station [m]."""
    odd, even = terms(station - curve.station, curve.curvature)
    return curve.height + curve.slope * odd + math.hypot(1.0, curve.slope) * even


@njit(cache=True, nogil=True)
def wire_heights(station: AnyArray, curve: WireCurve) -> AnyArray:
    """Return the heights (n,) of a wire at (n,) stations [m]."""
    out = np.empty(len(station))
    for i in range(len(station)):
        out[i] = wire_height(station[i], curve)
    return out


@njit(cache=True, nogil=True)
def residuals(
    xyz: AnyArray, line: tuple[float, float, float, float], curve: WireCurve
) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Return stations, offsets and heights above a wire of points (n, 3), (n,) each [m].

    `line` is the wire's line in plan: x and y of a point, and of a unit direction.
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
    """Return the derivatives of the height by z_c, m and k, at a distance `u` [m] from the reference station."""
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
) -> tuple[WireCurve, AnyArray, float]:
    """Fit a catenary by weighted least squares (Gauss-Newton).

    Parameters
    ----------
    s, z, w
        (n,) stations [m], heights [m] and weights.
    n_unknowns
        3; or 2 with the curvature held at 0.
    most_steps
        Largest number of Gauss-Newton steps.

    Returns
    -------
    curve
        The wire.
    cofactor
        (3, 3) inverse normal matrix of (z_c, m, k).
    square
        Weighted mean of the squared residuals. [m2]
    """
    total = w.sum()
    middle, mean = (w * s).sum() / total, (w * z).sum() / total
    reach = max(np.abs(s - middle).max(), _LEAST_EXTENT_M)
    scale = (1.0, 1.0 / reach, 2.0 / (reach * reach))
    curve = WireCurve(middle, mean, 0.0, 0.0)
    cofactor = np.zeros((3, 3))
    for _ in range(most_steps):
        normal, right = np.zeros((n_unknowns, n_unknowns)), np.zeros(n_unknowns)
        for i in range(len(s)):
            if w[i] == 0.0:
                continue
            v = derivatives(s[i] - middle, curve.slope, curve.curvature)
            off = z[i] - wire_height(s[i], curve)
            for a in range(n_unknowns):
                wv = w[i] * v[a] * scale[a]
                right[a] += wv * off
                for b in range(n_unknowns):
                    normal[a, b] += wv * v[b] * scale[b]
        for a in range(n_unknowns):
            normal[a, a] += _RIDGE * total
        inverse = np.linalg.inv(normal)
        step = np.zeros(3)
        for a in range(n_unknowns):
            for b in range(n_unknowns):
                step[a] += inverse[a, b] * right[b]
                cofactor[a, b] = inverse[a, b] * scale[a] * scale[b]
        curve = WireCurve(
            middle,
            curve.height + step[0] * scale[0],
            curve.slope + step[1] * scale[1],
            curve.curvature + step[2] * scale[2],
        )
        if np.abs(step).max() < _AT_REST:
            break
    squares = 0.0
    for i in range(len(s)):
        if w[i] > 0.0:
            squares += w[i] * (z[i] - wire_height(s[i], curve)) ** 2
    return curve, cofactor, squares / total
