"""Kernels of the cross profile at one place: gather its points, sum them in bins, find a step, fit planes.

A place has its own frame: u along the feature, v to its left, r the height over a plane through the place.
Positions are in metres from the survey's local origin.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.kernels.cells.floor import FINE_M, SPAN_COLS, SPAN_ROWS, SPAN_SOUTH, SPAN_WEST
from linework.kernels.tracking.small_systems import solve_two

#: Columns of the points of a place: x and y relative to it and height r over its plane [m], intensity.
PLACE_X, PLACE_Y, PLACE_R, PLACE_INTENSITY = range(4)
PLACE_COLUMNS = 4
#: Columns of the sums over the bins of a profile: points, v, v^2, height r, v r, r^2, intensity i, v i, i^2.
BIN_N, BIN_V, BIN_VV, BIN_R, BIN_VR, BIN_RR, BIN_I, BIN_VI, BIN_II = range(9)
PROFILE_SUMS = 9
#: Parts of a plane through a place: height there [m], slopes to the east and to the north.
PLANE_HEIGHT, PLANE_EAST, PLANE_NORTH = range(3)

#: Number of bins of a profile, and largest number on the lower and the upper side of a break: with bins of 2 cm the
#: lower side is fitted over 0.6 m, the upper over 0.4 m (kerb tops are narrow). The break is twice `FACE_BINS` wide.
N_PROFILE_BINS, LOW_BINS, HIGH_BINS, FACE_BINS = 72, 30, 20, 1
#: Largest slope of a kerb's top against its floor: ramps behind dropped kerbs rise by 1 in 8, flat tops by less,
#: and noise adds to both. [m/m]
STEEP_TOP = 0.3
#: Smallest noise of a floor: no scanner measures better. [m]
LEAST_FLOOR_NOISE_M = 0.0025
#: Fewest points on either side of a break: three unknowns, and one more for the noise.
PIECE_POINTS = 4
#: Largest number of points used to measure a place (more of them no longer reduce the error), and to find it.
MOST_PLACE_POINTS, ENOUGH_POINTS = 1000, 300
#: Points farther than this above or below the plane are neither floor nor kerb: cars, hedges, walls. [m]
CLIP_M = 0.30
#: A line that misses a cell by less than this may still pass through the cell once the profile is rotated. [m]
BESIDE_CELL_M = 0.08
#: Smallest variance of v in a piece of a profile, against division by zero. [m^2]
LEAST_VV = 1e-9
#: Standard deviation of a uniform distribution over its width: 1 / sqrt(12).
UNIFORM_SIGMA = 0.29
#: Width of a bin of the profile across a usual search area, and half of the length along u that it covers. [m]
PROFILE_BIN_M, HALF_LENGTH_M = 0.02, 0.5
#: Extent of a floor across [m]; weights that hold its slopes along u and v to 0 [m^2]; distance that it keeps from the
#: foot of a step: half of a usual scan spot [m].
FLOOR_WIDTH_M, FLOOR_SOFT, CLEAR_M = 0.60, (0.04, 0.04), 0.02
#: Distance beyond its cell within which a line is searched for when it is remeasured; shortest piece in a cell that is
#: remeasured, and shortest that makes a box. [m]
CHORD_SLACK_M, LEAST_CHORD_M, LEAST_BOX_M = 0.05, 0.1, 0.05
#: Radius within which a line is remeasured, about the middle of its piece in the cell. [m]
AGAIN_M = 0.80
#: Tukey's weight is 0 beyond this many standard deviations; rounds of reweighting, after which fits hardly change.
TUKEY_SPREADS, N_ROUNDS = 4.0, 4
#: Smallest sum of weights that determines a plane.
LEAST_WEIGHT = 3.0


class FloorCells(NamedTuple):
    """Points near the ground by fine cell, and the values computed for each cell.

    Parameters
    ----------
    points
        (n, 4): x, y, z [m, from the local origin], intensity.
    starts
        (n_cells + 1,) int64: first point of each fine cell.
    span
        (4,) int64: `SPAN_WEST` to `SPAN_ROWS`.
    sums, facets
        See `linework.kernels.cells.floor.cell_sums` and `facets_of`.
    near_road
        (cells,) bool: whether road was measured in or close to each cell of two fine ones.
    is_wall, on_ground
        (n,) bool and (n_cells + 1,) int64; see `linework.kernels.boundaries.walls.points_of_walls`.
    """

    points: FloatArray
    starts: IntArray
    span: IntArray
    sums: FloatArray
    facets: FloatArray
    near_road: BoolArray
    is_wall: BoolArray
    on_ground: IntArray


class FloorLimits(NamedTuple):
    """Settings of the boundary boxes: bounds of a kerb and of its floor.

    Parameters
    ----------
    least_step, highest_step
        Height of a kerb. [m]
    steepest
        Slope of a floor against the road. [m/m]
    most_noise
        Noise of the roughest floor. [m]
    is_vertical
        1 where slopes are measured against the vertical, 0 against the road.
    """

    least_step: float
    steepest: float
    highest_step: float
    most_noise: float
    is_vertical: float


class LocalFloor(NamedTuple):
    """The floor at a place.

    Parameters
    ----------
    plane
        (3,): `PLANE_HEIGHT`, `PLANE_EAST`, `PLANE_NORTH`.
    noise
        Rms distance of its points from the plane. [m]
    east, north
        Slopes of the road to the east and to the north, over 3 m. [m/m]
    usual
        Noise of the smoothest floors nearby. [m]
    scanner
        What of its noise the scanner adds: that of the smoothest floors at a road, which are pavement; elsewhere, where
        all floors may be soil or grass, 0. [m]
    """

    plane: FloatArray
    noise: float
    east: float
    north: float
    usual: float
    scanner: float


class PlaceScratch(NamedTuple):
    """Arrays that the kernels of one place overwrite: its points, the sums of a profile, a measured step."""

    work: FloatArray
    sums: FloatArray
    step: FloatArray


@njit(cache=True, nogil=True)
def count_near(starts: IntArray, span: IntArray, place: tuple[float, float], radius: float) -> int:
    """Return the number of points in the fine cells within `radius` [m] of a place (east, north)."""
    n_cols, n_rows = span[SPAN_COLS], span[SPAN_ROWS]
    px, py = place
    c0 = max(int(np.floor((px - radius) / FINE_M)) - span[SPAN_WEST], 0)
    c1 = min(int(np.floor((px + radius) / FINE_M)) - span[SPAN_WEST], n_cols - 1)
    r0 = max(int(np.floor((py - radius) / FINE_M)) - span[SPAN_SOUTH], 0)
    r1 = min(int(np.floor((py + radius) / FINE_M)) - span[SPAN_SOUTH], n_rows - 1)
    total = 0
    if c0 <= c1:
        for r in range(r0, r1 + 1):
            total += starts[r * n_cols + c1 + 1] - starts[r * n_cols + c0]
    return total


@njit(cache=True, nogil=True)
def gather_at(
    points: FloatArray,
    starts: IntArray,
    span: IntArray,
    place: tuple[float, float],
    radius: float,
    plane: FloatArray,
    most: int,
    work: FloatArray,
) -> int:
    """Write the points around a place to `work`, and return their number.

    Parameters
    ----------
    points, starts, span
        (n, 4), (n_cells + 1,), (4,): see `FloorCells`.
    place, radius
        Centre and radius. [m, from the local origin]
    plane
        (3,): plane through the place, above which heights are measured.
    most
        Largest number of points; of more points, only every second, third ... is used.
    work
        (most + 2, 4) output: columns `PLACE_X` to `PLACE_INTENSITY`.
    """
    px, py = place
    n_cols, n_rows = span[SPAN_COLS], span[SPAN_ROWS]
    c0 = max(int(np.floor((px - radius) / FINE_M)) - span[SPAN_WEST], 0)
    c1 = min(int(np.floor((px + radius) / FINE_M)) - span[SPAN_WEST], n_cols - 1)
    r0 = max(int(np.floor((py - radius) / FINE_M)) - span[SPAN_SOUTH], 0)
    r1 = min(int(np.floor((py + radius) / FINE_M)) - span[SPAN_SOUTH], n_rows - 1)
    if c0 > c1:
        return 0
    step = 1 + count_near(starts, span, place, radius) // most
    # Counting down takes a third less time than a remainder for every point
    n, left = 0, step
    for r in range(r0, r1 + 1):
        for i in range(starts[r * n_cols + c0], starts[r * n_cols + c1 + 1]):
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


@njit(cache=True, nogil=True, error_model="numpy")
def bin_sums_across(
    work: FloatArray,
    n: int,
    vx: float,
    vy: float,
    half_u: float,
    step: float,
    sums: FloatArray,
    bright: bool = True,
) -> None:
    """Write the running sums over the bins of a cross profile.

    Parameters
    ----------
    work
        (n or more, 4): points, see `gather_at`.
    vx, vy
        Unit vector across.
    half_u
        Points farther than this along u are left out. [m]
    step
        Width of a bin. [m]
    sums
        (73, 9) output, columns `BIN_N` to `BIN_II`; the sums over bins a to b - 1 are ``sums[b] - sums[a]``.
    bright
        Whether brightness is summed, too; if not, its columns are 0.
    """
    sums[:] = 0.0
    # In bins of their own first, 0 for what is beyond: all points at once, then summed one after the other
    bins = np.empty(n, np.int64)
    for i in range(n):
        x, y = work[i, PLACE_X], work[i, PLACE_Y]
        k = (x * vx + y * vy) / step + 0.5 * N_PROFILE_BINS + 1.0
        is_near = (abs(x * vy - y * vx) <= half_u) & (abs(work[i, PLACE_R]) <= CLIP_M)
        bins[i] = int(k) if is_near & (k >= 1.0) & (k < N_PROFILE_BINS + 1.0) else 0
    for i in range(n):
        k = bins[i]
        if k == 0:
            continue
        v, r = work[i, PLACE_X] * vx + work[i, PLACE_Y] * vy, work[i, PLACE_R]
        sums[k, BIN_N] += 1.0
        sums[k, BIN_V] += v
        sums[k, BIN_VV] += v * v
        sums[k, BIN_R] += r
        sums[k, BIN_VR] += v * r
        sums[k, BIN_RR] += r * r
        if bright:
            intensity = work[i, PLACE_INTENSITY]
            sums[k, BIN_I] += intensity
            sums[k, BIN_VI] += v * intensity
            sums[k, BIN_II] += intensity * intensity
    # Running sums in registers, three columns at a time: read back from memory they take twice the time
    for j in range(0, PROFILE_SUMS if bright else BIN_I, 3):
        a, b, c = 0.0, 0.0, 0.0
        for k in range(1, N_PROFILE_BINS + 1):
            a, b, c = a + sums[k, j], b + sums[k, j + 1], c + sums[k, j + 2]
            sums[k, j], sums[k, j + 1], sums[k, j + 2] = a, b, c


@njit(cache=True, nogil=True)
def beside_cell(vx: float, vy: float, v: float) -> bool:
    """Return whether the line at `v` [m] misses the cell around the place by more than `BESIDE_CELL_M`."""
    return bool(abs(v) > FINE_M * (abs(vx) + abs(vy)) + BESIDE_CELL_M)


@njit(cache=True, nogil=True)
def line_through(sums: FloatArray, a: int, b: int, v: float) -> tuple[float, float, float, float]:
    """Return points, residual sum of squares, height at `v` and slope of the line through the bins a to b - 1.

    sums: (73, 9) running sums of the bins, see `bin_sums_across`. Rows are taken by their numbers here and in what is
    called as often: a view of one is counted as used and unused again, by two locked instructions that took a third of
    the time of all boundary boxes.
    """
    n = sums[b, BIN_N] - sums[a, BIN_N]
    if n < PIECE_POINTS:
        return n, 0.0, 0.0, 0.0
    left, height, slope = _line_of_sums(
        n, sums[b, BIN_V] - sums[a, BIN_V], sums[b, BIN_VV] - sums[a, BIN_VV], sums[b, BIN_R] - sums[a, BIN_R],
        sums[b, BIN_VR] - sums[a, BIN_VR], sums[b, BIN_RR] - sums[a, BIN_RR], v,
    )  # fmt: skip
    return n, left, height, slope


@njit(cache=True, nogil=True)
def _line_of_sums(
    n: float, sv: float, svv: float, sr: float, svr: float, srr: float, v: float
) -> tuple[float, float, float]:
    """Return residual sum of squares, height at `v` and slope of a line, by sums over n points."""
    mv, mr = sv / n, sr / n
    vv = svv / n - mv * mv + LEAST_VV
    vr = svr / n - mv * mr
    rr = srr / n - mr * mr
    slope = vr / vv
    return max(rr - slope * vr, 0.0) * n, mr + slope * (v - mv), slope


@njit(cache=True, nogil=True)
def step_in(
    sums: FloatArray, step: float, half: int, stride: int
) -> tuple[float, float, float, float, float]:
    """Return the clearest step up of a profile towards -v: clearness, v, heights below and above, noise [m].

    The clearness is the sum of squares that two lines with a break explain beyond one line, over their noise
    variance. Bins in the break itself, where a kerb has its face, are left out.

    Parameters
    ----------
    sums, step
        (73, 9), [m]: see `bin_sums_across`.
    half, stride
        Breaks are tried up to `half` bins from the middle, every `stride` bins.
    """
    best, at, below, above, noise = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(N_PROFILE_BINS // 2 - half, N_PROFILE_BINS // 2 + half + 1, stride):
        v = (k - 0.5 * N_PROFILE_BINS) * step
        k_low, k_high = k + FACE_BINS, k - FACE_BINS
        low, high = min(k_low + LOW_BINS, N_PROFILE_BINS), max(k_high - HIGH_BINS, 0)
        n_low, left_low, z_low, slope_low = line_through(sums, k_low, low, v)
        n_high, left_high, z_high, slope_high = line_through(sums, high, k_high, v)
        if (
            n_low < PIECE_POINTS
            or n_high < PIECE_POINTS
            or z_high <= z_low
            or abs(slope_high - slope_low) > STEEP_TOP
        ):
            continue
        square = (left_low + left_high) / max(n_low + n_high - 4.0, 1.0) + LEAST_FLOOR_NOISE_M**2
        # One line through both sides
        left, _, _ = _line_of_sums(
            sums[low, BIN_N] - sums[k_low, BIN_N] + sums[k_high, BIN_N] - sums[high, BIN_N],
            sums[low, BIN_V] - sums[k_low, BIN_V] + sums[k_high, BIN_V] - sums[high, BIN_V],
            sums[low, BIN_VV] - sums[k_low, BIN_VV] + sums[k_high, BIN_VV] - sums[high, BIN_VV],
            sums[low, BIN_R] - sums[k_low, BIN_R] + sums[k_high, BIN_R] - sums[high, BIN_R],
            sums[low, BIN_VR] - sums[k_low, BIN_VR] + sums[k_high, BIN_VR] - sums[high, BIN_VR],
            sums[low, BIN_RR] - sums[k_low, BIN_RR] + sums[k_high, BIN_RR] - sums[high, BIN_RR],
            v,
        )
        clear = (left - left_low - left_high) / square
        if clear > best:
            best, at, below, above, noise = clear, v, z_low, z_high, np.sqrt(square)
    return best, at, below, above, noise


@njit(cache=True, nogil=True)
def fit_side(
    work: FloatArray,
    n: int,
    frame: tuple[float, float],
    window: tuple[float, float, float],
    first: tuple[float, float],
    soft: tuple[float, float],
) -> tuple[float, float, float, float, float]:
    """Fit a plane r = a + b u + c v to the points with v in a window, by reweighted least squares (Tukey).

    Parameters
    ----------
    work
        (n or more, 4): points, see `gather_at`.
    frame
        Unit vector v.
    window
        Lowest v, highest v, largest distance along u. [m]
    first
        a and spread to begin with. [m]
    soft
        Weights that hold b and c to 0. [m^2]

    Returns
    -------
    a, b, c
        The plane.
    spread
        Robust rms distance of the points from it. [m]
    count
        Number of points with a positive weight; 0 when there are too few.
    """
    vx, vy = frame
    v_low, v_high, u_most = window
    a, spread = first
    soft_u, soft_v = soft
    b = c = count = 0.0
    # Points in the window, chosen once for all rounds: u, v, r
    side, k = np.empty((n + 1, 3)), 0
    for i in range(n):
        x, y = work[i, PLACE_X], work[i, PLACE_Y]
        v, u = x * vx + y * vy, x * vy - y * vx
        side[k, 0], side[k, 1], side[k, 2] = u, v, work[i, PLACE_R]
        k += int((v >= v_low) & (v <= v_high) & (abs(u) <= u_most))
    for _ in range(N_ROUNDS):
        # Weighted sums
        m = su = sv = sr = suu = suv = svv = sur = svr = srr = 0.0
        count = 0.0
        for i in range(k):
            u, v, r = side[i, 0], side[i, 1], side[i, 2]
            off = r - a - b * u - c * v
            w = max(1.0 - (off / (TUKEY_SPREADS * spread)) ** 2, 0.0) ** 2
            count += 1.0 if w > 0.0 else 0.0
            m += w
            su += w * u
            sv += w * v
            sr += w * r
            suu += w * u * u
            suv += w * u * v
            svv += w * v * v
            sur += w * u * r
            svr += w * v * r
            srr += w * r * r
        if count < PIECE_POINTS or m < LEAST_WEIGHT:
            return 0.0, 0.0, 0.0, 0.0, 0.0
        mu, mv, mr = su / m, sv / m, sr / m
        uu, uv, vv = suu - m * mu * mu + soft_u, suv - m * mu * mv, svv - m * mv * mv + soft_v
        ur, vr = sur - m * mu * mr, svr - m * mv * mr
        b, c = solve_two(uu, uv, vv, ur, vr)
        a = mr - b * mu - c * mv
        left = srr - m * mr * mr - b * ur - c * vr
        spread = max(np.sqrt(max(left, 0.0) / max(m - 3.0, 1.0)), LEAST_FLOOR_NOISE_M)
    return a, b, c, spread, count
