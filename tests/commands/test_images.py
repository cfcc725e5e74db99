"""Surveys with images on the command line: info, photolog, and what is wrong with them in one line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.scenes.image_folders import camera_toml, stereo_folder, write_images
from tests.scenes.kitti_folders import write_drive, write_sequence
from tests.scenes.places import REAL

from linework.files.trajectories.read import write_trajectory
from linework.model.trajectory import Trajectory

RAMP = REAL / "stereo-ramp"
TIMES = [round(0.05 + 0.1 * i, 3) for i in range(8)]
MORE = '[trajectory]\nfile = "trajectory.csv"\n[events]\nfile = "events.csv"\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a survey folder: a van that drives east at 10 m/s with eight pairs and two keys."""
    stereo_folder(tmp_path / "drive", TIMES, more=MORE)
    time = np.arange(11) / 10.0
    xyz = np.stack([500_000.0 + 10.0 * time, np.full(11, 5_400_000.0), np.full(11, 100.0)], axis=1)
    write_trajectory(
        Trajectory(time, xyz, np.tile([0.0, 0.0, 90.0], (11, 1))), tmp_path / "drive/trajectory.csv"
    )
    (tmp_path / "drive/events.csv").write_text("time_s,key,note\n0.2,m,manhole\n0.7,s,sign\n")
    return tmp_path / "drive"


def _document(linework: Callable[..., Any], folder: Path) -> dict[str, Any]:
    found = linework("info", folder, "--json")
    assert found.code == 0, found.stderr
    document: dict[str, Any] = json.loads(found.stdout)
    return document


def test_info_tells_cameras_pairs_and_logs_without_points(linework: Any, folder: Path) -> None:
    document = _document(linework, folder)
    assert document["points"] == 0 and document["files"] == []
    cameras = document["cameras"]
    assert (cameras["pairs"], cameras["base_m"], cameras["rate_hz"]) == (8, 0.5, 10.0)
    assert cameras["left"]["focal_px"] == 50.0 and cameras["unpaired_images"] == 0
    assert document["logs"]["events"] == {
        "file": "events.csv", "rows": 2, "start_s": 0.2, "end_s": 0.7, "rate_hz": 2.0, "longest_pause_s": 0.5,
    }  # fmt: skip
    assert document["trajectory"]["length_m"] == 10.0


def test_info_has_a_line_for_every_fact(linework: Any, folder: Path) -> None:
    (folder / "right/000002.png").unlink()
    rows = (folder / "right.csv").read_text().splitlines()
    (folder / "right.csv").write_text("\n".join(rows[:3] + rows[4:]) + "\n")
    found = linework("info", folder)
    assert found.code == 0, found.stderr
    heads = [line.split("  ")[0] for line in found.stdout.splitlines()]
    assert heads == ["survey", "CRS", "points", "trajectory", "camera", "camera", "pairs", "events"]
    assert "7, baseline 0.500 m, 0.050 to 0.750 s, 10 Hz, 1 unpaired images" in found.stdout
    assert "warning: cameras.left: 1 of 8 images are in no pair" in found.stderr


@pytest.mark.parametrize("write", [write_sequence, write_drive])
def test_info_reads_kitti_folders(linework: Any, tmp_path: Path, write: Callable[[Path], Path]) -> None:
    document = _document(linework, write(tmp_path / "drive"))
    assert document["cameras"]["pairs"] == 6 and document["cameras"]["base_m"] == 0.54
    assert document["trajectory"]["has_attitude"] and document["trajectory"]["mean_speed_mps"] > 9.9


def test_info_tells_a_bad_calibration_and_the_rest(linework: Any, folder: Path) -> None:
    (folder / "survey.toml").write_text(
        'crs = "local"\n' + MORE + camera_toml("left", fx=-50.0) + camera_toml("right")
    )
    found = linework("info", folder)
    assert found.code == 4
    assert "events" in found.stdout and "trajectory" in found.stdout
    assert "1 part of the survey cannot be used" in found.line and "cameras.left.fx is -50.0" in found.line


def test_info_of_nothing_but_a_bad_camera_is_bad_input(linework: Any, tmp_path: Path) -> None:
    folder = stereo_folder(tmp_path, TIMES)
    (folder / "left.csv").unlink()
    found = linework("info", folder)
    assert found.code == 3 and "left.csv: cannot be opened" in found.line


def test_a_page_of_the_drive(linework: Any, folder: Path, tmp_path: Path) -> None:
    page = tmp_path / "out/log.html"
    found = linework("photolog", folder, "-o", page, "--every-m", 2, "--quiet")
    assert found.code == 0 and found.stderr == "", found.stderr
    assert found.stdout == f"{page}: 4 images, 2 keys\n"
    text = page.read_text()
    assert text.count("data:image/jpeg") == 4 and "manhole" in text and "./../drive/left/000000.png" in text
    assert linework("photolog", folder, "-o", page).code == 6
    assert linework("photolog", folder, "-o", page, "--overwrite").code == 0


def test_an_image_cut_off_leaves_a_gap_in_the_page(linework: Any, folder: Path, tmp_path: Path) -> None:
    image = folder / "left/000002.png"
    image.write_bytes(image.read_bytes()[:300])
    found = linework("photolog", folder, "-o", tmp_path / "log.html", "--every-m", 1)
    assert found.code == 4 and "1 of 8 images cannot be read" in found.line and str(image) in found.line
    assert (tmp_path / "log.html").read_text().count("data:image/jpeg") == 7


