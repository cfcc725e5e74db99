"""A survey.toml that somebody else wrote reads no file outside its folder, and no message quotes one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.conftest import CRS, road_points
from tests.scenes.image_folders import stereo_folder

import linework as lw
from linework.errors import ConfigError, LineworkError
from linework.files.images.series import open_stereo
from linework.files.las.write import write_las
from linework.files.survey.open import open_survey

SECRET = "sesame:opens:canary"
#: Every key that names a file, with the file's name for {}.
KEYS = {
    "points.files": '[points]\nfiles = ["{}"]\n',
    "trajectory.file": '[trajectory]\nfile = "{}"\n',
    "trajectory.times": '[trajectory]\nfile = "poses.txt"\ntimes = "{}"\n',
    "navigation.gnss": '[navigation]\ngnss = "{}"\n',
    "navigation.gyro": '[navigation]\ngnss = "gnss.csv"\ngyro = "{}"\n',
    "navigation.wheels": '[navigation]\ngnss = "gnss.csv"\nwheels = "{}"\n',
    "events.file": '[events]\nfile = "{}"\n',
    "heights.geoid": '[heights]\ngeoid = "{}"\n',
    "cameras.left.images": '[cameras.left]\nimages = "{}"\n',
    "cameras.left.times": '[cameras.left]\nimages = "left/*.png"\ntimes = "{}"\n',
}
COMMANDS = [
    ("info", "{survey}"),
    ("extract", "{survey}", "-o", "{out}.gpkg"),
    ("trace", "{survey}", "--at", "500010,5400000", "-o", "{out}.gpkg"),
    ("trace", "{survey}", "--image", "left/0.png", "--at-px", "1,2", "-o", "{out}.gpkg"),
    ("raster", "{survey}", "-o", "{out}"),
    ("locate", "{survey}", "-o", "{out}.csv"),
    ("photolog", "{survey}", "-o", "{out}.html"),
    ("serve", "{survey}"),
    ("calibrate", "{survey}", "-o", "{out}.toml"),
]


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    """Return a survey folder with points, beside a file that is none of its business."""
    folder = tmp_path / "drive"
    write_las(road_points(), folder / "a.laz", crs=CRS)
    (tmp_path / "secret.csv").write_text(f"{SECRET}\n{SECRET}\n", encoding="utf-8")
    return folder


def with_toml(folder: Path, text: str) -> Path:
    start = "" if "[points]" in text else '[points]\nfiles = ["a.laz"]\n'
    (folder / "survey.toml").write_text(start + text, encoding="utf-8")
    return folder


def outside_names(folder: Path) -> dict[str, str]:
    """Return the ways to name the file beside the folder, and a pattern that finds it."""
    secret = folder.parent / "secret.csv"
    (folder / "link.csv").symlink_to(secret)
    (folder / "over").symlink_to(folder.parent, target_is_directory=True)
    (folder / "deep").mkdir(exist_ok=True)
    return {
        "absolute": str(secret),
        "above": "../secret.csv",
        "above, by a way round": "deep/../../secret.csv",
        "a link": "link.csv",
        "through a link to a folder": "over/secret.csv",
        "a pattern": f"{folder.parent}/s*.csv",
        "a pattern above": "*/../../secret.csv",
    }


@pytest.mark.parametrize("key", KEYS)
def test_no_key_names_a_file_outside(drive, key):
    for way, name in outside_names(drive).items():
        with_toml(drive, KEYS[key].format(name))
        with pytest.raises(
            ConfigError, match=r"is outside the folder of this survey\.toml\. Copy it there"
        ) as error:
            open_survey(drive)
        assert f"survey.toml: {key}: '{name}'" in str(error.value), way


@pytest.mark.parametrize("words", COMMANDS, ids=lambda words: " ".join(words[:3:2]))
def test_every_command_refuses_it_and_says_what_allows_it(linework, drive, tmp_path, words):
    with_toml(drive, '[trajectory]\nfile = "../secret.csv"\n')
    named = [word.format(survey=drive, out=tmp_path / "out" / "x") for word in words]
    found = linework(*named)
    assert (found.code, found.line) == (
        2,
        f"error: {drive / 'survey.toml'}: trajectory.file: '../secret.csv' is outside the folder of this survey.toml. Copy"
        " it there, or give --allow-outside if you trust who wrote this file.",
    )


@pytest.mark.parametrize("key", [key for key in KEYS if "cameras" not in key and key != "points.files"])
def test_nothing_of_an_allowed_file_that_is_no_log_is_shown(linework, drive, tmp_path, key):
    with_toml(drive, KEYS[key].format("../secret.csv"))
    said = ""
    for words in (COMMANDS[0], *COMMANDS[5:7]):
        named = [word.format(survey=drive, out=tmp_path / "out" / "x") for word in words]
        found = linework(*named, "--allow-outside", "--quiet")
        assert "is outside" not in found.stderr
        said += found.stdout + found.stderr
    assert "secret.csv" in said or "poses.txt" in said or "gnss.csv" in said or key == "heights.geoid"
    for part in SECRET.split(":"):
        assert part not in said


def test_a_link_within_the_folder_is_no_way_out(drive):
    (drive / "also.laz").symlink_to("a.laz")
    with_toml(drive, '[points]\nfiles = ["also.laz"]\n')
    assert [path.name for path in open_survey(drive).point_files] == ["also.laz"]


def test_a_folder_may_be_reached_by_a_link(drive, tmp_path):
    with_toml(drive, "")
    (tmp_path / "mounted").symlink_to(drive, target_is_directory=True)
    assert len(open_survey(tmp_path / "mounted").point_files) == 1


def test_points_that_a_pattern_finds_may_not_be_links_out(drive, tmp_path):
    write_las(road_points(), tmp_path / "other" / "b.laz", crs=CRS)
    (drive / "b.laz").symlink_to(tmp_path / "other" / "b.laz")
    with_toml(drive, '[points]\nfiles = ["*.laz"]\n')
    with pytest.raises(ConfigError, match=r"points\.files: .*b\.laz' is outside"):
        open_survey(drive)
    assert len(open_survey(drive, allow_outside=True).point_files) == 2


def test_python_takes_the_same_word(drive, tmp_path):
    path = tmp_path / "poses.csv"
    rows = "".join(f"{3e8 + t},{500_000 + 10 * t},5400000,100\n" for t in range(5))
    path.write_text("time_s,easting_m,northing_m,height_m\n" + rows, encoding="utf-8")
    with_toml(drive, f'[time]\nepoch = "gps_adjusted"\n[trajectory]\nfile = "{path}"\n')
    for call in (
        lw.read_trajectory,
        lw.read_points,
        lw.extract,
        lw.locate,
        lambda s: lw.trace(s, (0.0, 0.0)),
    ):
        with pytest.raises(ConfigError, match="or give allow_outside=True if you trust"):
            call(drive)
    assert len(lw.read_points(drive, allow_outside=True)) == 400
    assert len(lw.read_trajectory(drive, allow_outside=True)) == 5
    with pytest.raises(LineworkError, match="allow_outside: an opened survey has its own"):
        lw.read_points(open_survey(drive, allow_outside=True), allow_outside=True)


def test_images_that_are_links_out_or_listed_there_are_refused(tmp_path):
    folder = stereo_folder(tmp_path / "drive", [0.0, 0.1, 0.2, 0.3])
    assert len(open_stereo(open_survey(folder)).pairs) > 1
    first = sorted((folder / "left").iterdir())[0]
    first.rename(tmp_path / first.name)
    first.symlink_to(tmp_path / first.name)
    with pytest.raises(ConfigError, match=r"cameras\.left\.images: .* is outside"):
        open_stereo(open_survey(folder))
    assert len(open_stereo(open_survey(folder, allow_outside=True)).pairs) > 1
    assert np.isfinite(open_stereo(open_survey(folder, allow_outside=True)).pairs[0].time_s)


@pytest.mark.parametrize("key", KEYS)
def test_a_name_as_long_as_a_book_is_refused_unprinted(drive, key):
    with_toml(drive, KEYS[key].format("a." * 50_000))
    with pytest.raises(
        ConfigError, match=f"{key} names a file with 100,000 characters, at most 4,096"
    ) as caught:
        open_survey(drive)
    assert len(str(caught.value)) < 600
