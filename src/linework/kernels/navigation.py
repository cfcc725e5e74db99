"""Positions from GNSS and dead reckoning: extended Kalman filter forward, Rauch-Tung-Striebel smoother backward.

State (what the filter estimates at a node, one of its columns each):

====== ==================================================================================================
0-2    position of the vehicle's origin: east, north, up [m]
3      heading, clockwise from north, without jumps [rad]
4, 5   gyro: bias [rad/s], scale (turn = (1 + scale) reading - bias dt)
6, 7   left and right wheel: scale (distance = (1 + scale) counts)
8, 9   speed [m/s] and turn rate [rad/s] beside what wheels and gyro say; 0 while these are to be trusted
10, 11 pitch and roll beside what the vertical gyro says [rad]
12     GNSS stamps: later than true by this [s]
13-15  slow error of the GNSS, east, north, up, in its own sigmas
====== ==================================================================================================
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray

N_STATES = 16
E, N, U, NAV_HEADING, BIAS, GYRO_SCALE, LEFT, RIGHT, SPEED, NAV_TURN, PITCH, ROLL, DELAY, WANDER = range(14)

# Columns of a step from one node to the next
(
    DT, TURN_READ, LEFT_M, RIGHT_M, ANTENNA_AHEAD, ASIDE, PITCH_READ, AT_REST, SPEED_FREE, TURN_FREE, WHEELS_TURN,
    WHEEL_TURN, WHEEL_TURN_VAR, SIDE_VAR, UP_VAR, BIAS_VAR,
) = range(16)  # fmt: skip
N_STEP = 16

# Columns of the noise model
(
    GYRO_VAR, BIAS_WALK, WHEEL_VAR, SCALE_WALK, TILT_VAR, PER_TILT_S, PER_TILT_M, GNSS_FACTOR, SHARE,
    PER_WANDER_S, TICK_VAR, TRACK_M, ACCEL_VAR, TURN_ACCEL_VAR, SPEED_VAR, PER_SPEED_S,
) = range(16)  # fmt: skip
N_NOISE = 16

#: 99.9 % of chi-squared with two and with one degree of freedom.
GATE_PLAN, GATE_UP = 13.8, 10.8


@njit(cache=True, nogil=True)
def predict(
    x: FloatArray, p: FloatArray, step: FloatArray, noise: FloatArray, F: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return state and covariance at the next node; `F` receives the derivative of the new state."""
    dt = step[DT]
    F[:] = np.eye(N_STATES)
    new = x.copy()
    q = np.zeros(N_STATES)
    far = 0.0
    if step[AT_REST] == 0.0:
        # Turn and distance of the step, and the direction of its chord
        turn = (1.0 + x[GYRO_SCALE]) * step[TURN_READ] + (x[NAV_TURN] - x[BIAS]) * dt
        w = step[WHEELS_TURN] / noise[TRACK_M]
        turn += w * (x[LEFT] * step[LEFT_M] - x[RIGHT] * step[RIGHT_M])
        far = 0.5 * ((1.0 + x[LEFT]) * step[LEFT_M] + (1.0 + x[RIGHT]) * step[RIGHT_M]) + x[SPEED] * dt
        h = x[NAV_HEADING] + 0.5 * (turn - step[TURN_READ])
        pitch = step[PITCH_READ] + x[PITCH]
        ahead_e = step[ANTENNA_AHEAD] * math.sin(h) + step[ASIDE] * math.cos(h)
        ahead_n = step[ANTENNA_AHEAD] * math.cos(h) - step[ASIDE] * math.sin(h)
        plan, rise = math.cos(pitch), math.sin(pitch)
        new[E] += far * plan * ahead_e
        new[N] += far * plan * ahead_n
        new[U] += far * rise
        new[NAV_HEADING] += turn
        # Derivatives of the turn, the distance, and the position through both
        turn_by = np.zeros(N_STATES)
        turn_by[GYRO_SCALE], turn_by[NAV_TURN], turn_by[BIAS] = step[TURN_READ], dt, -dt
        turn_by[LEFT], turn_by[RIGHT] = w * step[LEFT_M], -w * step[RIGHT_M]
        far_by = np.zeros(N_STATES)
        far_by[LEFT], far_by[RIGHT], far_by[SPEED] = 0.5 * step[LEFT_M], 0.5 * step[RIGHT_M], dt
        for i in range(N_STATES):
            by_h = 0.5 * turn_by[i] + (1.0 if i == NAV_HEADING else 0.0)
            by_p = 1.0 if i == PITCH else 0.0
            F[E, i] += far_by[i] * plan * ahead_e + far * (plan * ahead_n * by_h - rise * ahead_e * by_p)
            F[N, i] += far_by[i] * plan * ahead_n - far * (plan * ahead_e * by_h + rise * ahead_n * by_p)
            F[U, i] += far_by[i] * rise + far * plan * by_p
            F[NAV_HEADING, i] += turn_by[i]
        q[NAV_HEADING] = noise[GYRO_VAR] * dt
    way = abs(far)
    # What is free wanders, what is not is 0, or the slow error of a speed
    if step[SPEED_FREE] == 0.0 and noise[SPEED_VAR] > 0.0:
        _forget(SPEED, math.exp(-dt * noise[PER_SPEED_S]), noise[SPEED_VAR], new, F, q)
    else:
        _wander_freely(SPEED, step[SPEED_FREE], noise[ACCEL_VAR] * dt, 900.0, new, F, q)
    _wander_freely(NAV_TURN, step[TURN_FREE], noise[TURN_ACCEL_VAR] * dt, 0.25, new, F, q)
    _forget(PITCH, math.exp(-dt * noise[PER_TILT_S] - way * noise[PER_TILT_M]), noise[TILT_VAR], new, F, q)
    # Roll is that of the road where nothing measures it: it changes as the slope does
    _forget(ROLL, math.exp(-dt * noise[PER_TILT_S] - way * noise[PER_TILT_M]), noise[TILT_VAR], new, F, q)
    for i in range(WANDER, WANDER + 3):
        _forget(i, math.exp(-dt * noise[PER_WANDER_S]), 1.0, new, F, q)
    q[BIAS] = noise[BIAS_WALK] * dt + step[BIAS_VAR]
    q[LEFT] = q[RIGHT] = noise[SCALE_WALK] * way
    p = F @ p @ F.T
    for i in range(N_STATES):
        p[i, i] += q[i]
    sin_h, cos_h = math.sin(new[NAV_HEADING]), math.cos(new[NAV_HEADING])
    along, side = noise[WHEEL_VAR] * way, step[SIDE_VAR]
    p[E, E] += along * sin_h * sin_h + side * cos_h * cos_h + 1e-10 * dt
    p[N, N] += along * cos_h * cos_h + side * sin_h * sin_h + 1e-10 * dt
    p[E, N] += (along - side) * sin_h * cos_h
    p[N, E] = p[E, N]
    p[U, U] += step[UP_VAR] + 1e-10 * dt
    return new, p


