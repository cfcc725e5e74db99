"""Boxes followed along a line: the next box that collides with where the last ones lead.

Boxes lie sorted by the cells of a north-up lattice: `codes` is row * n_cols + col, ascending.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray

# Separating axis test of two rectangles in plan


@njit(cache=True, nogil=True)
def collides_in_plan(
    ax: float, ay: float, aux: float, auy: float, ahu: float, ahv: float,
    bx: float, by: float, bux: float, buy: float, bhu: float, bhv: float,
) -> bool:  # fmt: skip
    """Return whether two rectangles (centre, u-axis, half extents) share a place: no axis parts them."""
    dx, dy = bx - ax, by - ay
    cos, sin = abs(aux * bux + auy * buy), abs(aux * buy - auy * bux)
    if abs(dx * aux + dy * auy) > ahu + bhu * cos + bhv * sin:
        return False
    if abs(dy * aux - dx * auy) > ahv + bhu * sin + bhv * cos:
        return False
    if abs(dx * bux + dy * buy) > bhu + ahu * cos + ahv * sin:
        return False
    return abs(dy * bux - dx * buy) <= bhv + ahu * sin + ahv * cos


#: Columns of a table of boxes.
TRACK_X, TRACK_Y, TRACK_UX, TRACK_UY, TRACK_HALF_U, TRACK_HALF_V, TRACK_SIGMA_V, TRACK_SIGMA_U = range(8)

#: Why a line stops.
NOTHING_AHEAD, MEETS_LINE, JOINS_END = range(3)

#: Who a box belongs to: a line's number, or nobody, or nobody any more (beside a line), or from END downwards an
#: end of a line: END - 2 line - side.
FREE, BESIDE, LINE_END = -1, -2, -10
#: A line can be joined at its last boxes, this many.
N_END = 2

#: Search areas overlap: neighbouring boxes share about half of their points, and so their errors.
SHARED = 2.0
#: Longest piece of the past that says where a line leads. [m]
TRACK_PAST_M = 20.0
#: A parabola is a bend as far as 45 degrees: cosine.
LEAST_ALONG = 0.7
#: The last boxes always count in full: fewer do not show a curvature. [m]
RECENT_M = 2.0
#: Roads change their curvature over lengths of about this (clothoids), [m] and never less than by that of a
#: bend of this radius. [m]
CLOTHOID_M, STRAIGHT_RADIUS_M = 20.0, 200.0
#: Boxes stand half a metre apart: the next one is near by. Nearer than the least step it is the same place. [m]
NEAR_BOX_M, LEAST_STEP_M = 1.2, 0.02
#: A direction carries over gaps of no more than this many times the length it was taken from: dashes of 3 m
#: with 9 m between them are the least of paint in use.
GAP_PER_LENGTH = 4.0
#: How much faster than mostly the curvature changes: where a bend begins without a clothoid, and at corners.
TRACK_TURNS = (1.0, 4.0, 4.0)
#: At corners kerbs turn into arcs without a clothoid: standard deviation of the jump of the curvature. [1/m]
CORNER = 1.0 / 6.0
#: The tightest line that is looked for: a kerb's corner. [m]
TIGHTEST_M = 3.0


@njit(cache=True, nogil=True)
def first_at(codes: IntArray, code: int) -> int:
    """Return the first place in ascending `codes` that is not below `code`."""
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
    """Return for each box the share of the next `reach_m` along it, both ways, where others continue it.

    lattice: west, south edge and size of the cells, number of columns.
    """
    west, south, cell, n_cols = lattice
    n_bins = 16
    out = np.zeros(len(boxes))
    seen = np.zeros(n_bins, dtype=np.uint8)
    for i in range(len(boxes)):
        seen[:] = 0
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
                if abs(v) < 3.0 * sigma + 0.5 * s * s / (3.0 * TIGHTEST_M) + 0.02 and turn < 0.35:
                    seen[int((s + reach_m) / (2.0 * reach_m) * n_bins)] = 1
        out[i] = seen.sum() / n_bins
    return out


@njit(cache=True, nogil=True)
def fit_lead(
    boxes: FloatArray, path: IntArray, way: FloatArray, n: int, faster: float, out: FloatArray
) -> None:
    """Fit where the last of the `n` boxes of `path` lead.

    A parabola v = a + b s + c s^2 / 2 in the frame of the last box (s along it, v to its left), by weighted
    least squares over centres and directions; boxes farther back weigh less, as the curvature may have
    changed since, `faster` times as fast as it mostly does. `out`: a, b, c, their covariance (6, upper triangle),
    the change of curvature [1/m^2], and the standard deviation of a jump of it [1/m].
    """
    i = path[n - 1]
    hx, hy = way[n - 1] * boxes[i, TRACK_UX], way[n - 1] * boxes[i, TRACK_UY]
    curvature = abs(out[2])
    change = faster * (min(curvature, 1.0 / TIGHTEST_M) + 1.0 / STRAIGHT_RADIUS_M) / CLOTHOID_M
    aa = ab = ac = bb = bc = 0.0
    cc = (2.0 * TIGHTEST_M) ** 2 if n < 4 else TIGHTEST_M**2
    ra = rb = rc = 0.0
    for k in range(n - 1, -1, -1):
        j = path[k]
        dx, dy = boxes[j, TRACK_X] - boxes[i, TRACK_X], boxes[j, TRACK_Y] - boxes[i, TRACK_Y]
        s, v = dx * hx + dy * hy, dy * hx - dx * hy
        along = way[k] * (boxes[j, TRACK_UX] * hx + boxes[j, TRACK_UY] * hy)
        across = way[k] * (boxes[j, TRACK_UY] * hx - boxes[j, TRACK_UX] * hy)
        # Farther back, or before a turn that no parabola follows
        if s < -TRACK_PAST_M or along < LEAST_ALONG:
            break
        far = max(-s - RECENT_M, 0.0)
        w = 1.0 / (SHARED * boxes[j, TRACK_SIGMA_V] ** 2 + (change * far * far * far / 6.0) ** 2 + 1e-6)
        half = 0.5 * s * s
        aa, ab, ac = aa + w, ab + w * s, ac + w * half
        bb, bc, cc = bb + w * s * s, bc + w * s * half, cc + w * half * half
        ra, rb, rc = ra + w * v, rb + w * s * v, rc + w * half * v
        slope = across / along
        w = 1.0 / (SHARED * boxes[j, TRACK_SIGMA_U] ** 2 + (change * far * far / 2.0) ** 2 + 1e-6)
        bb, bc, cc = bb + w, bc + w * s, cc + w * s * s
        rb, rc = rb + w * slope, rc + w * s * slope
    # Inverse of the symmetric 3 x 3 normal matrix by cofactors
    c00, c01, c02 = bb * cc - bc * bc, ac * bc - ab * cc, ab * bc - ac * bb
    c11, c12, c22 = aa * cc - ac * ac, ab * ac - aa * bc, aa * bb - ab * ab
    det = aa * c00 + ab * c01 + ac * c02
    c00, c01, c02, c11, c12, c22 = c00 / det, c01 / det, c02 / det, c11 / det, c12 / det, c22 / det
    out[0] = c00 * ra + c01 * rb + c02 * rc
    out[1] = c01 * ra + c11 * rb + c12 * rc
    out[2] = c02 * ra + c12 * rb + c22 * rc
    out[3], out[4], out[5], out[6], out[7], out[8] = c00, c01, c02, c11, c12, c22
    out[9] = faster * (min(abs(out[2]), 1.0 / TIGHTEST_M) + 1.0 / STRAIGHT_RADIUS_M) / CLOTHOID_M


@njit(cache=True, nogil=True)
def predicted(fit: FloatArray, s: float) -> tuple[float, float, float, float]:
    """Return offset, slope, and their standard deviations, `s` metres ahead of the last box."""
    half = 0.5 * s * s
    v, slope = fit[0] + fit[1] * s + fit[2] * half, fit[1] + fit[2] * s
    var = fit[3] + 2.0 * s * fit[4] + 2.0 * half * fit[5] + s * s * fit[6] + 2.0 * s * half * fit[7]
    var += half * half * fit[8] + (fit[9] * s * s * s / 6.0) ** 2
    var_slope = fit[6] + 2.0 * s * fit[7] + s * s * fit[8] + (fit[9] * half) ** 2
    var, var_slope = var + (fit[10] * half) ** 2, var_slope + (fit[10] * s) ** 2
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
    """Return the box that goes on from the last of the `n` boxes of a path, and the stop reason if there is none.

    The last box is moved by the search length along the line (A'); boxes that collide with it and that the
    prediction explains are candidates. The search grows longer, and with the prediction's uncertainty wider,
    until one is found; the nearest wins unless it fits worse.

    state: path (boxes so far), way (+1, -1: box along or against the line), owner of every box, and for ends of
    lines which way into the line is (+1, -1: along or against the box).
    limits: longest gap [m], widest gate [m], least strength beyond a gap, sides matter (boundaries).
    """
    west, south, cell, n_cols = lattice
    path, way, owner, inward = state
    longest, widest, least_strength, is_sided = limits
    i = path[n - 1]
    hx, hy = way[n - 1] * boxes[i, TRACK_UX], way[n - 1] * boxes[i, TRACK_UY]
    tracked = math.hypot(
        boxes[i, TRACK_X] - boxes[path[0], TRACK_X], boxes[i, TRACK_Y] - boxes[path[0], TRACK_Y]
    )
    longest = min(longest, NEAR_BOX_M + GAP_PER_LENGTH * tracked)
    length, done, turns = NEAR_BOX_M, LEAST_STEP_M, 0
    while True:
        # Near by a second time as for a line that turns off; a kerb a third time as at a corner
        fit_lead(boxes, path, way, n, TRACK_TURNS[turns], fit)
        fit[10] = CORNER if turns == 2 else 0.0
        length = min(length, longest)
        v1, slope, sigma, _ = predicted(fit, length)
        gate = min(max(3.0 * sigma, 0.03), widest)
        # Box A': from where was searched already to the search length, about the prediction
        v0, _, _, _ = predicted(fit, done)
        mx, my = 0.5 * (done + length), 0.5 * (v0 + v1)
        ax, ay = boxes[i, TRACK_X] + mx * hx - my * hy, boxes[i, TRACK_Y] + mx * hy + my * hx
        bend = math.atan2(v1 - v0, length - done)
        aux, auy = hx * math.cos(bend) - hy * math.sin(bend), hy * math.cos(bend) + hx * math.sin(bend)
        sag = abs(fit[2]) * (length - done) ** 2 / 8.0
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
                    boxes[j, TRACK_X], boxes[j, TRACK_Y], boxes[j, TRACK_UX], boxes[j, TRACK_UY], boxes[j, TRACK_HALF_U], boxes[j, TRACK_HALF_V],
                ):  # fmt: skip
                    continue
                expected, slope, sigma, sigma_slope = predicted(fit, s)
                along, across = (
                    boxes[j, TRACK_UX] * hx + boxes[j, TRACK_UY] * hy,
                    boxes[j, TRACK_UY] * hx - boxes[j, TRACK_UX] * hy,
                )
                if is_sided and along * way[n - 1] < 0.0:
                    continue
                if along < 0.0:
                    along, across = -along, -across
                turn = math.atan2(across, along) - math.atan(slope)
                sigma2 = sigma * sigma + SHARED * boxes[j, TRACK_SIGMA_V] ** 2
                off = abs(v - expected)
                if s > NEAR_BOX_M:
                    # Over a gap: an arc that leaves as this line does and arrives as that box lies
                    off = abs(v - fit[0] - 0.5 * s * (fit[1] + across / max(along, 0.1)))
                    sigma2 = fit[3] + 0.25 * s * s * (fit[6] + SHARED * boxes[j, TRACK_SIGMA_U] ** 2)
                    sigma2 += (0.5 * fit[9] * s * s * s / 6.0) ** 2 + SHARED * boxes[j, TRACK_SIGMA_V] ** 2
                if off > min(3.0 * math.sqrt(sigma2) + 0.01, widest):
                    continue
                turn2 = sigma_slope * sigma_slope + SHARED * boxes[j, TRACK_SIGMA_U] ** 2
                if abs(turn) > min(3.0 * math.sqrt(turn2) + 0.05, 0.6):
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
            if owner[best] <= LINE_END and into > 0.5:
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
    boxes: FloatArray, codes: IntArray, lattice: tuple[float, float, float, int], owner: IntArray, pair: tuple[int, int],
    width_m: float,
) -> None:  # fmt: skip
    """Take out the boxes beside the stretch between two boxes of a line: the same thing, seen from other cells."""
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
            if -0.1 <= s <= length + 0.1 and abs(v) <= max(width_m, boxes[k, TRACK_HALF_V]):
                if abs(boxes[k, TRACK_UX] * hx + boxes[k, TRACK_UY] * hy) > 0.85:
                    owner[k] = BESIDE
