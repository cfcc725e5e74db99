"""Bright stripes across the rows of an image: two edges, darker on both sides, as wide as paint is there."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from linework.arrays import ByteArray, FloatArray

#: Columns of a table of stripes: column and row [pixels], width [pixels], contrast [grey values], standard
#: deviation of the column [pixels], level of the road beside it [grey values].
COL, ROW, WIDTH, STRIPE_CONTRAST, STRIPE_SIGMA, LEVEL = range(6)
#: Stripes of a row that are kept at most.
MOST_PER_ROW = 64
#: Half the length that edges are sharpened over, on the road [m]: the grain of asphalt is smaller, paint is wider.
GRAIN_M = 0.025
#: The road beside a stripe is judged over this width [m], from so far off its edge [pixels]: blur of the image.
ROAD_BESIDE_M, EDGE_BLUR_PX = 0.15, 1.0
#: And farther off, from where to where [m]: a strip of light between two narrow shadows is no brighter than that. So
#: much of its contrast paint has over the darker side there.
FAR_BESIDE_M, FAR_SHARE = (0.20, 0.60), 0.5


@njit(cache=True, nogil=True)
def _noise_of(row: ByteArray, start: int, end: int) -> float:
    """Return the standard deviation of a pixel of a row from differences of neighbours (median)."""
    count = np.zeros(256, dtype=np.int64)
    for u in range(start, end - 1):
        count[abs(np.int64(row[u + 1]) - np.int64(row[u]))] += 1
    half, total = (end - 1 - start) / 2.0, 0.0
    for level in range(256):
        if total + count[level] >= half:
            # Grey values are rounded: within a level the median is where its share says
            part = (half - total) / max(count[level], 1)
            return float(max((level - 0.5 + part) * 1.4826 / math.sqrt(2.0), 0.3))
        total += count[level]
    return 1.0


@njit(cache=True, nogil=True)
def _mean(total: FloatArray, start: int, end: int) -> float:
    return float((total[end] - total[start]) / (end - start))


@njit(cache=True, nogil=True)
def _crossing(row: ByteArray, near: int, reach: int, level: float, rises: bool) -> tuple[float, float]:
    """Return where the grey values of a row cross a level, nearest to a place, and how steeply; NaN if nowhere."""
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
    image : (height, width)
    plane
        (3,) disparity of the road at column 0 and row 0, per column, per row.
    per_disparity
        Pixels across per metre of road and pixel of disparity: 1 / base [1/m].
    rows
        First (lowest) row and the row after the last, counted upwards.
    widths_m
        Least and largest width across the rows.
    gates
        Least contrast in standard deviations of the noise, and relative to the road beside.

    Returns
    -------
    (n, 6) table; (height + 1,) index of the first stripe of the row ``rows[0] - i``.
    """
    height, width = image.shape
    table = np.empty((MOST_PER_ROW * max(rows[0] - rows[1], 1), 6))
    first = np.zeros(height + 1, dtype=np.int64)
    total, step = np.zeros(width + 1), np.zeros(width)
    n, line = 0, 0
    for v in range(rows[0], rows[1], -1):
        first[line] = n
        line += 1
        row = image[v]
        d0 = plane[0] + plane[2] * v
        scale_0, scale_1 = d0 * per_disparity, (d0 + plane[1] * (width - 1)) * per_disparity
        if min(scale_0, scale_1) <= 0.0:
            continue
        for u in range(width):
            total[u + 1] = total[u] + row[u]
        scale = 0.5 * (scale_0 + scale_1)
        k = min(max(round(GRAIN_M * scale), 1), 8)
        noise = _noise_of(row, 0, width)
        # Steps of means over k pixels to either side; of single pixels where paint is few pixels wide
        for u in range(k, width - k):
            step[u] = (total[u + k] - total[u] - total[u] + total[u - k]) / k
        step[:k], step[width - k :] = 0.0, 0.0
        least = gates[0] * noise * math.sqrt(2.0 / k)
        kept = 0
        u = k
        while u < width - k and kept < MOST_PER_ROW:
            up = step[u]
            if not (up >= least and up > step[u - 1] and up >= step[u + 1]):
                u += 1
                continue
            local = (d0 + plane[1] * u) * per_disparity
            narrow, wide = widths_m[0] * local - 1.0, widths_m[1] * local + 1.0
            # The strongest falling edge within the width of paint, before a rising one as strong
            end, down = -1, -0.5 * up
            for w in range(u + 1, min(int(u + wide) + 1, width - k)):
                if step[w] > up:
                    break
                if step[w] < down and step[w] <= step[w - 1] and step[w] < step[w + 1] and w - u >= narrow:
                    if end >= 0 and step[w] > 1.5 * down:
                        break
                    end, down = w, step[w]
            if end > u:
                stripe = _measured(row, total, u, end, local, noise)
                contrast, level = stripe[2], stripe[4]
                if (
                    contrast >= gates[0] * noise * 0.7
                    and contrast >= gates[1] * level
                    and not math.isnan(stripe[0])
                ):
                    if widths_m[0] * local - 0.7 <= stripe[1] <= wide:
                        table[n, COL], table[n, ROW], table[n, WIDTH] = stripe[0], v, stripe[1]
                        table[n, STRIPE_CONTRAST], table[n, STRIPE_SIGMA], table[n, LEVEL] = (
                            contrast,
                            stripe[3],
                            level,
                        )
                        n += 1
                        kept += 1
                        u = end
            u += 1
    first[line:] = n
    return table[:n].copy(), first


