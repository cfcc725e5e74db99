"""Edges of the pavement without a kerb: smooth on one side, rough or of another brightness on the other.

Frame and points as in `linework.kernels.boundaries.profiles`; v points to the smooth side, the carriageway.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.boundaries.profiles import (
    BIN_I,
    BIN_II,
    BIN_N,
    BIN_V,
    BIN_VI,
    BIN_VV,
    HALF_LENGTH_M,
    LEAST_FLOOR_NOISE_M,
    LEAST_VV,
    N_PROFILE_BINS,
    PROFILE_BIN_M,
    beside_cell,
    bin_sums_across,
    line_through,
)
from linework.kernels.cells.surroundings import ROUGHEST_M

#: Columns of an edge: unit vector v; clearness; v of the edge [m]; spreads on the smooth and on the rough side [m];
#: height of the rough side over the smooth one [m]; their brightness ratio (1 if it varies on one side); points on both
#: sides; standard deviation of v [m].
(
    EDGE_VX, EDGE_VY, EDGE_CLEAR, EDGE_V, EDGE_SMOOTH, EDGE_ROUGH, EDGE_STEP, EDGE_CONTRAST, EDGE_N_SMOOTH,
    EDGE_N_ROUGH, EDGE_SIGMA,
) = range(11)  # fmt: skip
EDGE_COLUMNS = 11
#: What an edge is found by: roughness, brightness, or both, where roughness decides.
BY_ROUGHNESS, BY_BRIGHTNESS, BY_BOTH = range(3)

#: Smallest ratio of the verge's roughness to the pavement's, and of their brightness: asphalt differs less from
#: asphalt.
ROUGHER, BRIGHTER = 1.3, 1.3
#: Turns that are tried about the first direction, from coarse to fine. [rad]
EDGE_TURNS = (
    np.deg2rad(np.array([0.0])),
    np.deg2rad(np.array([-16.0, 16.0])),
    np.deg2rad(np.array([-8.0, 8.0])),
    np.deg2rad(np.array([-4.0, 4.0])),
)
FINE_TURNS = (
    np.deg2rad(np.array([0.0, -6.0, 6.0])),
    np.deg2rad(np.array([-3.0, 3.0])),
    np.deg2rad(np.array([-1.5, 1.5])),
)
#: Half of a cell's diagonal and 5 cm; and how far edges are sought, over that: what is clearest beyond the cell is not
#: the clearest at the cell's border. [m, -]
EDGE_REACH_V, BEYOND = 0.40, 1.4
#: Smallest spread of brightness as a share of its level: it differs by that from stone to stone. And the smallest
#: variance, against division by zero.
LEAST_CONTRAST, LEAST_BRIGHT_VARIANCE = 0.03, 1e-12
#: First bin of a profile that is used, 0.5 m beyond the place: farther off a verge may fall away.
FAR_BIN = N_PROFILE_BINS // 2 - 25
#: Bins to either side of the place in which an edge is found again.
NEAR_BINS = 10
#: Share of the points that are independent: neighbours lie on the same tuft and the same stain.
NEW_SHARE = 0.15
#: Two sides of one brightness each differ by this many spreads; with a stripe of up to 0.4 m on one they do not.
STRIPE = 1.5
#: Widest paint, in bins (30 cm): brightness alone decides only over more.
WIDE_BINS = 15
#: Fewest points on either side, so that their spreads can be compared.
SIDE_POINTS = 10
#: Smallest clearness: twice the log likelihood ratio that two more spreads and two more levels reach by chance once in
#: 10 000 places.
CLEAR_SPLIT = 24.0
#: Bins that are checked together for one brightness, and the fewest points of them.
STEADY_BINS, STEADY_POINTS = 5, 3.0
#: Widest and narrowest paint along a pavement [m, bins], and bins beside it that are to be darker, the first of them smeared.
WIDEST_EDGE_LINE_M, NARROW_BINS, BORDER_BINS = 0.30, 3, 3
#: Turns at which a strip of road between paint and a verge may show [rad]; its least width [m]; and the standard deviations
#: by which its brightness is clearly that of the road.
STRIP_TURNS = np.deg2rad(np.arange(-16.0, 17.0, 4.0))
DARK_STRIP_M, CLEARLY = 0.10, 2.0


@njit(cache=True, nogil=True)
def _heights_of(sums: FloatArray, a: int, b: int, v: float) -> tuple[float, float, float]:
    """Return points, 0 where they are too few, variance of their heights and height at `v` of the bins a to b - 1."""
    n, left, z, _ = line_through(sums, a, b, v)
    if n < SIDE_POINTS:
        return 0.0, 1.0, 0.0
    return n, left / max(n - 2.0, 1.0) + LEAST_FLOOR_NOISE_M**2, z


@njit(cache=True, nogil=True)
def _brightness_of(sums: FloatArray, a: int, b: int, n: float) -> tuple[float, float]:
    """Return variance and mean of the brightness of the n points of the bins a to b - 1."""
    bright = (sums[b, BIN_I] - sums[a, BIN_I]) / n
    square = max((sums[b, BIN_II] - sums[a, BIN_II]) / n - bright * bright, 0.0)
    return square + least_bright_variance(bright), bright


@njit(cache=True, nogil=True)
def least_bright_variance(level: float) -> float:
    """Return the least variance of the brightness about a level."""
    return float((LEAST_CONTRAST * level) ** 2 + LEAST_BRIGHT_VARIANCE)


@njit(cache=True, nogil=True)
def sloping_variance(sums: FloatArray, first: int, last: int) -> float:
    """Return the variance of the brightness about a line, beyond `FAR_BIN` and without the bins first to last - 1."""
    n = _beyond(sums, first, last, BIN_N)
    mv, mean = _beyond(sums, first, last, BIN_V) / n, _beyond(sums, first, last, BIN_I) / n
    vi = _beyond(sums, first, last, BIN_VI) / n - mv * mean
    vv = _beyond(sums, first, last, BIN_VV) / n - mv * mv + LEAST_VV
    left = max(_beyond(sums, first, last, BIN_II) / n - mean * mean - vi * vi / vv, 0.0)
    return float(left + least_bright_variance(mean))


@njit(cache=True, nogil=True)
def _beyond(sums: FloatArray, first: int, last: int, column: int) -> float:
    """Return a sum over all bins from `FAR_BIN` on, without the bins first to last - 1."""
    whole = sums[N_PROFILE_BINS, column] - sums[FAR_BIN, column]
    return float(whole - (sums[last, column] - sums[first, column]))


@njit(cache=True, nogil=True)
def is_steady(sums: FloatArray, k: int, level: float, above: bool) -> bool:
    """Return whether all bins beyond bin k are above, or all below, a level of brightness: a stripe of paint is not.

    sums: (73, 9), see `linework.kernels.boundaries.profiles.bin_sums_across`.
    """
    for a in range(k, FAR_BIN, -STEADY_BINS):
        b = max(a - STEADY_BINS, FAR_BIN)
        n = sums[a, BIN_N] - sums[b, BIN_N]
        if n >= STEADY_POINTS and (sums[a, BIN_I] - sums[b, BIN_I] > level * n) != above:
            return False
    return True


@njit(cache=True, nogil=True)
def stripe_in(sums: FloatArray, step: float) -> tuple[int, int]:
    """Return the bins (first, last + 1) of a stripe of paint in a profile; (0, 0) where there is none.

    It is the bright piece of at most `WIDEST_EDGE_LINE_M` that explains most of the profile's spread of brightness and has
    darker ground on both sides. Paint along a pavement is brighter than pavement and verge: at its border two sides would
    differ most, one of mixed and one of even brightness. Parameters as for `split_in`.
    """
    n = sums[N_PROFILE_BINS, BIN_N] - sums[FAR_BIN, BIN_N]
    bright = sums[N_PROFILE_BINS, BIN_I] - sums[FAR_BIN, BIN_I]
    most, first, last = 0.0, 0, 0
    for i in range(FAR_BIN + BORDER_BINS, N_PROFILE_BINS - BORDER_BINS - NARROW_BINS + 1):
        n_i, bright_i = sums[i, BIN_N], sums[i, BIN_I]
        widest = min(i + int(WIDEST_EDGE_LINE_M / step) + 1, N_PROFILE_BINS - BORDER_BINS)
        for j in range(i + NARROW_BINS, widest + 1):
            m, inside = sums[j, BIN_N] - n_i, sums[j, BIN_I] - bright_i
            off = n * inside - m * bright
            if off <= 0.0 or m < STEADY_POINTS or m >= n or off * off <= most * m * (n - m):
                continue
            middle = 0.5 * (inside / m + (bright - inside) / (n - m))
            if _is_darker(sums, i - BORDER_BINS, middle) and _is_darker(sums, j + 1, middle):
                most, first, last = off * off / (m * (n - m)), i, j
    # Its borders are smeared
    return (first - 1, last + 1) if first > 0 else (0, 0)


@njit(cache=True, nogil=True)
def _is_darker(sums: FloatArray, k: int, level: float) -> bool:
    """Return whether the bins beside a stripe's border, from bin k on, hold points and are darker than a level."""
    count = sums[k + BORDER_BINS - 1, BIN_N] - sums[k, BIN_N]
    return bool(count > 0.0 and sums[k + BORDER_BINS - 1, BIN_I] - sums[k, BIN_I] < level * count)


