"""Where the pavement ends without a kerb: smooth here, rough or of another brightness there.

Positions are local [m]; v points to the smooth, carriageway side; heights r are over the place's plane.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.boundaries.profiles import (
    LEAST_FLOOR_NOISE_M,
    MOST_PLACE_POINTS,
    N_PROFILE_BINS,
    beside_cell,
    bin_sums_across,
    fit_side,
    gather_at,
    line_through,
)
from linework.kernels.cells import places as at_place
from linework.kernels.cells.places import (
    AREA_M,
    BOX_ALL_ROAD,
    BOX_CELL_M,
    BOX_ELSEWHERE,
    BOX_FOUND,
    BOX_HOLE,
    BOX_NO_ROAD,
    chord_in_cell,
    roughness_limit,
)
from linework.kernels.cells.surroundings import ROUGH, ROUGHEST_M

#: The verge is rougher than the pavement by this factor, or brighter by that one: asphalt differs less from
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
#: Half of a cell's diagonal and 5 cm. [m]
EDGE_REACH_V = 0.40
#: Brightness differs by this share at least from one stone to the next; one level is known to it.
LEAST_CONTRAST = 0.03
#: The verge is looked at from 0.5 m beyond the place on: farther off it may fall away.
FAR_BIN = N_PROFILE_BINS // 2 - 25
#: Bins to either side in which an edge is found again.
NEAR_BINS = 10
#: Points next to each other lie on the same tuft and the same stain: this share of them tells something new.
NEW_SHARE = 0.15
#: In a scanner's shadow lies less than this share of the usual points, where there should be this many. The pavement's rim is this straight. [m]
SHADOW_SHARE, SHADOW_POINTS, SHADOW_SIGMA_M = 0.3, 2.0, 0.01
#: Halves of one brightness each differ by this many spreads; a stripe of up to 0.4 m in one of them does not.
STRIPE = 1.5
#: Paint has this many bins, 30 cm, at most: brightness alone tells over more.
WIDE_BINS = 15
#: Fewest points on either side: two spreads are to be compared.
SIDE_POINTS = 10
#: Two more spreads and two more levels explain twice this log likelihood by chance once in 10 000 places.
CLEAR_SPLIT = 24.0
#: Columns of an edge: v-axis, clearness, v, spreads on the smooth and on the other side, step up beyond it,
#: brightness beyond over that before it (1 if it changes beyond), points on both sides, standard deviation of v.
EDGE_COLUMNS = 11


@njit(cache=True, nogil=True)
def _spread_of(a: FloatArray, b: FloatArray, v: float) -> tuple[float, float, float, float, float]:
    """Return points, variances of height and brightness, and levels of both of the bins from `a` to `b`."""
    n, left, z, _ = line_through(a, b, v)
    if n < SIDE_POINTS:
        return 0.0, 1.0, 1.0, 0.0, 0.0
    bright = (b[6] - a[6]) / n
    square = max((b[8] - a[8]) / n - bright * bright, 0.0)
    return (
        n,
        left / max(n - 2.0, 1.0) + LEAST_FLOOR_NOISE_M**2,
        square + (LEAST_CONTRAST * bright) ** 2 + 1e-12,
        z,
        bright,
    )


@njit(cache=True, nogil=True)
def is_steady(sums: FloatArray, k: int, level: float, above: bool) -> bool:
    """Return whether all beyond bin k is on one side of a level of brightness: a stripe of paint is not."""
    for a in range(k, FAR_BIN, -5):
        b = max(a - 5, FAR_BIN)
        n = sums[a, 0] - sums[b, 0]
        if n >= 3.0 and (sums[a, 6] - sums[b, 6] > level * n) != above:
            return False
    return True


@njit(cache=True, nogil=True)
def split_in(
    sums: FloatArray, step: float, half: int, stride: int, by: int, gains: FloatArray, out: FloatArray
) -> None:
    """Write where a profile changes most clearly: twice the log likelihood of two halves over that of one.

    by: 0 roughness, 1 brightness, 2 both, of which the first decides. The other side is the rougher, brighter one.
    gains: of each break. out: clearness, v, spreads before and beyond, step, contrast, points before and beyond.
    """
    out[:] = 0.0
    gains[:] = 0.0
    far = sums[FAR_BIN]
    n, r, i, _, mean = _spread_of(far, sums[N_PROFILE_BINS], 0.0)
    if n == 0.0:
        return
    # Brightness that falls off with distance is a slope in one piece, not two levels
    mv = (sums[N_PROFILE_BINS, 1] - far[1]) / n
    vi = (sums[N_PROFILE_BINS, 7] - far[7]) / n - mv * mean
    vv = (sums[N_PROFILE_BINS, 2] - far[2]) / n - mv * mv + 1e-9
    i = max(i - vi * vi / vv, (LEAST_CONTRAST * mean) ** 2 + 1e-12)
    for k in range(max(N_PROFILE_BINS // 2 - half, FAR_BIN + 4), N_PROFILE_BINS // 2 + half + 1, stride):
        v = (k - 0.5 * N_PROFILE_BINS) * step
        n_a, r_a, i_a, z_a, b_a = _spread_of(sums[k], sums[N_PROFILE_BINS], v)
        n_b, r_b, i_b, z_b, b_b = _spread_of(far, sums[k], v)
        if n_a == 0.0 or n_b == 0.0:
            continue
        # One brightness there and another here, not a stripe of paint in one of them
        steady = by != 0 and is_steady(sums, k, 0.5 * (b_a + b_b), b_b > b_a)
        if by == 1 and (
            not steady
            or k < FAR_BIN + WIDE_BINS
            or b_b <= b_a
            or (b_b - b_a) ** 2 < STRIPE**2 * max(i_a, i_b)
        ):
            continue
        gain = 0.0
        if by != 1:
            # A spread of few points is not well known; once an edge is there, that is no matter
            least = ROUGHER**2 * (1.0 + 2.0 / np.sqrt(n_b)) if stride > 1 else 1.0
            if r_b <= least * r_a or r_b > ROUGHEST_M**2:
                continue
            gain = n * np.log(r) - n_a * np.log(r_a) - n_b * np.log(r_b)
            if stride > 1 and gain < 0.5 * CLEAR_SPLIT:
                continue
        if steady:
            gain += n * np.log(i) - n_a * np.log(i_a) - n_b * np.log(i_b)
        gains[k] = gain
        if gain > out[0]:
            out[0], out[1], out[2], out[3] = gain, v, np.sqrt(r_a), np.sqrt(r_b)
            out[4], out[5], out[6], out[7] = z_b - z_a, b_b / max(b_a, 1e-6) if steady else 1.0, n_a, n_b


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
    """Turn the v-axis until the profile changes most clearly; False when it does not, or not near the place.

    out: see `EDGE_COLUMNS`.
    """
    step, half_u = 0.02 * scale, 0.5 * scale
    # Looked for beyond the cell as well: what is clearest there is not clearest at the cell's rim
    half = int(1.4 * EDGE_REACH_V / step)
    found, gains = np.zeros(8), np.zeros(N_PROFILE_BINS)
    out[0], out[1] = frame
    out[2] = 0.0
    for stage in range(len(EDGE_TURNS)):
        x0, y0 = out[0], out[1]
        for turn in EDGE_TURNS[stage]:
            x, y = x0 * np.cos(turn) - y0 * np.sin(turn), x0 * np.sin(turn) + y0 * np.cos(turn)
            bin_sums_across(work, n, x, y, half_u, step, sums)
            split_in(sums, step, half, 4 if stage == 0 else 2, by, gains, found)
            if found[0] > out[2]:
                out[0], out[1] = x, y
                out[2:10] = found
        if out[2] < (0.5 * CLEAR_SPLIT if stage == 0 else CLEAR_SPLIT):
            return False
        if stage > 0 and beside_cell(out[0], out[1], out[3]):
            return False
    return True


@njit(cache=True, nogil=True)
def sharpen_split(
    work: FloatArray, n: int, first: FloatArray, scale: float, by: int, sums: FloatArray, out: FloatArray
) -> bool:
    """Find the change again within 20 cm of the place, in fine steps; v is the mean of where it may be.

    out: see `EDGE_COLUMNS`. Paint beside the edge is brighter than both sides: it has no say farther off.
    """
    step = 0.02 * scale
    found, gains = np.zeros(8), np.zeros(N_PROFILE_BINS)
    out[0], out[1], out[2] = first[0], first[1], 0.0
    for stage in range(len(FINE_TURNS)):
        x0, y0 = out[0], out[1]
        for turn in FINE_TURNS[stage]:
            x, y = x0 * np.cos(turn) - y0 * np.sin(turn), x0 * np.sin(turn) + y0 * np.cos(turn)
            bin_sums_across(work, n, x, y, 0.5 * scale, step, sums)
            split_in(sums, step, NEAR_BINS, 1, by, gains, found)
            if found[0] > out[2]:
                out[0], out[1] = x, y
                out[2:10] = found
    if out[2] < CLEAR_SPLIT or abs(out[3]) > (NEAR_BINS - 0.5) * step:
        return False
    bin_sums_across(work, n, out[0], out[1], 0.5 * scale, step, sums)
    split_in(sums, step, NEAR_BINS, 1, by, gains, found)
    total, mean, square = 0.0, 0.0, 0.0
    for k in range(N_PROFILE_BINS):
        if gains[k] > 0.0:
            likely, v = np.exp(0.5 * NEW_SHARE * (gains[k] - found[0])), (k - 0.5 * N_PROFILE_BINS) * step
            total += likely
            mean += likely * v
            square += likely * v * v
    mean /= total
    out[3], out[10] = mean, np.sqrt(max(square / total - mean * mean, 0.0) + step * step / 12.0)
    _out_of_shadow(work, n, step, 0.5 * scale, sums, out)
    return True


@njit(cache=True, nogil=True)
def _out_of_shadow(
    work: FloatArray, n: int, step: float, half_u: float, sums: FloatArray, out: FloatArray
) -> None:
    """Move an edge that lies among few points to the pavement's last ones.

    Behind an edge over a lower verge lies the scanner's shadow: the change may be anywhere in it, the edge is
    where it begins.
    """
    usual = (sums[N_PROFILE_BINS, 0] - sums[N_PROFILE_BINS // 2, 0]) / (N_PROFILE_BINS // 2)
    k = int(np.floor(out[3] / step)) + N_PROFILE_BINS // 2
    for j in (k - 1, k + 1):
        if sums[j + 1, 0] - sums[j, 0] < sums[k + 1, 0] - sums[k, 0]:
            k = j
    if sums[k + 1, 0] - sums[k, 0] >= SHADOW_SHARE * usual:
        return
    first = k
    while first > FAR_BIN and sums[first, 0] - sums[first - 1, 0] < SHADOW_SHARE * usual:
        first -= 1
    while k < N_PROFILE_BINS - 1 and sums[k + 1, 0] - sums[k, 0] < SHADOW_SHARE * usual:
        k += 1
    # So few points by chance are no shadow
    if (k - first) * usual < SHADOW_POINTS:
        return
    # The fourth last point, so that strays do no harm, and what lies on average beyond it
    begin = (k - 0.5 * N_PROFILE_BINS) * step
    last = np.full(4, begin + 4.0 * step)
    for i in range(n):
        x, y = work[i, 0], work[i, 1]
        v = x * out[0] + y * out[1]
        if v < begin or abs(x * out[1] - y * out[0]) > half_u or abs(work[i, 2]) > ROUGHEST_M:
            continue
        for j in range(4):
            nearer = min(last[j], v)
            v = max(last[j], v)
            last[j] = nearer
    spacing = step / max(usual, 0.5)
    out[3], out[10] = last[3] - 3.5 * spacing, 2.0 * spacing + SHADOW_SIGMA_M


# The box of an unkerbed pavement edge in one cell: found, measured, and judged

#: Share of the fine cells' differences that a slope must explain before their points are looked at.
EDGE_EXPLAINED = 0.25
#: A verge lies this far below or above the pavement at most. [m]
VERGE_STEP_M = 0.15
#: Gravel, soil and cut grass are rough by this at least. [m]
VERGE_M = 0.005


@njit(cache=True, nogil=True)
def differs(slopes: FloatArray, noise: float, by: int) -> bool:
    """Return whether the fine cells get rougher (by = 0) or brighter (by = 1) as next to a pavement's edge."""
    row = slopes[ROUGH + by]
    # By how much both sides of the area differ, if it is cut in half: 0.85 / R is the slope of a step of 1
    least = (ROUGHER - 1.0) * noise if by == 0 else 0.5 * (BRIGHTER - 1.0) * row[3]
    return bool(row[2] >= EDGE_EXPLAINED and np.hypot(row[0], row[1]) * AREA_M >= least)


