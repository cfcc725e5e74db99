"""The filter and its parts, against closed forms and against slow, obvious twins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from linework.kernels import navigation as kernel
from linework.model.logs import GnssLog, GyroLog, WheelLog
from linework.navigation.dead_reckoning import Motion, reckon, steps_between
from linework.navigation.filter import filter_problem, filter_states, smooth_states
from linework.navigation.motion import valid_turn_rates
from linework.navigation.noise import NoiseModel
from linework.navigation.stretch import fit_onto_fixes
from linework.navigation.wheels import valid_wheel_travel

NONE = np.zeros((0, 2))


def circling(seconds=20.0, rate=0.1, speed=10.0):
    """A van on a circle, clockwise: turns and ways without any error."""
    time = np.arange(0.0, seconds + 0.01, 0.02)
    ways = speed * time[:, None] + np.array([0.75, -0.75]) * rate * time[:, None]
    return Motion(
        turn_time_s=time, turn_radps=np.full(len(time), rate), way_time_s=time, way_m=ways,
        tilt_rad=np.zeros((len(time), 2)), no_turn=NONE, no_way=NONE, at_rest=NONE, tick_m=0.02, track_m=1.5,
    )  # fmt: skip


def test_a_circle_is_reckoned():
    motion = circling()
    way = reckon(motion, np.zeros(0))
    heading = 0.1 * way.time_s
    assert np.allclose(way.heading_rad, heading, atol=1e-12)
    # Starts to the north, turns right: radius 100 m
    assert np.allclose(way.xy, 100.0 * np.stack([1.0 - np.cos(heading), np.sin(heading)], axis=1), atol=1e-4)


def test_wheels_turn_the_van_as_the_gyro_does():
    motion = circling()
    way = reckon(motion, np.zeros(0))
    steps = steps_between(motion, way, np.arange(0.0, 20.0, 0.5))
    assert np.allclose(steps[:, kernel.WHEEL_TURN], steps[:, kernel.TURN_READ], atol=1e-9)


def test_derivatives_are_those_of_the_step():
    """The kernel's F against differences of its own state."""
    rng = np.random.default_rng(1)
    step = np.zeros(kernel.N_STEP)
    step[[kernel.DT, kernel.TURN_READ, kernel.LEFT_M, kernel.RIGHT_M]] = 0.4, 0.05, 4.1, 3.9
    step[[kernel.ANTENNA_AHEAD, kernel.ASIDE, kernel.PITCH_READ]] = 0.999, 0.025, 0.04
    step[[kernel.SPEED_FREE, kernel.TURN_FREE, kernel.WHEELS_TURN]] = 1.0, 1.0, 1.1
    # As of front wheels: the derivatives by scales and turn are columns of their own
    step[[kernel.LEFT_BY, kernel.RIGHT_BY, kernel.FAR_BY_TURN]] = 4.5, 4.3, -0.3
    step[kernel.WHEEL_TURN_VAR] = np.inf
    x, noise = 0.01 * rng.normal(size=kernel.N_STATES), some_noise().row()
    x[kernel.NAV_HEADING] = 0.7
    F, unused = np.empty((16, 16)), np.empty((16, 16))
    kernel.predict(x, np.zeros((16, 16)), step, noise, F)
    for i in range(kernel.N_STATES):
        d = np.zeros(kernel.N_STATES)
        d[i] = 1e-5
        ends = [kernel.predict(x + s * d, np.zeros((16, 16)), step, noise, unused)[0] for s in (1, -1)]
        assert np.allclose(F[:, i], (ends[0] - ends[1]) / 2e-5, atol=1e-6), i


