"""Points of walls, and the ground beside them without: most points of a narrow footway's cells are of the house behind it.

A wall is neither rough nor sloping ground: where two sides of the ground are compared, it is left out.

Positions are in metres from the survey's local origin.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.kernels.boundaries.profiles import (
    PLACE_INTENSITY,
    PLACE_R,
    PLACE_X,
    PLACE_Y,
    PLANE_EAST,
    PLANE_HEIGHT,
    PLANE_NORTH,
    FloorCells,
    count_near,
)
from linework.kernels.cells.floor import FINE_M, SPAN_COLS, SPAN_ROWS, SPAN_SOUTH, SPAN_WEST
from linework.kernels.cells.places import AREA_M, area_scale

#: Smallest difference of the heights in a fine cell with a wall: more than that of kerbs. [m]
WALL_RANGE_M = 0.30
#: Parts of a fine cell along each side: 5 cm, the spread of the points of a wall that stands upright and of its foot.
WALL_PARTS = 5
#: Fewest points of such a part; and spread of their heights: more than that of grass 0.3 m tall, 0.09 m. [m]
WALL_POINTS, WALL_SPREAD_M = 4, 0.10
#: A change of the ground at the foot of a wall lies this near to its points, and to those beside it. [m]
AT_FOOT_M = 0.05
#: Points of such a part over those of the parts of the ground around it: plants let through what a wall stops.
WALL_DENSER = 3.0
_WIDE = 3 * WALL_PARTS


@njit(cache=True, nogil=True)
def points_of_walls(points: FloatArray, starts: IntArray, span: IntArray) -> tuple[BoolArray, IntArray]:
    """Return which points (n,) are of walls, or lie beside their feet; and the number of others before each cell.

    points, starts, span: (n, 4), (cells + 1,) int64 and (4,) int64; see `linework.kernels.cells.floor.sort_by_cell`.
    """
    n_rows, n_cols = span[SPAN_ROWS], span[SPAN_COLS]
    is_wall, on_ground = np.zeros(len(points), dtype=np.bool_), np.zeros(len(starts), dtype=np.int64)
    tall = np.zeros((n_rows + 4, n_cols + 4), dtype=np.bool_)
    for k in range(n_rows * n_cols):
        if starts[k + 1] - starts[k] >= WALL_POINTS:
            low = high = points[starts[k], PLACE_R]
            for i in range(starts[k], starts[k + 1]):
                low, high = min(low, points[i, PLACE_R]), max(high, points[i, PLACE_R])
            tall[k // n_cols + 2, k % n_cols + 2] = high - low >= WALL_RANGE_M
    # Of three rows of cells at a time: points of each part, whether they are spread; parts on a level and their points
    wide = WALL_PARTS * (n_cols + 2)
    counts, is_spread = np.zeros((3, WALL_PARTS, wide)), np.zeros((3, WALL_PARTS, wide), dtype=np.bool_)
    level = np.zeros((3, n_cols + 2, 2))
    for r in range(-1, n_rows):
        upper = (r + 1) % 3
        counts[upper], is_spread[upper], level[upper] = 0.0, False, 0.0
        if r + 1 < n_rows and tall[r + 1 : r + 6].any():
            _fill_parts(points, starts, span, r + 1, counts[upper], is_spread[upper], level[upper])
        if r < 0 or not tall[r + 1 : r + 4].any():
            continue
        dense = np.zeros((_WIDE, _WIDE), dtype=np.bool_)
        for c in range(n_cols):
            k = r * n_cols + c
            if starts[k + 1] == starts[k] or not tall[r + 1 : r + 4, c + 1 : c + 4].any():
                continue
            n, n_level = 0.0, 0.0
            for i in range(3):
                for j in range(c, c + 3):
                    n, n_level = n + level[i, j, 0], n_level + level[i, j, 1]
            # Plants let through what a wall stops
            n_dense = 0
            for a in range(_WIDE):
                row = (r - 1 + a // WALL_PARTS) % 3, a % WALL_PARTS
                for b in range(_WIDE):
                    at = WALL_PARTS * c + b
                    dense[a, b] = (
                        is_spread[row[0], row[1], at]
                        and counts[row[0], row[1], at] * n_level >= WALL_DENSER * n
                    )
                    n_dense += dense[a, b]
            if n_dense > 1:
                _mark(points, (starts[k], starts[k + 1]), _corner(span, r, c), dense, is_wall)
    for k in range(n_rows * n_cols):
        on_ground[k + 1] = on_ground[k] + starts[k + 1] - starts[k]
        for i in range(starts[k], starts[k + 1]):
            on_ground[k + 1] -= is_wall[i]
    return is_wall, on_ground


@njit(cache=True, nogil=True)
def _fill_parts(
    points: FloatArray,
    starts: IntArray,
    span: IntArray,
    r: int,
    counts: FloatArray,
    is_spread: BoolArray,
    level: FloatArray,
) -> None:
    """Write what is known of the parts of a row of cells, each beginning one cell farther on."""
    n_cols = span[SPAN_COLS]
    sums = np.empty((WALL_PARTS, WALL_PARTS, 2))
    for c in range(n_cols):
        k, at = r * n_cols + c, WALL_PARTS * (c + 1)
        corner = _corner(span, r, c)
        sums[:] = 0.0
        for i in range(starts[k], starts[k + 1]):
            a, b = _part(points[i, PLACE_X], points[i, PLACE_Y], corner)
            z = points[i, PLACE_R] - points[starts[k], PLACE_R]
            counts[a, at + b] += 1.0
            sums[a, b, 0] += z
            sums[a, b, 1] += z * z
        for a in range(WALL_PARTS):
            for b in range(WALL_PARTS):
                n = counts[a, at + b]
                if n == 0.0:
                    continue
                square = sums[a, b, 1] / n - (sums[a, b, 0] / n) ** 2
                is_spread[a, at + b] = n >= WALL_POINTS and square >= WALL_SPREAD_M**2
                if not is_spread[a, at + b]:
                    level[c + 1, 0] += n
                    level[c + 1, 1] += 1.0


@njit(cache=True, nogil=True)
def _mark(
    points: FloatArray,
    which: tuple[int, int],
    corner: tuple[float, float],
    dense: BoolArray,
    is_wall: BoolArray,
) -> None:
    """Mark the points of a cell in or beside dense parts (15, 15) of it and of those around it.

    One such part alone is a plant that holds many points by chance.
    """
    upright = np.zeros_like(dense)
    for a in range(1, _WIDE - 1):
        for b in range(1, _WIDE - 1):
            upright[a, b] = dense[a, b] and np.count_nonzero(dense[a - 1 : a + 2, b - 1 : b + 2]) > 1
    for k in range(which[0], which[1]):
        a, b = _part(points[k, PLACE_X], points[k, PLACE_Y], corner)
        a, b = a + WALL_PARTS, b + WALL_PARTS
        is_wall[k] = upright[a - 1 : a + 2, b - 1 : b + 2].any()


@njit(cache=True, nogil=True)
def _corner(span: IntArray, r: int, c: int) -> tuple[float, float]:
    """Return the south-western corner of a cell. [m]"""  # noqa: D400
    return (span[SPAN_WEST] + c) * FINE_M, (span[SPAN_SOUTH] + r) * FINE_M


@njit(cache=True, nogil=True)
def _part(x: float, y: float, corner: tuple[float, float]) -> tuple[int, int]:
    """Return row and column of the part of a cell that a point lies in."""
    most = WALL_PARTS - 1
    a = int((y - corner[1]) * WALL_PARTS / FINE_M)
    b = int((x - corner[0]) * WALL_PARTS / FINE_M)
    return min(max(a, 0), most), min(max(b, 0), most)


@njit(cache=True, nogil=True)
def gather_ground(
    data: FloorCells,
    place: tuple[float, float],
    radius: float,
    plane: FloatArray,
    most: int,
    work: FloatArray,
) -> int:
    """Write the points around a place that are of no wall to `work`, and return their number.

    Arguments as for `linework.kernels.boundaries.profiles.gather_at`: without walls, the points are the same.
    """
    points, starts, span = data.points, data.starts, data.span
    px, py = place
    n_cols, n_rows = span[SPAN_COLS], span[SPAN_ROWS]
    c0 = max(int(np.floor((px - radius) / FINE_M)) - span[SPAN_WEST], 0)
    c1 = min(int(np.floor((px + radius) / FINE_M)) - span[SPAN_WEST], n_cols - 1)
    r0 = max(int(np.floor((py - radius) / FINE_M)) - span[SPAN_SOUTH], 0)
    r1 = min(int(np.floor((py + radius) / FINE_M)) - span[SPAN_SOUTH], n_rows - 1)
    if c0 > c1:
        return 0
    step = 1 + count_near(data.on_ground, span, place, radius) // most
    n, left = 0, step
    for r in range(r0, r1 + 1):
        for i in range(starts[r * n_cols + c0], starts[r * n_cols + c1 + 1]):
            if data.is_wall[i]:
                continue
            left -= 1
            if left > 0:
                continue
            left = step
            x, y = points[i, PLACE_X] - px, points[i, PLACE_Y] - py
            work[n, PLACE_X], work[n, PLACE_Y] = x, y
            work[n, PLACE_R] = (
                points[i, PLACE_R] - plane[PLANE_HEIGHT] - plane[PLANE_EAST] * x - plane[PLANE_NORTH] * y
            )
            work[n, PLACE_INTENSITY] = points[i, PLACE_INTENSITY]
            n += int(x * x + y * y <= radius * radius)
    return n


@njit(cache=True, nogil=True)
def has_wall(data: FloorCells, place: tuple[float, float], radius: float) -> bool:
    """Return whether points of a wall lie within `radius` [m] of a place (east, north)."""
    starts, span = data.starts, data.span
    if count_near(starts, span, place, radius) == count_near(data.on_ground, span, place, radius):
        return False
    n_cols = span[SPAN_COLS]
    c0 = max(int(np.floor((place[0] - radius) / FINE_M)) - span[SPAN_WEST], 0)
    c1 = min(int(np.floor((place[0] + radius) / FINE_M)) - span[SPAN_WEST], n_cols - 1)
    r0 = max(int(np.floor((place[1] - radius) / FINE_M)) - span[SPAN_SOUTH], 0)
    r1 = min(int(np.floor((place[1] + radius) / FINE_M)) - span[SPAN_SOUTH], span[SPAN_ROWS] - 1)
    for r in range(r0, r1 + 1):
        for i in range(starts[r * n_cols + c0], starts[r * n_cols + c1 + 1]):
            x, y = data.points[i, PLACE_X] - place[0], data.points[i, PLACE_Y] - place[1]
            if data.is_wall[i] and x * x + y * y <= radius * radius:
                return True
    return False


@njit(cache=True, nogil=True)
def gather_ground_area(
    data: FloorCells, place: tuple[float, float], plane: FloatArray, work: FloatArray, wanted: int, most: int
) -> tuple[int, float]:
    """Collect the points of the search area about a place that are of no wall; return their number and its radius.

    Arguments and radius as for `linework.kernels.cells.places.gather_area`.
    """
    scale = area_scale(data.on_ground, data.span, place, wanted)
    return gather_ground(data, place, AREA_M * scale, plane, most, work), scale
