"""The box of a barrier's or wall's foot in one cell: a thin upright sheet that stands on the floor.

Positions are local: from the survey's origin. [m]
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.boundaries.kerb_steps import fit_face
from linework.kernels.boundaries.profiles import CLIP_M, MOST_PLACE_POINTS, fit_side, gather_at
from linework.kernels.cells import places as at_place
from linework.kernels.cells.places import (
    BOX_CELL_M,
    BOX_ELSEWHERE,
    BOX_FOUND,
    BOX_NO_ROAD,
    chord_in_cell,
    roughness_limit,
)
from linework.kernels.cells.surroundings import RISE

#: A barrier stands from the floor (its lowest part is hidden in noise) up to this at least; kerbs are lower. [m]
LOW_M, HIGH_M = 0.05, 0.55
#: A face is flat to this; hedges are not. [m]
THICK_M = 0.03
#: Fewest points of a face.
FACE_POINTS = 20
#: The foot of the face is judged up to here: cars are open below their sills, barriers not. [m]
BARRIER_FOOT_M = 0.18


@njit(cache=True, nogil=True)
def barrier_in_cell(
    data: tuple[FloatArray, IntArray, IntArray, FloatArray, FloatArray],
    place: tuple[float, float],
    floor: tuple[FloatArray, float, float, float, float],
    slopes: FloatArray,
    area: tuple[int, float],
    limits: FloatArray,
    rooms: tuple[FloatArray, FloatArray, FloatArray],
    box: FloatArray,
) -> int:
    """Find the foot of a barrier in the cell about `place`; write the box, return FOUND or why there is none.

    Arguments as for a kerb.
    """
    points, starts, span, _, _ = data
    work = rooms[0]
    x, y = place
    plane, sheet = floor[0].copy(), np.zeros(3)
    size = np.hypot(slopes[RISE, 0], slopes[RISE, 1])
    if size == 0.0 or not sheet_in(work, area[0], (-slopes[RISE, 0] / size, -slopes[RISE, 1] / size), sheet):
        return BOX_NO_ROAD
    vx, vy, v = sheet
    low, high = chord_in_cell(v * vx, v * vy, vy, -vx, 0.5 * BOX_CELL_M + 0.05)
    if high - low < 0.1:
        return BOX_ELSEWHERE
    # Once more about the middle of the piece in this cell
    mx, my = v * vx + 0.5 * (low + high) * vy, v * vy - 0.5 * (low + high) * vx
    plane[0] += plane[1] * mx + plane[2] * my
    scale = area[1]
    n = gather_at(points, starts, span, (x + mx, y + my), 0.80 * scale, plane, MOST_PLACE_POINTS, work)
    most = roughness_limit(floor[4], limits)
    a, b, c, noise, n_floor = fit_side(
        work, n, (vx, vy), (0.04, 0.6 * scale, 0.5 * scale), (0.0, floor[1] + 0.01), (0.04, 0.04)
    )
    if n_floor < FACE_POINTS or noise > most:
        return BOX_NO_ROAD
    about, reach = np.array([a, b, c, 0.0]), np.array([0.12, 0.12, 0.5 * scale])
    band = (max(LOW_M, 3.0 * noise), CLIP_M)
    at, beta, lean, spread, count = fit_face(work, n, (vx, vy), about, band, reach)
    if count < FACE_POINTS or spread > THICK_M:
        return BOX_NO_ROAD
    turned = np.sqrt(1.0 + beta * beta)
    vx, vy = (vx - beta * vy) / turned, (vy + beta * vx) / turned
    foot = (at + lean * 0.5 * (band[0] + band[1])) / turned
    u_low, u_high = np.zeros(1), np.zeros(1)
    if not _stands_on_floor(work, n, (vx, vy, foot, 0.5 * scale), (a, b, c), noise, u_low, u_high):
        return BOX_NO_ROAD
    low, high = chord_in_cell(mx + foot * vx, my + foot * vy, vy, -vx, 0.5 * BOX_CELL_M)
    if high - low < 0.05:
        return BOX_ELSEWHERE
    u = 0.5 * (low + high)
    dx, dy = foot * vx + u * vy, foot * vy - u * vx
    box[at_place.BOX_X], box[at_place.BOX_Y] = x + mx + dx, y + my + dy
    box[at_place.BOX_Z] = plane[0] + plane[1] * dx + plane[2] * dy + a + b * u + c * foot
    box[at_place.BOX_UX], box[at_place.BOX_UY] = vy, -vx
    box[at_place.BOX_HALF_U] = max(min(u_high[0] - u, u - u_low[0], 0.5 * scale), 0.05)
    box[at_place.S_V] = np.sqrt(2.0 * spread**2 / count + (0.1 * band[1]) ** 2 / count + 0.003**2)
    box[at_place.S_U] = max(spread, 0.003) / np.sqrt(count) / (0.29 * scale)
    box[at_place.S_Z] = 2.0 * noise / np.sqrt(n_floor)
    box[at_place.SCORE] = 1.0 - np.exp(-count / (4.0 * FACE_POINTS))
    box[at_place.FORM], box[at_place.BOX_STEP], box[at_place.TOP_V] = at_place.BARRIER, HIGH_M, np.nan
    box[at_place.COUNT] = count + n_floor
    return BOX_FOUND


@njit(cache=True, nogil=True)
def sheet_in(work: FloatArray, n: int, frame: tuple[float, float], out: FloatArray) -> bool:
    """Fit an upright sheet to the points above kerbs' height: v-axis and v; False when they make none.

    frame: v-axis to begin with, away from the sheet; it keeps its sense.
    """
    cut = 1e9
    for _ in range(4):
        m, sx, sy, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(n):
            if work[i, 2] < CLIP_M or work[i, 2] > HIGH_M:
                continue
            x, y = work[i, 0], work[i, 1]
            if cut < 1e8 and abs(x * out[0] + y * out[1] - out[2]) > cut:
                continue
            m += 1.0
            sx += x
            sy += y
            xx += x * x
            xy += x * y
            yy += y * y
        if m < FACE_POINTS:
            return False
        mx, my = sx / m, sy / m
        xx, xy, yy = xx / m - mx * mx, xy / m - mx * my, yy / m - my * my
        # The smaller principal axis is the sheet's normal
        half, apart = 0.5 * (xx + yy), np.sqrt(0.25 * (xx - yy) ** 2 + xy * xy)
        angle = 0.5 * np.arctan2(2.0 * xy, xx - yy) + 0.5 * np.pi
        vx, vy = np.cos(angle), np.sin(angle)
        if vx * frame[0] + vy * frame[1] < 0.0:
            vx, vy = -vx, -vy
        thick, long = np.sqrt(max(half - apart, 0.0)), np.sqrt(half + apart)
        out[0], out[1], out[2] = vx, vy, vx * mx + vy * my
        cut = max(2.5 * thick, 2.0 * THICK_M)
        # 0.5 m of an even sheet spread by 0.14 m
        if long < 0.14:
            return False
    return bool(thick <= 1.5 * THICK_M)


@njit(cache=True, nogil=True)
def _stands_on_floor(
    work: FloatArray,
    n: int,
    frame: tuple[float, float, float, float],
    floor: tuple[float, float, float],
    noise: float,
    u_low: FloatArray,
    u_high: FloatArray,
) -> bool:
    """Return whether the face goes down to the floor and up past kerbs, all along, with the floor before it.

    frame: v-axis, foot, half of the length. u_low, u_high: where face and floor both end.
    """
    vx, vy, foot, half_u = frame
    below, above, before = np.zeros(4), np.zeros(4), np.zeros(4)
    u_low[0], u_high[0] = 1e9, -1e9
    for i in range(n):
        x, y = work[i, 0], work[i, 1]
        v, u = x * vx + y * vy, x * vy - y * vx
        if abs(u) > half_u:
            continue
        r = work[i, 2] - floor[0] - floor[1] * u - floor[2] * v
        k = min(int((u / half_u + 1.0) * 2.0), 3)
        if v > foot + 0.05:
            before[k] += 1.0 if abs(r) <= 3.0 * noise else 0.0
        elif v > foot - 0.35:
            if r >= max(3.0 * noise, 0.03) and r <= BARRIER_FOOT_M:
                below[k] += 1.0
                u_low[0], u_high[0] = min(u_low[0], u), max(u_high[0], u)
            elif r > CLIP_M:
                above[k] += 1.0
    both = np.sum((below > 0.0) & (above > 0.0) & (before > 0.0))
    return bool(both >= 3 and np.sum(below) >= 6.0)