@njit(cache=True, nogil=True)
def _measured(
    row: ByteArray, total: FloatArray, start: int, end: int, local: float, noise: float
) -> tuple[float, float, float, float, float]:
    """Return middle, width, contrast, sigma of the middle and level beside of the stripe between two steps.

    A step at u is one between the pixels u - 1 and u. Edges are where the grey value is half-way between the paint
    and the road beside that edge. Where the paint is so narrow that blur takes its level down, the middle is the
    centre of what is brighter than the road.
    """
    width = len(row)
    beside, off = max(round(ROAD_BESIDE_M * local), 2), int(EDGE_BLUR_PX)
    a0, a1 = max(start - off - beside, 0), max(start - off, 1)
    b0, b1 = min(end + off, width - 1), min(end + off + beside, width)
    left, right = _mean(total, min(a0, a1 - 1), a1), _mean(total, b0, max(b1, b0 + 1))
    level = max(left, right)
    if end - start >= 4:
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
        return np.nan, 0.0, contrast, 0.0, level
    if end - start >= 4:
        reach = max((end - start) // 2, 2)
        x0, slope0 = _crossing(row, start - 1, reach, 0.5 * (left + paint), True)
        x1, slope1 = _crossing(row, end - 1, reach, 0.5 * (right + paint), False)
        if math.isnan(x0) or math.isnan(x1) or x1 <= x0:
            return np.nan, 0.0, contrast, 0.0, level
        sigma = 0.5 * noise * math.sqrt(1.0 / slope0**2 + 1.0 / slope1**2)
        return 0.5 * (x0 + x1), x1 - x0, contrast, sigma, level
    # Narrow: the centre of gravity over the road, which goes straight from side to side
    first, last = max(start - 2, 0), min(end + 1, width - 1)
    mass = moment = spread = 0.0
    for u in range(first, last + 1):
        part = (u - first + 0.5) / (last - first + 1.0)
        value = float(row[u]) - (left + part * (right - left))
        mass += value
        moment += value * u
    if mass <= 0.0:
        return np.nan, 0.0, contrast, 0.0, level
    middle = moment / mass
    for u in range(first, last + 1):
        spread += (u - middle) ** 2
    return middle, mass / contrast, contrast, noise * math.sqrt(spread) / mass, level
