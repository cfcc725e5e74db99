"""A step of brightness over some metres: the edge of a pavement where points are far apart, or the beam's spot is wide.

Separate from `edge_boxes`, whose search areas are as narrow as such a step is blurred: there it looks like a slope.

Positions are in metres from the survey's local origin.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.boundaries.edge_boxes import VERGE_STEP_M, differs
from linework.kernels.boundaries.kerbs.boxes import box_cell_at
from linework.kernels.boundaries.pavement_edges import (
    BY_BRIGHTNESS,
    CLEAR_SPLIT,
    NEW_SHARE,
    SIDE_POINTS,
    STEADY_POINTS,
)
from linework.kernels.boundaries.profiles import (
    CLIP_M,
    FLOOR_SOFT,
    LEAST_BOX_M,
    MOST_PLACE_POINTS,
    PLACE_COLUMNS,
    PLACE_INTENSITY,
    PLACE_R,
    PLACE_X,
    PLACE_Y,
    PLANE_EAST,
    PLANE_HEIGHT,
    PLANE_NORTH,
    UNIFORM_SIGMA,
    FloorCells,
    LocalFloor,
    PlaceScratch,
    count_near,
    fit_side,
)
from linework.kernels.boundaries.walls import gather_ground
from linework.kernels.cells.floor import FINE_M
from linework.kernels.cells.places import (
    AREA_POINTS,
    BOX_ALL_ROAD,
    BOX_CELL_M,
    BOX_ELSEWHERE,
    BOX_FOUND,
    BOX_HALF_U,
    BOX_HOLE,
    BOX_NO_ROAD,
    BOX_STEP,
    BOX_UX,
    BOX_UY,
    BOX_X,
    BOX_Y,
    BOX_Z,
    COUNT,
    EDGE,
    FORM,
    S_U,
    S_V,
    S_Z,
    SCORE,
    TOP_V,
    area_scale,
    chord_in_cell,
)

#: Reach of the profile to both sides, half of the length along it, and its bins [m]: a metre of road and one of verge
#: beyond a step that is a metre wide.
STEP_REACH_M, STEP_HALF_LENGTH_M, STEP_BIN_M = 2.0, 1.25, 0.1
STEP_BINS = int(2.0 * STEP_REACH_M / STEP_BIN_M + 0.5)
#: Points farther apart than in usual search areas: 60 to the square metre and fewer, 0.13 m. Denser ones show a step in
#: those, unless it is none.
MOST_PER_M2 = 60.0
#: Area of the fine cells in which they are counted. [m2]
COUNTED_M2 = (2.0 * STEP_REACH_M + FINE_M) ** 2
#: Half widths of a step that are tried: that of the beam's spot and of the spacing of points, up to a metre in all. [m]
HALF_STEPS_M = np.array([0.1, 0.25, 0.5])
#: The step is sought this far from the cell's middle: half of its diagonal and the slack of a turned profile. [m]
SEEK_M = 0.45
#: Turns about the direction of the gradient, coarse to fine. [rad]
STEP_TURNS = (
    np.deg2rad(np.array([0.0, -20.0, 20.0])),
    np.deg2rad(np.array([-10.0, 10.0])),
    np.deg2rad(np.array([-5.0, 5.0])),
)
#: Bins about a step that tell its place (0.8 m: a step that is a metre wide, and what it rises from and to), and how many
#: of the half widths are tried there.
PLACE_BINS, PLACE_HALVES = 8, 2
#: Widest stripe or joint that may look like a step, and widest line at the end of a pavement with the blur of its edges.
#: [bins]
STRIPE_BINS, PAINT_BINS = 7, 5
#: Road differs from road, patched or worn, by a tenth of its level or the noise of a point, twice as a standard
#: deviation; verges by up to eight times that. Asphalt that was laid at different times differs by 10 to 30 %, grass from
#: asphalt by 50 % and more in near infrared.
ALBEDO_SHARE, PATCHES_DIFFER, VERGES_DIFFER = 0.1, 2.0, 8.0
#: Sums of a bin: points, brightness and its square; columns of a step: clearness, place [m], half width [m], levels beyond
#: and before it, noise, standard deviation of the place [m].
_N, _I, _II = range(3)
STEP_CLEAR, STEP_V, STEP_HALF, STEP_BRIGHT, STEP_DARK, STEP_SPREAD, STEP_SIGMA = range(7)


@njit(cache=True, nogil=True)
def brightness_step_in_cell(
    data: FloorCells,
    place: tuple[float, float],
    floor: LocalFloor,
    slopes: FloatArray,
    scratch: PlaceScratch,
    box: FloatArray,
) -> int:
    """Find a step from road to brighter ground in the cell about `place`; write the box, return `BOX_FOUND` or why not.

    Arguments as for `linework.kernels.boundaries.edge_boxes.edge_in_cell`.
    """
    work = scratch.work
    x, y = place
    # What is a step over some metres is a slope here
    if not data.near_road[box_cell_at(data.span, x, y)] or not differs(slopes, floor.noise, BY_BRIGHTNESS):
        return BOX_ALL_ROAD
    if count_near(data.starts, data.span, place, STEP_REACH_M) >= MOST_PER_M2 * COUNTED_M2:
        return BOX_ALL_ROAD
    reach = math.hypot(STEP_REACH_M, STEP_HALF_LENGTH_M)
    n = _near_plane(work, gather_ground(data, place, reach, floor.plane, MOST_PLACE_POINTS, work))
    if n < 4 * SIDE_POINTS:
        return BOX_HOLE
    vx, vy = _towards_dark(work, n)
    bins, found, best = np.zeros((STEP_BINS + 1, 3)), np.zeros(7), np.zeros(7)
    for stage in range(len(STEP_TURNS)):
        x0, y0 = vx, vy
        for turn in STEP_TURNS[stage]:
            tx, ty = x0 * np.cos(turn) - y0 * np.sin(turn), x0 * np.sin(turn) + y0 * np.cos(turn)
            _sum_bins(work, n, tx, ty, bins)
            step_of_brightness(bins, found)
            if found[STEP_CLEAR] > best[STEP_CLEAR]:
                best[:], vx, vy = found, tx, ty
        if best[STEP_CLEAR] < CLEAR_SPLIT:
            return BOX_ALL_ROAD
    _sum_bins(work, n, vx, vy, bins)
    if not place_of_step(bins, best):
        return BOX_ELSEWHERE
    v, half = best[STEP_V], best[STEP_HALF]
    low, high = chord_in_cell(v * vx, v * vy, vy, -vx, 0.5 * BOX_CELL_M)
    if high - low < LEAST_BOX_M:
        return BOX_ELSEWHERE
    before = (v + half, STEP_REACH_M, STEP_HALF_LENGTH_M)
    a, b, c, noise, count = fit_side(work, n, (vx, vy), before, (0.0, VERGE_STEP_M), FLOOR_SOFT)
    beyond = (-STEP_REACH_M, v - half, STEP_HALF_LENGTH_M)
    a_beyond, _, c_beyond, _, n_beyond = fit_side(work, n, (vx, vy), beyond, (0.0, VERGE_STEP_M), FLOOR_SOFT)
    if min(count, n_beyond) < SIDE_POINTS:
        return BOX_HOLE
    rise = a_beyond + c_beyond * v - a - c * v
    if abs(rise) > VERGE_STEP_M:
        return BOX_NO_ROAD
    u = 0.5 * (low + high)
    dx, dy = v * vx + u * vy, v * vy - u * vx
    plane = floor.plane
    box[BOX_X], box[BOX_Y] = x + dx, y + dy
    box[BOX_Z] = plane[PLANE_HEIGHT] + plane[PLANE_EAST] * dx + plane[PLANE_NORTH] * dy + a + b * u + c * v
    box[BOX_UX], box[BOX_UY] = vy, -vx
    # As long as other boxes among so few points
    box[BOX_HALF_U] = 0.5 * BOX_CELL_M * area_scale(data.starts, data.span, place, AREA_POINTS)
    box[S_V], box[S_U] = best[STEP_SIGMA], best[STEP_SIGMA] / (2.0 * UNIFORM_SIGMA * STEP_HALF_LENGTH_M)
    box[S_Z] = 2.0 * noise / np.sqrt(count)
    clear = 1.0 / (1.0 + math.exp(-0.5 * NEW_SHARE * best[STEP_CLEAR]))
    box[SCORE] = clear * chance_of_verge(best[STEP_BRIGHT], best[STEP_DARK], best[STEP_SPREAD])
    box[FORM], box[BOX_STEP], box[TOP_V], box[COUNT] = EDGE, rise, np.nan, count + n_beyond
    return BOX_FOUND


@njit(cache=True, nogil=True)
def chance_of_verge(bright: float, dark: float, noise: float) -> float:
    """Return the chance that brighter ground beside a road is its verge, not another part of the road.

    bright, dark, noise: levels of both, and the noise of a point.
    """
    apart = max(bright - dark, 0.0) / max(noise, ALBEDO_SHARE * abs(dark))
    patch = math.sqrt(2.0 / math.pi) / PATCHES_DIFFER * math.exp(-0.5 * (apart / PATCHES_DIFFER) ** 2)
    return float(1.0 / (1.0 + VERGES_DIFFER * patch))


@njit(cache=True, nogil=True)
def _near_plane(work: FloatArray, n: int) -> int:
    """Keep the points of a place (n or more, 4) that are near its plane, in front; return their number."""
    m = 0
    for i in range(n):
        if abs(work[i, PLACE_R]) <= CLIP_M:
            # A row as a view of it costs two locked instructions
            for k in range(PLACE_COLUMNS):
                work[m, k] = work[i, k]
            m += 1
    return m


@njit(cache=True, nogil=True)
def _towards_dark(work: FloatArray, n: int) -> tuple[float, float]:
    """Return the unit vector against the gradient of the brightness of points (n or more, 4)."""
    mx, my, mi = work[:n, PLACE_X].mean(), work[:n, PLACE_Y].mean(), work[:n, PLACE_INTENSITY].mean()
    xx, xy, yy, xi, yi = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        x, y, bright = work[i, PLACE_X] - mx, work[i, PLACE_Y] - my, work[i, PLACE_INTENSITY] - mi
        xx += x * x
        xy += x * y
        yy += y * y
        xi += x * bright
        yi += y * bright
    gx, gy = yy * xi - xy * yi, xx * yi - xy * xi
    size = math.hypot(gx, gy)
    return (-gx / size, -gy / size) if size > 0.0 else (1.0, 0.0)


@njit(cache=True, nogil=True)
def _sum_bins(work: FloatArray, n: int, vx: float, vy: float, bins: FloatArray) -> None:
    """Write running sums over the bins across, (41, 3); work: (n or more, 4); (vx, vy): unit vector across."""
    bins[:] = 0.0
    for i in range(n):
        x, y = work[i, PLACE_X], work[i, PLACE_Y]
        v = x * vx + y * vy
        if abs(v) >= STEP_REACH_M or abs(x * vy - y * vx) > STEP_HALF_LENGTH_M:
            continue
        k = min(int((v + STEP_REACH_M) / STEP_BIN_M), STEP_BINS - 1) + 1
        bright = work[i, PLACE_INTENSITY]
        bins[k, _N] += 1.0
        bins[k, _I] += bright
        bins[k, _II] += bright * bright
    for k in range(1, STEP_BINS + 1):
        for j in range(3):
            bins[k, j] += bins[k - 1, j]


@njit(cache=True, nogil=True)
def step_of_brightness(bins: FloatArray, out: FloatArray) -> None:
    """Write how much clearer a step explains a profile than a slope or a stripe, and where it is.

    Parameters
    ----------
    bins
        (41, 3): running sums of points, brightness and its square over bins across, the brighter side first.
    out
        (7,) output with the columns `STEP_CLEAR` to `STEP_SIGMA`; clearness 0 where there is no step.
    """
    out[:] = 0.0
    n, square = bins[STEP_BINS, _N], bins[STEP_BINS, _II]
    middle = STEP_BINS // 2
    if min(bins[middle, _N], n - bins[middle, _N]) < SIDE_POINTS:
        return
    other = max(min(_left_by_slope(bins), _left_by_stripe(bins)), 1e-9 * square, 1e-12)
    places = int(SEEK_M / STEP_BIN_M + 0.5)
    for k in range(-places, places + 1):
        v = k * STEP_BIN_M
        for half in HALF_STEPS_M:
            left, bright, dark = _left_by_step(bins, (0, STEP_BINS), v, half)
            if bright > dark and n * math.log(other / left) > out[STEP_CLEAR]:
                out[STEP_CLEAR], out[STEP_V], out[STEP_HALF] = n * math.log(other / left), v, half
                out[STEP_BRIGHT], out[STEP_DARK], out[STEP_SPREAD] = bright, dark, math.sqrt(left / n)


@njit(cache=True, nogil=True)
def place_of_step(bins: FloatArray, out: FloatArray) -> bool:
    """Write where the brightness rises most about a step, and the standard deviation of that place; False if it is not known.

    Farther off, a verge has levels of its own (mown, gravel, tall grass), whose middle is not the edge of the road.
    Parameters as for `step_of_brightness`, whose result is `out`.
    """
    middle = int((out[STEP_V] + STEP_REACH_M) / STEP_BIN_M + 0.5)
    first, last = max(middle - PLACE_BINS, 0), min(middle + PLACE_BINS, STEP_BINS)
    n = bins[last, _N] - bins[first, _N]
    total, mean, square, best, rise = 0.0, 0.0, 0.0, math.inf, 0.0
    lefts = np.full(2 * PLACE_BINS, math.inf)
    for k in range(first + 2, last - 1):
        for half in HALF_STEPS_M[:PLACE_HALVES]:
            left, bright, dark = _left_by_step(bins, (first, last), k * STEP_BIN_M - STEP_REACH_M, half)
            if bright > dark:
                lefts[k - first] = min(lefts[k - first], left)
                if left < best:
                    best, rise = left, bright - dark
    # Beyond a hole, what rises here is not the step
    if rise < 0.5 * (out[STEP_BRIGHT] - out[STEP_DARK]):
        return False
    # The mean over all places, weighted by their likelihood
    for k in range(first + 2, last - 1):
        if math.isfinite(lefts[k - first]):
            likely = (lefts[k - first] / best) ** (-0.5 * NEW_SHARE * n)
            v = k * STEP_BIN_M - STEP_REACH_M
            total += likely
            mean += likely * v
            square += likely * v * v
    mean /= total
    out[STEP_V] = mean
    out[STEP_SIGMA] = math.sqrt(max(square / total - mean * mean, 0.0) + STEP_BIN_M**2 / 12.0)
    _behind_paint(bins, (first, last), out)
    return True


@njit(cache=True, nogil=True)
def _behind_paint(bins: FloatArray, of: tuple[int, int], out: FloatArray) -> None:
    """Set a step back behind a stripe of paint that is brighter than the road and than what lies beyond it.

    An edge line at the end of a pavement is the steepest rise, and belongs to the road. Parameters as for `place_of_step`;
    of: first and last of the bins that count.
    """
    first, last = of
    n = bins[last, _N] - bins[first, _N]
    step = min(max(int((out[STEP_V] + STEP_REACH_M) / STEP_BIN_M + 0.5), first + 1), last - 1)
    without = max(_squares(bins, first, step) + _squares(bins, step, last), 1e-12)
    most, edge = 0.5 * CLEAR_SPLIT, -1
    for b in range(max(step - PAINT_BINS // 2, first + 3), min(step + PAINT_BINS // 2 + 1, last)):
        for a in range(max(b - PAINT_BINS, first + 1), b - 1):
            # Where there is no point, nothing is known
            fewest = min(
                bins[a, _N] - bins[first, _N], bins[b, _N] - bins[a, _N], bins[last, _N] - bins[b, _N]
            )
            if fewest < STEADY_POINTS:
                continue
            inside, beyond, before = _mean(bins, a, b), _mean(bins, first, a), _mean(bins, b, last)
            if inside <= beyond or inside <= before:
                continue
            left = _squares(bins, first, a) + _squares(bins, a, b) + _squares(bins, b, last)
            gain = n * math.log(without / max(left, 1e-9 * without))
            if gain > most:
                most, edge = gain, a
    if edge >= 0:
        out[STEP_V] = edge * STEP_BIN_M - STEP_REACH_M
        out[STEP_BRIGHT] = _mean(bins, first, edge)


@njit(cache=True, nogil=True)
def _mean(bins: FloatArray, a: int, b: int) -> float:
    """Return the mean brightness of the bins a to b - 1, 0 without points."""
    n = bins[b, _N] - bins[a, _N]
    return float((bins[b, _I] - bins[a, _I]) / n) if n > 0.0 else 0.0


@njit(cache=True, nogil=True)
def _squares(bins: FloatArray, a: int, b: int) -> float:
    """Return the sum of squares of the brightness about its mean in the bins a to b - 1."""
    n, total = bins[b, _N] - bins[a, _N], bins[b, _I] - bins[a, _I]
    return float(max(bins[b, _II] - bins[a, _II] - (total * total / n if n > 0.0 else 0.0), 0.0))


@njit(cache=True, nogil=True)
def _left_by_step(bins: FloatArray, of: tuple[int, int], v: float, half: float) -> tuple[float, float, float]:
    """Return the sum of squares that a step leaves, and the levels beyond and before it, by least squares.

    bins: (41, 3), see `step_of_brightness`; of: first and last of those that count; v, half: place and half width [m].
    """
    first, last = of
    n, total = bins[last, _N] - bins[first, _N], bins[last, _I] - bins[first, _I]
    square = bins[last, _II] - bins[first, _II]
    s1, s2, si = 0.0, 0.0, 0.0
    for b in range(first, last):
        at = (b + 0.5) * STEP_BIN_M - STEP_REACH_M
        share = min(max((at - v) / (2.0 * half) + 0.5, 0.0), 1.0)
        m = bins[b + 1, _N] - bins[b, _N]
        s1 += m * share
        s2 += m * share * share
        si += (bins[b + 1, _I] - bins[b, _I]) * share
    aa, ab, bb = n - 2.0 * s1 + s2, s1 - s2, s2
    det = aa * bb - ab * ab
    if min(aa, bb) < 0.5 * SIDE_POINTS or det <= 0.0:
        return math.inf, 0.0, 0.0
    bright, dark = (bb * (total - si) - ab * si) / det, (aa * si - ab * (total - si)) / det
    left = square - bright * (total - si) - dark * si
    return max(left, 1e-9 * square, 1e-12), bright, dark


@njit(cache=True, nogil=True)
def _left_by_slope(bins: FloatArray) -> float:
    """Return the sum of squares that brightness in proportion to the distance across leaves; bins as above."""
    n, total, square = bins[STEP_BINS, _N], bins[STEP_BINS, _I], bins[STEP_BINS, _II]
    sv, svv, svi = 0.0, 0.0, 0.0
    for b in range(STEP_BINS):
        at = (b + 0.5) * STEP_BIN_M - STEP_REACH_M
        m = bins[b + 1, _N] - bins[b, _N]
        sv += m * at
        svv += m * at * at
        svi += (bins[b + 1, _I] - bins[b, _I]) * at
    vv, vi = svv - sv * sv / n, svi - sv * total / n
    left = square - total * total / n - (vi * vi / vv if vv > 0.0 else 0.0)
    return float(left)


@njit(cache=True, nogil=True)
def _left_by_stripe(bins: FloatArray) -> float:
    """Return the sum of squares that the best stripe of paint, or joint, on even ground leaves; bins as above."""
    n, total, square = bins[STEP_BINS, _N], bins[STEP_BINS, _I], bins[STEP_BINS, _II]
    most = 0.0
    for a in range(STEP_BINS):
        for b in range(a + 1, min(a + STRIPE_BINS, STEP_BINS) + 1):
            m, inside = bins[b, _N] - bins[a, _N], bins[b, _I] - bins[a, _I]
            if m > 0.0 and m < n:
                off = n * inside - m * total
                most = max(most, off * off / (n * m * (n - m)))
    return float(square - total * total / n - most)
