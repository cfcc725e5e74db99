"""Where stripes are in a search area: their direction, and the profile of brightness across it."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray

#: Columns of the points of a search area: place from its middle, height, brightness, time.
POINT_X, POINT_Y, POINT_Z, Q, TIME = range(5)

#: Points that show all there is in a search area: 500 per square metre and more.
ENOUGH = 1500
N_ANGLES = 16
N_TURN_BINS = 24
#: Bins across a search area of radius R, which reaches 1.4 R: a bar 0.5 m wide and the road on both sides of it
#: fit in.
N_ACROSS, PROFILE_ACROSS_M = 56, 1.4
#: Road beside a stripe that it is held against: 4 bins, 0.10 m of a search area of 0.5 m (double lines stand
#: 0.1 m and more apart).
N_SIDE = 4
#: Widest paint, in bins: 1 m.
WIDEST = 40
MOST_STRIPES = 4


@njit(cache=True, nogil=True)
def gather_within_reach(
    points: FloatArray,
    starts: IntArray,
    lattice: tuple[float, int, int, int, int],
    x: float,
    y: float,
    reach: float,
    work: FloatArray,
) -> int:
    """Write the points within `reach` of a place to `work`, places from there; return their number (or -needed)."""
    cell, south, west, n_rows, n_cols = lattice
    row0 = max(int(np.floor((y - reach) / cell)) - south, 0)
    row1 = min(int(np.floor((y + reach) / cell)) - south, n_rows - 1)
    col0 = max(int(np.floor((x - reach) / cell)) - west, 0)
    col1 = min(int(np.floor((x + reach) / cell)) - west, n_cols - 1)
    if col1 < col0:
        return 0
    most = 0
    for row in range(row0, row1 + 1):
        most += starts[row * n_cols + col1 + 1] - starts[row * n_cols + col0]
    # The disc is about 0.4 of these cells; of a denser one every second, third ... point shows as much
    stride = 1 + int(0.4 * most) // ENOUGH
    if most // stride + row1 - row0 + 1 > len(work):
        return -(most // stride + row1 - row0 + 1)
    n = 0
    for row in range(row0, row1 + 1):
        for i in range(starts[row * n_cols + col0], starts[row * n_cols + col1 + 1], stride):
            dx, dy = points[i, 0] - x, points[i, 1] - y
            if dx * dx + dy * dy <= reach * reach:
                work[n, POINT_X], work[n, POINT_Y], work[n, POINT_Z] = dx, dy, points[i, 2]
                work[n, Q], work[n, TIME] = points[i, 3], points[i, 4]
                n += 1
    return n


@njit(cache=True, nogil=True)
def direction(work: FloatArray, n: int, radius: float) -> float:
    """Return the direction [rad] across which the brightness of the points within 1.2 radii differs most.

    For each of 16 directions the points fall into bins across it; the sum of squares between the bins is
    largest along stripes and edges. All points count, not only the bright ones: how densely the scan lines
    lie does not matter. A parabola through the best three gives the direction between.
    """
    reach = 1.2 * radius
    scale = N_TURN_BINS / (2.0 * reach)
    # Some points settle a direction as well as all do
    stride = max(n // 400, 1)
    near = np.empty((n // stride + 1, 3))
    total, number = 0.0, 0
    for i in range(0, n, stride):
        if work[i, POINT_X] ** 2 + work[i, POINT_Y] ** 2 <= reach * reach:
            near[number, 0], near[number, 1], near[number, 2] = (
                work[i, POINT_X] * scale,
                work[i, POINT_Y] * scale,
                work[i, Q],
            )
            total += work[i, Q]
            number += 1
    mean = total / max(number, 1)
    # Bins of few points say little: as if this many more of the mean had been there
    few = 0.1 * number / N_TURN_BINS + 1.0
    between = np.zeros(N_ANGLES)
    bins, counts = np.zeros(N_TURN_BINS), np.zeros(N_TURN_BINS)
    for k in range(N_ANGLES):
        angle = k * math.pi / N_ANGLES
        nx, ny = -math.sin(angle), math.cos(angle)
        bins[:], counts[:] = 0.0, 0.0
        for i in range(number):
            b = min(int(near[i, 0] * nx + near[i, 1] * ny + 0.5 * N_TURN_BINS), N_TURN_BINS - 1)
            bins[b] += near[i, 2] - mean
            counts[b] += 1.0
        for b in range(N_TURN_BINS):
            between[k] += bins[b] * bins[b] / (counts[b] + few)
    best = int(np.argmax(between))
    before, after = between[best - 1], between[(best + 1) % N_ANGLES]
    bend = before - 2.0 * between[best] + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return (best + shift) * math.pi / N_ANGLES


@njit(cache=True, nogil=True)
def stripes_across(
    work: FloatArray, n: int, angle: float, radius: float, least_t: float, out: FloatArray
) -> int:
    """Find the stripes along a direction: bands that are brighter than the road on both their sides.

    The profile across has 56 bins; of all bands the one whose mean stands out most from the darker mean of
    the two sides (the smaller of two t-values counts) is taken, then the next one beside it.

    Writes right edge, left edge [m, across] and t-value of each to `out`; returns their number.
    """
    reach = PROFILE_ACROSS_M * radius
    size = 2.0 * reach / N_ACROSS
    ux, uy = math.cos(angle), math.sin(angle)
    number, total = np.zeros(N_ACROSS + 1), np.zeros(N_ACROSS + 1)
    square = 0.0
    for i in range(n):
        u, v = work[i, POINT_X] * ux + work[i, POINT_Y] * uy, work[i, POINT_Y] * ux - work[i, POINT_X] * uy
        if abs(u) < radius and abs(v) < reach:
            b = int((v + reach) / size)
            number[b + 1] += 1.0
            total[b + 1] += work[i, Q]
            square += work[i, Q] ** 2
    used, within = 0, square
    for b in range(1, N_ACROSS + 1):
        if number[b] > 0.0:
            used += 1
            within -= total[b] ** 2 / number[b]
        number[b] += number[b - 1]
        total[b] += total[b - 1]
    free = number[N_ACROSS] - used
    if free < 8.0:
        return 0
    variance = within / free + 1e-6
    rises, falls = edges_of(number, total)
    taken = np.zeros(N_ACROSS, dtype=np.uint8)
    m = 0
    while m < MOST_STRIPES:
        best, first, last = least_t, -1, -1
        for a in rises:
            if taken[a]:
                continue
            a0 = max(a - N_SIDE, 0)
            n_right = number[a] - number[a0]
            if n_right < 3.0:
                continue
            right = (total[a] - total[a0]) / n_right
            for b in falls:
                if b <= a:
                    continue
                if b > a + WIDEST or taken[a:b].any():
                    break
                n_in, b1 = number[b] - number[a], min(b + N_SIDE, N_ACROSS)
                n_left = number[b1] - number[b]
                if n_in < 3.0 or n_left < 3.0:
                    continue
                mean, left = (total[b] - total[a]) / n_in, (total[b1] - total[b]) / n_left
                if mean <= right or mean <= left:
                    continue
                t = min(
                    (mean - right) / math.sqrt(variance * (1.0 / n_in + 1.0 / n_right)),
                    (mean - left) / math.sqrt(variance * (1.0 / n_in + 1.0 / n_left)),
                )
                if t > best:
                    best, first, last = t, a, b
        if first < 0:
            break
        out[m, 0], out[m, 1], out[m, 2] = first * size - reach, last * size - reach, best
        m += 1
        taken[max(first - 1, 0) : min(last + 1, N_ACROSS)] = 1
    return m


@njit(cache=True, nogil=True)
def edges_of(number: FloatArray, total: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the borders between bins where the profile rises, and where it falls, more than beside them.

    number, total: sums of the bins so far. What counts is the difference of the means of two bins on each side.
    """
    n = len(number) - 1
    rise = np.zeros(n + 1)
    for a in range(1, n):
        low, high = max(a - 2, 0), min(a + 2, n)
        before, after = number[a] - number[low], number[high] - number[a]
        if before > 0.0 and after > 0.0:
            rise[a] = (total[high] - total[a]) / after - (total[a] - total[low]) / before
    rises, falls = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    n_rises, n_falls = 0, 0
    for a in range(1, n):
        if rise[a] > 0.0 and rise[a] >= rise[a - 1] and rise[a] >= rise[a + 1]:
            rises[n_rises] = a
            n_rises += 1
        if rise[a] < 0.0 and rise[a] <= rise[a - 1] and rise[a] <= rise[a + 1]:
            falls[n_falls] = a
            n_falls += 1
    return rises[:n_rises], falls[:n_falls]
