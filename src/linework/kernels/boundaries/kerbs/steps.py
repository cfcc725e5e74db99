"""Measurement of the step at one place: floor, face and top fitted in turn.

Frame and points as in `linework.kernels.boundaries.profiles`; the carriageway is at positive v.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.boundaries.profiles import (
    CLEAR_M,
    FLOOR_SOFT,
    FLOOR_WIDTH_M,
    HALF_LENGTH_M,
    PLACE_R,
    PLACE_X,
    PLACE_Y,
    PROFILE_BIN_M,
    TUKEY_SPREADS,
    UNIFORM_SIGMA,
    beside_cell,
    bin_sums_across,
    fit_side,
    step_in,
)
from linework.kernels.tracking.small_systems import solve_two

#: Columns of the clearest step of a profile: unit vector v, clearness, v of the step [m], heights below and above it
#: [m], noise [m].
(
    CLEAREST_VX, CLEAREST_VY, CLEAREST_CLEAR, CLEAREST_V, CLEAREST_BELOW, CLEAREST_ABOVE, CLEAREST_NOISE,
) = range(7)  # fmt: skip
CLEAREST_COLUMNS = 7

#: Rotations of the profile tried about its first direction, from coarse to fine. [rad]
KERB_TURNS = (
    np.deg2rad(np.array([0.0])),
    np.deg2rad(np.array([-24.0, -12.0, 12.0, 24.0])),
    np.deg2rad(np.array([-6.0, 6.0])),
    np.deg2rad(np.array([-3.0, 3.0])),
    np.deg2rad(np.array([-1.5, 1.5])),
)
#: The same for long windows, across which a direction that is off smears the step: the finer, the longer. As many as of
#: the usual, so that both are of one type. [rad]
LONG_TURNS = (
    np.deg2rad(np.arange(-36.0, 37.0, 6.0)),
    np.deg2rad(np.array([-3.0, 3.0])),
    np.deg2rad(np.array([-1.5, 1.5])),
    np.deg2rad(np.array([-0.75, 0.75])),
    np.deg2rad(np.array([-0.4, 0.4])),
)
#: Cosine of the largest angle between two directions of a long window that show the same: half of its coarse turns. And
#: of two of the usual window, as each is turned about: only the same direction.
SAME_TURN, SAME_FRAME = np.cos(np.deg2rad(3.0)), 1.0 - 1e-12
#: Most directions that are tried before their turns, in a window of any length.
MOST_TRIED = 2 * len(LONG_TURNS[0])
#: Half of a cell's diagonal plus 5 cm: a line farther than this from the cell's middle belongs to another cell. [m]
KERB_REACH_V = 0.40
#: Smallest clearness of a step: three more unknowns explain this many noise variances by chance once in 10 000
#: places (chi-squared).
CLEAR_STEP = 21.0
#: The same in longer windows. On noise alone (120 points a square metre) each of the two exceeds a clearness at twice as
#: many places as the usual window does, as more of their directions differ: five tries share the one place in 10 000.
CLEAR_LONG_STEP = 24.5
#: How far an upright kerb's face leans back per metre of height, and its standard deviation (DIN 483: 1:10 to 1:5;
#: flat kerbs lean by 1).
LEAN, LEAN_SIGMA = 0.15, 0.25
#: Standard deviation of the face's direction relative to that of the step (2 degrees). [rad]
BETA_SIGMA = 0.035
#: Variance assumed for points of the face in the first round, and smallest spread assumed in later ones. [m^2, m]
FIRST_HOLD, LEAST_HOLD_M = 4e-4, 0.005
#: Rounds of reweighting a face, and its smallest spread: no scanner measures better. [m]
FACE_ROUNDS, LEAST_SPREAD_M = 4, 2e-3
#: Fewest points of a floor, of a top and of a face, and the smallest step that is measured [m].
FLOOR_POINTS, TOP_POINTS, FACE_POINTS_LEAST, SMALLEST_STEP_M = 5, 4, 4, 0.005
#: Points of the face are above the floor and below the top by at least this many sigmas of their noise, and by at
#: least this share of the step.
FACE_NOISES, FACE_SHARE = 2.5, 0.15
#: Extent of the top across, from its edge [m]; weights that hold its slopes along u and v to 0 [m^2].
KERB_TOP_WIDTH_M, TOP_SOFT = 0.30, (0.10, 0.02)


@njit(cache=True, nogil=True)
def best_step(
    work: FloatArray,
    n: int,
    frame: tuple[float, float],
    scale: float,
    half_u: float,
    sums: FloatArray,
    tried: FloatArray,
    out: FloatArray,
) -> bool:
    """Turn the v-axis until the profile steps up most clearly; return False if no step passes through the cell.

    Parameters
    ----------
    work
        (n or more, 4): points, see `linework.kernels.boundaries.profiles.gather_at`.
    frame
        Unit vector v to begin with.
    scale, half_u
        Radius of the search area divided by the usual radius; half of the length along u that is used [m].
    sums
        (73, 9) scratch, see `linework.kernels.boundaries.profiles.bin_sums_across`.
    tried
        (`MOST_TRIED`, 2) input and output: unit vectors that were begun with at this place, then 0; none is tried again.
    out
        (7,) output, columns `CLEAREST_VX` to `CLEAREST_NOISE`.
    """
    step = PROFILE_BIN_M * scale
    is_long = half_u > HALF_LENGTH_M * scale
    turns, same = (LONG_TURNS, SAME_TURN) if is_long else (KERB_TURNS, SAME_FRAME)
    least = CLEAR_LONG_STEP if is_long else CLEAR_STEP
    half = int(KERB_REACH_V / step) + 1
    out[CLEAREST_VX], out[CLEAREST_VY] = frame
    out[CLEAREST_CLEAR] = 0.0
    for stage in range(len(turns)):
        x0, y0 = out[CLEAREST_VX], out[CLEAREST_VY]
        for turn in turns[stage]:
            x, y = x0 * np.cos(turn) - y0 * np.sin(turn), x0 * np.sin(turn) + y0 * np.cos(turn)
            if stage == 0 and _is_tried(tried, x, y, same):
                continue
            bin_sums_across(work, n, x, y, half_u, step, sums, False)
            clear, v, below, above, noise = step_in(sums, step, half, 2 if stage == 0 else 1)
            if clear > out[CLEAREST_CLEAR]:
                out[CLEAREST_VX], out[CLEAREST_VY], out[CLEAREST_CLEAR], out[CLEAREST_V] = x, y, clear, v
                out[CLEAREST_BELOW], out[CLEAREST_ABOVE], out[CLEAREST_NOISE] = below, above, noise
        if out[CLEAREST_CLEAR] < (0.5 * least if stage == 0 else least):
            return False
        if stage > 0 and beside_cell(out[CLEAREST_VX], out[CLEAREST_VY], out[CLEAREST_V]):
            return False
    return True


@njit(cache=True, nogil=True)
def _is_tried(tried: FloatArray, x: float, y: float, same: float) -> bool:
    """Return whether a direction was tried, `same` being the cosine of the angle allowed; note it in (n, 2) if not."""
    for k in range(len(tried)):
        if tried[k, 0] == 0.0 and tried[k, 1] == 0.0:
            tried[k, 0], tried[k, 1] = x, y
            return False
        if tried[k, 0] * x + tried[k, 1] * y >= same:
            return True
    return False


@njit(cache=True, nogil=True)
def fit_face(
    work: FloatArray,
    n: int,
    frame: tuple[float, float],
    floor: tuple[float, float, float],
    about: float,
    band: tuple[float, float],
    reach: tuple[float, float, float],
) -> tuple[float, float, float, float, float]:
    """Fit v = a + b u - lean (height - middle of the band) to the points of a face, by reweighted least squares.

    Parameters
    ----------
    work
        (n or more, 4): points, see `linework.kernels.boundaries.profiles.gather_at`.
    frame
        Unit vector v.
    floor
        Plane of the floor: height, slopes along u and v.
    about
        v of the face to begin with. [m]
    band
        Lowest and highest height over the floor. [m]
    reach
        Distances before and behind `about`, and along u. [m]

    Returns
    -------
    a, b, lean
        The face; `lean` is how far it leans back per metre of height.
    spread
        Robust rms distance of the points from it along v. [m]
    count
        Number of points.
    """
    vx, vy = frame
    floor_a, floor_b, floor_c = floor
    low, high = band
    before, behind, along = reach
    middle = 0.5 * (low + high)
    a, b, lean, spread = about, 0.0, LEAN, 1.0
    count = 0.0
    for turn in range(FACE_ROUNDS):
        # Weighted sums
        m = su = sh = sv = suu = suh = shh = suv = shv = 0.0
        count = 0.0
        for i in range(n):
            x, y = work[i, PLACE_X], work[i, PLACE_Y]
            v, u = x * vx + y * vy, x * vy - y * vx
            if v < about - behind or v > about + before or abs(u) > along:
                continue
            r = work[i, PLACE_R] - floor_a - floor_b * u - floor_c * v
            if r < low or r > high:
                continue
            h = r - middle
            off = v - a - b * u + lean * h
            w = 1.0 if turn == 0 else max(1.0 - (off / (TUKEY_SPREADS * spread)) ** 2, 0.0) ** 2
            count += 1.0
            m += w
            su += w * u
            sh += w * h
            sv += w * v
            suu += w * u * u
            suh += w * u * h
            shh += w * h * h
            suv += w * u * v
            shv += w * h * v
        if m < 2.0:
            return 0.0, 0.0, LEAN, 0.0, 0.0
        mu, mh, mv = su / m, sh / m, sv / m
        # The lean is constrained to that of an upright kerb, the direction to that of the step
        hold = max(spread, LEAST_HOLD_M) ** 2 if turn > 0 else FIRST_HOLD
        uu = suu - m * mu * mu + hold / BETA_SIGMA**2
        hh = shh - m * mh * mh + hold / LEAN_SIGMA**2
        uh = suh - m * mu * mh
        uv = suv - m * mu * mv
        hv = shv - m * mh * mv - LEAN * hold / LEAN_SIGMA**2
        b, slope = solve_two(uu, uh, hh, uv, hv)
        lean = min(max(-slope, 0.0), 1.0)
        a = mv - b * mu + lean * mh
        left = 0.0
        weights = 0.0
        for i in range(n):
            x, y = work[i, PLACE_X], work[i, PLACE_Y]
            v, u = x * vx + y * vy, x * vy - y * vx
            if v < about - behind or v > about + before or abs(u) > along:
                continue
            r = work[i, PLACE_R] - floor_a - floor_b * u - floor_c * v
            if r < low or r > high:
                continue
            off = v - a - b * u + lean * (r - middle)
            w = 1.0 if turn == 0 else max(1.0 - (off / (TUKEY_SPREADS * spread)) ** 2, 0.0) ** 2
            left += w * off * off
            weights += w
        spread = max(np.sqrt(left / max(weights - 2.0, 1.0)), LEAST_SPREAD_M)
    return a, b, lean, spread, count


#: Columns of a measured step: unit vector v; v of foot and top edge; height [m]; plane of the floor: height, slopes
#: along u and v; height and slope along v of the top; noise of floor and top [m]; points of floor, top and face;
#: standard deviations of the foot [m], of the direction [rad] and of the height [m]; length of floor in the step's shadow [m].
(
    STEP_VX, STEP_VY, STEP_FOOT, STEP_TOP, STEP_HEIGHT, STEP_FLOOR_A, STEP_FLOOR_B, STEP_FLOOR_C, STEP_TOP_A,
    STEP_TOP_C, STEP_NOISE, STEP_NOISE_TOP, STEP_N_FLOOR, STEP_N_TOP, STEP_N_FACE, STEP_SIGMA_V, STEP_SIGMA_U,
    STEP_SIGMA_H, STEP_SHADOW,
) = range(19)  # fmt: skip
STEP_COLUMNS = 19
#: Distance that floor and top keep from foot and top edge before these are known. [m]
FIRST_CLEAR_M = 0.05
#: Standard deviation of a kerb stone from a straight line. [m]
STRAIGHT_KERB_M = 0.001
#: Where no face is visible, the change from floor to top is sought this far to either side [m], at this many places.
CHANGE_REACH_M, N_CHANGE = 0.08, 32


@njit(cache=True, nogil=True)
def measure_step(
    work: FloatArray,
    n: int,
    first: FloatArray,
    hidden: tuple[float, float],
    scale: float,
    half_u: float,
    out: FloatArray,
) -> bool:
    """Measure the step that runs through the place along u; return False where floor or top is missing.

    Parameters
    ----------
    work
        (n or more, 4): points, see `linework.kernels.boundaries.profiles.gather_at`.
    first
        (7,): see `best_step`.
    hidden
        v of the upper edge, and length of the floor that the step hides from the scanner [m]; length 0: none.
    scale, half_u
        As for `best_step`.
    out
        (19,) output, columns `STEP_VX` to `STEP_SHADOW`; no shadow where False is returned.
    """
    out[STEP_SHADOW] = 0.0
    vx, vy = first[CLEAREST_VX], first[CLEAREST_VY]
    a, a2 = first[CLEAREST_BELOW], first[CLEAREST_ABOVE]
    noise = noise2 = first[CLEAREST_NOISE]
    spread_u = 2.0 * UNIFORM_SIGMA * half_u
    clear = FIRST_CLEAR_M * scale
    edge, shadow = hidden
    foot = top = edge
    for _ in range(3):
        low = (foot + clear, foot + shadow + FLOOR_WIDTH_M * scale, half_u)
        high = (top - clear - KERB_TOP_WIDTH_M * scale, top - clear, half_u)
        a, b, c, noise, n_floor = fit_side(work, n, (vx, vy), low, (a, noise + 0.01), FLOOR_SOFT)
        a2, _, c2, noise2, n_top = fit_side(work, n, (vx, vy), high, (a2, noise2 + 0.01), TOP_SOFT)
        if n_floor < FLOOR_POINTS or n_top < TOP_POINTS:
            return False
        h = a2 + c2 * top - a - c * foot
        if h < SMALLEST_STEP_M:
            return False
        # The face: clearly above the floor and clearly below the top
        lowest = max(FACE_NOISES * noise, FACE_SHARE * h)
        highest = h - max(FACE_NOISES * noise2, FACE_SHARE * h)
        middle = 0.5 * (foot + top)
        n_face, spread = 0.0, 0.0
        if shadow == 0.0 and highest - lowest > 0.1 * h:
            reach = (0.05 + 0.5 * h, 0.05 + h, half_u)
            at, beta, lean, spread, n_face = fit_face(
                work, n, (vx, vy), (a, b, c), middle, (lowest, highest), reach
            )
        if n_face >= FACE_POINTS_LEAST:
            half = 0.5 * (lowest + highest)
            foot, top = at + lean * half, at - lean * (h - half)
            size = np.sqrt(1.0 + beta * beta)
            # v = at + beta u: the face's own direction becomes the u-axis
            vx, vy = (vx - beta * vy) / size, (vy + beta * vx) / size
            clear = CLEAR_M
            foot, top = foot / size, top / size
            beta_sigma = max(spread, 0.003) / np.sqrt(n_face) / spread_u
            lean_sigma = 1.0 / np.sqrt(
                1.0 / LEAN_SIGMA**2 + n_face * (UNIFORM_SIGMA * (highest - lowest)) ** 2 / spread**2
            )
            sigma_v = np.sqrt(2.0 * spread**2 / n_face + (lean_sigma * half) ** 2 + STRAIGHT_KERB_M**2)
        else:
            # No face visible: the place where the points change from floor to top, known to within their spacing
            if shadow > 0.0:
                at, spacing = edge + 0.5 * LEAN * h, UNIFORM_SIGMA * PROFILE_BIN_M * scale
            else:
                at, spacing = _change_over(work, n, (vx, vy), (a, b, c), (a2, c2), middle, (scale, half_u))
            foot, top = at + 0.5 * LEAN * h, at - 0.5 * LEAN * h
            blur = spacing * (1.0 + 4.0 * (noise**2 + noise2**2) / h**2)
            sigma_v = np.sqrt(blur**2 + (0.5 * h * LEAN_SIGMA) ** 2)
            beta_sigma = max(blur / spread_u, 0.02)
        write_step(out, (vx, vy, foot, top), (a, b, c, noise, n_floor), (a2, c2, noise2, n_top))
        out[STEP_HEIGHT], out[STEP_N_FACE] = h, n_face
        out[STEP_SIGMA_V], out[STEP_SIGMA_U] = sigma_v, beta_sigma
        far = floor_at_foot(shadow, scale)
        out[STEP_SIGMA_H] = np.sqrt((far * noise) ** 2 / n_floor + (2.0 * noise2) ** 2 / n_top)
    out[STEP_SHADOW] = shadow
    return True


@njit(cache=True, nogil=True)
def floor_at_foot(shadow: float, scale: float) -> float:
    """Return the standard deviation of a floor at its foot over that of its mean height: 2, and more behind a shadow [m].

    A line through points that are spread evenly over a width w has 1 + 12 (d / w)^2 times the variance of their mean at a
    distance d from their middle.
    """
    return float(np.sqrt(1.0 + 12.0 * (0.5 + shadow / (FLOOR_WIDTH_M * scale)) ** 2))


@njit(cache=True, nogil=True)
def _change_over(
    work: FloatArray,
    n: int,
    frame: tuple[float, float],
    floor: tuple[float, float, float],
    top: tuple[float, float],
    about: float,
    reach: tuple[float, float],
) -> tuple[float, float]:
    """Return the v that best separates points of the floor from points of the top, and their spacing there [m].

    frame: unit vector v. floor: height, slopes along u and v. top: height, slope along v. about: v to begin with.
    reach: `scale` and `half_u` of `best_step`.
    """
    scale, half_u = reach
    vx, vy = frame
    floor_a, floor_b, floor_c = floor
    top_a, top_c = top
    half = CHANGE_REACH_M * scale
    cost = np.zeros(N_CHANGE + 1)
    count = 0.0
    for i in range(n):
        x, y = work[i, PLACE_X], work[i, PLACE_Y]
        v, u = x * vx + y * vy, x * vy - y * vx
        k = int(np.floor((v - about + half) / (2.0 * half) * N_CHANGE))
        if k < 0 or k >= N_CHANGE or abs(u) > half_u:
            continue
        r = work[i, PLACE_R] - floor_b * u
        low, high = r - floor_a - floor_c * v, r - top_a - top_c * v
        rise = low - high
        # A point below the floor or above the top shows only which side it is on
        low, high = min(max(low, -rise), 2.0 * rise), min(max(high, -2.0 * rise), rise)
        cost[k + 1] += high * high - low * low
        count += 1.0
    # Points with v below the change belong to the top: running cost of that, and the middle of all places of least cost
    best, first, last = 0.0, 0, 0
    for k in range(1, N_CHANGE + 1):
        cost[k] += cost[k - 1]
        if cost[k] < best:
            best, first, last = cost[k], k, k
        elif cost[k] == best and k == last + 1:
            last = k
    at = about - half + half * (first + last) / N_CHANGE
    return at, 2.0 * half / max(count, 2.0)


@njit(cache=True, nogil=True)
def write_step(
    out: FloatArray,
    edges: tuple[float, float, float, float],
    floor: tuple[float, float, float, float, float],
    top: tuple[float, float, float, float],
) -> None:
    """Write the columns of a step (19,) that its three parts give: edges, floor and top."""
    out[STEP_VX], out[STEP_VY], out[STEP_FOOT], out[STEP_TOP] = edges
    out[STEP_FLOOR_A], out[STEP_FLOOR_B], out[STEP_FLOOR_C], out[STEP_NOISE], out[STEP_N_FLOOR] = floor
    out[STEP_TOP_A], out[STEP_TOP_C], out[STEP_NOISE_TOP], out[STEP_N_TOP] = top
    out[STEP_SHADOW] = 0.0
