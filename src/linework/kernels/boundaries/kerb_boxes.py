"""A kerb's box in one cell: found, measured, and judged.

Positions are local: from the survey's origin. [m]
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.boundaries import kerb_steps as ks
from linework.kernels.boundaries.kerb_steps import CLEAR_STEP, best_step
from linework.kernels.boundaries.profiles import CLIP_M, MOST_PLACE_POINTS, gather_at
from linework.kernels.cells import places as at_place
from linework.kernels.cells.places import (
    AREA_M,
    BOX_ALL_ROAD,
    BOX_CELL_M,
    BOX_ELSEWHERE,
    BOX_FOUND,
    BOX_NO_ROAD,
    chord_in_cell,
    roughness_limit,
)
from linework.kernels.cells.surroundings import CHANNEL_HEIGHT, RISE

#: A kerb is higher than this many times the noise of its floor: grass is not.
LEAST_CLEAR_KERB = 1.5
#: Grass and soil are rougher than stone by this. [m]
GRASS_M = 0.008
#: Share of the cells' heights that a slope explains: three quarters across a step in the middle, a third of that
#: off the middle and in noise, a tenth by chance.
KERB_EXPLAINED = 0.25


@njit(cache=True, nogil=True)
def may_be_kerb(
    floor: tuple[FloatArray, float, float, float, float], around: tuple[FloatArray, float], limits: FloatArray
) -> bool:
    """Return whether the fine cells around a place rise as next to a kerb."""
    slopes, rise = around
    size = np.hypot(slopes[CHANNEL_HEIGHT, 0], slopes[CHANNEL_HEIGHT, 1])
    # Across a disc of radius R that a step h cuts in half the slope is 0.85 h / R; half of it off its middle
    least = 0.5 * max(limits[0], LEAST_CLEAR_KERB * floor[1])
    steady = size * AREA_M >= 0.8 * least and slopes[CHANNEL_HEIGHT, 2] >= KERB_EXPLAINED
    return bool(rise >= least and (rise >= CLIP_M or steady))


@njit(cache=True, nogil=True)
def kerb_in_cell(
    data: tuple[FloatArray, IntArray, IntArray, FloatArray, FloatArray],
    place: tuple[float, float],
    floor: tuple[FloatArray, float, float, float, float],
    around: tuple[FloatArray, float],
    area: tuple[int, float],
    limits: FloatArray,
    rooms: tuple[FloatArray, FloatArray, FloatArray],
    box: FloatArray,
) -> int:
    """Find the foot of a kerb in the cell about `place`; write the box, return FOUND or why there is none.

    data: points, starts, span, sums, facets. floor: plane, its noise, the road's slopes, noise of the smoothest
    floor around. around: slopes about the place, and rise. area: number of points in `work`, and scale.
    limits: see `_is_kerb`. rooms: work, sums of a profile, step: overwritten.
    """
    points, starts, span, _, _ = data
    work, sums, step = rooms
    x, y = place
    n, scale = area
    share, first, plane = np.zeros(5), np.zeros(7), floor[0].copy()
    found = False
    for k in (CHANNEL_HEIGHT, RISE):
        # Next to a car, a hedge or a wall the heights' slope is not the kerb's
        size = np.hypot(around[0][k, 0], around[0][k, 1])
        if not found and size > 0.0:
            found = best_step(work, n, (-around[0][k, 0] / size, -around[0][k, 1] / size), scale, sums, first)
    if around[1] >= 0.5 * CLIP_M:
        for k in range(8):
            if not found:
                turn = 0.25 * np.pi * k
                found = best_step(work, n, (np.cos(turn), np.sin(turn)), scale, sums, first)
    if not found:
        return BOX_ALL_ROAD if first[2] < CLEAR_STEP else BOX_ELSEWHERE
    if first[5] - first[4] < 0.7 * limits[0]:
        return BOX_ALL_ROAD
    vx, vy, v = first[0], first[1], first[3]
    low, high = chord_in_cell(v * vx, v * vy, vy, -vx, 0.5 * BOX_CELL_M + 0.05)
    if high - low < 0.1:
        return BOX_ELSEWHERE
    # Once more about the middle of the piece in this cell
    mx, my = v * vx + 0.5 * (low + high) * vy, v * vy - 0.5 * (low + high) * vx
    plane[0] += plane[1] * mx + plane[2] * my
    n = gather_at(points, starts, span, (x + mx, y + my), 0.80 * scale, plane, MOST_PLACE_POINTS, work)
    if not ks.measure_step(work, n, first, scale, step):
        return BOX_ALL_ROAD
    ks.filled_shares(work, n, step, scale, share)
    vx, vy, foot = step[ks.VX], step[ks.VY], step[ks.FOOT]
    low, high = chord_in_cell(mx + foot * vx, my + foot * vy, vy, -vx, 0.5 * BOX_CELL_M)
    if high - low < 0.05:
        return BOX_ELSEWHERE
    if not _is_kerb(step, share, floor, limits):
        return BOX_NO_ROAD
    u = 0.5 * (low + high)
    dx, dy = foot * vx + u * vy, foot * vy - u * vx
    box[at_place.BOX_X], box[at_place.BOX_Y] = x + mx + dx, y + my + dy
    box[at_place.BOX_Z] = plane[0] + plane[1] * dx + plane[2] * dy + step[ks.FLOOR_A]
    box[at_place.BOX_Z] += step[ks.FLOOR_B] * u + step[ks.FLOOR_C] * foot
    box[at_place.BOX_UX], box[at_place.BOX_UY] = vy, -vx
    box[at_place.BOX_HALF_U] = max(min(share[3] - u, u - share[2], 0.5 * scale), 0.05)
    _write_step(step, share, box)
    return BOX_FOUND


@njit(cache=True, nogil=True)
def _write_step(step: FloatArray, share: FloatArray, box: FloatArray) -> None:
    box[at_place.S_V], box[at_place.S_U] = step[ks.STEP_SIGMA_V], step[ks.STEP_SIGMA_U]
    box[at_place.S_Z] = 2.0 * step[ks.NOISE] / np.sqrt(step[ks.N_FLOOR])
    box[at_place.SCORE] = _score(step, share)
    box[at_place.FORM], box[at_place.BOX_STEP] = at_place.KERB, step[ks.STEP_HEIGHT]
    box[at_place.TOP_V] = step[ks.TOP] - step[ks.FOOT]
    box[at_place.COUNT] = step[ks.N_FLOOR] + step[ks.N_TOP] + step[ks.N_FACE]


@njit(cache=True, nogil=True)
def _is_kerb(
    step: FloatArray,
    share: FloatArray,
    floor: tuple[FloatArray, float, float, float, float],
    limits: FloatArray,
) -> bool:
    """Return whether floor and top are what a kerb lies between.

    limits: least step, steepest floor against the road, highest step, noise of the roughest floor, and whether
    it is the vertical, not the road, that floors are measured against.
    """
    plane = floor[0]
    h, vx, vy = step[ks.STEP_HEIGHT], step[ks.VX], step[ks.VY]
    tilt_x = plane[1] + step[ks.FLOOR_C] * vx + step[ks.FLOOR_B] * vy - floor[2]
    tilt_y = plane[2] + step[ks.FLOOR_C] * vy - step[ks.FLOOR_B] * vx - floor[3]
    # The road's slope is known from cells on both sides, 3 m apart, and holds part of the step
    level = np.hypot(tilt_x, tilt_y) <= limits[1] + h / 3.0
    # A verge's grass is as high as it is rough; behind a kerb it may be, if the kerb stands out of it
    grass = step[ks.NOISE_TOP] ** 2 - step[ks.NOISE] ** 2 > GRASS_M**2
    least = max(
        LEAST_CLEAR_KERB * step[ks.NOISE],
        (4.0 if grass else 2.0) * step[ks.NOISE_TOP],
        4.0 * step[ks.SIGMA_H],
    )
    high = limits[0] <= h <= limits[2] and h >= least
    # The pavement may lie over its verge: that is no kerb of the verge
    verge = step[ks.NOISE] ** 2 - step[ks.NOISE_TOP] ** 2 > GRASS_M**2
    smooth = (
        not verge
        and step[ks.NOISE] <= roughness_limit(floor[4], limits)
        and step[ks.NOISE_TOP] <= max(limits[3], 0.35 * h)
    )
    top = abs(step[ks.TOP_C] - step[ks.FLOOR_C]) <= 0.25
    seen = share[0] >= 0.6 and share[1] >= 0.5 and share[3] - share[2] > 0.15 and share[4] >= 0.25
    return bool(level and high and smooth and top and seen)


@njit(cache=True, nogil=True)
def _score(step: FloatArray, share: FloatArray) -> float:
    """Return how sure a kerb is: how far its step stands out of the noise, and how much of it is seen."""
    clear = step[ks.STEP_HEIGHT] / (3.0 * step[ks.NOISE] + 0.01)
    return float((1.0 - np.exp(-clear)) * share[4] ** 0.5 * (0.5 + 0.5 * share[0]) * (0.5 + 0.5 * share[1]))
