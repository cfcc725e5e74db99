"""Kernels that sort points near the ground into fine cells and fit a facet, a local plane, to each cell.

A facet is the plane through the points of a few cells: height, slopes, and rms distance of the points.
Positions are local: from the survey's origin. [m]
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import BoolArray, Float32Array, FloatArray, IntArray, zeros_on_demand

#: Side of a fine cell: half of a cell that may hold a box. [m]
FINE_M = 0.25
#: Fewest points of a facet, whose plane has three unknowns; with fewer it takes one more ring of cells, up to so
#: many rings.
FACET_POINTS, FACET_RINGS = 9, 3
#: Reach of the search for the smoothest facet around: 3 m. [cells of two fine ones]
FACETS_AROUND = 6
#: Of the facets of an even surface within that reach, some forty of 1 m that share no points, the smoothest lies this many
#: standard deviations below their mean, as often farther as nearer.
_SMOOTHEST_DEVIATION = 2.13
#: Column number of a point that belongs to no cell.
NO_CELL = -(2**62)
#: A scan line alone spans no plane: its points spread less than 2 cm to its sides. [m2]
_LEAST_SPREAD_M2 = 4e-4

#: Columns of the sums over the points of a fine cell: number, x, y, z, their products, and strength.
SUM_N, SUM_X, SUM_Y, SUM_Z, SUM_XX, SUM_XY, SUM_YY, SUM_XZ, SUM_YZ, SUM_ZZ, SUM_STRENGTH = range(11)
#: Number of these columns; the plane of a facet needs all but the last.
SUM_COLUMNS, _PLANE_SUMS = 11, 10
#: Columns of a facet: points, height [m], slopes east and north, rms distance [m], noise of the smoothest around [m].
FACET_N, FACET_HEIGHT, FACET_EAST, FACET_NORTH, FACET_RMS, FACET_SMOOTHEST = range(6)
#: Number of these columns.
FACET_COLUMNS = 6
#: Elements of a range of fine cells: first column, first row, number of columns, number of rows.
SPAN_WEST, SPAN_SOUTH, SPAN_COLS, SPAN_ROWS = range(4)


@njit(cache=True, nogil=True)
def ground_at(x: float, y: float, cell: float, west: int, north: int, ground: Float32Array) -> float:
    """Return the height of the ground at (x, y), bilinear between cell centres. [m, from the origin].

    Parameters
    ----------
    x, y
        Position. [m, from the origin]
    cell, west, north
        Side of a cell [m]; column of the first cell, row number of the northern edge, from the origin [cells].
    ground
        (rows, cols) float32 heights, north up. [m]
    """
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
    """Return the fine cell of each point near the ground, and the range of these cells.

    Parameters
    ----------
    xyz
        (n, 3) points. [m, world]
    origin
        (3,) origin of the survey. [m, world]
    cell, west, north, ground
        See `ground_at`.
    near
        (rows, cols) bool: cells whose points are wanted.
    band
        Lowest and highest height over the ground of wanted points. [m]

    Returns
    -------
    col, row
        (n,) int64 fine cell, counted from the origin; column `NO_CELL` where the point is not wanted.
    span
        (4,) int64, elements `SPAN_WEST` to `SPAN_ROWS`; whole cells of two fine ones; 0 without points.
    """
    col, row = np.empty(len(xyz), dtype=np.int64), np.empty(len(xyz), dtype=np.int64)
    n_rows, n_cols = near.shape
    low_c, low_r, high_c, high_r = 2**62, 2**62, -(2**62), -(2**62)
    for i in range(len(xyz)):
        col[i] = NO_CELL
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
    """Sort the wanted points by fine cell, row-major from the south-west of `span`; stable.

    Parameters
    ----------
    xyz, strength
        (n, 3) points [m, world] and (n,) float32 normalised intensity.
    origin
        (3,) origin of the survey. [m, world]
    col, row, span
        As `cells_near_ground` returns them.

    Returns
    -------
    points
        (k, 4) x, y, z from the origin [m] and strength.
    source
        (k,) int64: which of the n points each is.
    starts
        (cells + 1,) int64: where each cell's points begin.
    """
    n_cols = span[SPAN_COLS]
    starts = np.zeros(n_cols * span[SPAN_ROWS] + 1, dtype=np.int64)
    for i in range(len(col)):
        if col[i] != NO_CELL:
            starts[(row[i] - span[SPAN_SOUTH]) * n_cols + col[i] - span[SPAN_WEST] + 1] += 1
    for b in range(len(starts) - 1):
        starts[b + 1] += starts[b]
    fill = starts[:-1].copy()
    points = np.empty((starts[-1], 4))
    source = np.empty(starts[-1], dtype=np.int64)
    for i in range(len(col)):
        if col[i] == NO_CELL:
            continue
        b = (row[i] - span[SPAN_SOUTH]) * n_cols + col[i] - span[SPAN_WEST]
        at = fill[b]
        fill[b] += 1
        for k in range(3):
            points[at, k] = xyz[i, k] - origin[k]
        points[at, 3] = strength[i]
        source[at] = i
    return points, source, starts


def cell_sums(points: FloatArray, starts: IntArray, span: IntArray) -> FloatArray:
    """Return the sums over the points of each fine cell, (cells, 11), x and y from its centre.

    Columns `SUM_N` to `SUM_STRENGTH`; the arguments are what `sort_by_cell` returns, and its `span`.
    """
    # Most cells of a bent road's rectangle are empty
    sums = zeros_on_demand((len(starts) - 1, SUM_COLUMNS))
    write_sums(points, starts, span, sums)
    return sums


def sums_without(
    sums: FloatArray,
    points: FloatArray,
    starts: IntArray,
    span: IntArray,
    left_out: BoolArray,
    starts_without: IntArray,
) -> FloatArray:
    """Return the sums of fine cells (cells, 11) as `cell_sums` does, without some of the points.

    Parameters
    ----------
    sums
        (cells, 11) of all points, as `cell_sums` returns them; returned as they are where no point is left out.
    points, starts, span
        As for `cell_sums`.
    left_out
        (n,): which points are left out.
    starts_without
        (cells + 1,) int64: the number of points before each cell that are not.
    """
    if starts_without[-1] == starts[-1]:
        return sums
    out = zeros_on_demand(sums.shape)
    write_sums_without(sums, points, starts, span, left_out, starts_without, out)
    return out


@njit(cache=True, nogil=True)
def write_sums(points: FloatArray, starts: IntArray, span: IntArray, out: FloatArray) -> None:
    """Write the sums over the points of the fine cells that have any to (cells, 11) zeros; see `cell_sums`."""
    left_out = np.zeros(0, dtype=np.bool_)
    for b in range(len(starts) - 1):
        if starts[b + 1] > starts[b]:
            _sum_up(points, starts, span, b, left_out, out)


@njit(cache=True, nogil=True)
def write_sums_without(
    sums: FloatArray,
    points: FloatArray,
    starts: IntArray,
    span: IntArray,
    left_out: BoolArray,
    starts_without: IntArray,
    out: FloatArray,
) -> None:
    """Write the sums of the fine cells that have points to (cells, 11) zeros; arguments as for `sums_without`."""
    for b in range(len(starts) - 1):
        n = starts[b + 1] - starts[b]
        if n == 0:
            continue
        if starts_without[b + 1] - starts_without[b] != n:
            _sum_up(points, starts, span, b, left_out, out)
        else:
            for k in range(SUM_COLUMNS):
                out[b, k] = sums[b, k]


@njit(cache=True, nogil=True)
def _sum_up(
    points: FloatArray, starts: IntArray, span: IntArray, b: int, left_out: BoolArray, sums: FloatArray
) -> None:
    """Write the sums of one fine cell; left_out: which points (n,) are, or (0,) for none.

    Sums in registers: read back from memory for every point they take longer.
    """
    x0 = (span[SPAN_WEST] + b % span[SPAN_COLS] + 0.5) * FINE_M
    y0 = (span[SPAN_SOUTH] + b // span[SPAN_COLS] + 0.5) * FINE_M
    n = sx = sy = sz = xx = xy = yy = xz = yz = zz = strength = 0.0
    for i in range(starts[b], starts[b + 1]):
        if len(left_out) > 0 and left_out[i]:
            continue
        x, y, z = points[i, 0] - x0, points[i, 1] - y0, points[i, 2]
        n, sx, sy, sz, strength = n + 1.0, sx + x, sy + y, sz + z, strength + points[i, 3]
        xx, xy, yy = xx + x * x, xy + x * y, yy + y * y
        xz, yz, zz = xz + x * z, yz + y * z, zz + z * z
    sums[b, SUM_N], sums[b, SUM_X], sums[b, SUM_Y], sums[b, SUM_Z] = n, sx, sy, sz
    sums[b, SUM_XX], sums[b, SUM_XY], sums[b, SUM_YY] = xx, xy, yy
    sums[b, SUM_XZ], sums[b, SUM_YZ], sums[b, SUM_ZZ] = xz, yz, zz
    sums[b, SUM_STRENGTH] = strength


@njit(cache=True, nogil=True)
def plane_of(s: FloatArray) -> tuple[float, float, float, float]:
    """Return height at x = y = 0 [m], slopes, and rms distance [m] of the plane through the points of sums `s`.

    Parameters
    ----------
    s
        (10 or more,) sums over at least one point, elements `SUM_N` to `SUM_ZZ`.

    Notes
    -----
    The distance is NaN where the points lie on a line.
    """
    n = s[SUM_N]
    mx, my, mz = s[SUM_X] / n, s[SUM_Y] / n, s[SUM_Z] / n
    xx, xy, yy = s[SUM_XX] / n - mx * mx, s[SUM_XY] / n - mx * my, s[SUM_YY] / n - my * my
    xz, yz, zz = s[SUM_XZ] / n - mx * mz, s[SUM_YZ] / n - my * mz, s[SUM_ZZ] / n - mz * mz
    det = xx * yy - xy * xy
    if not det > _LEAST_SPREAD_M2 * max(xx, yy):
        return mz, 0.0, 0.0, np.nan
    a, b = (xz * yy - yz * xy) / det, (yz * xx - xz * xy) / det
    left = max(zz - a * xz - b * yz, 0.0)
    return mz - a * mx - b * my, a, b, np.sqrt(left * n / max(n - 3.0, 1.0))


@njit(cache=True, nogil=True)
def facets_of(sums: FloatArray, starts: IntArray, span: IntArray) -> FloatArray:
    """Return the facet at the centre of each cell of two fine ones, (cells, 6).

    Columns `FACET_N` to `FACET_SMOOTHEST`. Facets are 1 m wide, more where the points are few; 0 points where
    there are not enough or none in the cell.

    Parameters
    ----------
    sums
        (fine cells, 11), as `cell_sums` returns them, of all points or of some.
    starts, span
        (fine cells + 1,) and (4,) int64: where the points of each fine cell begin, and the range of these.
    """
    n_cols, n_rows = span[SPAN_COLS], span[SPAN_ROWS]
    out = np.zeros((len(sums) // 4, FACET_COLUMNS))
    s = np.empty(_PLANE_SUMS)
    for k in range(len(out)):
        r, c = 2 * (k // (n_cols // 2)), 2 * (k % (n_cols // 2))
        at = r * n_cols + c
        if starts[at + 2] == starts[at] and starts[at + n_cols + 2] == starts[at + n_cols]:
            continue
        south = sums[at, SUM_N] + sums[at + 1, SUM_N]
        if south + sums[at + n_cols, SUM_N] + sums[at + n_cols + 1, SUM_N] == 0.0:
            continue
        for ring in range(1, FACET_RINGS + 1):
            s[:] = 0.0
            for i in range(max(r - ring, 0), min(r + ring + 2, n_rows)):
                for j in range(max(c - ring, 0), min(c + ring + 2, n_cols)):
                    if sums[i * n_cols + j, SUM_N] > 0.0:
                        add_shifted(s, sums, i * n_cols + j, (j - c - 0.5) * FINE_M, (i - r - 0.5) * FINE_M)
            if s[SUM_N] >= FACET_POINTS:
                break
        if s[SUM_N] >= FACET_POINTS:
            z, a, b, rms = plane_of(s)
            if rms == rms:
                out[k, FACET_N], out[k, FACET_HEIGHT], out[k, FACET_RMS] = s[SUM_N], z, rms
                out[k, FACET_EAST], out[k, FACET_NORTH] = a, b
    _smoothest_near(out, n_rows // 2, n_cols // 2)
    return out


@njit(cache=True, nogil=True)
def _smoothest_near(facets: FloatArray, n_rows: int, n_cols: int) -> None:
    """Write the last column of the facets: the noise of the smoothest floor within `FACETS_AROUND` cells.

    The smoothest of many facets is smoother than their floor, the more by chance, the fewer points it has.
    """
    least = np.full((n_rows, n_cols), np.inf)
    for r in range(n_rows):
        for c in range(n_cols):
            if facets[r * n_cols + c, FACET_N] == 0.0:
                continue
            rms = facets[r * n_cols + c, FACET_RMS] / _share_of_smoothest(facets[r * n_cols + c, FACET_N])
            for j in range(max(c - FACETS_AROUND, 0), min(c + FACETS_AROUND + 1, n_cols)):
                least[r, j] = min(least[r, j], rms)
    for r in range(n_rows):
        for i in range(max(r - FACETS_AROUND, 0), min(r + FACETS_AROUND + 1, n_rows)):
            for c in range(n_cols):
                at = r * n_cols + c
                is_first = i == max(r - FACETS_AROUND, 0)
                facets[at, FACET_SMOOTHEST] = (
                    least[i, c] if is_first else min(facets[at, FACET_SMOOTHEST], least[i, c])
                )


@njit(cache=True, nogil=True)
def _share_of_smoothest(n: float) -> float:
    """Return the rms distance of the smoothest of many facets of `n` points over the noise of their floor.

    The square of a facet's rms distance is a chi-squared variable over its n - 3 degrees of freedom, here after
    E. B. Wilson and M. M. Hilferty, The distribution of chi-square, 1931, doi:10.1073/pnas.17.12.684.
    """
    spread = 2.0 / (9.0 * max(n - 3.0, 1.0))
    return float(max(1.0 - spread - _SMOOTHEST_DEVIATION * np.sqrt(spread), 0.1) ** 1.5)


@njit(cache=True, nogil=True)
def add_shifted(s: FloatArray, sums: FloatArray, at: int, dx: float, dy: float) -> None:
    """Add to sums `s` those of cell `at` of `sums` (cells, 11), which has points, taken about a centre at (dx, dy) [m].

    Without branches of its own: with one, its arrays are counted as used and unused again, which takes longer than the sums.
    """
    n = sums[at, SUM_N]
    s[SUM_N] += n
    s[SUM_X] += sums[at, SUM_X] + n * dx
    s[SUM_Y] += sums[at, SUM_Y] + n * dy
    s[SUM_Z] += sums[at, SUM_Z]
    s[SUM_XX] += sums[at, SUM_XX] + 2.0 * dx * sums[at, SUM_X] + n * dx * dx
    s[SUM_XY] += sums[at, SUM_XY] + dx * sums[at, SUM_Y] + dy * sums[at, SUM_X] + n * dx * dy
    s[SUM_YY] += sums[at, SUM_YY] + 2.0 * dy * sums[at, SUM_Y] + n * dy * dy
    s[SUM_XZ] += sums[at, SUM_XZ] + dx * sums[at, SUM_Z]
    s[SUM_YZ] += sums[at, SUM_YZ] + dy * sums[at, SUM_Z]
    s[SUM_ZZ] += sums[at, SUM_ZZ]