@njit(cache=True, nogil=True)
def edge_in_cell(
    data: tuple[FloatArray, IntArray, IntArray, FloatArray, FloatArray],
    place: tuple[float, float],
    floor: tuple[FloatArray, float, float, float, float],
    around: tuple[FloatArray, float],
    area: tuple[int, float],
    limits: FloatArray,
    rooms: tuple[FloatArray, FloatArray, FloatArray],
    box: FloatArray,
) -> int:
    """Find where the pavement ends in the cell about `place`; write the box, return FOUND or why there is none.

    Arguments as for a kerb. First by roughness; where that tells nothing, by brightness alone.
    """
    points, starts, span, _, _ = data
    work, sums, edge = rooms
    x, y = place
    n, scale = area
    plane, first = floor[0].copy(), np.zeros(EDGE_COLUMNS)
    if n < 2 * SIDE_POINTS:
        return BOX_HOLE
    by, found = 0, False
    for k in range(2):
        gx, gy = around[0][ROUGH + k, 0], around[0][ROUGH + k, 1]
        size = np.hypot(gx, gy)
        if not found and differs(around[0], floor[1], k) and size > 0.0:
            by = k
            found = best_split(work, n, (-gx / size, -gy / size), scale, 2 - k, sums, first)
    if not found:
        return BOX_ALL_ROAD if first[2] < CLEAR_SPLIT else BOX_ELSEWHERE
    vx, vy, v = first[0], first[1], first[3]
    low, high = chord_in_cell(v * vx, v * vy, vy, -vx, 0.5 * BOX_CELL_M + 0.10)
    if high - low < 0.1:
        return BOX_ELSEWHERE
    # Once more about the middle of the piece in this cell
    mx, my = v * vx + 0.5 * (low + high) * vy, v * vy - 0.5 * (low + high) * vx
    plane[0] += plane[1] * mx + plane[2] * my
    n = gather_at(points, starts, span, (x + mx, y + my), 0.80 * scale, plane, MOST_PLACE_POINTS, work)
    if not sharpen_split(work, n, first, scale, 2 if by == 0 else 1, sums, edge):
        return BOX_ALL_ROAD
    vx, vy, v = edge[0], edge[1], edge[3]
    low, high = chord_in_cell(mx + v * vx, my + v * vy, vy, -vx, 0.5 * BOX_CELL_M)
    if high - low < 0.05:
        return BOX_ELSEWHERE
    if not _is_edge(edge, by, roughness_limit(floor[4], limits)):
        return BOX_NO_ROAD
    a, b, c, noise, count = fit_side(
        work, n, (vx, vy), (v + 0.02, v + 0.60 * scale, 0.5 * scale), (0.0, edge[4] + 0.01), (0.04, 0.04)
    )
    if count < SIDE_POINTS:
        return BOX_HOLE
    u = 0.5 * (low + high)
    dx, dy = v * vx + u * vy, v * vy - u * vx
    box[at_place.BOX_X], box[at_place.BOX_Y] = x + mx + dx, y + my + dy
    box[at_place.BOX_Z] = plane[0] + plane[1] * dx + plane[2] * dy + a + b * u + c * v
    box[at_place.BOX_UX], box[at_place.BOX_UY] = vy, -vx
    box[at_place.BOX_HALF_U] = 0.5 * BOX_CELL_M * scale
    box[at_place.S_V], box[at_place.S_U] = edge[10], edge[10] / (0.29 * scale)
    box[at_place.S_Z] = 2.0 * noise / np.sqrt(count)
    box[at_place.SCORE] = (
        1.0 - np.exp(-edge[2] / (4.0 * CLEAR_SPLIT))
        if by == 0
        else 0.5 * (1.0 - np.exp(-edge[2] / (4.0 * CLEAR_SPLIT)))
    )
    box[at_place.FORM], box[at_place.BOX_STEP], box[at_place.TOP_V] = at_place.EDGE, edge[6], np.nan
    box[at_place.COUNT] = edge[8] + edge[9]
    return BOX_FOUND


@njit(cache=True, nogil=True)
def _is_edge(edge: FloatArray, by: int, most: float) -> bool:
    """Return whether pavement lies on one side and a verge on the other."""
    smooth, rough, contrast = edge[4], edge[5], edge[7]
    rougher = by == 0 and rough >= ROUGHER * smooth and rough**2 - smooth**2 >= VERGE_M**2
    # What is only just no wall was made so by the road before it
    verge = (rougher or contrast >= BRIGHTER) and rough <= 0.8 * ROUGHEST_M
    return bool(verge and smooth <= most and abs(edge[6]) <= VERGE_STEP_M)
