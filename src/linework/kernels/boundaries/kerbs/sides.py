"""What the points on both sides of a step show: the floor that it hides from the scanner, and how far both extend.

Separate from `steps`, which measures a step whose shadow is known.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.boundaries.kerbs.steps import (
    CLEAREST_VX,
    CLEAREST_VY,
    FACE_POINTS_LEAST,
    LEAN,
    LEAN_SIGMA,
    SMALLEST_STEP_M,
    STEP_FLOOR_A,
    STEP_FLOOR_B,
    STEP_FLOOR_C,
    STEP_FOOT,
    STEP_HEIGHT,
    STEP_N_FACE,
    STEP_NOISE,
    STEP_SHADOW,
    STEP_SIGMA_V,
    STEP_TOP,
    STEP_VX,
    STEP_VY,
    measure_step,
)
from linework.kernels.boundaries.profiles import (
    CLIP_M,
    PLACE_R,
    PLACE_X,
    PLACE_Y,
    PROFILE_BIN_M,
)

#: Columns of how far the evidence of a step extends: shares of the floor's and the top's width with points; lowest and
#: highest u with points of both [m]; share of the quarters along u with points of both.
COVER_FLOOR, COVER_TOP, COVER_U_LOW, COVER_U_HIGH, COVER_BOTH = range(5)
COVER_COLUMNS = 5
#: Largest distance of a floor point from the floor, in sigmas of the floor's noise. [-]
FLOOR_NOISES = 3.0
#: Bins (2 cm, at the usual density) of the profile in which a shadow is sought: those over the top, as many as a floor has
#: for its slope, and all, so that as much of the floor beyond 0.3 m of shadow is in it.
SHADOW_TOP_BINS, N_SHADOW_BINS = 30, 75
#: Fewest bins of a shadow, 10 cm, below which the middle of the missing stretch is as good; the step lies in it, or this
#: near to it.
LEAST_SHADOW_BINS = 5
#: Points that are expected in a shadow: exp(-16) is the chance that none is there, and it is sought at some hundred places
#: and directions that differ.
POINTS_IN_SHADOW = 16.0
#: Directions tried about that of the step, from coarse to fine: any that passes through the shadow separates floor and top
#: as well, 20 degrees to either side of 0.4 m of shadow over a metre. [rad]
SHADOW_TURNS = (np.deg2rad(np.arange(-40.0, 41.0, 8.0)), np.deg2rad(np.arange(-6.0, 7.0, 1.5)))
#: Largest share of the usual points in 10 cm of a profile that crosses a shadow: 0.2 m of shadow over 1 m, 20 degrees
#: askew, leaves half of them. [ratio]
SPARSE = 0.6
#: A scanner's shadow behind an edge holds less than this share of the usual points; standard deviation of an edge from a
#: straight line [m].
SHADOW_SHARE, SHADOW_SIGMA_M = 0.3, 0.01
#: Bins within which the shadow lies of where heights change, and brightness or roughness, which vary by themselves.
STEP_NEAR_BINS, EDGE_NEAR_BINS = 1, 3
#: How unlikely so few points are by chance, as a logarithm: along the direction found, at seven places, one in ten has
#: so few (exp(-4)); along a hundred places and directions, one in thirty (exp(-8)).
SHADOW_SURPRISE, TURNED_SURPRISE = 4.0, 8.0
#: Directions tried about that of an edge: what tells its sides apart leaves its direction open by this much. [rad]
TURNS_IN_SHADOW = (np.deg2rad(np.arange(-24.0, 25.0, 8.0)), np.deg2rad(np.arange(-6.0, 7.0, 2.0)))
#: Number of last points before a shadow; it begins at the fourth last, so that strays do no harm.
N_LAST = 4


@njit(cache=True, nogil=True)
def measure_seen_step(
    work: FloatArray, n: int, first: FloatArray, scale: float, half_u: float, out: FloatArray
) -> bool:
    """Measure a step by its face, or where none is visible with its shadow; parameters and result as for `measure_step`."""
    is_measured = bool(measure_step(work, n, first, (0.0, 0.0), scale, half_u, out))
    if is_measured and out[STEP_N_FACE] >= FACE_POINTS_LEAST:
        return True
    frame = first[CLEAREST_VX], first[CLEAREST_VY]
    vx, vy, edge, shadow = shadow_behind(work, n, frame, (scale, half_u))
    if shadow == 0.0:
        if is_measured:
            _before_shadow(work, n, first, scale, half_u, out)
        return is_measured
    turned, plain = first.copy(), out.copy()
    turned[CLEAREST_VX], turned[CLEAREST_VY] = vx, vy
    if measure_step(work, n, turned, (edge, shadow), scale, half_u, out):
        return True
    out[:] = plain
    return is_measured


@njit(cache=True, nogil=True)
def _before_shadow(
    work: FloatArray, n: int, first: FloatArray, scale: float, half_u: float, out: FloatArray
) -> None:
    """Move a step (19,) without a face to the last points of its top, where points are missing behind them.

    Parameters as for `measure_step`.
    """
    frame = -out[STEP_VX], -out[STEP_VY]
    middle = 0.5 * (out[STEP_FOOT] + out[STEP_TOP])
    vx, vy, v, sigma = edge_before_shadow(work, n, frame, -middle, (scale, half_u), STEP_NEAR_BINS)
    if sigma == 0.0:
        return
    turned, plain = first.copy(), out.copy()
    turned[CLEAREST_VX], turned[CLEAREST_VY] = -vx, -vy
    # A face says more than a shadow
    if (
        not measure_step(work, n, turned, (0.0, 0.0), scale, half_u, out)
        or out[STEP_N_FACE] >= FACE_POINTS_LEAST
    ):
        out[:] = plain
        return
    out[STEP_VX], out[STEP_VY] = -vx, -vy
    out[STEP_TOP], out[STEP_FOOT] = -v, LEAN * out[STEP_HEIGHT] - v
    out[STEP_SIGMA_V] = np.hypot(sigma, 0.5 * out[STEP_HEIGHT] * LEAN_SIGMA)


@njit(cache=True, nogil=True)
def shadow_behind(
    work: FloatArray, n: int, frame: tuple[float, float], reach: tuple[float, float]
) -> tuple[float, float, float, float]:
    """Return the unit vector v across the shadow of the step at v = 0, its upper edge v, and its length [m]; 0: none.

    Seen from above a kerb, the floor at its foot has no points between the last ones of the top and the first ones
    beyond the shadow, which chance leaves where points are few. Seen from the floor there is no such stretch. The
    direction is the one in which it is longest.

    Parameters
    ----------
    work
        (n or more, 4): points, see `linework.kernels.boundaries.profiles.gather_at`.
    frame
        Unit vector v to begin with.
    reach
        Radius of the search area divided by the usual radius; half of the length along u that is used [m].
    """
    counts, heights = np.zeros(N_SHADOW_BINS), np.zeros(N_SHADOW_BINS)
    _count_across(work, n, frame, reach, counts, heights)
    if not _is_sparse(counts):
        return frame[0], frame[1], 0.0, 0.0
    vx, vy = frame
    edge, best = 0.0, 0
    for turns in SHADOW_TURNS:
        x0, y0, sum_x, sum_y, edges, found = vx, vy, 0.0, 0.0, 0.0, 0.0
        for turn in turns:
            x, y = x0 * np.cos(turn) - y0 * np.sin(turn), x0 * np.sin(turn) + y0 * np.cos(turn)
            _count_across(work, n, (x, y), reach, counts, heights)
            first, length = _empty_bins(counts, heights)
            if length > best:
                best, sum_x, sum_y, edges, found = length, x, y, first, 1.0
            elif length == best and length > 0:
                # The middle of the directions in which it is as long
                sum_x, sum_y, edges, found = sum_x + x, sum_y + y, edges + first, found + 1.0
        size = np.hypot(sum_x, sum_y)
        if found > 0.0 and size > 0.0:
            vx, vy, edge = sum_x / size, sum_y / size, edges / found
    if best < LEAST_SHADOW_BINS:
        return frame[0], frame[1], 0.0, 0.0
    step = PROFILE_BIN_M * reach[0]
    return vx, vy, (edge - SHADOW_TOP_BINS) * step, best * step


@njit(cache=True, nogil=True)
def _count_across(
    work: FloatArray,
    n: int,
    frame: tuple[float, float],
    reach: tuple[float, float],
    counts: FloatArray,
    heights: FloatArray,
) -> None:
    """Count the points in the bins of a profile, and add up their heights [m].

    Parameters as for `shadow_behind`; counts, heights: (`N_SHADOW_BINS`,) output.
    """
    scale, half_u = reach
    vx, vy = frame
    step = PROFILE_BIN_M * scale
    counts[:], heights[:] = 0.0, 0.0
    # Points in bins are chosen without a branch, as in `bin_sums_across`
    bins, r, n_chosen = np.empty(n + 1, np.int64), np.empty(n + 1), 0
    for i in range(n):
        x, y = work[i, PLACE_X], work[i, PLACE_Y]
        k = int(np.floor((x * vx + y * vy) / step)) + SHADOW_TOP_BINS
        bins[n_chosen], r[n_chosen] = k, work[i, PLACE_R]
        is_near = (abs(x * vy - y * vx) <= half_u) & (abs(work[i, PLACE_R]) <= CLIP_M)
        n_chosen += int(is_near & (k >= 0) & (k < N_SHADOW_BINS))
    for j in range(n_chosen):
        counts[bins[j]] += 1.0
        heights[bins[j]] += r[j]


@njit(cache=True, nogil=True)
def _is_sparse(counts: FloatArray) -> bool:
    """Return whether 10 cm of a profile near the step hold fewer points than the rest, as where a shadow lies askew."""
    usual = np.median(counts)
    for k in range(LEAST_SHADOW_BINS, N_SHADOW_BINS - 2 * LEAST_SHADOW_BINS):
        if np.mean(counts[k : k + LEAST_SHADOW_BINS]) <= SPARSE * usual:
            return True
    return False


@njit(cache=True, nogil=True)
def _empty_bins(counts: FloatArray, heights: FloatArray) -> tuple[int, int]:
    """Return the first of the longest run of empty bins at the step, and how many; 0 where no shadow explains them.

    Few points leave bins empty by chance, scan lines along the kerb leave runs between them that are as long elsewhere, and
    what is missing on one level is not behind a step.
    """
    low, high = 0, N_SHADOW_BINS
    while low < high and counts[low] == 0.0:
        low += 1
    while high > low and counts[high - 1] == 0.0:
        high -= 1
    first, length, run = 0, 0, 0
    for k in range(low, high):
        run = run + 1 if counts[k] == 0.0 else 0
        is_here = (
            k - run + 1 <= SHADOW_TOP_BINS + LEAST_SHADOW_BINS and k >= SHADOW_TOP_BINS - LEAST_SHADOW_BINS
        )
        if run > length and is_here:
            first, length = k - run + 1, run
    beyond = first + length
    if length == 0 or first < LEAST_SHADOW_BINS or beyond + LEAST_SHADOW_BINS > N_SHADOW_BINS:
        return 0, 0
    other = run = 0
    for k in range(low, high):
        run = run + 1 if counts[k] == 0.0 and not first <= k < beyond else 0
        other = max(other, run)
    n_top, n_floor = (
        np.sum(counts[first - LEAST_SHADOW_BINS : first]),
        np.sum(counts[beyond : beyond + LEAST_SHADOW_BINS]),
    )
    # As many points as on either side, and as in the whole profile: few bins have more by chance
    usual = np.sum(counts) / (high - low - length)
    expected = length * min(usual, n_top / LEAST_SHADOW_BINS, n_floor / LEAST_SHADOW_BINS)
    if expected < POINTS_IN_SHADOW or 2 * other >= length:
        return 0, 0
    top = np.sum(heights[first - LEAST_SHADOW_BINS : first]) / n_top
    floor = np.sum(heights[beyond : beyond + LEAST_SHADOW_BINS]) / n_floor
    return (first, length) if top - floor >= SMALLEST_STEP_M else (0, 0)


@njit(cache=True, nogil=True)
def filled_shares(
    work: FloatArray, n: int, step: FloatArray, scale: float, half_u: float, share: FloatArray
) -> None:
    """Write how far the evidence of a step extends, across and along.

    Parameters
    ----------
    work
        (n or more, 4): points, see `linework.kernels.boundaries.profiles.gather_at`.
    step
        (19,): see `measure_step`.
    scale, half_u
        As for `best_step`.
    share
        (5,) output, columns `COVER_FLOOR` to `COVER_BOTH`: the floor's 0.5 m counted in fifths, the top's 0.2 m in
        quarters.
    """
    floor_bins, top_bins = np.zeros(5), np.zeros(4)
    along_floor, along_top = np.zeros(4), np.zeros(4)
    floor_low, floor_high, top_low, top_high = 1e9, -1e9, 1e9, -1e9
    for i in range(n):
        x, y = work[i, PLACE_X], work[i, PLACE_Y]
        v, u = x * step[STEP_VX] + y * step[STEP_VY], x * step[STEP_VY] - y * step[STEP_VX]
        if abs(u) > half_u:
            continue
        r = work[i, PLACE_R] - step[STEP_FLOOR_A] - step[STEP_FLOOR_B] * u - step[STEP_FLOOR_C] * v
        quarter = min(int((0.5 * u / half_u + 0.5) * 4.0), 3)
        if v > step[STEP_FOOT] - 0.01:
            off = v - step[STEP_FOOT] - step[STEP_SHADOW]
            if abs(r) <= FLOOR_NOISES * step[STEP_NOISE] and off < 0.5 * scale:
                floor_bins[min(max(int(off / (0.1 * scale)), 0), 4)] = 1.0
                if off < 0.3 * scale:
                    along_floor[quarter] = 1.0
                    floor_low, floor_high = min(floor_low, u), max(floor_high, u)
        elif step[STEP_TOP] - v < 0.2 * scale and r > 0.5 * step[STEP_HEIGHT]:
            top_bins[min(max(int((step[STEP_TOP] - v) / (0.05 * scale)), 0), 3)] = 1.0
            along_top[quarter] = 1.0
            top_low, top_high = min(top_low, u), max(top_high, u)
    share[COVER_FLOOR], share[COVER_TOP] = np.mean(floor_bins), np.mean(top_bins)
    share[COVER_U_LOW], share[COVER_U_HIGH] = max(floor_low, top_low), min(floor_high, top_high)
    share[COVER_BOTH] = np.mean(along_floor * along_top)


@njit(cache=True, nogil=True)
def edge_before_shadow(
    work: FloatArray, n: int, frame: tuple[float, float], v: float, reach: tuple[float, float], near: int
) -> tuple[float, float, float, float]:
    """Return unit vector v, v and its sigma [m] of the end of the ground of positive v before a shadow; sigma 0: no shadow.

    Behind an edge above a lower verge lies the scanner's shadow. What changes may change anywhere in it and along any line
    through it, but the edge is where it begins, and runs in the direction in which it is longest.

    Parameters
    ----------
    work
        (n or more, 4): points, see `linework.kernels.boundaries.profiles.gather_at`.
    frame
        Unit vector v to begin with.
    v
        Where the ground changes. [m]
    reach
        As for `shadow_behind`.
    near
        Number of bins of a profile from v within which the shadow lies.
    """
    counts, heights = np.zeros(N_SHADOW_BINS), np.zeros(N_SHADOW_BINS)
    step = PROFILE_BIN_M * reach[0]
    at = int(np.floor(-v / step)) + SHADOW_TOP_BINS
    # The shadow's axis points away from the pavement
    vx, vy = -frame[0], -frame[1]
    best, begin = 0, 0.0
    for turns in TURNS_IN_SHADOW:
        x0, y0, sum_x, sum_y, begins, found = vx, vy, 0.0, 0.0, 0.0, 0.0
        for turn in turns:
            x, y = x0 * np.cos(turn) - y0 * np.sin(turn), x0 * np.sin(turn) + y0 * np.cos(turn)
            _count_across(work, n, (x, y), reach, counts, heights)
            is_turned = x != -frame[0] or y != -frame[1]
            first, length = _sparse_bins(counts, at, near, TURNED_SURPRISE if is_turned else SHADOW_SURPRISE)
            if length > best:
                best, sum_x, sum_y, begins, found = length, 0.0, 0.0, 0.0, 0.0
            if length == best and length > 0:
                # The middle of the directions in which it is as long
                sum_x, sum_y, begins, found = sum_x + x, sum_y + y, begins + first, found + 1.0
        size = np.hypot(sum_x, sum_y)
        if size > 0.0:
            vx, vy, begin = sum_x / size, sum_y / size, begins / found
    if best == 0:
        return frame[0], frame[1], v, 0.0
    # From the fourth last point on, by the average distance to the edge beyond it
    limit, n_near = (begin - SHADOW_TOP_BINS) * step, 0
    last = np.full(N_LAST, -np.inf)
    for i in range(n):
        x, y = work[i, PLACE_X], work[i, PLACE_Y]
        away = x * vx + y * vy
        if away >= limit or abs(x * vy - y * vx) > reach[1] or abs(work[i, PLACE_R]) > CLIP_M:
            continue
        n_near += 1 if away >= limit - LEAST_SHADOW_BINS * step else 0
        for j in range(N_LAST):
            last[j], away = max(last[j], away), min(last[j], away)
    if last[N_LAST - 1] == -np.inf:
        return frame[0], frame[1], v, 0.0
    spacing = LEAST_SHADOW_BINS * step / max(n_near, 1)
    edge = last[N_LAST - 1] + (N_LAST - 0.5) * spacing
    return -vx, -vy, -edge, 2.0 * spacing + SHADOW_SIGMA_M


@njit(cache=True, nogil=True)
def _sparse_bins(counts: FloatArray, at: int, near: int, least: float) -> tuple[int, int]:
    """Return the first of the longest run of bins about one in which many points are missing, and how many; 0: none.

    least: smallest logarithm of the likelihood of so few points in a shadow over that by chance; without any, it is the
    number expected.
    """
    low = min(max(at - SHADOW_TOP_BINS, 0), N_SHADOW_BINS)
    usual = np.mean(counts[low:at]) if low < min(at, N_SHADOW_BINS) else 0.0
    sparse = SHADOW_SHARE * usual
    high = N_SHADOW_BINS
    while high > low and counts[high - 1] < sparse:
        high -= 1
    first, length, run = 0, 0, 0
    for k in range(low, high):
        run = run + 1 if counts[k] < sparse else 0
        if run > length and k - run + 1 <= at + near and k >= at - near:
            first, length = k - run + 1, run
    beyond = first + length
    # Where the points end there is no shadow
    if length == 0 or first == low or high - beyond < LEAST_SHADOW_BINS:
        return 0, 0
    other = run = 0
    for k in range(low, high):
        run = run + 1 if counts[k] < sparse and not first <= k < beyond else 0
        other = max(other, run)
    # Where few points are expected, their absence may be chance; rows of points are as far apart elsewhere
    before, behind = np.mean(counts[low:first]), np.mean(counts[beyond : beyond + LEAST_SHADOW_BINS])
    expected, seen = length * before, np.sum(counts[first:beyond])
    # With fewer points behind it they end there, askew
    if behind < SPARSE * before or seen >= expected:
        return 0, 0
    surprise = expected - seen + (seen * np.log(seen / expected) if seen > 0.0 else 0.0)
    if surprise < least or (other > 1 and 2 * other >= length):
        return 0, 0
    return first, length
