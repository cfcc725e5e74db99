"""Kernel for wires side by side: a mixture of normal distributions about parabolas, by expectation and maximisation.

Separate from `fit`, which fits one wire: here the points are shared out among several. Rounds are many and points are
few, so that a call for each sum of a round would take longer than the sums.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from linework.arrays import FloatArray

#: Columns of a point: scaled station, offset [m] and height [m]; rows of wires: parabolas across and in height.
AT_STATION, AT_OFFSET, AT_HEIGHT = 0, 1, 2
ACROSS, UP = 0, 1
#: Unknowns of a wire: a parabola in plan and one in height, and its share of the points.
UNKNOWNS_OF_WIRE = 7
#: Rounds of the mixture, and gain of its likelihood at which it has settled. [-, 1]
_MOST_ROUNDS, _SETTLED = 100, 1e-3
#: Ridge of the normal equations. [points]
_RIDGE = 1e-9
#: Most of the points that wires have together: the rest are strays.
_MOST_SHARE = 0.999


class MixtureLimits(NamedTuple):
    """Distance within which strays lie anywhere, and least and largest scatter of the points of a wire [m]."""

    reach: float
    least: float
    most: float


@njit(cache=True, nogil=True)
def settle_mixture(
    points: FloatArray,
    curves: FloatArray,
    share: FloatArray,
    sigma: tuple[float, float],
    limits: MixtureLimits,
) -> tuple[float, float, float]:
    """Change wires until their likelihood no longer grows; return it, its logarithm, and both scatters [m].

    The likelihood is NaN where a wire has lost its points: the wires are then of no use.

    Parameters
    ----------
    points
        (n, 3) columns `AT_STATION` to `AT_HEIGHT`. [1, m, m]
    curves
        (2, wires, 3) parabolas of the scaled station [m], rows `ACROSS` and `UP`; changed.
    share
        (wires,) share of the points that are on each; changed.
    sigma
        Standard deviations of a point across and in height to begin with. [m]
    limits
        What scatters may be.
    """
    n, n_wires = len(points), len(share)
    weight, number = np.empty((n, n_wires)), np.empty(n_wires)
    sigma_o, sigma_z = sigma
    total = -np.inf
    for _ in range(_MOST_ROUNDS):
        before, total = (
            total,
            _expect(points, curves, share, (sigma_o, sigma_z), limits.reach, weight, number),
        )
        if number.min() < UNKNOWNS_OF_WIRE:
            return np.nan, sigma_o, sigma_z
        for k in range(n_wires):
            _fit_wire(points, weight, k, curves)
        off, up = _squares(points, curves, weight)
        sigma_o = min(max(math.sqrt(off / number.sum()), limits.least), limits.most)
        sigma_z = min(max(math.sqrt(up / number.sum()), limits.least), limits.most)
        for k in range(n_wires):
            share[k] = min(number[k] / n, _MOST_SHARE * number[k] / number.sum())
        if total - before < _SETTLED:
            break
    return total, sigma_o, sigma_z


@njit(cache=True, nogil=True)
def _expect(
    points: FloatArray,
    curves: FloatArray,
    share: FloatArray,
    sigma: tuple[float, float],
    reach: float,
    weight: FloatArray,
    number: FloatArray,
) -> float:
    """Write how likely each point is on each wire, and return the logarithm of the likelihood.

    weight, number: (n, wires) and (wires,) output, the second the sums of the first.
    """
    n_wires = len(share)
    per_o, per_z = 1.0 / sigma[0], 1.0 / sigma[1]
    stray = (1.0 - share.sum()) / (2.0 * reach) ** 2
    peak = share / (2.0 * math.pi * sigma[0] * sigma[1])
    total = 0.0
    number[:] = 0.0
    for i in range(len(points)):
        u, sums = points[i, AT_STATION], stray
        for k in range(n_wires):
            o = (points[i, AT_OFFSET] - _at(curves, ACROSS, k, u)) * per_o
            z = (points[i, AT_HEIGHT] - _at(curves, UP, k, u)) * per_z
            weight[i, k] = peak[k] * math.exp(-0.5 * (o * o + z * z))
            sums += weight[i, k]
        for k in range(n_wires):
            weight[i, k] /= sums
            number[k] += weight[i, k]
        total += math.log(sums)
    return total


@njit(cache=True, nogil=True)
def _fit_wire(points: FloatArray, weight: FloatArray, k: int, curves: FloatArray) -> None:
    """Fit both parabolas of a wire to the points by their weights (n, wires)."""
    # Sums in registers: read back from memory for every point they take longer
    m0 = m1 = m2 = m3 = m4 = o0 = o1 = o2 = z0 = z1 = z2 = 0.0
    for i in range(len(points)):
        u, w = points[i, AT_STATION], weight[i, k]
        o, z = points[i, AT_OFFSET], points[i, AT_HEIGHT]
        m0, o0, z0 = m0 + w, o0 + w * o, z0 + w * z
        w *= u
        m1, o1, z1 = m1 + w, o1 + w * o, z1 + w * z
        w *= u
        m2, o2, z2 = m2 + w, o2 + w * o, z2 + w * z
        w *= u
        m3, m4 = m3 + w, m4 + w * u
    moments, right = (m0, m1, m2, m3, m4), np.array([[o0, z0], [o1, z1], [o2, z2]])
    normal = np.empty((3, 3))
    for a in range(3):
        for b in range(3):
            normal[a, b] = moments[a + b]
        normal[a, a] += _RIDGE
    curve = np.linalg.solve(normal, right)
    curves[ACROSS, k], curves[UP, k] = curve[:, 0], curve[:, 1]


@njit(cache=True, nogil=True)
def _squares(points: FloatArray, curves: FloatArray, weight: FloatArray) -> tuple[float, float]:
    """Return the sums of the squared distances from all wires, across and in height [m²], by the weights (n, wires)."""
    off, up = 0.0, 0.0
    for i in range(len(points)):
        u = points[i, AT_STATION]
        for k in range(weight.shape[1]):
            o = points[i, AT_OFFSET] - _at(curves, ACROSS, k, u)
            z = points[i, AT_HEIGHT] - _at(curves, UP, k, u)
            off += weight[i, k] * o * o
            up += weight[i, k] * z * z
    return off, up


@njit(cache=True, nogil=True)
def _at(curves: FloatArray, row: int, k: int, u: float) -> float:
    """Return where a wire is at a scaled station [m]."""
    value: float = curves[row, k, 0] + u * (curves[row, k, 1] + u * curves[row, k, 2])
    return value
