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
    PLACE_R,
    PLACE_X,
    PLACE_Y,
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
#: A scanner's shadow holds less than this share of the usual points, where at least this many are expected; and the
#: standard deviation of the pavement's edge from a straight line [m].
SHADOW_SHARE, SHADOW_POINTS, SHADOW_SIGMA_M = 0.3, 2.0, 0.01
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
#: Turns at which a strip of road between paint and a verge may show [rad]; its least width [m]; and the standard deviations
#: by which its brightness is clearly that of the road.
STRIP_TURNS = np.deg2rad(np.arange(-16.0, 17.0, 4.0))
DARK_STRIP_M, CLEARLY = 0.10, 2.0
#: Number of last points before a shadow; it begins at the fourth last, so that strays do no harm.
N_LAST = 4


@njit(cache=True, nogil=True)
def _spread_of(sums: FloatArray, a: int, b: int, v: float) -> tuple[float, float, float, float, float]:
    """Return points, variances of height and brightness, height at `v` and mean brightness of the bins a to b - 1."""
    n, left, z, _ = line_through(sums, a, b, v)
    if n < SIDE_POINTS:
        return 0.0, 1.0, 1.0, 0.0, 0.0
    bright = (sums[b, BIN_I] - sums[a, BIN_I]) / n
    square = max((sums[b, BIN_II] - sums[a, BIN_II]) / n - bright * bright, 0.0)
    return (
        n,
        left / max(n - 2.0, 1.0) + LEAST_FLOOR_NOISE_M**2,
        square + (LEAST_CONTRAST * bright) ** 2 + LEAST_BRIGHT_VARIANCE,
        z,
        bright,
    )


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
def strip_beyond(
    work: FloatArray, n: int, edge: FloatArray, half_u: float, step: float, sums: FloatArray
) -> bool:
    """Return whether beyond an edge (11,) there is paint, and behind it a strip as dark as the road.

    Then the edge is that of the paint, and the verge begins behind the strip. An axis that is turned mixes paint, strip and
    verge to one brightness, so that it is asked at all turns.
    """
    v = edge[EDGE_V]
    k = int(v / step + 0.5 * N_PROFILE_BINS + 0.5)
    width = max(int(DARK_STRIP_M / step + 0.5), 1)
    for turn in STRIP_TURNS:
        x = edge[EDGE_VX] * np.cos(turn) - edge[EDGE_VY] * np.sin(turn)
        y = edge[EDGE_VX] * np.sin(turn) + edge[EDGE_VY] * np.cos(turn)
        bin_sums_across(work, n, x, y, half_u, step, sums)
        n_a, _, _, _, b_a = _spread_of(sums, k, N_PROFILE_BINS, v)
        n_b, _, i_b, _, b_b = _spread_of(sums, FAR_BIN, k, v)
        if n_a == 0.0 or n_b == 0.0 or b_b <= b_a:
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
    n, r, i, _, mean = _spread_of(sums, FAR_BIN, N_PROFILE_BINS, 0.0)
    if n == 0.0:
        return
    # Brightness that falls off with distance is a slope in one piece, not two levels
    mv = (sums[N_PROFILE_BINS, BIN_V] - sums[FAR_BIN, BIN_V]) / n
    vi = (sums[N_PROFILE_BINS, BIN_VI] - sums[FAR_BIN, BIN_VI]) / n - mv * mean
    vv = (sums[N_PROFILE_BINS, BIN_VV] - sums[FAR_BIN, BIN_VV]) / n - mv * mv + LEAST_VV
    i = max(i - vi * vi / vv, (LEAST_CONTRAST * mean) ** 2 + LEAST_BRIGHT_VARIANCE)
    for k in range(max(N_PROFILE_BINS // 2 - half, FAR_BIN + 4), N_PROFILE_BINS // 2 + half + 1, stride):
        v = (k - 0.5 * N_PROFILE_BINS) * step
        n_a, r_a, i_a, z_a, b_a = _spread_of(sums, k, N_PROFILE_BINS, v)
        n_b, r_b, i_b, z_b, b_b = _spread_of(sums, FAR_BIN, k, v)
        if n_a == 0.0 or n_b == 0.0:
            continue
        # One brightness there and another here, not a stripe of paint on one side
        steady = by != BY_ROUGHNESS and is_steady(sums, k, 0.5 * (b_a + b_b), b_b > b_a)
        if by == BY_BRIGHTNESS and (
            not steady
            or k < FAR_BIN + WIDE_BINS
            or b_b <= b_a
            or (b_b - b_a) ** 2 < STRIPE**2 * max(i_a, i_b)
        ):
            continue
        gain = 0.0
        if by != BY_BRIGHTNESS:
            # A spread of few points is not well known; once an edge is found, that does not matter
            least = ROUGHER**2 * (1.0 + 2.0 / np.sqrt(n_b)) if stride > 1 else 1.0
            if r_b <= least * r_a or r_b > ROUGHEST_M**2:
                continue
            gain = n * np.log(r) - n_a * np.log(r_a) - n_b * np.log(r_b)
            if stride > 1 and gain < 0.5 * CLEAR_SPLIT:
                continue
        if steady:
            gain += n * np.log(i) - n_a * np.log(i_a) - n_b * np.log(i_b)
        gains[k] = gain
        if gain > out[EDGE_CLEAR]:
            out[EDGE_CLEAR], out[EDGE_V] = gain, v
            out[EDGE_SMOOTH], out[EDGE_ROUGH], out[EDGE_STEP] = np.sqrt(r_a), np.sqrt(r_b), z_b - z_a
            out[EDGE_CONTRAST] = b_b / max(b_a, 1e-6) if steady else 1.0
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
    bin_sums_across(work, n, out[EDGE_VX], out[EDGE_VY], half_u, step, sums)
    _out_of_shadow(work, n, step, half_u, sums, out)
    return True


@njit(cache=True, nogil=True)
def _sharpen_split(
    work: FloatArray, n: int, first: FloatArray, scale: float, by: int, sums: FloatArray, out: FloatArray
) -> bool:
    """Sharpen a split as `sharpen_split` does, by the evidence that it is given, without the scanner's shadow."""
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


@njit(cache=True, nogil=True)
def _out_of_shadow(
    work: FloatArray, n: int, step: float, half_u: float, sums: FloatArray, out: FloatArray
) -> None:
    """Move an edge (11,) that lies in the scanner's shadow to the last points of the pavement.

    Behind an edge above a lower verge lies the scanner's shadow: the change may be anywhere in it, but the edge is
    where it begins.
    """
    points = sums[:, BIN_N]
    usual = (points[N_PROFILE_BINS] - points[N_PROFILE_BINS // 2]) / (N_PROFILE_BINS // 2)
    k = int(np.floor(out[EDGE_V] / step)) + N_PROFILE_BINS // 2
    for j in (k - 1, k + 1):
        if points[j + 1] - points[j] < points[k + 1] - points[k]:
            k = j
    if points[k + 1] - points[k] >= SHADOW_SHARE * usual:
        return
    first = k
    while first > FAR_BIN and points[first] - points[first - 1] < SHADOW_SHARE * usual:
        first -= 1
    while k < N_PROFILE_BINS - 1 and points[k + 1] - points[k] < SHADOW_SHARE * usual:
        k += 1
    # Where few points are expected, their absence may be chance
    if (k - first) * usual < SHADOW_POINTS:
        return
    # From the fourth last point on, by the average distance to the edge beyond it
    begin = (k - 0.5 * N_PROFILE_BINS) * step
    last = np.full(N_LAST, begin + 4.0 * step)
    for i in range(n):
        x, y = work[i, PLACE_X], work[i, PLACE_Y]
        v = x * out[EDGE_VX] + y * out[EDGE_VY]
        if (
            v < begin
            or abs(x * out[EDGE_VY] - y * out[EDGE_VX]) > half_u
            or abs(work[i, PLACE_R]) > ROUGHEST_M
        ):
            continue
        for j in range(N_LAST):
            nearer = min(last[j], v)
            v = max(last[j], v)
            last[j] = nearer
    spacing = step / max(usual, 0.5)
    out[EDGE_V] = last[N_LAST - 1] - (N_LAST - 0.5) * spacing
    out[EDGE_SIGMA] = 2.0 * spacing + SHADOW_SIGMA_M
