"""Kernels for robust fits of one wire: its line in plan, its parabola in height, the kink over a support."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from linework.arrays import AnyArray

#: Tukey's constant: residuals beyond this many deviations have no weight; 95 % efficient on Gaussian noise.
TUKEY = 4.685
#: Standard deviation over median absolute deviation of Gaussian noise.
MAD = 1.4826
#: Fits of a robust fit, each with the weights of the one before.
_ROUNDS = 5
#: Fewest points with weight; with fewer the weights of the round before stay.
_LEAST_POINTS = 4
#: Ridge of the normal equations, as a share of the number of points.
_RIDGE = 1e-9
#: Least extent that stations are scaled by. [m]
_LEAST_EXTENT_M = 1e-3
#: A metre is clear where the ring holds at most a third as many points as the gate.
_CLEAR_SHARE = 3
#: Gap beyond the first and the last clear metre up to which a wire continues without other points. [m]
_BEYOND_M = 1.0
#: Stretches that count as seen when they hold a point. [1/m]
_SEEN_PER_M = 2.0
#: Columns of the sums of two parabolas: u^0 to u^4, z u^0 to z u^2, z^2.
_SUM_ZU, _SUM_ZZ, _SUMS = 5, 8, 9


class OnWireEdges(NamedTuple):
    """Stations that points lie between, and the shift that makes them stations from the survey's origin. [m]."""

    low: float
    high: float
    shift: float


class OnWireRadii(NamedTuple):
    """Radii about a wire: of the gate, and inner and outer of the ring. [m]."""

    gate: float
    inner: float
    outer: float


@njit(cache=True, nogil=True)
def robust_line(
    x: AnyArray, y: AnyArray, least_sigma: float
) -> tuple[float, float, float, float, float, AnyArray]:
    """Fit a line to points in plan by orthogonal least squares, reweighted four times by Tukey's function.

    Parameters
    ----------
    x, y
        (n,) points. [m]
    least_sigma
        Least deviation that outliers are judged by: a residual of four of it never counts as one. [m]

    Returns
    -------
    x0, y0, ux, uy
        A point [m] and the unit direction of the line.
    sigma
        Robust standard deviation across. [m]
    weights
        (n,).
    """
    n = len(x)
    weights = np.ones(n)
    x0, y0, ux, uy, sigma = 0.0, 0.0, 1.0, 0.0, 0.0
    for _ in range(_ROUNDS):
        total = weights.sum()
        x0, y0 = (weights * x).sum() / total, (weights * y).sum() / total
        xx, xy, yy = 0.0, 0.0, 0.0
        for i in range(n):
            dx, dy = x[i] - x0, y[i] - y0
            xx += weights[i] * dx * dx
            xy += weights[i] * dx * dy
            yy += weights[i] * dy * dy
        angle = 0.5 * math.atan2(2.0 * xy, xx - yy)  # in (-90, 90] degrees: towards the east
        ux, uy = math.cos(angle), math.sin(angle)
        offset = (y - y0) * ux - (x - x0) * uy
        sigma = MAD * np.median(np.abs(offset))
        new = tukey(offset, max(sigma, least_sigma))
        if np.count_nonzero(new) < _LEAST_POINTS:
            break
        weights = new
    return x0, y0, ux, uy, sigma, weights


@njit(cache=True, nogil=True)
def robust_parabola(
    s: AnyArray, z: AnyArray, given: AnyArray, least_sigma: float
) -> tuple[float, AnyArray, AnyArray, float, AnyArray]:
    """Fit a parabola to heights along a wire, reweighted four times by Tukey's function.

    Parameters
    ----------
    s, z, given
        (n,) stations [m], heights [m] and prior weights.
    least_sigma
        Least deviation that outliers are judged by. [m]

    Returns
    -------
    centre
        Reference station; u = s - centre. [m]
    curve, inverse
        (3,) coefficients of 1, u and u^2, and (3, 3) their cofactors.
    sigma
        Standard deviation of a height. [m]
    weights
        (n,).
    """
    n = len(s)
    centre = (given * s).sum() / given.sum()
    scale = max(np.abs(s - centre).max(), _LEAST_EXTENT_M)
    u = (s - centre) / scale
    weights = given.copy()
    curve: AnyArray = np.zeros(3)
    inverse: AnyArray = np.zeros((3, 3))
    sigma = 0.0
    for _ in range(_ROUNDS):
        normal, right = np.zeros((3, 3)), np.zeros(3)
        for i in range(n):
            v = (1.0, u[i], u[i] * u[i])
            for a in range(3):
                right[a] += weights[i] * v[a] * z[i]
                for b in range(3):
                    normal[a, b] += weights[i] * v[a] * v[b]
        for a in range(3):
            normal[a, a] += _RIDGE * n
        inverse = np.linalg.inv(normal)
        curve = inverse @ right
        residual = z - (curve[0] + curve[1] * u + curve[2] * u * u)
        total = weights.sum()
        used = np.count_nonzero(weights)
        sigma = math.sqrt((weights * residual * residual).sum() / total * used / max(used - 3, 1))
        new = given * tukey(residual, max(MAD * np.median(np.abs(residual)), least_sigma))
        if np.count_nonzero(new) < _LEAST_POINTS:
            break
        weights = new
    for a in range(3):
        curve[a] /= scale**a
        for b in range(3):
            inverse[a, b] /= scale ** (a + b)
    return centre, curve, inverse, sigma, weights