def test_derivatives_are_those_of_the_antenna():
    rng = np.random.default_rng(2)
    x, lever = 0.05 * rng.normal(size=kernel.N_STATES), np.array([0.8, -0.3, 1.9])
    read, sigma, noise = np.array([0.03, -0.05, 12.0]), np.array([0.02, 0.02, 0.04]), some_noise().row()
    H, unused = np.empty((3, 16)), np.empty((3, 16))
    kernel.antenna(x, read, lever, sigma, noise, H)
    # Speed and heading move the antenna by the delay too, at second order: not part of the derivative
    x[kernel.DELAY] = 0.0
    kernel.antenna(x, read, lever, sigma, noise, H)
    for i in range(kernel.N_STATES):
        d = np.zeros(kernel.N_STATES)
        d[i] = 1e-5
        ends = [np.array(kernel.antenna(x + s * d, read, lever, sigma, noise, unused)) for s in (1, -1)]
        assert np.allclose(H[:, i], (ends[0] - ends[1]) / 2e-5, atol=1e-6), i


def some_noise():
    return NoiseModel(
        gyro_noise=1e-3, bias_walk=1e-5, wheel_noise=0.01, wander_share=0.4, wander_s=20.0, tick_m=0.02
    )


def short_problem():
    """A drive of 20 s with fixes each second, seen with an antenna beside the axle."""
    motion = circling()
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 20.0, 1.0)
    angle = 0.1 * time
    xyz = np.stack([100.0 * (1.0 - np.cos(angle)), 100.0 * np.sin(angle), np.full(20, 1.9)], axis=1)
    gnss = GnssLog(time, xyz + 0.02 * rng.normal(size=(20, 3)), np.full((20, 3), 0.02))
    x0, sigma0 = np.zeros(16), np.zeros(16)
    sigma0[:3], sigma0[kernel.NAV_HEADING], sigma0[kernel.BIAS], sigma0[kernel.GYRO_SCALE] = (
        5.0,
        0.05,
        1e-3,
        0.01,
    )
    sigma0[[kernel.LEFT, kernel.RIGHT]] = 0.02
    sigma0[kernel.WANDER :] = 1.0
    lever = np.array([0.0, 0.0, 1.9])
    return filter_problem(motion, reckon(motion, gnss.time_s), gnss, x0, sigma0, lever)


def test_smoother_equals_least_squares():
    """All states of all nodes at once: prior, steps and fixes as one weighted adjustment."""
    problem, noise = short_problem(), some_noise()
    none = np.zeros((len(problem.fixes), 2))
    estimate = smooth_states(problem, noise, filter_states(problem, noise, none))
    x, p = adjusted(problem, noise, estimate.x)
    own, twin = np.diagonal(estimate.p, axis1=1, axis2=2), np.diagonal(p, axis1=1, axis2=2)
    # Both are linearised, at places that differ by the filter's own errors
    assert np.all(np.abs(estimate.x - x)[:, :8] < 0.01 * np.sqrt(own[:, :8]))
    assert np.allclose(own[:, :8], twin[:, :8], rtol=0.03, atol=1e-12)


