"""Points of one place, seen along a direction: gathered, sorted into a profile across, split where it breaks.

A place has its own frame: u along the feature, v to its left, r the height over a plane through the place.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.cells.floor import FINE_M

#: Bins of a profile, and how many of them a piece on either side of a break has at most: the lower side is
#: looked at over 0.6 m, the upper over 0.4 m (kerb tops are narrow), where a bin is 2 cm.
#: The break between them has twice `FACE_BINS`.
N_PROFILE_BINS, LOW_BINS, HIGH_BINS, FACE_BINS = 72, 30, 20, 1
#: Ramps behind dropped kerbs rise by 1 in 8, kerbs' flat tops by less: more is no top. [m/m]
STEEP_TOP = 0.3
#: No scanner measures smoother floors. [m]
LEAST_FLOOR_NOISE_M = 0.0025
EMPTY_BIN = np.zeros(9)
#: Fewest points in the pieces beside a break: three unknowns there, and one to judge them.
PIECE_POINTS = 4
#: A place needs no more points than this to be measured (what is left is not noise), and to be found.
MOST_PLACE_POINTS, ENOUGH_POINTS = 1000, 300
#: What stands higher over the plane (or lies deeper) is neither floor nor kerb: cars, hedges, walls. [m]
CLIP_M = 0.30


@njit(cache=True, nogil=True)
def count_near(starts: IntArray, span: IntArray, place: tuple[float, float], radius: float) -> int:
    """Return how many points the fine cells within `radius` of a place (east, north) hold."""
    n_cols, n_rows = span[2], span[3]
    c0 = max(int(np.floor((place[0] - radius) / FINE_M)) - span[0], 0)
    c1 = min(int(np.floor((place[0] + radius) / FINE_M)) - span[0], n_cols - 1)
    r0 = max(int(np.floor((place[1] - radius) / FINE_M)) - span[1], 0)
    r1 = min(int(np.floor((place[1] + radius) / FINE_M)) - span[1], n_rows - 1)
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
    """Collect the points around a place into `work`: x, y from it, r over the plane, strength, index.

    plane: height at the place and slopes. Of more than `most` points every second, third ... is taken.
    Returns how many there are.
    """
    px, py = place
    n_cols, n_rows = span[2], span[3]
    c0 = max(int(np.floor((px - radius) / FINE_M)) - span[0], 0)
    c1 = min(int(np.floor((px + radius) / FINE_M)) - span[0], n_cols - 1)
    r0 = max(int(np.floor((py - radius) / FINE_M)) - span[1], 0)
    r1 = min(int(np.floor((py + radius) / FINE_M)) - span[1], n_rows - 1)
    if c0 > c1:
        return 0
    step = 1 + count_near(starts, span, place, radius) // most
    n, turn = 0, 0
    for r in range(r0, r1 + 1):
        for i in range(starts[r * n_cols + c0], starts[r * n_cols + c1 + 1]):
            turn += 1
            if turn % step != 0:
                continue
            x, y = points[i, 0] - px, points[i, 1] - py
            w = work[n]
            w[0], w[1], w[2] = x, y, points[i, 2] - plane[0] - plane[1] * x - plane[2] * y
            w[3], w[4] = points[i, 3], i
            n += int(x * x + y * y <= radius * radius)
    return n


@njit(cache=True, nogil=True)
def bin_sums_across(
    work: FloatArray, n: int, vx: float, vy: float, half_u: float, step: float, sums: FloatArray
) -> None:
    """Write running sums over the bins of a profile along v: 1, v, vv, r, vr, rr, strength i, vi, ii.

    sums: (N_BINS + 1, 9); of bins a to b - 1 the sums are ``sums[b] - sums[a]``.
    """
    sums[:] = 0.0
    for i in range(n):
        x, y = work[i, 0], work[i, 1]
        v = x * vx + y * vy
        k = int(v / step + 0.5 * N_PROFILE_BINS + 1.0)
        r, strength = work[i, 2], work[i, 3]
        if k < 1 or k > N_PROFILE_BINS or abs(x * vy - y * vx) > half_u or abs(r) > CLIP_M:
            continue
        s = sums[k]
        s[0] += 1.0
        s[1] += v
        s[2] += v * v
        s[3] += r
        s[4] += v * r
        s[5] += r * r
        s[6] += strength
        s[7] += v * strength
        s[8] += strength * strength
    for k in range(1, N_PROFILE_BINS + 1):
        for j in range(9):
            sums[k, j] += sums[k - 1, j]


@njit(cache=True, nogil=True)
def beside_cell(vx: float, vy: float, v: float) -> bool:
    """Return whether the line at `v` passes the cell about the place by more than 8 cm (a turn may bring it in)."""
    return bool(abs(v) > FINE_M * (abs(vx) + abs(vy)) + 0.08)


@njit(cache=True, nogil=True)
def line_through(a: FloatArray, b: FloatArray, v: float) -> tuple[float, float, float, float]:
    """Return points, sum of squares left, height at `v` and slope of the line through the bins from `a` to `b`."""
    n = b[0] - a[0]
    if n < PIECE_POINTS:
        return n, 0.0, 0.0, 0.0
    mv, mr = (b[1] - a[1]) / n, (b[3] - a[3]) / n
    vv = (b[2] - a[2]) / n - mv * mv + 1e-9
    vr = (b[4] - a[4]) / n - mv * mr
    rr = (b[5] - a[5]) / n - mr * mr
    slope = vr / vv
    return n, max(rr - slope * vr, 0.0) * n, mr + slope * (v - mv), slope


@njit(cache=True, nogil=True)
def step_in(
    sums: FloatArray, step: float, half: int, stride: int
) -> tuple[float, float, float, float, float]:
    """Return where a profile steps up towards -v: clearness, v, heights below and above, and noise beside it.

    Clearness: how much two lines, broken there, leave less of the squares than one, over their noise. Bins in
    the break itself, where a kerb has its face, are left out. Breaks are tried up to `half` bins from the middle.
    """
    best, at, below, above, noise = 0.0, 0.0, 0.0, 0.0, 0.0
    both = np.empty(9)
    for k in range(N_PROFILE_BINS // 2 - half, N_PROFILE_BINS // 2 + half + 1, stride):
        v = (k - 0.5 * N_PROFILE_BINS) * step
        k_low, k_high = k + FACE_BINS, k - FACE_BINS
        low, high = sums[min(k_low + LOW_BINS, N_PROFILE_BINS)], sums[max(k_high - HIGH_BINS, 0)]
        n_low, left_low, z_low, slope_low = line_through(sums[k_low], low, v)
        n_high, left_high, z_high, slope_high = line_through(high, sums[k_high], v)
        if (
            n_low < PIECE_POINTS
            or n_high < PIECE_POINTS
            or z_high <= z_low
            or abs(slope_high - slope_low) > STEEP_TOP
        ):
            continue
        for j in range(9):
            both[j] = low[j] - sums[k_low, j] + sums[k_high, j] - high[j]
        square = (left_low + left_high) / max(n_low + n_high - 4.0, 1.0) + LEAST_FLOOR_NOISE_M**2
        clear = (line_through(EMPTY_BIN, both, v)[1] - left_low - left_high) / square
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
    """Fit r = a + b u + c v to the points with v inside a window; points far from it count less.

    frame: v-axis. window: lowest v, highest v, largest distance along u. first: a and spread to begin with.
    soft: weights that hold b and c to 0.

    Returns
    -------
    a, b, c
        The plane.
    spread
        Robust rms distance of the points from it. [m]
    count
        Of points that count; 0 when there are too few.
    """
    vx, vy = frame
    a, b, c, spread = first[0], 0.0, 0.0, first[1]
    count = 0.0
    for _ in range(4):
        s = np.zeros(10)
        mean_square, weights = 0.0, 0.0
        count = 0.0
        for i in range(n):
            x, y = work[i, 0], work[i, 1]
            v, u = x * vx + y * vy, x * vy - y * vx
            if v < window[0] or v > window[1] or abs(u) > window[2]:
                continue
            r = work[i, 2]
            off = r - a - b * u - c * v
            # Tukey's weight
            w = max(1.0 - (off / (4.0 * spread)) ** 2, 0.0) ** 2
            count += 1.0 if w > 0.0 else 0.0
            s[0] += w
            s[1] += w * u
            s[2] += w * v
            s[3] += w * r
            s[4] += w * u * u
            s[5] += w * u * v
            s[6] += w * v * v
            s[7] += w * u * r
            s[8] += w * v * r
            mean_square += w * r * r
            weights += w
        if count < PIECE_POINTS or s[0] < 3.0:
            return 0.0, 0.0, 0.0, 0.0, 0.0
        m = s[0]
        mu, mv, mr = s[1] / m, s[2] / m, s[3] / m
        uu, uv, vv = s[4] - m * mu * mu + soft[0], s[5] - m * mu * mv, s[6] - m * mv * mv + soft[1]
        ur, vr = s[7] - m * mu * mr, s[8] - m * mv * mr
        det = uu * vv - uv * uv
        b, c = (ur * vv - vr * uv) / det, (vr * uu - ur * uv) / det
        a = mr - b * mu - c * mv
        left = mean_square - m * mr * mr - b * ur - c * vr
        spread = max(np.sqrt(max(left, 0.0) / max(weights - 3.0, 1.0)), LEAST_FLOOR_NOISE_M)
    return a, b, c, spread, count
