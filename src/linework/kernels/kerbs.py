"""The foot of a kerb (or of a wall) in the points about one place: floor, step, top and face.

Positions are local [m]; v points to the lower, carriageway side; heights r are over the place's plane.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray
from linework.kernels.profiles import beside_cell, profile_across, step_in

#: Turns that are tried about the first direction, from coarse to fine. [rad]
TURNS = (
    np.deg2rad(np.array([0.0])),
    np.deg2rad(np.array([-24.0, -12.0, 12.0, 24.0])),
    np.deg2rad(np.array([-6.0, 6.0])),
    np.deg2rad(np.array([-3.0, 3.0])),
    np.deg2rad(np.array([-1.5, 1.5])),
)
#: Half of a cell's diagonal and 5 cm: a line farther than this from its middle is another cell's. [m]
REACH_V = 0.40
#: Three more unknowns explain so many noise variances by chance once in 10 000 places (chi-squared).
CLEAR = 21.0
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
    half = int(REACH_V / step) + 1
    out[0], out[1] = frame
    out[2] = 0.0
    for stage in range(len(TURNS)):
        x0, y0 = out[0], out[1]
        for turn in TURNS[stage]:
            x, y = x0 * np.cos(turn) - y0 * np.sin(turn), x0 * np.sin(turn) + y0 * np.cos(turn)
            profile_across(work, n, x, y, half_u, step, sums)
            found = step_in(sums, step, half, 2 if stage == 0 else 1)
            if found[0] > out[2]:
                out[0], out[1], out[2], out[3], out[4], out[5], out[6] = x, y, *found
        if out[2] < (0.5 * CLEAR if stage == 0 else CLEAR):
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
