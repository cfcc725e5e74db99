"""The box of a barrier's or a wall's foot in one cell: a thin upright sheet that stands on the floor.

Separate from `boundary_boxes`, which tries kerb, edge and barrier in turn: this one looks for an upright face above the
floor.

Positions are in metres from the survey's local origin.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.boundaries.kerbs.steps import fit_face
from linework.kernels.boundaries.profiles import (
    AGAIN_M,
    CHORD_SLACK_M,
    CLIP_M,
    FLOOR_SOFT,
    FLOOR_WIDTH_M,
    HALF_LENGTH_M,
    LEAST_BOX_M,
    LEAST_CHORD_M,
    MOST_PLACE_POINTS,
    PLACE_R,
    PLACE_X,
    PLACE_Y,
    PLANE_EAST,
    PLANE_HEIGHT,
    PLANE_NORTH,
    UNIFORM_SIGMA,
    FloorCells,
    FloorLimits,
    LocalFloor,
    PlaceScratch,
    fit_side,
    gather_at,
)
from linework.kernels.cells.places import (
    BARRIER,
    BOX_CELL_M,
    BOX_ELSEWHERE,
    BOX_FOUND,
    BOX_HALF_U,
    BOX_NO_ROAD,
    BOX_STEP,
    BOX_UX,
    BOX_UY,
    BOX_X,
    BOX_Y,
    BOX_Z,
    COUNT,
    FORM,
    S_U,
    S_V,
    S_Z,
    SCORE,
    TOP_V,
    chord_in_cell,
    roughness_limit,
)
from linework.kernels.cells.surroundings import RISE, SLOPE_EAST, SLOPE_NORTH

#: A barrier reaches from the floor (its lowest part is hidden in noise) up to this at least; kerbs are lower. [m]
LOW_M, HIGH_M = 0.05, 0.55
#: Largest spread of a flat face; hedges are rougher. [m]
THICK_M = 0.03
#: Fewest points of a face.
FACE_POINTS = 20
#: The foot of the face must have points up to here: cars are open below their sills, barriers are not. [m]
BARRIER_FOOT_M = 0.18
#: How far before and behind the sheet the face has its points. [m]
FACE_REACH_M = 0.12
#: Distance that the floor keeps from the sheet: half of a usual scan spot on both. [m]
FOOT_GAP_M = 0.04
#: Rounds of fitting a sheet, and spreads beyond which points are left out of the next.
SHEET_ROUNDS, SHEET_SPREADS = 4, 2.5
#: Thickest sheet of points over that of a face: points of its back and of its posts are among them.
THICK_RATIO = 1.5
#: Smallest standard deviation along a sheet: 0.5 m of an even one spread by 0.14 m. [m]
LEAST_LONG_M = 0.14
#: Numbers that stand for "no limit yet". [m]
FAR_M = 1e9


@njit(cache=True, nogil=True)
def barrier_in_cell(
    data: FloorCells,
    place: tuple[float, float],
    floor: LocalFloor,
    slopes: FloatArray,
    area: tuple[int, float],
    limits: FloorLimits,
    scratch: PlaceScratch,
    box: FloatArray,
) -> int:
    """Find the foot of a barrier in the cell about `place`; write the box, return `BOX_FOUND` or why there is none.

    Arguments as for `linework.kernels.boundaries.kerbs.boxes.kerb_in_cell`, with slopes (4, 4) and box (18,).
    """
    work = scratch.work
    x, y = place
    n, scale = area
    plane = floor.plane.copy()
    east, north = slopes[RISE, SLOPE_EAST], slopes[RISE, SLOPE_NORTH]
    size = np.hypot(east, north)
    if size == 0.0:
        return BOX_NO_ROAD
    is_sheet, vx, vy, v = sheet_in(work, n, (-east / size, -north / size))
    if not is_sheet:
        return BOX_NO_ROAD
    low, high = chord_in_cell(v * vx, v * vy, vy, -vx, 0.5 * BOX_CELL_M + CHORD_SLACK_M)
    if high - low < LEAST_CHORD_M:
        return BOX_ELSEWHERE
    # Measured again about the middle of the piece in this cell
    mx, my = v * vx + 0.5 * (low + high) * vy, v * vy - 0.5 * (low + high) * vx
    plane[PLANE_HEIGHT] += plane[PLANE_EAST] * mx + plane[PLANE_NORTH] * my
    n = gather_at(
        data.points, data.starts, data.span, (x + mx, y + my), AGAIN_M * scale, plane, MOST_PLACE_POINTS, work
    )
    most = roughness_limit(floor.usual, limits.most_noise)
    half_u = HALF_LENGTH_M * scale
    a, b, c, noise, n_floor = fit_side(
        work, n, (vx, vy), (FOOT_GAP_M, FLOOR_WIDTH_M * scale, half_u), (0.0, floor.noise + 0.01), FLOOR_SOFT
    )
    if n_floor < FACE_POINTS or noise > most:
        return BOX_NO_ROAD
    lowest = max(LOW_M, 3.0 * noise)
    at, beta, lean, spread, count = fit_face(
        work, n, (vx, vy), (a, b, c), 0.0, (lowest, CLIP_M), (FACE_REACH_M, FACE_REACH_M, half_u)
    )
    if count < FACE_POINTS or spread > THICK_M:
        return BOX_NO_ROAD
    turned = np.sqrt(1.0 + beta * beta)
    vx, vy = (vx - beta * vy) / turned, (vy + beta * vx) / turned
    foot = (at + lean * 0.5 * (lowest + CLIP_M)) / turned
    stands, u_low, u_high = _stands_on_floor(work, n, (vx, vy, foot, half_u), (a, b, c), noise)
    if not stands:
        return BOX_NO_ROAD
    low, high = chord_in_cell(mx + foot * vx, my + foot * vy, vy, -vx, 0.5 * BOX_CELL_M)
    if high - low < LEAST_BOX_M:
        return BOX_ELSEWHERE
    u = 0.5 * (low + high)
    dx, dy = foot * vx + u * vy, foot * vy - u * vx
    box[BOX_X], box[BOX_Y] = x + mx + dx, y + my + dy
    box[BOX_Z] = plane[PLANE_HEIGHT] + plane[PLANE_EAST] * dx + plane[PLANE_NORTH] * dy + a + b * u + c * foot
    box[BOX_UX], box[BOX_UY] = vy, -vx
    box[BOX_HALF_U] = max(min(u_high - u, u - u_low, half_u), 0.05)
    box[S_V] = np.sqrt(2.0 * spread**2 / count + (0.1 * CLIP_M) ** 2 / count + 0.003**2)
    box[S_U] = max(spread, 0.003) / np.sqrt(count) / (UNIFORM_SIGMA * scale)
    box[S_Z] = 2.0 * noise / np.sqrt(n_floor)
    box[SCORE] = 1.0 - np.exp(-count / (4.0 * FACE_POINTS))
    box[FORM], box[BOX_STEP], box[TOP_V] = BARRIER, HIGH_M, np.nan
    box[COUNT] = count + n_floor
    return BOX_FOUND


@njit(cache=True, nogil=True)
def sheet_in(work: FloatArray, n: int, frame: tuple[float, float]) -> tuple[bool, float, float, float]:
    """Fit an upright sheet to the points above a kerb's height.

    Parameters
    ----------
    work
        (n or more, 4): points, see `linework.kernels.boundaries.profiles.gather_at`.
    frame
        Unit vector v to begin with, away from the sheet; it keeps its sense.

    Returns
    -------
    Whether there is a sheet, its unit vector v, and its v [m].
    """
    frame_x, frame_y = frame
    cut, vx, vy, v, thick = FAR_M, 0.0, 0.0, 0.0, 0.0
    for _ in range(SHEET_ROUNDS):
        m, sx, sy, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(n):
            if work[i, PLACE_R] < CLIP_M or work[i, PLACE_R] > HIGH_M:
                continue
            x, y = work[i, PLACE_X], work[i, PLACE_Y]
            if cut < FAR_M and abs(x * vx + y * vy - v) > cut:
                continue
            m += 1.0
            sx += x
            sy += y
            xx += x * x
            xy += x * y
            yy += y * y
        if m < FACE_POINTS:
            return False, 0.0, 0.0, 0.0
        mx, my = sx / m, sy / m
        xx, xy, yy = xx / m - mx * mx, xy / m - mx * my, yy / m - my * my
        # The principal axis of the smaller variance is the normal of the sheet
        half, apart = 0.5 * (xx + yy), np.sqrt(0.25 * (xx - yy) ** 2 + xy * xy)
        angle = 0.5 * np.arctan2(2.0 * xy, xx - yy) + 0.5 * np.pi
        vx, vy = np.cos(angle), np.sin(angle)
        if vx * frame_x + vy * frame_y < 0.0:
            vx, vy = -vx, -vy
        thick, long = np.sqrt(max(half - apart, 0.0)), np.sqrt(half + apart)
        v = vx * mx + vy * my
        cut = max(SHEET_SPREADS * thick, 2.0 * THICK_M)
        if long < LEAST_LONG_M:
            return False, 0.0, 0.0, 0.0
    return thick <= THICK_RATIO * THICK_M, vx, vy, v


@njit(cache=True, nogil=True)
def _stands_on_floor(
    work: FloatArray,
    n: int,
    frame: tuple[float, float, float, float],
    floor: tuple[float, float, float],
    noise: float,
) -> tuple[bool, float, float]:
    """Return whether a face reaches from the floor to above a kerb's height along most of it, and its ends along u.

    frame: unit vector v, v of the foot, half of the length. floor: height, slopes along u and v.
    """
    floor_a, floor_b, floor_c = floor
    vx, vy, foot, half_u = frame
    below, above, before = np.zeros(4), np.zeros(4), np.zeros(4)
    u_low, u_high = FAR_M, -FAR_M
    for i in range(n):
        x, y = work[i, PLACE_X], work[i, PLACE_Y]
        v, u = x * vx + y * vy, x * vy - y * vx
        if abs(u) > half_u:
            continue
        r = work[i, PLACE_R] - floor_a - floor_b * u - floor_c * v
        k = min(int((u / half_u + 1.0) * 2.0), 3)
        if v > foot + 0.05:
            before[k] += 1.0 if abs(r) <= 3.0 * noise else 0.0
        elif v > foot - 0.35:
            if r >= max(3.0 * noise, 0.03) and r <= BARRIER_FOOT_M:
                below[k] += 1.0
                u_low, u_high = min(u_low, u), max(u_high, u)
            elif r > CLIP_M:
                above[k] += 1.0
    both = np.sum((below > 0.0) & (above > 0.0) & (before > 0.0))
    return bool(both >= 3 and np.sum(below) >= 6.0), u_low, u_high
