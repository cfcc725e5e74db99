"""Kernels that locate a drive: extended Kalman filter forward, Rauch-Tung-Striebel smoother backward.

State at a node, by column:

====== ==================================================================================================
0-2    position of the vehicle's origin: east, north, up [m]
3      heading, clockwise from north, without jumps [rad]
4, 5   gyro: bias [rad/s], scale (turn = (1 + scale) reading - bias dt)
6, 7   left and right wheel: scale (distance = (1 + scale) counts)
8, 9   speed [m/s] and turn rate [rad/s] in addition to wheels and gyro; 0 while these are valid
10, 11 pitch and roll in addition to the vertical gyro [rad]
12     delay of the GNSS time stamps [s]
13-15  slow error of the GNSS, east, north, up, in its own sigmas
====== ==================================================================================================
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray

#: Number of states, and their columns: see above.
N_STATES = 16
E, N, U, NAV_HEADING, BIAS, GYRO_SCALE, LEFT, RIGHT, SPEED, NAV_TURN, PITCH, ROLL, DELAY, WANDER = range(14)

#: Columns of a step from one node to the next: time [s], turn read [rad], distances of the rear wheels [m], end of the
#: unit chord ahead and to the right, pitch read [rad], at rest, speed and turn free (0, 1; 2: begins), turns from the
#: wheels (0; else their share in the scales' effect, 1 for rear wheels), turn by the wheels' difference [rad] and its
#: variance, variances of the body sideways and up [m2] and of the bias; derivatives of the distances by the scales of
#: the counted wheels [m], and of their mean by the turn [m/rad]: the distances themselves and 0 where the rear wheels
#: are counted.
(
    DT, TURN_READ, LEFT_M, RIGHT_M, ANTENNA_AHEAD, ASIDE, PITCH_READ, AT_REST, SPEED_FREE, TURN_FREE, WHEELS_TURN,
    WHEEL_TURN, WHEEL_TURN_VAR, SIDE_VAR, UP_VAR, BIAS_VAR, LEFT_BY, RIGHT_BY, FAR_BY_TURN,
) = range(19)  # fmt: skip
#: Number of these columns.
N_STEP = 19

#: Columns of the noise model: see `linework.navigation.noise.NoiseModel.row`.
(
    GYRO_VAR, BIAS_WALK, WHEEL_VAR, SCALE_WALK, TILT_VAR, PER_TILT_S, PER_TILT_M, GNSS_FACTOR, SHARE,
    PER_WANDER_S, TICK_VAR, TRACK_M, ACCEL_VAR, TURN_ACCEL_VAR, SPEED_VAR, PER_SPEED_S,
) = range(16)  # fmt: skip
#: Number of these columns.
N_NOISE = 16

#: Columns of the readings at a node: roll and pitch [rad], speed over seconds [m/s].
READ_ROLL, READ_PITCH, READ_SPEED = range(3)
#: Elements of a lever in the vehicle frame: forward, left, up. [m]
LEVER_FORWARD, LEVER_LEFT, LEVER_UP = range(3)

#: Variances with which speed [(30 m/s)^2] and turn rate [(0.5 rad/s)^2] begin where nothing measures them.
_SPEED_BEGIN_VAR, _TURN_BEGIN_VAR = 900.0, 0.25
#: Variance of a state that is held at 0: keeps the covariance invertible.
_HELD_VAR = 1e-14
#: Random walk of the position beside all models: 10 um in a second; keeps the covariance invertible. [m2/s]
_POSITION_WALK = 1e-10
#: Values of a state's `free`: held at 0, and beginning at this step; else it wanders.
_HELD, _BEGINS = 0.0, 2.0
#: Least variance that states are scaled by, and ridge of the scaled covariance, before it is inverted.
_LEAST_VAR, _SCALED_RIDGE = 1e-30, 1e-13

#: Gates of squared innovations in plan and in height: 99.9 % of chi-squared with two and with one degree of freedom.
GATE_PLAN, GATE_UP = 13.8, 10.8


@njit(cache=True, nogil=True)
def predict(
    x: FloatArray, p: FloatArray, step: FloatArray, noise: FloatArray, F: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return state (16,) and covariance (16, 16) at the next node.

    Parameters
    ----------
    x, p
        (16,) and (16, 16) at this node.
    step, noise
        (19,) and (16,).
    F
        (16, 16), written: derivative of the new state by the old one.
    """
    dt = step[DT]
    F[:] = np.eye(N_STATES)
    new = x.copy()
    q = np.zeros(N_STATES)
    far = 0.0
    if step[AT_REST] == 0.0:
        # Turn and distance of the step, and the direction of its chord
        turn = (1.0 + x[GYRO_SCALE]) * step[TURN_READ] + (x[NAV_TURN] - x[BIAS]) * dt
        w = step[WHEELS_TURN] / noise[TRACK_M]
        turn += w * (x[LEFT] * step[LEFT_BY] - x[RIGHT] * step[RIGHT_BY])
        far = 0.5 * ((1.0 + x[LEFT]) * step[LEFT_BY] + (1.0 + x[RIGHT]) * step[RIGHT_BY]) + x[SPEED] * dt
        # Front wheels: a scale counts 1 / cos^2 of the steering angle, and a turn lengthens their path, not the axle's
        far += 0.5 * ((step[LEFT_M] - step[LEFT_BY]) + (step[RIGHT_M] - step[RIGHT_BY]))
        far += step[FAR_BY_TURN] * (turn - step[TURN_READ])
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
        turn_by[LEFT], turn_by[RIGHT] = w * step[LEFT_BY], -w * step[RIGHT_BY]
        far_by = step[FAR_BY_TURN] * turn_by
        far_by[LEFT] += 0.5 * step[LEFT_BY]
        far_by[RIGHT] += 0.5 * step[RIGHT_BY]
        far_by[SPEED] += dt
        for i in range(N_STATES):
            by_h = 0.5 * turn_by[i] + (1.0 if i == NAV_HEADING else 0.0)
            by_p = 1.0 if i == PITCH else 0.0
            F[E, i] += far_by[i] * plan * ahead_e + far * (plan * ahead_n * by_h - rise * ahead_e * by_p)
            F[N, i] += far_by[i] * plan * ahead_n - far * (plan * ahead_e * by_h + rise * ahead_n * by_p)
            F[U, i] += far_by[i] * rise + far * plan * by_p
            F[NAV_HEADING, i] += turn_by[i]
        q[NAV_HEADING] = noise[GYRO_VAR] * dt
    way = abs(far)
    # Free states wander; others are 0, or the slow error of a speed log
    if step[SPEED_FREE] == 0.0 and noise[SPEED_VAR] > 0.0:
        _forget(SPEED, math.exp(-dt * noise[PER_SPEED_S]), noise[SPEED_VAR], new, F, q)
    else:
        _wander_freely(SPEED, step[SPEED_FREE], noise[ACCEL_VAR] * dt, _SPEED_BEGIN_VAR, new, F, q)
    _wander_freely(NAV_TURN, step[TURN_FREE], noise[TURN_ACCEL_VAR] * dt, _TURN_BEGIN_VAR, new, F, q)
    _forget(PITCH, math.exp(-dt * noise[PER_TILT_S] - way * noise[PER_TILT_M]), noise[TILT_VAR], new, F, q)
    # Where nothing measures roll it is that of the road, and changes as the slope does
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
    p[E, E] += along * sin_h * sin_h + side * cos_h * cos_h + _POSITION_WALK * dt
    p[N, N] += along * cos_h * cos_h + side * sin_h * sin_h + _POSITION_WALK * dt
    p[E, N] += (along - side) * sin_h * cos_h
    p[N, E] = p[E, N]
    p[U, U] += step[UP_VAR] + _POSITION_WALK * dt
    return new, p


