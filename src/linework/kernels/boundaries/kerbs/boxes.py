"""The box of a kerb in one cell: its step found, measured, and checked.

Separate from `boundary_boxes`, which tries kerb, edge and barrier in turn: this one looks for a step in the floor.

Positions are in metres from the survey's local origin.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.boundaries.kerbs.bends import follow_bend
from linework.kernels.boundaries.kerbs.sides import (
    COVER_BOTH,
    COVER_COLUMNS,
    COVER_FLOOR,
    COVER_TOP,
    COVER_U_HIGH,
    COVER_U_LOW,
    filled_shares,
    measure_seen_step,
)
from linework.kernels.boundaries.kerbs.steps import (
    CLEAR_LONG_STEP,
    CLEAR_STEP,
    CLEAREST_ABOVE,
    CLEAREST_BELOW,
    CLEAREST_CLEAR,
    CLEAREST_COLUMNS,
    CLEAREST_V,
    CLEAREST_VX,
    CLEAREST_VY,
    KERB_TOP_WIDTH_M,
    MOST_TRIED,
    STEP_FLOOR_A,
    STEP_FLOOR_B,
    STEP_FLOOR_C,
    STEP_FOOT,
    STEP_HEIGHT,
    STEP_N_FACE,
    STEP_N_FLOOR,
    STEP_N_TOP,
    STEP_NOISE,
    STEP_NOISE_TOP,
    STEP_SHADOW,
    STEP_SIGMA_H,
    STEP_SIGMA_U,
    STEP_SIGMA_V,
    STEP_TOP,
    STEP_TOP_C,
    STEP_VX,
    STEP_VY,
    best_step,
    floor_at_foot,
)
from linework.kernels.boundaries.profiles import (
    AGAIN_M,
    CHORD_SLACK_M,
    CLIP_M,
    FLOOR_WIDTH_M,
    HALF_LENGTH_M,
    LEAST_BOX_M,
    LEAST_CHORD_M,
    MOST_PLACE_POINTS,
    PIECE_POINTS,
    PLACE_R,
    PLACE_X,
    PLACE_Y,
    PLANE_EAST,
    PLANE_HEIGHT,
    PLANE_NORTH,
    FloorCells,
    FloorLimits,
    LocalFloor,
    PlaceScratch,
    count_near,
    gather_at,
)
from linework.kernels.cells.floor import SPAN_COLS, SPAN_ROWS, SPAN_SOUTH, SPAN_WEST
from linework.kernels.cells.places import (
    AREA_M,
    BOX_ALL_ROAD,
    BOX_CELL_M,
    BOX_ELSEWHERE,
    BOX_FOUND,
    BOX_HALF_U,
    BOX_NO_ROAD,
    BOX_ROUGHER,
    BOX_STEP,
    BOX_UX,
    BOX_UY,
    BOX_X,
    BOX_Y,
    BOX_Z,
    COUNT,
    FORM,
    GRASS_M,
    KERB,
    S_U,
    S_V,
    S_Z,
    SCORE,
    TOP_V,
    chord_in_cell,
    is_unpaved,
    own_roughness,
    points_in_noise,
    roughness_limit,
)
from linework.kernels.cells.surroundings import FIELD_HEIGHT, RISE, SLOPE_EAST, SLOPE_NORTH, SLOPE_SHARE

#: Smallest height of a kerb over the roughness of its floor, without the scanner's noise: grass stays below it.
LEAST_CLEAR_KERB = 1.5
#: Smallest share of the variance of the cells' heights that a slope explains: three quarters across a step in the
#: middle, a third of that off the middle and in noise, a tenth by chance.
KERB_EXPLAINED = 0.25
#: Slope across a disc of radius R that a step h cuts in half, times R / h; rounded down from 0.85.
STEP_SLOPE_SHARE = 0.8
#: Directions that are tried where something high stands near and the slopes do not show the kerb.
N_DIRECTIONS = 8
#: Half of the longest window: kerbs round corners of streets, of radii of 10 m, leave it by more than their own width. [m]
LONGEST_HALF_M = 3.0
#: Smallest step of the profile over the least height of a kerb: a profile smears it.
PROFILE_SHARE = 0.7
#: Smallest height of a kerb over the roughness of its top, where that is stone (without the scanner's noise, which only
#: counts in the sigma of the height) and where it is grass, and over the sigma
#: of its height.
STONE_CLEAR, GRASS_CLEAR, HEIGHT_SIGMAS = 2.0, 4.0, 4.0
#: The road's slope is known from cells on both sides, 3 m apart, and holds this share of the step (1 / 3).
STEP_IN_SLOPE = 3.0
#: Roughest top, as a share of the step, and steepest top against its floor.
ROUGHEST_TOP, STEEPEST_TOP = 0.35, 0.25
#: Smallest shares of floor, top and quarters along that have points, and shortest length with both [m].
LEAST_FLOOR_COVER, LEAST_TOP_COVER, LEAST_BOTH_COVER, LEAST_COVER_M = 0.6, 0.5, 0.25, 0.15


@njit(cache=True, nogil=True)
def may_be_kerb(floor: LocalFloor, around: tuple[FloatArray, float], limits: FloorLimits) -> bool:
    """Return whether the fine cells around a place rise as they do next to a kerb.

    around: (4, 4) slopes of the fields and the rise, see `linework.kernels.cells.surroundings`.
    """
    slopes, rise = around
    size = np.hypot(slopes[FIELD_HEIGHT, SLOPE_EAST], slopes[FIELD_HEIGHT, SLOPE_NORTH])
    # Half of the step's slope, where it is off the middle of the disc
    least = 0.5 * max(limits.least_step, LEAST_CLEAR_KERB * own_roughness(floor.noise, floor.scanner))
    steady = size * AREA_M >= STEP_SLOPE_SHARE * least and slopes[FIELD_HEIGHT, SLOPE_SHARE] >= KERB_EXPLAINED
    return bool(rise >= least and (rise >= CLIP_M or steady))


@njit(cache=True, nogil=True)
def kerb_in_cell(
    data: FloorCells,
    place: tuple[float, float],
    floor: LocalFloor,
    around: tuple[FloatArray, float],
    area: tuple[int, float],
    limits: FloorLimits,
    scratch: PlaceScratch,
    box: FloatArray,
) -> int:
    """Find the foot of a kerb in the cell about `place`; write the box, return `BOX_FOUND` or why there is none.

    Parameters
    ----------
    data
        The points near the ground.
    place
        Middle of the cell. [m, from the local origin]
    floor
        At the place.
    around
        (4, 4) slopes of the fields about the place, and the rise.
    area
        Number of points of the search area, in `scratch.work`, and its radius over the usual one.
    limits, scratch
        Settings; arrays to overwrite.
    box
        (18,) output: columns of `linework.kernels.cells.places`.
    """
    x, y = place
    n, scale = area
    usual_m = half_u = HALF_LENGTH_M * scale
    why = kerb_in_window(data, place, floor, around, (n, scale, half_u), limits, scratch, box)
    # At the road a second look: few points show a step over a longer stretch only; no farther than all can be used
    most = points_in_noise(floor.scanner, MOST_PLACE_POINTS)
    is_again = data.near_road[box_cell_at(data.span, x, y)] and not is_unpaved(floor.noise, floor.usual)
    while is_again and why != BOX_FOUND and 2.0 * half_u <= LONGEST_HALF_M:
        half_u *= 2.0
        radius = np.hypot(half_u, AREA_M * scale)
        if count_near(data.starts, data.span, place, radius) > most:
            break
        n = gather_at(data.points, data.starts, data.span, place, radius, floor.plane, most, scratch.work)
        why = kerb_in_window(data, place, floor, around, (n, scale, half_u), limits, scratch, box)
    # The windows of neighbouring boxes overlap the more, the longer they are: they err alike
    longer = np.sqrt(half_u / usual_m)
    box[S_V], box[S_Z] = longer * box[S_V], longer * box[S_Z]
    return why


@njit(cache=True, nogil=True)
def box_cell_at(span: IntArray, x: float, y: float) -> int:
    """Return the number of the cell of two fine ones that holds a place [m, from the local origin]."""
    c = int(np.floor(x / BOX_CELL_M)) - span[SPAN_WEST] // 2
    r = int(np.floor(y / BOX_CELL_M)) - span[SPAN_SOUTH] // 2
    return int(
        min(max(r, 0), span[SPAN_ROWS] // 2 - 1) * (span[SPAN_COLS] // 2)
        + min(max(c, 0), span[SPAN_COLS] // 2 - 1)
    )


@njit(cache=True, nogil=True)
def kerb_in_window(
    data: FloorCells,
    place: tuple[float, float],
    floor: LocalFloor,
    around: tuple[FloatArray, float],
    area: tuple[int, float, float],
    limits: FloorLimits,
    scratch: PlaceScratch,
    box: FloatArray,
) -> int:
    """Find the foot of a kerb as `kerb_in_cell`, in a window of one length.

    area: number of points in `scratch.work`, radius of the search area over the usual one, half of the window's length [m].
    """
    work, sums, step = scratch
    slopes, rise = around
    x, y = place
    n, scale, half_u = area
    is_long = half_u > HALF_LENGTH_M * scale
    least_clear = CLEAR_LONG_STEP if is_long else CLEAR_STEP
    step[STEP_SHADOW] = 0.0
    share, first, plane = np.zeros(COVER_COLUMNS), np.zeros(CLEAREST_COLUMNS), floor.plane.copy()
    found, tried = False, np.zeros((MOST_TRIED, 2))
    for k in (FIELD_HEIGHT, RISE):
        # Next to a car, a hedge or a wall the slope of the heights is not the kerb's
        east, north = slopes[k, SLOPE_EAST], slopes[k, SLOPE_NORTH]
        size = np.hypot(east, north)
        if not found and size > 0.0:
            found = best_step(work, n, (-east / size, -north / size), scale, half_u, sums, tried, first)
    if rise >= 0.5 * CLIP_M and not is_long:
        for k in range(N_DIRECTIONS):
            if not found:
                turn = 0.25 * np.pi * k
                found = best_step(work, n, (np.cos(turn), np.sin(turn)), scale, half_u, sums, tried, first)
    if not found:
        return BOX_ALL_ROAD if first[CLEAREST_CLEAR] < least_clear else BOX_ELSEWHERE
    if first[CLEAREST_ABOVE] - first[CLEAREST_BELOW] < PROFILE_SHARE * limits.least_step:
        return BOX_ALL_ROAD
    vx, vy, v = first[CLEAREST_VX], first[CLEAREST_VY], first[CLEAREST_V]
    low, high = chord_in_cell(v * vx, v * vy, vy, -vx, 0.5 * BOX_CELL_M + CHORD_SLACK_M)
    if high - low < LEAST_CHORD_M:
        return BOX_ELSEWHERE
    # Measured again about the middle of the piece in this cell
    mx, my = v * vx + 0.5 * (low + high) * vy, v * vy - 0.5 * (low + high) * vx
    plane[PLANE_HEIGHT] += plane[PLANE_EAST] * mx + plane[PLANE_NORTH] * my
    radius = np.hypot(half_u, AREA_M * scale) if is_long else AGAIN_M * scale
    most = points_in_noise(floor.scanner, MOST_PLACE_POINTS)
    n = gather_at(data.points, data.starts, data.span, (x + mx, y + my), radius, plane, most, work)
    if not measure_seen_step(work, n, first, scale, half_u, step):
        return BOX_ALL_ROAD
    # Over a long window the ground alone rises somewhere: the floor must be pavement, not soil, gravel or grass
    if is_long and is_unpaved(step[STEP_NOISE], floor.usual):
        return BOX_NO_ROAD
    if is_long and not rises_throughout(work, n, step, scale, half_u):
        return BOX_ELSEWHERE
    filled_shares(work, n, step, scale, half_u, share)
    if not is_kerb(step, share, floor, limits):
        return BOX_NO_ROAD
    if is_long:
        follow_bend(work, n, first, scale, half_u, step)
    vx, vy, foot = step[STEP_VX], step[STEP_VY], step[STEP_FOOT]
    low, high = chord_in_cell(mx + foot * vx, my + foot * vy, vy, -vx, 0.5 * BOX_CELL_M)
    if high - low < LEAST_BOX_M:
        return BOX_ELSEWHERE
    write_kerb(step, share, plane, (x + mx, y + my), 0.5 * (low + high), scale, box)
    return BOX_FOUND


@njit(cache=True, nogil=True)
def rises_throughout(work: FloatArray, n: int, step: FloatArray, scale: float, half_u: float) -> bool:
    """Return whether a measured step rises by half of its height and more in both halves of its window along u.

    What stands at one place only (a post, a car's corner, a few strays) makes no long step. Parameters as for
    `linework.kernels.boundaries.kerbs.sides.filled_shares`.
    """
    low, high, n_low, n_high = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
    for i in range(n):
        x, y = work[i, PLACE_X], work[i, PLACE_Y]
        v, u = x * step[STEP_VX] + y * step[STEP_VY], x * step[STEP_VY] - y * step[STEP_VX]
        if abs(u) > half_u:
            continue
        r = work[i, PLACE_R] - step[STEP_FLOOR_A] - step[STEP_FLOOR_B] * u - step[STEP_FLOOR_C] * v
        k = int(u > 0.0)
        if abs(r) > CLIP_M:
            continue
        begins = step[STEP_FOOT] + step[STEP_SHADOW]
        if begins < v < begins + FLOOR_WIDTH_M * scale:
            low[k] += r
            n_low[k] += 1.0
        elif step[STEP_TOP] - KERB_TOP_WIDTH_M * scale < v < step[STEP_TOP]:
            high[k] += r
            n_high[k] += 1.0
    for k in range(2):
        if min(n_low[k], n_high[k]) < PIECE_POINTS:
            return False
        if high[k] / n_high[k] - low[k] / n_low[k] < 0.5 * step[STEP_HEIGHT]:
            return False
    return True


@njit(cache=True, nogil=True)
def begins_beyond_shadow(step: FloatArray, limits: FloorLimits) -> bool:
    """Return whether the floor of a measured step (19,) begins beyond its shadow: it is as high as a kerb, over no verge."""
    return bool(step[STEP_SHADOW] > 0.0 and step[STEP_HEIGHT] >= limits.least_step and not _is_verge(step))


@njit(cache=True, nogil=True)
def _is_verge(step: FloatArray) -> bool:
    """Return whether the lower side of a measured step (19,) is as much rougher than the upper as grass is."""
    lower, upper = (step[STEP_NOISE], step[STEP_N_FLOOR]), (step[STEP_NOISE_TOP], step[STEP_N_TOP])
    return _is_as_grass(lower, upper)


@njit(cache=True, nogil=True)
def _is_as_grass(rough: tuple[float, float], smooth: tuple[float, float]) -> bool:
    """Return whether one side of a step is as much rougher than the other as grass is, by noise [m] and number of points.

    By more than two standard deviations of the difference between two measurements of one variance, too: few points tell
    little.
    """
    (noise, n), (least, m) = rough, smooth
    own, other = noise**2, least**2
    sigma = (n * own + m * other) / (n + m) * np.sqrt(2.0 / n + 2.0 / m)
    return bool(own - other > GRASS_M**2 + 2.0 * sigma)


@njit(cache=True, nogil=True)
def write_kerb(
    step: FloatArray,
    share: FloatArray,
    plane: FloatArray,
    place: tuple[float, float],
    u: float,
    scale: float,
    box: FloatArray,
) -> None:
    """Write the box (18,) of a measured step (19,) with this cover (5,).

    plane: (3,), above which the step was measured, at `place` [m]. u: middle of the box along the foot [m].
    """
    vx, vy, foot = step[STEP_VX], step[STEP_VY], step[STEP_FOOT]
    dx, dy = foot * vx + u * vy, foot * vy - u * vx
    box[BOX_X], box[BOX_Y] = place[0] + dx, place[1] + dy
    box[BOX_Z] = plane[PLANE_HEIGHT] + plane[PLANE_EAST] * dx + plane[PLANE_NORTH] * dy + step[STEP_FLOOR_A]
    box[BOX_Z] += step[STEP_FLOOR_B] * u + step[STEP_FLOOR_C] * foot
    box[BOX_UX], box[BOX_UY] = vy, -vx
    box[BOX_HALF_U] = max(min(share[COVER_U_HIGH] - u, u - share[COVER_U_LOW], HALF_LENGTH_M * scale), 0.05)
    box[S_V], box[S_U] = step[STEP_SIGMA_V], step[STEP_SIGMA_U]
    box[S_Z] = floor_at_foot(step[STEP_SHADOW], scale) * step[STEP_NOISE] / np.sqrt(step[STEP_N_FLOOR])
    box[SCORE] = _score(step, share)
    box[FORM], box[BOX_STEP] = KERB, step[STEP_HEIGHT]
    box[TOP_V] = step[STEP_TOP] - step[STEP_FOOT]
    # In noise above what grass adds, stone is not told from soil
    box[BOX_ROUGHER] = step[STEP_NOISE_TOP] / step[STEP_NOISE]
    if step[STEP_NOISE] > GRASS_M:
        box[BOX_ROUGHER] = np.nan
    box[COUNT] = step[STEP_N_FLOOR] + step[STEP_N_TOP] + step[STEP_N_FACE]


@njit(cache=True, nogil=True)
def is_kerb(
    step: FloatArray,
    share: FloatArray,
    floor: LocalFloor,
    limits: FloorLimits,
) -> bool:
    """Return whether a measured step (19,) with this cover (5,) is a kerb's: by its height, its floor and its top."""
    plane = floor.plane
    h, vx, vy = step[STEP_HEIGHT], step[STEP_VX], step[STEP_VY]
    tilt_x = plane[PLANE_EAST] + step[STEP_FLOOR_C] * vx + step[STEP_FLOOR_B] * vy - floor.east
    tilt_y = plane[PLANE_NORTH] + step[STEP_FLOOR_C] * vy - step[STEP_FLOOR_B] * vx - floor.north
    level = np.hypot(tilt_x, tilt_y) <= limits.steepest + h / STEP_IN_SLOPE
    # The grass of a verge is as high as it is rough; behind a kerb it is allowed, if the kerb stands out of it
    grass = _is_as_grass((step[STEP_NOISE_TOP], step[STEP_N_TOP]), (step[STEP_NOISE], step[STEP_N_FLOOR]))
    stone = STONE_CLEAR * own_roughness(step[STEP_NOISE_TOP], floor.scanner)
    least = max(
        LEAST_CLEAR_KERB * own_roughness(step[STEP_NOISE], floor.scanner),
        GRASS_CLEAR * step[STEP_NOISE_TOP] if grass else stone,
        HEIGHT_SIGMAS * step[STEP_SIGMA_H],
    )
    high = limits.least_step <= h <= limits.highest_step and h >= least
    # A pavement that lies above its verge is not a kerb of the verge
    smooth = (
        not _is_verge(step)
        and step[STEP_NOISE] <= roughness_limit(floor.usual, limits.most_noise)
        and step[STEP_NOISE_TOP] <= max(limits.most_noise, ROUGHEST_TOP * h)
    )
    top = abs(step[STEP_TOP_C] - step[STEP_FLOOR_C]) <= STEEPEST_TOP
    across = share[COVER_FLOOR] >= LEAST_FLOOR_COVER and share[COVER_TOP] >= LEAST_TOP_COVER
    along = share[COVER_U_HIGH] - share[COVER_U_LOW] > LEAST_COVER_M and share[COVER_BOTH] >= LEAST_BOTH_COVER
    return bool(level and high and smooth and top and across and along)


@njit(cache=True, nogil=True)
def _score(step: FloatArray, share: FloatArray) -> float:
    """Return the score of a kerb, 0 to 1: how far its step stands out of the noise, and how much of it is visible."""
    clear = step[STEP_HEIGHT] / (3.0 * step[STEP_NOISE] + 0.01)
    floor, top = 0.5 + 0.5 * share[COVER_FLOOR], 0.5 + 0.5 * share[COVER_TOP]
    return float((1.0 - np.exp(-clear)) * share[COVER_BOTH] ** 0.5 * floor * top)
