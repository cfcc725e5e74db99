"""Points near the ground, sorted into the cells of a survey's lattice, and the facets that they make there.

A facet is the plane through the points of a few cells: height, slopes, and how far the points lie from it.
Positions are local: from the survey's origin. [m]
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import BoolArray, Float32Array, FloatArray, IntArray

#: Side of a fine cell: half of a cell that may hold a box. [m]
FINE_M = 0.25
#: A facet of fewer points takes one more ring of cells, up to this many. A plane has three unknowns.
FACET_POINTS, FACET_RINGS = 9, 3
#: Cells of two fine ones, 3 m.
FACETS_AROUND = 6


@njit(cache=True, nogil=True)
def ground_at(x: float, y: float, cell: float, west: int, north: int, ground: Float32Array) -> float:
    """Return the ground's height, bilinear between cell centres; cells are counted from the origin."""
    n_rows, n_cols = ground.shape
    gx, gy = x / cell - 0.5, y / cell - 0.5
    c, r = int(np.floor(gx)), int(np.floor(gy))
    fx, fy = gx - c, gy - r
    c, r = c - west, north - 1 - r
    c0, c1 = min(max(c, 0), n_cols - 1), min(max(c + 1, 0), n_cols - 1)
    r0, r1 = min(max(r, 0), n_rows - 1), min(max(r - 1, 0), n_rows - 1)
    below = ground[r0, c0] * (1.0 - fx) + ground[r0, c1] * fx
    above = ground[r1, c0] * (1.0 - fx) + ground[r1, c1] * fx
    return float(below * (1.0 - fy) + above * fy)


