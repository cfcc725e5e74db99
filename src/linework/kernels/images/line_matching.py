"""One-parameter least-squares matching of a profile across a line, anywhere in an image and in any direction."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import ByteArray, FloatArray

#: Columns of a match: shift and its standard deviation, correlation, gain and offset, samples compared, and the
#: correlation of the best other place that is farther off than the pattern is wide.
SHIFT, MATCH_SIGMA, CORRELATION, GAIN, OFFSET, SAMPLES, OTHER = range(7)
#: Gauss-Newton is at a thousandth of a sample after so many steps from a place found by search.
_ITERATIONS = 6
#: Fewer samples than this say nothing about four unknowns (shift, gain, offset, noise).
LEAST_SAMPLES = 5


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
    image : (height, width)
    to_pixel : (3, 4) from space to homogeneous column and row
    frame : (3, 3) rows: place [m], direction along, direction across (unit)
    bend : curvature of the line, positive towards across [1/m]
    along : length that is averaged [m], and in how many places
    spacing : between samples across [m]
    half : samples to either side
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
    """Return the running integral of a template, in samples; ``blurred`` reads it."""
    total = np.zeros(len(template) + 1)
    for i in range(len(template)):
        total[i + 1] = total[i] + template[i]
    return total


@njit(cache=True, nogil=True)
def _integral_at(total: FloatArray, x: float) -> float:
    """Return the integral up to a place in samples from the first one's beginning; it goes on flat."""
    n = len(total) - 1
    if x <= 0.0:
        return float(x * (total[1] - total[0]))
    if x >= n:
        return float(total[n] + (x - n) * (total[n] - total[n - 1]))
    i = int(x)
    return float(total[i] + (x - i) * (total[i + 1] - total[i]))


@njit(cache=True, nogil=True)
def blurred(total: FloatArray, step: float, s: float, pixel: float) -> tuple[float, float]:
    """Return a template as a pixel sees it at a place [m from its middle], and the derivative there [1/m].

    Parameters
    ----------
    total : (n + 1,) running integral of the template
    step : spacing of the template [m]
    pixel : how much of it one pixel covers [m]
    """
    middle = 0.5 * (len(total) - 1)
    reach = 0.5 * max(pixel, step)
    low, high = (s - reach) / step + middle, (s + reach) / step + middle
    value = (_integral_at(total, high) - _integral_at(total, low)) / (high - low)
    # Differences of the template's values at both ends of the pixel
    rise = _value_at(total, high) - _value_at(total, low)
    return value, rise / (2.0 * reach)


@njit(cache=True, nogil=True)
def _value_at(total: FloatArray, x: float) -> float:
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
) -> FloatArray:
    """Return samples, gain, offset, correlation, step to a better shift, its variance, at one shift.

    With f the profile and g the template: f = offset + gain g(s - shift). The shift's step is
    dx = sum g_x (f - g) / sum g_x^2, where gain and offset are taken out of both.
    """
    out = np.zeros(6)
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
    out[0] = n
    if n < LEAST_SAMPLES:
        return out
    cff, cgg, cdd = sff - sf * sf / n, sgg - sg * sg / n, sdd - sd * sd / n
    cfg, cfd, cgd = sfg - sf * sg / n, sfd - sf * sd / n, sgd - sg * sd / n
    if cgg <= 1e-9 or cff <= 1e-9:
        return out
    gain = cfg / cgg
    out[1], out[2], out[3] = gain, (sf - gain * sg) / n, cfg / math.sqrt(cff * cgg)
    steep = cdd - cgd * cgd / cgg
    if gain <= 0.0 or steep <= 1e-9:
        return out
    out[4] = (cfd - cfg * cgd / cgg) / (gain * steep)
    left = max(cff - cfg * cfg / cgg - out[4] * gain * (cfd - cfg * cgd / cgg), 0.0)
    # Grey values are rounded: a twelfth of a grey value squared is the least noise
    noise = left / max(n - 3, 1) + 1.0 / 12.0 / n
    # Residuals that go together (texture, a worn side) say less than as many that do not
    ahead, before, alike = 0.0, 0.0, 0.0
    for j in range(first, last + 1):
        f = profile[j]
        if math.isnan(f):
            continue
        g, rise = blurred(total, step, (j - half) * spacing - shift, spacing)
        r = f - out[2] - gain * g
        alike += r * before
        ahead += r * r
        before = r
    rho = min(max(alike / ahead, 0.0), 0.8) if ahead > 0.0 else 0.0
    out[5] = noise * (1.0 + rho) / (1.0 - rho) / (gain * gain * steep)
    return out


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
    """Return where a template lies in a profile: shift, sigma [m], correlation, gain, offset, samples, other.

    Parameters
    ----------
    profile : (2 half + 1,) from `grey_profile_across`
    spacing : of the profile [m]
    total : (n + 1,) running integral of the template (`integral_of`)
    step : spacing of the template [m]
    window : half of the width that is compared [m]
    gate : where the shift is expected, and how far from there it may be [m]
    apart : places farther than this from the best one are others [m]

    Notes
    -----
    The sample with the best correlation starts Gauss-Newton steps of the shift alone; gain and offset have a
    closed form. Correlation 0: no place.
    """
    half = len(profile) // 2
    out = np.zeros(7)
    expected, reach = gate
    n = math.ceil(2.0 * reach / (0.5 * spacing))
    scores = np.zeros(n + 1)
    best, best_score = 0.0, 0.0
    for i in range(n + 1):
        x = expected - reach + i * (2.0 * reach / n)
        found = _fit(profile, half, spacing, total, step, x, window)
        scores[i] = found[3]
        # A little is taken off for the way: the nearer one of two alike
        score = found[3] - 0.05 * ((x - expected) / reach) ** 2
        if found[3] > 0.0 and score > best_score:
            best, best_score = x, score
    if best_score <= 0.0:
        return out
    start = best
    for _ in range(_ITERATIONS):
        found = _fit(profile, half, spacing, total, step, best, window)
        move = found[4]
        if found[1] <= 0.0 or abs(best + move - start) > 1.5 * spacing:
            break
        best += move
        if abs(move) < 1e-3 * spacing:
            break
    found = _fit(profile, half, spacing, total, step, best, window)
    out[SHIFT], out[MATCH_SIGMA] = best, math.sqrt(found[5])
    out[CORRELATION], out[GAIN], out[OFFSET], out[SAMPLES] = found[3], found[1], found[2], found[0]
    for i in range(1, n):
        x = expected - reach + i * (2.0 * reach / n)
        is_peak = scores[i] >= scores[i - 1] and scores[i] >= scores[i + 1]
        if is_peak and abs(x - best) > apart and scores[i] > out[OTHER]:
            out[OTHER] = scores[i]
    return out
