"""Finding stripes in a search area: their direction, and the bright bands of the profile across it.

A search area is a disc about a place near bright points; its points are rows of `linework.kernels.paint.paint_points`
with x and y from that place.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.paint.paint_points import POINT_INTENSITY, POINT_TIME, POINT_X, POINT_Y, POINT_Z
from linework.kernels.paint.stripe_bands import (
    BAND_POINTS,
    N_SIDE,
    band_on_shoulder,
    dark_gap,
    difference_t,
    narrower_band,
)

#: Columns of a band of brightness across a search area: its right and left edge [m, across], and its t-value over
#: the scatter of what was left when it was taken.
BAND_RIGHT, BAND_LEFT, BAND_T = range(3)
BAND_COLUMNS = 3

#: Points that are enough for a search area: 500 per square metre and more.
ENOUGH = 1500
#: Share of the lattice's cells around a search area that its disc covers, about.
DISC_SHARE = 0.4
#: Directions that are tried, 11.25 degrees apart; a parabola finds the direction between them.
N_ANGLES = 16
#: Bins across a search area while its direction is sought, and how far they reach, in radii.
N_TURN_BINS, TURN_REACH = 24, 1.2
#: Points that are enough to find the direction.
ENOUGH_TURN = 400
#: Bins with few points count less, as if this share of a bin's usual points had the mean brightness.
SHRINKING = 0.1
#: Bins across a search area of radius R, and how far they reach in radii: a bar 0.5 m wide and the road on both
#: sides of it fit in.
N_ACROSS, PROFILE_REACH = 56, 1.4
#: Widest paint, in bins: 1 m in a search area of 0.5 m.
WIDEST = 40
#: Bins on either side of a border whose means give the slope of the brightness there.
N_EDGE = 2
#: Most stripes of one search area: a double line and two neighbours.
MOST_STRIPES = 4
#: Fewest degrees of freedom of the profile's noise.
LEAST_FREE = 8.0
#: Narrowest line of paint (Vienna convention of 1968, protocol on road markings). [m]
NARROWEST_LINE_M = 0.10
#: Width over which the spot of a beam from the air blurs the edges of a line. [m]
BLURRED_M = 0.3
#: Smallest variance of brightness, so that noiseless points do not divide by zero. [(paint - road)^2]
LEAST_VARIANCE = 1e-6


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
    """Write the points within `reach` of a place to `work`, with x and y from there; return their number.

    Parameters
    ----------
    points, starts, lattice
        (n, 5), (n_cells + 1,): see `linework.kernels.paint.paint_points.sort_into_cells`.
    x, y, reach
        The place and the radius. [m, from the local origin]
    work
        (k, 5) output.

    Returns
    -------
    The number of points; if `work` is too small, minus the number of rows that are needed.
    """
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
    # Of a dense disc every second, third ... point is enough
    stride = 1 + int(DISC_SHARE * most) // ENOUGH
    if most // stride + row1 - row0 + 1 > len(work):
        return -(most // stride + row1 - row0 + 1)
    n = 0
    for row in range(row0, row1 + 1):
        for i in range(starts[row * n_cols + col0], starts[row * n_cols + col1 + 1], stride):
            dx, dy = points[i, POINT_X] - x, points[i, POINT_Y] - y
            if dx * dx + dy * dy <= reach * reach:
                work[n, POINT_X], work[n, POINT_Y], work[n, POINT_Z] = dx, dy, points[i, POINT_Z]
                work[n, POINT_INTENSITY], work[n, POINT_TIME] = (
                    points[i, POINT_INTENSITY],
                    points[i, POINT_TIME],
                )
                n += 1
    return n


@njit(cache=True, nogil=True)
def direction(work: FloatArray, n: int, radius: float) -> float:
    """Return the direction [rad] of the stripes or edges in a search area.

    For each of 16 directions the points within 1.2 radii fall into bins across it; the sum of squares between the
    bins is largest along stripes and edges. All points count, not only the bright ones, so the density of the scan
    lines does not matter. A parabola through the best three gives the direction between.

    Parameters
    ----------
    work
        (n or more, 5): points, see `gather`.
    radius
        Of the search area. [m]
    """
    reach = TURN_REACH * radius
    scale = N_TURN_BINS / (2.0 * reach)
    stride = max(n // ENOUGH_TURN, 1)
    most = n // stride + 1
    near_x, near_y, brightness = np.empty(most), np.empty(most), np.empty(most)
    total, number = 0.0, 0
    for i in range(0, n, stride):
        if work[i, POINT_X] ** 2 + work[i, POINT_Y] ** 2 <= reach * reach:
            near_x[number], near_y[number] = work[i, POINT_X] * scale, work[i, POINT_Y] * scale
            brightness[number] = work[i, POINT_INTENSITY]
            total += work[i, POINT_INTENSITY]
            number += 1
    mean = total / max(number, 1)
    few = SHRINKING * number / N_TURN_BINS + 1.0
    for i in range(number):
        brightness[i] -= mean
    between = np.zeros(N_ANGLES)
    bins, counts = np.zeros(N_TURN_BINS), np.zeros(N_TURN_BINS)
    others, other_counts = np.zeros(N_TURN_BINS), np.zeros(N_TURN_BINS)
    # Two directions at a time: while one waits for the sum of its bin, the other goes on
    half = N_ANGLES // 2
    for k in range(half):
        angle, other = k * math.pi / N_ANGLES, (k + half) * math.pi / N_ANGLES
        nx, ny = -math.sin(angle), math.cos(angle)
        mx, my = -math.sin(other), math.cos(other)
        bins[:], counts[:] = 0.0, 0.0
        others[:], other_counts[:] = 0.0, 0.0
        for i in range(number):
            b = min(int(near_x[i] * nx + near_y[i] * ny + 0.5 * N_TURN_BINS), N_TURN_BINS - 1)
            c = min(int(near_x[i] * mx + near_y[i] * my + 0.5 * N_TURN_BINS), N_TURN_BINS - 1)
            bins[b] += brightness[i]
            counts[b] += 1.0
            others[c] += brightness[i]
            other_counts[c] += 1.0
        for b in range(N_TURN_BINS):
            between[k] += bins[b] * bins[b] / (counts[b] + few)
            between[k + half] += others[b] * others[b] / (other_counts[b] + few)
    best = int(np.argmax(between))
    before, after = between[best - 1], between[(best + 1) % N_ANGLES]
    bend = before - 2.0 * between[best] + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return (best + shift) * math.pi / N_ANGLES


@njit(cache=True, nogil=True)
def stripes_across(
    work: FloatArray, n: int, angle: float, radius: float, least_t: float, out: FloatArray
) -> int:
    """Find the stripes along a direction, and return their number: bands brighter than the road on both sides.

    The profile across has 56 bins. The band that stands out most from both its sides is taken (the smaller of its
    two t-values counts), then the next one beside it, by the scatter of what is left.

    Parameters
    ----------
    work
        (n or more, 5): points, see `gather`.
    angle
        Direction of the stripes. [rad]
    radius
        Of the search area. [m]
    least_t
        Smallest t-value of a band.
    out
        (4, 3) output with the columns `BAND_RIGHT`, `BAND_LEFT`, `BAND_T`.
    """
    reach = PROFILE_REACH * radius
    size = 2.0 * reach / N_ACROSS
    ux, uy = math.cos(angle), math.sin(angle)
    number, total, square = np.zeros(N_ACROSS + 1), np.zeros(N_ACROSS + 1), np.zeros(N_ACROSS)
    for i in range(n):
        u = work[i, POINT_X] * ux + work[i, POINT_Y] * uy
        v = work[i, POINT_Y] * ux - work[i, POINT_X] * uy
        if abs(u) < radius and abs(v) < reach:
            b = int((v + reach) / size)
            number[b + 1] += 1.0
            total[b + 1] += work[i, POINT_INTENSITY]
            square[b] += work[i, POINT_INTENSITY] ** 2
    within, free = np.zeros(N_ACROSS), np.zeros(N_ACROSS)
    for b in range(N_ACROSS):
        if number[b + 1] > 0.0:
            within[b], free[b] = square[b] - total[b + 1] ** 2 / number[b + 1], number[b + 1] - 1.0
        number[b + 1] += number[b]
        total[b + 1] += total[b]
    if free.sum() < LEAST_FREE:
        return 0
    variance = pooled = within.sum() / free.sum() + LEAST_VARIANCE
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
            if n_right < BAND_POINTS:
                continue
            right = (total[a] - total[a0]) / n_right
            for b in falls:
                if b <= a:
                    continue
                if b > a + WIDEST or taken[a:b].any():
                    break
                n_in, b1 = number[b] - number[a], min(b + N_SIDE, N_ACROSS)
                n_left = number[b1] - number[b]
                if n_in < BAND_POINTS or n_left < BAND_POINTS:
                    continue
                mean, left = (total[b] - total[a]) / n_in, (total[b1] - total[b]) / n_left
                if mean <= right or mean <= left:
                    continue
                t = min(
                    difference_t(mean, n_in, right, n_right, variance),
                    difference_t(mean, n_in, left, n_left, variance),
                )
                if t > best:
                    best, first, last = t, a, b
        if first < 0:
            break
        out[m, BAND_RIGHT], out[m, BAND_LEFT], out[m, BAND_T] = (
            first * size - reach,
            last * size - reach,
            best,
        )
        m += 1
        taken[max(first - 1, 0) : min(last + 1, N_ACROSS)] = 1
        # The next ones stand out from what is left: a kerb's face, the brightest of all, scatters most
        rest_within, rest_free = 0.0, 0.0
        for b in range(N_ACROSS):
            if taken[b] == 0:
                rest_within += within[b]
                rest_free += free[b]
        if rest_free >= LEAST_FREE:
            variance = min(variance, rest_within / rest_free + LEAST_VARIANCE)
    # What lies within a band is told by the scatter there, too. Two lines near each other stand out more as one from the road
    # on both sides than each from the gap between
    for j in range(m):
        if m == MOST_STRIPES:
            break
        outer = borders_of(out[j], size, reach)
        first, last, t = dark_gap(number, total, pooled, rises, falls, outer, least_t)
        if first >= 0:
            out[m, BAND_RIGHT], out[m, BAND_LEFT], out[m, BAND_T] = last * size - reach, out[j, BAND_LEFT], t
            out[j, BAND_LEFT], out[j, BAND_T] = first * size - reach, t
            m += 1
    # Both edges of a line within a band need bins of their own. Where points are sparse these are too wide, and what is left of
    # the band on either side must be wider than the edge of a line is blurred. Along one side of a band an edge of the line is
    # that of the band
    bins, wide = int(NARROWEST_LINE_M / size + 0.5), m
    beside = 1 if bins >= 2 * N_EDGE else int(BLURRED_M / size + 0.5)
    for k in range(2 * wide):
        if m == MOST_STRIPES:
            break
        outer = borders_of(out[k % wide], size, reach)
        if k >= wide:
            first, last, t = band_on_shoulder(number, total, pooled, rises, falls, outer, least_t)
        else:
            first, last, t = narrower_band(number, total, pooled, rises, falls, outer, beside, least_t)
        if first >= 0:
            out[m, BAND_RIGHT], out[m, BAND_LEFT], out[m, BAND_T] = (
                first * size - reach,
                last * size - reach,
                t,
            )
            m += 1
    return m


@njit(cache=True, nogil=True)
def borders_of(band: FloatArray, size: float, reach: float) -> tuple[int, int]:
    """Return the first and last border of a band (3,) between the bins of `size` [m], which begin at -`reach` [m]."""
    return int((band[BAND_RIGHT] + reach) / size + 0.5), int((band[BAND_LEFT] + reach) / size + 0.5)


@njit(cache=True, nogil=True)
def edges_of(number: FloatArray, total: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the borders between bins where a profile rises most, and where it falls most, (k,) and (l,) int64.

    The slope at a border is the difference of the means of two bins on each side of it.

    Parameters
    ----------
    number, total
        (m + 1,): running sums over the bins of the points, and of their brightness.
    """
    n = len(number) - 1
    rise = np.zeros(n + 1)
    for a in range(1, n):
        low, high = max(a - N_EDGE, 0), min(a + N_EDGE, n)
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
