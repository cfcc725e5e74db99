"""Linking of stripes of image rows into lines, their partners in the other image, and local straight-line fits."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray

#: Columns of the places to be linked: across and ahead on the road [m], width [m], standard deviation across [m].
PLACE_ACROSS, PLACE_AHEAD, PLACE_WIDTH, PLACE_SIGMA = range(4)
#: Columns of the stripes to be paired: column and width [pixels], contrast [grey values], expected disparity [pixels].
PARTNER_COL, PARTNER_WIDTH, PARTNER_CONTRAST, PARTNER_DISPARITY = range(4)
#: Length behind the last place that a line's direction is fitted to [m]; most and fewest places in it.
STRIPE_PAST_M, MOST_PAST, LEAST_PAST = 1.5, 24, 3
#: Most lines that are open at once, a bound on memory: a row has at most 64 stripes (`row_stripes.MOST_PER_ROW`).
MOST_OPEN = 256
#: Largest change of slope per metre ahead: a bend of 20 m radius, over a metre. [1/m]
LINK_TURN = 0.05
#: Growth of the largest change of slope with the slope itself. [1/m] How it was chosen is not recorded.
LINK_TURN_PER_SLOPE = 0.1
#: Share of the width of paint by which its middle may be off where one edge is worn.
WORN_WIDTH = 0.30
#: Largest change of width to the next place: a share of the width, and standard deviations beside it. How they were
#: chosen is not recorded.
LINK_WIDTH_CHANGE, LINK_WIDTH_SIGMAS = 0.6, 4.0
#: Gate of a place across, in standard deviations; and its smallest half width beside these [m].
LINK_SIGMAS, LINK_SLACK_M = 3.0, 0.05
#: Largest difference in width between both images, as a share of the width and in pixels beside it; and the largest
#: ratio of the contrasts. How they were chosen is not recorded.
PARTNER_WIDTH_SHARE, PARTNER_WIDTH_PX, PARTNER_CONTRAST_RATIO = 0.35, 1.0, 2.5
#: Number of neighbouring rows that err as one: they show the same grain of asphalt and paint, and share pixels after
#: resampling.
SHARED_ROWS = 2.0
#: Rounds of reweighting of a local line, the residual from which a value weighs less (Huber), and the residual at
#: which the scatter is cut off. [1, sigma, sigma]
FIT_ROUNDS, FIT_HUBER, FIT_CUT = 6, 2.0, 3.0
#: Fewest values in a window of a local line; a window that holds fewer is doubled, at most so many times.
FIT_LEAST_VALUES, FIT_DOUBLINGS = 3, 6


@njit(cache=True, nogil=True)
def _direction(places: FloatArray, past: IntArray, n: int) -> tuple[float, float, float, float]:
    """Return a line's end across and ahead [m], its slope and the slope's standard deviation; NaN where too short."""
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
    """Return (n,) int64: the number of the line that each place belongs to, -1 for none.

    Parameters
    ----------
    places
        (n, 4) in order of rows, from near to far; columns `PLACE_ACROSS` to `PLACE_SIGMA`.
    first
        (n_rows + 1,) int64: first place of each row.
    steepest
        Largest slope of a line: metres across per metre ahead.
    gap
        Longest gap in a line [m] and in rows; the larger one counts.
    """
    n = len(places)
    line = np.full(n, -1, dtype=np.int64)
    past = np.zeros((MOST_OPEN, MOST_PAST), dtype=np.int64)
    number, size = np.full(MOST_OPEN, -1, np.int64), np.zeros(MOST_OPEN, np.int64)
    last_row = np.zeros(MOST_OPEN, np.int64)
    wanted = np.zeros(MOST_OPEN, dtype=np.int64)
    cost = np.zeros(MOST_OPEN)
    n_lines = 0
    for r in range(n_rows):
        start, end = first[r], first[r + 1]
        # End lines whose last place is too far back
        for a in range(MOST_OPEN):
            if number[a] >= 0 and start < end:
                y = places[past[a, (size[a] - 1) % MOST_PAST], PLACE_AHEAD]
                if places[start, PLACE_AHEAD] - y > gap[0] and r - last_row[a] > gap[1]:
                    number[a] = -1
        # Each line chooses a place, then each place the best of the lines that chose it
        taken = np.full(end - start, -1, dtype=np.int64)
        for a in range(MOST_OPEN):
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
                bound = 0.5 * wide + steepest * max(ahead, 0.0) + LINK_SIGMAS * own
                if not math.isnan(slope):
                    if abs(across) > bound:
                        continue
                    across -= slope * ahead
                    turn = LINK_TURN + LINK_TURN_PER_SLOPE * abs(slope) + LINK_SIGMAS * sigma
                    bound = min(bound, WORN_WIDTH * wide + LINK_SIGMAS * own + turn * ahead + LINK_SLACK_M)
                most_change = LINK_WIDTH_CHANGE * wide + LINK_WIDTH_SIGMAS * own
                change = abs(places[j, PLACE_WIDTH] - places[j0, PLACE_WIDTH]) / most_change
                value = max(abs(across) / bound, change)
                if value < best:
                    best, wanted[a] = value, j
            cost[a] = best
            if wanted[a] >= 0:
                k = wanted[a] - start
                rival = taken[k]
                # The longer line has precedence
                if rival < 0 or (cost[a] + 1.0 / size[a]) < (cost[rival] + 1.0 / size[rival]):
                    taken[k] = a
        for k in range(end - start):
            j = start + k
            a = taken[k]
            if a < 0:
                # A new line, in the first free slot
                for b in range(MOST_OPEN):
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
    """Return (n,) int64: the stripe of the right image that matches each stripe of the left one, -1 for none.

    Parameters
    ----------
    left, right
        (n, 4) and (m, 4): columns `PARTNER_COL` to `PARTNER_DISPARITY`; that of the right ones is not used.
    first_left, first_right
        (n_rows + 1,) int64: first stripe of each row, of the same rows.
    gate
        (n_rows,) largest difference from the expected disparity. [pixels]
    """
    out = np.full(len(left), -1, dtype=np.int64)
    for r in range(n_rows):
        for i in range(first_left[r], first_left[r + 1]):
            best = 1.0
            for j in range(first_right[r], first_right[r + 1]):
                wide_left, wide_right = left[i, PARTNER_WIDTH], right[j, PARTNER_WIDTH]
                most_wider = PARTNER_WIDTH_SHARE * max(wide_left, wide_right) + PARTNER_WIDTH_PX
                ratio = left[i, PARTNER_CONTRAST] / right[j, PARTNER_CONTRAST]
                off = abs(left[i, PARTNER_COL] - right[j, PARTNER_COL] - left[i, PARTNER_DISPARITY]) / gate[r]
                wide = abs(wide_left - wide_right) / most_wider
                bright = abs(math.log(ratio)) / math.log(PARTNER_CONTRAST_RATIO)
                value = max(off, wide, bright)
                if value < best:
                    best, out[i] = value, j
    return out


@njit(cache=True, nogil=True)
def fit_at(
    along: FloatArray, value: FloatArray, sigma: FloatArray, at: FloatArray, half: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the value of a local straight line at chosen places, and its standard deviation, both (m,).

    Parameters
    ----------
    along, value, sigma
        (n,) places in ascending order, the values measured there, and their standard deviations; NaN values are left
        out.
    at, half
        (m,) places and half the window at each, in the unit of `along`.

    Notes
    -----
    Weights fall off with the distance (tricube); a value more than 2 standard deviations off weighs less (Huber).
    A window of fewer than 3 values is widened. The standard deviation follows from those of the values, and grows
    where their scatter is larger.
    """
    n, m = len(along), len(at)
    out, spread = np.full(m, np.nan), np.full(m, np.nan)
    for k in range(m):
        reach = max(half[k], 1e-6)
        for _ in range(FIT_DOUBLINGS):
            count = 0
            for i in range(n):
                if abs(along[i] - at[k]) < reach and not math.isnan(value[i]):
                    count += 1
            if count >= FIT_LEAST_VALUES:
                break
            reach *= 2.0
        a = b = 0.0
        scale = 1.0
        for turn in range(FIT_ROUNDS):
            s = sx = sxx = sy = sxy = 0.0
            s2 = s2x = s2xx = 0.0
            for i in range(n):
                x = along[i] - at[k]
                if abs(x) >= reach or math.isnan(value[i]):
                    continue
                w = (1.0 - abs(x / reach) ** 3) ** 3 / sigma[i] ** 2
                if turn > 0:
                    off = abs(value[i] - a - b * x) / sigma[i]
                    if off > FIT_HUBER:
                        w *= FIT_HUBER / off
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
            # Scale of the standard deviations, from the scatter
            total = weight = 0.0
            for i in range(n):
                x = along[i] - at[k]
                if abs(x) < reach and not math.isnan(value[i]):
                    w = (1.0 - abs(x / reach) ** 3) ** 3
                    off = min(abs(value[i] - a - b * x) / sigma[i], FIT_CUT * scale)
                    total, weight = total + w * off * off, weight + w
            scale = max(math.sqrt(total / weight), 1.0) if weight > 0.0 else 1.0
            out[k], spread[k] = a, math.sqrt(max(var, 0.0) * SHARED_ROWS) * scale
    return out, spread
