"""Trajectories that no van has driven over these points (C10 and others), through the commands and from Python."""

from __future__ import annotations

import json

import numpy as np
import pytest

import linework as lw
from linework.errors import LineworkWarning
from linework.files.las.write import write_las
from linework.model.points import Points
from linework.model.trajectory import Trajectory

#: Corner of the drive; it climbs 4 m over 200 m, so that feet and an offset are told apart.
LOW, CLIMB = np.array([500_000.0, 5_400_000.0, 120.0]), 0.02
LENGTH_M, SPEED_MPS, START_S = 200.0, 10.0, 3.0e8
HEAD = "time_s,easting_m,northing_m,height_m"
GEOID_M = 43.2


def road(seed=3, n=60_000):
    """A road 8 m wide in scan lines, with a wall on one side and branches above it."""
    rng = np.random.default_rng(seed)
    along, across = np.sort(rng.integers(0, 2000, n)) / 10.0, rng.uniform(-4, 4, n)
    up = rng.normal(0, 0.01, n)
    wall, tree = np.arange(n) % 6 == 0, np.arange(n) % 6 == 1
    across[wall], up[wall] = 4.0, rng.uniform(0, 12, np.count_nonzero(wall))
    up[tree] = rng.uniform(5, 14, np.count_nonzero(tree))
    xyz = np.column_stack([along, across, up + along * CLIMB]) + LOW
    return Points(np.round(xyz, 3), intensity=rng.integers(1, 900, n).astype(np.float32),
                  time_s=START_S + along / SPEED_MPS)  # fmt: skip


def drive(rate_hz=20.0):
    """Rows of the way along the road, from a second before the points to a second after."""
    time = np.arange(-1.0, LENGTH_M / SPEED_MPS + 1.0, 1.0 / rate_hz)
    along = time * SPEED_MPS
    wander = 0.2 * np.sin(along / 30.0)
    return np.column_stack([START_S + time, along + LOW[0], wander + LOW[1], along * CLIMB + LOW[2] + 1.9])


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("van")
    write_las(road(), folder / "a.laz", crs="EPSG:25832")
    (folder / "survey.toml").write_text('[points]\nfiles = ["a.laz"]\n[trajectory]\nfile = "t.csv"\n')
    return folder


def told(linework, folder, rows):
    """Return the warnings of `linework info` with a trajectory of these rows."""
    (folder / "t.csv").write_text(
        "\n".join([HEAD, *(",".join(map(repr, row)) for row in rows.tolist())]) + "\n"
    )
    outcome = linework("info", folder, "--json")
    assert outcome.code == 0, outcome.stderr
    # A made-up road has no mirror that turns: that is not the subject
    found = json.loads(outcome.stdout)["warnings"]
    return [text for text in found if "scan lines" not in text]


def changed(column, value, first=0, last=None):
    rows = drive()
    rows[first:last, column] += value
    return rows


@pytest.mark.parametrize("rate_hz", [1.0, 20.0, 200.0])
@pytest.mark.parametrize("above_m", [-1.9, -2.4, 0.0, 3.0])
def test_a_sound_drive_is_not_doubted(linework, made, rate_hz, above_m):
    rows = drive(rate_hz)
    rows[:, 3] += above_m
    assert told(linework, made, rows) == []


def test_a_drive_with_stops_turns_and_noise_is_not_doubted(linework, made):
    rng = np.random.default_rng(5)
    rows = drive(5.0)
    # It stops within 5 s, stands, and goes on: the time lost is taken from what follows
    time = rows[:, 0] - START_S
    along = SPEED_MPS * np.interp(time, [-1.0, 5.0, 8.0, 12.0, 21.0], [-1.0, 5.0, 7.0, 7.0, 20.5])
    rows[:, 1], rows[:, 3] = along + LOW[0], along * CLIMB + LOW[2] + 1.9
    rows[:, 1:] += rng.normal(0, [0.4, 0.4, 0.8], (len(rows), 3))
    rows = np.delete(rows, slice(60, 66), axis=0)
    assert told(linework, made, rows) == []


@pytest.mark.parametrize(("offset_m", "word"), [(GEOID_M, "above"), (-GEOID_M, "below")])
def test_heights_of_two_kinds(linework, made, offset_m, word):
    (warning,) = told(linework, made, changed(3, offset_m))
    assert warning.startswith(
        f"t.csv: the van is {offset_m + 2.0:.1f} m {word} the points along the way: ".replace("-", "")
    )
    assert "heights above the ellipsoid mixed with heights above sea level?" in warning
    assert "[heights] geoid" in warning


def test_heights_in_feet(linework, made):
    rows = drive()
    rows[:, 3] /= 0.3048
    (warning,) = told(linework, made, rows)
    assert "are the trajectory's heights in feet? Convert them to metres" in warning
    rows[:, 3] *= 0.3048**2
    (warning,) = told(linework, made, rows)
    assert "are the points' heights in feet?" in warning


