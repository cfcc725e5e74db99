"""`linework trace --image` as a user runs it: a drive round a bend, two cameras with distortion-free lenses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from tests.scenes.edge_scenes import RADIUS_M, bend, circular_poses, drive_over, pixel_of
from tests.scenes.road_images import RIG

from linework.files.vectors.read_write import read_lines
from linework.navigation.poses import attitude_deg_of

PLACE = (9.0, -1.1, 0.0)
EAST, NORTH = 500_000.0, 5_400_000.0


@pytest.fixture(scope="module")
def drive():
    return drive_over(bend, circular_poses(3))


@pytest.fixture(scope="module")
def survey(drive, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("van") / "survey"
    lists = {"left": ["file,time_s"], "right": ["file,time_s"]}
    for i in drive.numbers:
        pair = drive.source(i)
        for side, image in (("left", pair.left), ("right", pair.right)):
            path = folder / side / f"{i:06d}.png"
            path.parent.mkdir(parents=True, exist_ok=True)
            PIL.Image.fromarray(image).save(path)
            lists[side].append(f"{side}/{i:06d}.png,{drive.poses.time_s[i]:.3f}")
    for side, rows in lists.items():
        (folder / f"{side}.csv").write_text("\n".join(rows) + "\n")
    header = "time_s,easting_m,northing_m,height_m,roll_deg,pitch_deg,heading_deg"
    xyz, attitude = (
        drive.poses.xyz + np.array([EAST, NORTH, 100.0]),
        attitude_deg_of(drive.poses.R_world_vehicle),
    )
    table = np.column_stack([drive.poses.time_s, xyz, attitude])
    np.savetxt(folder / "trajectory.csv", table, fmt="%.6f", delimiter=",", header=header, comments="")
    cameras = "\n".join(
        f'[cameras.{side}]\nimages = "{side}.csv"\nmodel = "pinhole"\nwidth = {RIG.width}\nheight = {RIG.height}\n'
        f"fx = {RIG.focal_px}\nfy = {RIG.focal_px}\ncx = {RIG.cx}\ncy = {RIG.cy}\n"
        f"distortion = [0, 0, 0, 0, 0]\nposition_m = [0.0, {0.3 - shift}, 1.6]\n"
        "rotation_wxyz = [0.5, -0.5, 0.5, -0.5]"
        for side, shift in (("left", 0.0), ("right", RIG.base_m))
    )
    (folder / "survey.toml").write_text(
        f'name = "bend"\ncrs = "EPSG:25832+7837"\n[trajectory]\nfile = "trajectory.csv"\n{cameras}\n'
    )
    return folder


def pixel(drive, off_px: float = 0.0) -> str:
    _, col, row = pixel_of(drive, 1, PLACE)
    return f"{col + off_px:.1f},{row:.1f}"


def test_a_pixel_becomes_a_line_in_the_world(linework, survey, drive, tmp_path) -> None:
    out = tmp_path / "line.gpkg"
    result = linework(
        "trace", survey, "--image", "left/000001.png", "--at-px", pixel(drive), "-o", out, "--json"
    )
    assert result.code == 0, result.stderr
    said = json.loads(result.stdout)
    assert said["kind"] == "lane_marking" and said["n_pairs"] == 3 and len(said["stops"]) == 2
    line = read_lines(out)
    xyz = line.xyz - [EAST, NORTH, 100.0]
    near = line.sigma_xy_m < 0.05
    across = np.hypot(xyz[:, 0], xyz[:, 1] - RADIUS_M) - (RADIUS_M + 1.75)
    assert near.sum() > 20 and np.abs(across[near]).max() < 0.06
    assert line.source[0] == "000000.png to 000002.png" and line.method[0] == "stereo"


def test_nothing_there_names_the_nearest_pixel(linework, survey, drive, tmp_path) -> None:
    out = tmp_path / "line.gpkg"
    where = ("--image", "000001.png")
    asked = linework("trace", survey, *where, "--at-px", pixel(drive, 25.0), "-o", out)
    assert asked.code == 3 and "could be 2 images" in asked.stderr
    where = ("--image", "left/000001.png")
    refused = linework("trace", survey, *where, "--at-px", pixel(drive, 25.0), "-o", out)
    assert refused.code == 3 and "no edge within 4 pixels" in refused.stderr and not out.exists()
    works = refused.stderr.rsplit("pick ", 1)[1].strip().rstrip(".")
    assert linework("trace", survey, *where, "--at-px", works, "-o", out).code == 0


@pytest.mark.parametrize(
    ("options", "code", "told"),
    [
        (("--image", "left/000099.png", "--at-px", "10,150"), 3, "in none of the 3 stereo pairs"),
        (("--image", "left/000001.png", "--at-px", "600,150"), 2, "columns are 0 to 599, rows 0 to 189"),
        (("--image", "left/000001.png", "--at-px", "300,5"), 3, "horizon"),
        (("--image", "left/000001.png", "--at-px", "left"), 2, "is not a pixel"),
        (("--image", "left/000001.png"), 2, "--at-px COL,ROW is missing"),
        (
            ("--image", "left/000001.png", "--at-px", "1,1", "--config", "a.toml"),
            2,
            "--config: only valid with --at",
        ),
        (("--at-px", "300,150"), 2, "--image FILE is missing"),
        (
            ("--image", "left/000001.png", "--at-px", "300,150", "--at", "1,2"),
            2,
            "both a position and a pixel",
        ),
        (("--image", "left/000001.png", "--at-px", "300,150", "--feature", "cable"), 2, "cannot be picked"),
        ((), 2, "no place and no pixel"),
    ],
)
def test_what_cannot_be_picked_is_one_line(linework, survey, tmp_path, options, code, told) -> None:
    result = linework("trace", survey, *options, "-o", tmp_path / "line.gpkg", "--quiet")
    assert result.code == code, result.stderr
    assert told.lower() in result.stderr.lower() and result.stderr.count("\n") == 1
