"""`linework locate` as a user runs it, on logs of drives of known truth."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import numpy as np
import pyproj
import pytest
from tests.scenes import gnss_files as made

from linework.files.trajectories.read import read_trajectory_content
from linework.simulation.folder import write_logs
from linework.simulation.sensors.logs import GNSS_2_CM, GYROS, GnssGrade, SensorGrades, simulate_logs
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


def errors_of(path, drive):
    """Return the horizontal errors of a trajectory [m]."""
    poses = read_trajectory_content(path).trajectory
    true = np.stack([np.interp(poses.time_s, drive.time_s, c) for c in drive.xyz.T], axis=1) + ORIGIN
    return np.hypot(*(poses.xyz - true)[:, :2].T)


@pytest.mark.parametrize("layout", ["degrees", "dms", "ecef", "baseline"])
def test_a_rover_solved_with_rtklib_is_located_as_its_csv_is(survey, linework, tmp_path, layout):
    """The fixes of the simulated rover as a .pos in each layout, in GPS time and UTC, calendar and week."""
    folder, drive = survey
    own = tmp_path / "survey"
    shutil.copytree(folder, own)
    fixes = np.loadtxt(own / "gnss.csv", delimiter=",", skiprows=1)
    back = pyproj.Transformer.from_crs("EPSG:25832", "EPSG:4326", always_xy=True)
    longitude, latitude = back.transform(fixes[:, 1], fixes[:, 2])
    # A drive at the start of week 2316; UTC is 18 s behind
    gps_s = 2316 * 604800.0 + fixes[:, 0]
    moments = np.datetime64("1980-01-06") + np.round(1e3 * (gps_s - 18.0)).astype("timedelta64[ms]")
    utc = [str(m).replace("-", "/").split("T") for m in moments]
    times = utc if layout in ("dms", "baseline") else [("2316", f"{t:.3f}") for t in fixes[:, 0]]
    places = np.column_stack([latitude, longitude, fixes[:, 3]])
    base = (places[0, 0] + 0.01, places[0, 1], 90.0)
    system = "UTC" if times is utc else "GPST"
    (own / "rover.pos").write_text(made.pos(layout, times, places, fixes[:, 4:7], base=base, system=system))
    text = (own / "survey.toml").read_text().replace("gnss.csv", "rover.pos")
    # gyro and wheels count seconds of that week
    text += '\n[heights]\ngeoid = 0.0\n[time]\nepoch = "gps_week"\nweek = 2316\n'
    (own / "survey.toml").write_text(text)
    done = linework("locate", own, "-o", tmp_path / "t.csv", "--rate-hz", 20, "--quiet")
    assert done.code == 0, done.stderr
    of_csv = linework("locate", folder, "-o", tmp_path / "csv.csv", "--rate-hz", 20, "--quiet")
    assert of_csv.code == 0
    found, expected = (read_trajectory_content(tmp_path / name).trajectory for name in ("t.csv", "csv.csv"))
    assert len(found) == len(expected)
    assert np.abs(found.xyz - expected.xyz).max() < 0.01
    assert errors_of(tmp_path / "t.csv", drive).max() < 0.3
    info = linework("info", own, "--quiet")
    assert "rover.pos: " in info.stdout
    assert ", 100% fixed" in info.stdout


def test_a_base_takes_off_what_both_receivers_are_off_by(linework, tmp_path):
    rng = np.random.default_rng(8)
    drive = long_drive(URBAN, 240.0, rng)
    grade = GnssGrade(white_m=0.1, wander_m=0.0, wander_s=1.0, rate_hz=5.0, outlier_share=0.0)
    logs = simulate_logs(drive, SensorGrades(gnss=grade, gyro=GYROS[1]), rng, origin_m=ORIGIN)

    def common(time_s):
        return 1.5 * np.sin(np.asarray(time_s)[:, None] / 150.0 + [0.0, 1.0, 2.0])

    time = np.arange(0.0, 240.0)
    place = np.array([501_000.0, 5_401_000.0, 120.0])
    base = np.column_stack([time, place + common(time) + 0.1 * rng.normal(size=(240, 3)), np.ones((240, 3))])
    gnss = replace(
        logs.gnss, xyz=logs.gnss.xyz + common(logs.gnss.time_s), sigma_m=np.ones((len(logs.gnss), 3))
    )
    (tmp_path / "s").mkdir()
    text = 'crs = "EPSG:25832+7837"\n' + write_logs(replace(logs, gnss=gnss), tmp_path / "s")
    head = (tmp_path / "s" / "gnss.csv").read_text().split("\n")[0]
    np.savetxt(tmp_path / "s" / "base.csv", base, delimiter=",", fmt="%.4f", header=head, comments="")
    errors = []
    for keys in ("", '[gnss]\nbase = "base.csv"\nbase_m = [501000.0, 5401000.0, 120.0]\n'):
        (tmp_path / "s" / "survey.toml").write_text(text + keys)
        done = linework("locate", tmp_path / "s", "-o", tmp_path / "t.csv", "--json", "--overwrite")
        assert done.code == 0, done.stderr
        errors.append(np.sqrt(np.mean(errors_of(tmp_path / "t.csv", drive) ** 2)))
    assert errors[0] > 5.0 * errors[1], errors
    assert errors[1] < 0.25, errors
    assert "differences to the base base.csv: approximate" in done.stderr
