"""The step at one place in numbers: floor, top and face fitted in turn, and what speaks for a kerb or a wall."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.boundaries.profiles import beside_cell, bin_sums_across, fit_side, step_in

# The foot of a kerb (or of a wall) in the points about one place: floor, step, top and face

#: Turns that are tried about the first direction, from coarse to fine. [rad]
KERB_TURNS = (
    np.deg2rad(np.array([0.0])),
    np.deg2rad(np.array([-24.0, -12.0, 12.0, 24.0])),
    np.deg2rad(np.array([-6.0, 6.0])),
    np.deg2rad(np.array([-3.0, 3.0])),
    np.deg2rad(np.array([-1.5, 1.5])),
)
#: Half of a cell's diagonal and 5 cm: a line farther than this from its middle is another cell's. [m]
KERB_REACH_V = 0.40
#: Three more unknowns explain so many noise variances by chance once in 10 000 places (chi-squared).
CLEAR_STEP = 21.0
#: How far an upright kerb's face leans back per metre of height, and how sure that is (DIN 483: 1:10 to 1:5;
#: flat kerbs lean by 1).
LEAN, LEAN_SIGMA = 0.15, 0.25


@njit(cache=True, nogil=True)
def best_step(
    work: FloatArray, n: int, frame: tuple[float, float], scale: float, sums: FloatArray, out: FloatArray
) -> bool:
    """Turn the v-axis until the profile steps up most clearly; False when the step is not near the place.

    out: v-axis, clearness, v, heights below and above, noise.
    """
    step, half_u = 0.02 * scale, 0.5 * scale
    half = int(KERB_REACH_V / step) + 1
    out[0], out[1] = frame
    out[2] = 0.0
    for stage in range(len(KERB_TURNS)):
        x0, y0 = out[0], out[1]
        for turn in KERB_TURNS[stage]:
            x, y = x0 * np.cos(turn) - y0 * np.sin(turn), x0 * np.sin(turn) + y0 * np.cos(turn)
            bin_sums_across(work, n, x, y, half_u, step, sums)
            found = step_in(sums, step, half, 2 if stage == 0 else 1)
            if found[0] > out[2]:
                out[0], out[1], out[2], out[3], out[4], out[5], out[6] = x, y, *found
        if out[2] < (0.5 * CLEAR_STEP if stage == 0 else CLEAR_STEP):
            return False
        if stage > 0 and beside_cell(out[0], out[1], out[3]):
            return False
    return True


@njit(cache=True, nogil=True)
def fit_face(
    work: FloatArray,
    n: int,
    frame: tuple[float, float],
    about: FloatArray,
    band: tuple[float, float],
    reach: FloatArray,
) -> tuple[float, float, float, float, float]:
    """Fit v = a + b u - lean (height - middle of the band) to the points of a face.

    about: floor's a, b, c, and the face's v. band: heights over the floor. reach: how far before and behind
    the face, and along it.

    Returns
    -------
    a, b, lean
        The face; `lean` is how far it leans back per metre of height.
    spread
        Robust rms distance of the points from it along v. [m]
    count
        Of points.
    """
    vx, vy = frame
    middle = 0.5 * (band[0] + band[1])
    a, b, lean, spread = about[3], 0.0, LEAN, 1.0
    count = 0.0
    for turn in range(4):
        s = np.zeros(10)
        count = 0.0
        for i in range(n):
            x, y = work[i, 0], work[i, 1]
            v, u = x * vx + y * vy, x * vy - y * vx
            if v < about[3] - reach[1] or v > about[3] + reach[0] or abs(u) > reach[2]:
                continue
            r = work[i, 2] - about[0] - about[1] * u - about[2] * v
            if r < band[0] or r > band[1]:
                continue
            h = r - middle
            off = v - a - b * u + lean * h
            w = 1.0 if turn == 0 else max(1.0 - (off / (4.0 * spread)) ** 2, 0.0) ** 2
            count += 1.0
            s[0] += w
            s[1] += w * u
            s[2] += w * h
            s[3] += w * v
            s[4] += w * u * u
            s[5] += w * u * h
            s[6] += w * h * h
            s[7] += w * u * v
            s[8] += w * h * v
            s[9] += w * v * v
        if s[0] < 2.0:
            return 0.0, 0.0, LEAN, 0.0, 0.0
        m = s[0]
        mu, mh, mv = s[1] / m, s[2] / m, s[3] / m
        # The lean is held to that of an upright kerb, the direction to what the step said (2 degrees)
        hold = max(spread, 0.005) ** 2 if turn > 0 else 4e-4
        uu = s[4] - m * mu * mu + hold / 0.035**2
        hh = s[6] - m * mh * mh + hold / LEAN_SIGMA**2
        uh = s[5] - m * mu * mh
        uv = s[7] - m * mu * mv
        hv = s[8] - m * mh * mv - LEAN * hold / LEAN_SIGMA**2
        det = uu * hh - uh * uh
        b, slope = (uv * hh - hv * uh) / det, (hv * uu - uv * uh) / det
        lean = min(max(-slope, 0.0), 1.0)
        a = mv - b * mu + lean * mh
        left = 0.0
        weights = 0.0
        for i in range(n):
            x, y = work[i, 0], work[i, 1]
            v, u = x * vx + y * vy, x * vy - y * vx
            if v < about[3] - reach[1] or v > about[3] + reach[0] or abs(u) > reach[2]:
                continue
            r = work[i, 2] - about[0] - about[1] * u - about[2] * v
            if r < band[0] or r > band[1]:
                continue
            off = v - a - b * u + lean * (r - middle)
            w = 1.0 if turn == 0 else max(1.0 - (off / (4.0 * spread)) ** 2, 0.0) ** 2
            left += w * off * off
            weights += w
        spread = max(np.sqrt(left / max(weights - 2.0, 1.0)), 2e-3)
    return a, b, lean, spread, count


#: Columns of a step, as `measure_step` writes them.
VX, VY, FOOT, TOP, STEP_HEIGHT, FLOOR_A, FLOOR_B, FLOOR_C = 0, 1, 2, 3, 4, 5, 6, 7
TOP_A, TOP_C, NOISE, NOISE_TOP, N_FLOOR, N_TOP, N_FACE, STEP_SIGMA_V, STEP_SIGMA_U, SIGMA_H = (
    8,
    9,
    10,
    11,
    12,
    13,
    14,
    15,
    16,
    17,
)
STEP_COLUMNS = 18
#: What floor and top keep clear of foot and top edge, half of a usual scan spot; and before these are known. [m]
CLEAR_M, FIRST_CLEAR_M = 0.02, 0.05
#: Kerb stones are set this straight. [m]
STRAIGHT_KERB_M = 0.001
#: Places, over 16 cm, at which floor and top may change over where no face is seen.
N_CHANGE = 32


@njit(cache=True, nogil=True)
def measure_step(work: FloatArray, n: int, first: FloatArray, scale: float, out: FloatArray) -> bool:
    """Measure the step that runs through the place along u; False where floor or top are missing.

    first: what `best_step` found. out: see the columns' names.
    """
    vx, vy = first[0], first[1]
    a, a2, noise, noise2 = first[4], first[5], first[6], first[6]
    foot = top = 0.0
    about, reach = np.zeros(4), np.zeros(3)
    clear = FIRST_CLEAR_M * scale
    for _ in range(3):
        low = (foot + clear, foot + 0.60 * scale, 0.5 * scale)
        high = (top - clear - 0.30 * scale, top - clear, 0.5 * scale)
        a, b, c, noise, n_floor = fit_side(work, n, (vx, vy), low, (a, noise + 0.01), (0.04, 0.04))
        a2, _, c2, noise2, n_top = fit_side(work, n, (vx, vy), high, (a2, noise2 + 0.01), (0.10, 0.02))
        if n_floor < 5 or n_top < 4:
            return False
        h = a2 + c2 * top - a - c * foot
        if h < 0.005:
            return False
        # The face: clearly above the floor and clearly below the top
        band = (max(2.5 * noise, 0.15 * h), h - max(2.5 * noise2, 0.15 * h))
        middle = 0.5 * (foot + top)
        n_face, spread = 0.0, 0.0
        if band[1] - band[0] > 0.1 * h:
            about[0], about[1], about[2], about[3] = a, b, c, middle
            reach[0], reach[1], reach[2] = 0.05 + 0.5 * h, 0.05 + h, 0.5 * scale
            at, beta, lean, spread, n_face = fit_face(work, n, (vx, vy), about, band, reach)
        if n_face >= 4:
            half = 0.5 * (band[0] + band[1])
            foot, top = at + lean * half, at - lean * (h - half)
            size = np.sqrt(1.0 + beta * beta)
            # v = at + beta u: the face's own direction becomes the u-axis
            vx, vy = (vx - beta * vy) / size, (vy + beta * vx) / size
            clear = CLEAR_M
            foot, top = foot / size, top / size
            beta_sigma = max(spread, 0.003) / np.sqrt(n_face) / (0.29 * scale)
            lean_sigma = 1.0 / np.sqrt(
                1.0 / LEAN_SIGMA**2 + n_face * (0.29 * (band[1] - band[0])) ** 2 / spread**2
            )
            sigma_v = np.sqrt(2.0 * spread**2 / n_face + (lean_sigma * half) ** 2 + STRAIGHT_KERB_M**2)
        else:
            # No face: where the points change over from the floor to the top, to their spacing
            at, spacing = _change_over(work, n, (vx, vy), (a, b, c), (a2, c2), middle, scale)
            foot, top = at + 0.5 * LEAN * h, at - 0.5 * LEAN * h
            blur = spacing * (1.0 + 4.0 * (noise**2 + noise2**2) / h**2)
            sigma_v = np.sqrt(blur**2 + (0.5 * h * LEAN_SIGMA) ** 2)
            beta_sigma = max(blur / (0.29 * scale), 0.02)
        _write(out, (vx, vy, foot, top), (a, b, c, noise, n_floor), (a2, c2, noise2, n_top))
        out[STEP_HEIGHT], out[N_FACE], out[STEP_SIGMA_V], out[STEP_SIGMA_U] = h, n_face, sigma_v, beta_sigma
        out[SIGMA_H] = 2.0 * np.sqrt(noise**2 / n_floor + noise2**2 / n_top)
    return True


@njit(cache=True, nogil=True)
def _change_over(
    work: FloatArray,
    n: int,
    frame: tuple[float, float],
    floor: tuple[float, float, float],
    top: tuple[float, float],
    about: float,
    scale: float,
) -> tuple[float, float]:
    """Return the v that best parts points of the floor from points of the top, and how dense they are there.

    frame: v-axis. floor: a, b, c. top: a, c. about: where it is looked for.
    """
    vx, vy = frame
    half = 0.08 * scale
    cost = np.zeros(N_CHANGE + 1)
    count = 0.0
    for i in range(n):
        x, y = work[i, 0], work[i, 1]
        v, u = x * vx + y * vy, x * vy - y * vx
        k = int(np.floor((v - about + half) / (2.0 * half) * N_CHANGE))
        if k < 0 or k >= N_CHANGE or abs(u) > 0.5 * scale:
            continue
        r = work[i, 2] - floor[1] * u
        low, high = r - floor[0] - floor[2] * v, r - top[0] - top[1] * v
        rise = low - high
        # Of a point beyond both it is only known on which side it is
        low, high = min(max(low, -rise), 2.0 * rise), min(max(high, -2.0 * rise), rise)
        cost[k + 1] += high * high - low * low
        count += 1.0
    # Below the change v belongs to the top: running cost of that; the middle of all best places
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
def _write(
    out: FloatArray,
    edges: tuple[float, float, float, float],
    floor: tuple[float, float, float, float, float],
    top: tuple[float, float, float, float],
) -> None:
    out[VX], out[VY], out[FOOT], out[TOP] = edges
    out[FLOOR_A], out[FLOOR_B], out[FLOOR_C], out[NOISE], out[N_FLOOR] = floor
    out[TOP_A], out[TOP_C], out[NOISE_TOP], out[N_TOP] = top


@njit(cache=True, nogil=True)
def filled_shares(work: FloatArray, n: int, step: FloatArray, scale: float, share: FloatArray) -> None:
    """Write how far floor, top and ends of the evidence reach.

    share: shares of tenths of the floor's 0.5 m and of the top's 0.2 m that hold points, lowest and highest u
    that both floor and top have points up to, and the share of quarters along u that hold points of both.
    """
    floor_bins, top_bins = np.zeros(5), np.zeros(4)
    along_floor, along_top = np.zeros(4), np.zeros(4)
    u_low, u_high = np.array([1e9, 1e9]), np.array([-1e9, -1e9])
    for i in range(n):
        x, y = work[i, 0], work[i, 1]
        v, u = x * step[VX] + y * step[VY], x * step[VY] - y * step[VX]
        if abs(u) > 0.5 * scale:
            continue
        r = work[i, 2] - step[FLOOR_A] - step[FLOOR_B] * u - step[FLOOR_C] * v
        quarter = min(int((u / scale + 0.5) * 4.0), 3)
        if v > step[FOOT] - 0.01:
            if abs(r) <= 3.0 * step[NOISE] and v - step[FOOT] < 0.5 * scale:
                floor_bins[min(max(int((v - step[FOOT]) / (0.1 * scale)), 0), 4)] = 1.0
                if v - step[FOOT] < 0.3 * scale:
                    along_floor[quarter] = 1.0
                    u_low[0], u_high[0] = min(u_low[0], u), max(u_high[0], u)
        elif step[TOP] - v < 0.2 * scale and r > 0.5 * step[STEP_HEIGHT]:
            top_bins[min(max(int((step[TOP] - v) / (0.05 * scale)), 0), 3)] = 1.0
            along_top[quarter] = 1.0
            u_low[1], u_high[1] = min(u_low[1], u), max(u_high[1], u)
    share[0], share[1] = np.mean(floor_bins), np.mean(top_bins)
    share[2], share[3] = np.max(u_low), np.min(u_high)
    share[4] = np.mean(along_floor * along_top)
