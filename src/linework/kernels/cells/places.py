"""Places where a box is looked for: cells of the survey's lattice, their floor, and the areas around them.

Positions are local: from the survey's origin. [m]
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import Float32Array, FloatArray, IntArray
from linework.kernels.boundaries.profiles import ENOUGH_POINTS, count_near, gather_at
from linework.kernels.cells.floor import ground_at

#: Side of a cell that may hold a box.
BOX_CELL_M = 0.5
#: Radius of a search area: the floor's 0.5 m on one side, 0.2 m of the top on the other, from anywhere in a cell.
AREA_M = 0.75
#: Search areas of fewer points grow; they have these radii.
SCALES = np.array([1.0, 1.5, 2.5])
AREA_POINTS = 60

#: A kerb is higher than this many times the noise of its floor: grass is not.
LEAST_CLEAR_STEP = 1.5

#: The carriageway is the smoothest floor around, but for what a rough spot or a far scanner adds; and any
#: floor is as smooth as that of fresh asphalt under a fair scanner. [times, m]
ROUGHER_FLOOR, SMOOTH_FLOOR_M = 3.0, 0.006

#: Why there is no box.
BOX_FOUND, BOX_HOLE, BOX_NO_ROAD, BOX_ALL_ROAD, BOX_ELSEWHERE = 0, 1, 2, 3, 4
#: Columns of a box.
BOX_X, BOX_Y, BOX_Z, BOX_UX, BOX_UY, BOX_HALF_U, S_V, S_Z, S_U, SCORE, FORM, BOX_STEP, TOP_V, COUNT, START, BOX_END = (
    0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15,
)  # fmt: skip
COLUMNS = 16
KERB, EDGE, BARRIER = 2.0, 3.0, 4.0


@njit(cache=True, nogil=True)
def floor_near(
    facets: FloatArray, span: IntArray, x: float, y: float, slope: tuple[float, float], plane: FloatArray
) -> tuple[float, float]:
    """Choose the smoothest facet of the road's slope within the search area; write its plane at (x, y).

    Returns its rms distance, negative without any, and that of the smoothest facets around.
    """
    best, noise, usual = 1e9, -1.0, 0.0
    n_cols, n_rows = span[2] // 2, span[3] // 2
    c0, r0 = int(np.floor(x / BOX_CELL_M)) - span[0] // 2, int(np.floor(y / BOX_CELL_M)) - span[1] // 2
    for r in range(max(r0 - 2, 0), min(r0 + 3, n_rows)):
        for c in range(max(c0 - 2, 0), min(c0 + 3, n_cols)):
            f = facets[r * n_cols + c]
            if f[0] == 0.0:
                continue
            # A facet across a step is tilted as well as rough: over half of its width the tilt is worth
            tilt = (f[2] - slope[0]) ** 2 + (f[3] - slope[1]) ** 2
            cost = f[4] ** 2 + 0.15**2 * tilt
            if cost < best:
                best, noise, usual = cost, f[4], f[5]
                dx = x - (span[0] // 2 + c + 0.5) * BOX_CELL_M
                dy = y - (span[1] // 2 + r + 0.5) * BOX_CELL_M
                plane[0], plane[1], plane[2] = f[1] + f[2] * dx + f[3] * dy, f[2], f[3]
    return noise, usual


@njit(cache=True, nogil=True)
def roughness_limit(usual: float, limits: FloatArray) -> float:
    """Return how rough the floor of a place may be, where the smoothest floor around is known."""
    return float(min(limits[3], max(ROUGHER_FLOOR * usual, SMOOTH_FLOOR_M)))


@njit(cache=True, nogil=True)
def gather_area(
    points: FloatArray,
    starts: IntArray,
    span: IntArray,
    place: tuple[float, float],
    plane: FloatArray,
    work: FloatArray,
) -> tuple[int, float]:
    """Collect the points of the search area about a place, wider where they are few; return how many, and scale."""
    scale = SCALES[0]
    for k in range(len(SCALES)):
        scale = SCALES[k]
        if k == len(SCALES) - 1 or count_near(starts, span, place, AREA_M * scale) >= AREA_POINTS:
            break
    return gather_at(points, starts, span, place, AREA_M * scale, plane, ENOUGH_POINTS, work), scale


@njit(cache=True, nogil=True)
def chord_in_cell(x: float, y: float, ux: float, uy: float, half: float) -> tuple[float, float]:
    """Return from where to where (along u) a line is inside the square ``|x|, |y| <= half``; empty: 0, -1."""
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
    """Return the ground's slope east and north over 3 m."""
    x, y = place
    height, cell, west, north = ground
    east = ground_at(x + 1.5, y, cell, west, north, height) - ground_at(x - 1.5, y, cell, west, north, height)
    up = ground_at(x, y + 1.5, cell, west, north, height) - ground_at(x, y - 1.5, cell, west, north, height)
    return east / 3.0, up / 3.0