@njit(cache=True, nogil=True)
def brightness_gain(sums: FloatArray, k: int, beyond: float, stripe: tuple[int, int]) -> tuple[float, float]:
    """Return how much clearer two levels of brightness are than one that slopes, and the level before bin k.

    A stripe of paint before bin k is left out. beyond: the brightness beyond bin k; stripe: see `stripe_in`; sums: as for
    `split_in`.
    """
    first, last = stripe if stripe[1] > k else (0, 0)
    first = max(first, k) if first > 0 else 0
    n, n_b = _beyond(sums, first, last, BIN_N), sums[k, BIN_N] - sums[FAR_BIN, BIN_N]
    n_a = n - n_b
    if n_a < SIDE_POINTS:
        return 0.0, beyond
    i_b, ii_b = sums[k, BIN_I] - sums[FAR_BIN, BIN_I], sums[k, BIN_II] - sums[FAR_BIN, BIN_II]
    level = (_beyond(sums, first, last, BIN_I) - i_b) / n_a
    if not is_steady(sums, k, 0.5 * (level + beyond), beyond > level):
        return 0.0, beyond
    before = (_beyond(sums, first, last, BIN_II) - ii_b) / n_a - level * level
    before = max(before, 0.0) + least_bright_variance(level)
    behind = max(ii_b / n_b - beyond * beyond, 0.0) + least_bright_variance(beyond)
    # Paint at an angle to the profile is smeared over it
    for b in range(k, N_PROFILE_BINS, STEADY_BINS):
        a = min(b + STEADY_BINS, N_PROFILE_BINS)
        count = sums[a, BIN_N] - sums[b, BIN_N]
        if count < STEADY_POINTS or (a > first and b < last):
            continue
        off = abs((sums[a, BIN_I] - sums[b, BIN_I]) / count - level)
        if off > 0.5 * abs(beyond - level) and off > CLEARLY * np.sqrt(min(before, behind) / count):
            return 0.0, beyond
    gain = n * np.log(sloping_variance(sums, first, last)) - n_a * np.log(before) - n_b * np.log(behind)
    return float(gain), float(level)


