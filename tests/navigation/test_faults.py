"""Logs with faults: each is put right or left out, and named in a warning; the track stays near the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from linework.errors import InputError
from linework.model.logs import GnssLog, GyroLog, WheelLog
from linework.navigation.locate import locate_drive
from linework.navigation.located import NavigationConfig
from linework.simulation.sensors.logs import GNSS_2_CM, GYROS, SensorGrades, WheelGrade, simulate_logs
from linework.simulation.sensors.long_drives import URBAN, long_drive


@pytest.fixture(scope="module")
def drive():
    return long_drive(URBAN, 300.0, np.random.default_rng(12))


@pytest.fixture(scope="module")
def logs(drive):
    grades = SensorGrades(gnss=GNSS_2_CM, gyro=GYROS[1], wheels=WheelGrade(scale_left=0.01))
    return simulate_logs(drive, grades, np.random.default_rng(13))


def off_m(drive, located):
    """Return the horizontal error of every pose."""
    poses = located.trajectory
    true = np.stack([np.interp(poses.time_s, drive.time_s, c) for c in drive.xyz.T], axis=1)
    return np.hypot(*(poses.xyz - true)[:, :2].T)


def said(located, *words):
    """Return the one warning that has all of these words."""
    found = [w for w in located.warnings if all(word in w for word in words)]
    assert len(found) == 1, located.warnings
    return found[0]


def with_rate(logs, rate):
    return replace(logs, gyro=replace(logs.gyro, yaw_rate_radps=rate))


def with_ticks(logs, ticks):
    return replace(logs, wheels=WheelLog(logs.wheels.time_s, ticks))


def later(logs, seconds, since_s=-1.0):
    time = logs.gnss.time_s
    return replace(logs, gnss=replace(logs.gnss, time_s=time + np.where(time >= since_s, seconds, 0.0)))


def test_sound_logs_need_no_warning(drive, logs):
    located = locate_drive(logs, rate_hz=10.0)
    assert located.warnings == ()
    assert off_m(drive, located).max() < 0.2


@pytest.mark.parametrize(
    ("seconds", "name"),
    [(18.0, "GPS time against UTC"), (-18.0, "GPS time against UTC"), (1.0, "one second"),
     (19.0, "TAI against GPS time"), (37.0, "TAI against UTC")],
)  # fmt: skip
def test_clock_offsets_are_named(drive, logs, seconds, name):
    located = locate_drive(later(logs, seconds), rate_hz=10.0)
    said(located, name, "taken into account")
    poses = located.trajectory
    true = np.stack([np.interp(poses.time_s - seconds, drive.time_s, c) for c in drive.xyz.T], axis=1)
    assert np.hypot(*(poses.xyz - true)[:, :2].T).max() < 0.3


def test_late_stamps_are_estimated(drive, logs):
    located = locate_drive(later(logs, 0.12), rate_hz=10.0)
    said(located, "GNSS stamps are 0.1", "later")
    value, sigma = located.stretches[0].estimates["gnss_delay_s"]
    assert value == pytest.approx(0.12, abs=max(4.0 * sigma, 0.005))
    assert off_m(drive, located).max() < 0.3


def test_a_clock_that_jumps_cuts_the_drive(drive, logs):
    located = locate_drive(later(logs, 1.0, since_s=170.0), rate_hz=10.0)
    said(located, "clock jumps by +1.00 s", "split")
    assert len(located.stretches) == 2
    assert located.stretches[0].last_s == pytest.approx(170.0, abs=3.0)
    first = located.trajectory.time_s < 165.0
    assert off_m(drive, located)[first].max() < 0.3


def test_a_long_outage_is_bridged_up_to_the_limit(drive, logs):
    gone = (logs.gnss.time_s > 60.0) & (logs.gnss.time_s < 200.0)
    gnss = GnssLog(logs.gnss.time_s[~gone], logs.gnss.xyz[~gone], logs.gnss.sigma_m[~gone])
    config = NavigationConfig(longest_outage_s=60.0)
    located = locate_drive(replace(logs, gnss=gnss), config, rate_hz=10.0)
    assert np.allclose(located.left_out_s, [[90.0, 170.0]], atol=1.0)
    time, sigma = located.trajectory.time_s, located.trajectory.sigma_xyz_m[:, 0]
    assert not np.any((time > 91.0) & (time < 169.0))
    # Sigmas grow into the outage, and the way back from a long one is found
    assert sigma[np.searchsorted(time, 88.0)] > 2.0 * sigma[np.searchsorted(time, 59.0)]
    assert off_m(drive, located).max() < 1.0


@pytest.mark.parametrize("bits", [16, 32])
def test_counters_wrap(drive, logs, bits):
    size = 2.0**bits
    start = size - 2000.0
    located = locate_drive(with_ticks(logs, (logs.wheels.ticks + start) % size), rate_hz=10.0)
    assert sum("wraps at" in w for w in located.warnings) == 2
    assert off_m(drive, located).max() < 0.2


def test_counters_count_down(drive, logs):
    located = locate_drive(with_ticks(logs, -logs.wheels.ticks), rate_hz=10.0)
    said(located, "sign reversed")
    assert off_m(drive, located).max() < 0.2


def test_a_counter_is_reset(drive, logs):
    ticks = logs.wheels.ticks.copy()
    ticks[2000:] -= ticks[2000]
    located = locate_drive(with_ticks(logs, ticks), rate_hz=10.0)
    assert any("jumps" in w for w in located.warnings)
    assert off_m(drive, located).max() < 0.2


def test_a_stuck_counter_is_replaced_by_the_other(drive, logs):
    ticks = logs.wheels.ticks.copy()
    ticks[1600:2400, 0] = ticks[1600, 0]
    ticks[2400:, 0] -= ticks[2400, 0] - ticks[1600, 0]
    gone = (logs.gnss.time_s > 85.0) & (logs.gnss.time_s < 115.0)
    gnss = GnssLog(logs.gnss.time_s[~gone], logs.gnss.xyz[~gone], logs.gnss.sigma_m[~gone])
    located = locate_drive(replace(with_ticks(logs, ticks), gnss=gnss), rate_hz=10.0)
    assert any("left counter is stuck" in w for w in located.warnings)
    assert off_m(drive, located).max() < 0.6


def test_wheels_that_stand_while_the_van_moves_are_not_believed(drive, logs):
    ticks = logs.wheels.ticks.copy()
    ticks[1600:1800] = ticks[1600]
    ticks[1800:] -= ticks[1800] - ticks[1600]
    located = locate_drive(with_ticks(logs, ticks), rate_hz=10.0)
    said(located, "while GNSS moves", "not taken for a stop")
    assert off_m(drive, located).max() < 0.5


@pytest.mark.parametrize(
    ("factor", "name"),
    [(-1.0, "with the wrong sign"), (180.0 / np.pi, "in degrees instead of radians"),
     (np.pi / 180.0, "in radians instead of degrees")],
)  # fmt: skip
def test_signs_and_units_of_the_gyro_are_named(drive, logs, factor, name):
    located = locate_drive(with_rate(logs, logs.gyro.yaw_rate_radps * factor), rate_hz=10.0)
    said(located, "gyro: against GNSS it turns", name)
    assert off_m(drive, located).max() < 0.2


def test_a_step_of_the_bias_is_named(drive, logs):
    step = np.where(logs.gyro.time_s > 150.0, np.radians(0.2), 0.0)
    located = locate_drive(with_rate(logs, logs.gyro.yaw_rate_radps + step), rate_hz=10.0)
    warning = said(located, "its bias jumps")
    assert abs(float(warning.split("about ")[1].split()[0]) - 150.0) < 5.0
    assert off_m(drive, located).max() < 0.2


def test_a_saturated_gyro_is_named_and_bridged_by_the_wheels(drive, logs):
    limit = np.radians(12.0)
    assert np.abs(logs.gyro.yaw_rate_radps).max() > 1.5 * limit
    located = locate_drive(with_rate(logs, np.clip(logs.gyro.yaw_rate_radps, -limit, limit)), rate_hz=10.0)
    assert any("saturated at 12.0 deg/s" in w for w in located.warnings)
    assert off_m(drive, located).max() < 0.3


def test_a_wrong_tick_or_unit_of_speed_is_named(drive, logs):
    located = locate_drive(replace(logs, tick_m=logs.tick_m * 1.3), rate_hz=10.0)
    said(located, "the distance by GNSS is 0.77", "times theirs")
    speed = np.gradient(logs.wheels.ticks.mean(axis=1) * logs.tick_m, logs.wheels.time_s)
    located = locate_drive(
        replace(logs, wheels=WheelLog(logs.wheels.time_s, speed_mps=3.6 * speed)), rate_hz=10.0
    )
    said(located, "km/h instead of m/s")
    assert off_m(drive, located).max() < 0.3


def test_works_with_fewer_sensors(drive, logs):
    bare = replace(logs, gyro=GyroLog(logs.gyro.time_s, logs.gyro.yaw_rate_radps))
    for fewer in (bare, replace(bare, wheels=None), replace(logs, gyro=None)):
        located = locate_drive(fewer, rate_hz=10.0)
        assert off_m(drive, located).max() < 0.5
        assert np.sqrt(np.mean((off_m(drive, located) / located.trajectory.sigma_xyz_m[:, 0]) ** 2)) < 3.0


def test_refuses_what_cannot_be_located(logs):
    with pytest.raises(InputError, match="neither a gyro nor"):
        locate_drive(replace(logs, gyro=None, wheels=None))
    with pytest.raises(InputError, match="one clock"):
        locate_drive(later(logs, 1e6))
    still = np.flatnonzero(logs.gnss.time_s < 4.0)
    gnss = GnssLog(logs.gnss.time_s[still], logs.gnss.xyz[still], logs.gnss.sigma_m[still])
    with pytest.raises(InputError, match="hardly moves"):
        locate_drive(replace(logs, gnss=gnss))
