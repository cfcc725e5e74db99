"""Boundary boxes: for each cell of the lattice where its floor ends, if it ends in it.

Positions are local: from the survey's origin. [m]
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import Float32Array, FloatArray, IntArray
from linework.kernels.boundaries.barrier_boxes import barrier_in_cell
from linework.kernels.boundaries.kerb_boxes import kerb_in_cell, may_be_kerb
from linework.kernels.boundaries.kerb_steps import STEP_COLUMNS
from linework.kernels.boundaries.pavement_edges import differs, edge_in_cell
from linework.kernels.boundaries.profiles import CLIP_M, MOST_PLACE_POINTS, N_PROFILE_BINS
from linework.kernels.cells.floor import FINE_M
from linework.kernels.cells.places import (
    BOX_ALL_ROAD,
    BOX_END,
    BOX_FOUND,
    BOX_HOLE,
    BOX_NO_ROAD,
    BOX_X,
    BOX_Y,
    COLUMNS,
    START,
    floor_near,
    gather_area,
    roughness_limit,
    slope_at,
)
from linework.kernels.cells.surroundings import fit_surroundings

#: Of the cells about a pavement's edge this share is floor at least.
LEAST_FLOOR_SHARE = 0.15


@njit(cache=True, nogil=True)
def box_in_cell(
    data: tuple[FloatArray, IntArray, IntArray, FloatArray, FloatArray],
    ground: tuple[Float32Array, float, int, int],
    place: tuple[float, float],
    limits: FloatArray,
    rooms: tuple[FloatArray, FloatArray, FloatArray],
    box: FloatArray,
) -> int:
    """Find where the floor ends in the cell about `place`; write the box, return FOUND or why there is none.

    data: points, starts, span, sums, facets. ground: see `boxes_in_cells`. limits: see `kerb_boxes`.
    rooms: work, sums of a profile, step: overwritten.
    """
    plane = np.zeros(3)
    east, north = slope_at(place, ground)
    if limits[4] > 0.0:
        east, north = 0.0, 0.0
    noise, usual = floor_near(data[4], data[2], place[0], place[1], (east, north), plane)
    if noise < 0.0:
        return BOX_HOLE
    if noise > roughness_limit(usual, limits):
        return BOX_NO_ROAD
    floor = (plane, noise, east, north, usual)
    slopes = np.empty((4, 4))
    rise, share = fit_surroundings(data[3], data[2], place, plane, noise, slopes)
    if rise < 0.0:
        return BOX_HOLE
    why = BOX_ALL_ROAD
    if may_be_kerb(floor, (slopes, rise), limits):
        area = gather_area(data[0], data[1], data[2], place, plane, rooms[0])
        why = kerb_in_cell(data, place, floor, (slopes, rise), area, limits, rooms, box)
    if (
        why != BOX_FOUND
        and share >= LEAST_FLOOR_SHARE
        and (differs(slopes, noise, 0) or differs(slopes, noise, 1))
    ):
        area = gather_area(data[0], data[1], data[2], place, plane, rooms[0])
        why = edge_in_cell(data, place, floor, (slopes, rise), area, limits, rooms, box)
    if why != BOX_FOUND and rise >= CLIP_M:
        area = gather_area(data[0], data[1], data[2], place, plane, rooms[0])
        why = barrier_in_cell(data, place, floor, slopes, area, limits, rooms, box)
    return why


@njit(cache=True, nogil=True)
def make_rooms() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return room for the points of a place, a profile, and a step."""
    return np.empty((MOST_PLACE_POINTS + 2, 5)), np.empty((N_PROFILE_BINS + 1, 9)), np.empty(STEP_COLUMNS)


@njit(cache=True, nogil=True)
def boxes_in_cells(
    data: tuple[FloatArray, IntArray, IntArray, FloatArray, FloatArray],
    ground: tuple[Float32Array, float, int, int],
    times: tuple[IntArray, FloatArray],
    limits: FloatArray,
    core: tuple[float, float, float, float],
) -> FloatArray:
    """Return (n, COLUMNS) the boxes of all cells that hold points, by row from the south, then column.

    ground: height over the origin, its cell, first column and row after the last (from the origin).
    core: west, south, east, north; only cells that touch it are looked at.
    times: where each point was, and the times there; no times: (0,).
    """
    starts, span = data[1], data[2]
    n_cols = span[2]
    rooms = make_rooms()
    out = np.empty((1024, COLUMNS))
    n = 0
    for r in range(0, span[3], 2):
        for c in range(0, n_cols, 2):
            south, north = r * n_cols + c, (r + 1) * n_cols + c
            if starts[south + 2] == starts[south] and starts[north + 2] == starts[north]:
                continue
            place = (span[0] + c + 1) * FINE_M, (span[1] + r + 1) * FINE_M
            if place[0] < core[0] - FINE_M or place[0] > core[2] + FINE_M:
                continue
            if place[1] < core[1] - FINE_M or place[1] > core[3] + FINE_M:
                continue
            if n == len(out):
                out = np.concatenate((out, np.empty_like(out)))
            if box_in_cell(data, ground, place, limits, rooms, out[n]) == BOX_FOUND:
                write_box_times(starts, span, times, out[n])
                n += 1
    return out[:n]


@njit(cache=True, nogil=True)
def write_box_times(
    starts: IntArray, span: IntArray, times: tuple[IntArray, FloatArray], box: FloatArray
) -> None:
    """Write when the first and the last point within about 0.25 m of the box was measured."""
    box[START], box[BOX_END] = np.nan, np.nan
    source, time = times
    if len(time) == 0:
        return
    c, r = int(np.floor(box[BOX_X] / FINE_M)) - span[0], int(np.floor(box[BOX_Y] / FINE_M)) - span[1]
    first, last = np.inf, -np.inf
    for i in range(max(r - 1, 0), min(r + 2, span[3])):
        for k in range(starts[i * span[2] + max(c - 1, 0)], starts[i * span[2] + min(c + 2, span[2])]):
            first, last = min(first, time[source[k]]), max(last, time[source[k]])
    if first <= last:
        box[START], box[BOX_END] = first, last
