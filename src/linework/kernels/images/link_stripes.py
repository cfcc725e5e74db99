"""Stripes of single rows linked into lines, from near to far, on the plane of the road."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray

#: Columns of the places to be linked: across and ahead on the road [m], width [m], standard deviation across [m].
PLACE_ACROSS, PLACE_AHEAD, PLACE_WIDTH, PLACE_SIGMA = range(4)
#: A line's direction is taken from so much of its past [m], places at most and least.
STRIPE_PAST_M, MOST_PAST, LEAST_PAST = 1.5, 24, 3
#: How far a line may leave its direction per metre ahead: a bend of 20 m radius, over a metre. And so much of the
#: width of paint, of whose edges some are worn.
LINK_TURN, WORN_WIDTH = 0.05, 0.30


@njit(cache=True, nogil=True)
def _direction(places: FloatArray, past: IntArray, n: int) -> tuple[float, float, float, float]:
    """Return where a line leads: last place across and ahead, its slope and how well that is known; NaN if not."""
    s = sx = sy = sxx = sxy = 0.0
    last = past[(n - 1) % MOST_PAST]
    y0, x0 = places[last, PLACE_AHEAD], places[last, PLACE_ACROSS]
    for i in range(n - 1, max(n - 1 - MOST_PAST, -1), -1):
        j = past[i % MOST_PAST]
        x, y = places[j, PLACE_ACROSS] - x0, places[j, PLACE_AHEAD] - y0
        if y < -STRIPE_PAST_M:
            break
        s, sx, sy, sxx, sxy = s + 1.0, sx + x, sy + y, sxx + y * y, sxy + x * y
    det = s * sxx - sy * sy
    if s < LEAST_PAST or det <= 1e-9:
        return x0, y0, np.nan, np.nan
    slope = (s * sxy - sy * sx) / det
    return x0 + (sx - slope * sy) / s, y0, slope, places[last, PLACE_SIGMA] * math.sqrt(s / det)


@njit(cache=True, nogil=True)
def link(
    places: FloatArray, first: IntArray, n_rows: int, steepest: float, gap: tuple[float, int]
) -> IntArray:
    """Return (n,) the line that each place belongs to.

    Parameters
    ----------
    places
        (n, 4) in order of rows, from near to far.
    first
        (n_rows + 1,) first place of each row.
    steepest
        Metres across per metre ahead that a line has at most.
    gap
        Longest gap in a line [m] and in rows; the larger one counts.
    """
    n = len(places)
    line = np.full(n, -1, dtype=np.int64)
    most = 256
    past = np.zeros((most, MOST_PAST), dtype=np.int64)
    number, size, last_row = np.full(most, -1, np.int64), np.zeros(most, np.int64), np.zeros(most, np.int64)
    wanted = np.zeros(most, dtype=np.int64)
    cost = np.zeros(most)
    n_lines = 0
    for r in range(n_rows):
        start, end = first[r], first[r + 1]
        # Lines whose last place is too far back are ended
        for a in range(most):
            if number[a] >= 0 and start < end:
                y = places[past[a, (size[a] - 1) % MOST_PAST], PLACE_AHEAD]
                if places[start, PLACE_AHEAD] - y > gap[0] and r - last_row[a] > gap[1]:
                    number[a] = -1
        # Every line chooses its place, every place the line that it suits best
        taken = np.full(end - start, -1, dtype=np.int64)
        for a in range(most):
            wanted[a] = -1
            if number[a] < 0:
                continue
            x, y, slope, sigma = _direction(places, past[a], size[a])
            j0 = past[a, (size[a] - 1) % MOST_PAST]
            best = 1.0
            for j in range(start, end):
                ahead = places[j, PLACE_AHEAD] - y
                across = places[j, PLACE_ACROSS] - x
                wide = max(places[j, PLACE_WIDTH], places[j0, PLACE_WIDTH])
                own = math.sqrt(places[j, PLACE_SIGMA] ** 2 + places[j0, PLACE_SIGMA] ** 2)
                bound = 0.5 * wide + steepest * max(ahead, 0.0) + 3.0 * own
                if not math.isnan(slope):
                    if abs(across) > bound:
                        continue
                    across -= slope * ahead
                    turn = LINK_TURN + 0.1 * abs(slope) + 3.0 * sigma
                    bound = min(bound, WORN_WIDTH * wide + 3.0 * own + turn * ahead + 0.05)
                other = abs(places[j, PLACE_WIDTH] - places[j0, PLACE_WIDTH]) / (0.6 * wide + 4.0 * own)
                value = max(abs(across) / bound, other)
                if value < best:
                    best, wanted[a] = value, j
            cost[a] = best
            if wanted[a] >= 0:
                k = wanted[a] - start
                rival = taken[k]
                # The longer line goes first
                if rival < 0 or (cost[a] + 1.0 / size[a]) < (cost[rival] + 1.0 / size[rival]):
                    taken[k] = a
        for k in range(end - start):
            j = start + k
            a = taken[k]
            if a < 0:
                # A new line, in the first free seat
                for b in range(most):
                    if number[b] < 0:
                        a = b
                        break
                if a < 0:
                    continue
                number[a], size[a] = n_lines, 0
                n_lines += 1
            past[a, size[a] % MOST_PAST] = j
            size[a] += 1
            last_row[a] = r
            line[j] = number[a]
    return line


@njit(cache=True, nogil=True)
def partners(
    left: FloatArray,
    first_left: IntArray,
    right: FloatArray,
    first_right: IntArray,
    n_rows: int,
    gate: FloatArray,
) -> IntArray:
    """Return (n,) the stripe of the right image that each stripe of the left one is, -1 where there is none.

    Parameters
    ----------
    left, right
        (n, 4): column, width and contrast, and the expected disparity of the left one [pixels].
    first_left, first_right
        First of each row; the same rows.
    gate
        (n_rows,) how far from the expected disparity [pixels].
    """
    out = np.full(len(left), -1, dtype=np.int64)
    for r in range(n_rows):
        for i in range(first_left[r], first_left[r + 1]):
            best = 1.0
            for j in range(first_right[r], first_right[r + 1]):
                off = abs(left[i, 0] - right[j, 0] - left[i, 3]) / gate[r]
                wide = abs(left[i, 1] - right[j, 1]) / (0.35 * max(left[i, 1], right[j, 1]) + 1.0)
                bright = abs(math.log(left[i, 2] / right[j, 2])) / math.log(2.5)
                value = max(off, wide, bright)
                if value < best:
                    best, out[i] = value, j
    return out


# Straight lines fitted locally along places of an image line, at chosen rows

#: Neighbouring rows see the same grain of asphalt and paint, and the same pixels after resampling: so many err as
#: one.
SHARED_ROWS = 2.0


@njit(cache=True, nogil=True)
def fit_at(
    along: FloatArray, value: FloatArray, sigma: FloatArray, at: FloatArray, half: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the value of a local straight line at chosen places, and its standard deviation.

    Parameters
    ----------
    along, value, sigma
        (n,) places in ascending order, what was measured there, and how well (NaN values count as not measured).
    at, half
        (m,) where, and half the window there, in the unit of `along`.

    Notes
    -----
    Weights fall off with the distance (tricube); a value more than 2 standard deviations off weighs less (Huber).
    Where less than 3 values are in a window, it is widened. The standard deviation is the larger one of that by
    the values' own and that by their scatter.
    """
    n, m = len(along), len(at)
    out, spread = np.full(m, np.nan), np.full(m, np.nan)
    for k in range(m):
        reach = max(half[k], 1e-6)
        for _ in range(6):
            count = 0
            for i in range(n):
                if abs(along[i] - at[k]) < reach and not math.isnan(value[i]):
                    count += 1
            if count >= 3:
                break
            reach *= 2.0
        a = b = 0.0
        scale = 1.0
        for turn in range(6):
            s = sx = sxx = sy = sxy = 0.0
            s2 = s2x = s2xx = 0.0
            for i in range(n):
                x = along[i] - at[k]
                if abs(x) >= reach or math.isnan(value[i]):
                    continue
                w = (1.0 - abs(x / reach) ** 3) ** 3 / sigma[i] ** 2
                if turn > 0:
                    off = abs(value[i] - a - b * x) / sigma[i]
                    if off > 2.0:
                        w *= 2.0 / off
                s, sx, sxx = s + w, sx + w * x, sxx + w * x * x
                sy, sxy = sy + w * value[i], sxy + w * x * value[i]
                v = w * w * sigma[i] ** 2
                s2, s2x, s2xx = s2 + v, s2x + v * x, s2xx + v * x * x
            if s <= 0.0:
                break
            det = s * sxx - sx * sx
            if det > 1e-6 * s * s * reach * reach * 0.01:
                a, b = (sxx * sy - sx * sxy) / det, (s * sxy - sx * sy) / det
                var = (sxx * sxx * s2 - 2.0 * sxx * sx * s2x + sx * sx * s2xx) / (det * det)
            else:
                a, b, var = sy / s, 0.0, s2 / (s * s)
            # The scatter says how well the values really are known
            total = weight = 0.0
            for i in range(n):
                x = along[i] - at[k]
                if abs(x) < reach and not math.isnan(value[i]):
                    w = (1.0 - abs(x / reach) ** 3) ** 3
                    off = min(abs(value[i] - a - b * x) / sigma[i], 3.0 * scale)
                    total, weight = total + w * off * off, weight + w
            scale = max(math.sqrt(total / weight), 1.0) if weight > 0.0 else 1.0
            out[k], spread[k] = a, math.sqrt(max(var, 0.0) * SHARED_ROWS) * scale
    return out, spread
