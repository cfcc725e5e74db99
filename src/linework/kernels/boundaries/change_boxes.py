"""The box of a change of the ground in one cell: found, measured again, and weighed against paint.

Separate from `boundary_boxes`, which tries kerb, edge, barrier and change in turn: this one adds up the evidence of
brightness, roughness and height, each too weak or too unusual for the others.

Positions are in metres from the survey's local origin.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.boundaries.ground_changes import (
    CHANGE_COLUMNS,
    CHANGE_CONTRAST,
    CHANGE_GAIN,
    CHANGE_HEIGHT,
    CHANGE_POINTS,
    CHANGE_ROUGH,
    CHANGE_SIGMA,
    CHANGE_STEP,
    CHANGE_V,
    CHANGE_VX,
    CHANGE_VY,
    LEAST_GAIN,
    best_change,
    settle_change,
)
from linework.kernels.boundaries.kerbs.sides import EDGE_NEAR_BINS, edge_before_shadow
from linework.kernels.boundaries.profiles import (
    CHORD_SLACK_M,
    CLEAR_M,
    FLOOR_SOFT,
    FLOOR_WIDTH_M,
    HALF_LENGTH_M,
    LEAST_BOX_M,
    LEAST_CHORD_M,
    MOST_PLACE_POINTS,
    PLANE_EAST,
    PLANE_HEIGHT,
    PLANE_NORTH,
    UNIFORM_SIGMA,
    FloorCells,
    FloorLimits,
    LocalFloor,
    PlaceScratch,
    fit_side,
)
from linework.kernels.boundaries.walls import gather_ground
from linework.kernels.cells.places import (
    BOX_ALL_ROAD,
    BOX_CELL_M,
    BOX_CONTRAST,
    BOX_ELSEWHERE,
    BOX_FOUND,
    BOX_HALF_U,
    BOX_HOLE,
    BOX_NO_ROAD,
    BOX_STEP,
    BOX_UX,
    BOX_UY,
    BOX_X,
    BOX_Y,
    BOX_Z,
    CHANGE,
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
from linework.kernels.cells.surroundings import (
    FIELD_BRIGHT,
    RISE,
    ROUGH,
    SLOPE_EAST,
    SLOPE_NORTH,
    SLOPE_SHARE,
)

#: Smallest share of the variance of the fine cells that a slope explains, before their points are used: a tenth is
#: explained by chance.
CHANGE_EXPLAINED = 0.25
#: Points that the search area of a change is to hold: two levels with their spreads take more than a step.
CHANGE_AREA_POINTS = 150
#: Radius about the middle of its piece in the cell within which a change is measured again: both sides whole. [m]
CHANGE_AGAIN_M = 0.85
#: Cosine of the angle over which two directions are two: half of what is turned about each.
SAME_DIRECTION = np.cos(np.deg2rad(17.0))
#: Gain over the least one by which the chance of a mistake falls to a third.
GAIN_SCALE = 8.0
#: Farther off than this the height of the ground beside a change is not that of its carriageway. [m]
FAR_SPREAD_M = 0.02


@njit(cache=True, nogil=True)
def may_change(slopes: FloatArray) -> bool:
    """Return whether brightness, roughness or height of the fine cells (4, 4) slope as they do across an edge."""
    return bool(
        slopes[ROUGH, SLOPE_SHARE] >= CHANGE_EXPLAINED
        or slopes[FIELD_BRIGHT, SLOPE_SHARE] >= CHANGE_EXPLAINED
        or slopes[RISE, SLOPE_SHARE] >= CHANGE_EXPLAINED
    )


@njit(cache=True, nogil=True)
def change_in_cell(
    data: FloorCells,
    place: tuple[float, float],
    floor: LocalFloor,
    slopes: FloatArray,
    area: tuple[int, float],
    limits: FloorLimits,
    scratch: PlaceScratch,
    box: FloatArray,
) -> int:
    """Find a change of the ground in the cell about `place`; write the box, return `BOX_FOUND` or why there is none.

    Arguments as for `linework.kernels.boundaries.kerbs.boxes.kerb_in_cell`, with slopes (4, 4) and box (18,).
    """
    work, sums = scratch.work, scratch.sums
    x, y = place
    n, scale = area
    plane = floor.plane.copy()
    first, change = np.zeros(CHANGE_COLUMNS), np.zeros(CHANGE_COLUMNS)
    tried_x, tried_y = np.zeros(3), np.zeros(3)
    for i, field in enumerate((FIELD_BRIGHT, ROUGH, RISE)):
        east, north = slopes[field, SLOPE_EAST], slopes[field, SLOPE_NORTH]
        size = np.hypot(east, north)
        if slopes[field, SLOPE_SHARE] < CHANGE_EXPLAINED or size == 0.0:
            continue
        tried_x[i], tried_y[i] = east / size, north / size
        if (
            np.max(np.abs(tried_x[:i] * tried_x[i] + tried_y[:i] * tried_y[i])) > SAME_DIRECTION
            if i
            else False
        ):
            continue
        best_change(work, n, (-east / size, -north / size), scale, False, sums, change)
        if change[CHANGE_GAIN] > first[CHANGE_GAIN]:
            first[:] = change
    if first[CHANGE_GAIN] < LEAST_GAIN:
        return BOX_ALL_ROAD
    vx, vy, v = first[CHANGE_VX], first[CHANGE_VY], first[CHANGE_V]
    low, high = chord_in_cell(v * vx, v * vy, vy, -vx, 0.5 * BOX_CELL_M + CHORD_SLACK_M)
    if high - low < LEAST_CHORD_M:
        return BOX_ELSEWHERE
    # Measured again about the middle of the piece in this cell
    mx, my = v * vx + 0.5 * (low + high) * vy, v * vy - 0.5 * (low + high) * vx
    plane[PLANE_HEIGHT] += plane[PLANE_EAST] * mx + plane[PLANE_NORTH] * my
    n = gather_ground(data, (x + mx, y + my), CHANGE_AGAIN_M * scale, plane, MOST_PLACE_POINTS, work)
    if not best_change(work, n, (vx, vy), scale, True, sums, change):
        return BOX_ALL_ROAD
    if not settle_change(work, n, scale, sums, first, change):
        return BOX_NO_ROAD
    vx, vy, v, sigma = edge_before_shadow(
        work,
        n,
        (change[CHANGE_VX], change[CHANGE_VY]),
        change[CHANGE_V],
        (scale, HALF_LENGTH_M * scale),
        EDGE_NEAR_BINS,
    )
    sigma = sigma if sigma > 0.0 else change[CHANGE_SIGMA]
    low, high = chord_in_cell(mx + v * vx, my + v * vy, vy, -vx, 0.5 * BOX_CELL_M)
    if high - low < LEAST_BOX_M:
        return BOX_ELSEWHERE
    window = (v + CLEAR_M, v + FLOOR_WIDTH_M * scale, HALF_LENGTH_M * scale)
    a, b, c, noise, count = fit_side(work, n, (vx, vy), window, (0.0, floor.noise + FAR_SPREAD_M), FLOOR_SOFT)
    if count == 0.0:
        return BOX_HOLE
    if noise > roughness_limit(floor.usual, limits.most_noise):
        return BOX_NO_ROAD
    u = 0.5 * (low + high)
    dx, dy = v * vx + u * vy, v * vy - u * vx
    box[BOX_X], box[BOX_Y] = x + mx + dx, y + my + dy
    box[BOX_Z] = plane[PLANE_HEIGHT] + plane[PLANE_EAST] * dx + plane[PLANE_NORTH] * dy + a + b * u + c * v
    box[BOX_UX], box[BOX_UY] = vy, -vx
    box[BOX_HALF_U] = 0.5 * BOX_CELL_M * scale
    box[S_V], box[S_U] = sigma, sigma / (UNIFORM_SIGMA * scale)
    box[S_Z] = 2.0 * noise / np.sqrt(count)
    box[SCORE] = 1.0 - np.exp(-change[CHANGE_GAIN] / GAIN_SCALE)
    box[FORM], box[BOX_STEP], box[TOP_V] = CHANGE, change[CHANGE_STEP], np.nan
    box[COUNT] = change[CHANGE_POINTS]
    if abs(change[CHANGE_ROUGH]) + abs(change[CHANGE_HEIGHT]) < LEAST_GAIN:
        box[BOX_CONTRAST] = change[CHANGE_CONTRAST]
    return BOX_FOUND
