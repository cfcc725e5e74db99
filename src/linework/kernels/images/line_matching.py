"""Least-squares matching of a profile across a line with a template, with the shift as the only unknown.

G. He, K. Novak (1992), section 3.5: dx = sum g_x (f - g) / sum g_x^2; here the profile lies across the line on the
road, so it may run in any direction of the image, and gain and offset are removed from both.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from linework.arrays import ByteArray, FloatArray

#: Columns of a match: shift and its standard deviation [m], correlation, gain, offset [grey values], number of samples
#: compared, and the correlation of the best other place, farther from this one than the pattern is wide.
SHIFT, MATCH_SIGMA, CORRELATION, GAIN, OFFSET, SAMPLES, OTHER = range(7)
MATCH_COLUMNS = 7
#: Most Gauss-Newton steps: from a place found by search, six reach a thousandth of a sample.
_ITERATIONS = 6
#: Smallest number of samples: there are four unknowns (shift, gain, offset, noise).
LEAST_SAMPLES = 5
#: Variance of the rounding of grey values to integers. [grey values^2]
_ROUNDING_VARIANCE = 1.0 / 12.0
#: Largest correlation of neighbouring residuals that is used: towards 1 the variance grows without bound.
_MOST_RESIDUAL_CORRELATION = 0.8
#: Correlation taken off at the border of the gate: of two places that are alike the nearer one is taken.
_DISTANCE_PENALTY = 0.05
#: Largest move of Gauss-Newton from the best place of the search, which is in steps of half a sample. [samples]
_MOST_MOVE = 1.5
#: Smallest sum of squares, against division by zero. [grey values^2]
_LEAST_SQUARES = 1e-9


class _Fit(NamedTuple):
    """A template fitted to a profile at one shift: all 0 where too few samples or no contrast."""

    samples: float
    gain: float
    offset: float
    correlation: float
    move: float
    variance: float


@njit(cache=True, nogil=True)
def grey_profile_across(
    image: ByteArray,
    to_pixel: FloatArray,
    frame: FloatArray,
    bend: float,
    along: tuple[float, int],
    spacing: float,
    half: int,
) -> FloatArray:
    """Return (2 half + 1,) grey values across a line, averaged along it; NaN where most are outside of the image.

    Parameters
    ----------
    image
        (height, width) uint8.
    to_pixel
        (3, 4) projection from the local world [m] to homogeneous column and row.
    frame
        (3, 3) rows: place [m, local world], unit direction along the line, unit direction across it.
    bend
        Curvature of the line, positive towards the direction across. [1/m]
    along
        Length that is averaged [m], and number of places on it.
    spacing
        Distance between samples across. [m]
    half
        Number of samples on either side.
    """
    height, width = image.shape
    out, inside = np.zeros(2 * half + 1), np.zeros(2 * half + 1)
    length, places = along
    h = np.empty((3, 3))
    for i in range(3):
        h[0, i] = to_pixel[i, 3]
        h[1, i] = h[2, i] = 0.0
        for k in range(3):
            h[0, i] += to_pixel[i, k] * frame[0, k]
            h[1, i] += to_pixel[i, k] * frame[1, k]
            h[2, i] += to_pixel[i, k] * frame[2, k]
    for p in range(places):
        a = length * ((p + 0.5) / places - 0.5)
        bow = 0.5 * bend * a * a
        for j in range(2 * half + 1):
            s = (j - half) * spacing + bow
            w = h[0, 2] + a * h[1, 2] + s * h[2, 2]
            if w <= 1e-6:
                continue
            u = (h[0, 0] + a * h[1, 0] + s * h[2, 0]) / w
            v = (h[0, 1] + a * h[1, 1] + s * h[2, 1]) / w
            if not (u >= 0.0 and v >= 0.0 and u <= width - 1.0 and v <= height - 1.0):
                continue
            c, r = min(int(u), width - 2), min(int(v), height - 2)
            du, dv = u - c, v - r
            upper = (1.0 - du) * image[r, c] + du * image[r, c + 1]
            lower = (1.0 - du) * image[r + 1, c] + du * image[r + 1, c + 1]
            out[j] += (1.0 - dv) * upper + dv * lower
            inside[j] += 1.0
    for j in range(2 * half + 1):
        out[j] = out[j] / inside[j] if inside[j] >= 0.5 * places else np.nan
    return out


@njit(cache=True, nogil=True)
def integral_of(template: FloatArray) -> FloatArray:
    """Return (n + 1,) running integral of a template (n,), in grey values times samples, as `blurred` takes it."""
    total = np.zeros(len(template) + 1)
    for i in range(len(template)):
        total[i + 1] = total[i] + template[i]
    return total


@njit(cache=True, nogil=True)
def _integral_at(total: FloatArray, x: float) -> float:
    """Return the integral up to a place, in samples from the start; constant grey values beyond both ends."""
    n = len(total) - 1
    if x <= 0.0:
        return float(x * (total[1] - total[0]))
    if x >= n:
        return float(total[n] + (x - n) * (total[n] - total[n - 1]))
    i = int(x)
    return float(total[i] + (x - i) * (total[i + 1] - total[i]))


@njit(cache=True, nogil=True)
def blurred(total: FloatArray, step: float, s: float, pixel: float) -> tuple[float, float]:
    """Return the mean of a template over one pixel, and its derivative there. [grey values, grey values/m]

    Parameters
    ----------
    total
        (n + 1,) running integral of the template (`integral_of`).
    step
        Spacing of the template. [m]
    s
        Middle of the pixel, from the template's middle. [m]
    pixel
        Extent of the pixel on the template. [m]
    """  # noqa: D400
    middle = 0.5 * (len(total) - 1)
    reach = 0.5 * max(pixel, step)
    low, high = (s - reach) / step + middle, (s + reach) / step + middle
    value = (_integral_at(total, high) - _integral_at(total, low)) / (high - low)
    rise = _value_at(total, high) - _value_at(total, low)
    return value, rise / (2.0 * reach)


@njit(cache=True, nogil=True)
def _value_at(total: FloatArray, x: float) -> float:
    """Return the template at a place in samples from the start, linear between samples."""
    n = len(total) - 1
    y = min(max(x - 0.5, 0.0), n - 1.0)
    i = min(int(y), n - 2)
    a, b = total[i + 1] - total[i], total[i + 2] - total[i + 1]
    return float(a + (y - i) * (b - a))


@njit(cache=True, nogil=True)
def _fit(
    profile: FloatArray,
    half: int,
    spacing: float,
    total: FloatArray,
    step: float,
    shift: float,
    window: float,
) -> _Fit:
    """Return gain, offset, correlation, the Gauss-Newton step of the shift and its variance, at one shift.

    With f the profile and g the template: f = offset + gain g(s - shift). The step of the shift is
    dx = sum g_x (f - g) / sum g_x^2, with gain and offset removed from both.
    """
    n, sf, sg, sd, sff, sgg, sdd, sfg, sfd, sgd = 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    first = max(0, math.ceil((shift - window) / spacing) + half)
    last = min(2 * half, math.floor((shift + window) / spacing) + half)
    for j in range(first, last + 1):
        f = profile[j]
        if math.isnan(f):
            continue
        g, rise = blurred(total, step, (j - half) * spacing - shift, spacing)
        d = -rise
        n += 1
        sf += f
        sg += g
        sd += d
        sff += f * f
        sgg += g * g
        sdd += d * d
        sfg += f * g
        sfd += f * d
        sgd += g * d
    samples = float(n)
    if n < LEAST_SAMPLES:
        return _Fit(samples, 0.0, 0.0, 0.0, 0.0, 0.0)
    cff, cgg, cdd = sff - sf * sf / n, sgg - sg * sg / n, sdd - sd * sd / n
    cfg, cfd, cgd = sfg - sf * sg / n, sfd - sf * sd / n, sgd - sg * sd / n
    if cgg <= _LEAST_SQUARES or cff <= _LEAST_SQUARES:
        return _Fit(samples, 0.0, 0.0, 0.0, 0.0, 0.0)
    gain = cfg / cgg
    offset, correlation = (sf - gain * sg) / n, cfg / math.sqrt(cff * cgg)
    steep = cdd - cgd * cgd / cgg
    if gain <= 0.0 or steep <= _LEAST_SQUARES:
        return _Fit(samples, gain, offset, correlation, 0.0, 0.0)
    move = (cfd - cfg * cgd / cgg) / (gain * steep)
    left = max(cff - cfg * cfg / cgg - move * gain * (cfd - cfg * cgd / cgg), 0.0)
    noise = left / max(n - 3, 1) + _ROUNDING_VARIANCE / n
    # Neighbouring residuals are correlated (texture, a worn side): as an autoregressive process of first order
    ahead, before, alike = 0.0, 0.0, 0.0
    for j in range(first, last + 1):
        f = profile[j]
        if math.isnan(f):
            continue
        g, rise = blurred(total, step, (j - half) * spacing - shift, spacing)
        r = f - offset - gain * g
        alike += r * before
        ahead += r * r
        before = r
    rho = min(max(alike / ahead, 0.0), _MOST_RESIDUAL_CORRELATION) if ahead > 0.0 else 0.0
    variance = noise * (1.0 + rho) / (1.0 - rho) / (gain * gain * steep)
    return _Fit(samples, gain, offset, correlation, move, variance)


@njit(cache=True, nogil=True)
def match_profile(
    profile: FloatArray,
    spacing: float,
    total: FloatArray,
    step: float,
    window: float,
    gate: tuple[float, float],
    apart: float,
) -> FloatArray:
    """Return (7,) the best match of a template in a profile: columns `SHIFT` to `OTHER`.

    Parameters
    ----------
    profile
        (2 half + 1,) from `grey_profile_across`; NaN values are not compared.
    spacing
        Spacing of the profile. [m]
    total
        (n + 1,) running integral of the template (`integral_of`).
    step
        Spacing of the template. [m]
    window
        Half of the width that is compared. [m]
    gate
        Expected shift and its largest difference from there. [m]
    apart
        Least distance of another place from the best one, for `OTHER`. [m]

    Notes
    -----
    Gauss-Newton steps of the shift start at the sample of best correlation; gain and offset have a closed form.
    Correlation 0 means that there is no match.
    """
    half = len(profile) // 2
    out = np.zeros(MATCH_COLUMNS)
    expected, reach = gate
    n = math.ceil(2.0 * reach / (0.5 * spacing))
    scores = np.zeros(n + 1)
    best, best_score = 0.0, 0.0
    for i in range(n + 1):
        x = expected - reach + i * (2.0 * reach / n)
        found = _fit(profile, half, spacing, total, step, x, window)
        scores[i] = found.correlation
        score = found.correlation - _DISTANCE_PENALTY * ((x - expected) / reach) ** 2
        if found.correlation > 0.0 and score > best_score:
            best, best_score = x, score
    if best_score <= 0.0:
        return out
    start = best
    for _ in range(_ITERATIONS):
        found = _fit(profile, half, spacing, total, step, best, window)
        move = found.move
        if found.gain <= 0.0 or abs(best + move - start) > _MOST_MOVE * spacing:
            break
        best += move
        if abs(move) < 1e-3 * spacing:
            break
    found = _fit(profile, half, spacing, total, step, best, window)
    out[SHIFT], out[MATCH_SIGMA] = best, math.sqrt(found.variance)
    out[CORRELATION], out[GAIN] = found.correlation, found.gain
    out[OFFSET], out[SAMPLES] = found.offset, found.samples
    for i in range(1, n):
        x = expected - reach + i * (2.0 * reach / n)
        is_peak = scores[i] >= scores[i - 1] and scores[i] >= scores[i + 1]
        if is_peak and abs(x - best) > apart and scores[i] > out[OTHER]:
            out[OTHER] = scores[i]
    return out
