"""Boxes of channels: lines at which two even, smooth slopes meet and to which both fall.

Where a carriageway ends flush with its footway, both fall towards their common edge by 2 % and more (the crossfall of
either), so that water runs off there. Neither step, nor roughness, nor brightness need tell them apart: a gutter of
bright stone may lie on either side of the edge. Two slopes are weighed against one slope, against one even bow (ruts, old
roads) and against a step.

Separate from `change_boxes`, which compares two sides over less ground: this one needs long, even flanks.

Positions are in metres from the survey's local origin.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.boundaries.change_boxes import GAIN_SCALE
from linework.kernels.boundaries.ground_changes import (
    CHANGE_SIDE_POINTS,
    HEIGHTS_PER_M2,
    LEAST_CHANGE_M,
    LEAST_GAIN,
    hinge_left,
)
from linework.kernels.boundaries.profiles import (
    BIN_N,
    BIN_R,
    BIN_V,
    BIN_VV,
    LEAST_BOX_M,
    LEAST_FLOOR_NOISE_M,
    LEAST_VV,
    N_PROFILE_BINS,
    PLACE_COLUMNS,
    PLACE_R,
    PLACE_X,
    PLACE_Y,
    PLANE_EAST,
    PLANE_HEIGHT,
    PLANE_NORTH,
    UNIFORM_SIGMA,
    FloorCells,
    LocalFloor,
    PlaceScratch,
    bin_sums_across,
    fit_side,
    line_through,
)
from linework.kernels.boundaries.walls import gather_ground
from linework.kernels.cells.floor import (
    FACET_HEIGHT,
    FACET_N,
    FACET_RMS,
    SPAN_COLS,
    SPAN_ROWS,
    SPAN_SOUTH,
    SPAN_WEST,
)
from linework.kernels.cells.places import (
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
    CHANNEL,
    COUNT,
    FORM,
    S_U,
    S_V,
    S_Z,
    SCORE,
    TOP_V,
    chord_in_cell,
)

#: Change of the slope across a channel: carriageway and footway fall towards it by 2 to 3 % each, a ramp of a drive by 12;
#: what is steeper is a kerb with a sloping face or a bank, what is less a rut. [m/m]
CHANNEL_SLOPES = (0.03, 0.20)
#: Extent of each slope across, less than the narrowest footway; half of the length along which it is measured; and how far
#: from the middle of its cell a channel is sought, half of its diagonal. [m]
CHANNEL_FLANK_M, CHANNEL_HALF_M, CHANNEL_SOUGHT_M = 0.80, 1.50, 0.36
#: Width of a bin of its profile [m], and bins of a flank.
CHANNEL_BIN_M = 0.04
FLANK_OF_CHANNEL = round(CHANNEL_FLANK_M / CHANNEL_BIN_M)
#: Radius that holds both slopes over that length [m]; and the most points of it that are used: 5 mm of noise need them.
CHANNEL_AREA_M, MOST_CHANNEL_POINTS = 1.9, 5000
#: Bins on either side of a step that it is weighed with: what is narrower is noise at the end of a flank.
LEAST_STEP_BINS = 5
#: Points farther than this above or below the ground's plane are of neither slope: of walls and cars. [m]
NEAR_SLOPE_M = 0.10
#: Share of a channel's rise that the middles of the cells around it show at least: they are 0.5 m wide.
SEEN_SHARE = 0.5
#: Cells on one side of a cell, of those around it: steps to the east and to the north.
_SIDES = ((1, 0), (1, 1), (0, 1), (-1, 1))
#: Greatest ratio of the noise of the two slopes: both are paved.
ALIKE_NOISE = 1.5
#: Turns by which the direction is refined, on either side: a cell's neighbours lie 45 degrees apart. [rad]
CHANNEL_TURNS = np.deg2rad(np.array([12.0, 6.0, 3.0, 1.5]))


@njit(cache=True, nogil=True)
def rise_around(data: FloorCells, place: tuple[float, float], most_noise: float) -> tuple[float, float]:
    """Return the unit vector across which the smooth cells beside the cell at `place` lie highest over it, or zeros."""
    span, facets = data.span, data.facets
    n_cols, n_rows = span[SPAN_COLS] // 2, span[SPAN_ROWS] // 2
    c = int(np.floor(place[0] / BOX_CELL_M)) - span[SPAN_WEST] // 2
    r = int(np.floor(place[1] / BOX_CELL_M)) - span[SPAN_SOUTH] // 2
    if r < 1 or c < 1 or r + 1 >= n_rows or c + 1 >= n_cols:
        return 0.0, 0.0
    middle = r * n_cols + c
    most, x, y = 0.0, 0.0, 0.0
    for dx, dy in _SIDES:
        a, b = (r + dy) * n_cols + c + dx, (r - dy) * n_cols + c - dx
        if min(facets[middle, FACET_N], facets[a, FACET_N], facets[b, FACET_N]) == 0.0:
            return 0.0, 0.0
        if max(facets[middle, FACET_RMS], facets[a, FACET_RMS], facets[b, FACET_RMS]) > most_noise:
            return 0.0, 0.0
        height = facets[a, FACET_HEIGHT] + facets[b, FACET_HEIGHT] - 2.0 * facets[middle, FACET_HEIGHT]
        rise = height / (BOX_CELL_M * np.hypot(dx, dy))
        most = max(most, rise)
        # Opposite sides count as one: the mean over doubled angles
        square = dx * dx + dy * dy
        x, y = x + rise * (dx * dx - dy * dy) / square, y + rise * 2.0 * dx * dy / square
    if most < SEEN_SHARE * CHANNEL_SLOPES[0] or most > CHANNEL_SLOPES[1]:
        return 0.0, 0.0
    angle = 0.5 * np.arctan2(y, x)
    return float(np.cos(angle)), float(np.sin(angle))


@njit(cache=True, nogil=True)
def bow_left(sums: FloatArray, first: int, last: int) -> float:
    """Return the residual sum of squares of heights about one even bow (a parabola), over the bins first to last - 1.

    sums: (73, 9), see `linework.kernels.boundaries.profiles.bin_sums_across`.
    """
    n, flat, _, _ = line_through(sums, first, last, 0.0)
    if n == 0.0:
        return 0.0
    mv, mr = (sums[last, BIN_V] - sums[first, BIN_V]) / n, (sums[last, BIN_R] - sums[first, BIN_R]) / n
    mq = (sums[last, BIN_VV] - sums[first, BIN_VV]) / n
    vv, vq, qq, vr, qr = LEAST_VV, 0.0, LEAST_VV, 0.0, 0.0
    for i in range(first, last):
        m = sums[i + 1, BIN_N] - sums[i, BIN_N]
        if m > 0.0:
            v = (sums[i + 1, BIN_V] - sums[i, BIN_V]) / m
            r = (sums[i + 1, BIN_R] - sums[i, BIN_R]) / m - mr
            q, v = v * v - mq, v - mv
            vv, vq, qq = vv + m * v * v, vq + m * v * q, qq + m * q * q
            vr, qr = vr + m * v * r, qr + m * q * r
    return float(max(flat - (qr - vq * vr / vv) ** 2 / max(qq - vq * vq / vv, LEAST_VV), 0.0))


@njit(cache=True, nogil=True)
def channel_gain(sums: FloatArray, k: int) -> tuple[float, float, float, float]:
    """Return the gain of a channel at bin k over one slope or bow, the height of its line [m], its points and mean square.

    The gain is 0 where the slopes do not make a channel. sums: as for `bow_left`, in bins of `CHANNEL_BIN_M`.
    """
    first, last = k - FLANK_OF_CHANNEL, k + FLANK_OF_CHANNEL
    v = (k - 0.5 * N_PROFILE_BINS) * CHANNEL_BIN_M
    n_a, left_a, z_a, slope_a = line_through(sums, first, k, v)
    n_b, left_b, z_b, slope_b = line_through(sums, k, last, v)
    n, z = n_a + n_b, 0.5 * (z_a + z_b)
    if min(n_a, n_b) < CHANGE_SIDE_POINTS:
        return 0.0, z, n, 0.0
    if not CHANNEL_SLOPES[0] <= slope_b - slope_a <= CHANNEL_SLOPES[1]:
        return 0.0, z, n, 0.0
    floor = LEAST_FLOOR_NOISE_M**2
    s_a, s_b = left_a / n_a + floor, left_b / n_b + floor
    if max(s_a, s_b) > ALIKE_NOISE**2 * min(s_a, s_b):
        return 0.0, z, n, 0.0
    area = (last - first) * CHANNEL_BIN_M * 2.0 * CHANNEL_HALF_M
    independent = min(n, HEIGHTS_PER_M2 * area)
    price = np.log(independent)
    hinge = hinge_left(sums, first, k, last, v) / n + floor
    _, flat, _, _ = line_through(sums, first, last, v)
    rival = flat / n + floor
    # A bow takes three times as long as all else, and most hinges are no better than one slope already
    if 0.5 * independent * np.log(rival / hinge) > price:
        bow = (bow_left(sums, first, last) / n + floor) * np.exp(2.0 * price / independent)
        rival = min(rival, bow)
    gain = max(0.5 * independent * np.log(rival / hinge) - price, 0.0)
    return float(gain), z, n, float(hinge)


@njit(cache=True, nogil=True)
def left_by_step(sums: FloatArray) -> float:
    """Return the mean square of the heights about two slopes with a step between, anywhere in a profile; inf: no step.

    sums: as for `channel_gain`. Beside a low kerb there is no channel.
    """
    first, last = N_PROFILE_BINS // 2 - FLANK_OF_CHANNEL, N_PROFILE_BINS // 2 + FLANK_OF_CHANNEL
    least = np.inf
    for j in range(first + LEAST_STEP_BINS, last - LEAST_STEP_BINS + 1):
        v = (j - 0.5 * N_PROFILE_BINS) * CHANNEL_BIN_M
        n_a, left_a, z_a, _ = line_through(sums, first, j, v)
        n_b, left_b, z_b, _ = line_through(sums, j, last, v)
        if min(n_a, n_b) >= CHANGE_SIDE_POINTS and abs(z_a - z_b) >= LEAST_CHANGE_M:
            least = min(least, (left_a + left_b) / (n_a + n_b))
    return least + LEAST_FLOOR_NOISE_M**2


@njit(cache=True, nogil=True)
def ground_across(
    data: FloorCells,
    place: tuple[float, float],
    frame: tuple[float, float],
    plane: FloatArray,
    extent: float,
    most: int,
    work: FloatArray,
) -> tuple[int, FloatArray, float]:
    """Write the points of the ground about a place, above the plane through them; return their number, it, and its noise [m].

    The slope of a single cell, 0.5 m wide, would add to the noise of points 1.5 m away.

    Parameters
    ----------
    frame
        Unit vector across.
    plane
        (3,): near the ground there.
    extent
        How far across the plane is fitted. [m]
    most
        Largest number of points; of more points, only every second, third ... is used.
    work
        (n, 4) output: see `linework.kernels.boundaries.profiles.gather_at`.
    """
    vx, vy = frame
    n = gather_ground(data, place, CHANNEL_AREA_M, plane, most, work)
    window = (-extent, extent, CHANNEL_HALF_M)
    a, b, c, noise, count = fit_side(work, n, frame, window, (0.0, NEAR_SLOPE_M), (LEAST_VV, LEAST_VV))
    if count == 0.0:
        return 0, plane, noise
    near = 0
    for i in range(n):
        x, y = work[i, PLACE_X], work[i, PLACE_Y]
        work[i, PLACE_R] -= a + b * (x * vy - y * vx) + c * (x * vx + y * vy)
        if abs(work[i, PLACE_R]) <= NEAR_SLOPE_M:
            for k in range(PLACE_COLUMNS):
                work[near, k] = work[i, k]
            near += 1
    through = plane.copy()
    through[PLANE_HEIGHT] += a
    through[PLANE_EAST] += b * vy + c * vx
    through[PLANE_NORTH] += c * vy - b * vx
    return near, through, noise


@njit(cache=True, nogil=True)
def channel_in_cell(
    data: FloorCells,
    place: tuple[float, float],
    floor: LocalFloor,
    most_noise: float,
    scratch: PlaceScratch,
    box: FloatArray,
) -> int:
    """Find a channel in the cell about `place`; write the box, return `BOX_FOUND` or why there is none.

    Arguments as for `linework.kernels.boundaries.change_boxes.change_in_cell`; most_noise: of a paved floor [m].
    """
    work, sums = scratch.work, scratch.sums
    x, y = place
    vx, vy = rise_around(data, place, most_noise)
    if vx == 0.0 and vy == 0.0:
        return BOX_ALL_ROAD
    near, plane, _ = ground_across(
        data, place, (vx, vy), floor.plane, CHANNEL_FLANK_M, MOST_CHANNEL_POINTS, work
    )
    if near < 2.0 * CHANGE_SIDE_POINTS:
        return BOX_HOLE
    half = int(CHANNEL_SOUGHT_M / CHANNEL_BIN_M) + 1
    middle = N_PROFILE_BINS // 2
    best, least, left, count = 0.0, np.inf, 0.0, 0.0
    for stage in range(len(CHANNEL_TURNS) + 1):
        x0, y0 = vx, vy
        for side in range(0 if stage == 0 else -1, 2 if stage > 0 else 1, 2):
            turn = side * CHANNEL_TURNS[stage - 1]
            tx, ty = x0 * np.cos(turn) - y0 * np.sin(turn), x0 * np.sin(turn) + y0 * np.cos(turn)
            bin_sums_across(work, near, tx, ty, CHANNEL_HALF_M, CHANNEL_BIN_M, sums, False)
            for k in range(middle - half, middle + half + 1):
                gain, _, n_points, square = channel_gain(sums, k)
                if gain > best:
                    best, left, count, vx, vy = gain, square, n_points, tx, ty
            # A step seen aslant looks like two slopes
            least = min(least, left_by_step(sums))
    if best < LEAST_GAIN:
        return BOX_NO_ROAD
    independent = min(count, HEIGHTS_PER_M2 * 2.0 * CHANNEL_FLANK_M * 2.0 * CHANNEL_HALF_M)
    sure = min(best, 0.5 * independent * np.log(least / left) + np.log(independent))
    if sure < LEAST_GAIN:
        return BOX_NO_ROAD
    bin_sums_across(work, near, vx, vy, CHANNEL_HALF_M, CHANNEL_BIN_M, sums, False)
    # Its place: the mean over the bins near the best, weighted by their likelihood
    total, mean, square, height = 0.0, 0.0, 0.0, 0.0
    for k in range(middle - half, middle + half + 1):
        gain, z, _, _ = channel_gain(sums, k)
        if gain > 0.0:
            likely, v = np.exp(gain - best), (k - middle) * CHANNEL_BIN_M
            total, mean, square = total + likely, mean + likely * v, square + likely * v * v
            height += likely * z
    v, height = mean / total, height / total
    sigma = np.sqrt(max(square / total - v * v, 0.0) + CHANNEL_BIN_M**2 / 12.0)
    low, high = chord_in_cell(v * vx, v * vy, vy, -vx, 0.5 * BOX_CELL_M)
    if high - low < LEAST_BOX_M:
        return BOX_ELSEWHERE
    u = 0.5 * (low + high)
    dx, dy = v * vx + u * vy, v * vy - u * vx
    box[BOX_X], box[BOX_Y] = x + dx, y + dy
    box[BOX_Z] = plane[PLANE_HEIGHT] + plane[PLANE_EAST] * dx + plane[PLANE_NORTH] * dy + height
    box[BOX_UX], box[BOX_UY] = vy, -vx
    box[BOX_HALF_U] = 0.5 * BOX_CELL_M
    box[S_V], box[S_U] = sigma, sigma / (UNIFORM_SIGMA * 2.0 * CHANNEL_HALF_M)
    box[S_Z] = 2.0 * floor.noise / np.sqrt(count)
    box[SCORE] = 1.0 - np.exp(-sure / GAIN_SCALE)
    box[FORM], box[BOX_STEP], box[TOP_V] = CHANNEL, 0.0, np.nan
    box[COUNT] = count
    return BOX_FOUND
