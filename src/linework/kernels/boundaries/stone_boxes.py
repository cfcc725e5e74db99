"""Boxes of channels and low kerbs along a bright stripe: a row of stones has its bend or its step at one of its own edges.

A stripe's direction is known, so that less ground is enough than for a channel in a cell, and a step is told that is too
low for the kerb of a cell. Paint has neither at its edges.

Positions are in metres from the survey's local origin.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.boundaries.change_boxes import GAIN_SCALE
from linework.kernels.boundaries.channel_boxes import (
    ALIKE_NOISE,
    CHANNEL_FLANK_M,
    CHANNEL_HALF_M,
    CHANNEL_SLOPES,
    bow_left,
    ground_across,
)
from linework.kernels.boundaries.ground_changes import (
    CHANGE_SIDE_POINTS,
    HEIGHTS_PER_M2,
    LEAST_GAIN,
    hinge_left,
)
from linework.kernels.boundaries.kerbs.boxes import box_cell_at
from linework.kernels.boundaries.profiles import (
    BIN_N,
    LEAST_FLOOR_NOISE_M,
    N_PROFILE_BINS,
    PLANE_EAST,
    PLANE_HEIGHT,
    PLANE_NORTH,
    UNIFORM_SIGMA,
    FloorCells,
    PlaceScratch,
    bin_sums_across,
    line_through,
)
from linework.kernels.cells.floor import FACET_N, FACET_RMS
from linework.kernels.cells.places import (
    BOX_CELL_M,
    BOX_HALF_U,
    BOX_STEP,
    BOX_UX,
    BOX_UY,
    BOX_X,
    BOX_Y,
    BOX_Z,
    CHANNEL,
    COUNT,
    FORM,
    KERB,
    S_U,
    S_V,
    S_Z,
    SCORE,
    TOP_V,
)

#: Columns of a stripe: centre [m, local], unit vector along it, and from where to where off its middle an edge of it lies [m].
STONE_X, STONE_Y, STONE_Z, STONE_UX, STONE_UY, STONE_FROM, STONE_TO = range(7)
#: Width of a bin of the profile across a stripe, and how far from an edge of the stripe its bend or step lies at most: a
#: bin, and the error of the edge. [m]
STONE_BIN_M, AT_EDGE_M = 0.025, 0.03
#: Half of the extent of that profile [m]: that of a channel's flank, and where a wall stands nearer, less than the narrowest
#: footway.
STONE_HALVES_M = (CHANNEL_FLANK_M, 0.55)
#: The most points that are used: of the profile's area, nearly as many as it has independent heights.
MOST_STONE_POINTS = 2500
#: Shortest slope on either side [bins]: 0.15 m.
LEAST_STONE_BINS = 6
#: Fewest points of a bin on the average: of fewer, far apart as from the air, none lie at the edge itself.
BIN_POINTS = 4.0
#: Least change of the slope where there is a step as well: of a road and a footway that are as good as level. [m/m]
STEP_SLOPES = 0.5 * CHANNEL_SLOPES[0]
#: Height of a kerb over the noise of the ground beside it, at least, as for the kerb of a cell; and height of a dropped kerb
#: (DIN 18040-3): what is higher shows in a cell, where its foot is measured apart from its face [m].
STEP_OVER_NOISE, HIGHEST_STONE_M = 1.5, 0.03
#: How far on either side of a stripe's middle facets, 1 m wide, are mostly beside the stones [m]; and the greatest ratio of their
#: noise, wider than that of points as either may hold a part of the stones.
SIDE_OF_STONES_M, FACETS_ALIKE = 0.5, 1.5 * ALIKE_NOISE
#: Noise of a facet above which it says nothing: points of a wall or of tall plants are in it. [m]
MOST_FACET_M = 0.05
#: Models of the ground under a stripe: two slopes that meet, and two with a step between them.
HINGED, STEPPED = 0, 1


@njit(cache=True, nogil=True)
def slopes_under(sums: FloatArray, half: int, left: FloatArray) -> tuple[float, float]:
    """Write what two slopes leave of the heights across a stripe, and return what one slope and what one bow leaves [m2].

    Parameters
    ----------
    sums
        (73, 9), see `linework.kernels.boundaries.profiles.bin_sums_across`, in bins of `STONE_BIN_M`.
    half
        Extent of the profile to either side. [bins]
    left
        (73, 2) output: mean square [m2] with the second slope from each bin on, columns `HINGED` and `STEPPED`; inf where
        too few points lie on either side.
    """
    middle = N_PROFILE_BINS // 2
    first, last = middle - half, middle + half
    floor = LEAST_FLOOR_NOISE_M**2
    n, flat, _, _ = line_through(sums, first, last, 0.0)
    left[:] = np.inf
    for k in range(first + LEAST_STONE_BINS, last - LEAST_STONE_BINS + 1):
        v = (k - middle) * STONE_BIN_M
        n_a, left_a, _, _ = line_through(sums, first, k, v)
        n_b, left_b, _, _ = line_through(sums, k, last, v)
        if min(n_a, n_b) >= CHANGE_SIDE_POINTS:
            left[k, HINGED] = hinge_left(sums, first, k, last, v) / n + floor
            left[k, STEPPED] = (left_a + left_b) / n + floor
    return flat / max(n, 1.0) + floor, bow_left(sums, first, last) / max(n, 1.0) + floor


@njit(cache=True, nogil=True)
def stone_at_edge(
    sums: FloatArray, half: int, zone: tuple[float, float], left: FloatArray
) -> tuple[float, int, int]:
    """Return the gain of a bend or a step at an edge of a stripe, its bin and its model; gain 0 where there is none.

    Parameters
    ----------
    sums, half, left
        (73, 9); (73, 2) scratch: see `slopes_under`.
    zone
        Least and greatest distance from the middle at which it is one of the stripe's. [m]
    """
    middle = N_PROFILE_BINS // 2
    n = sums[middle + half, BIN_N] - sums[middle - half, BIN_N]
    if n < 2.0 * half * BIN_POINTS:
        return 0.0, middle, HINGED
    flat, bow = slopes_under(sums, half, left)
    independent = min(n, HEIGHTS_PER_M2 * 2.0 * half * STONE_BIN_M * 2.0 * CHANNEL_HALF_M)
    price = np.log(independent)
    # Each unknown has its price: a bow has one more than a slope, as a bend at a known place has
    rival = min(flat, bow * np.exp(2.0 * price / independent))
    best, at, model = 0.0, middle, HINGED
    for k in range(middle - half, middle + half + 1):
        for m in range(2):
            gain = 0.5 * independent * np.log(rival / left[k, m]) - (m + 1.0) * price
            if gain > best:
                best, at, model = gain, k, m
    off = abs(at - middle) * STONE_BIN_M
    return (best if best >= LEAST_GAIN and zone[0] <= off <= zone[1] else 0.0), at, model


@njit(cache=True, nogil=True)
def alike_beside(data: FloorCells, place: tuple[float, float], frame: tuple[float, float]) -> bool:
    """Return whether the facets on both sides of a place may be of two pavements, before their points are used.

    frame: unit vector across. Where one is missing, or holds a part of a wall, they may.
    """
    noise = np.zeros(2)
    for side in range(2):
        off = SIDE_OF_STONES_M if side == 1 else -SIDE_OF_STONES_M
        facet = data.facets[box_cell_at(data.span, place[0] + off * frame[0], place[1] + off * frame[1])]
        if facet[FACET_N] == 0.0 or facet[FACET_RMS] > MOST_FACET_M:
            return True
        noise[side] = np.hypot(facet[FACET_RMS], LEAST_FLOOR_NOISE_M)
    return bool(max(noise[0], noise[1]) <= FACETS_ALIKE * min(noise[0], noise[1]))


@njit(cache=True, nogil=True)
def box_of_stone(
    data: FloorCells,
    stripe: FloatArray,
    slope: tuple[float, float],
    least_step: float,
    scratch: PlaceScratch,
    box: FloatArray,
) -> bool:
    """Write the box of a channel or of a low kerb at an edge of a stripe; return whether there is one.

    Parameters
    ----------
    stripe
        (7,): columns `STONE_X` to `STONE_TO`.
    slope
        Of the road there, to the east and to the north; unknown: nan.
    least_step
        Height of a kerb at least. [m]
    box
        (18,) output with the columns of `linework.kernels.cells.places`.
    """
    work, sums = scratch.work, scratch.sums
    x, y, ux, uy = stripe[STONE_X], stripe[STONE_Y], stripe[STONE_UX], stripe[STONE_UY]
    vx, vy = -uy, ux
    if not alike_beside(data, (x, y), (vx, vy)):
        return False
    east, north = slope
    road = np.array(
        (stripe[STONE_Z], east, north) if np.isfinite(east + north) else (stripe[STONE_Z], 0.0, 0.0)
    )
    near, plane, noise = ground_across(
        data, (x, y), (vx, vy), road, STONE_HALVES_M[1], MOST_STONE_POINTS, work
    )
    if near < 2.0 * CHANGE_SIDE_POINTS:
        return False
    bin_sums_across(work, near, vx, vy, CHANNEL_HALF_M, STONE_BIN_M, sums, False)
    left = np.empty((N_PROFILE_BINS + 1, 2))
    zone = (stripe[STONE_FROM], stripe[STONE_TO])
    gain, k, model, half = 0.0, 0, HINGED, 0
    for half_m in STONE_HALVES_M:
        half_bins = int(half_m / STONE_BIN_M)
        gain_of_half, at, model_there = stone_at_edge(sums, half_bins, zone, left)
        if gain_of_half > gain:
            gain, k, model, half = gain_of_half, at, model_there, half_bins
    if gain == 0.0:
        return False
    middle = N_PROFILE_BINS // 2
    v = (k - middle) * STONE_BIN_M
    n_a, left_a, z_a, slope_a = line_through(sums, middle - half, k, v)
    n_b, left_b, z_b, slope_b = line_through(sums, k, middle + half, v)
    s_a, s_b = left_a / n_a + LEAST_FLOOR_NOISE_M**2, left_b / n_b + LEAST_FLOOR_NOISE_M**2
    if max(s_a, s_b) > ALIKE_NOISE**2 * min(s_a, s_b):
        return False
    step = z_b - z_a if model == STEPPED else 0.0
    bend = slope_b - slope_a
    # The carriageway is below a step
    sign = -1.0 if step > 0.0 else 1.0
    is_kerb = abs(step) >= max(least_step, STEP_OVER_NOISE * np.sqrt(max(s_a, s_b)))
    if (
        abs(step) > HIGHEST_STONE_M
        or bend > CHANNEL_SLOPES[1]
        or bend < (STEP_SLOPES if is_kerb else CHANNEL_SLOPES[0])
    ):
        return False
    low = z_a if step > 0.0 else z_b
    box[BOX_X], box[BOX_Y] = x + v * vx, y + v * vy
    box[BOX_Z] = plane[PLANE_HEIGHT] + (plane[PLANE_EAST] * vx + plane[PLANE_NORTH] * vy) * v
    box[BOX_Z] += low if is_kerb else 0.5 * (z_a + z_b)
    box[BOX_UX], box[BOX_UY] = sign * ux, sign * uy
    box[BOX_HALF_U] = 0.5 * BOX_CELL_M
    box[S_V] = AT_EDGE_M * UNIFORM_SIGMA * 2.0
    box[S_U] = box[S_V] / (UNIFORM_SIGMA * 2.0 * CHANNEL_HALF_M)
    box[S_Z] = 2.0 * noise / np.sqrt(near)
    box[SCORE] = 1.0 - np.exp(-gain / GAIN_SCALE)
    box[FORM], box[BOX_STEP] = (KERB, abs(step)) if is_kerb else (CHANNEL, 0.0)
    box[TOP_V] = -STONE_BIN_M if is_kerb else np.nan
    box[COUNT] = near
    return True