def test_heights_that_nothing_explains(linework, made):
    (warning,) = told(linework, made, changed(3, 1500.0))
    assert "do they have the same vertical datum and unit? Check the heights of both" in warning


def test_heights_that_are_wrong_for_a_part_of_the_way(linework, made):
    (warning,) = told(linework, made, changed(3, 20.0, 220, 400))
    assert "the van is 22.0 m above the points at " in warning
    assert "lost fixes" not in warning


@pytest.mark.parametrize(("column", "off_m"), [(1, 25.0), (2, -300.0), (3, 43.0)])
@pytest.mark.parametrize("at", [3, 200])
def test_one_pose_beside_the_way(linework, made, column, off_m, at):
    rows = changed(column, off_m, at, at + 1)
    (warning,) = told(linework, made, rows)
    assert warning == (
        f"t.csv: the pose at {rows[at, 0]:.3f} s is {abs(off_m):,.1f} m off the way between those before and after it:"
        " a fix gone wrong? Leave its row out"
    )


def test_several_poses_beside_the_way(linework, made):
    rows = drive()
    rows[[50, 150, 300], 2] += [20.0, 90.0, -30.0]
    (warning,) = told(linework, made, rows)
    assert "90.0 m off the way" in warning
    assert "the farthest of 3 such poses" in warning


def test_a_leap(linework, made):
    (warning,) = told(linework, made, changed(2, 60.0, 200))
    assert "the van leaps 60.0 m within 0.050 s after" in warning
    assert "or two drives in one file? Cut the file there" in warning


def test_a_van_that_is_too_fast(linework, made):
    rows = drive()
    rows[:, 1] = LOW[0] + (rows[:, 1] - LOW[0]) * 30.0
    warnings = told(linework, made, rows)
    assert "t.csv: the van drives at 300 m/s: are times or lengths in another unit?" in warnings


def test_a_van_that_never_moves(linework, made):
    rows = drive()
    rows[:, 1:3] = LOW[:2] + np.array([100.0, 0.0])
    rows[:, 3] = LOW[2] + 3.9
    (warning,) = told(linework, made, rows)
    assert warning.startswith("t.csv: the van never moves: all 440 poses of 22 s lie within 0.00 m.")
    assert warning.endswith("name another file")


@pytest.mark.parametrize(("seconds", "share"), [(0.01, ""), (0.04, "0.15 %"), (0.1, "0.45 %"), (4.0, "20 %")])
def test_points_after_the_last_pose_are_said(linework, made, seconds, share):
    rows = drive(100.0)
    rows = rows[rows[:, 0] <= START_S + LENGTH_M / SPEED_MPS - seconds + 0.001]
    found = [text for text in told(linework, made, rows) if "outside the trajectory's time" in text]
    assert [text.split(" of the points")[0] for text in found] == ([share] if share else [])


def test_plan_in_feet(linework, made):
    rows = drive()
    rows[:, 1:3] /= 0.3048
    (made / "t.csv").write_text(
        "\n".join([HEAD, *(",".join(map(repr, row)) for row in rows.tolist())]) + "\n"
    )
    outcome = linework("info", made)
    assert outcome.code == 3
    assert "they meet if the trajectory is in feet" in outcome.line


@pytest.mark.parametrize("command", ["extract", "raster"])
def test_other_commands_say_it_too(linework, made, tmp_path, command):
    told(linework, made, changed(3, GEOID_M))
    more = ("--features", "guardrail") if command == "extract" else ("--cell-m", 0.5)
    outcome = linework(command, made, "-o", tmp_path / ("o.gpkg" if command == "extract" else "o"), *more)
    assert outcome.code == 0, outcome.stderr
    assert "warning: t.csv: the van is 45.2 m above the points along the way:" in outcome.stderr
    if command == "extract":
        assert "45.2 m above" in str(json.loads((tmp_path / "run.json").read_text())["warnings"])


def test_points_and_trajectory_in_memory(tmp_path):
    rows = changed(3, GEOID_M)
    points = road()
    points = Points(points.xyz, intensity=points.intensity, time_s=points.time_s, crs="local")
    path = Trajectory(rows[:, 0], rows[:, 1:])
    with pytest.warns(LineworkWarning, match="trajectory: the van is 45.2 m above the points"):
        lines = lw.extract(points, trajectory=path, kinds="guardrail", work=tmp_path / "w")
    assert any("45.2 m above" in text for text in lines.report.warnings)


def test_the_antennas_log_is_not_taken_for_the_path(linework, tmp_path):
    simulated = ("--road", "straight", "--length-m", "40", "--points-per-m", "300", "--no-images", "--quiet")
    assert linework("simulate", "-o", tmp_path / "s", *simulated).code == 0
    outcome = linework(
        "extract", tmp_path / "s", "-o", tmp_path / "a.gpkg", "--trajectory", tmp_path / "s" / "gnss.csv"
    )
    assert outcome.code == 2
    assert "--trajectory: gnss.csv is the log of the antenna, not the path of the vehicle" in outcome.stderr
    assert not (tmp_path / "a.gpkg").exists()