def adjusted(problem, noise, about):
    """Return states (n, 16) and covariances of a batch adjustment linearised about given states."""
    n, row = len(problem.time_s), noise.row()
    sigma0 = problem.sigma0.copy()
    sigma0[[kernel.PITCH, kernel.ROLL]] = noise.tilt_rad
    free = 1e-9  # what has no noise at all, in a least-squares sense
    rows, right = [], []

    def add(blocks, residual, cov):
        half = np.linalg.cholesky(np.linalg.inv(cov + free**2 * np.eye(len(residual)))).T
        line = np.zeros((len(residual), 16 * n))
        for k, block in blocks:
            line[:, 16 * k : 16 * k + 16] = block
        rows.append(half @ line)
        right.append(half @ residual)

    add([(0, np.eye(16))], problem.x0 - about[0], np.diag(sigma0**2))
    for k, step in enumerate(problem.steps):
        F = np.empty((16, 16))
        ahead, q = kernel.predict(about[k], np.zeros((16, 16)), step, row, F)
        add([(k, -F), (k + 1, np.eye(16))], ahead - about[k + 1], q)
        h = np.zeros((1, 16))
        h[0, kernel.BIAS], h[0, kernel.GYRO_SCALE], h[0, kernel.NAV_TURN] = (
            -step[kernel.DT], step[kernel.TURN_READ], step[kernel.DT]
        )  # fmt: skip
        h[0, kernel.LEFT], h[0, kernel.RIGHT] = -step[kernel.LEFT_M] / 1.5, step[kernel.RIGHT_M] / 1.5
        got = step[kernel.WHEEL_TURN] - step[kernel.TURN_READ] - h @ about[k + 1]
        add([(k + 1, h)], got, np.array([[step[kernel.WHEEL_TURN_VAR]]]))
    for k in np.flatnonzero(problem.fix_of >= 0):
        j, H = problem.fix_of[k], np.empty((3, 16))
        sigma = problem.sigma_m[j]
        at = np.array(kernel.antenna(about[k], problem.read[k], problem.lever_m, sigma, row, H))
        cov = np.diag((1.0 - noise.wander_share) * sigma**2 + row[kernel.TICK_VAR])
        add([(k, H)], problem.fixes[j] - at, cov)
    A, b = np.concatenate(rows), np.concatenate(right)
    cov = np.linalg.inv(A.T @ A + 1e-9 * np.eye(16 * n))
    x = about + (cov @ (A.T @ b)).reshape(n, 16)
    return x, np.stack([cov[16 * k : 16 * k + 16, 16 * k : 16 * k + 16] for k in range(n)])


def test_a_fix_far_off_pulls_little():
    problem, noise = short_problem(), some_noise()
    sound = filter_states(problem, noise).x[-1, :2]
    fixes = problem.fixes.copy()
    fixes[10] += [30.0, -20.0, 0.0]
    problem = replace(problem, fixes=fixes)
    off = filter_states(problem, noise)
    assert off.added_m2[10, 0] > 100.0
    assert np.hypot(*(off.x[-1, :2] - sound)) < 0.01


def test_a_way_is_laid_onto_fixes():
    rng = np.random.default_rng(4)
    way = rng.uniform(-50.0, 50.0, (30, 2))
    c, s = np.cos(0.6), np.sin(0.6)
    fixes = 1.02 * way @ np.array([[c, -s], [s, c]]) + [7.0, -3.0]
    fixes[5] += 400.0
    fit = fit_onto_fixes(way, fixes)
    assert (fit.east_m, fit.north_m) == pytest.approx((7.0, -3.0), abs=0.05)
    assert fit.heading_rad == pytest.approx(0.6, abs=1e-3)
    assert fit.scale == pytest.approx(1.02, abs=1e-3)


def test_noise_of_a_gyro_is_read_from_rest_and_from_driving():
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 200.0, 0.02)
    walk = np.radians(0.5) / 60.0
    rate = walk / np.sqrt(0.02) * rng.normal(size=len(time)) + 0.2 * np.sin(0.3 * time)
    assert valid_turn_rates(GyroLog(time, rate), NONE).noise == pytest.approx(walk, rel=0.05)
    rate[:5000] -= 0.2 * np.sin(0.3 * time[:5000])
    assert valid_turn_rates(GyroLog(time, rate), np.array([[0.0, 99.0]])).noise == pytest.approx(
        walk, rel=0.15
    )


def test_stops_and_speeds():
    time = np.arange(0.0, 30.0, 0.1)
    speed = np.where((time > 10.0) & (time < 20.0), 0.0, 8.0)
    log = WheelLog(time, speed_mps=speed)
    ways = valid_wheel_travel(log, 0.02, 1.5, None)
    assert np.allclose(ways.at_rest, [[10.4, 19.6]], atol=0.11)
    assert ways.way_m[-1, 0] == pytest.approx(8.0 * 20.0, abs=1.0)
