"""`linework locate` as a user runs it, on logs of drives of known truth."""

from __future__ import annotations

import json

import numpy as np
import pytest

from linework.files.trajectories.read import read_trajectory_content
from linework.simulation.folder import write_logs
from linework.simulation.sensors.logs import GNSS_2_CM, GYROS, SensorGrades, simulate_logs
from linework.simulation.sensors.long_drives import URBAN, long_drive

ORIGIN = (500_000.0, 5_400_000.0, 100.0)


def survey_of(folder, *, outages=(), seconds=120.0, seed=4):
    """Write a survey folder of logs alone; returns the true drive."""
    rng = np.random.default_rng(seed)
    drive = long_drive(URBAN, seconds, rng)
    logs = simulate_logs(
        drive, SensorGrades(gnss=GNSS_2_CM, gyro=GYROS[1]), rng, outages_s=outages, origin_m=ORIGIN
    )
    folder.mkdir(parents=True)
    (folder / "survey.toml").write_text(
        'name = "drive"\ncrs = "EPSG:25832+7837"\n' + write_logs(logs, folder)
    )
    return drive


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    folder = tmp_path_factory.mktemp("locate") / "survey"
    return folder, survey_of(folder, outages=[(60.0, 80.0)])


def test_writes_a_trajectory_with_sigmas(survey, linework, tmp_path):
    folder, drive = survey
    done = linework("locate", folder, "-o", tmp_path / "t.csv", "--rate-hz", 20, "--plot", tmp_path / "t.png")
    assert done.code == 0, done.stderr
    poses = read_trajectory_content(tmp_path / "t.csv").trajectory
    assert np.median(np.diff(poses.time_s)) == pytest.approx(0.05)
    true = np.stack([np.interp(poses.time_s, drive.time_s, c) for c in drive.xyz.T], axis=1) + ORIGIN
    off = np.hypot(*(poses.xyz - true)[:, :2].T)
    assert off.max() < 0.3
    assert np.median(off) < 0.04
    assert poses.sigma_xyz_m is not None
    assert poses.sigma_attitude_deg is not None
    assert (tmp_path / "t.png").read_bytes().startswith(b"\x89PNG")
    assert "outages: 1, longest 20" in done.stdout
    assert "wheel_scale_left" in done.stdout


def test_says_as_json_what_was_found(survey, linework, tmp_path):
    done = linework(
        "locate", survey[0], "-o", tmp_path / "t.csv", "--json", "--plot", tmp_path / "t.html", "--quiet"
    )
    found = json.loads(done.stdout)
    assert found["distance_m"] > 100.0
    assert len(found["outages_s"]) == 1
    assert found["left_out_s"] == []
    assert found["sigma_plan_largest_m"] > found["sigma_plan_median_m"] > 0.0
    assert "<table>" in (tmp_path / "t.html").read_text()


def test_same_logs_same_bytes(survey, linework, tmp_path):
    for name in ("a.csv", "b.csv"):
        assert linework("locate", survey[0], "-o", tmp_path / name).code == 0
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


def test_too_long_an_outage_is_a_gap(survey, linework, tmp_path):
    done = linework("locate", survey[0], "-o", tmp_path / "t.csv", "--longest-outage-s", 10)
    assert done.code == 4
    assert "no poses from 64.8 to 75.2 s" in done.line
    time = read_trajectory_content(tmp_path / "t.csv").trajectory.time_s
    assert np.diff(time).max() == pytest.approx(10.0, abs=0.7)


def test_refuses_in_one_line(survey, linework, tmp_path):
    folder, _ = survey
    assert linework("locate", folder, "-o", tmp_path / "t.csv", "--rate-hz", 0).code == 2
    assert linework("locate", folder, "-o", tmp_path / "t.csv", "--plot", tmp_path / "t.pdf").code == 2
    (tmp_path / "t.csv").write_text("mine")
    done = linework("locate", folder, "-o", tmp_path / "t.csv")
    assert done.code == 6
    assert (tmp_path / "t.csv").read_text() == "mine"
    text = (folder / "survey.toml").read_text().replace('gyro = "gyro.csv"\nwheels = "wheels.csv"\n', "")
    other = tmp_path / "other"
    other.mkdir()
    (other / "survey.toml").write_text(text)
    (other / "gnss.csv").write_bytes((folder / "gnss.csv").read_bytes())
    done = linework("locate", other, "-o", tmp_path / "u.csv")
    assert done.code == 3
    assert "neither a gyro nor the counts of two wheels" in done.line
    assert not (tmp_path / "u.csv").exists()
