"""Counters on the front wheels: the path of the rear axle, and what a scale or a turn does to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from linework.kernels import navigation as kernel
from linework.model.logs import GnssLog, GyroLog, NavigationLogs, WheelLog
from linework.navigation.dead_reckoning import Motion, reckon, steps_between
from linework.navigation.front_wheels import front_steps, rear_steps, turns_of_wheels
from linework.navigation.motion import motion_of
from linework.navigation.noise import NoiseModel
from linework.navigation.wheels import valid_wheel_travel

NONE = np.zeros((0, 2))
RADIUS_M, WHEELBASE_M, TRACK_M, SPEED_MPS = 9.0, 3.0, 1.6, 4.5
RATE_RADPS = SPEED_MPS / RADIUS_M
#: Of the left and the right front wheel, clockwise about a centre on the line of the rear axle.
FRONT_MPS = RATE_RADPS * np.hypot(RADIUS_M + np.array([0.5, -0.5]) * TRACK_M, WHEELBASE_M)


def turning(seconds=10.0, scales=(0.0, 0.0), *, with_gyro=True):
    """A van in a bend of 9 m whose wheels travel (1 + scale) times what is counted."""
    time = np.arange(0.0, seconds + 0.01, 0.02)
    motion = Motion(
        turn_time_s=time, turn_radps=np.full(len(time), RATE_RADPS), way_time_s=time,
        way_m=time[:, None] * FRONT_MPS / (1.0 + np.asarray(scales)), tilt_rad=np.zeros((len(time), 2)),
        no_turn=NONE, no_way=NONE, at_rest=NONE, tick_m=0.02, track_m=TRACK_M, wheelbase_m=WHEELBASE_M,
    )  # fmt: skip
    if with_gyro:
        return motion
    step = np.diff(motion.way_m, axis=0)
    rate = turns_of_wheels(step, TRACK_M, WHEELBASE_M) / np.diff(time)
    return replace(motion, turn_radps=np.append(rate, rate[-1]), wheels_turn=True)


def test_the_rear_axle_runs_the_bend():
    way = reckon(turning(), np.zeros(0))
    heading = RATE_RADPS * way.time_s
    circle = RADIUS_M * np.stack([1.0 - np.cos(heading), np.sin(heading)], axis=1)
    assert np.allclose(way.xy, circle, atol=1e-3)
    # Taken for rear wheels, the front ones make it 5 % too long
    wrong = reckon(replace(turning(), wheelbase_m=0.0), np.zeros(0))
    assert wrong.way_m.mean(axis=1)[-1] / way.way_m.mean(axis=1)[-1] == pytest.approx(1.054, abs=1e-3)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_front_wheels_show_the_turn(sign):
    step = sign * 0.05 * FRONT_MPS[None]
    # Backward on the same circle the van turns the other way
    assert turns_of_wheels(step, TRACK_M, WHEELBASE_M) == pytest.approx(sign * 0.05 * RATE_RADPS)
    assert turns_of_wheels(step[:, ::-1], TRACK_M, WHEELBASE_M) == pytest.approx(-sign * 0.05 * RATE_RADPS)
    steps = steps_between(turning(), reckon(turning(), np.zeros(0)), np.arange(0.0, 10.0, 0.5))
    assert np.allclose(steps[:, kernel.WHEEL_TURN], steps[:, kernel.TURN_READ], atol=1e-6)


def test_rest_noise_and_rear_wheels():
    rest, by_scale = rear_steps(np.zeros((1, 2)), np.array([0.01]), WHEELBASE_M)
    assert rest.tolist() == by_scale.tolist() == [[0.0, 0.0]]
    assert turns_of_wheels(np.zeros((1, 2)), TRACK_M, WHEELBASE_M).tolist() == [0.0]
    # A turn that no front wheel could make is noise: bounded, never NaN
    creeping, by_scale = rear_steps(np.full((1, 2), 0.001), np.array([0.01]), WHEELBASE_M)
    assert np.allclose(creeping, 0.0006)
    assert np.allclose(by_scale, 0.001 / 0.6)
    assert np.isfinite(turns_of_wheels(np.array([[0.02, 0.0]]), TRACK_M, WHEELBASE_M)).all()
    step = np.array([[0.1, 0.2]])
    assert rear_steps(step, np.array([0.1]), 0.0)[0] is step
    back = front_steps(rear_steps(-step, np.array([0.01]), WHEELBASE_M)[0][0], 0.01, WHEELBASE_M)
    assert np.allclose(back, -step)


@pytest.mark.parametrize("with_gyro", [True, False])
@pytest.mark.parametrize("scales", [(0.0006, 0.0006), (0.0006, -0.0003)])
def test_a_scale_moves_the_van_as_the_filter_says(scales, with_gyro):
    """The step with the scales as states against the step that was driven."""
    nodes, noise = np.array([0.0, 0.5]), NoiseModel(gyro_noise=1e-3, bias_walk=1e-5, wheel_noise=0.01).row()
    noise[kernel.TRACK_M] = TRACK_M
    ends = []
    for counted, states in (((0.0, 0.0), (0.0, 0.0)), (scales, scales), (scales, (0.0, 0.0))):
        motion = turning(1.0, counted, with_gyro=with_gyro)
        (step,) = steps_between(motion, reckon(motion, np.zeros(0)), nodes)
        x = np.zeros(kernel.N_STATES)
        x[[kernel.LEFT, kernel.RIGHT]] = states
        ends.append(kernel.predict(x, np.zeros((16, 16)), step, noise, np.empty((16, 16)))[0])
    driven, corrected, uncorrected = (end[[kernel.E, kernel.N, kernel.NAV_HEADING]] for end in ends)
    # A correction of the turn rotates the chord of the step and does not shorten it
    assert np.all(np.abs(corrected - driven) < 0.1 * np.abs(uncorrected - driven) + 1e-8)


def test_a_gyro_that_reads_too_much_moves_the_van_as_the_filter_says():
    noise = NoiseModel(gyro_noise=1e-3, bias_walk=1e-5, wheel_noise=0.01).row()
    ends = []
    for factor, scale in ((1.0, 0.0), (1.01, 1.0 / 1.01 - 1.0), (1.01, 0.0)):
        motion = turning(1.0)
        motion = replace(motion, turn_radps=factor * motion.turn_radps)
        (step,) = steps_between(motion, reckon(motion, np.zeros(0)), np.array([0.0, 0.5]))
        x = np.zeros(kernel.N_STATES)
        x[kernel.GYRO_SCALE] = scale
        ends.append(kernel.predict(x, np.zeros((16, 16)), step, noise, np.empty((16, 16)))[0][:4])
    driven, corrected, uncorrected = ends
    # A correction of the turn rotates the chord of the step and does not shorten it
    assert np.all(np.abs(corrected - driven) < 0.1 * np.abs(uncorrected - driven) + 1e-8)


def test_a_stuck_front_wheel_is_replaced_by_the_other():
    time = np.arange(0.0, 20.0, 0.05)
    counts = np.floor(time[:, None] * FRONT_MPS / 0.001)
    stuck = counts.copy()
    stuck[(time > 8.0) & (time < 14.0), 0] = counts[np.searchsorted(time, 8.0), 0]
    stuck[time >= 14.0, 0] -= counts[time >= 14.0, 0][0] - stuck[time < 14.0, 0][-1]
    ways = valid_wheel_travel(
        WheelLog(time, stuck), 0.001, TRACK_M, RATE_RADPS * time, wheelbase_m=WHEELBASE_M
    )
    assert any("left counter is stuck" in text for text in ways.warnings)
    assert ways.way_m[-1, 0] == pytest.approx(FRONT_MPS[0] * time[-1], rel=0.002)


def test_a_speed_of_the_front_axle_and_no_wheels():
    time = np.arange(0.0, 5.0, 0.1)
    gnss = GnssLog(time, np.zeros((50, 3)), np.full((50, 3), 0.02))
    gyro = GyroLog(time, np.full(50, RATE_RADPS))
    speed = WheelLog(time, speed_mps=np.full(50, RATE_RADPS * np.hypot(RADIUS_M, WHEELBASE_M)))
    motion, _, _ = motion_of(NavigationLogs(gnss=gnss, gyro=gyro, wheels=speed, wheelbase_m=WHEELBASE_M))
    assert reckon(motion, np.zeros(0)).way_m[-1, 0] == pytest.approx(SPEED_MPS * 4.9, rel=1e-6)
    # Distances from fixes are those of the vehicle, whatever wheels it has
    motion, _, _ = motion_of(NavigationLogs(gnss=gnss, gyro=gyro, wheelbase_m=WHEELBASE_M))
    assert motion.wheelbase_m == 0.0
