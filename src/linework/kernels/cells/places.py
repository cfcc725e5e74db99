"""Kernels for the places where a box is searched: cells of the survey's lattice, their floor and search area.

Positions are local: from the survey's origin. [m]
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import Float32Array, FloatArray, IntArray
from linework.kernels.boundaries.profiles import (
    ENOUGH_POINTS,
    PLANE_EAST,
    PLANE_HEIGHT,
    PLANE_NORTH,
    count_near,
    gather_at,
)
from linework.kernels.cells.floor import (
    FACET_EAST,
    FACET_HEIGHT,
    FACET_N,
    FACET_NORTH,
    FACET_RMS,
    FACET_SMOOTHEST,
    SPAN_COLS,
    SPAN_ROWS,
    SPAN_SOUTH,
    SPAN_WEST,
    ground_at,
)

#: Side of a cell that may hold a box. [m]
BOX_CELL_M = 0.5
#: Radius of a search area: 0.5 m of floor on one side and 0.2 m of the top on the other, from anywhere in a cell. [m]
AREA_M = 0.75
#: Radii of search areas, in `AREA_M`: those of fewer than `AREA_POINTS` points grow.
SCALES = np.array([1.0, 1.5, 2.5])
#: Points that a search area is to hold.
AREA_POINTS = 60

#: Noise of a floor against the smoothest around it, at most [ratio]: a rough spot or a far scanner adds to it. Noise
#: that any floor may have: fresh asphalt under a fair scanner [m].
ROUGHER_FLOOR, SMOOTH_FLOOR_M = 2.75, 0.006

#: Noise of a floor over that of the smoothest floor around: a scanner is as much noisier some metres farther away, where it
#: grazes the road, or where strips overlap. On als-roads-more-t0102 it is 1.3 to 1.4 (looked at, 2026-11-30).
NOISIER_SHARE = 1.5

#: Most points of a place over the usual number: dense surveys have no more of them there, and time goes with them.
MOST_MORE_POINTS = 8
#: Grass and soil are rougher than stone by this, in quadrature. [m]
GRASS_M = 0.008

#: Result of the search at a place: a box, or why there is none.
BOX_FOUND, BOX_HOLE, BOX_NO_ROAD, BOX_ALL_ROAD, BOX_ELSEWHERE = 0, 1, 2, 3, 4
#: Half width of a facet, over which a tilt against the road counts like its rms distance. [m]
_TILT_LEVER_M = 0.15
#: Half of the length over which the slope of the ground is taken. [m]
_HALF_SLOPE_M = 1.5
#: Columns of a box.
(
    BOX_X, BOX_Y, BOX_Z, BOX_UX, BOX_UY, BOX_HALF_U, S_V, S_Z, S_U, SCORE, FORM, BOX_STEP, TOP_V, COUNT, START, BOX_END,
    BOX_CONTRAST, BOX_ROUGHER,
) = range(18)  # fmt: skip
COLUMNS = 18
KERB, EDGE, BARRIER, CHANGE, CHANNEL = 2.0, 3.0, 4.0, 5.0, 6.0


@njit(cache=True, nogil=True)
def floor_near(
    facets: FloatArray, span: IntArray, x: float, y: float, slope: tuple[float, float], plane: FloatArray
) -> tuple[float, float]:
    """Choose the smoothest facet with the road's slope within the search area, and write its plane.

    Facets that are smooth enough for a floor come first: beside a steep verge, one across the edge may have more of the
    mean slope there than the road has.

    Parameters
    ----------
    facets, span
        (cells, 6) and (4,) int64; see `linework.kernels.cells.floor.facets_of`.
    x, y
        The place. [m]
    slope
        Slope of the road to the east and to the north.
    plane
        (3,), written: elements `PLANE_HEIGHT` to `PLANE_NORTH`, at (x, y).

    Returns
    -------
    noise, usual
        Rms distance of the facet, negative without any, and noise of the smoothest floor around. [m]
    """
    best, noise, usual, is_floor = 1e9, -1.0, 0.0, False
    n_cols, n_rows = span[SPAN_COLS] // 2, span[SPAN_ROWS] // 2
    c0 = int(np.floor(x / BOX_CELL_M)) - span[SPAN_WEST] // 2
    r0 = int(np.floor(y / BOX_CELL_M)) - span[SPAN_SOUTH] // 2
    for r in range(max(r0 - 2, 0), min(r0 + 3, n_rows)):
        for c in range(max(c0 - 2, 0), min(c0 + 3, n_cols)):
            at = r * n_cols + c
            if facets[at, FACET_N] == 0.0:
                continue
            # A facet across a step is tilted as well as rough: the tilt counts over half of its width
            tilt = (facets[at, FACET_EAST] - slope[0]) ** 2 + (facets[at, FACET_NORTH] - slope[1]) ** 2
            cost = facets[at, FACET_RMS] ** 2 + _TILT_LEVER_M**2 * tilt
            smooth = bool(
                facets[at, FACET_RMS] <= max(ROUGHER_FLOOR * facets[at, FACET_SMOOTHEST], SMOOTH_FLOOR_M)
            )
            if (smooth and not is_floor) or (cost < best and smooth == is_floor):
                best, noise, usual, is_floor = (
                    cost,
                    facets[at, FACET_RMS],
                    facets[at, FACET_SMOOTHEST],
                    smooth,
                )
                dx = x - (span[SPAN_WEST] // 2 + c + 0.5) * BOX_CELL_M
                dy = y - (span[SPAN_SOUTH] // 2 + r + 0.5) * BOX_CELL_M
                plane[PLANE_HEIGHT] = (
                    facets[at, FACET_HEIGHT] + facets[at, FACET_EAST] * dx + facets[at, FACET_NORTH] * dy
                )
                plane[PLANE_EAST], plane[PLANE_NORTH] = facets[at, FACET_EAST], facets[at, FACET_NORTH]
    return noise, usual


@njit(cache=True, nogil=True)
def roughness_limit(usual: float, most_noise: float) -> float:
    """Return the largest noise of the floor at a place [m], `usual` being that of the smoothest floors around."""
    return float(min(most_noise, max(ROUGHER_FLOOR * usual, SMOOTH_FLOOR_M)))


@njit(cache=True, nogil=True)
def points_in_noise(scanner: float, most: int) -> int:
    """Return how many points of a place are used: `most`, and up to 8 times as many under a noisy scanner.

    A step shows as clearly under more noise where the points grow with its variance, `scanner` squared [m2].
    """
    return int(most * min(max((scanner / SMOOTH_FLOOR_M) ** 2, 1.0), MOST_MORE_POINTS))


@njit(cache=True, nogil=True)
def is_rougher(rough: float, smooth: float) -> bool:
    """Return whether one surface is rougher than another [m] by what grass and soil are."""
    return bool(rough**2 - smooth**2 > GRASS_M**2)


@njit(cache=True, nogil=True)
def is_unpaved(noise: float, usual: float) -> bool:
    """Return whether a floor is rougher [m] than `NOISIER_SHARE` of the smoothest around by what grass and soil are."""
    return is_rougher(noise, NOISIER_SHARE * usual)


@njit(cache=True, nogil=True)
def own_roughness(noise: float, scanner: float) -> float:
    """Return the roughness of a surface without what the scanner adds to its noise [m]."""
    return float(np.sqrt(max(noise**2 - scanner**2, 0.0)))


@njit(cache=True, nogil=True)
def area_scale(starts: IntArray, span: IntArray, place: tuple[float, float], wanted: int) -> float:
    """Return the radius of the search area about a place, in `AREA_M`: wider where it holds fewer points than `wanted`.

    starts, span: as for `gather_area`.
    """
    for k in range(len(SCALES) - 1):
        if count_near(starts, span, place, AREA_M * SCALES[k]) >= wanted:
            return float(SCALES[k])
    return float(SCALES[-1])


@njit(cache=True, nogil=True)
def gather_area(
    points: FloatArray,
    starts: IntArray,
    span: IntArray,
    place: tuple[float, float],
    plane: FloatArray,
    work: FloatArray,
    wanted: int = AREA_POINTS,
    most: int = ENOUGH_POINTS,
) -> tuple[int, float]:
    """Collect the points of the search area about a place, wider where they are fewer than `wanted`; of more than `most`, some.

    Parameters
    ----------
    points, starts, span
        (n, 4), (cells + 1,) int64 and (4,) int64; see `linework.kernels.cells.floor.sort_by_cell`.
    place
        x and y. [m]
    plane
        (3,) floor of the place.
    work
        (m, 4), written: the points; see `linework.kernels.boundaries.profiles.gather_at`.

    Returns
    -------
    Number of points, and the radius of the area in `AREA_M`.
    """
    scale = area_scale(starts, span, place, wanted)
    return gather_at(points, starts, span, place, AREA_M * scale, plane, most, work), scale


@njit(cache=True, nogil=True)
def chord_in_cell(x: float, y: float, ux: float, uy: float, half: float) -> tuple[float, float]:
    """Return the range along a line (x, y) + t (ux, uy) inside the square ``|x|, |y| <= half`` [m]; empty: 0, -1."""
    low, high = -1e9, 1e9
    for p, d in ((x, ux), (y, uy)):
        if abs(d) < 1e-12:
            if abs(p) > half:
                return 0.0, -1.0
            continue
        a, b = (-half - p) / d, (half - p) / d
        low, high = max(low, min(a, b)), min(high, max(a, b))
    if low > high:
        return 0.0, -1.0
    return low, high


@njit(cache=True, nogil=True)
def slope_at(place: tuple[float, float], ground: tuple[Float32Array, float, int, int]) -> tuple[float, float]:
    """Return the slope of the ground to the east and to the north at a place, over 3 m.

    `ground` is heights (rows, cols) float32, side of a cell, first column and northern edge; see `ground_at`.
    """
    x, y = place
    height, cell, west, north = ground
    half = _HALF_SLOPE_M
    east = ground_at(x + half, y, cell, west, north, height) - ground_at(
        x - half, y, cell, west, north, height
    )
    up = ground_at(x, y + half, cell, west, north, height) - ground_at(x, y - half, cell, west, north, height)
    return east / (2.0 * half), up / (2.0 * half)
