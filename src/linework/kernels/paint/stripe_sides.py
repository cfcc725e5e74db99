"""The road on both sides of a stripe, also beyond a dark band beside it: a sealed joint, a crack, a groove.

Separate from `stripe_fit`, whose flanks are as narrow as such a band.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.paint.paint_points import POINT_INTENSITY, POINT_X, POINT_Y
from linework.kernels.paint.stripe_fit import (
    FIT_OFFSET,
    FIT_PAINT,
    FIT_ROAD_LEFT,
    FIT_ROAD_RIGHT,
    FIT_SLOPE,
    FIT_WIDTH,
)
from linework.kernels.paint.stripe_search import BAND_LEFT, BAND_RIGHT

#: Where beside the edge of a stripe a dark band shows, and where the road beyond it does: sealed joints are 0.05 to 0.12 m
#: wide. [m]
BAND_FROM_M, BAND_TO_M, BEYOND_FROM_M, BEYOND_TO_M = 0.01, 0.07, 0.12, 0.27
#: A dark band is darker than the road on the other side by at least this share of the contrast of the paint. Set by
#: hand on roundabout 8502, 2026-11-27, where it is 0.8 (joint 40, road 74, stripe 117 counts).
LEAST_DARKER = 0.15
#: Share of that difference that the road beyond the band makes up for: nearer to the level of the other side than to that
#: of the band. Set by hand on roundabout 8502, 2026-11-27, where it is more than all (road beyond 120 counts).
GONE_BEYOND = 0.5
#: Widest line: a wider band may be road [m].
WIDEST_LINE_M = 0.45
#: Fewest points that show a level: the mean of 5 scatters by 0.45 of one point's noise; not fitted, set by hand on
#: roundabout 8502, 2026-11-27. And how far beyond the edge of another line its own points may lie: the spot of a beam [m].
FEWEST_BESIDE, BESIDE_BAND_M = 5, 0.02
#: Smallest contrast that the difference of the sides is divided by, of that of the search area's bright points: set by hand
#: on roundabout 8502, 2026-11-27; it only keeps the quotient finite where a stripe is no brighter than its sides.
LEAST_EXCESS = 0.01


@njit(cache=True, nogil=True)
def sides_of(
    work: FloatArray,
    n: int,
    axes: tuple[float, float],
    stretch: tuple[float, float],
    fit: FloatArray,
    bands: FloatArray,
    j: int,
) -> float:
    """Return the difference of the road on both sides of a stripe over the contrast of its paint, 0 and more.

    Where a dark band lies along a side, and the road beyond it is brighter again, that is the road on this side: along
    a sealed joint in a wheel track, a soft shoulder and a crisp edge look like a stripe, and behind the joint the road
    goes on as bright as it.

    Parameters
    ----------
    work
        (n or more, 5): points of the search area, brightness scaled to 0 for road and 1 for paint.
    axes, stretch
        Unit vector along the search area's direction; begin and end of the stripe [m].
    fit
        (6,): see `linework.kernels.paint.stripe_fit.fit_stripe`.
    bands, j
        (m, 3) all stripes of the search area, see `stripes_across`, and the number of this one.
    """
    road = np.array((fit[FIT_ROAD_LEFT], fit[FIT_ROAD_RIGHT]))
    found = road.copy()
    for side in range(2):
        sign, other = 1.0 - 2.0 * side, road[1 - side]
        band = level_beside(work, n, axes, stretch, fit, (sign, BAND_FROM_M, BAND_TO_M), bands, j)
        beyond = level_beside(work, n, axes, stretch, fit, (sign, BEYOND_FROM_M, BEYOND_TO_M), bands, j)
        # False where too few points show them
        is_dark = other - band >= LEAST_DARKER * (fit[FIT_PAINT] - other)
        if is_dark and beyond - band >= GONE_BEYOND * (other - band):
            found[side] = beyond
    contrast = fit[FIT_PAINT] - min(found[0], found[1])
    return float(abs(found[0] - found[1]) / max(contrast, LEAST_EXCESS))


@njit(cache=True, nogil=True)
def level_beside(
    work: FloatArray,
    n: int,
    axes: tuple[float, float],
    stretch: tuple[float, float],
    fit: FloatArray,
    where: tuple[float, float, float],
    bands: FloatArray,
    j: int,
) -> float:
    """Return the mean brightness of the points beside a stripe, off other lines; NaN for too few points.

    where: side, +1 on the left, -1 on the right, and from where to where beyond the edge [m]; the rest as for `sides_of`.
    """
    begin, end = stretch
    sign, first, last = where
    total, number = 0.0, 0
    for i in range(n):
        u = work[i, POINT_X] * axes[0] + work[i, POINT_Y] * axes[1]
        if u <= begin or u >= end:
            continue
        v = work[i, POINT_Y] * axes[0] - work[i, POINT_X] * axes[1]
        d = sign * (v - fit[FIT_OFFSET] - fit[FIT_SLOPE] * u) - 0.5 * fit[FIT_WIDTH]
        if d <= first or d >= last:
            continue
        is_free = True
        for k in range(len(bands)):
            right, left = bands[k, BAND_RIGHT], bands[k, BAND_LEFT]
            inside = right - BESIDE_BAND_M <= v <= left + BESIDE_BAND_M
            # Neither the own band nor one that holds it, as a shoulder does
            holds = right <= bands[j, BAND_RIGHT] and left >= bands[j, BAND_LEFT]
            is_free = is_free and (holds or not inside or left - right > WIDEST_LINE_M)
        if is_free:
            total += work[i, POINT_INTENSITY]
            number += 1
    return total / number if number >= FEWEST_BESIDE else np.nan
