"""Robust fits of one wire: its line in plan and its parabola in height, and the kink over a support."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import AnyArray

Edges = tuple[float, float, float]

#: Tukey's constant: residuals beyond this many deviations weigh nothing; 95 % efficient on Gaussian noise.
TUKEY = 4.685
#: Makes the median absolute deviation a standard deviation for Gaussian noise.
MAD = 1.4826


@njit(cache=True, nogil=True)
def robust_line(
    x: AnyArray, y: AnyArray, least_sigma: float
) -> tuple[float, float, float, float, float, AnyArray]:
    """Return the orthogonal line through points in plan: (x0, y0, ux, uy), sigma across, weights.

    Reweighted four times by Tukey's function; a residual of four `least_sigma` never counts as gross.
    """
    n = len(x)
    weights = np.ones(n)
    x0, y0, ux, uy, sigma = 0.0, 0.0, 1.0, 0.0, 0.0
    for _ in range(5):
        total = weights.sum()
        x0, y0 = (weights * x).sum() / total, (weights * y).sum() / total
        xx, xy, yy = 0.0, 0.0, 0.0
        for i in range(n):
            dx, dy = x[i] - x0, y[i] - y0
            xx += weights[i] * dx * dx
            xy += weights[i] * dx * dy
            yy += weights[i] * dy * dy
        angle = 0.5 * math.atan2(2.0 * xy, xx - yy)  # in (-90, 90] degrees: east is ahead
        ux, uy = math.cos(angle), math.sin(angle)
        offset = (y - y0) * ux - (x - x0) * uy
        sigma = MAD * np.median(np.abs(offset))
        new = tukey(offset, max(sigma, least_sigma))
        if np.count_nonzero(new) < 4:
            break
        weights = new
    return x0, y0, ux, uy, sigma, weights


@njit(cache=True, nogil=True)
def robust_parabola(
    s: AnyArray, z: AnyArray, given: AnyArray, least_sigma: float
) -> tuple[float, AnyArray, AnyArray, float, AnyArray]:
    """Return (centre, coefficients of (1, u, u^2), their cofactors, sigma, weights), u = s - centre."""
    n = len(s)
    centre = (given * s).sum() / given.sum()
    scale = max(np.abs(s - centre).max(), 1e-3)
    u = (s - centre) / scale
    weights = given.copy()
    curve: AnyArray = np.zeros(3)
    inverse: AnyArray = np.zeros((3, 3))
    sigma = 0.0
    for _ in range(5):
        normal, right = np.zeros((3, 3)), np.zeros(3)
        for i in range(n):
            v = (1.0, u[i], u[i] * u[i])
            for a in range(3):
                right[a] += weights[i] * v[a] * z[i]
                for b in range(3):
                    normal[a, b] += weights[i] * v[a] * v[b]
        for a in range(3):
            normal[a, a] += 1e-9 * n
        inverse = np.linalg.inv(normal)
        curve = inverse @ right
        residual = z - (curve[0] + curve[1] * u + curve[2] * u * u)
        total = weights.sum()
        used = np.count_nonzero(weights)
        sigma = math.sqrt((weights * residual * residual).sum() / total * used / max(used - 3, 1))
        new = given * tukey(residual, max(MAD * np.median(np.abs(residual)), least_sigma))
        if np.count_nonzero(new) < 4:
            break
        weights = new
    for a in range(3):
        curve[a] /= scale**a
        for b in range(3):
            inverse[a, b] /= scale ** (a + b)
    return centre, curve, inverse, sigma, weights


@njit(cache=True, nogil=True)
def tukey(residual: AnyArray, sigma: float) -> AnyArray:
    """Return Tukey's biweights of residuals."""
    weights = np.zeros(len(residual))
    for i in range(len(residual)):
        x = residual[i] / (TUKEY * sigma)
        if abs(x) < 1.0:
            weights[i] = (1.0 - x * x) ** 2
    return weights


@njit(cache=True, nogil=True)
def on_wire(s: AnyArray, o: AnyArray, dz: AnyArray, edges: Edges, radii: Edges) -> AnyArray:
    """Return which of (n,) points lie on a wire, up to the next other point beyond its first and last clear metre.

    `edges` are the stations that points lie between, and what makes them stations from the survey's origin:
    where metres begin must not depend on the wire's points. `radii` are the gate's and the ring's (inner, outer).
    """
    low, high, shift = edges
    n_metres = math.ceil(high - low) + 2
    inside, around = np.zeros(n_metres, np.int32), np.zeros(n_metres, np.int32)
    metre, on = np.empty(len(s), np.int64), np.zeros(len(s), np.bool_)
    beside = np.zeros(len(s), np.bool_)
    for i in range(len(s)):
        metre[i] = math.floor(s[i] + shift) - math.floor(low + shift)
        r = math.hypot(o[i], dz[i])
        on[i] = r <= radii[0]
        if on[i]:
            inside[metre[i]] += 1
        beside[i] = radii[1] < r <= radii[2]
        if beside[i]:
            around[metre[i]] += 1
    first, last = n_metres, -1
    for m in range(n_metres):
        if inside[m] > 0 and 3 * around[m] <= inside[m]:
            first, last = min(first, m), m
    before, after = low - 1.0, high + 1.0
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
    """Return the edges (k + 1,) of runs of rising stations without a long gap, and the metres (k,) seen in each.

    A gap is long beyond `gap_m`, or `gaps` times the mean gap, each weighted by its length up to `most_usual`.
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
        half_metre = math.floor(2.0 * s[i])
        if half_metre != last:
            seen[n] += 0.5
            last = half_metre
    edges[n + 1] = len(s)
    return edges[: n + 2], seen[: n + 1]


@njit(cache=True, nogil=True)
def best_break(s: AnyArray, z: AnyArray, least: float, step: float, few: int) -> tuple[int, float]:
    """Return where two parabolas fit best: the first point of the right one, and the share of squares left.

    Stations rise. Breaks are tried every `step` metres, `least` metres and `few` points from the ends;
    (0, 1.0) where there is no room.
    """
    n = len(s)
    middle, scale = 0.5 * (s[0] + s[n - 1]), max(0.5 * (s[n - 1] - s[0]), 1e-6)
    sums = np.zeros((n + 1, 9))
    for i in range(n):
        u = (s[i] - middle) / scale
        power = 1.0
        for k in range(5):
            sums[i + 1, k] = sums[i, k] + power
            if k < 3:
                sums[i + 1, 5 + k] = sums[i, 5 + k] + power * z[i]
            power *= u
        sums[i + 1, 8] = sums[i, 8] + z[i] * z[i]
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
    """Return the squares about the parabola with these sums of u^0..u^4, z u^0..z u^2, z^2."""
    normal = np.empty((3, 3))
    for a in range(3):
        for b in range(3):
            normal[a, b] = m[a + b]
        normal[a, a] += 1e-9 * m[0]
    right = m[5:8].copy()
    return max(float(m[8] - (np.linalg.inv(normal) @ right) @ right), 0.0)
