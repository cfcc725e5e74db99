"""Detection of bright stripes in image rows: a rising and a falling edge, as far apart as paint is wide there."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from linework.arrays import ByteArray, FloatArray

#: Columns of a table of stripes: column and row [pixels], width [pixels], contrast [grey values], standard
#: deviation of the column [pixels], level of the road beside it [grey values].
COL, ROW, WIDTH, STRIPE_CONTRAST, STRIPE_SIGMA, LEVEL = range(6)
#: Columns of such a table.
ROW_STRIPE_COLUMNS = 6
#: Most stripes kept per row, a bound on memory.
MOST_PER_ROW = 64
#: Length on either side of an edge over which grey values are averaged, on the road: longer than the grain of asphalt,
#: shorter than paint is wide [m]; and its largest extent [pixels].
GRAIN_M, MOST_GRAIN_PX = 0.025, 8
#: Width of the road beside a stripe that its level is taken from [m], beginning this far off the edge for the blur of
#: the image [pixels].
ROAD_BESIDE_M, EDGE_BLUR_PX = 0.15, 1.0
#: Road farther off, from and to [m]: a strip of light between two narrow shadows is no brighter than that. Paint has at
#: least this share of its contrast over the darker side there.
FAR_BESIDE_M, FAR_SHARE = (0.20, 0.60), 0.5
#: Stripes under this width are blurred as a whole: their middle is a centre of gravity. [pixels]
NARROW_PX = 4
#: Smallest noise of a pixel: grey values are rounded to integers, which alone gives 1 / sqrt(12). [grey values]
LEAST_NOISE = 0.3
#: Ratio of the standard deviation to the median absolute value of normal errors.
MEDIAN_TO_SIGMA = 1.4826
#: Least drop at the falling edge as a share of the rise at the rising one; and the ratio from which a second falling
#: edge ends the stripe. How they were chosen is not recorded.
LEAST_STRIPE_FALL, SECOND_FALL = 0.5, 1.5
#: Share of the smallest contrast in sigmas that a measured stripe must reach. How it was chosen is not recorded.
MEASURED_CONTRAST = 0.7
#: Slack of the widths in the search, and of the smallest measured width. [pixels]
WIDTH_SLACK_PX, NARROWEST_SLACK_PX = 1.0, 0.7


class MeasuredStripe(NamedTuple):
    """A stripe of one row: middle (NaN where it is none), width [pixels], contrast, sigma of the middle, level."""

    col: float
    width: float
    contrast: float
    sigma: float
    level: float


@njit(cache=True, nogil=True)
def _noise_of(row: ByteArray, start: int, end: int) -> float:
    """Return the standard deviation of a pixel of a row, from the median difference of neighbours. [grey values]"""  # noqa: D400
    count = np.zeros(256, dtype=np.int64)
    for u in range(start, end - 1):
        count[abs(np.int64(row[u + 1]) - np.int64(row[u]))] += 1
    half, total = (end - 1 - start) / 2.0, 0.0
    for level in range(256):
        if total + count[level] >= half:
            # Grey values are integers: interpolate the median within its level
            part = (half - total) / max(count[level], 1)
            return float(max((level - 0.5 + part) * MEDIAN_TO_SIGMA / math.sqrt(2.0), LEAST_NOISE))
        total += count[level]
    return 1.0


@njit(cache=True, nogil=True)
def _mean(total: FloatArray, start: int, end: int) -> float:
    """Return the mean of the pixels from start to end, from a running sum."""
    return float((total[end] - total[start]) / (end - start))


@njit(cache=True, nogil=True)
def _crossing(row: ByteArray, near: int, reach: int, level: float, rises: bool) -> tuple[float, float]:
    """Return where grey values cross a level, nearest to a place [pixels], and their slope there; NaN for nowhere."""
    best, slope, off = np.nan, 0.0, np.inf
    for u in range(max(near - reach, 0), min(near + reach, len(row) - 2) + 1):
        a, b = float(row[u]), float(row[u + 1])
        if (rises and a < level <= b) or (not rises and a >= level > b):
            place = u + (level - a) / (b - a)
            if abs(place - near) < off:
                best, slope, off = place, abs(b - a), abs(place - near)
    return best, slope


@njit(cache=True, nogil=True)
def stripes_of_rows(
    image: ByteArray, plane: FloatArray, per_disparity: float, rows: tuple[int, int], widths_m: tuple[float, float],
    gates: tuple[float, float],
) -> tuple[FloatArray, npt.NDArray[np.int64]]:  # fmt: skip
    """Return the stripes of an image, row by row from the bottom upwards, and each row's first.

    Parameters
    ----------
    image
        (height, width) uint8.
    plane
        (3,) disparity of the road at column 0 and row 0, per column, per row. [pixels, 1, 1]
    per_disparity
        Pixels across per metre of road and pixel of disparity: 1 / base. [1/m]
    rows
        First (lowest) row and the row after the last, counted upwards.
    widths_m
        Smallest and largest width along the rows. [m]
    gates
        Smallest contrast: in standard deviations of the noise, and relative to the road beside the stripe.

    Returns
    -------
    table
        (n, 6): columns `COL` to `LEVEL`.
    first
        (height + 1,) int64: the first stripe of row ``rows[0] - i``.
    """
    height, width = image.shape
    least_sigmas, least_share = gates
    narrowest_m, widest_m = widths_m
    at_origin, per_col, per_row = plane[0], plane[1], plane[2]
    table = np.empty((MOST_PER_ROW * max(rows[0] - rows[1], 1), ROW_STRIPE_COLUMNS))
    first = np.zeros(height + 1, dtype=np.int64)
    total, step = np.zeros(width + 1), np.zeros(width)
    n, line = 0, 0
    for v in range(rows[0], rows[1], -1):
        first[line] = n
        line += 1
        row = image[v]
        d0 = at_origin + per_row * v
        scale_0, scale_1 = d0 * per_disparity, (d0 + per_col * (width - 1)) * per_disparity
        if min(scale_0, scale_1) <= 0.0:
            continue
        for u in range(width):
            total[u + 1] = total[u] + row[u]
        scale = 0.5 * (scale_0 + scale_1)
        k = min(max(round(GRAIN_M * scale), 1), MOST_GRAIN_PX)
        noise = _noise_of(row, 0, width)
        # Steps between the means of k pixels on either side
        for u in range(k, width - k):
            step[u] = (total[u + k] - total[u] - total[u] + total[u - k]) / k
        step[:k], step[width - k :] = 0.0, 0.0
        least = least_sigmas * noise * math.sqrt(2.0 / k)
        kept = 0
        u = k
        while u < width - k and kept < MOST_PER_ROW:
            up = step[u]
            if not (up >= least and up > step[u - 1] and up >= step[u + 1]):
                u += 1
                continue
            local = (d0 + per_col * u) * per_disparity
            narrow, wide = narrowest_m * local - WIDTH_SLACK_PX, widest_m * local + WIDTH_SLACK_PX
            # The strongest falling edge within the width of paint, before a rising one as strong
            end, down = -1, -LEAST_STRIPE_FALL * up
            for w in range(u + 1, min(int(u + wide) + 1, width - k)):
                if step[w] > up:
                    break
                if step[w] < down and step[w] <= step[w - 1] and step[w] < step[w + 1] and w - u >= narrow:
                    if end >= 0 and step[w] > SECOND_FALL * down:
                        break
                    end, down = w, step[w]
            if end > u:
                stripe = _measured(row, total, u, end, local, noise)
                if (
                    stripe.contrast >= least_sigmas * noise * MEASURED_CONTRAST
                    and stripe.contrast >= least_share * stripe.level
                    and not math.isnan(stripe.col)
                ):
                    if narrowest_m * local - NARROWEST_SLACK_PX <= stripe.width <= wide:
                        table[n, COL], table[n, ROW], table[n, WIDTH] = stripe.col, v, stripe.width
                        table[n, STRIPE_CONTRAST], table[n, STRIPE_SIGMA] = stripe.contrast, stripe.sigma
                        table[n, LEVEL] = stripe.level
                        n += 1
                        kept += 1
                        u = end
            u += 1
    first[line:] = n
    return table[:n].copy(), first


@njit(cache=True, nogil=True)
def _measured(
    row: ByteArray, total: FloatArray, start: int, end: int, local: float, noise: float
) -> MeasuredStripe:
    """Return the stripe between two steps, measured to a fraction of a pixel.

    A step at u lies between the pixels u - 1 and u. Edges are where the grey value is half-way between the paint and
    the road beside that edge. Where the paint is so narrow that blur lowers its level, the middle is the centre of
    gravity of what is brighter than the road.
    """
    width = len(row)
    beside, off = max(round(ROAD_BESIDE_M * local), 2), int(EDGE_BLUR_PX)
    a0, a1 = max(start - off - beside, 0), max(start - off, 1)
    b0, b1 = min(end + off, width - 1), min(end + off + beside, width)
    left, right = _mean(total, min(a0, a1 - 1), a1), _mean(total, b0, max(b1, b0 + 1))
    level = max(left, right)
    if end - start >= NARROW_PX:
        paint = _mean(total, start + 1, end - 1)
    else:
        paint = 0.0
        for u in range(start, end):
            paint = max(paint, float(row[u]))
    contrast = paint - level
    c0, c1 = int(start - FAR_BESIDE_M[1] * local), int(start - FAR_BESIDE_M[0] * local)
    d0, d1 = int(end + FAR_BESIDE_M[0] * local), int(end + FAR_BESIDE_M[1] * local)
    far = level
    if c0 >= 0 and d1 < width and c1 > c0 and d1 > d0:
        far = min(_mean(total, c0, c1), _mean(total, d0, d1))
    if contrast <= 0.0 or paint - far < FAR_SHARE * contrast:
        return MeasuredStripe(np.nan, 0.0, contrast, 0.0, level)
    if end - start >= NARROW_PX:
        reach = max((end - start) // 2, 2)
        x0, slope0 = _crossing(row, start - 1, reach, 0.5 * (left + paint), True)
        x1, slope1 = _crossing(row, end - 1, reach, 0.5 * (right + paint), False)
        if math.isnan(x0) or math.isnan(x1) or x1 <= x0:
            return MeasuredStripe(np.nan, 0.0, contrast, 0.0, level)
        sigma = 0.5 * noise * math.sqrt(1.0 / slope0**2 + 1.0 / slope1**2)
        return MeasuredStripe(0.5 * (x0 + x1), x1 - x0, contrast, sigma, level)
    # Narrow: centre of gravity above the road, whose level is linear from side to side
    first, last = max(start - 2, 0), min(end + 1, width - 1)
    mass = moment = spread = 0.0
    for u in range(first, last + 1):
        part = (u - first + 0.5) / (last - first + 1.0)
        value = float(row[u]) - (left + part * (right - left))
        mass += value
        moment += value * u
    if mass <= 0.0:
        return MeasuredStripe(np.nan, 0.0, contrast, 0.0, level)
    middle = moment / mass
    for u in range(first, last + 1):
        spread += (u - middle) ** 2
    return MeasuredStripe(middle, mass / contrast, contrast, noise * math.sqrt(spread) / mass, level)
