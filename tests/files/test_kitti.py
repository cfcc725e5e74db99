"""KITTI folders, read as they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.scenes.image_folders import HEIGHT, WIDTH, picture
from tests.scenes.kitti_folders import (
    BASE_M,
    FOCAL_PX,
    RECTIFYING,
    REFERENCE_M,
    TURN,
    write_drive,
    write_sequence,
)
from tests.scenes.places import REAL

from linework.errors import ConfigError, InputError
from linework.files.images.read import read_pair
from linework.files.images.series import open_stereo
from linework.files.survey.open import open_survey
from linework.files.trajectories.of_survey import read_survey_trajectory_content, read_van_path
from linework.imaging.rectify import rectifier_of
from linework.model.camera import LOOKING_AHEAD
from linework.model.images import StereoSeries

RAMP = REAL / "stereo-ramp"


def _series(folder: Path) -> StereoSeries:
    series = open_stereo(open_survey([folder]))
    assert series is not None
    return series


def test_a_sequence_is_a_survey(tmp_path: Path) -> None:
    survey = open_survey([write_sequence(tmp_path / "07")])
    assert (survey.name, survey.crs, survey.point_files) == ("07", "local", ())
    assert survey.trajectory_file == tmp_path / "07/poses.txt"
    series = open_stereo(survey)
    assert series is not None and series.warnings == () and survey.warnings == ()
    assert [pair.time_s for pair in series.pairs] == pytest.approx([0.1 * i for i in range(6)])
    assert series.pairs[2].right == tmp_path / "07/image_1/000002.png"
    rig = rectifier_of(series.rig)
    assert rig.left_map is None and rig.right_map is None
    assert rig.rig.focal_px == FOCAL_PX and rig.rig.base_m == pytest.approx(BASE_M)
    np.testing.assert_allclose(rig.rig.position_m, 0.0, atol=1e-12)
    left, _ = read_pair(series.pairs[2], series.rig)
    np.testing.assert_array_equal(left, np.asarray(picture(2)))


def test_colour_cameras_stand_beside_the_grey_one_of_the_poses(tmp_path: Path) -> None:
    rig = _series(write_sequence(tmp_path / "s", names=("image_2", "image_3"))).rig
    # To the left of the reference camera, and the right one a little higher
    np.testing.assert_allclose(rig.left.position_m, [0.0, 0.06, 0.0], atol=1e-12)
    np.testing.assert_allclose(rig.right.position_m, [0.0, 0.06 - BASE_M, 0.0002], atol=1e-12)


def test_bare_rows_without_times_take_kittis_rate_and_say_so(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "s", names=("image_l", "image_r"), named_rows=False, with_times=False)
    (folder / "image_l/000003.png").unlink()
    survey = open_survey([folder])
    assert survey.warnings == (f"{folder}: no times.txt, image rate assumed to be 10 Hz (KITTI's)",)
    series = open_stereo(survey)
    assert series is not None
    # A missing image moves no other
    assert [pair.time_s for pair in series.pairs] == pytest.approx([0.0, 0.1, 0.2, 0.4, 0.5])
    assert series.unpaired == (folder / "image_r/000003.png",)


@pytest.mark.parametrize("number_of_left", [0, 2])
def test_a_raw_drive_has_its_cameras_where_the_calibration_puts_them(
    tmp_path: Path, number_of_left: int
) -> None:
    survey = open_survey(
        [write_drive(tmp_path / "2011_09_26_drive_0001_sync", number_of_left=number_of_left)]
    )
    assert survey.trajectory_lever_m == (0.0, 0.0, 0.93)
    series = open_stereo(survey)
    assert series is not None and len(series.pairs) == 6
    assert np.diff([pair.time_s for pair in series.pairs]) == pytest.approx(0.1, abs=1e-6)
    left, right = series.rig.left, series.rig.right
    assert (left.width, left.height) == (WIDTH, HEIGHT)
    np.testing.assert_allclose(left.position_m, REFERENCE_M, atol=1e-9)
    np.testing.assert_allclose(left.R_vehicle_camera, LOOKING_AHEAD @ TURN, atol=1e-9)
    np.testing.assert_allclose(
        right.position_m, REFERENCE_M + BASE_M * (LOOKING_AHEAD @ TURN)[:, 0], atol=1e-9
    )
    assert rectifier_of(series.rig).left_map is None


def test_images_that_are_not_rectified_bring_their_distortion(tmp_path: Path) -> None:
    folder = write_drive(tmp_path / "drive_extract")
    for path in folder.glob("image_0?/data/*.png"):
        picture(1, (80, 60)).save(path)
    left = _series(folder).rig.left
    assert (left.width, left.height) == (80, 60)
    assert left.distortion == pytest.approx((-0.3, 0.2, 0.001, 0.001, -0.1))
    np.testing.assert_allclose(left.position_m, REFERENCE_M, atol=1e-9)
    np.testing.assert_allclose(left.R_vehicle_camera, LOOKING_AHEAD @ TURN @ RECTIFYING, atol=1e-9)


def test_grey_cameras_are_preferred(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "s")
    for name, other in (("image_2", "image_0"), ("image_3", "image_1")):
        (folder / name).symlink_to(folder / other)
    assert _series(folder).pairs[0].left.parent.name == "image_0"


def test_a_crs_can_be_given_to_a_drive(tmp_path: Path) -> None:
    folder = write_drive(tmp_path / "drive")
    assert open_survey([folder]).crs == "local"
    assert "25832" in str(open_survey([folder], crs="EPSG:25832").settings["crs"])


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("calib.txt", None, "no calib.txt"),
        ("calib.txt", "P0: 1 2 3\n", "row P0 has 3 numbers, expected 12"),
        ("calib.txt", "P0: x y z\n", "line 1 is not a row of numbers"),
        ("calib.txt", "P0: " + "0 " * 12 + "\n", "row P0 is not the projection"),
        ("calib.txt", "Tr: " + "0 " * 12 + "\n", "has no row P0"),
        ("calib.txt", "", "empty file"),
        ("times.txt", "0\n0.1\nnoon\n", "line 3 is not a time"),
        ("times.txt", "0\n0.1\n", "2 times for 6 images of cameras.left"),
    ],
)
def test_a_bad_sequence_is_one_line_with_the_file(
    tmp_path: Path, name: str, content: str | None, told: str
) -> None:
    folder = write_sequence(tmp_path / "s")
    (folder / name).unlink()
    if content is not None:
        (folder / name).write_text(content)
    with pytest.raises(InputError) as caught:
        _series(folder)
    assert told in str(caught.value) and "\n" not in str(caught.value)
    assert str(folder) in str(caught.value)


def test_a_negative_focal_length_names_the_calibration(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "s")
    text = (folder / "calib.txt").read_text()
    (folder / "calib.txt").write_text(text.replace("P0: 5.0", "P0: -5.0"))
    with pytest.raises(ConfigError, match=r"calib\.txt: cameras\.left\.fx is -50"):
        _series(folder)


def test_a_drive_without_its_calibration_says_where_it_looked(tmp_path: Path) -> None:
    folder = write_drive(tmp_path / "drive")
    (tmp_path / "calib_imu_to_velo.txt").unlink()
    with pytest.raises(InputError, match=r"without calib_imu_to_velo\.txt, looked here and in"):
        open_survey([folder])


def test_a_drive_with_one_camera_empty_is_refused(tmp_path: Path) -> None:
    folder = write_drive(tmp_path / "drive")
    for path in (folder / "image_01/data").iterdir():
        path.unlink()
    with pytest.raises(InputError, match=r"image_01/data: no images in it"):
        open_survey([folder])


@pytest.mark.skipif(not RAMP.is_dir(), reason="needs ../shared/data")
def test_the_real_ramp() -> None:
    series = _series(RAMP)
    assert len(series.pairs) == 51 and series.warnings == ()
    rig = rectifier_of(series.rig)
    assert rig.left_map is None and rig.right_map is None
    assert rig.rig.base_m == pytest.approx(0.5372, abs=1e-4)
    left, right = read_pair(series.pairs[50], series.rig)
    assert left.shape == right.shape == (376, 1241)


def test_poses_stand_where_the_benchmark_has_them(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "sequences/07")
    (tmp_path / "poses").mkdir()
    (folder / "poses.txt").rename(tmp_path / "poses/07.txt")
    survey = open_survey([folder])
    assert survey.trajectory_file == tmp_path / "poses/07.txt"
    trajectory = read_survey_trajectory_content(survey).trajectory
    assert trajectory is not None
    np.testing.assert_allclose(trajectory.time_s, 0.1 * np.arange(6))
    np.testing.assert_allclose(trajectory.xyz[5], [5.0, 0.0, 0.0])


def test_a_drives_trajectory_is_that_of_the_vehicles_origin(tmp_path: Path) -> None:
    survey = open_survey([write_drive(tmp_path / "drive")])
    path = read_van_path(survey, open_stereo(survey))
    assert path.trajectory is not None and path.trajectory.attitude_deg is not None
    # The first pose of the inertial unit is the local origin; the road is 0.93 m below
    np.testing.assert_allclose(path.trajectory.xyz[0], [0.0, 0.0, -0.93], atol=1e-6)
    np.testing.assert_allclose(path.trajectory.attitude_deg[0], [0.0, 0.0, 90.0], atol=1e-6)
    assert path.trajectory.xyz[-1, 0] == pytest.approx(6.0, abs=0.02)
