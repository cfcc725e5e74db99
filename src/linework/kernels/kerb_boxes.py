"""A kerb's box in one cell: found, measured, and judged.

Positions are local: from the survey's origin. [m]
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from linework.kernels import kerb_steps as ks
from linework.kernels import places as at_place
from linework.kernels.floor import FINE_M
from linework.kernels.kerbs import CLEAR, best_step
from linework.kernels.places import (
    ALL_ROAD,
    AREA_M,
    CELL_M,
    ELSEWHERE,
    FOUND,
    HOLE,
    NO_ROAD,
    chord_in_cell,
    gather_area,
    roughest,
)
from linework.kernels.profiles import CLIP_M, MOST_POINTS, gather_at

F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

#: A kerb is higher than this many times the noise of its floor: grass is not.
LEAST_CLEAR = 1.5


@njit(cache=True, nogil=True)
def uphill(sums: F64, span: I64, x: float, y: float, plane: F64, noise: float) -> tuple[float, float, float]:
    """Return the direction in which the fine cells' mean heights leave the plane, and by how much they do.

    Cells within the search area; those over 0.3 m from the plane count for how far only.
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
            d = s[3] / s[0] - plane[0] - plane[1] * dx - plane[2] * dy
            w = min(s[0], 5.0) if abs(d) <= CLIP_M else 0.0
            low, high = min(low, d + 2.0 * noise / np.sqrt(s[0])), max(high, d - 2.0 * noise / np.sqrt(s[0]))
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
        return 0.0, 0.0, -2.0
    xx, xy, yy = xx - sx * sx / n, xy - sx * sy / n, yy - sy * sy / n
    xr, yr = xr - sx * sr / n, yr - sy * sr / n
    det = xx * yy - xy * xy
    if det <= 1e-9:
        return 0.0, 0.0, -2.0
    gx, gy = (xr * yy - yr * xy) / det, (yr * xx - xr * xy) / det
    return gx, gy, high - low


@njit(cache=True, nogil=True)
def kerb_in_cell(
    data: tuple[F64, I64, I64, F64, F64],
    place: tuple[float, float],
    floor: tuple[F64, float, float, float, float],
    limits: F64,
    rooms: tuple[F64, F64, F64],
    box: F64,
) -> int:
    """Find the foot of a kerb in the cell about `place`; write the box, return FOUND or why there is none.

    data: points, starts, span, sums, facets. floor: plane, its noise, the road's slopes, noise of the smoothest floor around. limits: see `_is_kerb`.
    rooms: work, sums of a profile, step: overwritten.
    """
    points, starts, span, cells, _ = data
    work, sums, step = rooms
    x, y = place
    share, first, plane = np.zeros(5), np.zeros(7), floor[0].copy()
    gx, gy, rise = uphill(cells, span, x, y, plane, floor[1])
    size = np.hypot(gx, gy)
    # Across a disc of radius R that a step h cuts in half the slope is 0.85 h / R; half of it off its middle
    least = 0.5 * max(limits[0], LEAST_CLEAR * floor[1])
    if rise < -1.0:
        return HOLE
    if rise < least or (rise < CLIP_M and size * AREA_M < 0.8 * least):
        return ALL_ROAD
    n, scale = gather_area(points, starts, span, place, plane, work)
    if n < 12:
        return HOLE
    found = size > 0.0 and best_step(work, n, (-gx / size, -gy / size), scale, sums, first)
    if rise >= 0.5 * CLIP_M:
        # Next to a car, a hedge or a wall the slope is not the kerb's: all ways round
        for k in range(8):
            if not found:
                turn = 0.25 * np.pi * k
                found = best_step(work, n, (np.cos(turn), np.sin(turn)), scale, sums, first)
    if not found:
        return ALL_ROAD if first[2] < CLEAR else ELSEWHERE
    if first[5] - first[4] < 0.7 * limits[0]:
        return ALL_ROAD
    vx, vy, v = first[0], first[1], first[3]
    low, high = chord_in_cell(v * vx, v * vy, vy, -vx, 0.5 * CELL_M + 0.05)
    if high - low < 0.1:
        return ELSEWHERE
    # Once more about the middle of the piece in this cell
    mx, my = v * vx + 0.5 * (low + high) * vy, v * vy - 0.5 * (low + high) * vx
    plane[0] += plane[1] * mx + plane[2] * my
    n = gather_at(points, starts, span, (x + mx, y + my), 0.80 * scale, plane, MOST_POINTS, work)
    if not ks.measure_step(work, n, first, scale, step):
        return ALL_ROAD
    ks.filled_shares(work, n, step, scale, share)
    vx, vy, foot = step[ks.VX], step[ks.VY], step[ks.FOOT]
    low, high = chord_in_cell(mx + foot * vx, my + foot * vy, vy, -vx, 0.5 * CELL_M)
    if high - low < 0.05:
        return ELSEWHERE
    if not _is_kerb(step, share, floor, limits):
        return NO_ROAD
    u = 0.5 * (low + high)
    dx, dy = foot * vx + u * vy, foot * vy - u * vx
    box[at_place.X], box[at_place.Y] = x + mx + dx, y + my + dy
    box[at_place.Z] = plane[0] + plane[1] * dx + plane[2] * dy + step[ks.FLOOR_A]
    box[at_place.Z] += step[ks.FLOOR_B] * u + step[ks.FLOOR_C] * foot
    box[at_place.UX], box[at_place.UY] = vy, -vx
    box[at_place.HALF_U] = max(min(share[3] - u, u - share[2], 0.5 * scale), 0.05)
    _write_step(step, share, box)
    return FOUND


