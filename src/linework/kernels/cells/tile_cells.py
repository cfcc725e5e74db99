"""Cells of the plan view's tiles: sums over points, four cells to one, the nearest cell that is known."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import AnyArray

#: Steps of the fixed-point sums of heights [1/m]: whole numbers add up to the same in any order of the points.
SUM_STEPS_PER_M = 1048576.0
#: A point so near to the road's height belongs to the ground: lower than the sill of a car. [m]
GROUND_M = 0.4
#: What a lorry passes under does not hide the road. [m]
OVERHEAD_ROAD_M = 4.5


@njit(cache=True, nogil=True)
def add_points(
    columns: tuple[AnyArray, ...],
    corner: tuple[float, float],
    cell_m: float,
    sums: tuple[AnyArray, ...],
) -> None:
    """Add points to the cells they lie in; those outside are passed over.

    Parameters
    ----------
    columns
        (n,) each: x, y, z float32 [m]; above the road float32 [m], NaN where it is not known; intensity uint16.
    corner
        South-west corner of the cells, in the points' coordinates. [m]
    sums
        (n_rows, n_cols) each, row 0 north: points, points on the ground (int32), their height in steps (int64), sum
        of their intensity or of all where none is on the ground (int64), highest z and highest above the road
        that is not overhead, where all is, the highest (float32). See `no_sums`.
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
    """Return sums over no points, as `add_points` takes them."""
    shape = (n_rows, n_cols)
    whole = [np.zeros(shape, dtype) for dtype in (np.int32, np.int32, np.int64, np.int64)]
    return (*whole, *(np.full(shape, -np.inf, np.float32) for _ in range(2)))


@njit(cache=True, nogil=True)
def layers_of(sums: tuple[AnyArray, ...], cell_m: float) -> tuple[AnyArray, ...]:
    """Return density [1/m2], ground height, height of what stands on it, height above the road [m], mean intensity.

    (n_rows, n_cols) float32 each; density 0 and NaN where no point is. Where no point is on the ground, its height
    is that of the highest, and nothing stands on it.
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
    """Join four cells each of a child's layers into one of `out`, from a row and a column on.

    Densities are averaged; heights of the ground and intensities by density; of what stands, the highest is kept.
    """
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
            out[0][i, j] = total / 4.0
            out[1][i, j] = height / total
            out[2][i, j] = top - out[1][i, j]
            out[3][i, j] = over if over > -np.inf else np.nan
            out[4][i, j] = bright / total


@njit(cache=True, nogil=True)
def nearest_known_index(is_known: AnyArray, reach: float) -> AnyArray:
    """Return the flat index of the nearest known cell of each cell within a reach in cells, -1 where none is.

    Two passes that hand on the nearest from neighbour to neighbour (Danielsson 1980,
    doi:10.1016/0146-664X(80)90054-4): nearly always the nearest, else one hardly farther.
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
                _hand_on(nearest, far, r, c, r - step, c - step)
                _hand_on(nearest, far, r, c, r - step, c)
                _hand_on(nearest, far, r, c, r - step, c + step)
                _hand_on(nearest, far, r, c, r, c - step)
            for m in range(n_cols - 1, -1, -1):
                c = m if turn == 0 else n_cols - 1 - m
                _hand_on(nearest, far, r, c, r, c + step)
    return nearest


@njit(cache=True, nogil=True)
def _hand_on(nearest: AnyArray, far: AnyArray, r: int, c: int, from_r: int, from_c: int) -> None:
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
    """Return (n,) uint16 values over the level where they lie, between nodes on a square lattice from 0, 0."""
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
