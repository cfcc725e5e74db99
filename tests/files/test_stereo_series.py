"""The stereo pairs of a survey: cameras checked, images paired by time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.scenes.image_folders import camera_toml, picture, stereo_folder, write_images
from tests.scenes.places import REAL

from linework.errors import ConfigError, InputError, LineworkError
from linework.files.images.series import open_stereo, rig_of
from linework.files.survey.open import open_survey
from linework.model.images import StereoSeries

TENTHS = [round(0.1 * i, 3) for i in range(10)]
RAMP = REAL / "stereo-ramp"


def _open(folder: Path) -> StereoSeries:
    series = open_stereo(open_survey([folder]))
    assert series is not None
    return series


def test_images_of_two_lists_are_paired(tmp_path: Path) -> None:
    series = _open(stereo_folder(tmp_path, TENTHS))
    assert [pair.time_s for pair in series.pairs] == TENTHS
    assert series.pairs[3].left == tmp_path / "left/000003.png"
    assert series.pairs[3].right == tmp_path / "right/000003.png"
    assert series.warnings == () and series.unpaired == ()
    np.testing.assert_array_equal(series.rig.right.position_m, [1.0, -0.25, 2.0])


def test_a_survey_without_cameras_has_no_series(tmp_path: Path) -> None:
    (tmp_path / "survey.toml").write_text('crs = "local"\n')
    assert open_stereo(open_survey([tmp_path])) is None


def test_a_missing_frame_shifts_no_pair(tmp_path: Path) -> None:
    folder = stereo_folder(tmp_path, TENTHS)
    rows = (folder / "right.csv").read_text().splitlines()
    (folder / "right.csv").write_text("\n".join(rows[:4] + rows[5:]) + "\n")
    series = _open(folder)
    assert all(pair.left.name == pair.right.name for pair in series.pairs) and len(series.pairs) == 9
    assert series.unpaired == (folder / "left/000003.png",)
    assert series.warnings == (
        "cameras.left: 1 of 10 images are in no pair (none of the other camera within 0.050 s): 000003.png",
    )


def test_cameras_stamped_apart_are_told(tmp_path: Path) -> None:
    series = _open(stereo_folder(tmp_path, TENTHS, [t + 0.004 for t in TENTHS]))
    assert len(series.pairs) == 10
    assert "up to 4.0 ms apart" in series.warnings[0]


def test_a_clock_set_back_leaves_its_doubled_times_out(tmp_path: Path) -> None:
    times = [*TENTHS, *[round(0.65 + 0.1 * i, 3) for i in range(10)]]
    series = _open(stereo_folder(tmp_path, times))
    kept = [pair.time_s for pair in series.pairs]
    assert kept == sorted(kept)
    # 0.7 to 0.9 and 0.65 to 0.85 were written twice
    assert kept == [*TENTHS[:7], *[round(0.95 + 0.1 * i, 3) for i in range(7)]]
    assert all(pair.left.name == pair.right.name for pair in series.pairs)
    assert "time runs backwards 1 times, first from 0.900 to 0.650 s at 000010.png" in series.warnings[0]


def test_a_stuck_clock_counts_once(tmp_path: Path) -> None:
    series = _open(stereo_folder(tmp_path, [0.0, 0.1, 0.1, 0.1, 0.4, 0.5]))
    assert [pair.left.name for pair in series.pairs] == [f"{i:06d}.png" for i in (0, 1, 4, 5)]
    assert "2 images with a repeated time left out, first 000002.png" in series.warnings[0]


def test_a_shuffled_list_is_sorted_without_a_word(tmp_path: Path) -> None:
    folder = stereo_folder(tmp_path, TENTHS)
    head, *rows = (folder / "left.csv").read_text().splitlines()
    (folder / "left.csv").write_text("\r\n".join([head, *rows[::-1]]) + "\r\n")
    series = _open(folder)
    assert len(series.pairs) == 10 and series.warnings == ()


def test_a_pause_is_told_with_its_time(tmp_path: Path) -> None:
    series = _open(stereo_folder(tmp_path, [*TENTHS, *[t + 60.0 for t in TENTHS]]))
    assert series.warnings == ("no pair in 1 pauses, the longest of 59.100 s after 0.900 s",)
    assert len(series.pairs) == 20


@pytest.mark.parametrize(
    ("side", "changed", "told"),
    [
        ("left", {"fx": None}, "cameras.left.fx is missing"),
        ("left", {"fx": -50.0}, "cameras.left.fx is -50.0, expected a number above 0"),
        ("left", {"fy": float("nan")}, "cameras.left.fy is nan"),
        ("right", {"width": 0}, "cameras.right.width is 0"),
        ("right", {"position_m": [1.0, 0.25, 2.0]}, "base of 0.0000 m"),
        ("right", {"position_m": [1.0, 0.75, 2.0]}, "swapped"),
        ("right", {"position_m": [3.0, 0.25, 2.0]}, "not perpendicular to their view"),
        ("left", {"rotation_wxyz": [0.5, 0.5, 0.5, 0.6]}, "cameras.left.rotation_wxyz"),
        ("right", {"rotation_wxyz": [-0.5, 0.5, 0.5, -0.5]}, "differ by 180 degrees"),
        ("left", {"images": "*.png"}, "a pattern without times"),
        ("left", {"focal": 3.0}, "unknown key cameras.left.focal"),
    ],
)
def test_an_impossible_calibration_is_one_line(
    tmp_path: Path, side: str, changed: dict[str, object], told: str
) -> None:
    folder = stereo_folder(tmp_path, TENTHS[:2])
    picture(0).save(folder / "x.png")
    other = "right" if side == "left" else "left"
    (folder / "survey.toml").write_text('crs = "local"\n' + camera_toml(other) + camera_toml(side, **changed))
    with pytest.raises(ConfigError) as caught:
        _open(folder)
    assert told in str(caught.value) and "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(folder))


def test_a_rounded_quaternion_is_normalised(tmp_path: Path) -> None:
    folder = stereo_folder(tmp_path, TENTHS[:2])
    rough = camera_toml("left", rotation_wxyz=[0.502, -0.502, 0.502, -0.502])
    (folder / "survey.toml").write_text('crs = "local"\n' + rough + camera_toml("right"))
    turned = _open(folder).rig.left.R_vehicle_camera
    np.testing.assert_allclose(turned @ turned.T, np.eye(3), atol=1e-12)


def test_one_camera_alone_has_no_pairs(tmp_path: Path) -> None:
    folder = stereo_folder(tmp_path, TENTHS[:2])
    (folder / "survey.toml").write_text('crs = "local"\n' + camera_toml("left"))
    assert open_stereo(open_survey([folder])) is None
    with pytest.raises(ConfigError, match=r"cameras\.right is missing"):
        rig_of({"left": {}}, folder)


def test_a_camera_without_any_image_is_refused(tmp_path: Path) -> None:
    folder = stereo_folder(tmp_path, TENTHS)
    for path in (folder / "right").iterdir():
        path.unlink()
    with pytest.raises(InputError, match=r"cameras\.right has no image: none of its 10 files exists"):
        _open(folder)


def test_times_that_never_meet_are_refused_with_both_spans(tmp_path: Path) -> None:
    folder = stereo_folder(tmp_path, TENTHS, [t + 100.0 for t in TENTHS])
    with pytest.raises(InputError, match=r"0\.000 to 0\.900 s, cameras\.right 100\.000 to 100\.900 s"):
        _open(folder)


@pytest.mark.parametrize(
    ("times", "names", "expected"),
    [
        ("0.5\n0.6\n0.7\n", ("a0.png", "a1.png", "a2.png"), [0.5, 0.6, 0.7]),
        ("time_s\n0.5\n0.6\n", ("a0.PNG", "a1.png"), [0.5, 0.6]),
        # One image is missing: the numbers in the names are those of the lines, from 0 or from 1
        ("0.5\n0.6\n0.7\n", ("a0.png", "a2.png"), [0.5, 0.7]),
        ("0.5\n0.6\n0.7\n", ("a2.png", "a3.png"), [0.6, 0.7]),
        ("file,time_s\na1.png,0.6\na0.png,0.5\n", ("a0.png", "a1.png"), [0.5, 0.6]),
        ("1970-01-01 00:00:00.500000000\n1970-01-01 00:00:00.6\n", ("a9.png", "a10.png"), [0.5, 0.6]),
    ],
)
def test_a_pattern_takes_its_times_from_a_file(
    tmp_path: Path, times: str, names: tuple[str, ...], expected: list[float]
) -> None:
    folder = stereo_folder(tmp_path, TENTHS)
    for side in ("left", "right"):
        (folder / f"{side}_views").mkdir()
        for i, name in enumerate(names):
            picture(i).save(folder / f"{side}_views" / name, format="PNG")
    (folder / "times.txt").write_text(times)
    tables = [camera_toml(s, images=f"{s}_views/*.png", times="times.txt") for s in ("left", "right")]
    (folder / "survey.toml").write_text('crs = "local"\n' + "".join(tables))
    series = _open(folder)
    assert [pair.time_s for pair in series.pairs] == pytest.approx(expected)
    assert [pair.left.name for pair in series.pairs] == list(names)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("", "empty file"),
        ("name;time\nx;1\n", "missing columns file, time_s"),
        ("file,time_s\n", "lists no image"),
        ("file,time_s\nleft/000000.png,noon\n", "lists no image"),
        ("file,time_s\n" + "left/000000.png,1\nx\n" * 5, "line 3 and 4 other of 10 lines"),
        ("file,time_s\n" + "x" * 20_000, "longer than 10,000 characters"),
        ("file,time_s\n\0\0\n", "NUL bytes"),
    ],
)
def test_a_bad_list_is_one_line_with_its_name(tmp_path: Path, content: str, told: str) -> None:
    folder = stereo_folder(tmp_path, TENTHS)
    (folder / "left.csv").write_text(content)
    with pytest.raises(LineworkError) as caught:
        _open(folder)
    assert told in str(caught.value) and str(caught.value).startswith(str(folder / "left.csv"))
    assert "\n" not in str(caught.value)


def test_a_line_cut_off_at_the_end_of_a_list_is_told(tmp_path: Path) -> None:
    folder = stereo_folder(tmp_path, TENTHS)
    text = (folder / "left.csv").read_text()
    (folder / "left.csv").write_text(text[:-8])
    series = _open(folder)
    assert len(series.pairs) >= 9


def test_links_in_circles_and_many_names_end(tmp_path: Path) -> None:
    folder = stereo_folder(tmp_path, TENTHS[:3])
    (folder / "left" / "again").symlink_to(folder / "left")
    (folder / "left" / "._000000.png").write_bytes(b"what another system left here")
    tables = [camera_toml(s, images=f"**/{s}/*.png", rate_hz=10.0) for s in ("left", "right")]
    (folder / "survey.toml").write_text('crs = "local"\n' + "".join(tables))
    assert len(_open(folder).pairs) == 3


def test_the_same_images_for_both_cameras_are_refused(tmp_path: Path) -> None:
    folder = stereo_folder(tmp_path, TENTHS)
    write_images(folder, "left", TENTHS)
    (folder / "survey.toml").write_text(
        'crs = "local"\n' + camera_toml("left") + camera_toml("right", images="left.csv")
    )
    with pytest.raises(ConfigError, match="have the same images"):
        _open(folder)