@njit(cache=True, nogil=True)
def _write_step(step: F64, share: F64, box: F64) -> None:
    box[at_place.S_V], box[at_place.S_U] = step[ks.SIGMA_V], step[ks.SIGMA_U]
    box[at_place.S_Z] = 2.0 * step[ks.NOISE] / np.sqrt(step[ks.N_FLOOR])
    box[at_place.SCORE] = _score(step, share)
    box[at_place.FORM], box[at_place.STEP] = at_place.KERB, step[ks.HEIGHT]
    box[at_place.TOP_V] = step[ks.TOP] - step[ks.FOOT]
    box[at_place.COUNT] = step[ks.N_FLOOR] + step[ks.N_TOP] + step[ks.N_FACE]


@njit(cache=True, nogil=True)
def _is_kerb(step: F64, share: F64, floor: tuple[F64, float, float, float, float], limits: F64) -> bool:
    """Return whether floor and top are what a kerb lies between.

    limits: least step, steepest floor against the road, highest step, noise of the roughest floor.
    """
    plane = floor[0]
    h, vx, vy = step[ks.HEIGHT], step[ks.VX], step[ks.VY]
    tilt_x = plane[1] + step[ks.FLOOR_C] * vx + step[ks.FLOOR_B] * vy - floor[2]
    tilt_y = plane[2] + step[ks.FLOOR_C] * vy - step[ks.FLOOR_B] * vx - floor[3]
    # The road's slope is known from cells on both sides, 3 m apart, and holds part of the step
    level = np.hypot(tilt_x, tilt_y) <= limits[1] + h / 3.0
    high = limits[0] <= h <= limits[2] and h >= LEAST_CLEAR * step[ks.NOISE] and h >= 4.0 * step[ks.SIGMA_H]
    smooth = step[ks.NOISE] <= roughest(floor[4], limits) and step[ks.NOISE_TOP] <= max(limits[3], 0.35 * h)
    top = abs(step[ks.TOP_C] - step[ks.FLOOR_C]) <= 0.25
    seen = share[0] >= 0.6 and share[1] >= 0.5 and share[3] - share[2] > 0.15 and share[4] >= 0.25
    return bool(level and high and smooth and top and seen)


@njit(cache=True, nogil=True)
def _score(step: F64, share: F64) -> float:
    """Return how sure a kerb is: how far its step stands out of the noise, and how much of it is seen."""
    clear = step[ks.HEIGHT] / (3.0 * step[ks.NOISE] + 0.01)
    return float((1.0 - np.exp(-clear)) * share[4] ** 0.5 * (0.5 + 0.5 * share[0]) * (0.5 + 0.5 * share[1]))
