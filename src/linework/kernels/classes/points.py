"""Kernel of the class of each point of a tile.

Separate from `near_lines` and `standing`, which prepare a tile: this is called for every point of every file.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from linework.arrays import AnyArray, Float32Array, FloatArray, IntArray
from linework.kernels.classes.near_lines import (
    BARRIER_PIECE,
    BOUNDARY_PIECE,
    LEFT_IS_ROAD,
    MARKING_PIECE,
    PIECE_CELL_M,
    RIGHT_IS_ROAD,
    WIRE_PIECE,
    NearLines,
)
from linework.kernels.classes.standing import CUBE_M, STANDS_LEAVES, STANDS_POLE, Cubes

#: Classes, by the numbers of `linework.methods.classes.point_class.PointClass`.
_OTHER, _ROAD, _FOOTWAY, _VERGE, _MARKING, _KERB, _RAIL, _BARRIER, _WIRE, _POLE, _LEAVES = range(11)
#: Bits of a cell in plan: it is road; if not, or beyond a boundary, it is paved.
CELL_IS_ROAD, CELL_IS_PAVED = 1, 2
#: Points this far below and above the ground are on it [m]: the step of a kerb within a cell, grass, and noise.
_BELOW_M, STANDS_M = 0.30, 0.15
#: Nearer to a boundary than this, its side decides and not the cell, whose diagonal is 0.71 m. [m]
BESIDE_BOUNDARY_M = 0.75
#: A kerb's points lie from this far below its foot to its top: noise, and the gutter's fall. [m]
_KERB_BELOW_M = 0.05
#: A rail begins this high above the ground, and ends this far above its line: noise and the lip of the beam. [m]
_RAIL_FROM_M, _RAIL_OVER_M = 0.12, 0.08
#: Nearer than this to the edge of a barrier's top there is no ground, which cells of the ground cannot know. [m]
_INSIDE_M = 0.15


class PlanCells(NamedTuple):
    """Cells of the ground.

    Parameters
    ----------
    height
        (n_rows, n_cols) float32: the ground at the middle of each cell; row 0 is north. [m above zero]
    bits
        (n_rows, n_cols) uint8: road, paved.
    west, north, cell, zero
        Corner of the cells, their side, and zero of heights. [m, world]
    """

    height: Float32Array
    bits: AnyArray
    west: float
    north: float
    cell: float
    zero: float


@njit(cache=True, nogil=True)
def give_classes(
    xyz: FloatArray, intensity: Float32Array, index: IntArray, cells: PlanCells, near: NearLines, cubes: Cubes, out: AnyArray,
    line: AnyArray,
) -> None:  # fmt: skip
    """Write the class of points, (n,) uint8, to `out`, and the number of their lines, (n,) uint32, to `line`.

    Parameters
    ----------
    xyz, intensity
        (n, 3) points [m, world], and (n,) float32.
    index
        (k,) int64: those that are in this tile.
    """
    per_length2 = np.zeros(len(near.ends))
    for j in range(len(near.ends)):
        length2 = (near.ends[j, 3] - near.ends[j, 0]) ** 2 + (near.ends[j, 4] - near.ends[j, 1]) ** 2
        per_length2[j] = 1.0 / length2 if length2 > 0.0 else 0.0
    for i in index:
        x, y, z = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        h, bits = _over_ground(x, y, z, cells)
        kind, of = _on_lines(x, y, z, h, intensity[i], bits, near, per_length2)
        if kind < 0:
            kind = _ground(bits) if -_BELOW_M <= h <= STANDS_M else _standing(x, y, z, h, cubes)
        out[i] = kind
        line[i] = of


@njit(cache=True, nogil=True, inline="always")
def _over_ground(x: float, y: float, z: float, cells: PlanCells) -> tuple[float, int]:
    """Return the height of a point above the ground, bilinear between cells [m], and the bits of its cell."""
    n_rows, n_cols = cells.height.shape
    u, v = (x - cells.west) / cells.cell, (cells.north - y) / cells.cell
    bits = int(cells.bits[min(max(int(v), 0), n_rows - 1), min(max(int(u), 0), n_cols - 1)])
    u, v = min(max(u - 0.5, 0.0), n_cols - 1.0), min(max(v - 0.5, 0.0), n_rows - 1.0)
    c, r = max(min(int(u), n_cols - 2), 0), max(min(int(v), n_rows - 2), 0)
    c1, r1 = min(c + 1, n_cols - 1), min(r + 1, n_rows - 1)
    fx, fy = u - c, v - r
    top = cells.height[r, c] * (1.0 - fx) + cells.height[r, c1] * fx
    bottom = cells.height[r1, c] * (1.0 - fx) + cells.height[r1, c1] * fx
    return z - cells.zero - (top * (1.0 - fy) + bottom * fy), bits


@njit(cache=True, nogil=True, inline="always")
def _ground(bits: int) -> int:
    if bits & CELL_IS_ROAD:
        return _ROAD
    return _FOOTWAY if bits & CELL_IS_PAVED else _VERGE


@njit(cache=True, nogil=True, inline="always")
def _on_lines(
    x: float,
    y: float,
    z: float,
    h: float,
    intensity: float,
    bits: int,
    near: NearLines,
    per_length2: FloatArray,
) -> tuple[int, int]:
    """Return the class of a point on or beside a line, and the line's number; -1 and 0 if lines do not decide it."""
    c, r = int(np.floor((x - near.west) / PIECE_CELL_M)), int(np.floor((y - near.south) / PIECE_CELL_M))
    if c < 0 or r < 0 or c >= near.n_cols or r >= near.n_rows:
        return -1, 0
    at = r * near.n_cols + c
    is_low = -_BELOW_M <= h <= STANDS_M
    stands, stands_at, edge, edge_at, paint, paint_at = -1, 1e9, -1, BESIDE_BOUNDARY_M**2, -1, 1e9
    edge_t = 0.0
    for j in near.item[near.start[at] : near.start[at + 1]]:
        kind = near.kind[j]
        if kind <= MARKING_PIECE and not is_low:
            continue
        # Squares of distances are compared: most pieces of a cell are not near, and need no root
        ax, ay = near.ends[j, 0], near.ends[j, 1]
        ux, uy = near.ends[j, 3] - ax, near.ends[j, 4] - ay
        free = ((x - ax) * ux + (y - ay) * uy) * per_length2[j]
        t = min(max(free, 0.0), 1.0)
        dx, dy = x - ax - t * ux, y - ay - t * uy
        d2 = dx * dx + dy * dy
        if kind == BOUNDARY_PIECE:
            if d2 < edge_at:
                edge, edge_at, edge_t = j, d2, t
            continue
        if d2 > near.reach[j] * near.reach[j]:
            continue
        level = near.ends[j, 2] + t * (near.ends[j, 5] - near.ends[j, 2])
        if kind == MARKING_PIECE:
            if d2 < paint_at and free == t and intensity >= near.least[j]:
                paint, paint_at = j, d2
        elif kind == WIRE_PIECE:
            d2 += (z - level) ** 2
            if d2 <= near.reach[j] * near.reach[j] and d2 < stands_at:
                stands, stands_at = j, d2
        elif d2 < stands_at and z <= level + _RAIL_OVER_M:
            is_inside = kind == BARRIER_PIECE and d2 <= _INSIDE_M**2 and h >= -_BELOW_M
            if is_inside or h >= _RAIL_FROM_M:
                stands, stands_at = j, d2
    if stands >= 0:
        kind = near.kind[stands]
        return _WIRE if kind == WIRE_PIECE else (_BARRIER if kind == BARRIER_PIECE else _RAIL), near.number[
            stands
        ]
    is_road = (bits & CELL_IS_ROAD) > 0
    is_edge = edge >= 0 and near.sides[edge] > 0
    if is_edge:
        sides = near.sides[edge]
        ax, ay = near.ends[edge, 0], near.ends[edge, 1]
        edge_side = (near.ends[edge, 3] - ax) * (y - ay) - (near.ends[edge, 4] - ay) * (x - ax)
        is_road = (sides & (LEFT_IS_ROAD if edge_side > 0.0 else RIGHT_IS_ROAD)) > 0
        foot = near.ends[edge, 2] + edge_t * (near.ends[edge, 5] - near.ends[edge, 2])
        is_kerb = edge_at <= near.reach[edge] * near.reach[edge] and z >= foot - _KERB_BELOW_M
        if not is_road and is_kerb:
            return _KERB, near.number[edge]
    if paint >= 0 and is_road:
        return _MARKING, near.number[paint]
    if is_edge:
        return _ground(bits | CELL_IS_ROAD if is_road else bits & ~CELL_IS_ROAD), 0
    return -1, 0


@njit(cache=True, nogil=True, inline="always")
def _standing(x: float, y: float, z: float, h: float, cubes: Cubes) -> int:
    """Return the class of a point above the ground by the cube it is in."""
    c, r = int(np.floor((x - cubes.west) / CUBE_M)), int(np.floor((y - cubes.south) / CUBE_M))
    # Not below the ground, nor where its height is not known
    if not h > 0.0 or c < 0 or r < 0 or c >= cubes.n_cols or r >= cubes.n_rows:
        return _OTHER
    column = r * cubes.n_cols + c
    level = int(np.floor((z - cubes.base) / CUBE_M))
    a, b = cubes.start[column], cubes.start[column + 1]
    while a < b:
        middle = (a + b) // 2
        if cubes.level[middle] < level:
            a = middle + 1
        else:
            b = middle
    if a >= cubes.start[column + 1] or cubes.level[a] != level:
        return _OTHER
    label = cubes.label[a]
    return _POLE if label == STANDS_POLE else (_LEAVES if label == STANDS_LEAVES else _OTHER)
