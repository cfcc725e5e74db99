"""The box of an unkerbed pavement edge in one cell: found, measured, and judged.

Positions are local: from the survey's origin. [m]
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels import pavement_edges as pe
from linework.kernels import places as at_place
from linework.kernels.places import (
    ALL_ROAD,
    AREA_M,
    CELL_M,
    ELSEWHERE,
    FOUND,
    HOLE,
    NO_ROAD,
    chord_in_cell,
    roughest,
)
from linework.kernels.profiles import MOST_POINTS, fit_side, gather_at
from linework.kernels.surroundings import ROUGH, ROUGHEST_M

#: Share of the fine cells' differences that a slope must explain before their points are looked at.
EXPLAINED = 0.25
#: A verge lies this far below or above the pavement at most. [m]
STEP_M = 0.15
#: Gravel, soil and cut grass are rough by this at least. [m]
VERGE_M = 0.005


@njit(cache=True, nogil=True)
def differs(slopes: FloatArray, noise: float, by: int) -> bool:
    """Return whether the fine cells get rougher (by = 0) or brighter (by = 1) as next to a pavement's edge."""
    row = slopes[ROUGH + by]
    # By how much both sides of the area differ, if it is cut in half: 0.85 / R is the slope of a step of 1
    least = (pe.ROUGHER - 1.0) * noise if by == 0 else 0.5 * (pe.BRIGHTER - 1.0) * row[3]
    return bool(row[2] >= EXPLAINED and np.hypot(row[0], row[1]) * AREA_M >= least)


@njit(cache=True, nogil=True)
def edge_in_cell(
    data: tuple[FloatArray, IntArray, IntArray, FloatArray, FloatArray],
    place: tuple[float, float],
    floor: tuple[FloatArray, float, float, float, float],
    around: tuple[FloatArray, float],
    area: tuple[int, float],
    limits: FloatArray,
    rooms: tuple[FloatArray, FloatArray, FloatArray],
    box: FloatArray,
) -> int:
    """Find where the pavement ends in the cell about `place`; write the box, return FOUND or why there is none.

    Arguments as for a kerb. First by roughness; where that tells nothing, by brightness alone.
    """
    points, starts, span, _, _ = data
    work, sums, edge = rooms
    x, y = place
    n, scale = area
    plane, first = floor[0].copy(), np.zeros(pe.EDGE_COLUMNS)
    if n < 2 * pe.SIDE_POINTS:
        return HOLE
    by, found = 0, False
    for k in range(2):
        gx, gy = around[0][ROUGH + k, 0], around[0][ROUGH + k, 1]
        size = np.hypot(gx, gy)
        if not found and differs(around[0], floor[1], k) and size > 0.0:
            by = k
            found = pe.best_split(work, n, (-gx / size, -gy / size), scale, 2 - k, sums, first)
    if not found:
        return ALL_ROAD if first[2] < pe.CLEAR else ELSEWHERE
    vx, vy, v = first[0], first[1], first[3]
    low, high = chord_in_cell(v * vx, v * vy, vy, -vx, 0.5 * CELL_M + 0.10)
    if high - low < 0.1:
        return ELSEWHERE
    # Once more about the middle of the piece in this cell
    mx, my = v * vx + 0.5 * (low + high) * vy, v * vy - 0.5 * (low + high) * vx
    plane[0] += plane[1] * mx + plane[2] * my
    n = gather_at(points, starts, span, (x + mx, y + my), 0.80 * scale, plane, MOST_POINTS, work)
    if not pe.sharpen_split(work, n, first, scale, 2 if by == 0 else 1, sums, edge):
        return ALL_ROAD
    vx, vy, v = edge[0], edge[1], edge[3]
    low, high = chord_in_cell(mx + v * vx, my + v * vy, vy, -vx, 0.5 * CELL_M)
    if high - low < 0.05:
        return ELSEWHERE
    if not _is_edge(edge, by, roughest(floor[4], limits)):
        return NO_ROAD
    a, b, c, noise, count = fit_side(
        work, n, (vx, vy), (v + 0.02, v + 0.60 * scale, 0.5 * scale), (0.0, edge[4] + 0.01), (0.04, 0.04)
    )
    if count < pe.SIDE_POINTS:
        return HOLE
    u = 0.5 * (low + high)
    dx, dy = v * vx + u * vy, v * vy - u * vx
    box[at_place.X], box[at_place.Y] = x + mx + dx, y + my + dy
    box[at_place.Z] = plane[0] + plane[1] * dx + plane[2] * dy + a + b * u + c * v
    box[at_place.UX], box[at_place.UY] = vy, -vx
    box[at_place.HALF_U] = 0.5 * CELL_M * scale
    box[at_place.S_V], box[at_place.S_U] = edge[10], edge[10] / (0.29 * scale)
    box[at_place.S_Z] = 2.0 * noise / np.sqrt(count)
    box[at_place.SCORE] = (
        1.0 - np.exp(-edge[2] / (4.0 * pe.CLEAR))
        if by == 0
        else 0.5 * (1.0 - np.exp(-edge[2] / (4.0 * pe.CLEAR)))
    )
    box[at_place.FORM], box[at_place.STEP], box[at_place.TOP_V] = at_place.EDGE, edge[6], np.nan
    box[at_place.COUNT] = edge[8] + edge[9]
    return FOUND


@njit(cache=True, nogil=True)
def _is_edge(edge: FloatArray, by: int, most: float) -> bool:
    """Return whether pavement lies on one side and a verge on the other."""
    smooth, rough, contrast = edge[4], edge[5], edge[7]
    rougher = by == 0 and rough >= pe.ROUGHER * smooth and rough**2 - smooth**2 >= VERGE_M**2
    # What is only just no wall was made so by the road before it
    verge = (rougher or contrast >= pe.BRIGHTER) and rough <= 0.8 * ROUGHEST_M
    return bool(verge and smooth <= most and abs(edge[6]) <= STEP_M)
