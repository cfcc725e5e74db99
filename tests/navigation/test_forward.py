"""The filter that is fed while the van drives, against the one that knows the whole drive."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from linework.model.logs import NavigationLogs
from linework.model.trajectory import Trajectory
from linework.navigation.forward import LATE_S, ForwardFilter
from linework.navigation.locate import locate_drive
from linework.simulation.folder import van_grades
from linework.simulation.sensors.logs import simulate_logs
from linework.simulation.sensors.long_drives import URBAN, long_drive

OUTAGE = (100.0, 125.0)
ORIGIN = (500000.0, 5600000.0, 100.0)


@pytest.fixture(scope="module")
def driven():
    rng = np.random.default_rng(5)
    drive = long_drive(URBAN, 200.0, rng)
    return drive, simulate_logs(drive, van_grades(), rng, outages_s=[OUTAGE], origin_m=ORIGIN)


def part(log, chosen):
    return log.take(np.flatnonzero(chosen(log.time_s)))


def arrived(log, start, step_s, late_s, hidden):
    """Return the rows of a log that arrive in an interval, those of a time left out."""
    return part(
        log,
        lambda t: (
            (t + late_s >= start) & (t + late_s < start + step_s) & ~((t > hidden[0]) & (t < hidden[1]))
        ),
    )


def fed(logs: NavigationLogs, *, step_s=0.5, late_s=0.0, hidden=(0.0, 0.0), shuffle=False):
    """Return the filter and its poses after a drive whose logs arrive in pieces."""
    none = part(logs.gnss, lambda t: t < -1.0)
    live = ForwardFilter(replace(logs, gnss=none, gyro=None, wheels=None))
    found = []
    for start in np.arange(0.0, logs.gyro.time_s[-1] + 5.0, step_s):
        pieces = {
            name: arrived(getattr(logs, name), start, step_s, late_s if name == "gnss" else 0.0, hidden)
            for name in ("gnss", "gyro", "wheels")
        }
        if shuffle:
            live.add(wheels=pieces["wheels"])
            n = len(pieces["gyro"]) // 2
            live.add(gyro=pieces["gyro"].take(slice(n, None)))
            live.add(gyro=pieces["gyro"].take(slice(0, n)))
            live.add(gnss=pieces["gnss"])
        else:
            live.add(**pieces)
        found.append(live.advance())
    return live, Trajectory.concatenate([poses for poses in found if len(poses)])


def plan_errors(drive, poses):
    true = np.stack([np.interp(poses.time_s, drive.time_s, c) for c in drive.xyz.T], axis=1) + ORIGIN
    return np.hypot(*(poses.xyz - true)[:, :2].T)


def test_it_is_as_good_as_the_forward_filter_of_the_whole_drive(driven):
    drive, logs = driven
    live, poses = fed(logs)
    whole = locate_drive(logs).forward
    inside = (poses.time_s > OUTAGE[0]) & (poses.time_s < OUTAGE[1] + 2.0)
    same = (whole.time_s > OUTAGE[0]) & (whole.time_s < OUTAGE[1] + 2.0)
    errors, expected = plan_errors(drive, poses), plan_errors(drive, whole)
    assert np.median(errors[~inside]) < 1.2 * np.median(expected[~same])
    assert errors[inside].max() < 1.5 * expected[same].max() + 0.02
    # Every moment has a pose, but for the last ones, which may change still
    assert np.diff(poses.time_s).max() < 0.021
    assert poses.time_s[0] < 1.0
    assert LATE_S <= logs.gyro.time_s[-1] - poses.time_s[-1] < LATE_S + 1.0
    assert live.n_late == 0


def test_only_the_last_seconds_are_kept(driven):
    live, _ = fed(driven[1])
    assert len(live._logs.gyro) < 30.0 * 100.0


def test_order_within_two_seconds_changes_nothing(driven):
    _, logs = driven
    _, plain = fed(logs)
    _, late = fed(logs, late_s=1.0)
    _, shuffled = fed(logs, shuffle=True)
    both = np.intersect1d(plain.time_s, late.time_s)
    a, b = (poses.xyz[np.isin(poses.time_s, both)] for poses in (plain, late))
    assert np.abs(a - b).max() < 0.30  # after the outage, fixes that come later pull later
    assert np.median(np.abs(a - b)) < 0.005
    assert np.array_equal(plain.xyz, shuffled.xyz)


def test_after_a_pause_of_all_logs_it_begins_again(driven):
    drive, logs = driven
    _, poses = fed(logs, hidden=(60.0, 80.0))
    gaps = np.flatnonzero(np.diff(poses.time_s) > 1.0)
    assert len(gaps) == 1
    assert poses.time_s[gaps[0]] < 60.0
    assert poses.time_s[gaps[0] + 1] > 80.0
    assert np.median(plan_errors(drive, poses)) < 0.05


def test_a_fix_that_comes_too_late_is_left_out_and_counted(driven):
    _, logs = driven
    live, _ = fed(logs)
    live.add(gnss=part(logs.gnss, lambda t: (t > 150.0) & (t < 151.0)))
    assert live.n_late == np.count_nonzero((logs.gnss.time_s > 150.0) & (logs.gnss.time_s < 151.0))