@njit(cache=True, nogil=True)
def strip_beyond(
    work: FloatArray, n: int, edge: FloatArray, half_u: float, step: float, sums: FloatArray
) -> bool:
    """Return whether beyond an edge (11,) there is paint, and behind it a strip as dark as the road.

    Then the edge is that of the paint, and the verge begins behind the strip. An axis that is turned mixes paint, strip and
    verge to one brightness, so that it is asked at all turns.
    """
    k = int(edge[EDGE_V] / step + 0.5 * N_PROFILE_BINS + 0.5)
    width = max(int(DARK_STRIP_M / step + 0.5), 1)
    for turn in STRIP_TURNS:
        x = edge[EDGE_VX] * np.cos(turn) - edge[EDGE_VY] * np.sin(turn)
        y = edge[EDGE_VX] * np.sin(turn) + edge[EDGE_VY] * np.cos(turn)
        bin_sums_across(work, n, x, y, half_u, step, sums)
        n_a, n_b = sums[N_PROFILE_BINS, BIN_N] - sums[k, BIN_N], sums[k, BIN_N] - sums[FAR_BIN, BIN_N]
        if n_a < SIDE_POINTS or n_b < SIDE_POINTS:
            continue
        _, b_a = _brightness_of(sums, k, N_PROFILE_BINS, n_a)
        i_b, b_b = _brightness_of(sums, FAR_BIN, k, n_b)
        if b_b <= b_a:
            continue
        level, is_paint = 0.5 * (b_a + b_b), False
        for a in range(k, FAR_BIN + width - 1, -1):
            count = sums[a, BIN_N] - sums[a - width, BIN_N]
            over = sums[a, BIN_I] - sums[a - width, BIN_I] - level * count
            if count < STEADY_POINTS or abs(over) <= CLEARLY * np.sqrt(i_b * count):
                continue
            if is_paint and over < 0.0:
                return True
            is_paint = is_paint or over > 0.0
    return False


