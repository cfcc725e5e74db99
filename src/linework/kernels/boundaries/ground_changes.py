"""Changes of the ground across a line, by competing explanations: of its brightness, its roughness or its height.

Each of the three is compared with what the ground does without an edge: brightness and height may slope evenly, the
height may have a kink (gutter, crown), the brightness may show a stripe of paint. What counts is how much better two
sides explain the profile than the best of these, in natural units of likelihood; the three add up.

Separate from `change_boxes`, which looks for a change in a cell and writes its box: this weighs one profile.

Frame and points as in `linework.kernels.boundaries.profiles`; v points to the carriageway.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.boundaries.profiles import (
    BIN_I,
    BIN_II,
    BIN_N,
    BIN_R,
    BIN_RR,
    BIN_V,
    BIN_VI,
    BIN_VR,
    BIN_VV,
    HALF_LENGTH_M,
    LEAST_FLOOR_NOISE_M,
    LEAST_VV,
    N_PROFILE_BINS,
    PROFILE_BIN_M,
    bin_sums_across,
    line_through,
)

#: Columns of a change: unit vector v; gain; v of the change [m]; gains by brightness, roughness and height; height of
#: the outer side over the inner one [m]; brightness of the outer side over that of the inner one; points on both sides;
#: standard deviation of v [m].
(
    CHANGE_VX, CHANGE_VY, CHANGE_GAIN, CHANGE_V, CHANGE_BRIGHT, CHANGE_ROUGH, CHANGE_HEIGHT, CHANGE_STEP,
    CHANGE_CONTRAST, CHANGE_POINTS, CHANGE_SIGMA,
) = range(11)  # fmt: skip
CHANGE_COLUMNS = 11

#: Smallest gain of a change: the logarithm of the number of places, directions and offsets tried in a metre of road
#: (4 cells of 20 offsets and 10 directions), and of 10 for an error once in ten metres.
LEAST_GAIN = 9.0
#: Bins of each side that are compared: 0.6 m in a usual search area, which a footway or a verge has.
FLANK_BINS = 30
#: Bins about a change that tell nothing of the roughness of its sides: a face or a shadow lies there.
FACE_GAP_BINS = 2
#: Independent samples of brightness and of roughness per square metre, as stains and tufts are 0.1 m wide; and of
#: height, as a scan spot and the stones of asphalt are not.
SAMPLES_PER_M2, HEIGHTS_PER_M2 = 100.0, 400.0
#: Fewest points of a side: a variance of fewer is not known.
CHANGE_SIDE_POINTS = 8.0
#: Smallest spread of brightness as a share of its level, and smallest variance of it, against division by zero.
LEAST_BRIGHT_SHARE, LEAST_LEVEL_VARIANCE = 0.03, 1e-12
#: Smallest difference of brightness, in spreads of the sides: less is a stain.
LEAST_CONTRAST_SPREADS = 1.5
#: Smallest ratio of the variances of roughness: 1.3 in the spread, as asphalt differs less from asphalt.
LEAST_ROUGH_RATIO = 1.7
#: Smallest step: the joint of two layers of asphalt is lower. [m]
LEAST_CHANGE_M = 0.008
#: Widest bin at which a step is told from a bank, as a face with its noise takes 0.3 m. [m]
STEEP_BIN_M = 1.6 * PROFILE_BIN_M
#: Widest stripe of paint [m], and narrowest stripe and ground beside it [bins].
WIDEST_STRIPE_M, NARROWEST_STRIPE_BINS = 0.30, 3
#: Largest turn about a direction, which is halved to the last: when a change is sought, and when it is measured again.
#: [rad, -]
WIDEST_TURN, N_HALVINGS = np.deg2rad(20.0), 3
AGAIN_TURN, N_AGAIN = np.deg2rad(5.0), 2
#: How far from the place changes are sought: half of a cell's diagonal and 5 cm; and when measured again. [m]
CHANGE_SOUGHT_M, AGAIN_REACH_M = 0.40, 0.20


@njit(cache=True, nogil=True)
def _mean_and_left(sums: FloatArray, a: int, b: int) -> tuple[float, float]:
    """Return mean and residual sum of squares of the brightness of the bins a to b - 1."""
    n = sums[b, BIN_N] - sums[a, BIN_N]
    mean = (sums[b, BIN_I] - sums[a, BIN_I]) / n
    return mean, max(sums[b, BIN_II] - sums[a, BIN_II] - n * mean * mean, 0.0)


@njit(cache=True, nogil=True)
def bright_line_left(sums: FloatArray, a: int, b: int) -> float:
    """Return the residual sum of squares of a straight line through the brightness of the bins a to b - 1.

    sums: (73, 9), see `linework.kernels.boundaries.profiles.bin_sums_across`.
    """
    n = sums[b, BIN_N] - sums[a, BIN_N]
    mean, left = _mean_and_left(sums, a, b)
    mv = (sums[b, BIN_V] - sums[a, BIN_V]) / n
    vv = (sums[b, BIN_VV] - sums[a, BIN_VV]) - n * mv * mv + LEAST_VV
    vi = (sums[b, BIN_VI] - sums[a, BIN_VI]) - n * mv * mean
    return float(max(left - vi * vi / vv, 0.0))


@njit(cache=True, nogil=True)
def hinge_left(sums: FloatArray, a: int, k: int, b: int, v: float) -> float:
    """Return the residual sum of squares of heights about two slopes that meet at v [m], over the bins a to b - 1.

    sums: (73, 9), see `linework.kernels.boundaries.profiles.bin_sums_across`; k: the first bin of the second slope.
    """
    n = sums[b, BIN_N] - sums[a, BIN_N]
    z, rr = sums[b, BIN_R] - sums[a, BIN_R], sums[b, BIN_RR] - sums[a, BIN_RR]
    whole, height, left = n, z, rr
    for low, high in ((a, k), (k, b)):
        m = sums[high, BIN_N] - sums[low, BIN_N]
        s, q = sums[high, BIN_V] - sums[low, BIN_V], sums[high, BIN_R] - sums[low, BIN_R]
        s1 = s - m * v
        s2 = (sums[high, BIN_VV] - sums[low, BIN_VV]) - 2.0 * v * s + m * v * v + LEAST_VV
        r1 = (sums[high, BIN_VR] - sums[low, BIN_VR]) - v * q
        whole -= s1 * s1 / s2
        height -= r1 * s1 / s2
        left -= r1 * r1 / s2
    if whole <= LEAST_VV:
        return float(max(left, 0.0))
    return float(max(left - height * height / whole, 0.0))


@njit(cache=True, nogil=True)
def _ratio(worse: float, better: float, floor: float, n: float) -> float:
    """Return half of n times the logarithm of the ratio of two residual sums, each raised by n floors."""
    return float(0.5 * n * np.log((worse + n * floor) / (better + n * floor)))


@njit(cache=True, nogil=True)
def gains_at(sums: FloatArray, k: int, step: float, out: FloatArray) -> float:
    """Return the gain of a change at a bin of a profile, and write what it consists of.

    Parameters
    ----------
    sums
        (73, 9), see `linework.kernels.boundaries.profiles.bin_sums_across`.
    k, step
        The first bin of the side of positive v; width of a bin [m].
    out
        (11,) output, columns `CHANGE_GAIN` to `CHANGE_POINTS`.
    """
    first, last = max(k - FLANK_BINS, 0), min(k + FLANK_BINS, N_PROFILE_BINS)
    n_a, n_b = sums[k, BIN_N] - sums[first, BIN_N], sums[last, BIN_N] - sums[k, BIN_N]
    n = n_a + n_b
    out[CHANGE_GAIN] = 0.0
    if n_a < CHANGE_SIDE_POINTS or n_b < CHANGE_SIDE_POINTS:
        return 0.0
    area = (last - first) * step * 2.0 * HALF_LENGTH_M * step / PROFILE_BIN_M
    share = min(1.0, SAMPLES_PER_M2 * area / n)
    share_of_heights = min(1.0, HEIGHTS_PER_M2 * area / n)
    v = (k - 0.5 * N_PROFILE_BINS) * step
    # Brightness: two levels against a slope
    i_a, left_a = _mean_and_left(sums, first, k)
    i_b, left_b = _mean_and_left(sums, k, last)
    floor = (LEAST_BRIGHT_SHARE * 0.5 * (i_a + i_b)) ** 2 + LEAST_LEVEL_VARIANCE
    bright, contrast = 0.0, i_a - i_b
    if contrast * contrast >= LEAST_CONTRAST_SPREADS**2 * ((left_a + left_b) / n + floor):
        bright = share * _ratio(bright_line_left(sums, first, last), left_a + left_b, floor, n) - np.log(
            n * share
        )
    # Height: a step between two slopes, against a kink
    _, r_a, z_a, _ = line_through(sums, first, k, v)
    _, r_b, z_b, _ = line_through(sums, k, last, v)
    height, rise = 0.0, z_a - z_b
    if abs(rise) >= LEAST_CHANGE_M and step <= STEEP_BIN_M:
        kink = hinge_left(sums, first, k, last, v)
        height = share_of_heights * _ratio(kink, r_a + r_b, LEAST_FLOOR_NOISE_M**2, n) - np.log(n * share)
    # Roughness: two variances against one
    n_a, left_a, _, _ = line_through(sums, first, max(k - FACE_GAP_BINS, first), v)
    n_b, left_b, _, _ = line_through(sums, min(k + FACE_GAP_BINS, last), last, v)
    rough, rougher = 0.0, 1.0
    if n_a >= CHANGE_SIDE_POINTS and n_b >= CHANGE_SIDE_POINTS:
        s_a, s_b = left_a / n_a + LEAST_FLOOR_NOISE_M**2, left_b / n_b + LEAST_FLOOR_NOISE_M**2
        rougher = s_a / s_b
        if max(rougher, 1.0 / rougher) >= LEAST_ROUGH_RATIO:
            both = (n_a * s_a + n_b * s_b) / (n_a + n_b)
            rough = 0.5 * share * (n_a * np.log(both / s_a) + n_b * np.log(both / s_b)) - np.log(n * share)
    bright, rough, height = max(bright, 0.0), max(rough, 0.0), max(height, 0.0)
    out[CHANGE_GAIN], out[CHANGE_V] = bright + rough + height, v
    # Signed: positive where the side of negative v is brighter, rougher, higher
    out[CHANGE_BRIGHT] = np.copysign(bright, contrast)
    out[CHANGE_ROUGH] = np.copysign(rough, rougher - 1.0)
    out[CHANGE_CONTRAST] = (i_a + np.sqrt(floor)) / (i_b + np.sqrt(floor))
    out[CHANGE_HEIGHT], out[CHANGE_STEP], out[CHANGE_POINTS] = np.copysign(height, rise), rise, n
    return float(out[CHANGE_GAIN])


@njit(cache=True, nogil=True)
def best_change(
    work: FloatArray,
    n: int,
    frame: tuple[float, float],
    scale: float,
    again: bool,
    sums: FloatArray,
    out: FloatArray,
) -> bool:
    """Turn the v-axis until the ground changes most clearly; return False if no change is clear enough.

    Parameters
    ----------
    work
        (n or more, 4): points, see `linework.kernels.boundaries.profiles.gather_at`.
    frame
        Unit vector v to begin with.
    scale
        Radius of the search area over the usual one.
    again
        Whether a change is measured again, in small turns near the place.
    sums
        (73, 9) scratch, see `linework.kernels.boundaries.profiles.bin_sums_across`.
    out
        (11,) output, columns `CHANGE_VX` to `CHANGE_SIGMA`.
    """
    step, half_u = PROFILE_BIN_M * scale, HALF_LENGTH_M * scale
    half = int((AGAIN_REACH_M if again else CHANGE_SOUGHT_M) / step) + 1
    found = np.zeros(CHANGE_COLUMNS)
    out[:] = 0.0
    out[CHANGE_VX], out[CHANGE_VY] = frame
    widest, n_halvings = (AGAIN_TURN, N_AGAIN) if again else (WIDEST_TURN, N_HALVINGS)
    for stage in range(n_halvings + 1):
        x0, y0 = out[CHANGE_VX], out[CHANGE_VY]
        # As it is, then to either side
        for side in range(0 if stage == 0 else -1, 2 if stage > 0 else 1, 2):
            turn = side * widest * 0.5 ** (stage - 1)
            x, y = x0 * np.cos(turn) - y0 * np.sin(turn), x0 * np.sin(turn) + y0 * np.cos(turn)
            bin_sums_across(work, n, x, y, half_u, step, sums)
            for k in range(N_PROFILE_BINS // 2 - half, N_PROFILE_BINS // 2 + half + 1, 1 if again else 2):
                if gains_at(sums, k, step, found) > out[CHANGE_GAIN]:
                    out[CHANGE_GAIN:CHANGE_SIGMA] = found[CHANGE_GAIN:CHANGE_SIGMA]
                    out[CHANGE_VX], out[CHANGE_VY] = x, y
        if out[CHANGE_GAIN] < (0.5 * LEAST_GAIN if stage == 0 else LEAST_GAIN):
            return False
    return True


@njit(cache=True, nogil=True)
def settle_change(
    work: FloatArray, n: int, scale: float, sums: FloatArray, found: FloatArray, change: FloatArray
) -> bool:
    """Weigh a change (11,) against a stripe and measure its place; return False if a stripe explains it as well.

    Its v becomes the mean over the bins near the best, weighted by their likelihood, and v points to the carriageway:
    to the smoother or the darker side, whichever is clearer, else to the lower one. found: (11,) scratch.
    """
    step = PROFILE_BIN_M * scale
    bin_sums_across(work, n, change[CHANGE_VX], change[CHANGE_VY], HALF_LENGTH_M * scale, step, sums)
    k = int(np.floor(change[CHANGE_V] / step + 0.5)) + N_PROFILE_BINS // 2
    stripe = gain_of_stripe(sums, k, step)
    bright = max(abs(change[CHANGE_BRIGHT]) - stripe, 0.0)
    change[CHANGE_GAIN] += bright - abs(change[CHANGE_BRIGHT])
    change[CHANGE_BRIGHT] = np.copysign(bright, change[CHANGE_BRIGHT])
    if change[CHANGE_GAIN] < LEAST_GAIN:
        return False
    half = int(AGAIN_REACH_M / step) + 1
    low, high = max(k - half, 1), min(k + half + 1, N_PROFILE_BINS)
    gains = np.zeros(N_PROFILE_BINS)
    for j in range(low, high):
        gains[j] = gains_at(sums, j, step, found)
    best, total, mean, square = np.max(gains), 0.0, 0.0, 0.0
    for j in range(low, high):
        if gains[j] > 0.0:
            likely, v = np.exp(gains[j] - best), (j - 0.5 * N_PROFILE_BINS) * step
            total += likely
            mean += likely * v
            square += likely * v * v
    if total == 0.0:
        return False
    mean /= total
    change[CHANGE_V] = mean
    change[CHANGE_SIGMA] = np.sqrt(max(square / total - mean * mean, 0.0) + step * step / 12.0)
    rough, bright, height = change[CHANGE_ROUGH], change[CHANGE_BRIGHT], change[CHANGE_HEIGHT]
    side = rough if abs(rough) >= abs(bright) else bright
    side = side if side != 0.0 else height
    if side < 0.0:
        for j in (CHANGE_VX, CHANGE_VY, CHANGE_V, CHANGE_BRIGHT, CHANGE_ROUGH, CHANGE_HEIGHT, CHANGE_STEP):
            change[j] = -change[j]
        change[CHANGE_CONTRAST] = 1.0 / change[CHANGE_CONTRAST]
    return True


@njit(cache=True, nogil=True)
def gain_of_stripe(sums: FloatArray, k: int, step: float) -> float:
    """Return how much of the gain by brightness of a change at bin k a stripe on one level explains as well.

    sums, step: as for `gains_at`.
    """
    first, last = max(k - FLANK_BINS, 0), min(k + FLANK_BINS, N_PROFILE_BINS)
    n = sums[last, BIN_N] - sums[first, BIN_N]
    area = (last - first) * step * 2.0 * HALF_LENGTH_M * step / PROFILE_BIN_M
    share = min(1.0, SAMPLES_PER_M2 * area / max(n, 1.0))
    line = bright_line_left(sums, first, last)
    mean, whole = _mean_and_left(sums, first, last)
    floor = (LEAST_BRIGHT_SHARE * mean) ** 2 + LEAST_LEVEL_VARIANCE
    best = line
    widest = max(int(WIDEST_STRIPE_M / step), NARROWEST_STRIPE_BINS)
    for i in range(first + NARROWEST_STRIPE_BINS, last - 2 * NARROWEST_STRIPE_BINS + 1):
        for j in range(i + NARROWEST_STRIPE_BINS, min(i + widest, last - NARROWEST_STRIPE_BINS) + 1):
            m = sums[j, BIN_N] - sums[i, BIN_N]
            if m < 2.0 or n - m < 2.0:
                continue
            off = (sums[j, BIN_I] - sums[i, BIN_I]) / m - mean
            best = min(best, whole - off * off * m * n / (n - m))
    return float(share * _ratio(line, max(best, 0.0), floor, n))
