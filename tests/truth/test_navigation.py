"""Drives of known truth: how near the track comes, and whether its sigmas are honest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from linework.navigation.locate import locate_drive
from linework.simulation.sensors.logs import (
    GNSS_2_CM,
    GYROS,
    SensorGrades,
    WheelGrade,
    attitude_deg,
    simulate_logs,
)
from linework.simulation.sensors.long_drives import MOTORWAY, URBAN, long_drive

OUTAGES = ((100.0, 130.0), (180.0, 240.0))
WHEELS = WheelGrade(scale_left=0.012, scale_right=-0.006)


def errors_of(drive, poses):
    """Return errors of position [m] and of roll, pitch, heading [deg] at the poses."""
    true = np.stack([np.interp(poses.time_s, drive.time_s, c) for c in drive.xyz.T], axis=1)
    turned = np.stack([np.interp(poses.time_s, drive.time_s, c) for c in attitude_deg(drive).T], axis=1)
    off = poses.attitude_deg - turned
    off[:, 2] = (off[:, 2] + 180.0) % 360.0 - 180.0
    return poses.xyz - true, off


@pytest.fixture(
    scope="module", params=[(URBAN, GNSS_2_CM, 1), (MOTORWAY, GNSS_2_CM, 2), (URBAN, GNSS_2_CM, 0)]
)
def drive(request):
    kind, gnss, gyro = request.param
    rng = np.random.default_rng([5, gyro])
    driven = long_drive(kind, 300.0, rng)
    grades = SensorGrades(gnss=gnss, gyro=GYROS[gyro], wheels=WHEELS)
    return driven, grades, locate_drive(simulate_logs(driven, grades, rng, outages_s=OUTAGES))


def test_outages_are_bridged_to_a_thousandth_of_the_way(drive):
    driven, grades, located = drive
    off = np.hypot(*errors_of(driven, located.trajectory)[0][:, :2].T)
    sigma = np.hypot(grades.gnss.white_m, grades.gnss.wander_m)
    for start, end in OUTAGES:
        inside = (located.trajectory.time_s > start) & (located.trajectory.time_s < end)
        gone = (driven.time_s > start) & (driven.time_s < end)
        way = np.sum(np.linalg.norm(np.diff(driven.xyz[gone], axis=0), axis=1))
        assert off[inside].max() <= 0.001 * way + 2.0 * sigma


@pytest.fixture(scope="module")
def turns():
    """A drive of turns of 9 m, and its path by the rear wheels, the front wheels, and these taken for rear ones."""
    driven = long_drive(
        replace(URBAN, turn_share=1.0, stop_share=0.0, turn_m=(9.0, 9.0), leg_m=(20.0, 60.0)),
        300.0,
        np.random.default_rng(6),
    )
    located = []
    for counts_front in (False, True):
        grades = SensorGrades(gnss=GNSS_2_CM, gyro=GYROS[1], wheels=WHEELS, counts_front=counts_front)
        logs = simulate_logs(driven, grades, np.random.default_rng(7), outages_s=OUTAGES)
        located.append(locate_drive(logs, rate_hz=10.0))
    return driven, *located, locate_drive(replace(logs, wheelbase_m=0.0), rate_hz=10.0)


def test_front_wheels_bridge_turns_of_9_m_as_rear_wheels_do(turns):
    driven, *located = turns
    rear, front, mistaken = ([], [], [])
    for errors, found in zip((rear, front, mistaken), located, strict=True):
        off = np.hypot(*errors_of(driven, found.trajectory)[0][:, :2].T)
        time = found.trajectory.time_s
        errors += [off[(time > start) & (time < end)].max() for start, end in OUTAGES]
    assert np.all(np.array(front) < 1.2 * np.array(rear) + 0.01)
    assert np.all(np.array(mistaken) > 3.0 * np.array(rear))


def test_sigmas_are_honest(drive):
    driven, _, located = drive
    off, turned = errors_of(driven, located.trajectory)
    plan = np.sqrt(np.mean((off / located.trajectory.sigma_xyz_m)[:, :2] ** 2))
    heading = np.sqrt(np.mean((turned / located.trajectory.sigma_attitude_deg)[:, 2] ** 2))
    # One drive is one draw of slow errors
    assert 0.4 < plan < 2.0
    assert 0.3 < heading < 2.0


def test_smoothing_helps(drive):
    driven, _, located = drive
    inside = np.zeros(len(located.trajectory), dtype=bool)
    for start, end in OUTAGES:
        inside |= (located.trajectory.time_s > start) & (located.trajectory.time_s < end)
    after, before = (
        np.sqrt(np.mean(np.sum(errors_of(driven, t)[0][inside, :2] ** 2, axis=1)))
        for t in (located.trajectory, located.forward)
    )
    assert after < 0.7 * before


def test_scales_are_found(drive):
    _, _, located = drive
    found = located.stretches[0].estimates
    for name, true in (("wheel_scale_left", WHEELS.scale_left), ("wheel_scale_right", WHEELS.scale_right)):
        value, sigma = found[name]
        assert abs(value - true) < 4.0 * sigma < 0.01


def test_outages_are_reported(drive):
    _, _, located = drive
    assert len(located.outages_s) == 2
    assert np.allclose(located.outages_s, OUTAGES, atol=1.5)
    assert len(located.left_out_s) == 0