@pytest.mark.parametrize(
    ("more", "code", "told"),
    [
        ('crs = "local"\n', 3, "neither images nor operator keys"),
        ('crs = "local"\n[events]\nfile = "events.csv"\n', 3, "no trajectory"),
        ('crs = "local"\n' + MORE + "[cameras]\nmiddle = 1\n", 2, "cameras.middle"),
        ('crs = "local"\n' + MORE.replace("events.csv", "none.csv"), 3, "none.csv: cannot be opened"),
    ],
)
def test_what_has_no_page_is_one_line(
    linework: Any, folder: Path, tmp_path: Path, more: str, code: int, told: str
) -> None:
    (folder / "survey.toml").write_text(more)
    found = linework("photolog", folder, "-o", tmp_path / "log.html")
    assert found.code == code and told in found.line
    assert not (tmp_path / "log.html").exists()


def test_a_page_has_to_be_html(linework: Any, folder: Path, tmp_path: Path) -> None:
    found = linework("photolog", folder, "-o", tmp_path / "log.pdf")
    assert found.code == 2 and "Use .html" in found.line


@pytest.mark.skipif(not RAMP.is_dir(), reason="needs ../shared/data")
def test_the_real_ramp(linework: Any, tmp_path: Path) -> None:
    document = _document(linework, RAMP)
    assert document["cameras"]["pairs"] == 51 and document["trajectory"]["length_m"] == 51.74
    # Rectified by its makers; 0.1 to 0.6 pixels remain
    assert 0.1 < document["cameras"]["row_error_px"] < 0.6
    assert "no times.txt" in document["warnings"][0]
    found = linework("photolog", RAMP, "-o", tmp_path / "log.html", "--every-m", 10)
    assert found.code == 0 and "6 images" in found.stdout
    assert (tmp_path / "log.html").stat().st_size < 100_000


def test_a_page_of_a_drive_with_logs_alone_is_located_on_the_way(linework: Any, tmp_path: Path) -> None:
    drive = tmp_path / "drive"
    made = linework(
        "simulate", "-o", drive, "--no-images", "--length-m", 40, "--points-per-m", 100, "--quiet"
    )
    assert made.code == 0, made.stderr
    text = (drive / "survey.toml").read_text().replace('[trajectory]\nfile = "trajectory.csv"\n', "")
    start = float((drive / "gnss.csv").read_text().splitlines()[1].split(",")[0])
    (drive / "events.csv").write_text(f"time_s,key\n{start + 1.0},m\n")
    (drive / "survey.toml").write_text(text + '[events]\nfile = "events.csv"\n')
    found = linework("photolog", drive, "-o", tmp_path / "log.html", "--quiet")
    assert found.code == 0 and "0 images, 1 keys" in found.stdout, found.stderr
    assert "made from the logs" in found.stderr


def _with_video(folder: Path, *, pair: bool) -> None:
    """Add a colour camera to the survey, or leave only it."""
    write_images(folder, "video", [0.1, 0.4, 0.7], ".jpg")
    text = (folder / "survey.toml").read_text()
    tables = text if pair else text[: text.index("[cameras.left]")]
    (folder / "survey.toml").write_text(tables + '[cameras.video]\nimages = "video.csv"\n')


@pytest.mark.parametrize("pair", [True, False])
def test_a_video_camera_is_described_and_shown(
    linework: Any, folder: Path, tmp_path: Path, pair: bool
) -> None:
    _with_video(folder, pair=pair)
    found = linework("info", folder)
    assert found.code == 0, found.stderr
    assert "camera      video: 3 images for the photolog, 0.100 to 0.700 s, 3.333 Hz" in found.stdout
    assert ("no stereo pairs (only video in [cameras])" in found.stderr) == (not pair)
    document = _document(linework, folder)
    assert (document["cameras"] is None) == (not pair)
    assert document["single_cameras"]["video"]["images"] == 3
    page = linework("photolog", folder, "-o", tmp_path / "log.html", "--every-m", 1, "--quiet")
    assert page.code == 0, page.stderr
    assert page.stdout.endswith("3 images, 2 keys\n")
    assert "video/000002.jpg" in (tmp_path / "log.html").read_text()


def test_one_camera_without_points_has_no_lines_and_says_what_it_is_for(linework: Any, folder: Path) -> None:
    _with_video(folder, pair=False)
    found = linework("extract", folder, "-o", folder.parent / "lines.gpkg")
    assert found.code == 3
    assert "one camera takes no stereo pairs, and there are no laser points" in found.line
    assert "linework photolog" in found.line


def test_lines_of_points_and_frames_of_one_camera(linework: Any, tmp_path: Path) -> None:
    folder = tmp_path / "s"
    made = linework(
        "simulate", "-o", folder, "--length-m", 40, "--points-per-m", 400, "--no-images", "--road", "straight"
    )
    assert made.code == 0, made.stderr
    first = np.loadtxt(folder / "trajectory.csv", delimiter=",", skiprows=1)[0, 0]
    write_images(folder, "video", [float(first + 0.1 * i) for i in range(1, 5)], ".jpg")
    with (folder / "survey.toml").open("a") as file:
        file.write('[cameras.video]\nimages = "video.csv"\n')
    found = linework("extract", folder, "-o", tmp_path / "lines.gpkg", "--features", "lane_marking")
    assert found.code == 0, found.stderr
    assert found.stderr.count("no stereo pairs (only video in [cameras]), so no lines from images") == 1
    import pyogrio

    meta, _, _, values = pyogrio.raw.read(tmp_path / "lines.gpkg", layer="photolog")
    table = dict(zip(meta["fields"], values, strict=True))
    assert table["camera"].tolist() == ["video"] * 4
    assert table["image"][0] == "video/000000.jpg"
    record = json.loads((tmp_path / "run.json").read_text())
    assert any("no stereo pairs" in text for text in record["warnings"])
