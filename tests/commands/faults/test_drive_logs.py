"""Navigation logs that lie: C04 and C07 to C09 of the list of faults, through `linework locate`."""

from __future__ import annotations

import numpy as np
import pytest

from linework.files.trajectories.read import read_trajectory_content
from linework.navigation.located import NavigationConfig
from linework.simulation.folder import write_logs
from linework.simulation.sensors.logs import GNSS_2_CM, GYROS, SensorGrades, simulate_logs
from linework.simulation.sensors.long_drives import URBAN, long_drive

ORIGIN = np.array([500_000.0, 5_400_000.0, 100.0])


def made_drive(folder, seconds):
    """Write a survey folder of logs alone; return the true drive."""
    rng = np.random.default_rng(4)
    drive = long_drive(URBAN, seconds, rng)
    logs = simulate_logs(drive, SensorGrades(gnss=GNSS_2_CM, gyro=GYROS[1]), rng, origin_m=tuple(ORIGIN))
    (folder / "survey.toml").write_text('crs = "EPSG:25832+7837"\n' + write_logs(logs, folder))
    return drive


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a survey folder with the logs of a drive of 200 s, and the drive."""
    folder = tmp_path_factory.mktemp("drive")
    return folder, made_drive(folder, 200.0)


class _Logs:
    """The logs of a folder, and what `linework locate` makes of them."""

    def __init__(self, folder, drive, linework):
        self.folder, self.drive, self.linework = folder, drive, linework

    def change(self, name, change):
        """Write a log anew with other rows: `change` takes and returns (n, k) values."""
        file = self.folder / name
        head = file.read_text().splitlines()[0]
        rows = change(np.loadtxt(file, delimiter=",", skiprows=1))
        np.savetxt(file, rows, delimiter=",", fmt="%.6f", header=head, comments="")

    def located(self, *more):
        """Return the outcome, times, sigmas and distances from the truth in plan."""
        target = self.folder / "t.csv"
        outcome = self.linework("locate", self.folder, "-o", target, "--rate-hz", 10, *more)
        if not target.exists():
            return outcome, None, None, None
        poses = read_trajectory_content(target).trajectory
        true = np.stack([np.interp(poses.time_s, self.drive.time_s, c) for c in self.drive.xyz.T], axis=1)
        off = np.hypot(*(poses.xyz - true - ORIGIN)[:, :2].T)
        return outcome, poses.time_s, poses.sigma_xyz_m[:, 0], off


@pytest.fixture
def logs(made, tmp_path, linework):
    for name in ("survey.toml", "gnss.csv", "gyro.csv", "wheels.csv"):
        (tmp_path / name).write_bytes((made[0] / name).read_bytes())
    return _Logs(tmp_path, made[1], linework)


def without(first_s, last_s):
    return lambda rows: rows[(rows[:, 0] < first_s) | (rows[:, 0] > last_s)]


def test_sound_logs_need_no_warning(logs):
    outcome, _, _, off = logs.located()
    assert outcome.code == 0
    assert "warning" not in outcome.stderr
    assert off.max() < 0.3


def test_c04_a_clock_that_jumps_cuts_the_drive(logs):
    def jump(rows):
        rows[:, 0] += np.where(rows[:, 0] >= 100.0, 1.0, 0.0)
        return rows

    logs.change("gnss.csv", jump)
    outcome, time_s, _, off = logs.located()
    assert outcome.code == 0
    assert "clock jumps by +1.00 s" in outcome.stderr
    assert off[time_s < 95.0].max() < 0.3


def test_c04_a_clock_that_stands_still_counts_once(logs):
    def stand(rows):
        rows[(rows[:, 0] > 60.0) & (rows[:, 0] < 63.0), 0] = 60.0
        return rows

    logs.change("gnss.csv", stand)
    outcome, _, _, off = logs.located()
    assert outcome.code == 0
    assert "gnss.csv" in outcome.stderr
    assert "rows with a repeated time left out" in outcome.stderr
    assert off.max() < 0.5


def test_c07_ten_seconds_without_gnss_are_bridged(logs):
    logs.change("gnss.csv", without(60.0, 70.0))
    outcome, time_s, sigma, off = logs.located()
    assert outcome.code == 0
    assert "outages: 1, longest 10" in outcome.stdout
    assert np.diff(time_s).max() < 0.2
    assert sigma[np.searchsorted(time_s, 65.0)] > 1.2 * sigma[np.searchsorted(time_s, 50.0)]
    assert off.max() < 0.5


def test_c07_five_minutes_without_gnss_are_a_gap(tmp_path, linework):
    logs = _Logs(tmp_path, made_drive(tmp_path, 380.0), linework)
    logs.change("gnss.csv", without(40.0, 340.0))
    outcome, time_s, sigma, off = logs.located()
    assert outcome.code == 4
    assert "no poses from" in outcome.line
    gap = int(np.argmax(np.diff(time_s)))
    # Half of what is bridged at either end
    assert np.diff(time_s)[gap] == pytest.approx(300.0 - NavigationConfig().longest_outage_s, abs=2.0)
    assert sigma[gap] > 3.0 * sigma[np.searchsorted(time_s, 38.0)]
    assert np.all(off < np.maximum(4.0 * sigma, 0.3))


@pytest.mark.parametrize("bits", [16, 32])
def test_c08_a_counter_that_wraps(logs, bits):
    def wrap(rows):
        rows[:, 1:] = (rows[:, 1:] + 2.0**bits - 1000.0) % 2.0**bits
        return rows

    logs.change("wheels.csv", wrap)
    outcome, _, _, off = logs.located()
    assert outcome.code == 0
    assert outcome.stderr.count("wraps at") == 2
    assert off.max() < 0.3


def test_c08_a_counter_that_counts_down(logs):
    logs.change("wheels.csv", lambda rows: rows * np.array([1.0, -1.0, -1.0]))
    outcome, _, _, off = logs.located()
    assert outcome.code == 0
    assert "sign reversed" in outcome.stderr
    assert off.max() < 0.3


def test_c08_a_counter_that_is_reset(logs):
    def reset(rows):
        rows[2000:, 1:] -= rows[2000, 1:]
        return rows

    logs.change("wheels.csv", reset)
    outcome, _, _, off = logs.located()
    assert outcome.code == 0
    assert "jumps" in outcome.stderr
    assert off.max() < 0.3


def test_c08_counters_that_stand_while_the_van_moves(logs):
    def stand(rows):
        moved = np.abs(np.diff(rows[:, 1], prepend=rows[0, 1]))
        i = int(np.argmax(np.convolve(moved, np.ones(200), "valid")))
        rows[i : i + 200, 1:] = rows[i, 1:]
        rows[i + 200 :, 1:] -= rows[i + 200, 1:] - rows[i, 1:]
        return rows

    logs.change("wheels.csv", stand)
    outcome, _, _, off = logs.located()
    assert outcome.code == 0
    assert "not taken for a stop" in outcome.stderr
    assert off.max() < 0.5


@pytest.mark.parametrize(
    ("factor", "name"), [(np.pi / 180.0, "radians instead of degrees"), (-1.0, "with the wrong sign")]
)
def test_c09_a_gyro_in_another_unit_or_with_another_sign(logs, factor, name):
    logs.change("gyro.csv", lambda rows: rows * np.array([1.0, factor, *[1.0] * (rows.shape[1] - 2)]))
    outcome, _, _, off = logs.located()
    assert outcome.code == 0
    assert name in outcome.stderr
    assert off.max() < 0.3


def test_c09_a_gyro_with_a_step(logs):
    def step(rows):
        rows[:, 1] += np.where(rows[:, 0] > 100.0, 0.2, 0.0)
        return rows

    logs.change("gyro.csv", step)
    outcome, _, _, off = logs.located()
    assert outcome.code == 0
    assert "its bias jumps" in outcome.stderr
    assert off.max() < 0.5


def test_c09_a_gyro_at_its_limit(logs):
    def clip(rows):
        assert np.abs(rows[:, 1]).max() > 11.0
        rows[:, 1] = np.clip(rows[:, 1], -8.0, 8.0)
        return rows

    logs.change("gyro.csv", clip)
    outcome, _, _, off = logs.located()
    assert outcome.code == 0
    assert "saturated at 8.0 deg/s" in outcome.stderr
    assert off.max() < 0.5
