"""The boundary boxes of a tile: in every cell of the lattice, the edge of the floor, if there is one.

Positions are in metres from the survey's local origin.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from linework.arrays import Float32Array, FloatArray, IntArray
from linework.kernels.boundaries.barrier_boxes import barrier_in_cell
from linework.kernels.boundaries.brightness_steps import brightness_step_in_cell
from linework.kernels.boundaries.change_boxes import CHANGE_AREA_POINTS, change_in_cell, may_change
from linework.kernels.boundaries.channel_boxes import MOST_CHANNEL_POINTS, channel_in_cell
from linework.kernels.boundaries.edge_boxes import differs, edge_in_cell
from linework.kernels.boundaries.kerbs.boxes import (
    begins_beyond_shadow,
    box_cell_at,
    kerb_in_cell,
    may_be_kerb,
)
from linework.kernels.boundaries.kerbs.ramps import ramp_in_cell, ramp_instead
from linework.kernels.boundaries.kerbs.steps import STEP_COLUMNS
from linework.kernels.boundaries.pavement_edges import BY_BRIGHTNESS, BY_ROUGHNESS
from linework.kernels.boundaries.profiles import (
    CLIP_M,
    ENOUGH_POINTS,
    MOST_PLACE_POINTS,
    N_PROFILE_BINS,
    PLACE_COLUMNS,
    PROFILE_SUMS,
    FloorCells,
    FloorLimits,
    LocalFloor,
    PlaceScratch,
)
from linework.kernels.boundaries.stone_boxes import STONE_X, STONE_Y, box_of_stone
from linework.kernels.boundaries.walls import AT_FOOT_M, gather_ground_area, has_wall
from linework.kernels.cells.floor import FINE_M, SPAN_COLS, SPAN_ROWS, SPAN_SOUTH, SPAN_WEST
from linework.kernels.cells.places import (
    AREA_M,
    AREA_POINTS,
    BOX_ALL_ROAD,
    BOX_CONTRAST,
    BOX_ELSEWHERE,
    BOX_END,
    BOX_FOUND,
    BOX_HOLE,
    BOX_NO_ROAD,
    BOX_ROUGHER,
    BOX_X,
    BOX_Y,
    COLUMNS,
    EDGE,
    FORM,
    MOST_MORE_POINTS,
    SCORE,
    START,
    floor_near,
    gather_area,
    points_in_noise,
    roughness_limit,
    slope_at,
)
from linework.kernels.cells.surroundings import fit_surroundings

#: Edges of no larger score, by brightness alone, are sought as changes of the ground too.
UNSURE_EDGE = 0.5
#: Noise of a floor over that of the smoothest floor around, at most, under scanners whose noise is larger than the limit.
NOISIEST_SHARE = 1.8
#: Smallest share of floor among the cells about a pavement's edge.
LEAST_FLOOR_SHARE = 0.15


@njit(cache=True, nogil=True)
def limits_at(data: FloorCells, place: tuple[float, float], usual: float, limits: FloorLimits) -> FloorLimits:
    """Return the limits at a place: at the road, a floor may be as noisy as the scanner makes its smoothest parts."""
    if not data.near_road[box_cell_at(data.span, place[0], place[1])]:
        return limits
    most = max(limits.most_noise, NOISIEST_SHARE * usual)
    return FloorLimits(limits.least_step, limits.steepest, limits.highest_step, most, limits.is_vertical)


class Around(NamedTuple):
    """What is known of a place before its points are looked at.

    Parameters
    ----------
    floor, limits
        The floor there, and the limits.
    slopes, rise, share
        See `linework.kernels.cells.surroundings.fit_surroundings`.
    """

    floor: LocalFloor
    limits: FloorLimits
    slopes: FloatArray
    rise: float
    share: float


@njit(cache=True, nogil=True)
def look_around(
    data: FloorCells,
    ground: tuple[Float32Array, float, int, int],
    place: tuple[float, float],
    limits: FloorLimits,
    plane: FloatArray,
    slopes: FloatArray,
) -> tuple[int, Around]:
    """Return `BOX_FOUND` where a place has a floor and cells around it, else why not; and what is around it.

    Parameters as for `boxes_in_cells`; plane: (3,) and slopes: (4, 4) are written.
    """
    east, north = slope_at(place, ground)
    if limits.is_vertical > 0.0:
        east, north = 0.0, 0.0
    noise, usual = floor_near(data.facets, data.span, place[0], place[1], (east, north), plane)
    scanner = usual if data.near_road[box_cell_at(data.span, place[0], place[1])] else 0.0
    floor = LocalFloor(plane, noise, east, north, usual, scanner)
    own = limits_at(data, place, usual, limits)
    rise, share = -1.0, 0.0
    if noise >= 0.0 and noise > roughness_limit(usual, own.most_noise):
        return BOX_NO_ROAD, Around(floor, own, slopes, rise, share)
    if noise >= 0.0:
        rise, share = fit_surroundings(data.sums, data.span, place, plane, noise, slopes)
    return BOX_HOLE if rise < 0.0 else BOX_FOUND, Around(floor, own, slopes, rise, share)


@njit(cache=True, nogil=True)
def box_in_cell(
    data: FloorCells, place: tuple[float, float], around: Around, scratch: PlaceScratch, box: FloatArray
) -> int:
    """Find the edge of the floor in the cell about `place`; write the box, return `BOX_FOUND` or why there is none.

    A kerb is tried first, then an edge without one, then a barrier. around: of the place; box: (18,) output with the
    columns of `linework.kernels.cells.places`.
    """
    floor, limits, slopes, rise, share = around
    plane, noise = floor.plane, floor.noise
    why, is_shadow = BOX_ALL_ROAD, False
    if may_be_kerb(floor, (slopes, rise), limits):
        most = points_in_noise(floor.scanner, ENOUGH_POINTS)
        area = gather_area(data.points, data.starts, data.span, place, plane, scratch.work, AREA_POINTS, most)
        why = kerb_in_cell(data, place, floor, (slopes, rise), area, limits, scratch, box)
        # Beyond a kerb's shadow the floor begins anew: that is no edge of it
        is_shadow = begins_beyond_shadow(scratch.step, limits)
        # A sloping face, where there is no step or a ramp explains it better
        if why == BOX_FOUND:
            why = ramp_instead(data, place, floor, area[1], limits, scratch, box)
        elif not is_shadow:
            why = ramp_in_cell(data, place, floor, slopes, area[1], limits, scratch, box)
    if (
        why != BOX_FOUND
        and not is_shadow
        and share >= LEAST_FLOOR_SHARE
        and (differs(slopes, noise, BY_ROUGHNESS) or differs(slopes, noise, BY_BRIGHTNESS))
    ):
        area = gather_area(data.points, data.starts, data.span, place, plane, scratch.work)
        why = edge_in_cell(data, place, floor, (slopes, rise), area, limits, scratch, box)
    if why != BOX_FOUND and rise >= CLIP_M:
        area = gather_area(data.points, data.starts, data.span, place, plane, scratch.work)
        why = barrier_in_cell(data, place, floor, slopes, area, limits, scratch, box)
    return why


@njit(cache=True, nogil=True)
def change_box_in_cell(
    data: FloorCells, place: tuple[float, float], around: Around, scratch: PlaceScratch, box: FloatArray
) -> int:
    """Find a change of the ground in the cell about `place`; write the box, return `BOX_FOUND` or why there is none.

    Parameters as for `box_in_cell`.
    """
    floor, limits, slopes, _, share = around
    if share < LEAST_FLOOR_SHARE or not may_change(slopes):
        return BOX_ALL_ROAD
    area = gather_ground_area(data, place, floor.plane, scratch.work, CHANGE_AREA_POINTS, ENOUGH_POINTS)
    return change_in_cell(data, place, floor, slopes, area, limits, scratch, box)


@njit(cache=True, nogil=True)
def channel_box_in_cell(
    data: FloorCells, place: tuple[float, float], around: Around, scratch: PlaceScratch, box: FloatArray
) -> int:
    """Find a channel in the cell about `place`; write the box, return `BOX_FOUND` or why there is none.

    Parameters as for `box_in_cell`.
    """
    most = roughness_limit(around.floor.usual, around.limits.most_noise)
    return channel_in_cell(data, place, around.floor, most, scratch, box)


@njit(cache=True, nogil=True)
def make_scratch() -> PlaceScratch:
    """Return arrays for the points of a place, the sums of a profile, and a step or an edge."""
    most = max(MOST_MORE_POINTS * MOST_PLACE_POINTS, MOST_CHANNEL_POINTS)
    # Columns one after the other: most kernels go through all points by two or three of them
    return PlaceScratch(
        np.empty((PLACE_COLUMNS, most + 2)).T,
        np.empty((N_PROFILE_BINS + 1, PROFILE_SUMS)),
        np.empty(STEP_COLUMNS),
    )


@njit(cache=True, nogil=True)
def boxes_in_cells(
    data: FloorCells,
    ground: tuple[Float32Array, float, int, int],
    times: tuple[IntArray, FloatArray],
    limits: FloorLimits,
    core: tuple[float, float, float, float],
) -> FloatArray:
    """Return the boxes of all cells that hold points, (n, 18), by row from the south, then by column.

    Parameters
    ----------
    data
        The points near the ground.
    ground
        Height of the ground over the origin (rows, cols) [m], its cell size [m], its first column and the row after
        its last, from the origin.
    times
        (n,) int64 number of each point in the tile, and (m,) the tile's times [s]; without times: (0,).
    limits
        Settings.
    core
        West, south, east and north edge [m]: only cells that touch it are searched.
    """
    starts, span = data.starts, data.span
    west, south, east, north = core
    n_cols = span[SPAN_COLS]
    scratch, plane, slopes = make_scratch(), np.zeros(3), np.empty((4, 4))
    # A change is against the road, whatever the slopes of floors are measured against
    against_road = FloorLimits(
        limits.least_step, limits.steepest, limits.highest_step, limits.most_noise, 0.0
    )
    with_walls = FloorCells(
        data.points, starts, span, data.sums, data.facets, data.near_road, np.zeros_like(data.is_wall), starts
    )
    out = np.empty((1024, COLUMNS))
    n = 0
    for r in range(0, span[SPAN_ROWS], 2):
        for c in range(0, n_cols, 2):
            lower, upper = r * n_cols + c, (r + 1) * n_cols + c
            if starts[lower + 2] == starts[lower] and starts[upper + 2] == starts[upper]:
                continue
            x, y = (span[SPAN_WEST] + c + 1) * FINE_M, (span[SPAN_SOUTH] + r + 1) * FINE_M
            if x < west - FINE_M or x > east + FINE_M:
                continue
            if y < south - FINE_M or y > north + FINE_M:
                continue
            if n + 2 >= len(out):
                out = np.concatenate((out, np.empty_like(out)))
            out[n : n + 3, BOX_CONTRAST], out[n : n + 3, BOX_ROUGHER] = np.nan, np.nan
            is_sure, before = False, n
            known, around = look_around(data, ground, (x, y), limits, plane, slopes)
            if known == BOX_FOUND and box_in_cell(data, (x, y), around, scratch, out[n]) == BOX_FOUND:
                write_box_times(starts, span, times, out[n])
                is_sure = out[n, FORM] != EDGE or out[n, SCORE] > UNSURE_EDGE
                n += 1
            if is_sure:
                continue
            if (
                known == BOX_FOUND
                and brightness_step_in_cell(data, (x, y), around.floor, slopes, scratch, out[n]) == BOX_FOUND
            ):
                # Instead of an edge that is no surer
                if n > before:
                    n -= 1
                    if out[n + 1, SCORE] > out[n, SCORE]:
                        out[n] = out[n + 1]
                write_box_times(starts, span, times, out[n])
                n += 1
                if out[n - 1, SCORE] > UNSURE_EDGE:
                    continue
            if limits.is_vertical > 0.0:
                known, around = look_around(data, ground, (x, y), against_road, plane, slopes)
            if known != BOX_FOUND:
                continue
            why = change_box_in_cell(data, (x, y), around, scratch, out[n])
            if why != BOX_FOUND and has_wall(data, (x, y), AREA_M):
                # The ground ends at its foot, or at that of a hedge
                why = change_box_in_cell(with_walls, (x, y), around, scratch, out[n])
                if why == BOX_FOUND and not has_wall(data, (out[n, BOX_X], out[n, BOX_Y]), AT_FOOT_M):
                    why = BOX_ELSEWHERE
            if why == BOX_FOUND:
                write_box_times(starts, span, times, out[n])
                n += 1
            # What was tried and left out may have one
            out[n, BOX_CONTRAST] = np.nan
            if channel_box_in_cell(data, (x, y), around, scratch, out[n]) == BOX_FOUND:
                write_box_times(starts, span, times, out[n])
                n += 1
    return out[:n]


@njit(cache=True, nogil=True)
def boxes_at_stripes(
    data: FloorCells,
    ground: tuple[Float32Array, float, int, int],
    times: tuple[IntArray, FloatArray],
    limits: FloorLimits,
    stripes: FloatArray,
) -> FloatArray:
    """Return the channels and low kerbs at edges of stripes, (k, 18), in the order of the stripes.

    Parameters
    ----------
    data, ground, times, limits
        As for `boxes_in_cells`.
    stripes
        (m, 7) with the columns of `linework.kernels.boundaries.stone_boxes`, `STONE_X` to `STONE_TO`.
    """
    scratch, out = make_scratch(), np.full((len(stripes) + 1, COLUMNS), np.nan)
    n = 0
    for i in range(len(stripes)):
        slope = slope_at((stripes[i, STONE_X], stripes[i, STONE_Y]), ground)
        if box_of_stone(data, stripes[i], slope, limits.least_step, scratch, out[n]):
            write_box_times(data.starts, data.span, times, out[n])
            n += 1
    return out[:n]


@njit(cache=True, nogil=True)
def write_box_times(
    starts: IntArray, span: IntArray, times: tuple[IntArray, FloatArray], box: FloatArray
) -> None:
    """Write the times of the first and the last point within about 0.25 m of a box (18,)."""
    box[START], box[BOX_END] = np.nan, np.nan
    source, time = times
    if len(time) == 0:
        return
    c, r = (
        int(np.floor(box[BOX_X] / FINE_M)) - span[SPAN_WEST],
        int(np.floor(box[BOX_Y] / FINE_M)) - span[SPAN_SOUTH],
    )
    n_cols = span[SPAN_COLS]
    first, last = np.inf, -np.inf
    for i in range(max(r - 1, 0), min(r + 2, span[SPAN_ROWS])):
        for k in range(
            starts[i * n_cols + min(max(c - 1, 0), n_cols)],
            starts[i * n_cols + max(min(c + 2, n_cols), 0)],
        ):
            first, last = min(first, time[source[k]]), max(last, time[source[k]])
    if first <= last:
        box[START], box[BOX_END] = first, last
