"""The box of a kerb with a sloping face in one cell: floor, ramp and top fitted together.

Separate from `boxes`, which looks for a step: flat kerbs, worn stones and banks of pavers rise by 10 cm over 0.25 to
0.5 m. Between two lines with a break their faces are taken for steep tops.

Frame and points as in `linework.kernels.boundaries.profiles`; the carriageway is at positive v.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.boundaries.kerbs.boxes import (
    LONGEST_HALF_M,
    PROFILE_SHARE,
    box_cell_at,
    is_kerb,
    rises_throughout,
    write_kerb,
)
from linework.kernels.boundaries.kerbs.sides import COVER_COLUMNS, filled_shares
from linework.kernels.boundaries.kerbs.steps import (
    CLEAR_STEP,
    FLOOR_POINTS,
    KERB_REACH_V,
    KERB_TOP_WIDTH_M,
    SMALLEST_STEP_M,
    STEP_FOOT,
    STEP_HEIGHT,
    STEP_N_FACE,
    STEP_NOISE,
    STEP_SIGMA_H,
    STEP_SIGMA_U,
    STEP_SIGMA_V,
    STEP_VX,
    STEP_VY,
    STRAIGHT_KERB_M,
    TOP_POINTS,
    TOP_SOFT,
    write_step,
)
from linework.kernels.boundaries.profiles import (
    BIN_N,
    BIN_R,
    BIN_RR,
    BIN_V,
    BIN_VR,
    BIN_VV,
    CHORD_SLACK_M,
    CLEAR_M,
    ENOUGH_POINTS,
    FLOOR_SOFT,
    FLOOR_WIDTH_M,
    HALF_LENGTH_M,
    HIGH_BINS,
    LEAST_BOX_M,
    LEAST_FLOOR_NOISE_M,
    LOW_BINS,
    MOST_PLACE_POINTS,
    N_PROFILE_BINS,
    PIECE_POINTS,
    PLANE_EAST,
    PLANE_HEIGHT,
    PLANE_NORTH,
    PROFILE_BIN_M,
    STEEP_TOP,
    UNIFORM_SIGMA,
    FloorCells,
    FloorLimits,
    LocalFloor,
    PlaceScratch,
    bin_sums_across,
    count_near,
    fit_side,
    gather_at,
    line_through,
)
from linework.kernels.cells.places import (
    AREA_M,
    BOX_ALL_ROAD,
    BOX_CELL_M,
    BOX_ELSEWHERE,
    BOX_FOUND,
    BOX_NO_ROAD,
    BOX_UX,
    BOX_UY,
    BOX_X,
    BOX_Y,
    S_V,
    S_Z,
    chord_in_cell,
    is_rougher,
    is_unpaved,
    points_in_noise,
)
from linework.kernels.cells.surroundings import FIELD_HEIGHT, SLOPE_EAST, SLOPE_NORTH

#: Widths of ramps that are tried, in bins of 2 cm of a usual search area: flat kerbs of 8 cm to banks of half a metre.
RAMP_BINS = np.array([4, 8, 12, 16, 24])
#: Unknowns of the explanations of a profile, each of which costs the logarithm of the number of points: a line, two lines
#: with a break, and two lines with a ramp between them.
LINE_UNKNOWNS, BREAK_UNKNOWNS, RAMP_UNKNOWNS = 2.0, 5.0, 6.0
#: Rotations of the profile tried about the slope of the heights: a ramp smears a turn less than a step does. [rad]
RAMP_TURNS = (
    np.deg2rad(np.array([0.0])),
    np.deg2rad(np.array([-16.0, 16.0])),
    np.deg2rad(np.array([-8.0, 8.0])),
    np.deg2rad(np.array([-4.0, 4.0])),
)
#: Columns of the clearest ramp of a profile: unit vector v, clearness, v of the foot and of the top edge, heights of
#: both, noise [m].
RAMP_VX, RAMP_VY, RAMP_CLEAR, RAMP_FOOT, RAMP_TOP, RAMP_BELOW, RAMP_ABOVE, RAMP_NOISE = range(8)
RAMP_COLUMNS = 8
#: Least slope of a ramp against its floor and its top: crowns, channels and footways have less. [m/m]
LEAST_RAMP_SLOPE = 0.12
#: Largest slope of a ramp: faces that lean back by less are those of steps, see `fit_face`. [m/m]
MOST_RAMP_SLOPE = 1.0
#: Largest slope of a ramp that replaces a step: a face that leans back by 1 is half of a ramp that does by 2. [m/m]
MOST_SLOPE_INSTEAD = 0.5
#: Weights that hold a ramp's slopes along u and v to 0 [m^2]; share of its width at either end that is left out: points of
#: floor and top near its ends turn its plane. The share is set, not measured.
RAMP_SOFT, RAMP_END = (1e-3, 1e-4), 0.1
#: Rounds of fitting the three planes, and the largest turn in one round [rad], so that a plane of few points cannot turn the
#: frame away. Set, not measured.
RAMP_ROUNDS, MOST_FOOT_TURN = 3, 0.2
#: Variance of a line's height at its end over that at its middle, for points spread evenly along it: 1 + 3.
END_VARIANCE = 4.0


@njit(cache=True, nogil=True)
def ramp_in_cell(
    data: FloorCells,
    place: tuple[float, float],
    floor: LocalFloor,
    slopes: FloatArray,
    scale: float,
    limits: FloorLimits,
    scratch: PlaceScratch,
    box: FloatArray,
) -> int:
    """Find the foot of a sloping kerb in the cell about `place`; write the box, return `BOX_FOUND` or why there is none.

    Parameters as for `linework.kernels.boundaries.kerbs.boxes.kerb_in_cell`, with slopes (4, 4); scale: radius of the
    search area over the usual one.
    """
    x, y = place
    why = BOX_ALL_ROAD
    east, north = slopes[FIELD_HEIGHT, SLOPE_EAST], slopes[FIELD_HEIGHT, SLOPE_NORTH]
    size = np.hypot(east, north)
    # At the road only: ground rises like this anywhere
    if size == 0.0 or not data.near_road[box_cell_at(data.span, x, y)]:
        return why
    frame = -east / size, -north / size
    usual_m = half_u = HALF_LENGTH_M * scale
    most = points_in_noise(floor.scanner, MOST_PLACE_POINTS)
    while half_u <= max(usual_m, LONGEST_HALF_M):
        radius = np.hypot(half_u, AREA_M * scale)
        if half_u > usual_m and count_near(data.starts, data.span, place, radius) > most:
            break
        why = _ramp_over(data, place, floor, frame, (scale, half_u, radius), limits, scratch, box)
        if why == BOX_FOUND:
            longer = np.sqrt(half_u / usual_m)
            box[S_V], box[S_Z] = longer * box[S_V], longer * box[S_Z]
            break
        half_u *= 2.0
    return why


@njit(cache=True, nogil=True)
def ramp_instead(
    data: FloorCells,
    place: tuple[float, float],
    floor: LocalFloor,
    scale: float,
    limits: FloorLimits,
    scratch: PlaceScratch,
    box: FloatArray,
) -> int:
    """Replace the kerb that was found in a cell where a ramp explains its profile better; return as `ramp_in_cell`.

    A step that is fitted to a ramp lies in the middle of it. `BOX_ELSEWHERE`: the ramp's foot is in another cell.
    Parameters as for `ramp_in_cell`.
    """
    half_u = HALF_LENGTH_M * scale
    radius = np.hypot(half_u, AREA_M * scale)
    frame = -box[BOX_UY], box[BOX_UX]
    most = points_in_noise(floor.scanner, ENOUGH_POINTS)
    n = gather_at(data.points, data.starts, data.span, place, AREA_M * scale, floor.plane, most, scratch.work)
    step = PROFILE_BIN_M * scale
    # In the step's own direction, for in another one a step is a ramp; with its foot before that of the step
    bin_sums_across(scratch.work, n, frame[0], frame[1], half_u, step, scratch.sums, False)
    v = (box[BOX_X] - place[0]) * frame[0] + (box[BOX_Y] - place[1]) * frame[1]
    k = min(max(int(v / step + 0.5 * N_PROFILE_BINS), 0), N_PROFILE_BINS)
    reach = k, min(k + RAMP_BINS[-1], N_PROFILE_BINS)
    if ramp_in(scratch.sums, step, reach, MOST_SLOPE_INSTEAD)[0] < CLEAR_STEP:
        return BOX_FOUND
    ramp = box.copy()
    why = _ramp_over(data, place, floor, frame, (scale, half_u, radius), limits, scratch, ramp)
    if why == BOX_FOUND:
        box[:] = ramp
    return why if why == BOX_ELSEWHERE else BOX_FOUND


@njit(cache=True, nogil=True)
def _ramp_over(
    data: FloorCells,
    place: tuple[float, float],
    floor: LocalFloor,
    frame: tuple[float, float],
    window: tuple[float, float, float],
    limits: FloorLimits,
    scratch: PlaceScratch,
    box: FloatArray,
) -> int:
    """Find the foot of a sloping kerb as `ramp_in_cell`, in a window of one length.

    frame: unit vector v to begin with. window: radius of the search area over the usual one, half of its length, and
    radius about the place [m].
    """
    work, sums, step = scratch
    scale, half_u, radius = window
    x, y = place
    most = points_in_noise(floor.scanner, MOST_PLACE_POINTS)
    usual = points_in_noise(floor.scanner, ENOUGH_POINTS)
    wanted = usual if half_u <= HALF_LENGTH_M * scale else most
    n = gather_at(data.points, data.starts, data.span, place, radius, floor.plane, wanted, work)
    first, share, plane = np.zeros(RAMP_COLUMNS), np.zeros(COVER_COLUMNS), floor.plane.copy()
    if not best_ramp(work, n, frame, scale, half_u, sums, first):
        return BOX_ALL_ROAD
    if first[RAMP_ABOVE] - first[RAMP_BELOW] < PROFILE_SHARE * limits.least_step:
        return BOX_ALL_ROAD
    vx, vy, v = first[RAMP_VX], first[RAMP_VY], first[RAMP_FOOT]
    low, high = chord_in_cell(v * vx, v * vy, vy, -vx, 0.5 * BOX_CELL_M + CHORD_SLACK_M)
    middle = 0.5 * (low + high) if low <= high else 0.0
    # Measured again about the middle of the foot within this cell, or where it is nearest to the cell
    mx, my = v * vx + middle * vy, v * vy - middle * vx
    plane[PLANE_HEIGHT] += plane[PLANE_EAST] * mx + plane[PLANE_NORTH] * my
    again = (x + mx, y + my)
    n = gather_at(data.points, data.starts, data.span, again, radius, plane, most, work)
    first[RAMP_FOOT], first[RAMP_TOP] = 0.0, first[RAMP_TOP] - first[RAMP_FOOT]
    if not measure_ramp(work, n, first, scale, half_u, step):
        return BOX_ALL_ROAD
    # The ground rises like this in places: the floor must be pavement, and the rise must go on
    if is_unpaved(step[STEP_NOISE], floor.usual):
        return BOX_NO_ROAD
    if not rises_throughout(work, n, step, scale, half_u):
        return BOX_NO_ROAD
    filled_shares(work, n, step, scale, half_u, share)
    if not is_kerb(step, share, floor, limits):
        return BOX_NO_ROAD
    vx, vy, foot = step[STEP_VX], step[STEP_VY], step[STEP_FOOT]
    low, high = chord_in_cell(mx + foot * vx, my + foot * vy, vy, -vx, 0.5 * BOX_CELL_M)
    if high - low < LEAST_BOX_M:
        return BOX_ELSEWHERE
    write_kerb(step, share, plane, again, 0.5 * (low + high), scale, box)
    return BOX_FOUND


@njit(cache=True, nogil=True)
def best_ramp(
    work: FloatArray,
    n: int,
    frame: tuple[float, float],
    scale: float,
    half_u: float,
    sums: FloatArray,
    out: FloatArray,
) -> bool:
    """Turn the v-axis until a ramp explains the profile best; return False if none does.

    Parameters as for `linework.kernels.boundaries.kerbs.steps.best_step`; out: (8,), columns `RAMP_VX` to
    `RAMP_NOISE`.
    """
    step = PROFILE_BIN_M * scale
    half = int(KERB_REACH_V / step) + 1
    reach = N_PROFILE_BINS // 2 - half, N_PROFILE_BINS // 2 + half
    out[RAMP_VX], out[RAMP_VY] = frame
    out[RAMP_CLEAR] = 0.0
    for stage in range(len(RAMP_TURNS)):
        x0, y0 = out[RAMP_VX], out[RAMP_VY]
        for turn in RAMP_TURNS[stage]:
            x, y = x0 * np.cos(turn) - y0 * np.sin(turn), x0 * np.sin(turn) + y0 * np.cos(turn)
            bin_sums_across(work, n, x, y, half_u, step, sums, False)
            clear, foot, top, below, above, noise = ramp_in(sums, step, reach, MOST_RAMP_SLOPE)
            if clear > out[RAMP_CLEAR]:
                out[RAMP_VX], out[RAMP_VY], out[RAMP_CLEAR] = x, y, clear
                out[RAMP_FOOT], out[RAMP_TOP] = foot, top
                out[RAMP_BELOW], out[RAMP_ABOVE], out[RAMP_NOISE] = below, above, noise
        if out[RAMP_CLEAR] < (0.5 * CLEAR_STEP if stage == 0 else CLEAR_STEP):
            return False
    return True


@njit(cache=True, nogil=True)
def ramp_in(
    sums: FloatArray, step: float, reach: tuple[int, int], steepest: float
) -> tuple[float, float, float, float, float, float]:
    """Return the clearest ramp of a profile up towards -v: clearness, v of foot and top, their heights, noise [m].

    The clearness is the sum of squares that two lines with a ramp between them explain beyond the best of one line
    and of two lines with a break, over their noise variance, less what the further unknowns cost.

    Parameters
    ----------
    sums, step
        (73, 9), [m]: see `linework.kernels.boundaries.profiles.bin_sums_across`.
    reach
        First and last bin of the feet that are tried.
    steepest
        Largest slope of the ramp. [m/m]
    """
    best, foot, top, below, above, noise = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(reach[0], reach[1] + 1, 2):
        v = (k - 0.5 * N_PROFILE_BINS) * step
        last = min(k + LOW_BINS, N_PROFILE_BINS)
        n_low, left_low, z_low, slope_low = line_through(sums, k, last, v)
        if n_low < PIECE_POINTS:
            continue
        for width in RAMP_BINS:
            k_top = k - width
            if k_top < 1:
                break
            v_top = v - width * step
            start = max(k_top - HIGH_BINS, 0)
            n_high, left_high, z_high, slope_high = line_through(sums, start, k_top, v_top)
            if n_high < PIECE_POINTS:
                break
            slope = (z_low - z_high) / (v - v_top)
            if max(slope - slope_low, slope - slope_high) > -LEAST_RAMP_SLOPE:
                continue
            if slope < -steepest or abs(slope_high - slope_low) > STEEP_TOP:
                continue
            n = sums[last, BIN_N] - sums[start, BIN_N]
            left = left_low + left_high + _left_of(sums, k_top, k, z_low - slope * v, slope)
            square = left / max(n - RAMP_UNKNOWNS, 1.0) + LEAST_FLOOR_NOISE_M**2
            cost = square * np.log(n)
            other = line_through(sums, start, last, v)[1] + LINE_UNKNOWNS * cost
            if (other - left - RAMP_UNKNOWNS * cost) / square <= best:
                continue
            middle = k - width // 2
            at_foot = line_through(sums, start, k, v)[1] + left_low
            at_middle = line_through(sums, start, middle, v)[1] + line_through(sums, middle, last, v)[1]
            at_top = left_high + line_through(sums, k_top, last, v)[1]
            other = min(other, min(at_foot, at_middle, at_top) + BREAK_UNKNOWNS * cost)
            clear = (other - left - RAMP_UNKNOWNS * cost) / square
            if clear > best:
                best, foot, top, below, above, noise = clear, v, v_top, z_low, z_high, np.sqrt(square)
    return best, foot, top, below, above, noise


@njit(cache=True, nogil=True)
def _left_of(sums: FloatArray, a: int, b: int, height: float, slope: float) -> float:
    """Return the residual sum of squares of the bins a to b - 1 about the line height + slope v."""
    n, v, r = (
        sums[b, BIN_N] - sums[a, BIN_N],
        sums[b, BIN_V] - sums[a, BIN_V],
        sums[b, BIN_R] - sums[a, BIN_R],
    )
    vv, vr = sums[b, BIN_VV] - sums[a, BIN_VV], sums[b, BIN_VR] - sums[a, BIN_VR]
    rr = sums[b, BIN_RR] - sums[a, BIN_RR]
    left = rr - 2.0 * (height * r + slope * vr) + n * height**2 + 2.0 * height * slope * v + slope**2 * vv
    return float(max(left, 0.0))


@njit(cache=True, nogil=True)
def measure_ramp(
    work: FloatArray, n: int, first: FloatArray, scale: float, half_u: float, out: FloatArray
) -> bool:
    """Measure the ramp that runs through the place along u; return False where a plane is missing.

    The foot is where the planes of floor and ramp meet, the top edge where those of ramp and top do.

    Parameters as for `linework.kernels.boundaries.kerbs.steps.measure_step`, with first (8,): see `best_ramp`.
    """
    vx, vy = first[RAMP_VX], first[RAMP_VY]
    foot, top = first[RAMP_FOOT], first[RAMP_TOP]
    a, a2 = first[RAMP_BELOW], first[RAMP_ABOVE]
    noise = noise2 = first[RAMP_NOISE]
    clear = CLEAR_M * scale
    for k in range(RAMP_ROUNDS):
        width, middle, rise = foot - top, 0.5 * (a + a2), 0.5 * (a2 - a)
        side = (foot + clear, foot + FLOOR_WIDTH_M * scale, half_u)
        a, b, c, noise, n_floor = fit_side(work, n, (vx, vy), side, (a, noise + 0.01), FLOOR_SOFT)
        side = (top - clear - KERB_TOP_WIDTH_M * scale, top - clear, half_u)
        a2, _, c2, noise2, n_top = fit_side(work, n, (vx, vy), side, (a2, noise2 + 0.01), TOP_SOFT)
        side = (top + RAMP_END * width, foot - RAMP_END * width, half_u)
        a3, b3, c3, noise3, n_ramp = fit_side(work, n, (vx, vy), side, (middle, rise + noise), RAMP_SOFT)
        if n_floor < FLOOR_POINTS or n_top < TOP_POINTS or n_ramp < TOP_POINTS:
            return False
        if max(c3 - c, c3 - c2) > -LEAST_RAMP_SLOPE:
            return False
        foot, top = (a3 - a) / (c - c3), (a3 - a2) / (c2 - c3)
        if not 0.5 * width < foot - top < 2.0 * width:
            return False
        beta = (b3 - b) / (c - c3)
        if k < RAMP_ROUNDS - 1:
            # v = foot + beta u: the foot's own direction becomes the u-axis
            beta = min(max(beta, -MOST_FOOT_TURN), MOST_FOOT_TURN)
            length = np.sqrt(1.0 + beta * beta)
            vx, vy = (vx - beta * vy) / length, (vy + beta * vx) / length
    h = a2 + c2 * top - a - c * foot
    if h < SMALLEST_STEP_M or is_rougher(noise3, noise):
        return False
    write_step(out, (vx, vy, foot, top), (a, b, c, noise, n_floor), (a2, c2, noise2, n_top))
    at_ends = np.sqrt(END_VARIANCE * (noise**2 / n_floor + noise3**2 / n_ramp)) / (c - c3)
    out[STEP_HEIGHT], out[STEP_N_FACE] = h, n_ramp
    out[STEP_SIGMA_V] = np.sqrt(at_ends**2 + STRAIGHT_KERB_M**2)
    out[STEP_SIGMA_U] = at_ends / (2.0 * UNIFORM_SIGMA * half_u)
    out[STEP_SIGMA_H] = 2.0 * np.sqrt(noise**2 / n_floor + noise2**2 / n_top)
    return True
