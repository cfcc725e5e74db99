"""The box of a pavement's edge without a kerb in one cell: the edge found, measured, and checked.

Separate from `boundary_boxes`, which tries kerb, edge and barrier in turn: this one looks for a change of roughness or
brightness.

Positions are in metres from the survey's local origin.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.boundaries.kerbs.sides import EDGE_NEAR_BINS, edge_before_shadow
from linework.kernels.boundaries.pavement_edges import (
    BRIGHTER,
    BY_BOTH,
    BY_BRIGHTNESS,
    BY_ROUGHNESS,
    CLEAR_SPLIT,
    EDGE_CLEAR,
    EDGE_COLUMNS,
    EDGE_CONTRAST,
    EDGE_N_ROUGH,
    EDGE_N_SMOOTH,
    EDGE_ROUGH,
    EDGE_SIGMA,
    EDGE_SMOOTH,
    EDGE_STEP,
    EDGE_V,
    EDGE_VX,
    EDGE_VY,
    ROUGHER,
    SIDE_POINTS,
    best_split,
    sharpen_split,
)
from linework.kernels.boundaries.profiles import (
    AGAIN_M,
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
    gather_at,
)
from linework.kernels.cells.places import (
    AREA_M,
    BOX_ALL_ROAD,
    BOX_CELL_M,
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
    COUNT,
    EDGE,
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
    ROUGH,
    ROUGHEST_M,
    SLOPE_EAST,
    SLOPE_MEAN,
    SLOPE_NORTH,
    SLOPE_SHARE,
)

#: Smallest share of the variance of the fine cells that a slope explains, before their points are used.
EDGE_EXPLAINED = 0.25
#: Largest height of a verge below or above the pavement. [m]
VERGE_STEP_M = 0.15
#: Smallest roughness of gravel, soil and cut grass. [m]
VERGE_M = 0.005
#: Largest roughness of a verge over that of `linework.kernels.cells.surroundings`: a verge only just below it was
#: brought there by the road in front of a wall.
VERGE_SHARE = 0.8
#: An edge is sought as far as this beyond its cell, where it is measured again. [m]
EDGE_SLACK_M = 0.10


@njit(cache=True, nogil=True)
def differs(slopes: FloatArray, noise: float, by: int) -> bool:
    """Return whether the fine cells get rougher, or brighter, as they do next to a pavement's edge.

    slopes: (4, 4), see `linework.kernels.cells.surroundings`. by: `BY_ROUGHNESS` or `BY_BRIGHTNESS`.
    """
    row = slopes[ROUGH + by]
    # The difference of both sides of the area, if it is cut in half: a step of 1 has a slope of 0.85 / R
    least = (ROUGHER - 1.0) * noise if by == BY_ROUGHNESS else 0.5 * (BRIGHTER - 1.0) * row[SLOPE_MEAN]
    return bool(
        row[SLOPE_SHARE] >= EDGE_EXPLAINED and np.hypot(row[SLOPE_EAST], row[SLOPE_NORTH]) * AREA_M >= least
    )


@njit(cache=True, nogil=True)
def edge_in_cell(
    data: FloorCells,
    place: tuple[float, float],
    floor: LocalFloor,
    around: tuple[FloatArray, float],
    area: tuple[int, float],
    limits: FloorLimits,
    scratch: PlaceScratch,
    box: FloatArray,
) -> int:
    """Find the pavement's edge in the cell about `place`; write the box, return `BOX_FOUND` or why there is none.

    First by roughness; where that shows nothing, by brightness alone. Arguments as for
    `linework.kernels.boundaries.kerbs.boxes.kerb_in_cell`, with box (18,).
    """
    work, sums, edge = scratch
    slopes, _ = around
    x, y = place
    n, scale = area
    plane, first = floor.plane.copy(), np.zeros(EDGE_COLUMNS)
    if n < 2 * SIDE_POINTS:
        return BOX_HOLE
    by, found = BY_ROUGHNESS, False
    for k in (BY_ROUGHNESS, BY_BRIGHTNESS):
        gx, gy = slopes[ROUGH + k, SLOPE_EAST], slopes[ROUGH + k, SLOPE_NORTH]
        size = np.hypot(gx, gy)
        if not found and differs(slopes, floor.noise, k) and size > 0.0:
            by = k
            both = BY_BOTH if k == BY_ROUGHNESS else BY_BRIGHTNESS
            found = best_split(work, n, (-gx / size, -gy / size), scale, both, sums, first)
    if not found:
        return BOX_ALL_ROAD if first[EDGE_CLEAR] < CLEAR_SPLIT else BOX_ELSEWHERE
    vx, vy, v = first[EDGE_VX], first[EDGE_VY], first[EDGE_V]
    low, high = chord_in_cell(v * vx, v * vy, vy, -vx, 0.5 * BOX_CELL_M + EDGE_SLACK_M)
    if high - low < LEAST_CHORD_M:
        return BOX_ELSEWHERE
    # Measured again about the middle of the piece in this cell
    mx, my = v * vx + 0.5 * (low + high) * vy, v * vy - 0.5 * (low + high) * vx
    plane[PLANE_HEIGHT] += plane[PLANE_EAST] * mx + plane[PLANE_NORTH] * my
    n = gather_at(
        data.points, data.starts, data.span, (x + mx, y + my), AGAIN_M * scale, plane, MOST_PLACE_POINTS, work
    )
    if not sharpen_split(work, n, first, scale, BY_BOTH if by == BY_ROUGHNESS else BY_BRIGHTNESS, sums, edge):
        return BOX_ALL_ROAD
    vx, vy, v, sigma = edge_before_shadow(
        work, n, (edge[EDGE_VX], edge[EDGE_VY]), edge[EDGE_V], (scale, HALF_LENGTH_M * scale), EDGE_NEAR_BINS
    )
    sigma = sigma if sigma > 0.0 else edge[EDGE_SIGMA]
    low, high = chord_in_cell(mx + v * vx, my + v * vy, vy, -vx, 0.5 * BOX_CELL_M)
    if high - low < LEAST_BOX_M:
        return BOX_ELSEWHERE
    if not _is_edge(edge, by, roughness_limit(floor.usual, limits.most_noise)):
        return BOX_NO_ROAD
    window = (v + CLEAR_M, v + FLOOR_WIDTH_M * scale, HALF_LENGTH_M * scale)
    a, b, c, noise, count = fit_side(work, n, (vx, vy), window, (0.0, edge[EDGE_SMOOTH] + 0.01), FLOOR_SOFT)
    if count < SIDE_POINTS:
        return BOX_HOLE
    u = 0.5 * (low + high)
    dx, dy = v * vx + u * vy, v * vy - u * vx
    box[BOX_X], box[BOX_Y] = x + mx + dx, y + my + dy
    box[BOX_Z] = plane[PLANE_HEIGHT] + plane[PLANE_EAST] * dx + plane[PLANE_NORTH] * dy + a + b * u + c * v
    box[BOX_UX], box[BOX_UY] = vy, -vx
    box[BOX_HALF_U] = 0.5 * BOX_CELL_M * scale
    box[S_V], box[S_U] = sigma, sigma / (UNIFORM_SIGMA * scale)
    box[S_Z] = 2.0 * noise / np.sqrt(count)
    clear = 1.0 - np.exp(-edge[EDGE_CLEAR] / (4.0 * CLEAR_SPLIT))
    box[SCORE] = clear if by == BY_ROUGHNESS else 0.5 * clear
    box[FORM], box[BOX_STEP], box[TOP_V] = EDGE, edge[EDGE_STEP], np.nan
    box[COUNT] = edge[EDGE_N_SMOOTH] + edge[EDGE_N_ROUGH]
    return BOX_FOUND


@njit(cache=True, nogil=True)
def _is_edge(edge: FloatArray, by: int, most: float) -> bool:
    """Return whether an edge (11,) has pavement on one side and a verge on the other; `most`: roughest pavement [m]."""
    smooth, rough, contrast = edge[EDGE_SMOOTH], edge[EDGE_ROUGH], edge[EDGE_CONTRAST]
    rougher = by == BY_ROUGHNESS and rough >= ROUGHER * smooth and rough**2 - smooth**2 >= VERGE_M**2
    verge = (rougher or contrast >= BRIGHTER) and rough <= VERGE_SHARE * ROUGHEST_M
    return bool(verge and smooth <= most and abs(edge[EDGE_STEP]) <= VERGE_STEP_M)
