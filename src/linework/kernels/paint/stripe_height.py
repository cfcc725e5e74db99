"""The height of a stripe of paint, and that of a kerb under it.

Separate from `stripes`, which fits a stripe in plan by intensity: this fits heights, in which a kerb under the stripe
shows as a bend.

Bright stone and grass beside a kerb look like paint; but paint lies in one plane with the road on both its sides.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.paint.stripe_fit import (
    FEWEST_FITTED,
    FIT_OFFSET,
    FIT_SLOPE,
    FIT_WIDTH,
    STRIP_HEIGHT,
    STRIP_U,
    STRIP_V,
)
from linework.kernels.tracking.small_systems import factor, solve

#: Unknowns of the road's plane about a stripe: height [m], slopes along and across, step from right to left [m].
PLANE_CENTRE, PLANE_ALONG, PLANE_ACROSS, PLANE_STEP = range(4)
PLANE_UNKNOWNS = 4
#: Zones across a stripe: right of it, its right half, its left half, left of it.
ZONE_RIGHT, ZONE_RIGHT_HALF, ZONE_LEFT_HALF, ZONE_LEFT = range(4)
#: Columns of a zone: points, sum and sum of squares of their distances from the plane [m, m^2].
ZONE_N, ZONE_SUM, ZONE_SQUARES = range(3)
#: A height without enough points for a plane: its sigma; and the sigma of an unknown step. [m]
UNKNOWN_HEIGHT_M, UNKNOWN_STEP_M = 0.05, 1.0
#: A kerb under a stripe leaves this share of its height in one of the four zones.
KERB_IN_ZONE = 0.3
#: Variance on the stripe over that beside it, from which on it is rough, as a kerb's face or grass are.
ROUGH_RATIO = 3.0
#: Weight, in points, that holds the unknowns of a plane to 0 where no point determines them.
PLANE_DAMPING = 1e-4
#: Significance of a step. [standard deviations]
STEP_SIGMAS = 3.0
#: Smallest variance of a height, against division by zero. [m^2]
LEAST_HEIGHT_VARIANCE = 1e-8


@njit(cache=True, nogil=True)
def height_of(
    strip: FloatArray, stretch: tuple[float, float], fit: FloatArray, at: float, side: float
) -> tuple[float, float, float, float, float]:
    """Return the height of a stripe's centre and its sigma; that of a kerb under it and its sigma; and its rise [m].

    The rise is by how much the ground on its left lies higher than that on its right, both planes carried to its
    middle; NaN with too few points, or none on one side. Points within `side` [m] of the stripe count. Paint lies in
    one plane with the road on both its sides.
    `strip` (n, 4), `stretch`, `fit` (6,) as for `linework.kernels.paint.stripe_fit.edge_variance`; `at`: position along
    the stripe [m].
    """
    begin, end = stretch
    normal, right = np.zeros((PLANE_UNKNOWNS, PLANE_UNKNOWNS)), np.zeros(PLANE_UNKNOWNS)
    solution, row = np.zeros(PLANE_UNKNOWNS), np.ones(PLANE_UNKNOWNS)
    half = 0.5 * fit[FIT_WIDTH]
    along, across, height = np.empty(len(strip)), np.empty(len(strip)), np.empty(len(strip))
    number = 0
    for i in range(len(strip)):
        u = strip[i, STRIP_U]
        d = strip[i, STRIP_V] - fit[FIT_OFFSET] - fit[FIT_SLOPE] * u
        if u >= begin and u <= end and abs(d) <= half + side:
            along[number], across[number] = u - at, d
            height[number] = strip[i, STRIP_HEIGHT] - strip[0, STRIP_HEIGHT]
            number += 1
    if number < FEWEST_FITTED:
        return strip[0, STRIP_HEIGHT], UNKNOWN_HEIGHT_M, 0.0, UNKNOWN_STEP_M, math.nan
    # The plane through all points
    for i in range(number):
        row[PLANE_ALONG], row[PLANE_ACROSS], row[PLANE_STEP] = along[i], across[i], 0.0
        _add(row, height[i], normal, right)
    _solve(normal, right, solution)
    zones = np.zeros((4, 3))
    total = 0.0
    for i in range(number):
        d = across[i]
        off = (
            height[i] - solution[PLANE_CENTRE] - solution[PLANE_ALONG] * along[i] - solution[PLANE_ACROSS] * d
        )
        if d < 0.0:
            zone = ZONE_RIGHT if d < -half else ZONE_RIGHT_HALF
        else:
            zone = ZONE_LEFT_HALF if d < half else ZONE_LEFT
        zones[zone, ZONE_N] += 1.0
        zones[zone, ZONE_SUM] += off
        zones[zone, ZONE_SQUARES] += off * off
        total += off * off
    z = strip[0, STRIP_HEIGHT] + solution[PLANE_CENTRE]
    variance = total / max(number - 3, 1) + LEAST_HEIGHT_VARIANCE
    right[:] = 0.0
    right[PLANE_CENTRE] = variance
    solve(normal, right, solution)
    sigma = math.sqrt(solution[PLANE_CENTRE])
    # A step between the planes of the two sides
    normal[:], right[:] = 0.0, 0.0
    for i in range(number):
        if abs(across[i]) >= half:
            row[PLANE_ALONG], row[PLANE_ACROSS] = along[i], across[i]
            row[PLANE_STEP] = 0.5 if across[i] > 0.0 else -0.5
            _add(row, height[i], normal, right)
    _solve(normal, right, solution)
    kerb, noise = kerb_from_bend(zones)
    step = abs(solution[PLANE_STEP])
    is_known = zones[ZONE_RIGHT, ZONE_N] > 0.0 and zones[ZONE_LEFT, ZONE_N] > 0.0
    rise = solution[PLANE_STEP] if is_known else math.nan
    right[:] = 0.0
    right[PLANE_STEP] = noise * noise
    solve(normal, right, solution)
    sigma_step, sigma_kerb = math.sqrt(solution[PLANE_STEP]), noise / KERB_IN_ZONE / math.sqrt(0.25 * number)
    if step - STEP_SIGMAS * sigma_step > kerb - STEP_SIGMAS * sigma_kerb:
        return z, sigma, step, sigma_step, rise
    return z, sigma, kerb, sigma_kerb, rise


@njit(cache=True, nogil=True)
def _add(row: FloatArray, value: float, normal: FloatArray, right: FloatArray) -> None:
    """Add an observation to the normal equations of a plane."""
    for a in range(PLANE_UNKNOWNS):
        right[a] += row[a] * value
        for b in range(a + 1):
            normal[a, b] += row[a] * row[b]


@njit(cache=True, nogil=True)
def _solve(normal: FloatArray, right: FloatArray, out: FloatArray) -> None:
    """Solve the normal equations of a plane in place; unknowns without observations become 0."""
    for a in range(PLANE_UNKNOWNS):
        normal[a, a] += PLANE_DAMPING
    factor(normal)
    solve(normal, right, out)


@njit(cache=True, nogil=True)
def kerb_from_bend(zones: FloatArray) -> tuple[float, float]:
    """Return the height of a kerb that would bend four zones this far off their plane, and the noise [m].

    The noise is that beside the stripe; where the stripe itself is twice as rough (the face of a kerb, grass), half
    of its roughness counts as a bend.

    Parameters
    ----------
    zones
        (4, 3): rows `ZONE_RIGHT` to `ZONE_LEFT`, columns `ZONE_N`, `ZONE_SUM`, `ZONE_SQUARES`.
    """
    # Degrees of freedom and sum of squares of the scatter: beside the stripe, and on it
    free_beside = free_on = square_beside = square_on = largest = 0.0
    for k in range(4):
        if zones[k, ZONE_N] >= 3.0:
            mean = zones[k, ZONE_SUM] / zones[k, ZONE_N]
            square = max(zones[k, ZONE_SQUARES] - mean * zones[k, ZONE_SUM], 0.0)
            if k == ZONE_RIGHT_HALF or k == ZONE_LEFT_HALF:
                free_on += zones[k, ZONE_N] - 1.0
                square_on += square
            else:
                free_beside += zones[k, ZONE_N] - 1.0
                square_beside += square
            largest = max(largest, abs(mean))
    if free_beside < 3.0:
        return 0.0, UNKNOWN_STEP_M
    noise = math.sqrt(square_beside / free_beside + LEAST_HEIGHT_VARIANCE)
    if free_on > 0.0 and square_on / free_on > ROUGH_RATIO * noise * noise:
        largest = max(largest, 0.5 * math.sqrt(square_on / free_on - noise * noise))
    return largest / KERB_IN_ZONE, noise
