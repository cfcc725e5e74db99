"""Inner loops of the cable search: crowded columns, the Radon image of a vertical slice, growing a wire."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from linework.arrays import AnyArray

#: Columns are divided into 5 x 5 sub-cells, one bit each.
SIDE = 5


@njit(cache=True, nogil=True)
def crowding(
    order: AnyArray, start: AnyArray, layer: AnyArray, sub_cell: AnyArray, reach: int
) -> tuple[AnyArray, AnyArray]:
    """Return per point how full its column is directly above or below, and how wide its own layer is.

    Parameters are points sorted by column: `order` (n,), `start` (columns + 1,), and per point `layer`
    (n,) int32, the number of its height bin, and `sub_cell` (n,) int32 in 0..24.

    Returns
    -------
    stacked
        (n,) int32: occupied layers among layer + 2 .. layer + reach, or among those below if they are more.
    spread
        (n,) int32: occupied sub-cells of the column within one layer of the point.
    """
    stacked = np.zeros(len(layer), np.int32)
    spread = np.zeros(len(layer), np.int32)
    for c in range(len(start) - 1):
        first, last = start[c], start[c + 1]
        lowest = layer[order[first]]
        highest = lowest
        for i in range(first, last):
            lowest = min(lowest, layer[order[i]])
            highest = max(highest, layer[order[i]])
        n = highest - lowest + 1 + 2 * reach
        bits = np.zeros(n, np.int32)
        for i in range(first, last):
            p = order[i]
            bits[layer[p] - lowest + reach] |= np.int32(1) << sub_cell[p]
        below = np.zeros(n + 1, np.int32)  # occupied layers before each one
        for k in range(n):
            below[k + 1] = below[k] + (1 if bits[k] != 0 else 0)
        for i in range(first, last):
            p = order[i]
            k = layer[p] - lowest + reach
            stacked[p] = max(below[k + reach + 1] - below[k + 2], below[k - 1] - below[k - reach])
            union = bits[k - 1] | bits[k] | bits[k + 1]
            while union:
                union &= union - np.int32(1)
                spread[p] += 1
    return stacked, spread


@njit(cache=True, nogil=True)
def near_segment(
    keys: AnyArray,
    start: AnyArray,
    order: AnyArray,
    grid: AnyArray,
    xy: AnyArray,
    segment: AnyArray,
    reach: float,
) -> AnyArray:
    """Return the indices of points within `reach` of a plan line's stretch.

    `keys` (columns,) are the sorted row-major numbers of the occupied columns, `grid` is (cell size, number
    of columns per row, first column, first row), `segment` is (x, y, ux, uy, from, to): a point, a unit direction, two stations.
    """
    cell, n_cols, west_col, south_row = grid[0], int(grid[1]), int(grid[2]), int(grid[3])
    x0, y0, ux, uy, low, high = segment
    xa, xb = x0 + ux * low, x0 + ux * high
    ya, yb = y0 + uy * low, y0 + uy * high
    row_low = math.floor((min(ya, yb) - reach) / cell)
    row_high = math.floor((max(ya, yb) + reach) / cell)
    found = np.empty(256, np.int64)
    n = 0
    for row in range(max(row_low, south_row), row_high + 1):
        west, east = min(xa, xb) - reach, max(xa, xb) + reach
        if abs(uy) > 1e-6:  # the stretch of the line that can touch this row
            t1 = (row * cell - reach - y0) / uy
            t2 = ((row + 1) * cell + reach - y0) / uy
            ta, tb = max(min(t1, t2), low), min(max(t1, t2), high)
            west = max(west, min(x0 + ux * ta, x0 + ux * tb) - 1.5 * reach)
            east = min(east, max(x0 + ux * ta, x0 + ux * tb) + 1.5 * reach)
        col_low = max(math.floor(west / cell) - west_col, 0)
        col_high = min(math.floor(east / cell) - west_col, n_cols - 1)
        first = (row - south_row) * n_cols
        k = np.searchsorted(keys, first + col_low)
        while k < len(keys) and keys[k] <= first + col_high:
            for i in range(start[k], start[k + 1]):
                p = order[i]
                dx, dy = xy[p, 0] - x0, xy[p, 1] - y0
                along = dx * ux + dy * uy
                if low <= along <= high and abs(dy * ux - dx * uy) <= reach:
                    if n == len(found):
                        found = np.concatenate((found, np.empty(n, np.int64)))
                    found[n] = p
                    n += 1
            k += 1
    return found[:n]


@njit(cache=True, nogil=True)
def best_curve(
    points: tuple[AnyArray, AnyArray, AnyArray],
    left: AnyArray,
    shapes: tuple[AnyArray, AnyArray],
    sides: tuple[float, ...],
) -> tuple[int, tuple[float, float, float]]:
    """Return the curve with most votes in a slice, and how many steps along it hold a vote for it.

    `points` are stations (rising), offsets and heights; those that are `left` vote, one for each cell, and the
    cells of one step along share a vote. `shapes` are slopes and curvatures, `sides` those of a cell along, up
    and across and the height of a bin [m].
    """
    s, o, z = points
    along, up, across, bin_m = sides
    voter, weight, step_of = np.empty(len(s), np.int64), np.empty(len(s)), np.empty(len(s), np.int64)
    key = np.empty(len(s))
    n, first = 0, 0
    for i in range(len(s)):
        if not left[i]:
            continue
        step = math.floor(s[i] / along)
        if n > first and step != step_of[first]:
            weight[first:n] = 1.0 / (n - first)
            first = n
        cell = math.floor(z[i] / up) * 1e3 + math.floor(o[i] / across)
        k = n  # cells of a step by rising number, the first point of each
        while k > first and key[k - 1] > cell:
            k -= 1
        if k > first and key[k - 1] == cell:
            continue
        for j in range(n, k, -1):
            key[j], voter[j] = key[j - 1], voter[j - 1]
        key[k], voter[k], step_of[n] = cell, i, step
        n += 1
    weight[first:n] = 1.0 / max(n - first, 1)
    s, z = s[voter[:n]], z[voter[:n]]
    curve = slice_peak(s, z, weight[:n], shapes[0], shapes[1], bin_m)
    seen, last = 0, -(10**9)
    for i in range(n):
        near = abs(z[i] - curve[0] - curve[1] * s[i] - 0.5 * curve[2] * s[i] * s[i]) <= bin_m
        if near and step_of[i] != last:
            seen, last = seen + 1, step_of[i]
    return seen, curve


@njit(cache=True, nogil=True)
def slice_peak(
    s: AnyArray, z: AnyArray, weight: AnyArray, slopes: AnyArray, curvatures: AnyArray, bin_m: float
) -> tuple[float, float, float]:
    """Return (height at 0, slope, curvature) of the hanging curve that most cells of a slice lie on.

    A Radon transform of the vertical slice with one more parameter, the curvature: each cell votes with its
    weight for the height z - m s - k s^2 / 2. Two neighbouring bins count together, so that no curve falls
    between.
    """
    top, best = 0.0, (0.0, 0.0, 0.0)
    bend = 0.5 * curvatures.max() * max(s.max() ** 2, s.min() ** 2)
    tilt = np.abs(slopes).max() * max(abs(s.max()), abs(s.min()))
    lowest = z.min() - tilt - bend
    n_bins = int((z.max() + tilt - lowest) / bin_m) + 3
    votes = np.zeros(n_bins + 1)  # from one: the first bin has a neighbour below
    sag, bins = np.empty(len(s)), np.empty(len(s), np.int32)
    for k in curvatures:
        for i in range(len(s)):
            sag[i] = 0.5 * k * s[i] * s[i]
        for m in slopes:
            for i in range(len(s)):
                bins[i] = np.int32((z[i] - m * s[i] - sag[i] - lowest) / bin_m) + 1
            highest = 0.0
            for i in range(len(s)):
                b = bins[i]
                votes[b] += weight[i]
                highest = max(highest, votes[b] + max(votes[b - 1], votes[b + 1]))
            if highest > top:  # rarely: where it is
                for b in range(1, n_bins):
                    if votes[b] + votes[b + 1] > top:
                        top = votes[b] + votes[b + 1]
                        best = (lowest + b * bin_m, m, k)
            for i in range(len(s)):
                votes[bins[i]] = 0.0
    return best


@njit(cache=True, nogil=True)
def grow(
    s: AnyArray, o: AnyArray, z: AnyArray, member: AnyArray, gates: AnyArray, max_gap: float
) -> AnyArray:
    """Follow a wire along its line in both directions and return which points belong to it.

    A parabola z(s) and a straight o(s) are fitted to all members so far; they predict the next stretch, a
    quarter of the length known; points within the gate join. It stops where `max_gap` holds no point, and
    where the ring about it holds more points than the tube: in a crown, and in a bundle that it crosses.

    Points are sorted by s. `gates` is (floor [m], ceiling [m], ring): the gate is four standard deviations of
    the members about their fit and of the prediction, between floor and ceiling; the ring's outer radius is
    `ring` gates.
    """
    member = member.copy()
    done = [False, False]
    for _ in range(400):
        fit = _parabola(s, o, z, member)
        if fit[1] - fit[0] < 1e-6 or (done[0] and done[1]):
            break
        step = min(max(0.25 * (fit[1] - fit[0]), 2.0), max_gap)
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
        # those that the better fit no longer explains leave
        low, high, centre, curve, _, sigma_z, sigma_o = _parabola(s, o, z, member)
        gate_z = min(max(4.0 * sigma_z, gates[0]), gates[1])
        gate_o = min(max(4.0 * sigma_o, gates[0]), gates[1])
        for i in range(len(s)):
            if low <= s[i] <= high:
                u = s[i] - centre
                member[i] = (
                    abs(z[i] - (curve[0] + curve[1] * u + curve[2] * u * u)) <= gate_z
                    and abs(o[i] - (curve[3] + curve[4] * u)) <= gate_o
                )
    return member


@njit(cache=True, nogil=True)
def _stretch(
    s: AnyArray,
    o: AnyArray,
    z: AnyArray,
    member: AnyArray,
    fit: Any,
    side: int,
    reach: float,
    gates: AnyArray,
) -> tuple[AnyArray, int]:
    """Return the points that join in the next `reach` metres, and how many lie in the ring about them."""
    low, high, centre, curve, cofactor, sigma_z, sigma_o = fit
    joined = np.empty(len(s), np.int64)
    n, around = 0, 0
    for i in range(len(s)):
        ahead = low - s[i] if side == 0 else s[i] - high
        if 0.0 < ahead <= reach and not member[i]:
            u = s[i] - centre
            wide = 4.0 * math.sqrt(1.0 + _variance(cofactor, u))
            gate_z = min(max(wide * sigma_z, gates[0]), gates[1])
            gate_o = min(max(wide * sigma_o, gates[0]), gates[1])
            dz = z[i] - (curve[0] + curve[1] * u + curve[2] * u * u)
            do = o[i] - (curve[3] + curve[4] * u)
            if abs(dz) <= gate_z and abs(do) <= gate_o:
                joined[n] = i
                n += 1
            elif 1.25 * max(gate_z, gate_o) < math.hypot(dz, do) <= gates[2] * max(gate_z, gate_o):
                around += 1
    return joined[:n], around


@njit(cache=True, nogil=True)
def settle(
    s: AnyArray, o: AnyArray, z: AnyArray, free: AnyArray, curve: tuple[float, float, float], gate: float
) -> AnyArray:
    """Return which points lie on the wire near a curve (height at 0, slope, curvature) of the slice.

    Of wires side by side the one that most half metres agree on; then parabola and line are fitted to the
    points within the gate, which narrows from one and a half times to half of `gate`: a curve across two
    wires comes to rest on one of them.
    """
    member = np.zeros(len(s), np.bool_)
    half = 0.5 * gate
    n_bins = 2 * math.ceil(np.abs(o).max() / half) + 4
    agree = np.zeros(n_bins, np.int32)
    last = np.full(n_bins, -(10**9), np.int64)
    for i in range(len(s)):
        member[i] = (
            free[i] and abs(z[i] - curve[0] - curve[1] * s[i] - 0.5 * curve[2] * s[i] * s[i]) <= 1.6 * gate
        )
        if member[i]:
            b = math.floor(o[i] / half) + n_bins // 2
            half_metre = math.floor(2.0 * s[i])
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
        member[i] = member[i] and abs(o[i] - offset) <= 2.0 * gate
    for narrow in (1.5, 1.2, 1.0, 0.8, 0.65, 0.5, 0.5, 0.5):
        low, high, centre, fit, _, _sigma_z, _sigma_o = _parabola(s, o, z, member)
        if high - low < 1e-6:
            break
        width = gate * narrow
        for i in range(len(s)):
            u = s[i] - centre
            member[i] = (
                free[i]
                and low - 1.0 <= s[i] <= high + 1.0
                and abs(z[i] - fit[0] - fit[1] * u - fit[2] * u * u) <= width
                and abs(o[i] - fit[3] - fit[4] * u) <= width
            )
    return member


@njit(cache=True, nogil=True)
def thinness(
    s: AnyArray, o: AnyArray, z: AnyArray, member: AnyArray, gates: AnyArray
) -> tuple[float, float, float]:
    """Return length, share of metres with a point, and share of these with more than a third in the ring.

    The tube about the members' fit is four deviations wide, within `gates` (floor, ceiling, ring); the ring
    lies between one and a quarter times that and `ring` times that.
    """
    low, high, centre, fit, _, sigma_z, sigma_o = _parabola(s, o, z, member)
    n = math.ceil(high - low)
    if n < 1:
        return 0.0, 0.0, 1.0
    tube = min(max(4.0 * max(sigma_z, sigma_o), gates[0]), gates[1])
    inside, around = np.zeros(n, np.int32), np.zeros(n, np.int32)
    for i in range(len(s)):
        if low <= s[i] <= high:
            u = s[i] - centre
            r = math.hypot(z[i] - fit[0] - fit[1] * u - fit[2] * u * u, o[i] - fit[3] - fit[4] * u)
            metre = min(int(s[i] - low), n - 1)
            if r <= tube:
                inside[metre] += 1
            elif 1.25 * tube < r <= gates[2] * tube:
                around[metre] += 1
    has, ringed = 0, 0
    for m in range(n):
        if inside[m] > 0:
            has += 1
            if 3 * around[m] > inside[m]:
                ringed += 1
    return high - low, has / n, ringed / max(has, 1)


@njit(cache=True, nogil=True)
def _variance(cofactor: AnyArray, u: float) -> float:
    v = np.array([1.0, u, u * u])
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += v[i] * cofactor[i, j] * v[j]
    return max(total, 0.0)


@njit(cache=True, nogil=True)
def _parabola(
    s: AnyArray, o: AnyArray, z: AnyArray, member: AnyArray
) -> tuple[float, float, float, AnyArray, AnyArray, float, float]:
    """Fit z by a parabola and o by a line in u = s - centre: coefficients (z0, z1, z2, o0, o1)."""
    n = 0
    low, high, centre = 1e300, -1e300, 0.0
    for i in range(len(s)):
        if member[i]:
            n += 1
            centre += s[i]
            low, high = min(low, s[i]), max(high, s[i])
    fit = np.zeros(5)
    cofactor = np.zeros((3, 3))
    if n < 4:
        return 0.0, 0.0, 0.0, fit, cofactor, 0.0, 0.0
    centre /= n
    scale = max(high - low, 1e-3) / 2.0
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
        normal[a, a] += 1e-9 * n
    inverse = np.linalg.inv(normal)
    for a in range(3):
        for b in range(3):
            fit[a] += inverse[a, b] * right_z[b]
            cofactor[a, b] = inverse[a, b] / scale ** (a + b)
    determinant = normal[0, 0] * normal[1, 1] - normal[0, 1] ** 2
    fit[3] = (normal[1, 1] * right_o[0] - normal[0, 1] * right_o[1]) / determinant
    fit[4] = (normal[0, 0] * right_o[1] - normal[0, 1] * right_o[0]) / determinant / scale
    fit[1] /= scale
    fit[2] /= scale * scale
    sigma_z, sigma_o = _scatter(s - centre, o, z, member, fit)
    return low, high, centre, fit, cofactor, sigma_z, sigma_o


@njit(cache=True, nogil=True)
def _scatter(u: AnyArray, o: AnyArray, z: AnyArray, member: AnyArray, fit: AnyArray) -> tuple[float, float]:
    """Return the standard deviations of the members about parabola and line."""
    square_z, square_o, n = 0.0, 0.0, 0
    for i in range(len(u)):
        if member[i]:
            n += 1
            square_z += (z[i] - fit[0] - fit[1] * u[i] - fit[2] * u[i] * u[i]) ** 2
            square_o += (o[i] - fit[3] - fit[4] * u[i]) ** 2
    return math.sqrt(square_z / max(n - 3, 1)), math.sqrt(square_o / max(n - 2, 1))