@njit(cache=True, nogil=True)
def _wander_freely(
    i: int, free: float, q_step: float, q_begin: float, x: FloatArray, F: FloatArray, q: FloatArray
) -> None:
    """Propagate state `i`: 0 while `free` is 0, unknown where it is 2, a random walk where it is 1."""
    if free == _HELD:
        x[i], F[i, i], q[i] = 0.0, 0.0, _HELD_VAR
    elif free == _BEGINS:
        x[i], F[i, i], q[i] = 0.0, 0.0, q_begin
    else:
        q[i] = q_step


@njit(cache=True, nogil=True)
def _forget(i: int, keep: float, var: float, x: FloatArray, F: FloatArray, q: FloatArray) -> None:
    """Propagate state `i` as a Gauss-Markov process of variance `var` that keeps the share `keep`."""
    x[i] *= keep
    F[i, i] = keep
    q[i] = var * (1.0 - keep * keep)


@njit(cache=True, nogil=True)
def _update(x: FloatArray, p: FloatArray, H: FloatArray, innovation: float, variance: float) -> float:
    """Update state and covariance, in place, by one scalar measurement; return the variance of its innovation."""
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
    """Return the expected position of a fix: east, north, up [m].

    Parameters
    ----------
    x
        (16,) state.
    read
        (3,) readings, columns `READ_ROLL` to `READ_SPEED`. The speed is over seconds: that of the last step would
        carry the error of the step into the delay.
    lever
        (3,) of the antenna. [m, vehicle]
    sigma
        (3,) of the fix. [m]
    noise
        (16,).
    H
        (3, 16), written: derivative of the position by the state.
    """
    roll, pitch = read[READ_ROLL] + x[ROLL], read[READ_PITCH] + x[PITCH]
    sin_r, cos_r, sin_p, cos_p = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    sin_h, cos_h = math.sin(x[NAV_HEADING]), math.cos(x[NAV_HEADING])
    left = lever[LEVER_LEFT] * cos_r - lever[LEVER_UP] * sin_r
    up = lever[LEVER_LEFT] * sin_r + lever[LEVER_UP] * cos_r
    front, top = lever[LEVER_FORWARD] * cos_p - up * sin_p, lever[LEVER_FORWARD] * sin_p + up * cos_p
    east, north = front * sin_h - left * cos_h, front * cos_h + left * sin_h
    velocity = np.empty(3)
    speed = read[READ_SPEED] + x[SPEED]
    velocity[E], velocity[N], velocity[U] = speed * sin_h, speed * cos_h, speed * sin_p
    H[:] = 0.0
    slow = noise[GNSS_FACTOR] * math.sqrt(noise[SHARE])
    for i in range(3):
        H[i, i] = 1.0
        H[i, DELAY] = -velocity[i]
        H[i, WANDER + i] = slow * sigma[i]
    H[E, NAV_HEADING], H[N, NAV_HEADING] = north, -east
    H[E, PITCH], H[N, PITCH], H[U, PITCH] = -top * sin_h, -top * cos_h, front
    H[E, ROLL] = -left * sin_p * sin_h + up * cos_h
    H[N, ROLL] = -left * sin_p * cos_h - up * sin_h
    H[U, ROLL] = left * cos_p
    add = np.empty(3)
    add[E], add[N], add[U] = east, north, top
    for i in range(3):
        add[i] += x[i] - velocity[i] * x[DELAY] + H[i, WANDER + i] * x[WANDER + i]
    return add[E], add[N], add[U]


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
    """Filter all nodes forward.

    Parameters
    ----------
    x0, p0 : (16,), (16, 16) at the first node
    steps : (n - 1, 19)
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
    The variance of a fix whose innovation is beyond the gate grows so that it pulls less the farther off it is; it is
    never rejected, so that the filter recovers after a long outage.
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
                # The difference of the wheels measures the turn, as the gyro does
                h[BIAS], h[GYRO_SCALE], h[NAV_TURN] = -step[DT], step[TURN_READ], step[DT]
                h[LEFT], h[RIGHT] = -step[LEFT_BY] / noise[TRACK_M], step[RIGHT_BY] / noise[TRACK_M]
                got = step[WHEEL_TURN] - step[TURN_READ] - h @ x
                s = h @ p @ h + step[WHEEL_TURN_VAR]
                excess = max(got * got / s / GATE_UP, 1.0)
                _update(x, p, h, got, step[WHEEL_TURN_VAR] + s * (excess * excess - 1.0))
        j = fix_of[k]
        if j >= 0:
            east, north, up = antenna(x, read[k], lever, sigma[j], noise, H)
            d[E], d[N], d[U] = fixes[j, E] - east, fixes[j, N] - north, fixes[j, U] - up
            white = noise[GNSS_FACTOR] ** 2 * (1.0 - noise[SHARE])
            for i in range(3):
                r[i] = white * sigma[j, i] ** 2 + noise[TICK_VAR]
            s00, s11, s01 = H[E] @ p @ H[E] + r[E], H[N] @ p @ H[N] + r[N], H[E] @ p @ H[N]
            s22 = H[U] @ p @ H[U] + r[U]
            det = s00 * s11 - s01 * s01
            nis = (s11 * d[E] * d[E] - 2.0 * s01 * d[E] * d[N] + s00 * d[N] * d[N]) / det
            nis_up = d[U] * d[U] / s22
            innovation[j] = d
            spread[j, E], spread[j, N], spread[j, U] = math.sqrt(s00), math.sqrt(s11), math.sqrt(s22)
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
                # One axis after the other, all linearised at the same state
                moved = H[i] @ (x - at)
                _update(x, p, H[i].copy(), d[i] - moved, r[i] + added[j, i // 2])
        p = 0.5 * (p + p.T)
        xs[k], ps[k] = x, p
    return xs, ps, innovation, spread, added, likelihood


@njit(cache=True, nogil=True)
def _bounded(nis: float, gate: float) -> float:
    """Return a normalised squared innovation that grows only logarithmically beyond the gate."""
    return nis if nis <= gate else gate * (1.0 + math.log(nis / gate))


@njit(cache=True, nogil=True)
def smooth_backward(
    xs: FloatArray, ps: FloatArray, steps: FloatArray, noise: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Smooth filtered states backward.

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
        # Variances of states differ by 10^12: the covariance is scaled before it is inverted
        scale = np.empty(N_STATES)
        for i in range(N_STATES):
            scale[i] = 1.0 / math.sqrt(max(cov[i, i], _LEAST_VAR))
        unit = cov * np.outer(scale, scale)
        for i in range(N_STATES):
            unit[i, i] += _SCALED_RIDGE
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