@njit(cache=True, nogil=True)
def _wander_freely(
    i: int, free: float, q_step: float, q_begin: float, x: FloatArray, F: FloatArray, q: FloatArray
) -> None:
    """Set a state that is 0 while `free` is 0, begins unknown where it is 2, and walks where it is 1."""
    if free == 0.0:
        x[i], F[i, i], q[i] = 0.0, 0.0, 1e-14
    elif free == 2.0:
        x[i], F[i, i], q[i] = 0.0, 0.0, q_begin
    else:
        q[i] = q_step


@njit(cache=True, nogil=True)
def _forget(i: int, keep: float, var: float, x: FloatArray, F: FloatArray, q: FloatArray) -> None:
    """Gauss-Markov: a state of variance `var` that keeps the share `keep` of itself."""
    x[i] *= keep
    F[i, i] = keep
    q[i] = var * (1.0 - keep * keep)


@njit(cache=True, nogil=True)
def _update(x: FloatArray, p: FloatArray, H: FloatArray, innovation: float, variance: float) -> float:
    """Take in one scalar measurement; returns the variance of its innovation."""
    ph = p @ H
    s = H @ ph + variance
    gain = ph / s
    x += gain * innovation
    p -= np.outer(gain, ph)
    return float(s)


@njit(cache=True, nogil=True)
def antenna(
    x: FloatArray, read: FloatArray, lever: FloatArray, sigma: FloatArray, noise: FloatArray, H: FloatArray
) -> tuple[float, float, float]:
    """Return where a fix is expected; `H` (3, 16) receives its derivative.

    `read` is roll, pitch, and the speed over seconds: that of the last step would carry the step's own error
    into the delay.
    """
    roll, pitch = read[0] + x[ROLL], read[1] + x[PITCH]
    sin_r, cos_r, sin_p, cos_p = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    sin_h, cos_h = math.sin(x[NAV_HEADING]), math.cos(x[NAV_HEADING])
    left, up = lever[1] * cos_r - lever[2] * sin_r, lever[1] * sin_r + lever[2] * cos_r
    front, top = lever[0] * cos_p - up * sin_p, lever[0] * sin_p + up * cos_p
    east, north = front * sin_h - left * cos_h, front * cos_h + left * sin_h
    velocity = np.empty(3)
    speed = read[2] + x[SPEED]
    velocity[0], velocity[1], velocity[2] = speed * sin_h, speed * cos_h, speed * sin_p
    H[:] = 0.0
    slow = noise[GNSS_FACTOR] * math.sqrt(noise[SHARE])
    for i in range(3):
        H[i, i] = 1.0
        H[i, DELAY] = -velocity[i]
        H[i, WANDER + i] = slow * sigma[i]
    H[0, NAV_HEADING], H[1, NAV_HEADING] = north, -east
    H[0, PITCH], H[1, PITCH], H[2, PITCH] = -top * sin_h, -top * cos_h, front
    H[0, ROLL] = -left * sin_p * sin_h + up * cos_h
    H[1, ROLL] = -left * sin_p * cos_h - up * sin_h
    H[2, ROLL] = left * cos_p
    add = np.empty(3)
    add[0], add[1], add[2] = east, north, top
    for i in range(3):
        add[i] += x[i] - velocity[i] * x[DELAY] + H[i, WANDER + i] * x[WANDER + i]
    return add[0], add[1], add[2]


