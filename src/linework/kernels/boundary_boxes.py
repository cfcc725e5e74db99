"""Boundary boxes: for each cell of the lattice where its floor ends, if it ends in it.

Positions are local: from the survey's origin. [m]
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from linework.kernels import kerb_steps as ks
from linework.kernels.floor import FINE_M, ground_at
from linework.kernels.kerbs import CLEAR, best_step
from linework.kernels.profiles import ENOUGH_POINTS, MOST_POINTS, N_BINS, chord_in_cell, gather_at

F64 = npt.NDArray[np.float64]
F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]

#: Side of a cell that may hold a box.
CELL_M = 0.5
#: Radius of a search area: the floor's 0.5 m on one side, 0.2 m of the top on the other, from anywhere in a cell.
AREA_M = 0.75
#: Search areas of fewer points grow; they have these radii.
SCALES = np.array([1.0, 1.5, 2.5])
AREA_POINTS = 60

#: Why there is no box.
FOUND, HOLE, NO_ROAD, ALL_ROAD, ELSEWHERE = 0, 1, 2, 3, 4
#: Columns of a box.
X, Y, Z, UX, UY, HALF_U, S_V, S_Z, S_U, SCORE, FORM, STEP, TOP_V, COUNT, START, END = (
    0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15,
)  # fmt: skip
COLUMNS = 16
KERB, EDGE, BARRIER = 2.0, 3.0, 4.0


@njit(cache=True, nogil=True)
def floor_near(facets: F64, span: I64, x: float, y: float, slope: tuple[float, float], plane: F64) -> float:
    """Choose the smoothest facet of the road's slope within the search area; write its plane at (x, y).

    Returns its rms distance, negative without any.
    """
    best, noise = 1e9, -1.0
    c0, r0 = int(np.floor(x / FINE_M)) - span[0], int(np.floor(y / FINE_M)) - span[1]
    for r in range(max(r0 - 4, 0), min(r0 + 4, span[3])):
        for c in range(max(c0 - 4, 0), min(c0 + 4, span[2])):
            f = facets[r * span[2] + c]
            if f[0] == 0.0:
                continue
            # A facet across a step is tilted as well as rough: over half of its width the tilt is worth
            tilt = (f[2] - slope[0]) ** 2 + (f[3] - slope[1]) ** 2
            cost = f[4] ** 2 + 0.15**2 * tilt
            if cost < best:
                best, noise = cost, f[4]
                dx = x - (span[0] + c + 0.5) * FINE_M
                dy = y - (span[1] + r + 0.5) * FINE_M
                plane[0], plane[1], plane[2] = f[1] + f[2] * dx + f[3] * dy, f[2], f[3]
    return noise


@njit(cache=True, nogil=True)
def uphill(sums: F64, span: I64, x: float, y: float, plane: F64, noise: float) -> tuple[float, float, float]:
    """Return the direction in which the fine cells' mean heights leave the plane, and by how much they do.

    Cells within the search area; heights beyond 0.3 m count as 0.3 m.
    """
    c0, r0 = int(np.floor(x / FINE_M)) - span[0], int(np.floor(y / FINE_M)) - span[1]
    n, sx, sy, sr, xx, xy, yy, xr, yr = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    low, high = 1e9, -1e9
    for r in range(max(r0 - 3, 0), min(r0 + 3, span[3])):
        for c in range(max(c0 - 3, 0), min(c0 + 3, span[2])):
            s = sums[r * span[2] + c]
            if s[0] == 0.0:
                continue
            dx = s[1] / s[0] + (span[0] + c + 0.5) * FINE_M - x
            dy = s[2] / s[0] + (span[1] + r + 0.5) * FINE_M - y
            if dx * dx + dy * dy > AREA_M**2:
                continue
            d = min(max(s[3] / s[0] - plane[0] - plane[1] * dx - plane[2] * dy, -0.3), 0.3)
            w = min(s[0], 5.0)
            low, high = min(low, d + noise / np.sqrt(s[0])), max(high, d - noise / np.sqrt(s[0]))
            n += w
            sx += w * dx
            sy += w * dy
            sr += w * d
            xx += w * dx * dx
            xy += w * dx * dy
            yy += w * dy * dy
            xr += w * dx * d
            yr += w * dy * d
    if n < 6.0:
        return 0.0, 0.0, -1.0
    xx, xy, yy = xx - sx * sx / n, xy - sx * sy / n, yy - sy * sy / n
    xr, yr = xr - sx * sr / n, yr - sy * sr / n
    det = xx * yy - xy * xy
    if det <= 1e-9:
        return 0.0, 0.0, -1.0
    gx, gy = (xr * yy - yr * xy) / det, (yr * xx - xr * xy) / det
    return gx, gy, high - low


@njit(cache=True, nogil=True)
def box_in_cell(
    data: tuple[F64, I64, I64, F64, F64],
    place: tuple[float, float],
    slope: tuple[float, float],
    limits: F64,
    rooms: tuple[F64, F64, F64],
    box: F64,
) -> int:
    """Find where the floor ends in the cell about `place`; write the box, return FOUND or why there is none.

    data: points, starts, span, sums, facets. limits: least step, steepest floor against the road.
    rooms: work, sums of a profile, step: overwritten.
    """
    points, starts, span, cells, facets = data
    work, sums, step = rooms
    x, y = place
    plane, share, first = np.zeros(3), np.zeros(5), np.zeros(7)
    noise = floor_near(facets, span, x, y, slope, plane)
    if noise < 0.0:
        return HOLE
    gx, gy, rise = uphill(cells, span, x, y, plane, noise)
    if rise < 0.5 * limits[0]:
        return HOLE if rise < 0.0 else ALL_ROAD
    size = np.hypot(gx, gy)
    if size < 1e-6:
        return ALL_ROAD
    n, scale = 0, 1.0
    for k in range(len(SCALES)):
        scale = SCALES[k]
        n = gather_at(points, starts, span, place, AREA_M * scale, plane, ENOUGH_POINTS, work)
        if n >= AREA_POINTS:
            break
    if n < 12:
        return HOLE
    if not best_step(work, n, (-gx / size, -gy / size), scale, sums, first):
        return ALL_ROAD if first[2] < CLEAR else ELSEWHERE
    vx, vy, at = first[0], first[1], first[3]
    if first[5] - first[4] < 0.7 * limits[0]:
        return ALL_ROAD
    low, high = chord_in_cell(at * vx, at * vy, vy, -vx, 0.5 * CELL_M + 0.05)
    if high - low < 0.1:
        return ELSEWHERE
    # Once more about the middle of the piece in this cell
    mx, my = at * vx + 0.5 * (low + high) * vy, at * vy - 0.5 * (low + high) * vx
    plane[0] += plane[1] * mx + plane[2] * my
    n = gather_at(points, starts, span, (x + mx, y + my), 0.80 * scale, plane, MOST_POINTS, work)
    if not ks.measure_step(work, n, first, scale, step):
        return ALL_ROAD
    ks.filled_shares(work, n, step, scale, share)
    vx, vy, foot = step[ks.VX], step[ks.VY], step[ks.FOOT]
    low, high = chord_in_cell(mx + foot * vx, my + foot * vy, vy, -vx, 0.5 * CELL_M)
    if high - low < 0.05:
        return ELSEWHERE
    if not _is_kerb(step, share, slope, plane, limits):
        return NO_ROAD
    u = 0.5 * (low + high)
    box[X], box[Y] = x + mx + foot * vx + u * vy, y + my + foot * vy - u * vx
    # Exactly in its cell, whatever rounding does
    box[Z] = plane[0] + plane[1] * (box[X] - x - mx) + plane[2] * (box[Y] - y - my)
    box[Z] += step[ks.FLOOR_A] + step[ks.FLOOR_B] * u + step[ks.FLOOR_C] * foot
    box[UX], box[UY] = vy, -vx
    box[HALF_U] = max(min(share[3] - u, u - share[2], 0.5 * scale), 0.05)
    box[S_V], box[S_U] = step[ks.SIGMA_V], step[ks.SIGMA_U]
    box[S_Z] = 2.0 * step[ks.NOISE] / np.sqrt(step[ks.N_FLOOR])
    box[SCORE] = _score(step, share)
    box[FORM], box[STEP], box[TOP_V] = KERB, step[ks.HEIGHT], step[ks.TOP] - foot
    box[COUNT] = step[ks.N_FLOOR] + step[ks.N_TOP] + step[ks.N_FACE]
    return FOUND


@njit(cache=True, nogil=True)
def _is_kerb(step: F64, share: F64, slope: tuple[float, float], plane: F64, limits: F64) -> bool:
    """Return whether floor and top are what a kerb lies between."""
    h, vx, vy = step[ks.HEIGHT], step[ks.VX], step[ks.VY]
    tilt_x = plane[1] + step[ks.FLOOR_C] * vx + step[ks.FLOOR_B] * vy - slope[0]
    tilt_y = plane[2] + step[ks.FLOOR_C] * vy - step[ks.FLOOR_B] * vx - slope[1]
    # The road's slope is known from cells on both sides, 3 m apart, and holds part of the step
    level = np.hypot(tilt_x, tilt_y) <= limits[1] + h / 3.0
    high = limits[0] <= h <= limits[2] and h >= 1.5 * step[ks.NOISE] and h >= 4.0 * step[ks.SIGMA_H]
    smooth = step[ks.NOISE] <= limits[3] and step[ks.NOISE_TOP] <= max(limits[3], 0.35 * h)
    top = abs(step[ks.TOP_C] - step[ks.FLOOR_C]) <= 0.25
    seen = share[0] >= 0.6 and share[1] >= 0.5 and share[3] - share[2] > 0.15 and share[4] >= 0.25
    return bool(level and high and smooth and top and seen)


@njit(cache=True, nogil=True)
def _score(step: F64, share: F64) -> float:
    """Return how sure a kerb is: how far its step stands out of the noise, and how much of it is seen."""
    clear = step[ks.HEIGHT] / (3.0 * step[ks.NOISE] + 0.01)
    return float((1.0 - np.exp(-clear)) * share[4] ** 0.5 * (0.5 + 0.5 * share[0]) * (0.5 + 0.5 * share[1]))


@njit(cache=True, nogil=True)
def boxes_in_cells(
    data: tuple[F64, I64, I64, F64, F64],
    ground: tuple[F32, float, int, int],
    limits: F64,
) -> F64:
    """Return (n, COLUMNS) the boxes of all cells that hold points, by row from the south, then column.

    ground: height over the origin, its cell, first column and row after the last (from the origin).
    """
    starts, span = data[1], data[2]
    west, south = span[0] // 2, span[1] // 2
    east, north = (span[0] + span[2] + 1) // 2, (span[1] + span[3] + 1) // 2
    rooms = (np.empty((MOST_POINTS + 2, 5)), np.empty((N_BINS + 1, 8)), np.empty(ks.STEP_COLUMNS))
    out = np.empty((1024, COLUMNS))
    n = 0
    for row in range(south, north):
        for col in range(west, east):
            if not _holds_points(starts, span, row, col):
                continue
            place = (col + 0.5) * CELL_M, (row + 0.5) * CELL_M
            if n == len(out):
                out = np.concatenate((out, np.empty_like(out)))
            if box_in_cell(data, place, slope_at(place, ground), limits, rooms, out[n]) == FOUND:
                n += 1
    return out[:n]


@njit(cache=True, nogil=True)
def slope_at(place: tuple[float, float], ground: tuple[F32, float, int, int]) -> tuple[float, float]:
    """Return the ground's slope east and north over 3 m."""
    x, y = place
    height, cell, west, north = ground
    east = ground_at(x + 1.5, y, cell, west, north, height) - ground_at(x - 1.5, y, cell, west, north, height)
    up = ground_at(x, y + 1.5, cell, west, north, height) - ground_at(x, y - 1.5, cell, west, north, height)
    return east / 3.0, up / 3.0


@njit(cache=True, nogil=True)
def _holds_points(starts: I64, span: I64, row: int, col: int) -> bool:
    for r in range(max(2 * row - span[1], 0), min(2 * row - span[1] + 2, span[3])):
        c0, c1 = max(2 * col - span[0], 0), min(2 * col - span[0] + 2, span[2])
        if c1 > c0 and starts[r * span[2] + c1] > starts[r * span[2] + c0]:
            return True
    return False