@njit(cache=True, nogil=True)
def cells_near_ground(
    xyz: FloatArray,
    origin: FloatArray,
    cell: float,
    west: int,
    north: int,
    ground: Float32Array,
    near: BoolArray,
    band: tuple[float, float],
) -> tuple[IntArray, IntArray, IntArray]:
    """Return each point's fine cell (col, row from the origin; col -2**62: not wanted), and their ranges.

    Wanted are points in cells that are `near`, with a height over the ground inside the band.

    Parameters
    ----------
    ground
        (rows, cols): height over the origin, cells of `cell` from column `west`, rows down from `north`.

    Returns
    -------
    col, row
        (n,).
    span
        (4,): first column, first row, number of columns and rows; numbers are 0 without points.
    """
    col, row = np.empty(len(xyz), dtype=np.int64), np.empty(len(xyz), dtype=np.int64)
    n_rows, n_cols = near.shape
    low_c, low_r, high_c, high_r = 2**62, 2**62, -(2**62), -(2**62)
    for i in range(len(xyz)):
        col[i] = -(2**62)
        x, y, z = xyz[i, 0] - origin[0], xyz[i, 1] - origin[1], xyz[i, 2] - origin[2]
        c, r = int(np.floor(x / cell)) - west, north - 1 - int(np.floor(y / cell))
        if r < 0 or r >= n_rows or c < 0 or c >= n_cols or not near[r, c]:
            continue
        above = z - ground_at(x, y, cell, west, north, ground)
        if above < band[0] or above > band[1]:
            continue
        c, r = int(np.floor(x / FINE_M)), int(np.floor(y / FINE_M))
        col[i], row[i] = c, r
        low_c, low_r, high_c, high_r = min(low_c, c), min(low_r, r), max(high_c, c), max(high_r, r)
    if low_c > high_c:
        return col, row, np.zeros(4, dtype=np.int64)
    # Whole cells of two fine ones
    low_c, low_r = 2 * (low_c // 2), 2 * (low_r // 2)
    return (
        col,
        row,
        np.array([low_c, low_r, 2 * ((high_c - low_c) // 2 + 1), 2 * ((high_r - low_r) // 2 + 1)]),
    )


@njit(cache=True, nogil=True)
def sort_by_cell(
    xyz: FloatArray, strength: Float32Array, origin: FloatArray, col: IntArray, row: IntArray, span: IntArray
) -> tuple[FloatArray, IntArray, IntArray]:
    """Return the wanted points (x, y, z, strength) by fine cell, where they were, and the cells' starts; stable.

    Cells are row-major from the south-west of `span`.
    """
    n_cols = span[2]
    starts = np.zeros(n_cols * span[3] + 1, dtype=np.int64)
    for i in range(len(col)):
        if col[i] != -(2**62):
            starts[(row[i] - span[1]) * n_cols + col[i] - span[0] + 1] += 1
    for b in range(len(starts) - 1):
        starts[b + 1] += starts[b]
    fill = starts[:-1].copy()
    points = np.empty((starts[-1], 4))
    source = np.empty(starts[-1], dtype=np.int64)
    for i in range(len(col)):
        if col[i] == -(2**62):
            continue
        b = (row[i] - span[1]) * n_cols + col[i] - span[0]
        at = fill[b]
        fill[b] += 1
        for k in range(3):
            points[at, k] = xyz[i, k] - origin[k]
        points[at, 3] = strength[i]
        source[at] = i
    return points, source, starts


@njit(cache=True, nogil=True)
def cell_sums(points: FloatArray, starts: IntArray, span: IntArray) -> FloatArray:
    """Return (cells, 11) sums over the points of each fine cell, x and y from its centre.

    Columns: 1, x, y, z, xx, xy, yy, xz, yz, zz, strength.
    """
    sums = np.zeros((len(starts) - 1, 11))
    n_cols = span[2]
    for b in range(len(starts) - 1):
        x0, y0 = (span[0] + b % n_cols + 0.5) * FINE_M, (span[1] + b // n_cols + 0.5) * FINE_M
        s = sums[b]
        for i in range(starts[b], starts[b + 1]):
            x, y, z = points[i, 0] - x0, points[i, 1] - y0, points[i, 2]
            s[0] += 1.0
            s[1] += x
            s[2] += y
            s[3] += z
            s[4] += x * x
            s[5] += x * y
            s[6] += y * y
            s[7] += x * z
            s[8] += y * z
            s[9] += z * z
            s[10] += points[i, 3]
    return sums


@njit(cache=True, nogil=True)
def plane_of(s: FloatArray) -> tuple[float, float, float, float]:
    """Return height at x = y = 0, slopes, and rms distance of the plane through the points of sums `s`.

    Distance NaN: the points lie on a line.
    """
    n = s[0]
    mx, my, mz = s[1] / n, s[2] / n, s[3] / n
    xx, xy, yy = s[4] / n - mx * mx, s[5] / n - mx * my, s[6] / n - my * my
    xz, yz, zz = s[7] / n - mx * mz, s[8] / n - my * mz, s[9] / n - mz * mz
    det = xx * yy - xy * xy
    # A scan line alone: its points spread less than 2 cm to its sides
    if not det > 4e-4 * max(xx, yy):
        return mz, 0.0, 0.0, np.nan
    a, b = (xz * yy - yz * xy) / det, (yz * xx - xz * xy) / det
    left = max(zz - a * xz - b * yz, 0.0)
    return mz - a * mx - b * my, a, b, np.sqrt(left * n / max(n - 3.0, 1.0))


@njit(cache=True, nogil=True)
def facets_of(sums: FloatArray, span: IntArray) -> FloatArray:
    """Return (cells of two fine ones, 6) the facet at each cell's middle: points, height, slopes, rms distance.

    The last column is the rms distance of the smoothest facet within 3 m. Facets are 1 m wide, more where the
    points are few. Without enough, or without any in the cell: 0 points.
    """
    n_cols, n_rows = span[2], span[3]
    out = np.zeros((len(sums) // 4, 6))
    s = np.empty(10)
    for k in range(len(out)):
        r, c = 2 * (k // (n_cols // 2)), 2 * (k % (n_cols // 2))
        at = r * n_cols + c
        if sums[at, 0] + sums[at + 1, 0] + sums[at + n_cols, 0] + sums[at + n_cols + 1, 0] == 0.0:
            continue
        for ring in range(1, FACET_RINGS + 1):
            s[:] = 0.0
            for i in range(max(r - ring, 0), min(r + ring + 2, n_rows)):
                for j in range(max(c - ring, 0), min(c + ring + 2, n_cols)):
                    _add_shifted(s, sums[i * n_cols + j], (j - c - 0.5) * FINE_M, (i - r - 0.5) * FINE_M)
            if s[0] >= FACET_POINTS:
                break
        if s[0] >= FACET_POINTS:
            z, a, b, rms = plane_of(s)
            if rms == rms:
                out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4] = s[0], z, a, b, rms
    _smoothest_near(out, n_rows // 2, n_cols // 2)
    return out


@njit(cache=True, nogil=True)
def _smoothest_near(facets: FloatArray, n_rows: int, n_cols: int) -> None:
    """Write each facet's last column: the least rms distance within `FACETS_AROUND` cells, rows before columns."""
    least = np.full((n_rows, n_cols), np.inf)
    for r in range(n_rows):
        for c in range(n_cols):
            if facets[r * n_cols + c, 0] == 0.0:
                continue
            rms = facets[r * n_cols + c, 4]
            for j in range(max(c - FACETS_AROUND, 0), min(c + FACETS_AROUND + 1, n_cols)):
                least[r, j] = min(least[r, j], rms)
    for r in range(n_rows):
        for i in range(max(r - FACETS_AROUND, 0), min(r + FACETS_AROUND + 1, n_rows)):
            for c in range(n_cols):
                at = r * n_cols + c
                facets[at, 5] = (
                    least[i, c] if i == max(r - FACETS_AROUND, 0) else min(facets[at, 5], least[i, c])
                )


@njit(cache=True, nogil=True)
def _add_shifted(s: FloatArray, t: FloatArray, dx: float, dy: float) -> None:
    """Add sums `t`, taken about a centre that lies at (dx, dy), to `s`."""
    n = t[0]
    if n == 0.0:
        return
    s[0] += n
    s[1] += t[1] + n * dx
    s[2] += t[2] + n * dy
    s[3] += t[3]
    s[4] += t[4] + 2.0 * dx * t[1] + n * dx * dx
    s[5] += t[5] + dx * t[2] + dy * t[1] + n * dx * dy
    s[6] += t[6] + 2.0 * dy * t[2] + n * dy * dy
    s[7] += t[7] + dx * t[3]
    s[8] += t[8] + dy * t[3]
    s[9] += t[9]
