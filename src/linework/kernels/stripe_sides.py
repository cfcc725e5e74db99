"""What is beside a stripe of paint: worn edges, other bright ground, steps; and the stripe's height."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.cholesky import factor, solve


@njit(cache=True, nogil=True)
def edge_variance(strip: FloatArray, stretch: tuple[float, float], across: float, fit: FloatArray) -> float:
    """Return the variance of a stripe's centre that the fit does not see: gaps between points, and worn edges.

    Across the road points follow each other at a distance a, at random: an edge half way between the last one on
    the paint and the next one beside it is off by a / sqrt(2), the centre between two edges by a / 2. And where a
    share f of the paint between the edges is gone, as much may be gone beyond one of them: f / (1 - f) of the
    width, evenly distributed.
    """
    inside, paint, gone = 0, 1, 0
    middle = 0.5 * fit[5] + 0.25 * (fit[3] + fit[4])
    for i in range(len(strip)):
        u = strip[i, 0]
        if u > stretch[0] and u < stretch[1]:
            inside += 1
            if abs(strip[i, 1] - fit[0] - fit[1] * u) < 0.45 * fit[2]:
                paint += 1
                gone += strip[i, 2] < middle
    apart = across / max(inside, 1)
    worn = min(gone / paint, 0.6)
    return float((0.5 * apart) ** 2 + (worn / (1.0 - worn) * fit[2]) ** 2 / 12.0)


@njit(cache=True, nogil=True)
def bright_beside(strip: FloatArray, stretch: tuple[float, float], fit: FloatArray, side: float) -> float:
    """Return the share of points within `side` of a stripe's edges that look like its paint, on the worse side.

    The road beside paint has next to none, whatever its level; a strip of grass beside other grass has many.
    """
    counts = np.zeros((2, 2))
    for i in range(len(strip)):
        d = strip[i, 1] - fit[0] - fit[1] * strip[i, 0]
        beyond = abs(d) - 0.5 * fit[2]
        if beyond > 0.0 and beyond < side and strip[i, 0] > stretch[0] and strip[i, 0] < stretch[1]:
            k = 0 if d > 0.0 else 1
            counts[k, 0] += 1.0
            counts[k, 1] += 1.0 if strip[i, 2] > 0.5 * (fit[5] + fit[3 + k]) else 0.0
    left, right = counts[0, 1] / max(counts[0, 0], 1.0), counts[1, 1] / max(counts[1, 0], 1.0)
    return float(max(left, right))


@njit(cache=True, nogil=True)
def height_of(
    strip: FloatArray, stretch: tuple[float, float], fit: FloatArray, at: float, side: float
) -> tuple[float, float, float, float]:
    """Return the height of the stripe's centre at `at` and its sigma; the height of a kerb here and its sigma.

    What lies within `side` of the stripe counts. Paint lies in one plane with the road on both its sides.
    """
    normal, right, solution, row = np.zeros((4, 4)), np.zeros(4), np.zeros(4), np.ones(4)
    half = 0.5 * fit[2]
    points, number = np.empty((len(strip), 3)), 0
    for i in range(len(strip)):
        u = strip[i, 0]
        d = strip[i, 1] - fit[0] - fit[1] * u
        if u >= stretch[0] and u <= stretch[1] and abs(d) <= half + side:
            points[number, 0], points[number, 1] = u - at, d
            points[number, 2] = strip[i, 3] - strip[0, 3]
            number += 1
    if number < 8:
        return strip[0, 3], 0.05, 0.0, 1.0
    points = points[:number]
    # The plane through all points
    for i in range(number):
        row[1], row[2], row[3] = points[i, 0], points[i, 1], 0.0
        _add(row, points[i, 2], normal, right)
    _solve(normal, right, solution)
    zones = np.zeros((4, 3))
    total = 0.0
    for i in range(number):
        off = points[i, 2] - solution[0] - solution[1] * points[i, 0] - solution[2] * points[i, 1]
        d = points[i, 1]
        zone = (0 if d < -half else 1) if d < 0.0 else (2 if d < half else 3)
        zones[zone, 0] += 1.0
        zones[zone, 1] += off
        zones[zone, 2] += off * off
        total += off * off
    z, variance = strip[0, 3] + solution[0], total / max(number - 3, 1) + 1e-8
    right[:] = 0.0
    right[0] = variance
    solve(normal, right, solution)
    sigma = math.sqrt(solution[0])
    # A step between the planes of the two sides
    normal[:], right[:] = 0.0, 0.0
    for i in range(number):
        if abs(points[i, 1]) >= half:
            row[1], row[2], row[3] = points[i, 0], points[i, 1], 0.5 if points[i, 1] > 0.0 else -0.5
            _add(row, points[i, 2], normal, right)
    _solve(normal, right, solution)
    height, noise = bent(zones)
    step = abs(solution[3])
    right[:] = 0.0
    right[3] = noise * noise
    solve(normal, right, solution)
    sigma_step, sigma_height = math.sqrt(solution[3]), noise / 0.3 / math.sqrt(0.25 * number)
    if step - 3.0 * sigma_step > height - 3.0 * sigma_height:
        return z, sigma, step, sigma_step
    return z, sigma, height, sigma_height


@njit(cache=True, nogil=True)
def _add(row: FloatArray, value: float, normal: FloatArray, right: FloatArray) -> None:
    """Add an observation to normal equations of four unknowns."""
    for a in range(4):
        right[a] += row[a] * value
        for b in range(a + 1):
            normal[a, b] += row[a] * row[b]


@njit(cache=True, nogil=True)
def _solve(normal: FloatArray, right: FloatArray, out: FloatArray) -> None:
    """Solve normal equations in place, unknowns without observations become 0."""
    for a in range(4):
        normal[a, a] += 1e-4
    factor(normal)
    solve(normal, right, out)


@njit(cache=True, nogil=True)
def bent(zones: FloatArray) -> tuple[float, float]:
    """Return the height of a kerb that would bend four zones off their plane as far, and the noise.

    zones: number, sum and sum of squares of the distances from the plane: right of the stripe, its right and left
    half, left of it. A kerb leaves 0.3 of its height in one of them. The noise is that on both sides; where the
    stripe is twice as rough (the face of a kerb, grass), it is as if half of that were a bend.
    """
    # Degrees of freedom and squares of what scatters: beside the stripe, and on it
    free, square, largest = np.zeros(2), np.zeros(2), 0.0
    for k in range(4):
        if zones[k, 0] >= 3.0:
            on = 1 if k == 1 or k == 2 else 0
            mean = zones[k, 1] / zones[k, 0]
            free[on] += zones[k, 0] - 1.0
            square[on] += max(zones[k, 2] - mean * zones[k, 1], 0.0)
            largest = max(largest, abs(mean))
    if free[0] < 3.0:
        return 0.0, 1.0
    noise = math.sqrt(square[0] / free[0] + 1e-8)
    if free[1] > 0.0 and square[1] / free[1] > 3.0 * noise * noise:
        largest = max(largest, 0.5 * math.sqrt(square[1] / free[1] - noise * noise))
    return largest / 0.3, noise
