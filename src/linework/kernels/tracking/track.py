"""Tracking from box to box: the next box that collides with the prediction from the last ones.

The tracker of Seokchan Kang, Jeongwon Lee and Jiyeong Lee (2023), doi:10.3390/rs15194656, with a prediction of its own.
Boxes are sorted by the cells of a north-up lattice: `codes` is row * n_cols + col, ascending.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.tracking.small_systems import inverse_of_three

#: Columns of a table of boxes: centre [m], unit vector u, half extents [m], standard deviations of the centre across
#: [m] and of the direction [rad].
TRACK_X, TRACK_Y, TRACK_UX, TRACK_UY, TRACK_HALF_U, TRACK_HALF_V, TRACK_SIGMA_V, TRACK_SIGMA_U = range(8)

#: Why a line stops.
NOTHING_AHEAD, MEETS_LINE, JOINS_END = range(3)

#: Owner of a box: a line's number; none; none, and absorbed by the line beside it; or, from `LINE_END` downwards, an
#: end of a line: LINE_END - 2 line - side.
FREE, BESIDE, LINE_END = -1, -2, -10
#: Number of the last boxes of a line at which another one can join it.
N_END = 2

#: Number of neighbouring boxes that err as one: search areas overlap, so neighbours share about half of their points.
SHARED = 2.0
#: Longest piece behind the last box that the prediction uses. [m]
TRACK_PAST_M = 20.0
#: Largest turn that a parabola approximates, 45 degrees: cosine.
LEAST_ALONG = 0.7
#: Length of the last boxes that count in full: fewer do not show a curvature. [m]
RECENT_M = 2.0
#: Length over which a road changes its curvature (a clothoid), and the radius of the smallest bend that it changes
#: by. [m]
CLOTHOID_M, STRAIGHT_RADIUS_M = 20.0, 200.0
#: First search length: boxes are half a metre apart, so the next one is near. A nearer one than the least step is at
#: the same place. [m]
NEAR_BOX_M, LEAST_STEP_M = 1.2, 0.02
#: Longest gap over the length that has been tracked: 3 m of paint in a period of 12 m is the least in use.
GAP_PER_LENGTH = 4.0
#: Change of curvature over the usual one, by attempt: usual, a bend that begins without a clothoid, a corner.
TRACK_TURNS = (1.0, 4.0, 4.0)
#: Standard deviation of the jump of the curvature at a corner, where kerbs turn into arcs without a clothoid. [1/m]
CORNER = 1.0 / 6.0
#: Smallest radius of a line that is tracked: a kerb's corner. [m]
TIGHTEST_M = 3.0
#: Places along a box at which others may continue it; and their largest turn [rad].
SUPPORT_BINS, SUPPORT_TURN = 16, 0.35
#: Half of the narrowest gate, and what a gate is wider by than its sigmas: rounding, and errors that no sigma knows.
#: [m]
LEAST_GATE_M, GATE_SLACK_M, SUPPORT_SLACK_M = 0.03, 0.01, 0.02
#: Gates are this many standard deviations wide.
GATE_SIGMAS = 3.0
#: A candidate's turn: what its gate is wider by than its sigmas, and its largest value. [rad]
TURN_SLACK, MOST_BOX_TURN = 0.05, 0.6
#: Smallest variance of an observation, against division by zero. [m^2]
LEAST_VARIANCE_M2 = 1e-6
#: Number of boxes from which on the curvature is known better than by the tightest bend.
FEW_BOXES = 4
#: An end of a line is joined if the track runs into it, not against it: least cosine.
LEAST_INTO = 0.5
#: Boxes absorbed by a line run along it: least cosine (32 degrees); and lie this far beyond the two boxes at most [m].
LEAST_PARALLEL, ABSORB_BEYOND_M = 0.85, 0.1
#: Columns of a prediction in the frame of the last box: parabola v = a + b s + c s^2 / 2 [m, -, 1/m], covariance of its
#: coefficients, change of curvature per metre [1/m^2], standard deviation of a jump of the curvature [1/m].
(
    LEAD_A, LEAD_B, LEAD_C, LEAD_AA, LEAD_AB, LEAD_AC, LEAD_BB, LEAD_BC, LEAD_CC, LEAD_CHANGE, LEAD_JUMP,
) = range(11)  # fmt: skip
LEAD_COLUMNS = 11


@njit(cache=True, nogil=True)
def collides_in_plan(
    ax: float, ay: float, aux: float, auy: float, ahu: float, ahv: float,
    bx: float, by: float, bux: float, buy: float, bhu: float, bhv: float,
) -> bool:  # fmt: skip
    """Return whether two rectangles (centre, u-axis, half extents) overlap: no axis separates them."""
    dx, dy = bx - ax, by - ay
    cos, sin = abs(aux * bux + auy * buy), abs(aux * buy - auy * bux)
    if abs(dx * aux + dy * auy) > ahu + bhu * cos + bhv * sin:
        return False
    if abs(dy * aux - dx * auy) > ahv + bhu * sin + bhv * cos:
        return False
    if abs(dx * bux + dy * buy) > bhu + ahu * cos + ahv * sin:
        return False
    return abs(dy * bux - dx * buy) <= bhv + ahu * sin + ahv * cos


@njit(cache=True, nogil=True)
def first_at(codes: IntArray, code: int) -> int:
    """Return the index of the first of ascending codes (n,) that is not below `code`."""
    low, high = 0, len(codes)
    while low < high:
        middle = (low + high) >> 1
        if codes[middle] < code:
            low = middle + 1
        else:
            high = middle
    return low


@njit(cache=True, nogil=True)
def support(
    boxes: FloatArray, codes: IntArray, lattice: tuple[float, float, float, int], reach_m: float
) -> FloatArray:
    """Return for each box the share of the next `reach_m` along it, in both directions, where others continue it, (n,).

    Parameters
    ----------
    boxes
        (n, 8): columns `TRACK_X` to `TRACK_SIGMA_U`.
    codes
        (n,) int64, ascending: the cell of each box.
    lattice
        West edge, south edge and size of the cells [m], number of columns.
    """
    west, south, cell, n_cols = lattice
    n_bins = SUPPORT_BINS
    out = np.zeros(len(boxes))
    continued = np.zeros(n_bins, dtype=np.uint8)
    for i in range(len(boxes)):
        continued[:] = 0
        x, y, ux, uy = boxes[i, TRACK_X], boxes[i, TRACK_Y], boxes[i, TRACK_UX], boxes[i, TRACK_UY]
        row0, row1 = int((y - reach_m - south) // cell), int((y + reach_m - south) // cell)
        col0, col1 = int((x - reach_m - west) // cell), int((x + reach_m - west) // cell)
        for row in range(row0, row1 + 1):
            first = first_at(codes, row * n_cols + max(col0, 0))
            last = first_at(codes, row * n_cols + min(col1, n_cols - 1) + 1)
            for j in range(first, last):
                dx, dy = boxes[j, TRACK_X] - x, boxes[j, TRACK_Y] - y
                s, v = dx * ux + dy * uy, dy * ux - dx * uy
                if abs(s) >= reach_m:
                    continue
                turn = abs(ux * boxes[j, TRACK_UY] - uy * boxes[j, TRACK_UX])
                sigma = math.sqrt(
                    boxes[i, TRACK_SIGMA_V] ** 2
                    + boxes[j, TRACK_SIGMA_V] ** 2
                    + (boxes[i, TRACK_SIGMA_U] * s) ** 2
                )
                if (
                    abs(v) < GATE_SIGMAS * sigma + 0.5 * s * s / (3.0 * TIGHTEST_M) + SUPPORT_SLACK_M
                    and turn < SUPPORT_TURN
                ):
                    continued[int((s + reach_m) / (2.0 * reach_m) * n_bins)] = 1
        out[i] = continued.sum() / n_bins
    return out


@njit(cache=True, nogil=True)
def fit_lead(
    boxes: FloatArray, path: IntArray, sense: FloatArray, n: int, faster: float, out: FloatArray
) -> None:
    """Fit a parabola to the last of the `n` boxes of a path, to predict where the line leads.

    v = a + b s + c s^2 / 2 in the frame of the last box (s along it, v to its left), by weighted least squares over
    centres and directions. Boxes farther back weigh less, as the curvature may have changed since.

    Parameters
    ----------
    boxes
        (k, 8): columns `TRACK_X` to `TRACK_SIGMA_U`.
    path, sense
        (n or more,) int64 boxes in the order of the line; +1 where it runs along the box's u-axis, else -1.
    faster
        Change of curvature over the usual one.
    out
        (11,) input and output: columns `LEAD_A` to `LEAD_CHANGE`; its curvature is that of the prediction before.
    """
    i = path[n - 1]
    hx, hy = sense[n - 1] * boxes[i, TRACK_UX], sense[n - 1] * boxes[i, TRACK_UY]
    curvature = abs(out[LEAD_C])
    change = faster * (min(curvature, 1.0 / TIGHTEST_M) + 1.0 / STRAIGHT_RADIUS_M) / CLOTHOID_M
    aa = ab = ac = bb = bc = 0.0
    cc = (2.0 * TIGHTEST_M) ** 2 if n < FEW_BOXES else TIGHTEST_M**2
    ra = rb = rc = 0.0
    for k in range(n - 1, -1, -1):
        j = path[k]
        dx, dy = boxes[j, TRACK_X] - boxes[i, TRACK_X], boxes[j, TRACK_Y] - boxes[i, TRACK_Y]
        s, v = dx * hx + dy * hy, dy * hx - dx * hy
        along = sense[k] * (boxes[j, TRACK_UX] * hx + boxes[j, TRACK_UY] * hy)
        across = sense[k] * (boxes[j, TRACK_UY] * hx - boxes[j, TRACK_UX] * hy)
        # Farther back, or before a turn that no parabola follows
        if s < -TRACK_PAST_M or along < LEAST_ALONG:
            break
        far = max(-s - RECENT_M, 0.0)
        w = 1.0 / (
            SHARED * boxes[j, TRACK_SIGMA_V] ** 2 + (change * far * far * far / 6.0) ** 2 + LEAST_VARIANCE_M2
        )
        half = 0.5 * s * s
        aa, ab, ac = aa + w, ab + w * s, ac + w * half
        bb, bc, cc = bb + w * s * s, bc + w * s * half, cc + w * half * half
        ra, rb, rc = ra + w * v, rb + w * s * v, rc + w * half * v
        slope = across / along
        w = 1.0 / (
            SHARED * boxes[j, TRACK_SIGMA_U] ** 2 + (change * far * far / 2.0) ** 2 + LEAST_VARIANCE_M2
        )
        bb, bc, cc = bb + w, bc + w * s, cc + w * s * s
        rb, rc = rb + w * slope, rc + w * s * slope
    c00, c01, c02, c11, c12, c22 = inverse_of_three(aa, ab, ac, bb, bc, cc)
    out[LEAD_A] = c00 * ra + c01 * rb + c02 * rc
    out[LEAD_B] = c01 * ra + c11 * rb + c12 * rc
    out[LEAD_C] = c02 * ra + c12 * rb + c22 * rc
    out[LEAD_AA], out[LEAD_AB], out[LEAD_AC] = c00, c01, c02
    out[LEAD_BB], out[LEAD_BC], out[LEAD_CC] = c11, c12, c22
    out[LEAD_CHANGE] = (
        faster * (min(abs(out[LEAD_C]), 1.0 / TIGHTEST_M) + 1.0 / STRAIGHT_RADIUS_M) / CLOTHOID_M
    )


@njit(cache=True, nogil=True)
def predicted(fit: FloatArray, s: float) -> tuple[float, float, float, float]:
    """Return offset [m], slope, and their standard deviations, `s` metres ahead of the last box; `fit` (11,)."""
    half = 0.5 * s * s
    v, slope = fit[LEAD_A] + fit[LEAD_B] * s + fit[LEAD_C] * half, fit[LEAD_B] + fit[LEAD_C] * s
    var = fit[LEAD_AA] + 2.0 * s * fit[LEAD_AB] + 2.0 * half * fit[LEAD_AC]
    var = var + s * s * fit[LEAD_BB] + 2.0 * s * half * fit[LEAD_BC]
    var += half * half * fit[LEAD_CC] + (fit[LEAD_CHANGE] * s * s * s / 6.0) ** 2
    var_slope = fit[LEAD_BB] + 2.0 * s * fit[LEAD_BC] + s * s * fit[LEAD_CC] + (fit[LEAD_CHANGE] * half) ** 2
    var, var_slope = var + (fit[LEAD_JUMP] * half) ** 2, var_slope + (fit[LEAD_JUMP] * s) ** 2
    return v, slope, math.sqrt(max(var, 0.0)), math.sqrt(max(var_slope, 0.0))


@njit(cache=True, nogil=True)
def next_box(
    boxes: FloatArray,
    codes: IntArray,
    lattice: tuple[float, float, float, int],
    state: tuple[IntArray, FloatArray, IntArray, FloatArray],
    n: int,
    limits: tuple[float, float, float, bool],
    strength: FloatArray,
    fit: FloatArray,
) -> tuple[int, int]:
    """Return the box that continues the last of the `n` boxes of a path, -1 if there is none, and the stop reason.

    The last box is moved by the search length along the line (A'); boxes that collide with it and agree with the
    prediction are candidates. The search area grows longer, and with the prediction's uncertainty wider, until there
    is one; the nearest wins unless it agrees worse.

    Parameters
    ----------
    boxes, codes, lattice
        (k, 8), (k,), tuple: as for `support`.
    state
        (n or more,) path, the boxes so far; (n or more,) sense, +1 or -1 where the line runs along a box or against
        it; (k,) owner of every box; (k,) for ends of lines, +1 or -1 where the line begins along the box or against
        it.
    limits
        Longest gap [m], widest gate [m], least strength beyond a gap, whether the side matters (boundaries).
    strength
        (k,) support of each box, see `support`.
    fit
        (11,) input and output: see `fit_lead`.
    """
    west, south, cell, n_cols = lattice
    path, sense, owner, inward = state
    longest, widest, least_strength, is_sided = limits
    i = path[n - 1]
    hx, hy = sense[n - 1] * boxes[i, TRACK_UX], sense[n - 1] * boxes[i, TRACK_UY]
    tracked = math.hypot(
        boxes[i, TRACK_X] - boxes[path[0], TRACK_X], boxes[i, TRACK_Y] - boxes[path[0], TRACK_Y]
    )
    longest = min(longest, NEAR_BOX_M + GAP_PER_LENGTH * tracked)
    length, done, turns = NEAR_BOX_M, LEAST_STEP_M, 0
    while True:
        # Nearby, a second time as for a line that turns off, and for a kerb a third time as at a corner
        fit_lead(boxes, path, sense, n, TRACK_TURNS[turns], fit)
        fit[LEAD_JUMP] = CORNER if turns == 2 else 0.0
        length = min(length, longest)
        v1, slope, sigma, _ = predicted(fit, length)
        gate = min(max(GATE_SIGMAS * sigma, LEAST_GATE_M), widest)
        # Box A': from the end of the last search to the search length, about the prediction
        v0, _, _, _ = predicted(fit, done)
        mx, my = 0.5 * (done + length), 0.5 * (v0 + v1)
        ax, ay = boxes[i, TRACK_X] + mx * hx - my * hy, boxes[i, TRACK_Y] + mx * hy + my * hx
        bend = math.atan2(v1 - v0, length - done)
        aux, auy = hx * math.cos(bend) - hy * math.sin(bend), hy * math.cos(bend) + hx * math.sin(bend)
        sag = abs(fit[LEAD_C]) * (length - done) ** 2 / 8.0
        half_u, half_v = 0.5 * math.hypot(length - done, v1 - v0), gate + sag
        reach = half_u + half_v
        best, best_cost = -1, math.inf
        row0, row1 = int((ay - reach - south) // cell), int((ay + reach - south) // cell)
        col0, col1 = int((ax - reach - west) // cell), int((ax + reach - west) // cell)
        for row in range(row0, row1 + 1):
            first = first_at(codes, row * n_cols + max(col0, 0))
            last = first_at(codes, row * n_cols + min(col1, n_cols - 1) + 1)
            for j in range(first, last):
                if j == i or owner[j] == BESIDE:
                    continue
                dx, dy = boxes[j, TRACK_X] - boxes[i, TRACK_X], boxes[j, TRACK_Y] - boxes[i, TRACK_Y]
                s, v = dx * hx + dy * hy, dy * hx - dx * hy
                if s <= done or s > length:
                    continue
                if not collides_in_plan(
                    ax, ay, aux, auy, half_u, half_v,
                    boxes[j, TRACK_X], boxes[j, TRACK_Y], boxes[j, TRACK_UX], boxes[j, TRACK_UY],
                    boxes[j, TRACK_HALF_U], boxes[j, TRACK_HALF_V],
                ):  # fmt: skip
                    continue
                expected, slope, sigma, sigma_slope = predicted(fit, s)
                along, across = (
                    boxes[j, TRACK_UX] * hx + boxes[j, TRACK_UY] * hy,
                    boxes[j, TRACK_UY] * hx - boxes[j, TRACK_UX] * hy,
                )
                if is_sided and along * sense[n - 1] < 0.0:
                    continue
                if along < 0.0:
                    along, across = -along, -across
                turn = math.atan2(across, along) - math.atan(slope)
                sigma2 = sigma * sigma + SHARED * boxes[j, TRACK_SIGMA_V] ** 2
                off = abs(v - expected)
                if s > NEAR_BOX_M:
                    # Over a gap: an arc that leaves along this line and arrives along that box
                    off = abs(v - fit[LEAD_A] - 0.5 * s * (fit[LEAD_B] + across / max(along, 0.1)))
                    sigma2 = fit[LEAD_AA] + 0.25 * s * s * (
                        fit[LEAD_BB] + SHARED * boxes[j, TRACK_SIGMA_U] ** 2
                    )
                    sigma2 += (0.5 * fit[LEAD_CHANGE] * s * s * s / 6.0) ** 2 + SHARED * boxes[
                        j, TRACK_SIGMA_V
                    ] ** 2
                if off > min(GATE_SIGMAS * math.sqrt(sigma2) + GATE_SLACK_M, widest):
                    continue
                turn2 = sigma_slope * sigma_slope + SHARED * boxes[j, TRACK_SIGMA_U] ** 2
                if abs(turn) > min(GATE_SIGMAS * math.sqrt(turn2) + TURN_SLACK, MOST_BOX_TURN):
                    continue
                if s > NEAR_BOX_M and strength[j] < least_strength:
                    continue
                cost = (s - done) / (length - done) + (off * off / sigma2 + turn * turn / turn2) / 9.0
                if cost < best_cost:
                    best, best_cost = j, cost
        if best >= 0:
            if owner[best] == FREE:
                return best, NOTHING_AHEAD
            into = inward[best] * (boxes[best, TRACK_UX] * hx + boxes[best, TRACK_UY] * hy)
            if owner[best] <= LINE_END and into > LEAST_INTO:
                return best, NOTHING_AHEAD
            return -1, MEETS_LINE
        if turns < (2 if is_sided else 1) and length <= NEAR_BOX_M:
            turns += 1
            continue
        turns = 0
        if length >= longest:
            return -1, NOTHING_AHEAD
        done, length = length, 2.0 * length


@njit(cache=True, nogil=True)
def absorb(
    boxes: FloatArray,
    codes: IntArray,
    lattice: tuple[float, float, float, int],
    owner: IntArray,
    pair: tuple[int, int],
    width_m: float,
) -> None:
    """Mark the free boxes beside two boxes of a line as absorbed: they are the same feature in other cells.

    Parameters
    ----------
    boxes, codes, lattice
        (k, 8), (k,), tuple: as for `support`.
    owner
        (k,) int64, changed in place: owner of every box.
    pair, width_m
        The two boxes; largest distance from the line between them [m].
    """
    west, south, cell, n_cols = lattice
    i, j = pair
    dx, dy = boxes[j, TRACK_X] - boxes[i, TRACK_X], boxes[j, TRACK_Y] - boxes[i, TRACK_Y]
    length = math.hypot(dx, dy)
    if length == 0.0:
        return
    hx, hy = dx / length, dy / length
    x0, x1 = (
        min(boxes[i, TRACK_X], boxes[j, TRACK_X]) - width_m,
        max(boxes[i, TRACK_X], boxes[j, TRACK_X]) + width_m,
    )
    y0, y1 = (
        min(boxes[i, TRACK_Y], boxes[j, TRACK_Y]) - width_m,
        max(boxes[i, TRACK_Y], boxes[j, TRACK_Y]) + width_m,
    )
    col0, col1 = int((x0 - west) // cell), int((x1 - west) // cell)
    for row in range(int((y0 - south) // cell), int((y1 - south) // cell) + 1):
        first = first_at(codes, row * n_cols + max(col0, 0))
        last = first_at(codes, row * n_cols + min(col1, n_cols - 1) + 1)
        for k in range(first, last):
            if owner[k] != FREE:
                continue
            dx, dy = boxes[k, TRACK_X] - boxes[i, TRACK_X], boxes[k, TRACK_Y] - boxes[i, TRACK_Y]
            s, v = dx * hx + dy * hy, dy * hx - dx * hy
            if -ABSORB_BEYOND_M <= s <= length + ABSORB_BEYOND_M and abs(v) <= max(
                width_m, boxes[k, TRACK_HALF_V]
            ):
                if abs(boxes[k, TRACK_UX] * hx + boxes[k, TRACK_UY] * hy) > LEAST_PARALLEL:
                    owner[k] = BESIDE
