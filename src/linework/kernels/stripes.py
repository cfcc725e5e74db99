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
    total, number = 0.0, 0
    for i in range(n):
        if work[i, X] ** 2 + work[i, Y] ** 2 <= reach * reach:
            total += work[i, Q]
            number += 1
    mean = total / max(number, 1)
    # Bins of few points say little: as if this many more of the mean had been there
    few = 0.1 * number / N_TURN_BINS + 1.0
    # Many points settle a direction as well as all do
    stride = max(number // 400, 1)
    between = np.zeros(N_ANGLES)
    bins, counts = np.zeros(N_TURN_BINS), np.zeros(N_TURN_BINS)
    for k in range(N_ANGLES):
        angle = k * math.pi / N_ANGLES
        nx, ny = -math.sin(angle) * scale, math.cos(angle) * scale
        bins[:], counts[:] = 0.0, 0.0
        for i in range(0, n, stride):
            if work[i, X] ** 2 + work[i, Y] ** 2 <= reach * reach:
                b = min(int(work[i, X] * nx + work[i, Y] * ny + 0.5 * N_TURN_BINS), N_TURN_BINS - 1)
                bins[b] += work[i, Q] - mean
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
    taken = np.zeros(N_ACROSS, dtype=np.uint8)
    m = 0
    while m < MOST_STRIPES:
        best, first, last = least_t, -1, -1
        for a in range(2, N_ACROSS - 3):
            if taken[a]:
                continue
            a0 = max(a - N_SIDE, 0)
            n_right = number[a] - number[a0]
            if n_right < 3.0:
                continue
            right = (total[a] - total[a0]) / n_right
            for b in range(a + 1, min(a + 41, N_ACROSS - 1)):
                if taken[b - 1]:
                    break
                n_in = number[b] - number[a]
                b1 = min(b + N_SIDE, N_ACROSS)
                n_left = number[b1] - number[b]
                if n_in < 3.0 or n_left < 3.0:
                    continue
                mean = (total[b] - total[a]) / n_in
                left = (total[b1] - total[b]) / n_left
                if mean <= right or mean <= left:
                    continue
                t = min(
                    (mean - right) / math.sqrt(1.0 / n_in + 1.0 / n_right),
                    (mean - left) / math.sqrt(1.0 / n_in + 1.0 / n_left),
                ) / math.sqrt(variance)
                if t > best:
                    best, first, last = t, a, b
        if first < 0:
            break
        out[m, 0], out[m, 1], out[m, 2] = first * size - reach, last * size - reach, best
        m += 1
        taken[max(first - 1, 0) : min(last + 1, N_ACROSS)] = 1
    return m


@njit(cache=True, nogil=True)
def extent(
    work: F64,
    n: int,
    axes: tuple[float, float],
    radius: float,
    centre: tuple[float, float, float],
    middle: float,
) -> tuple[float, float, int]:
    """Return where along its direction a stripe begins and ends, and in how many of 8 parts between are points.

    centre: offset, slope and half width. The stretch with the largest sum of (brightness - middle) is the
    most likely one for paint that begins once and ends once; an end is half way to the next point beyond.
    """
    ux, uy = axes
    size = 2.0 * radius / N_ALONG
    value, low, high = np.zeros(N_ALONG), np.full(N_ALONG, np.inf), np.full(N_ALONG, -np.inf)
    half = max(0.8 * centre[2], 0.02)
    for i in range(n):
        u, v = work[i, X] * ux + work[i, Y] * uy, work[i, Y] * ux - work[i, X] * uy
        if abs(u) < radius and abs(v - centre[0] - centre[1] * u) <= half:
            b = int((u + radius) / size)
            value[b] += work[i, Q] - middle
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
    gap, previous, filled = size, low[first], 0
    part, parts = -1, 0
    for b in range(first, last + 1):
        if low[b] <= high[b]:
            gap = max(gap, low[b] - previous)
            previous = high[b]
            here = b * N_SLICES // N_ALONG
            if here != part:
                part, parts = here, parts + 1
            filled += 1
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
def fit_stripe(
    work: F64,
    n: int,
    axes: tuple[float, float],
    stretch: tuple[float, float],
    limits: tuple[float, float],
    blur: float,
    rounds: int,
    fit: F64,
    covariance: F64,
) -> int:
    """Fit a stripe to the brightness of all points around it by least squares; return the number of points.

    Brightness is that of the paint between two edges, that of the road on the left and on the right beyond
    them, and passes from one to the other over `blur` on both sides of an edge. `fit`: offset, slope, width,
    road left, road right, paint (changed in place). `covariance` (6, 6) takes the scatter between eight parts
    along the stripe for independent, not that of the points: worn places and stains are larger than those.
    """
    ux, uy = axes
    width0 = fit[2]
    normal, right = np.zeros((6, 6)), np.zeros(6)
    row = np.zeros(6)
    scores = np.zeros((N_SLICES, 6))
    number, squares = 0, 0.0
    for k in range(rounds + 1):
        normal[:], right[:], scores[:] = 0.0, 0.0, 0.0
        number, squares = 0, 0.0
        for i in range(n):
            u, v = work[i, X] * ux + work[i, Y] * uy, work[i, Y] * ux - work[i, X] * uy
            if v <= limits[0] or v >= limits[1] or u <= stretch[0] or u >= stretch[1]:
                continue
            d = v - fit[0] - fit[1] * u
            share = min(max((0.5 * fit[2] - abs(d)) / (2.0 * blur) + 0.5, 0.0), 1.0)
            road = fit[3] if d > 0.0 else fit[4]
            row[:] = 0.0
            if share > 0.0 and share < 1.0:
                rise = (fit[5] - road) / (2.0 * blur)
                row[0] = rise if d > 0.0 else -rise
                row[1] = row[0] * u
                row[2] = 0.5 * rise
            row[3 if d > 0.0 else 4] = 1.0 - share
            row[5] = share
            residual = work[i, Q] - (road + (fit[5] - road) * share)
            squares += residual * residual
            number += 1
            part = min(int((u - stretch[0]) / (stretch[1] - stretch[0]) * N_SLICES), N_SLICES - 1)
            for a in range(6):
                if row[a] != 0.0:
                    scores[part, a] += row[a] * residual
                    for b in range(a, 6):
                        normal[a, b] += row[a] * row[b]
        if number < 8:
            return 0
        variance = squares / number + 1e-6
        # Known before: the width to about 5 cm, the slope to 0.2, levels to the range of brightness
        normal[0, 0] += variance / 0.1**2
        normal[1, 1] += variance / 0.2**2
        normal[2, 2] += variance / 0.05**2
        right[2] = (width0 - fit[2]) * variance / 0.05**2
        right[1] = -fit[1] * variance / 0.2**2
        for a in range(6):
            normal[a, a] += 1e-3 * variance
            for b in range(N_SLICES):
                right[a] += scores[b, a]
            for b in range(a):
                normal[a, b] = normal[b, a]
        if k < rounds:
            step = np.linalg.solve(normal, right)
            quarter = max(0.25 * fit[2], 0.01)
            fit[0] += min(max(step[0], -quarter), quarter)
            fit[1] += min(max(step[1], -0.1), 0.1)
            fit[2] = max(fit[2] + min(max(step[2], -quarter), quarter), 0.02)
            for a in range(3, 6):
                fit[a] += step[a]
    inverse = np.linalg.inv(normal)
    middle = np.zeros((6, 6))
    for b in range(N_SLICES):
        for a in range(6):
            for c in range(6):
                middle[a, c] += scores[b, a] * scores[b, c]
    sandwich = inverse @ middle @ inverse
    for a in range(6):
        for c in range(6):
            # 8 parts, of which as many as two unknowns of an edge are spent
            covariance[a, c] = N_SLICES / (N_SLICES - 2.0) * sandwich[a, c] + variance * inverse[a, c]
    return number


@njit(cache=True, nogil=True)
def height_of(
    work: F64,
    n: int,
    axes: tuple[float, float],
    stretch: tuple[float, float],
    fit: F64,
    side: float,
    at: float,
) -> tuple[float, float, float, float]:
    """Return the height of the stripe's centre at `at` and its sigma; the step between its sides and its sigma.

    One plane on both sides of the centre, and a step between them: paint has none, a kerb has.
    """
    ux, uy = axes
    normal, right = np.zeros((4, 4)), np.zeros(4)
    row = np.ones(4)
    reach = 0.5 * fit[2] + side
    z0, squares, number = 0.0, 0.0, 0
    for i in range(n):
        u, v = work[i, X] * ux + work[i, Y] * uy, work[i, Y] * ux - work[i, X] * uy
        d = v - fit[0] - fit[1] * u
        if abs(d) > reach or u < stretch[0] or u > stretch[1]:
            continue
        if number == 0:
            z0 = work[i, Z]
        number += 1
        row[1], row[2], row[3] = u - at, d, 0.5 if d > 0.0 else -0.5
        z = work[i, Z] - z0
        squares += z * z
        for a in range(4):
            right[a] += row[a] * z
            for b in range(4):
                normal[a, b] += row[a] * row[b]
    if number < 6:
        return z0, 0.05, 0.0, 1.0
    for a in range(4):
        normal[a, a] += 1e-4
    solution = np.linalg.solve(normal, right)
    inverse = np.linalg.inv(normal)
    rest = squares
    for a in range(4):
        rest -= solution[a] * right[a]
    variance = max(rest, 0.0) / max(number - 4, 1) + 1e-8
    return (
        z0 + solution[0], math.sqrt(variance * inverse[0, 0]),
        solution[3], math.sqrt(variance * inverse[3, 3]),
    )  # fmt: skip


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
        fit[0], fit[1], fit[2], fit[3], fit[4], fit[5] = offset, 0.0, width, 0.0, 0.0, 0.7
        stretch = (-radius, radius)
        if fit_stripe(work, n, axes, stretch, (low, high), 0.03 * scale, 3, fit, covariance) == 0:
            sparse = True
            continue
        middle = 0.5 * fit[5] + 0.25 * (fit[3] + fit[4])
        begin, end, parts = extent(work, n, axes, radius, (fit[0], fit[1], 0.5 * fit[2]), middle)
        if parts < 3:
            sparse = True
        if parts < 2 or end - begin < 0.15 * scale:
            continue
        # Precisely, on this stretch: an edge is passed over by 8 points or more
        stretch = (begin, end)
        in_strip = 0
        for i in range(n):
            u, v = work[i, X] * axes[0] + work[i, Y] * axes[1], work[i, Y] * axes[0] - work[i, X] * axes[1]
            if v > low and v < high and u > begin and u < end:
                in_strip += 1
        blur = min(max(4.0 * (high - low) / max(in_strip, 1), 0.01), 0.04 * scale)
        used = fit_stripe(work, n, axes, stretch, (low, high), blur, 4, fit, covariance)
        if used == 0 or not (fit[5] > fit[3] and fit[5] > fit[4]):
            continue
        middle = 0.5 * fit[5] + 0.25 * (fit[3] + fit[4])
        begin, end, parts = extent(work, n, axes, radius, (fit[0], fit[1], 0.5 * fit[2]), middle)
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
        row[CZ], row[SIGMA_Z], row[STEP], row[SIGMA_STEP] = height_of(
            work, n, axes, (begin, end), fit, 0.2 * scale, at
        )
        row[DARK] = dark + (bright - dark) * max(fit[3], fit[4])
        row[BRIGHT] = dark + (bright - dark) * fit[5]
        row[NUMBER] = used
        row[FIRST], row[LAST] = -1.0, -1.0
        number += 1
    return number, HOLES if sparse else (FOUND if number else NO_STRIPE)