@njit(cache=True, nogil=True)
def tukey(residual: AnyArray, sigma: float) -> AnyArray:
    """Return Tukey's biweights of residuals (n,) with standard deviation `sigma`, (n,)."""
    weights = np.zeros(len(residual))
    for i in range(len(residual)):
        x = residual[i] / (TUKEY * sigma)
        if abs(x) < 1.0:
            weights[i] = (1.0 - x * x) ** 2
    return weights


@njit(cache=True, nogil=True)
def on_wire(s: AnyArray, o: AnyArray, dz: AnyArray, edges: OnWireEdges, radii: OnWireRadii) -> AnyArray:
    """Return which points lie on a wire, up to the next other point beyond its first and last clear metre.

    Parameters
    ----------
    s, o, dz
        (n,) stations, offsets and heights above the wire. [m]
    edges
        Range of the stations; metres are counted from the survey's origin, independent of the wire's points.
    radii
        Gate and ring.

    Returns
    -------
    (n,) bool.
    """
    low, high, shift = edges
    gate, inner, outer = radii
    n_metres = math.ceil(high - low) + 2
    inside, around = np.zeros(n_metres, np.int32), np.zeros(n_metres, np.int32)
    metre, on = np.empty(len(s), np.int64), np.zeros(len(s), np.bool_)
    beside = np.zeros(len(s), np.bool_)
    for i in range(len(s)):
        metre[i] = math.floor(s[i] + shift) - math.floor(low + shift)
        r = math.hypot(o[i], dz[i])
        on[i] = r <= gate
        if on[i]:
            inside[metre[i]] += 1
        beside[i] = inner < r <= outer
        if beside[i]:
            around[metre[i]] += 1
    first, last = n_metres, -1
    for m in range(n_metres):
        if inside[m] > 0 and _CLEAR_SHARE * around[m] <= inside[m]:
            first, last = min(first, m), m
    before, after = low - _BEYOND_M, high + _BEYOND_M
    for i in range(len(s)):
        if beside[i] and metre[i] < first:
            before = max(before, s[i])
        elif beside[i] and metre[i] > last:
            after = min(after, s[i])
    for i in range(len(s)):
        on[i] = on[i] and last >= 0 and before < s[i] < after
    return on


@njit(cache=True, nogil=True)
def station_runs(s: AnyArray, most_usual: float, gap_m: float, gaps: float) -> tuple[AnyArray, AnyArray]:
    """Return the runs of rising stations without a long gap.

    A gap is long beyond `gap_m` and beyond `gaps` times the mean gap, each weighted by its length up to
    `most_usual`.

    Returns
    -------
    edges
        (k + 1,) int64: run i has the stations from edges[i] to edges[i + 1].
    seen
        (k,) length of the half metres with a point. [m]
    """
    square, total = 0.0, 0.0
    for i in range(1, len(s)):
        short = min(s[i] - s[i - 1], most_usual)
        square += short * short
        total += short
    limit = max(gap_m, gaps * (square / max(total, 1e-6)))
    edges, seen = np.empty(len(s) + 1, np.int64), np.zeros(len(s))
    edges[0], n, last = 0, 0, -math.inf
    for i in range(len(s)):
        if i > 0 and s[i] - s[i - 1] > limit:
            n += 1
            edges[n], last = i, -math.inf
        half_metre = math.floor(_SEEN_PER_M * s[i])
        if half_metre != last:
            seen[n] += 1.0 / _SEEN_PER_M
            last = half_metre
    edges[n + 1] = len(s)
    return edges[: n + 2], seen[: n + 1]


@njit(cache=True, nogil=True)
def best_break(s: AnyArray, z: AnyArray, least: float, step: float, few: int) -> tuple[int, float]:
    """Return the break at which two parabolas fit best, and the share of the squares that it leaves.

    Parameters
    ----------
    s, z
        (n,) rising stations and heights. [m]
    least, few
        Least distance [m] and number of points between a break and either end.
    step
        Distance of tried breaks. [m]

    Returns
    -------
    First point of the right parabola, and the share; (0, 1.0) where there is no room.
    """
    n = len(s)
    middle, scale = 0.5 * (s[0] + s[n - 1]), max(0.5 * (s[n - 1] - s[0]), 1e-6)
    sums = np.zeros((n + 1, _SUMS))
    for i in range(n):
        u = (s[i] - middle) / scale
        power = 1.0
        for k in range(_SUM_ZU):
            sums[i + 1, k] = sums[i, k] + power
            if k < 3:
                sums[i + 1, _SUM_ZU + k] = sums[i, _SUM_ZU + k] + power * z[i]
            power *= u
        sums[i + 1, _SUM_ZZ] = sums[i, _SUM_ZZ] + z[i] * z[i]
    whole = _squares(sums[n])
    best, at = whole, 0
    place = s[0] + least
    last = -1
    while place < s[n - 1] - least:
        i = np.searchsorted(s, place)
        if i != last and few <= i <= n - few:
            squares = _squares(sums[i]) + _squares(sums[n] - sums[i])
            if squares < best:
                best, at = squares, i
            last = i
        place += step
    return at, (best / whole if whole > 0.0 else 1.0)


@njit(cache=True, nogil=True)
def _squares(m: AnyArray) -> float:
    """Return the sum of squared residuals of the parabola with these sums (9,)."""
    normal = np.empty((3, 3))
    for a in range(3):
        for b in range(3):
            normal[a, b] = m[a + b]
        normal[a, a] += _RIDGE * m[0]
    right = m[_SUM_ZU:_SUM_ZZ].copy()
    return max(float(m[_SUM_ZZ] - (np.linalg.inv(normal) @ right) @ right), 0.0)
