"""Stripes of paint in search areas: their direction, their two edges, and how far along there is evidence."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

#: Columns of the points of a search area: place from its middle, height, brightness, index.
X, Y, Z, Q, INDEX = range(5)
#: Columns of a stripe.
(
    CX, CY, CZ, UX, UY, HALF_U, HALF_V, SIGMA_V, SIGMA_Z, SIGMA_U, T_VALUE, STEP, SIGMA_STEP,
    DARK, BRIGHT, NUMBER, FIRST, LAST, LENGTH,
) = range(19)  # fmt: skip
N_COLUMNS = 19

#: Why a search area has no stripe.
FOUND, TOO_FEW_POINTS, HOLES, NO_BRIGHT, NO_STRIPE = range(5)

N_ANGLES = 16
N_TURN_BINS = 24
#: Bins across and along a search area of radius R: across it reaches 1.4 R, so that a bar 0.5 m wide and the
#: road on both sides of it fit in.
N_ACROSS, ACROSS = 56, 1.4
N_ALONG = 80
N_SLICES = 8
#: Road beside a stripe that it is held against: 4 bins, 0.10 m of a search area of 0.5 m (double lines stand
#: 0.1 m and more apart).
N_SIDE = 4
#: Widest paint, in bins: 1 m.
WIDEST = 40
MOST_STRIPES = 4


@njit(cache=True, nogil=True)
def gather(
    points: F64,
    starts: I64,
    lattice: tuple[float, int, int, int, int],
    x: float,
    y: float,
    reach: float,
    work: F64,
) -> int:
    """Write the points within `reach` of a place to `work`, places from there; return their number (or -needed)."""
    cell, south, west, n_rows, n_cols = lattice
    row0 = max(int(np.floor((y - reach) / cell)) - south, 0)
    row1 = min(int(np.floor((y + reach) / cell)) - south, n_rows - 1)
    col0 = max(int(np.floor((x - reach) / cell)) - west, 0)
    col1 = min(int(np.floor((x + reach) / cell)) - west, n_cols - 1)
    if col1 < col0:
        return 0
    most = 0
    for row in range(row0, row1 + 1):
        most += starts[row * n_cols + col1 + 1] - starts[row * n_cols + col0]
    if most > len(work):
        return -most
    n = 0
    for row in range(row0, row1 + 1):
        for i in range(starts[row * n_cols + col0], starts[row * n_cols + col1 + 1]):
            dx, dy = points[i, 0] - x, points[i, 1] - y
            if dx * dx + dy * dy <= reach * reach:
                work[n, X], work[n, Y], work[n, Z], work[n, Q], work[n, INDEX] = (
                    dx, dy, points[i, 2], points[i, 3], i,
                )  # fmt: skip
                n += 1
    return n


@njit(cache=True, nogil=True)
def direction(work: F64, n: int, radius: float) -> float:
    """Return the direction [rad] across which the brightness of the points within 1.2 radii differs most.

    For each of 16 directions the points fall into bins across it; the sum of squares between the bins is
    largest along stripes and edges. All points count, not only the bright ones: how densely the scan lines
    lie does not matter. A parabola through the best three gives the direction between.
    """
    reach = 1.2 * radius
    scale = N_TURN_BINS / (2.0 * reach)
    # Some points settle a direction as well as all do
    stride = max(n // 400, 1)
    near = np.empty((n // stride + 1, 3))
    total, number = 0.0, 0
    for i in range(0, n, stride):
        if work[i, X] ** 2 + work[i, Y] ** 2 <= reach * reach:
            near[number, 0], near[number, 1], near[number, 2] = (
                work[i, X] * scale,
                work[i, Y] * scale,
                work[i, Q],
            )
            total += work[i, Q]
            number += 1
    mean = total / max(number, 1)
    # Bins of few points say little: as if this many more of the mean had been there
    few = 0.1 * number / N_TURN_BINS + 1.0
    between = np.zeros(N_ANGLES)
    bins, counts = np.zeros(N_TURN_BINS), np.zeros(N_TURN_BINS)
    for k in range(N_ANGLES):
        angle = k * math.pi / N_ANGLES
        nx, ny = -math.sin(angle), math.cos(angle)
        bins[:], counts[:] = 0.0, 0.0
        for i in range(number):
            b = min(int(near[i, 0] * nx + near[i, 1] * ny + 0.5 * N_TURN_BINS), N_TURN_BINS - 1)
            bins[b] += near[i, 2] - mean
            counts[b] += 1.0
        for b in range(N_TURN_BINS):
            between[k] += bins[b] * bins[b] / (counts[b] + few)
    best = int(np.argmax(between))
    before, after = between[best - 1], between[(best + 1) % N_ANGLES]
    bend = before - 2.0 * between[best] + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return (best + shift) * math.pi / N_ANGLES


@njit(cache=True, nogil=True)
def stripes_across(work: F64, n: int, angle: float, radius: float, least_t: float, out: F64) -> int:
    """Find the stripes along a direction: bands that are brighter than the road on both their sides.

    The profile across has 56 bins; of all bands the one whose mean stands out most from the darker mean of
    the two sides (the smaller of two t-values counts) is taken, then the next one beside it.

    Writes right edge, left edge [m, across] and t-value of each to `out`; returns their number.
    """
    reach = ACROSS * radius
    size = 2.0 * reach / N_ACROSS
    ux, uy = math.cos(angle), math.sin(angle)
    number, total = np.zeros(N_ACROSS + 1), np.zeros(N_ACROSS + 1)
    square = 0.0
    for i in range(n):
        u, v = work[i, X] * ux + work[i, Y] * uy, work[i, Y] * ux - work[i, X] * uy
        if abs(u) < radius and abs(v) < reach:
            b = int((v + reach) / size)
            number[b + 1] += 1.0
            total[b + 1] += work[i, Q]
            square += work[i, Q] ** 2
    used, within = 0, square
    for b in range(1, N_ACROSS + 1):
        if number[b] > 0.0:
            used += 1
            within -= total[b] ** 2 / number[b]
        number[b] += number[b - 1]
        total[b] += total[b - 1]
    free = number[N_ACROSS] - used
    if free < 8.0:
        return 0
    variance = within / free + 1e-6
    rises, falls = edges_of(number, total)
    taken = np.zeros(N_ACROSS, dtype=np.uint8)
    m = 0
    while m < MOST_STRIPES:
        best, first, last = least_t, -1, -1
        for a in rises:
            if taken[a]:
                continue
            a0 = max(a - N_SIDE, 0)
            n_right = number[a] - number[a0]
            if n_right < 3.0:
                continue
            right = (total[a] - total[a0]) / n_right
            for b in falls:
                if b <= a:
                    continue
                if b > a + WIDEST or taken[a:b].any():
                    break
                n_in, b1 = number[b] - number[a], min(b + N_SIDE, N_ACROSS)
                n_left = number[b1] - number[b]
                if n_in < 3.0 or n_left < 3.0:
                    continue
                mean, left = (total[b] - total[a]) / n_in, (total[b1] - total[b]) / n_left
                if mean <= right or mean <= left:
                    continue
                t = min(
                    (mean - right) / math.sqrt(variance * (1.0 / n_in + 1.0 / n_right)),
                    (mean - left) / math.sqrt(variance * (1.0 / n_in + 1.0 / n_left)),
                )
                if t > best:
                    best, first, last = t, a, b
        if first < 0:
            break
        out[m, 0], out[m, 1], out[m, 2] = first * size - reach, last * size - reach, best
        m += 1
        taken[max(first - 1, 0) : min(last + 1, N_ACROSS)] = 1
    return m


@njit(cache=True, nogil=True)
def edges_of(number: F64, total: F64) -> tuple[I64, I64]:
    """Return the borders between bins where the profile rises, and where it falls, more than beside them.

    number, total: sums of the bins so far. What counts is the difference of the means of two bins on each side.
    """
    n = len(number) - 1
    rise = np.zeros(n + 1)
    for a in range(1, n):
        low, high = max(a - 2, 0), min(a + 2, n)
        before, after = number[a] - number[low], number[high] - number[a]
        if before > 0.0 and after > 0.0:
            rise[a] = (total[high] - total[a]) / after - (total[a] - total[low]) / before
    rises, falls = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    n_rises, n_falls = 0, 0
    for a in range(1, n):
        if rise[a] > 0.0 and rise[a] >= rise[a - 1] and rise[a] >= rise[a + 1]:
            rises[n_rises] = a
            n_rises += 1
        if rise[a] < 0.0 and rise[a] <= rise[a - 1] and rise[a] <= rise[a + 1]:
            falls[n_falls] = a
            n_falls += 1
    return rises[:n_rises], falls[:n_falls]


@njit(cache=True, nogil=True)
def extent(strip: F64, radius: float, fit: F64) -> tuple[float, float, int]:
    """Return where along its direction a stripe begins and ends, and in how many of 8 parts between are points.

    The stretch with the largest sum of brightness above the middle of road and paint is the most likely one
    for paint that begins once and ends once; an end is half way to the next point beyond.
    """
    size = 2.0 * radius / N_ALONG
    value, low, high = np.zeros(N_ALONG), np.full(N_ALONG, np.inf), np.full(N_ALONG, -np.inf)
    half = max(0.4 * fit[2], 0.02)
    middle = 0.5 * fit[5] + 0.25 * (fit[3] + fit[4])
    for i in range(len(strip)):
        u = strip[i, 0]
        if abs(strip[i, 1] - fit[0] - fit[1] * u) <= half:
            b = min(int((u + radius) / size), N_ALONG - 1)
            value[b] += strip[i, 2] - middle
            low[b], high[b] = min(low[b], u), max(high[b], u)
    best, first, last, total, begin = 0.0, 0, -1, 0.0, 0
    for b in range(N_ALONG):
        if total <= 0.0:
            total, begin = 0.0, b
        total += value[b]
        if total > best:
            best, first, last = total, begin, b
    if last < 0:
        return 0.0, 0.0, 0
    while low[first] > high[first]:
        first += 1
    gap, previous = size, low[first]
    part, parts = -1, 0
    for b in range(first, last + 1):
        if low[b] <= high[b]:
            gap = max(gap, low[b] - previous)
            previous = high[b]
            here = b * N_SLICES // N_ALONG
            if here != part:
                part, parts = here, parts + 1
    begin_m, end_m = low[first], high[last]
    after, before = -1, -1
    for b in range(last + 1, N_ALONG):
        if low[b] <= high[b]:
            after = b
            break
    for b in range(first - 1, -1, -1):
        if low[b] <= high[b]:
            before = b
            break
    # Without a point beyond, the paint is followed to the border if the next one would have lain there
    if after >= 0:
        end_m = 0.5 * (end_m + low[after])
    elif radius - end_m <= 1.5 * gap:
        end_m = radius
    if before >= 0:
        begin_m = 0.5 * (begin_m + high[before])
    elif radius + begin_m <= 1.5 * gap:
        begin_m = -radius
    return begin_m, end_m, parts


@njit(cache=True, nogil=True)
def strip_of(
    work: F64, n: int, axes: tuple[float, float], radius: float, limits: tuple[float, float], strip: F64
) -> int:
    """Write the points between two offsets as (along, across, brightness, height) to `strip`; return their number."""
    ux, uy = axes
    m = 0
    for i in range(n):
        v = work[i, Y] * ux - work[i, X] * uy
        if v > limits[0] and v < limits[1]:
            u = work[i, X] * ux + work[i, Y] * uy
            if abs(u) < radius:
                strip[m, 0], strip[m, 1], strip[m, 2], strip[m, 3] = u, v, work[i, Q], work[i, Z]
                m += 1
    return m


@njit(cache=True, nogil=True)
def fit_stripe(
    strip: F64, stretch: tuple[float, float], blur: float, rounds: int, fit: F64, covariance: F64
) -> int:
    """Fit a stripe to the brightness of all points around it by least squares; return the number of points.

    Brightness is that of the paint between two edges, that of the road on the left and on the right beyond
    them, and passes from one to the other over `blur` on both sides of an edge. `fit`: offset, slope, width,
    road left, road right, paint (changed in place). `covariance` (6, 6) takes the scatter between eight parts
    along the stripe for independent, not that of the points: worn places and stains are larger than those.
    """
    width0 = max(fit[2], 0.10)
    normal, right, step = np.zeros((6, 6)), np.zeros(6), np.zeros(6)
    row = np.zeros(6)
    scores = np.zeros((N_SLICES, 6))
    number, variance = 0, 1.0
    begin, parts = stretch[0], N_SLICES / (stretch[1] - stretch[0])
    for k in range(rounds + 1):
        normal[:], right[:], scores[:] = 0.0, 0.0, 0.0
        number, squares = 0, 0.0
        slant = 0.25 / blur
        for i in range(len(strip)):
            u = strip[i, 0]
            if u <= stretch[0] or u >= stretch[1]:
                continue
            number += 1
            part = min(int((u - begin) * parts), N_SLICES - 1)
            d = strip[i, 1] - fit[0] - fit[1] * u
            share = (0.5 * fit[2] - abs(d)) * 2.0 * slant + 0.5
            side = 3 if d > 0.0 else 4
            # On the road or on the paint one level is all that counts
            if share <= 0.0 or share >= 1.0:
                at = side if share <= 0.0 else 5
                residual = strip[i, 2] - fit[at]
                squares += residual * residual
                scores[part, at] += residual
                normal[at, at] += 1.0
                continue
            rise = (fit[5] - fit[side]) * 2.0 * slant
            row[0] = rise if d > 0.0 else -rise
            row[1], row[2] = row[0] * u, 0.5 * rise
            row[3], row[4], row[5] = 0.0, 0.0, share
            row[side] = 1.0 - share
            residual = strip[i, 2] - fit[side] - (fit[5] - fit[side]) * share
            squares += residual * residual
            for a in range(6):
                scores[part, a] += row[a] * residual
                for b in range(a + 1):
                    normal[a, b] += row[a] * row[b]
        if number < 8:
            return 0
        variance = squares / number + 1e-6
        # Known before: the width to about 5 cm (lines are 0.10 m and wider), the slope to 0.2
        normal[0, 0] += variance / 0.1**2
        normal[1, 1] += variance / 0.2**2
        normal[2, 2] += variance / 0.05**2
        right[2] = (width0 - fit[2]) * variance / 0.05**2
        right[1] = -fit[1] * variance / 0.2**2
        for a in range(6):
            normal[a, a] += 1e-3 * variance
            for b in range(N_SLICES):
                right[a] += scores[b, a]
        factor(normal)
        if k < rounds:
            solve(normal, right, step)
            quarter = max(0.25 * fit[2], 0.01)
            fit[0] += min(max(step[0], -quarter), quarter)
            fit[1] += min(max(step[1], -0.1), 0.1)
            fit[2] = max(fit[2] + min(max(step[2], -quarter), quarter), 0.02)
            for a in range(3, 6):
                fit[a] += step[a]
    # The scatter of the parts, of which two unknowns are spent for an edge, and that of the points
    covariance[:] = 0.0
    for b in range(N_SLICES):
        solve(normal, scores[b], step)
        for a in range(6):
            for c in range(6):
                covariance[a, c] += N_SLICES / (N_SLICES - 2.0) * step[a] * step[c]
    for a in range(6):
        right[:] = 0.0
        right[a] = variance
        solve(normal, right, step)
        for c in range(6):
            covariance[a, c] += step[c]
    return number


@njit(cache=True, nogil=True)
def factor(matrix: F64) -> None:
    """Replace the lower triangle of a positive definite matrix by its Cholesky factor."""
    n = len(matrix)
    for a in range(n):
        for b in range(a + 1):
            total = matrix[a, b]
            for c in range(b):
                total -= matrix[a, c] * matrix[b, c]
            if a == b:
                matrix[a, a] = math.sqrt(max(total, 1e-12))
            else:
                matrix[a, b] = total / matrix[b, b]


@njit(cache=True, nogil=True)
def solve(lower: F64, right: F64, out: F64) -> None:
    """Write the solution of a system whose matrix has this Cholesky factor."""
    n = len(lower)
    for a in range(n):
        total = right[a]
        for c in range(a):
            total -= lower[a, c] * out[c]
        out[a] = total / lower[a, a]
    for a in range(n - 1, -1, -1):
        total = out[a]
        for c in range(a + 1, n):
            total -= lower[c, a] * out[c]
        out[a] = total / lower[a, a]


@njit(cache=True, nogil=True)
def height_of(
    strip: F64, stretch: tuple[float, float], fit: F64, at: float
) -> tuple[float, float, float, float]:
    """Return the height of the stripe's centre at `at` and its sigma; the larger step beside it and its sigma.

    One plane over the stripe and what it was fitted to, and a step at each edge: paint has none, a kerb has.
    """
    normal, right, solution = np.zeros((5, 5)), np.zeros(5), np.zeros(5)
    row = np.ones(5)
    half = 0.5 * fit[2]
    z0, squares, number = 0.0, 0.0, 0
    for i in range(len(strip)):
        u = strip[i, 0]
        if u < stretch[0] or u > stretch[1]:
            continue
        d = strip[i, 1] - fit[0] - fit[1] * u
        if number == 0:
            z0 = strip[i, 3]
        number += 1
        row[1], row[2] = u - at, d
        row[3], row[4] = 1.0 if d > half else 0.0, 1.0 if d < -half else 0.0
        z = strip[i, 3] - z0
        squares += z * z
        for a in range(5):
            right[a] += row[a] * z
            for b in range(a + 1):
                normal[a, b] += row[a] * row[b]
    if number < 8:
        return z0, 0.05, 0.0, 1.0
    for a in range(5):
        normal[a, a] += 1e-4
    factor(normal)
    solve(normal, right, solution)
    for a in range(5):
        squares -= solution[a] * right[a]
    variance = max(squares, 0.0) / max(number - 5, 1) + 1e-8
    z, k = z0 + solution[0], 3 if abs(solution[3]) > abs(solution[4]) else 4
    step = solution[k]
    right[:] = 0.0
    right[0] = variance
    solve(normal, right, solution)
    sigma = math.sqrt(solution[0])
    right[0], right[k] = 0.0, variance
    solve(normal, right, solution)
    return z, sigma, step, math.sqrt(solution[k])


@njit(cache=True, nogil=True)
def clipped(
    px: float,
    py: float,
    ux: float,
    uy: float,
    stretch: tuple[float, float],
    box: tuple[float, float, float, float],
) -> tuple[float, float]:
    """Return the stretch of the line p + s u that lies in a box (west, south, east, north); empty: begin > end."""
    begin, end = stretch
    for axis in range(2):
        p, u = (px, ux) if axis == 0 else (py, uy)
        low, high = (box[0], box[2]) if axis == 0 else (box[1], box[3])
        if abs(u) < 1e-9:
            if p < low or p >= high:
                return 1.0, 0.0
            continue
        a, b = (low - p) / u, (high - p) / u
        begin, end = max(begin, min(a, b)), min(end, max(a, b))
    return begin, end


@njit(cache=True, nogil=True)
def stripes_in_area(
    work: F64,
    n: int,
    radius: float,
    levels: tuple[float, float],
    cell: tuple[float, float, float, float],
    least_t: float,
    out: F64,
) -> tuple[int, int]:
    """Find the stripes of a search area that pass through a cell.

    Parameters
    ----------
    work
        (n, 5): the points within 1.75 radii of its middle.
    levels
        Intensity of road and of paint, about.
    cell
        West, south, east and north edge from the middle of the search area.
    out
        Takes one row per stripe; indices are those of the points in `work`.

    Returns
    -------
    Their number, and why there are none; HOLES where a larger area should be tried.
    """
    dark, bright = levels
    for i in range(n):
        work[i, Q] = min(max((work[i, Q] - dark) / (bright - dark), -1.0), 1.5)
    angle = direction(work, n, radius)
    found = np.empty((MOST_STRIPES, 3))
    m = stripes_across(work, n, angle, radius, least_t, found)
    axes = (math.cos(angle), math.sin(angle))
    fit, covariance = np.empty(6), np.empty((6, 6))
    number, sparse = 0, False
    scale = 2.0 * radius
    wide = (cell[0] - 0.05, cell[1] - 0.05, cell[2] + 0.05, cell[3] + 0.05)
    strip = np.empty((n, 4))
    for j in range(m):
        right_edge, left_edge = found[j, 0], found[j, 1]
        offset, width = 0.5 * (right_edge + left_edge), left_edge - right_edge
        low, high = right_edge - 0.12 * scale, left_edge + 0.12 * scale
        for k in range(m):
            # Half way into the gap there is no paint of the neighbour
            if k != j and found[k, 1] <= right_edge:
                low = max(low, found[k, 1] + 0.2 * (right_edge - found[k, 1]))
            if k != j and found[k, 0] >= left_edge:
                high = min(high, found[k, 0] - 0.2 * (found[k, 0] - left_edge))
        # Stripes that do not come near the cell are left to others
        s0, s1 = clipped(-offset * axes[1], offset * axes[0], axes[0], axes[1], (-radius, radius), wide)
        if s1 <= s0:
            continue
        k = strip_of(work, n, axes, radius, (low, high), strip)
        near = strip[:k]
        fit[0], fit[1], fit[2], fit[3], fit[4], fit[5] = offset, 0.0, width, 0.0, 0.0, 0.7
        if fit_stripe(near, (-radius, radius), 0.03 * scale, 3, fit, covariance) == 0:
            sparse = True
            continue
        begin, end, parts = extent(near, radius, fit)
        if parts < 3:
            sparse = True
        if parts < 2 or end - begin < 0.15 * scale:
            continue
        # Precisely, on this stretch: an edge is passed over by 8 points or more
        blur = min(max(4.0 * (high - low) * scale / ((end - begin) * k), 0.01), 0.04 * scale)
        used = fit_stripe(near, (begin, end), blur, 4, fit, covariance)
        if used == 0 or not (fit[5] > fit[3] and fit[5] > fit[4]):
            continue
        begin, end, parts = extent(near, radius, fit)
        if parts < 2 or end - begin < 0.15 * scale:
            continue
        # The piece of the centreline in this cell
        root = math.sqrt(1.0 + fit[1] ** 2)
        ux, uy = (axes[0] - fit[1] * axes[1]) / root, (axes[1] + fit[1] * axes[0]) / root
        px, py = -fit[0] * axes[1], fit[0] * axes[0]
        s0, s1 = clipped(px, py, ux, uy, (begin * root, end * root), cell)
        if s1 - s0 < 0.04:
            continue
        s = 0.5 * (s0 + s1)
        at = s / root
        row = out[number]
        row[CX], row[CY], row[UX], row[UY] = px + s * ux, py + s * uy, ux, uy
        row[HALF_U] = min(s - begin * root, end * root - s)
        row[LENGTH] = (end - begin) * root
        row[HALF_V] = 0.5 * fit[2] / root
        row[SIGMA_V] = (
            math.sqrt(covariance[0, 0] + 2.0 * at * covariance[0, 1] + at * at * covariance[1, 1]) / root
        )
        row[SIGMA_U] = math.sqrt(covariance[1, 1])
        row[T_VALUE] = min(
            (fit[5] - fit[3]) / math.sqrt(covariance[5, 5] + covariance[3, 3] - 2.0 * covariance[5, 3]),
            (fit[5] - fit[4]) / math.sqrt(covariance[5, 5] + covariance[4, 4] - 2.0 * covariance[5, 4]),
        )
        row[CZ], row[SIGMA_Z], row[STEP], row[SIGMA_STEP] = height_of(near, (begin, end), fit, at)
        row[DARK] = dark + (bright - dark) * max(fit[3], fit[4])
        row[BRIGHT] = dark + (bright - dark) * fit[5]
        row[NUMBER] = used
        row[FIRST], row[LAST] = -1.0, -1.0
        number += 1
    return number, HOLES if sparse else (FOUND if number else NO_STRIPE)
