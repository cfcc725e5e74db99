"""Kernels that follow a wire through the points of a slice by a tube: a parabola in height, a line in plan."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from linework.arrays import AnyArray
from linework.kernels.cables.search import SliceCurve

#: Elements of the gates: narrowest and widest gate [m], outer radius of the ring in gates.
GATE_FLOOR, GATE_CEILING, GATE_RING = range(3)
#: Coefficients of a tube: height, slope and bend of the parabola, offset and turn of the line.
TUBE_Z, TUBE_SLOPE, TUBE_BEND, TUBE_OFFSET, TUBE_TURN = range(5)

#: Half width of a gate in standard deviations of the members.
_GATE_SIGMAS = 4.0
#: Inner radius of the ring about a tube, in its radius: points between belong to neither.
_RING_INNER = 1.25
#: Most rounds of growing: each follows a quarter of the known length, so that a few dozen are used.
_MOST_ROUNDS = 400
#: Length followed at a time: a share of the known length, and at least so much. [1, m]
_GROW_SHARE, _GROW_M = 0.25, 2.0
#: Shortest extent of members that is fitted. [m]
_LEAST_EXTENT_M = 1e-6
#: Height and offset about a curve of the slice within which points are taken at first, in gates. Tuned.
_SETTLE_UP, _SETTLE_ACROSS = 1.6, 2.0
#: Gates of the rounds in which a wire settles: from one and a half to a half, which then stays. Tuned.
_SETTLE_GATES = (1.5, 1.2, 1.0, 0.8, 0.65, 0.5, 0.5, 0.5)
#: Points up to this far beyond the members may join while a wire settles. [m]
_SETTLE_BEYOND_M = 1.0
#: Stretches of a wire that agree on its offset: half metres. [1/m]
_AGREE_PER_M = 2.0
#: A metre is ringed where the ring holds more than a third as many points as the tube.
_RINGED_SHARE = 3
#: Fewest members that are fitted.
_LEAST_MEMBERS = 4
#: Ridge of the normal equations, as a share of the number of members.
_RIDGE = 1e-9
#: Least length that stations are scaled by. [m]
_LEAST_SCALE_M = 1e-3


class TubeFit(NamedTuple):
    """A parabola z(s) and a line o(s) through the members of a wire.

    Parameters
    ----------
    low, high, centre
        First, last and mean station of the members; u = s - centre. [m]
    curve
        (5,) coefficients `TUBE_Z` to `TUBE_TURN`.
    cofactor
        (3, 3) cofactors of the parabola.
    sigma_z, sigma_o
        Standard deviations of the members in height and across. [m]
    """

    low: float
    high: float
    centre: float
    curve: AnyArray
    cofactor: AnyArray
    sigma_z: float
    sigma_o: float


@njit(cache=True, nogil=True)
def grow(
    s: AnyArray, o: AnyArray, z: AnyArray, member: AnyArray, gates: AnyArray, max_gap: float
) -> AnyArray:
    """Follow a wire along its line in both directions, and return its points, (n,) bool.

    A parabola z(s) and a line o(s) are fitted to all members so far; they predict the next stretch, a quarter of
    the known length; points within the gate join. It stops where `max_gap` holds no point, and where the ring
    about it holds more points than the tube: in a crown, and in a bundle that it crosses.

    Parameters
    ----------
    s, o, z
        (n,) stations (rising), offsets and heights. [m]
    member
        (n,) bool: points to start from.
    gates
        (3,) elements `GATE_FLOOR` to `GATE_RING`. The gate is four standard deviations of the members about their
        fit and of the prediction, between floor and ceiling; the ring's outer radius is in gates.
    max_gap
        Longest gap that is crossed. [m]
    """
    member = member.copy()
    done = [False, False]
    for _ in range(_MOST_ROUNDS):
        fit = _parabola(s, o, z, member)
        if fit.high - fit.low < _LEAST_EXTENT_M or (done[0] and done[1]):
            break
        step = min(max(_GROW_SHARE * (fit.high - fit.low), _GROW_M), max_gap)
        for side in range(2):
            reach = step
            while not done[side]:
                joined, around = _stretch(s, o, z, member, fit, side, reach, gates)
                if around > len(joined):
                    done[side] = True
                elif len(joined) > 0:
                    for i in joined:
                        member[i] = True
                    break
                elif reach >= max_gap:
                    done[side] = True
                reach = min(2.0 * reach, max_gap)
        # Members that the better fit no longer explains are removed
        low, high, centre, curve, _, sigma_z, sigma_o = _parabola(s, o, z, member)
        gate_z = min(max(_GATE_SIGMAS * sigma_z, gates[GATE_FLOOR]), gates[GATE_CEILING])
        gate_o = min(max(_GATE_SIGMAS * sigma_o, gates[GATE_FLOOR]), gates[GATE_CEILING])
        for i in range(len(s)):
            if low <= s[i] <= high:
                u = s[i] - centre
                hang = curve[TUBE_Z] + curve[TUBE_SLOPE] * u + curve[TUBE_BEND] * u * u
                member[i] = (
                    abs(z[i] - hang) <= gate_z
                    and abs(o[i] - (curve[TUBE_OFFSET] + curve[TUBE_TURN] * u)) <= gate_o
                )
    return member


@njit(cache=True, nogil=True)
def _stretch(
    s: AnyArray,
    o: AnyArray,
    z: AnyArray,
    member: AnyArray,
    fit: TubeFit,
    side: int,
    reach: float,
    gates: AnyArray,
) -> tuple[AnyArray, int]:
    """Return the points that join within the next `reach` [m], (k,) int64, and the number in the ring about them.

    `side` is 0 towards falling and 1 towards rising stations.
    """
    low, high, centre, curve, cofactor, sigma_z, sigma_o = fit
    joined = np.empty(len(s), np.int64)
    n, around = 0, 0
    for i in range(len(s)):
        ahead = low - s[i] if side == 0 else s[i] - high
        if 0.0 < ahead <= reach and not member[i]:
            u = s[i] - centre
            wide = _GATE_SIGMAS * math.sqrt(1.0 + _variance(cofactor, u))
            gate_z = min(max(wide * sigma_z, gates[GATE_FLOOR]), gates[GATE_CEILING])
            gate_o = min(max(wide * sigma_o, gates[GATE_FLOOR]), gates[GATE_CEILING])
            dz = z[i] - (curve[TUBE_Z] + curve[TUBE_SLOPE] * u + curve[TUBE_BEND] * u * u)
            do = o[i] - (curve[TUBE_OFFSET] + curve[TUBE_TURN] * u)
            gate = max(gate_z, gate_o)
            if abs(dz) <= gate_z and abs(do) <= gate_o:
                joined[n] = i
                n += 1
            elif _RING_INNER * gate < math.hypot(dz, do) <= gates[GATE_RING] * gate:
                around += 1
    return joined[:n], around


@njit(cache=True, nogil=True)
def settle(s: AnyArray, o: AnyArray, z: AnyArray, free: AnyArray, curve: SliceCurve, gate: float) -> AnyArray:
    """Return the points of the wire near a curve of the slice, (n,) bool.

    Of wires side by side the one that most half metres agree on; then parabola and line are fitted to the
    points within the gate, which narrows from one and a half times to half of `gate`: a curve across two
    wires comes to rest on one of them.

    Parameters
    ----------
    s, o, z
        (n,) stations, offsets and heights. [m]
    free
        (n,) bool: points of no other wire.
    curve
        The curve.
    gate
        Widest gate across a wire. [m]
    """
    member = np.zeros(len(s), np.bool_)
    half = 0.5 * gate
    n_bins = 2 * math.ceil(np.abs(o).max() / half) + 4
    agree = np.zeros(n_bins, np.int32)
    last = np.full(n_bins, -(10**9), np.int64)
    for i in range(len(s)):
        off = z[i] - curve.height - curve.slope * s[i] - 0.5 * curve.curvature * s[i] * s[i]
        member[i] = free[i] and abs(off) <= _SETTLE_UP * gate
        if member[i]:
            b = math.floor(o[i] / half) + n_bins // 2
            half_metre = math.floor(_AGREE_PER_M * s[i])
            if last[b] != half_metre:
                agree[b] += 1
                last[b] = half_metre
    top, at = -1, 0
    for b in range(1, n_bins - 1):
        total = agree[b - 1] + 2 * agree[b] + agree[b + 1]
        if total > top:
            top, at = total, b
    offset = (at - n_bins // 2 + 0.5) * half
    for i in range(len(s)):
        member[i] = member[i] and abs(o[i] - offset) <= _SETTLE_ACROSS * gate
    for narrow in _SETTLE_GATES:
        low, high, centre, fit, _, _sigma_z, _sigma_o = _parabola(s, o, z, member)
        if high - low < _LEAST_EXTENT_M:
            break
        width = gate * narrow
        for i in range(len(s)):
            u = s[i] - centre
            member[i] = (
                free[i]
                and low - _SETTLE_BEYOND_M <= s[i] <= high + _SETTLE_BEYOND_M
                and abs(z[i] - fit[TUBE_Z] - fit[TUBE_SLOPE] * u - fit[TUBE_BEND] * u * u) <= width
                and abs(o[i] - fit[TUBE_OFFSET] - fit[TUBE_TURN] * u) <= width
            )
    return member


@njit(cache=True, nogil=True)
def thinness(
    s: AnyArray, o: AnyArray, z: AnyArray, member: AnyArray, gates: AnyArray
) -> tuple[float, float, float]:
    """Return length [m], share of metres with a point, and share of these whose ring is not clear.

    The tube about the fit of the members is four deviations wide, within the gates; the ring lies between one and
    a quarter and `GATE_RING` times that. A metre is not clear with more than a third as many points in the ring.

    Parameters
    ----------
    s, o, z, member
        (n,) stations, offsets and heights [m], and bool.
    gates
        (3,) elements `GATE_FLOOR` to `GATE_RING`.
    """
    low, high, centre, fit, _, sigma_z, sigma_o = _parabola(s, o, z, member)
    n = math.ceil(high - low)
    if n < 1:
        return 0.0, 0.0, 1.0
    tube = min(max(_GATE_SIGMAS * max(sigma_z, sigma_o), gates[GATE_FLOOR]), gates[GATE_CEILING])
    inside, around = np.zeros(n, np.int32), np.zeros(n, np.int32)
    for i in range(len(s)):
        if low <= s[i] <= high:
            u = s[i] - centre
            dz = z[i] - fit[TUBE_Z] - fit[TUBE_SLOPE] * u - fit[TUBE_BEND] * u * u
            r = math.hypot(dz, o[i] - fit[TUBE_OFFSET] - fit[TUBE_TURN] * u)
            metre = min(int(s[i] - low), n - 1)
            if r <= tube:
                inside[metre] += 1
            elif _RING_INNER * tube < r <= gates[GATE_RING] * tube:
                around[metre] += 1
    has, ringed = 0, 0
    for m in range(n):
        if inside[m] > 0:
            has += 1
            if _RINGED_SHARE * around[m] > inside[m]:
                ringed += 1
    return high - low, has / n, ringed / max(has, 1)


@njit(cache=True, nogil=True)
def _variance(cofactor: AnyArray, u: float) -> float:
    """Return the variance of the parabola at `u` from its cofactors, in variances of a height."""
    v = np.array([1.0, u, u * u])
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += v[i] * cofactor[i, j] * v[j]
    return max(total, 0.0)


@njit(cache=True, nogil=True)
def _parabola(s: AnyArray, o: AnyArray, z: AnyArray, member: AnyArray) -> TubeFit:
    """Fit heights by a parabola and offsets by a line to the members (n,) bool; all 0 with too few."""
    n = 0
    low, high, centre = 1e300, -1e300, 0.0
    for i in range(len(s)):
        if member[i]:
            n += 1
            centre += s[i]
            low, high = min(low, s[i]), max(high, s[i])
    fit = np.zeros(5)
    cofactor = np.zeros((3, 3))
    if n < _LEAST_MEMBERS:
        return TubeFit(0.0, 0.0, 0.0, fit, cofactor, 0.0, 0.0)
    centre /= n
    scale = max(high - low, _LEAST_SCALE_M) / 2.0
    normal, right_z, right_o = np.zeros((3, 3)), np.zeros(3), np.zeros(2)
    for i in range(len(s)):
        if member[i]:
            u = (s[i] - centre) / scale
            v = (1.0, u, u * u)
            for a in range(3):
                right_z[a] += v[a] * z[i]
                for b in range(3):
                    normal[a, b] += v[a] * v[b]
            right_o[0] += o[i]
            right_o[1] += u * o[i]
    for a in range(3):
        normal[a, a] += _RIDGE * n
    inverse = np.linalg.inv(normal)
    for a in range(3):
        for b in range(3):
            fit[a] += inverse[a, b] * right_z[b]
            cofactor[a, b] = inverse[a, b] / scale ** (a + b)
    determinant = normal[0, 0] * normal[1, 1] - normal[0, 1] ** 2
    fit[TUBE_OFFSET] = (normal[1, 1] * right_o[0] - normal[0, 1] * right_o[1]) / determinant
    fit[TUBE_TURN] = (normal[0, 0] * right_o[1] - normal[0, 1] * right_o[0]) / determinant / scale
    fit[TUBE_SLOPE] /= scale
    fit[TUBE_BEND] /= scale * scale
    sigma_z, sigma_o = _scatter(s - centre, o, z, member, fit)
    return TubeFit(low, high, centre, fit, cofactor, sigma_z, sigma_o)


@njit(cache=True, nogil=True)
def _scatter(u: AnyArray, o: AnyArray, z: AnyArray, member: AnyArray, fit: AnyArray) -> tuple[float, float]:
    """Return the standard deviations of the members about parabola and line. [m]."""
    square_z, square_o, n = 0.0, 0.0, 0
    for i in range(len(u)):
        if member[i]:
            n += 1
            slope = fit[TUBE_SLOPE] * u[i]
            square_z += (z[i] - fit[TUBE_Z] - slope - fit[TUBE_BEND] * u[i] * u[i]) ** 2
            square_o += (o[i] - fit[TUBE_OFFSET] - fit[TUBE_TURN] * u[i]) ** 2
    return math.sqrt(square_z / max(n - 3, 1)), math.sqrt(square_o / max(n - 2, 1))
