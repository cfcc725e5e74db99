"""Kernels of what stands above the ground: small cubes that hold flat or scattered points, and lean columns of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from linework.arrays import AnyArray, Float32Array, FloatArray, IntArray

#: Side of a cube [m]: wider than a pole, and small enough that a hedge and a wall share few.
CUBE_M = 0.4
#: Labels of cubes.
NO_LABEL, STANDS_OTHER, STANDS_POLE, STANDS_LEAVES = range(4)
#: Fewest points whose scatter across their plane counts: three lie on any plane.
_LEAST_POINTS = 6
#: Points of one cube that count at most, so that near objects do not outvote far ones behind them. [points]
_MOST_VOTES = 30
#: Scatter over 3 x 3 x 3 cubes, where each holds too few points by itself, above which they are leaves [m]: walls and
#: roofs scatter by the noise alone.
_SPARSE_SCATTER_M = 0.12
#: A column is lean at a height where its 3 x 3 cubes hold points within this of their axis (standard deviation, m), and
#: the cubes around those at most this share of them.
_LEAN_M, _LEAN_SHARE = 0.15, 0.1
#: A pole is lean over this height [m], and over this share of its height; its foot is at most this high [m]: cars and
#: hedges hide it. Posts of guardrails and people are lower than the least top [m].
_POLE_M, _POLE_SHARE, _FOOT_M, _LEAST_TOP_M = 1.6, 0.6, 1.6, 2.0
#: Least height of a trunk. [cubes]
_TRUNK_CUBES = 2


class Cubes(NamedTuple):
    """Cubes that hold points, by column.

    Parameters
    ----------
    start, level
        Cubes of column i are at heights ``level[start[i]:start[i + 1]]``, rising; int32. Row 0 is south.
    label
        (n,) uint8.
    west, south, base
        Corner of the first column, and height of level 0. [m, world]
    n_rows, n_cols
        Shape of the columns.
    """

    start: AnyArray
    level: AnyArray
    label: AnyArray
    west: float
    south: float
    base: float
    n_rows: int
    n_cols: int


@njit(cache=True, nogil=True)
def cube_numbers(
    xyz: FloatArray, west: float, south: float, base: float, n_rows: int, n_cols: int, n_levels: int
) -> IntArray:
    """Return the number of the cube of each point, (n,) int64: those of a column are successive; -1 outside."""
    out = np.empty(len(xyz), dtype=np.int64)
    for i in range(len(xyz)):
        c = int(np.floor((xyz[i, 0] - west) / CUBE_M))
        r = int(np.floor((xyz[i, 1] - south) / CUBE_M))
        k = int(np.floor((xyz[i, 2] - base) / CUBE_M))
        is_inside = 0 <= c < n_cols and 0 <= r < n_rows and 0 <= k < n_levels
        out[i] = (r * n_cols + c) * n_levels + k if is_inside else -1
    return out


@njit(cache=True, nogil=True)
def cube_sums(
    xyz: FloatArray, number: IntArray, order: IntArray, west: float, south: float, base: float, n_cols: int,
    n_levels: int,
) -> tuple[IntArray, FloatArray]:  # fmt: skip
    """Return the number of each cube that holds points, (m,) int64, and sums over its points, (m, 10).

    The sums: points, x, y, z, xx, yy, zz, xy, xz, yz, from the middle of the cube. [m]

    Parameters
    ----------
    number, order
        (n,) numbers of `cube_numbers`, and the order in which they rise.
    """
    n = 0
    last = np.int64(-1)
    for i in order:
        if number[i] >= 0 and number[i] != last:
            n += 1
            last = number[i]
    cube, sums = np.empty(n, dtype=np.int64), np.zeros((n, 10))
    at, last = -1, np.int64(-1)
    for i in order:
        if number[i] < 0:
            continue
        if number[i] != last:
            at += 1
            last = number[i]
            cube[at] = last
        column, k = divmod(last, n_levels)
        r, c = divmod(column, n_cols)
        x = xyz[i, 0] - west - (c + 0.5) * CUBE_M
        y = xyz[i, 1] - south - (r + 0.5) * CUBE_M
        z = xyz[i, 2] - base - (k + 0.5) * CUBE_M
        s = sums[at]
        s[0] += 1.0
        s[1] += x
        s[2] += y
        s[3] += z
        s[4] += x * x
        s[5] += y * y
        s[6] += z * z
        s[7] += x * y
        s[8] += x * z
        s[9] += y * z
    return cube, sums


@njit(cache=True, nogil=True)
def labels_of_cubes(cubes: Cubes, sums: FloatArray, ground: Float32Array, flat_m: float) -> AnyArray:
    """Return the label of each cube, (m,) uint8: leaves, pole, or other.

    Parameters
    ----------
    cubes
        Cubes without labels yet.
    sums
        (m, 10) sums of `cube_sums`.
    ground
        (n_rows, n_cols) float32: level of the ground below each column, row 0 south. [cubes above base]
    flat_m
        Largest scatter of points across a flat surface: the noise. [m]
    """
    label = _leaves(cubes, sums, flat_m)
    found = label.copy()
    for r in range(2, cubes.n_rows - 2):
        for c in range(2, cubes.n_cols - 2):
            _mark_lean(cubes, sums, ground, label, found, r, c)
    return found


@njit(cache=True, nogil=True)
def _leaves(cubes: Cubes, sums: FloatArray, flat_m: float) -> AnyArray:
    """Return which cubes are of leaves, by the votes of the 3 x 3 x 3 cubes around each."""
    n = len(cubes.level)
    scatter = np.empty(n)
    for i in range(n):
        scatter[i] = scatter_across(sums[i]) if sums[i, 0] >= _LEAST_POINTS else -1.0
    label = np.full(n, STANDS_OTHER, dtype=np.uint8)
    pooled = np.empty(10)
    for r in range(cubes.n_rows):
        for c in range(cubes.n_cols):
            here = r * cubes.n_cols + c
            for i in range(cubes.start[here], cubes.start[here + 1]):
                leaves, all_votes = 0.0, 0.0
                pooled[:] = 0.0
                for dr in range(-1, 2):
                    for dc in range(-1, 2):
                        if not (0 <= r + dr < cubes.n_rows and 0 <= c + dc < cubes.n_cols):
                            continue
                        column = here + dr * cubes.n_cols + dc
                        for j in range(cubes.start[column], cubes.start[column + 1]):
                            dk = cubes.level[j] - cubes.level[i]
                            if dk < -1:
                                continue
                            if dk > 1:
                                break
                            if scatter[j] >= 0.0:
                                votes = min(sums[j, 0], _MOST_VOTES)
                                all_votes += votes
                                leaves += votes * (scatter[j] > flat_m)
                            _add_moved(pooled, sums[j], dc * CUBE_M, dr * CUBE_M, dk * CUBE_M)
                if all_votes > 0.0:
                    is_leaf = 2.0 * leaves > all_votes
                else:
                    is_leaf = pooled[0] >= _LEAST_POINTS and scatter_across(pooled) > _SPARSE_SCATTER_M
                if is_leaf:
                    label[i] = STANDS_LEAVES
    return label


@njit(cache=True, nogil=True)
def _mark_lean(
    cubes: Cubes, sums: FloatArray, ground: Float32Array, label: AnyArray, found: AnyArray, r: int, c: int
) -> None:
    """Label the cubes of the column at (r, c) and around it that are a pole or a trunk."""
    here = r * cubes.n_cols + c
    a, b = cubes.start[here], cubes.start[here + 1]
    if b - a < _TRUNK_CUBES:
        return
    # Only the fullest of neighbouring columns is looked at
    own = _points_of(sums, a, b)
    for dr in range(-1, 2):
        for dc in range(-1, 2):
            column = here + dr * cubes.n_cols + dc
            other = _points_of(sums, cubes.start[column], cubes.start[column + 1])
            if other > own or (other == own and column < here):
                return
    low, high = cubes.level[a], cubes.level[b - 1]
    is_lean = np.zeros(high - low + 1, dtype=np.bool_)
    n_lean, n_filled, n_lean_leaves, top = 0, 0, 0, low
    pooled = np.empty(10)
    for i in range(a, b):
        pooled[:] = 0.0
        around = 0.0
        for dr in range(-2, 3):
            for dc in range(-2, 3):
                j = _cube_at(cubes, here + dr * cubes.n_cols + dc, cubes.level[i])
                if j < 0:
                    continue
                if max(abs(dr), abs(dc)) == 2:
                    around += sums[j, 0]
                else:
                    _add_moved(pooled, sums[j], dc * CUBE_M, dr * CUBE_M, 0.0)
        n_filled += 1
        if around <= _LEAN_SHARE * pooled[0] and _widest(pooled) <= _LEAN_M:
            is_lean[cubes.level[i] - low] = True
            n_lean += 1
            top = cubes.level[i]
        elif label[i] == STANDS_LEAVES:
            n_lean_leaves += 1
    level = ground[r, c]
    is_pole = (
        n_lean * CUBE_M >= _POLE_M
        and n_lean >= _POLE_SHARE * n_filled
        and (low - level) * CUBE_M <= _FOOT_M
        and (top + 1 - level) * CUBE_M >= _LEAST_TOP_M
    )
    is_trunk = not is_pole and n_lean >= _TRUNK_CUBES and n_lean_leaves > n_lean
    if not (is_pole or is_trunk):
        return
    for dr in range(-1, 2):
        for dc in range(-1, 2):
            column = here + dr * cubes.n_cols + dc
            for j in range(cubes.start[column], cubes.start[column + 1]):
                k = cubes.level[j] - low
                # Beside its foot stand grass and rails
                is_foot = is_pole and dr == 0 and dc == 0 and cubes.level[j] <= top
                if 0 <= k < len(is_lean) and (is_lean[k] or is_foot):
                    found[j] = STANDS_POLE if is_pole else STANDS_LEAVES


@njit(cache=True, nogil=True)
def _points_of(sums: FloatArray, a: int, b: int) -> float:
    total = 0.0
    for i in range(a, b):
        total += sums[i, 0]
    return total


@njit(cache=True, nogil=True)
def _cube_at(cubes: Cubes, column: int, level: int) -> int:
    """Return the cube of a column at a level, -1 where there is none."""
    a, b = cubes.start[column], cubes.start[column + 1]
    while a < b:
        middle = (a + b) // 2
        if cubes.level[middle] < level:
            a = middle + 1
        else:
            b = middle
    is_there = a < cubes.start[column + 1] and cubes.level[a] == level
    return a if is_there else -1


@njit(cache=True, nogil=True)
def _add_moved(to: FloatArray, s: FloatArray, dx: float, dy: float, dz: float) -> None:
    """Add the sums of a cube whose middle is away by (dx, dy, dz)."""
    n = s[0]
    to[0] += n
    to[1] += s[1] + n * dx
    to[2] += s[2] + n * dy
    to[3] += s[3] + n * dz
    to[4] += s[4] + 2.0 * dx * s[1] + n * dx * dx
    to[5] += s[5] + 2.0 * dy * s[2] + n * dy * dy
    to[6] += s[6] + 2.0 * dz * s[3] + n * dz * dz
    to[7] += s[7] + dx * s[2] + dy * s[1] + n * dx * dy
    to[8] += s[8] + dx * s[3] + dz * s[1] + n * dx * dz
    to[9] += s[9] + dy * s[3] + dz * s[2] + n * dy * dz


@njit(cache=True, nogil=True)
def _widest(s: FloatArray) -> float:
    """Return the largest standard deviation of points in plan, from their sums [m]."""
    n = s[0]
    xx, yy = s[4] / n - (s[1] / n) ** 2, s[5] / n - (s[2] / n) ** 2
    xy = s[7] / n - s[1] * s[2] / n**2
    widest: float = np.sqrt(max(0.5 * (xx + yy) + np.sqrt(0.25 * (xx - yy) ** 2 + xy * xy), 0.0))
    return widest


@njit(cache=True, nogil=True)
def scatter_across(s: FloatArray) -> float:
    """Return the smallest standard deviation of points, across the plane that fits them best, from their sums [m]."""
    n = s[0]
    mx, my, mz = s[1] / n, s[2] / n, s[3] / n
    xx, yy, zz = s[4] / n - mx * mx, s[5] / n - my * my, s[6] / n - mz * mz
    xy, xz, yz = s[7] / n - mx * my, s[8] / n - mx * mz, s[9] / n - my * mz
    # Smallest root of the characteristic polynomial of a symmetric matrix, by its trigonometric form
    mean = (xx + yy + zz) / 3.0
    off = xy * xy + xz * xz + yz * yz
    a, b, c = xx - mean, yy - mean, zz - mean
    p = np.sqrt((a * a + b * b + c * c + 2.0 * off) / 6.0)
    if p < 1e-12:
        round_m: float = np.sqrt(max(mean, 0.0))
        return round_m
    half = (a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)) / (2.0 * p**3)
    angle = np.arccos(min(max(half, -1.0), 1.0)) / 3.0
    least: float = np.sqrt(max(mean + 2.0 * p * np.cos(angle + 2.0 * np.pi / 3.0), 0.0))
    return least