@njit(cache=True, nogil=True)
def _two_levels(
    sums: FloatArray, k: int, numbers: tuple[float, float, float], i: float
) -> tuple[float, float]:
    """Return how much clearer two levels of brightness are than one that slopes, 0 for no two levels; and their ratio.

    One brightness there and another here, not a stripe of paint on one side. numbers: of all points, and of those on both
    sides of bin k; i: variance about the slope.
    """
    n, n_a, n_b = numbers
    i_a, b_a = _brightness_of(sums, k, N_PROFILE_BINS, n_a)
    i_b, b_b = _brightness_of(sums, FAR_BIN, k, n_b)
    if (
        b_b <= b_a
        or (b_b - b_a) ** 2 < STRIPE**2 * max(i_a, i_b)
        or not is_steady(sums, k, 0.5 * (b_a + b_b), True)
    ):
        return 0.0, 1.0
    return float(n * np.log(i) - n_a * np.log(i_a) - n_b * np.log(i_b)), float(b_b / max(b_a, 1e-6))


@njit(cache=True, nogil=True)
def split_in(
    sums: FloatArray, step: float, half: int, stride: int, by: int, gains: FloatArray, out: FloatArray
) -> None:
    """Write where a profile changes most clearly: twice the log likelihood of two sides over that of one.

    The verge is the rougher, brighter side, at negative v.

    Parameters
    ----------
    sums, step
        (73, 9), [m]: see `linework.kernels.boundaries.profiles.bin_sums_across`.
    half, stride
        Breaks are tried up to `half` bins from the middle, every `stride` bins.
    by
        `BY_ROUGHNESS`, `BY_BRIGHTNESS` or `BY_BOTH`.
    gains
        (72,) output: the clearness of each break.
    out
        (11,) output, columns `EDGE_CLEAR` to `EDGE_N_ROUGH`; the others become 0.
    """
    out[:] = 0.0
    gains[:] = 0.0
    n, r, _ = _heights_of(sums, FAR_BIN, N_PROFILE_BINS, 0.0)
    if n == 0.0:
        return
    # Brightness that falls off with distance is a slope in one piece, not two levels
    i, stripe = sloping_variance(sums, 0, 0) if by == BY_BRIGHTNESS else 0.0, (-1, -1)
    for k in range(max(N_PROFILE_BINS // 2 - half, FAR_BIN + 4), N_PROFILE_BINS // 2 + half + 1, stride):
        v = (k - 0.5 * N_PROFILE_BINS) * step
        n_a, r_a, z_a = _heights_of(sums, k, N_PROFILE_BINS, v)
        n_b, r_b, z_b = _heights_of(sums, FAR_BIN, k, v)
        if n_a == 0.0 or n_b == 0.0:
            continue
        gain, contrast = 0.0, 1.0
        if by != BY_BRIGHTNESS:
            # A spread of few points is not well known; once an edge is found, that does not matter
            least = ROUGHER**2 * (1.0 + 2.0 / np.sqrt(n_b)) if stride > 1 else 1.0
            if r_b <= least * r_a or r_b > ROUGHEST_M**2:
                continue
            gain = n * np.log(r) - n_a * np.log(r_a) - n_b * np.log(r_b)
            if stride > 1 and gain < 0.5 * CLEAR_SPLIT:
                continue
            if by == BY_BOTH:
                # Sought once, where a break asks for it: in most profiles none is clear enough
                stripe = stripe_in(sums, step) if stripe[0] < 0 else stripe
                b_b = _brightness_of(sums, FAR_BIN, k, n_b)[1]
                brighter, level = brightness_gain(sums, k, b_b, stripe)
                gain, contrast = gain + brighter, b_b / max(level, 1e-6)
        elif k < FAR_BIN + WIDE_BINS:
            continue
        else:
            gain, contrast = _two_levels(sums, k, (n, n_a, n_b), i)
        gains[k] = gain
        if gain > out[EDGE_CLEAR]:
            out[EDGE_CLEAR], out[EDGE_V] = gain, v
            out[EDGE_SMOOTH], out[EDGE_ROUGH], out[EDGE_STEP] = np.sqrt(r_a), np.sqrt(r_b), z_b - z_a
            out[EDGE_CONTRAST] = contrast
            out[EDGE_N_SMOOTH], out[EDGE_N_ROUGH] = n_a, n_b


@njit(cache=True, nogil=True)
def best_split(
    work: FloatArray,
    n: int,
    frame: tuple[float, float],
    scale: float,
    by: int,
    sums: FloatArray,
    out: FloatArray,
) -> bool:
    """Turn the v-axis until the profile changes most clearly; return False if no change passes the cell.

    Where brightness shows the edge of paint (`strip_beyond`), only roughness counts.

    Parameters
    ----------
    work
        (n or more, 4): points, see `linework.kernels.boundaries.profiles.gather_at`.
    frame
        Unit vector v to begin with.
    scale
        Radius of the search area over the usual one.
    by
        `BY_ROUGHNESS`, `BY_BRIGHTNESS` or `BY_BOTH`.
    sums
        (73, 9) scratch, see `linework.kernels.boundaries.profiles.bin_sums_across`.
    out
        (11,) output, columns `EDGE_VX` to `EDGE_N_ROUGH`.
    """
    if not _best_split(work, n, frame, scale, by, sums, out):
        return False
    if out[EDGE_CONTRAST] == 1.0 or not strip_beyond(
        work, n, out, HALF_LENGTH_M * scale, PROFILE_BIN_M * scale, sums
    ):
        return True
    return by == BY_BOTH and _best_split(work, n, frame, scale, BY_ROUGHNESS, sums, out)


@njit(cache=True, nogil=True)
def _best_split(
    work: FloatArray,
    n: int,
    frame: tuple[float, float],
    scale: float,
    by: int,
    sums: FloatArray,
    out: FloatArray,
) -> bool:
    """Find the best split as `best_split` does, by the evidence that it is given."""
    step, half_u = PROFILE_BIN_M * scale, HALF_LENGTH_M * scale
    half = int(BEYOND * EDGE_REACH_V / step)
    found, gains = np.zeros(EDGE_COLUMNS), np.zeros(N_PROFILE_BINS)
    out[EDGE_VX], out[EDGE_VY] = frame
    out[EDGE_CLEAR] = 0.0
    for stage in range(len(EDGE_TURNS)):
        x0, y0 = out[EDGE_VX], out[EDGE_VY]
        for turn in EDGE_TURNS[stage]:
            x, y = x0 * np.cos(turn) - y0 * np.sin(turn), x0 * np.sin(turn) + y0 * np.cos(turn)
            bin_sums_across(work, n, x, y, half_u, step, sums)
            split_in(sums, step, half, 4 if stage == 0 else 2, by, gains, found)
            if found[EDGE_CLEAR] > out[EDGE_CLEAR]:
                out[EDGE_VX], out[EDGE_VY] = x, y
                out[EDGE_CLEAR:EDGE_SIGMA] = found[EDGE_CLEAR:EDGE_SIGMA]
        if out[EDGE_CLEAR] < (0.5 * CLEAR_SPLIT if stage == 0 else CLEAR_SPLIT):
            return False
        if stage > 0 and beside_cell(out[EDGE_VX], out[EDGE_VY], out[EDGE_V]):
            return False
    return True


@njit(cache=True, nogil=True)
def sharpen_split(
    work: FloatArray, n: int, first: FloatArray, scale: float, by: int, sums: FloatArray, out: FloatArray
) -> bool:
    """Find a change again within 20 cm of the place, in fine steps; return False if it is not there.

    Its v is the mean over the breaks, weighted by their likelihood. No break farther off is tried: paint beside the
    edge is brighter than both sides. Parameters as for `best_split`, whose result is `first` (11,); `out` gets all
    columns.
    """
    step, half_u = PROFILE_BIN_M * scale, HALF_LENGTH_M * scale
    if not _sharpen_split(work, n, first, scale, by, sums, out):
        return False
    if out[EDGE_CONTRAST] != 1.0 and strip_beyond(work, n, out, half_u, step, sums):
        if by != BY_BOTH or not _sharpen_split(work, n, first, scale, BY_ROUGHNESS, sums, out):
            return False
    return True


@njit(cache=True, nogil=True)
def _sharpen_split(
    work: FloatArray, n: int, first: FloatArray, scale: float, by: int, sums: FloatArray, out: FloatArray
) -> bool:
    """Sharpen a split as `sharpen_split` does, by the evidence that it is given."""
    step, half_u = PROFILE_BIN_M * scale, HALF_LENGTH_M * scale
    found, gains = np.zeros(EDGE_COLUMNS), np.zeros(N_PROFILE_BINS)
    out[EDGE_VX], out[EDGE_VY], out[EDGE_CLEAR] = first[EDGE_VX], first[EDGE_VY], 0.0
    for stage in range(len(FINE_TURNS)):
        x0, y0 = out[EDGE_VX], out[EDGE_VY]
        for turn in FINE_TURNS[stage]:
            x, y = x0 * np.cos(turn) - y0 * np.sin(turn), x0 * np.sin(turn) + y0 * np.cos(turn)
            bin_sums_across(work, n, x, y, half_u, step, sums)
            split_in(sums, step, NEAR_BINS, 1, by, gains, found)
            if found[EDGE_CLEAR] > out[EDGE_CLEAR]:
                out[EDGE_VX], out[EDGE_VY] = x, y
                out[EDGE_CLEAR:EDGE_SIGMA] = found[EDGE_CLEAR:EDGE_SIGMA]
    if out[EDGE_CLEAR] < CLEAR_SPLIT or abs(out[EDGE_V]) > (NEAR_BINS - 0.5) * step:
        return False
    bin_sums_across(work, n, out[EDGE_VX], out[EDGE_VY], half_u, step, sums)
    split_in(sums, step, NEAR_BINS, 1, by, gains, found)
    total, mean, square = 0.0, 0.0, 0.0
    for k in range(N_PROFILE_BINS):
        if gains[k] > 0.0:
            likely, v = (
                np.exp(0.5 * NEW_SHARE * (gains[k] - found[EDGE_CLEAR])),
                (k - 0.5 * N_PROFILE_BINS) * step,
            )
            total += likely
            mean += likely * v
            square += likely * v * v
    mean /= total
    out[EDGE_V], out[EDGE_SIGMA] = mean, np.sqrt(max(square / total - mean * mean, 0.0) + step * step / 12.0)
    return True
