"""Kernels for the tiles of the plan view: sums over points per cell, four cells to one, the nearest known cell."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import AnyArray

#: Steps of the fixed-point sums of heights: integer sums do not depend on the order of the points. [1/m]
SUM_STEPS_PER_M = 1048576.0
#: Points within this height of the road belong to the ground: lower than the sill of a car. [m]
GROUND_M = 0.4
#: Points above this height do not hide the road: a lorry passes under them. [m]
OVERHEAD_ROAD_M = 4.5


@njit(cache=True, nogil=True)
def add_points(
    columns: tuple[AnyArray, ...],
    corner: tuple[float, float],
    cell_m: float,
    sums: tuple[AnyArray, ...],
) -> None:
    """Add points to the sums of their cells; points outside are left out.

    Parameters
    ----------
    columns
        (n,) each: x, y, z float32 [m]; height above the road float32 [m], NaN where unknown; intensity uint16.
    corner
        South-west corner of the cells, in the points' coordinates. [m]
    sums
        (n_rows, n_cols) each, row 0 north, written: number of points and of those on the ground (int32); sum of
        the heights of the latter in steps (int64); sum of their intensities, or of all where none is on the ground
        (int64); highest z [m]; highest height above the road that is not overhead, or the highest where all are
        (float32) [m]. See `no_sums`.
    """
    xs, ys, zs, aboves, intensities = columns
    count, on_ground, steps, bright, top, above = sums
    n_rows, n_cols = count.shape
    for i in range(len(xs)):
        col = int(np.floor((xs[i] - corner[0]) / cell_m))
        row = n_rows - 1 - int(np.floor((ys[i] - corner[1]) / cell_m))
        if col < 0 or col >= n_cols or row < 0 or row >= n_rows:
            continue
        count[row, col] += 1
        top[row, col] = max(top[row, col], zs[i])
        a = aboves[i]
        if abs(a) <= GROUND_M:
            if on_ground[row, col] == 0:
                bright[row, col] = 0
            on_ground[row, col] += 1
            steps[row, col] += np.int64(np.float64(zs[i]) * SUM_STEPS_PER_M)
            bright[row, col] += intensities[i]
        elif on_ground[row, col] == 0:
            bright[row, col] += intensities[i]
        old = above[row, col]
        if not old > -np.inf or (a <= OVERHEAD_ROAD_M and (a > old or old > OVERHEAD_ROAD_M)):
            above[row, col] = a if a == a else old
        elif a > old and old > OVERHEAD_ROAD_M:
            above[row, col] = a


def no_sums(n_rows: int, n_cols: int) -> tuple[AnyArray, ...]:
    """Return the sums over no points, six arrays (n_rows, n_cols) as `add_points` takes them."""
    shape = (n_rows, n_cols)
    whole = [np.zeros(shape, dtype) for dtype in (np.int32, np.int32, np.int64, np.int64)]
    return (*whole, *(np.full(shape, -np.inf, np.float32) for _ in range(2)))


@njit(cache=True, nogil=True)
def layers_of(sums: tuple[AnyArray, ...], cell_m: float) -> tuple[AnyArray, ...]:
    """Return the layers of the cells: density, ground, objects, height above the road, mean intensity.

    Parameters
    ----------
    sums
        Six arrays (n_rows, n_cols); see `add_points`.
    cell_m
        Side of a cell. [m]

    Returns
    -------
    density
        (n_rows, n_cols) float32; 0 in empty cells. [1/m2]
    ground, stands, over, shine
        (n_rows, n_cols) float32: height of the ground [m], height of what stands on it [m], height above the road
        [m], mean intensity; NaN in empty cells. Without points on the ground, its height is that of the highest
        point, and nothing stands on it.
    """
    count, on_ground, steps, bright, top, above = sums
    shape = count.shape
    density = np.zeros(shape, np.float32)
    ground, stands = np.full(shape, np.nan, np.float32), np.full(shape, np.nan, np.float32)
    over, shine = np.full(shape, np.nan, np.float32), np.full(shape, np.nan, np.float32)
    for r in range(shape[0]):
        for c in range(shape[1]):
            n, m = count[r, c], on_ground[r, c]
            if n == 0:
                continue
            density[r, c] = n / (cell_m * cell_m)
            ground[r, c] = steps[r, c] / (SUM_STEPS_PER_M * m) if m else top[r, c]
            stands[r, c] = top[r, c] - ground[r, c]
            shine[r, c] = bright[r, c] / (m if m else n)
            if above[r, c] > -np.inf:
                over[r, c] = above[r, c]
    return density, ground, stands, over, shine


@njit(cache=True, nogil=True)
def join_cells(
    child: tuple[AnyArray, ...],
    out: tuple[AnyArray, ...],
    first_row: int,
    first_col: int,
) -> None:
    """Merge each 2 x 2 cells of a child's layers into one cell of `out`, starting at a row and a column.

    Densities are averaged, ground heights and intensities weighted by density; of heights of objects the highest
    is kept. `child` and `out` are layers as `layers_of` returns them; `out` is written.
    """
    to_density, to_ground, to_stands, to_above, to_shine = out
    density, ground, stands, above, shine = child
    for r in range(density.shape[0] // 2):
        for c in range(density.shape[1] // 2):
            total, height, bright = 0.0, 0.0, 0.0
            top, over = -np.inf, -np.inf
            for k in range(4):
                i, j = 2 * r + k // 2, 2 * c + k % 2
                n = density[i, j]
                if n == 0:
                    continue
                total += n
                height += n * ground[i, j]
                bright += n * shine[i, j]
                top = max(top, ground[i, j] + stands[i, j])
                over = max(over, above[i, j])
            if total == 0.0:
                continue
            i, j = first_row + r, first_col + c
            to_density[i, j] = total / 4.0
            to_ground[i, j] = height / total
            to_stands[i, j] = top - to_ground[i, j]
            to_above[i, j] = over if over > -np.inf else np.nan
            to_shine[i, j] = bright / total


@njit(cache=True, nogil=True)
def nearest_known_index(is_known: AnyArray, reach: float) -> AnyArray:
    """Return the flat index of the nearest known cell of each cell, (n_rows, n_cols) int32, -1 beyond `reach`.

    Two passes that propagate the nearest cell from neighbour to neighbour (Danielsson 1980,
    doi:10.1016/0146-664X(80)90054-4): nearly always the nearest, else one hardly farther.

    Parameters
    ----------
    is_known
        (n_rows, n_cols) bool.
    reach
        Largest distance. [cells]
    """
    n_rows, n_cols = is_known.shape
    nearest = np.full((n_rows, n_cols), -1, np.int32)
    far = np.full((n_rows, n_cols), np.float32(reach * reach + 0.01), np.float32)
    for r in range(n_rows):
        for c in range(n_cols):
            if is_known[r, c]:
                nearest[r, c], far[r, c] = r * n_cols + c, 0.0
    for turn in range(2):
        step = 1 - 2 * turn
        for k in range(n_rows):
            r = k if turn == 0 else n_rows - 1 - k
            for m in range(n_cols):
                c = m if turn == 0 else n_cols - 1 - m
                _propagate(nearest, far, r, c, r - step, c - step)
                _propagate(nearest, far, r, c, r - step, c)
                _propagate(nearest, far, r, c, r - step, c + step)
                _propagate(nearest, far, r, c, r, c - step)
            for m in range(n_cols - 1, -1, -1):
                c = m if turn == 0 else n_cols - 1 - m
                _propagate(nearest, far, r, c, r, c + step)
    return nearest


@njit(cache=True, nogil=True)
def _propagate(nearest: AnyArray, far: AnyArray, r: int, c: int, from_r: int, from_c: int) -> None:
    """Take the nearest cell of a neighbour where it is nearer than the cell's own; `far` is squared."""
    n_rows, n_cols = nearest.shape
    if far[r, c] == 0.0 or from_r < 0 or from_r >= n_rows or from_c < 0 or from_c >= n_cols:
        return
    known = nearest[from_r, from_c]
    if known < 0:
        return
    d_row, d_col = known // n_cols - r, known % n_cols - c
    apart = np.float32(d_row * d_row + d_col * d_col)
    if apart < far[r, c]:
        nearest[r, c], far[r, c] = known, apart


@njit(cache=True, nogil=True)
def divided_by(x: AnyArray, y: AnyArray, values: AnyArray, level: AnyArray, node_m: float) -> AnyArray:
    """Return values divided by a level that is bilinear between the nodes of a square lattice, (n,) uint16.

    Parameters
    ----------
    x, y, values
        (n,) positions from the first node [m], and values.
    level
        (n_rows, n_cols) level at the nodes, row 0 at y = 0.
    node_m
        Distance of the nodes. [m]
    """
    n_rows, n_cols = level.shape
    out = np.empty(len(values), np.uint16)
    for i in range(len(values)):
        fx, fy = x[i] / node_m, y[i] / node_m
        c = min(max(int(fx), 0), n_cols - 2)
        r = min(max(int(fy), 0), n_rows - 2)
        a, b = fx - c, fy - r
        low = level[r, c] * (1.0 - a) + level[r, c + 1] * a
        high = level[r + 1, c] * (1.0 - a) + level[r + 1, c + 1] * a
        out[i] = np.uint16(min(values[i] / (low * (1.0 - b) + high * b), 65535.0))
    return out
