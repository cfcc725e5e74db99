"""`linework info`: what a survey holds, for people and for programs."""

from __future__ import annotations

import json

import numpy as np
import pytest
from tests.conftest import CRS, road_points

from linework.files.las.write import write_las
from linework.files.trajectories.read import write_trajectory
from linework.model.points import Points
from linework.model.trajectory import Trajectory
from linework.runs.opened.statistics import densities_per_m2


@pytest.fixture
def driven(tmp_path):
    """Return a survey folder: a profile scanner at 100 Hz on a van at 10 m/s, off for 5 s."""
    turns, per_turn = 600, 40
    angle = np.linspace(-1.2, 1.2, per_turn)
    turn_s = 3.0e8 + np.arange(turns) / 100 + np.where(np.arange(turns) >= 400, 5.0, 0.0)
    times = (turn_s[:, None] + np.linspace(0, 0.002, per_turn)).ravel()
    east = 500_000.0 + 10 * (times - 3.0e8)
    xyz = np.stack([east, np.tile(5_400_000 + 2 * np.tan(angle), turns), np.full(len(east), 100.0)], axis=1)
    intensity = np.tile(np.linspace(5, 250, per_turn), turns).astype(np.float32)
    write_las(Points(xyz, intensity=intensity, time_s=times), tmp_path / "points" / "a.laz", crs=CRS)
    at_s = np.arange(0.0, 13.0, 1.0)
    path = np.stack([500_000 + 10 * at_s, np.full(13, 5_400_000.0), np.full(13, 100.0)], axis=1)
    write_trajectory(Trajectory(3.0e8 + at_s, path), tmp_path / "trajectory.csv")
    (tmp_path / "survey.toml").write_text(
        f'name = "two stretches"\ncrs = "{CRS}"\n[points]\nfiles = ["points/*.laz"]\n'
        '[trajectory]\nfile = "trajectory.csv"\n'
    )
    return tmp_path


def test_the_document_says_all_there_is(linework, driven):
    found = linework("info", driven, "--json", "--quiet")
    assert found.code == 0, found.stderr
    document = json.loads(found.stdout)
    assert document["name"] == "two stretches"
    assert document["crs"]["compound"]
    assert document["points"] == 24_000
    assert document["files"][0]["version"] == "1.4"
    assert document["files"][0]["columns"][:2] == ["classification", "return_number"]
    assert document["scan_line_spacing_m"] == pytest.approx(0.1, abs=0.005)
    assert document["intensity"] | {"median": 0} == {"lowest": 5, "median": 0, "highest": 250, "bits": 8}
    assert document["time"]["n_gaps"] == 1
    gap = document["time"]["gaps"][0]
    assert gap["end_s"] - gap["start_s"] == pytest.approx(5.0, abs=0.02)
    assert document["trajectory"]["length_m"] == 120.0
    assert document["trajectory"]["mean_speed_mps"] == 10.0
    assert document["extent_m"]["west"] == pytest.approx(500_000.0)


def test_for_people_every_fact_has_a_line(linework, driven):
    found = linework("info", driven)
    assert found.code == 0, found.stderr
    heads = [line.split("  ")[0] for line in found.stdout.splitlines()]
    assert heads == [
        "survey", "CRS", "file", "points", "extent", "height", "density", "scan lines", "intensity", "time", "",
        "columns", "trajectory",
    ]  # fmt: skip
    assert "36 km/h" in found.stdout
    assert "columns     classification, return_number, number_of_returns, user_data" in found.stdout


def test_what_is_missing_is_said(linework, las_file):
    found = linework("info", las_file)
    assert "trajectory  none" in found.stdout
    assert linework("info", las_file, "--json", "--quiet").stderr == ""


def test_intensity_of_eight_bits_in_a_sixteen_bit_field(linework, tmp_path):
    points = road_points()
    shifted = Points(points.xyz, intensity=np.floor(points.intensity / 16) * 257, time_s=points.time_s)
    write_las(shifted, tmp_path / "a.laz", crs=CRS)
    assert json.loads(linework("info", tmp_path / "a.laz", "--json").stdout)["intensity"]["bits"] == 8


def test_a_damaged_file_is_listed_and_the_rest_described(linework, las_file):
    las_file.with_name("b.laz").write_bytes(b"LASF")
    found = linework("info", las_file.parent, "--json")
    assert found.code == 4
    assert "1 of 2 files left out" in found.line
    document = json.loads(found.stdout)
    assert document["points"] == 400
    assert len(document["failures"]) == 1


def test_densities_add_up_to_the_points():
    rng = np.random.default_rng(5)
    xyz = rng.uniform(-50, 50, (5000, 3)) + np.array([1000.5, -3.25, 0])
    assert densities_per_m2(Points(xyz)).sum() == 5000