@njit(cache=True, nogil=True)
def filter_forward(
    x0: FloatArray,
    p0: FloatArray,
    steps: FloatArray,
    read: FloatArray,
    fix_of: IntArray,
    fixes: FloatArray,
    sigma: FloatArray,
    doubt: FloatArray,
    lever: FloatArray,
    noise: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, float]:
    """Filter all nodes.

    Parameters
    ----------
    x0, p0 : (16,), (16, 16) at the first node
    steps : (n - 1, 16)
    read : (n, 3) roll and pitch as read [rad], speed over seconds [m/s]
    fix_of : (n,) number of the fix at a node, -1: none
    fixes, sigma : (m, 3) [m]
    doubt : (m, 2) variance added to a fix in plan and height [m^2]; nan: decided by its innovation
    lever : (3,) of the antenna [m]
    noise : (16,)

    Returns
    -------
    (n, 16) states, (n, 16, 16) covariances after each node.
    (m, 3) innovations [m], (m, 3) their sigmas [m], (m, 2) variance added.
    Logarithm of the likelihood of all innovations, outliers bounded.

    Notes
    -----
    A fix whose innovation is beyond the gate gets so much variance that it pulls ever less the further off
    it is; it is never refused for good, so that the filter finds back after a long outage.
    """  # fmt: skip
    n, m = len(read), len(fixes)
    xs, ps = np.empty((n, N_STATES)), np.empty((n, N_STATES, N_STATES))
    innovation, spread, added = np.full((m, 3), np.nan), np.full((m, 3), np.nan), np.zeros((m, 2))
    F, H, h = np.empty((N_STATES, N_STATES)), np.empty((3, N_STATES)), np.empty(N_STATES)
    r, d = np.empty(3), np.empty(3)
    x, p = x0.copy(), p0.copy()
    likelihood = 0.0
    for k in range(n):
        if k > 0:
            step = steps[k - 1]
            x, p = predict(x, p, step, noise, F)
            h[:] = 0.0
            if step[AT_REST] != 0.0:
                # At rest the gyro reads its bias
                h[BIAS] = 1.0
                got = step[TURN_READ] / step[DT] - x[BIAS]
                s = _update(x, p, h, got, noise[GYRO_VAR] / step[DT])
                likelihood -= 0.5 * (math.log(s) + _bounded(got * got / s, GATE_UP))
            elif step[WHEEL_TURN_VAR] < math.inf:
                # The wheels turn the van as the gyro does
                h[BIAS], h[GYRO_SCALE], h[NAV_TURN] = -step[DT], step[TURN_READ], step[DT]
                h[LEFT], h[RIGHT] = -step[LEFT_M] / noise[TRACK_M], step[RIGHT_M] / noise[TRACK_M]
                got = step[WHEEL_TURN] - step[TURN_READ] - h @ x
                s = h @ p @ h + step[WHEEL_TURN_VAR]
                excess = max(got * got / s / GATE_UP, 1.0)
                _update(x, p, h, got, step[WHEEL_TURN_VAR] + s * (excess * excess - 1.0))
        j = fix_of[k]
        if j >= 0:
            east, north, up = antenna(x, read[k], lever, sigma[j], noise, H)
            d[0], d[1], d[2] = fixes[j, 0] - east, fixes[j, 1] - north, fixes[j, 2] - up
            white = noise[GNSS_FACTOR] ** 2 * (1.0 - noise[SHARE])
            for i in range(3):
                r[i] = white * sigma[j, i] ** 2 + noise[TICK_VAR]
            s00, s11, s01 = H[0] @ p @ H[0] + r[0], H[1] @ p @ H[1] + r[1], H[0] @ p @ H[1]
            s22 = H[2] @ p @ H[2] + r[2]
            det = s00 * s11 - s01 * s01
            nis = (s11 * d[0] * d[0] - 2.0 * s01 * d[0] * d[1] + s00 * d[1] * d[1]) / det
            nis_up = d[2] * d[2] / s22
            innovation[j] = d
            spread[j, 0], spread[j, 1], spread[j, 2] = math.sqrt(s00), math.sqrt(s11), math.sqrt(s22)
            likelihood -= 0.5 * (math.log(det) + _bounded(nis, GATE_PLAN))
            likelihood -= 0.5 * (math.log(s22) + _bounded(nis_up, GATE_UP))
            if math.isnan(doubt[j, 0]):
                excess = max(nis / GATE_PLAN, 1.0)
                added[j, 0] = 0.5 * (s00 + s11) * (excess * excess - 1.0)
                excess = max(nis_up / GATE_UP, 1.0)
                added[j, 1] = s22 * (excess * excess - 1.0)
            else:
                added[j] = doubt[j]
            at = x.copy()
            for i in range(3):
                # One axis after the other, all linearised at the same place
                moved = H[i] @ (x - at)
                _update(x, p, H[i].copy(), d[i] - moved, r[i] + added[j, i // 2])
        p = 0.5 * (p + p.T)
        xs[k], ps[k] = x, p
    return xs, ps, innovation, spread, added, likelihood


@njit(cache=True, nogil=True)
def _bounded(nis: float, gate: float) -> float:
    """Squared innovation over its variance; beyond the gate it grows as its logarithm."""
    return nis if nis <= gate else gate * (1.0 + math.log(nis / gate))


@njit(cache=True, nogil=True)
def smooth_backward(
    xs: FloatArray, ps: FloatArray, steps: FloatArray, noise: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Smooth filtered states.

    Parameters
    ----------
    xs, ps : (n, 16), (n, 16, 16) from `filter_forward`
    steps, noise : as there

    Returns
    -------
    (n, 16) states, (n, 16, 16) covariances.
    (n - 1,) the jump of the gyro's bias in each step over its sigma.

    References
    ----------
    H. E. Rauch, F. Tung, C. T. Striebel (1965), doi:10.2514/3.3166; the jump is the auxiliary residual of
    A. C. Harvey, S. J. Koopman (1992), doi:10.1080/07350015.1992.10509913.
    """
    n = len(xs)
    x, p = xs.copy(), ps.copy()
    jump = np.zeros(n - 1)
    F = np.empty((N_STATES, N_STATES))
    for k in range(n - 2, -1, -1):
        ahead, cov = predict(xs[k], ps[k], steps[k], noise, F)
        # States differ by 10^12 in variance: scaled, their covariance can be inverted
        scale = np.empty(N_STATES)
        for i in range(N_STATES):
            scale[i] = 1.0 / math.sqrt(max(cov[i, i], 1e-30))
        unit = cov * np.outer(scale, scale)
        for i in range(N_STATES):
            unit[i, i] += 1e-13
        inverse = np.linalg.inv(unit) * np.outer(scale, scale)
        gain = ps[k] @ F.T @ inverse
        change = x[k + 1] - ahead
        shrink = p[k + 1] - cov
        x[k] = xs[k] + gain @ change
        smoothed = ps[k] + gain @ shrink @ gain.T
        p[k] = 0.5 * (smoothed + smoothed.T)
        row = inverse[BIAS].copy()
        var = -(row @ shrink @ row)
        if var > 0.0:
            jump[k] = (row @ change) / math.sqrt(var)
    return x, p, jump
