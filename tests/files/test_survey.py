"""Surveys: files, folders, survey.toml; what is left out is counted and said."""

import os
import shutil
from pathlib import Path

import numpy as np
import pyproj
import pytest
from tests.scenes.places import REAL

from linework.crs import parse_crs
from linework.errors import ConfigError, CrsError, InputError, UsageError
from linework.files.images.single import open_single_cameras
from linework.files.las.write import write_las
from linework.files.store.in_memory import check_trajectory_covers, read_survey_points
from linework.files.survey.open import open_survey
from linework.files.trajectories.of_survey import read_survey_trajectory_content
from linework.files.trajectories.read import write_trajectory
from linework.model.points import Points
from linework.model.trajectory import Trajectory

UTM = "EPSG:25832+7837"


def points(seed=1, n=500, *, east=500_000.0, time=3e8, intensity=True):
    rng = np.random.default_rng(seed)
    xyz = np.round(rng.uniform(0, 40, (n, 3)) + np.array([east, 5400000, 100]), 3)
    light = rng.integers(1, 4000, n).astype(np.float32) if intensity else None
    return Points(xyz, intensity=light, time_s=None if time is None else time + np.arange(n) * 0.001)


def sorted_rows(points, *, factor=1.0):
    """East, north, up, intensity and time of the points on the store's lattice, in an order of their own."""
    rows = np.column_stack([np.round(points.xyz * factor, 4), points.intensity, points.time_s])
    return rows[np.lexsort(rows.T)]


@pytest.fixture
def folder(tmp_path):
    for i, name in enumerate(("b.laz", "a.laz", "c.LAS")):
        write_las(points(i), tmp_path / "drive" / name, crs=UTM)
    (tmp_path / "drive" / "notes.txt").write_text("not a laser file")
    return tmp_path / "drive"


def test_folder(folder):
    survey = open_survey([folder])
    assert [p.name for p in survey.point_files] == ["a.laz", "b.laz", "c.LAS"]
    assert survey.name == "drive"
    assert survey.crs == parse_crs(UTM)
    read = read_survey_points(survey)
    assert len(read.points) == 1500
    expected = np.concatenate([sorted_rows(points(i)) for i in range(3)])
    np.testing.assert_allclose(sorted_rows(read.points), expected[np.lexsort(expected.T)], rtol=0, atol=1e-6)
    assert [f.n_points for f in read.files] == [500, 500, 500]
    assert (read.rejected, read.warnings, read.failures, read.gps_time_kind) == ({}, (), (), "adjusted")


def test_hidden_files_are_not_the_surveys(folder):
    (folder / "._a.laz").write_bytes(b"what another system keeps beside a file")
    assert [p.name for p in open_survey([folder]).point_files] == ["a.laz", "b.laz", "c.LAS"]


def test_laser_files_in_folders_below_are_named(folder):
    assert open_survey([folder]).warnings == ()
    write_las(points(7), folder / "pass 2" / "d.laz", crs=UTM)
    (folder / "empty").mkdir()
    survey = open_survey([folder])
    assert len(survey.point_files) == 3
    (warning,) = survey.warnings
    assert (
        warning
        == f"{folder}: 1 laser files in folders below it are not read (pass 2); name those folders too"
    )


def test_what_is_no_file_does_not_stop_the_others(folder):
    (folder / "folder.laz").mkdir()
    (folder / "gone.laz").symlink_to(folder / "nowhere.laz")
    (folder / "loop.laz").symlink_to(folder / "loop.laz")
    os.mkfifo(folder / "pipe.laz")
    read = read_survey_points(open_survey([folder]))
    assert len(read.points) == 1500
    (gone, loop, pipe) = (text.removeprefix(f"{path}: ") for path, text in read.failures)
    assert gone.startswith("cannot be opened")
    assert "No such file" in gone
    assert loop.startswith("cannot be opened")
    assert "Too many levels of symbolic links" in loop
    assert pipe == "is not a regular file. Name a file on a disk."


def test_files_in_any_order_and_twice_are_one_survey(folder):
    files = [folder / "c.LAS", folder / "a.laz", folder / "a.laz"]
    (folder / "link.laz").symlink_to(folder / "a.laz")
    survey = open_survey([*files, folder / "link.laz"])
    assert [p.name for p in survey.point_files] == ["a.laz", "c.LAS"]


def test_the_same_bytes_under_two_names_are_read_once(folder):
    shutil.copy(folder / "a.laz", folder / "copy.laz")
    read = read_survey_points(open_survey([folder]))
    assert len(read.points) == 1500
    assert read.warnings == ("copy.laz: the same bytes as a.laz, left out",)


def test_progress_runs_over_all_files(folder):
    seen = []
    read_survey_points(open_survey([folder]), progress=lambda done, _: seen.append(done))
    assert seen == sorted(seen)
    assert seen[-1] == 1500


def test_damaged_file_among_good_ones_is_listed(folder):
    data = (folder / "b.laz").read_bytes()
    (folder / "b.laz").write_bytes(data[:2000])
    read = read_survey_points(open_survey([folder]))
    assert len(read.points) == 1000
    ((path, message),) = read.failures
    assert path == folder / "b.laz"
    assert message.startswith(f"{path}: ")


def test_all_damaged(folder):
    for path in folder.glob("*.[lL]*"):
        path.write_bytes(b"LASF")
    with pytest.raises(InputError, match=r"a\.laz: cut off inside the header"):
        open_survey([folder])


def test_file_without_points_is_no_failure(folder):
    write_las(points(n=0), folder / "empty.laz", crs=UTM)
    read = read_survey_points(open_survey([folder]))
    assert len(read.points) == 1500
    assert read.failures == ()
    assert read.warnings == ("empty.laz: no points (0 in the header), left out",)


def test_no_points_at_all(tmp_path):
    write_las(points(n=0), tmp_path / "empty.laz", crs=UTM)
    with pytest.raises(InputError, match="no points"):
        read_survey_points(open_survey([tmp_path]))


def test_a_survey_is_named_by_paths_of_any_form(folder, monkeypatch):
    names = {"a.laz", "b.laz"}
    monkeypatch.chdir(folder.parent)
    for src in (
        str(folder / "*.laz"),
        folder / "[ab].laz",
        f"{folder.name}/*.laz",
        "**/?.laz",
        [str(folder / "a.laz"), folder / "b.laz"],
        iter([folder / "*.laz"]),
        (folder / "b.laz", str(folder / "*.l*z")),
    ):
        assert {path.name for path in open_survey(src).point_files} == names
    assert len(open_survey(str(folder)).point_files) == len(open_survey(folder).point_files) == 3
    assert open_survey(folder / "a.laz").name == "a"
    assert len(open_survey(f"{folder.parent}/*").point_files) == 3  # a pattern may match the folder


def test_a_name_with_brackets_is_not_a_pattern_where_it_exists(tmp_path):
    write_las(points(), tmp_path / "drive [1].laz", crs=UTM)
    assert open_survey(tmp_path / "drive [1].laz").point_files == (tmp_path / "drive [1].laz",)


def test_a_pattern_that_matches_nothing_is_refused(folder):
    (folder / "notes.txt").write_text("not a laser file")
    for pattern in ("*.xyz", "*.txt", "nothing/*.laz"):
        with pytest.raises(InputError, match=r"the pattern matches no file of points and no folder"):
            open_survey(folder / pattern)


@pytest.mark.parametrize("wrong", [5, None, [None], ["", ""], "", []])
def test_what_is_not_a_path_is_refused_in_one_line(wrong):
    with pytest.raises(UsageError, match=r"Name \.las/\.laz files or a survey folder"):
        open_survey(wrong)


def test_a_survey_takes_the_crs_as_code_or_object(tmp_path):
    write_las(points(), tmp_path / "a.laz", crs="local")
    for crs in (25832, pyproj.CRS.from_epsg(25832)):
        survey = open_survey(tmp_path / "a.laz", crs=crs)
        assert survey.crs == parse_crs("EPSG:25832")
        assert len(read_survey_points(survey).points) == 500


def test_mixed_crss(folder):
    write_las(points(9), folder / "z.laz", crs="EPSG:25833+7837")
    with pytest.raises(CrsError) as caught:
        open_survey([folder])
    for words in ("1 of 4 files", "z.laz", "zone 32N", "zone 33N", "Transform them"):
        assert words in str(caught.value)


def test_a_missing_vertical_part_is_filled_in(folder):
    write_las(points(9), folder / "z.laz", crs="EPSG:25832")
    assert open_survey([folder]).crs == parse_crs(UTM)


def test_no_crs(tmp_path):
    write_las(points(), tmp_path / "a.laz", crs="local")
    with pytest.raises(CrsError, match=r"crs=\"local\""):
        open_survey([tmp_path])
    survey = open_survey([tmp_path], crs="local")
    assert survey.crs == "local"
    assert len(read_survey_points(survey).points) == 500


def test_feet_by_option(tmp_path):
    write_las(points(), tmp_path / "a.laz", crs="local")
    survey = open_survey([tmp_path], crs="EPSG:2263+6360")
    read = read_survey_points(survey)
    expected = sorted_rows(points(), factor=1200 / 3937)
    np.testing.assert_allclose(sorted_rows(read.points), expected, rtol=0, atol=1.01e-4)
    assert survey.crs == parse_crs("EPSG:32118+5703")
    assert "feet converted" in read.warnings[0]


def test_mixed_time_kinds(folder):
    write_las(points(9, time=1000.0), folder / "z.laz", crs=UTM)
    with pytest.raises(InputError, match="GPS times of 2 kinds"):
        read_survey_points(open_survey([folder]))


def test_files_without_intensity_or_time_among_others(folder):
    write_las(points(9, intensity=False, time=None), folder / "z.laz", crs=UTM)
    read = read_survey_points(open_survey([folder]))
    assert read.points.time_s is None
    assert np.count_nonzero(read.points.intensity == 0) == 500
    assert any("1 of 4 files have no intensity" in w for w in read.warnings)
    assert any("1 of 4 files have no GPS time" in w for w in read.warnings)


@pytest.mark.parametrize("far", [[1e5, 0, 0], [0, -2e6, 0], [0, 0, 1e5]])
def test_far_points_are_left_out_and_counted(tmp_path, far):
    near = points(n=5000).xyz
    write_las(Points(np.concatenate([near, near[:1] + far])), tmp_path / "a.laz", crs=UTM)
    read = read_survey_points(open_survey([tmp_path]))
    assert len(read.points) == 5000
    assert read.rejected == {"far from all others": 1}
    assert any("1 points far from all others" in w for w in read.warnings)


def test_a_long_road_with_a_tall_mast_loses_nothing(tmp_path):
    rng = np.random.default_rng(1)
    road = np.stack([np.linspace(0, 20_000, 5000), rng.uniform(0, 8, 5000), np.zeros(5000)], axis=1)
    mast = np.array([[10_000, 30, z] for z in range(0, 300, 100)] + [[500, 900, 0]])
    write_las(Points(np.concatenate([road, mast])), tmp_path / "a.laz", crs="local")
    read = read_survey_points(open_survey([tmp_path], crs="local"))
    assert len(read.points) == 5004


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("ftp://127.0.0.1:1/a.laz", "is not a file on this machine"),
        ("/vsicurl/http://host/a.laz", "is not a file on this machine"),
        ("/vsizip/a.zip/a.laz", "is not a file on this machine"),
        ("/dev/zero", "is not a regular file"),
        ("/nowhere/a.laz", "No such file"),
    ],
)
def test_inputs_that_are_no_files_here(name, words):
    with pytest.raises(InputError, match=words):
        open_survey([Path(name)])


def test_other_inputs_that_are_refused(tmp_path):
    with pytest.raises(UsageError, match="no survey"):
        open_survey([])
    with pytest.raises(InputError, match="folder without"):
        open_survey([tmp_path])
    (tmp_path / "a.txt").write_text("x")
    with pytest.raises(InputError, match="suffix"):
        open_survey([tmp_path / "a.txt"])


TOML = """
name = "ring road"
crs = "EPSG:25832+7837"
[points]
files = ["points/*.laz"]
[trajectory]
file = "trajectory.csv"
lever_m = [0, 0.5, 1.9]
[cameras.left]
images = "left.csv"
model = "pinhole"
width = 732
height = 484
fx = 820.0
fy = 820.0
cx = 365.5
cy = 241.5
distortion = [0, 0, 0, 0, 0]
position_m = [1.2, 0.6, 2.3]
rotation_wxyz = [-0.4635, 0.5340, -0.5340, 0.4635]
"""


@pytest.fixture
def described(tmp_path):
    write_las(points(), tmp_path / "points" / "1.laz", crs="local")
    (tmp_path / "survey.toml").write_text(TOML)
    time = 3e8 + np.linspace(-1, 2, 50)
    xyz = np.stack([np.linspace(499_990, 500_050, 50), np.full(50, 5_400_000.0), np.full(50, 100.0)], axis=1)
    write_trajectory(Trajectory(time, xyz), tmp_path / "trajectory.csv")
    return tmp_path


@pytest.mark.parametrize("as_file", [True, False])
def test_survey_toml(described, as_file):
    survey = open_survey([described / "survey.toml" if as_file else described])
    assert survey.name == "ring road"
    assert survey.point_files == (described / "points" / "1.laz",)
    assert survey.crs == parse_crs(UTM)
    assert survey.trajectory_lever_m == (0.0, 0.5, 1.9)
    assert survey.settings["cameras"]["left"]["fx"] == 820.0
    read, trajectory = read_survey_points(survey), read_survey_trajectory_content(survey).trajectory
    assert len(read.points) == 500
    assert check_trajectory_covers(trajectory, read.facts) == ()


def test_survey_toml_conflicts_with_the_option(described):
    with pytest.raises(CrsError, match="two different CRSs"):
        open_survey([described], crs="EPSG:25833")
    with pytest.raises(UsageError, match="1 other inputs"):
        open_survey([described, described / "points"])


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("fx = 820.0", "fx = 0", "cameras.left.fx is 0, expected a number above 0"),
        ("fx = 820.0", "fx = nan", "cameras.left.fx is nan"),
        ("fx = 820.0", "fxx = 820.0", "unknown key cameras.left.fxx"),
        ("width = 732", "width = 732.5", "expected a whole number"),
        ("width = 732", "width = true", "expected a whole number"),
        ("[points]", "[point]", "unknown key point. Known here: name, crs"),
        ('files = ["points/*.laz"]', 'files = "a.laz"', "points.files is 'a.laz', expected a list"),
        ("lever_m = [0, 0.5, 1.9]", "lever_m = [0, 1]", "expected a list of 3 finite numbers"),
        ("-0.4635, 0.5340", "0.9, 0.5340", "expected a unit quaternion (this one has length"),
        ('model = "pinhole"', 'model = "fisheye"', "expected one of pinhole"),
        ('name = "ring road"', "name = ring road", "is not TOML"),
        ('name = "ring road"', "trajectory = 3", "is not TOML"),
        ('name = "ring road"', "events = 3", "events is 3, expected a table"),
    ],
)
def test_survey_toml_with_mistakes(described, old, new, words):
    path = described / "survey.toml"
    path.write_text(TOML.replace(old, new))
    with pytest.raises(ConfigError) as caught:
        # What is wrong with the cameras is said when their images are wanted: it stops nothing else
        open_single_cameras(open_survey([described]))
    assert str(caught.value).startswith(f"{path}: ")
    assert words in str(caught.value)
    assert caught.value.advice


def test_pattern_that_matches_nothing(described):
    (described / "survey.toml").write_text(TOML.replace("points/*.laz", "pts/*.laz"))
    with pytest.raises(InputError, match="matches no file"):
        open_survey([described])


def shifted(described, *, east=0.0, time=0.0):
    survey = open_survey([described])
    t = read_survey_trajectory_content(survey).trajectory
    return Trajectory(t.time_s + time, t.xyz + np.array([east, 0, 0])), read_survey_points(survey).facts


def test_trajectory_elsewhere(described):
    with pytest.raises(InputError) as caught:
        check_trajectory_covers(*shifted(described, east=5000.0), where="trajectory.csv")
    for words in ("trajectory.csv: ", "5.0 km apart", "east 504990 to 505050", "east 500000 to 500040"):
        assert words in str(caught.value)


def test_trajectory_at_another_time(described):
    with pytest.raises(InputError, match="no common time"):
        check_trajectory_covers(*shifted(described, time=18_000.0))
    (warning,) = check_trajectory_covers(*shifted(described, time=1.25))
    assert warning.startswith(
        "50 % of the points are outside the trajectory's time (trajectory from 300000000.2 to"
    )
    assert warning.endswith("points from 300000000.0 to 300000000.5 s)")


def test_a_trajectory_in_utc(described):
    path, facts = shifted(described)
    times = np.linspace(facts.times.low_s - 0.5, facts.times.high_s + 0.5, len(path))
    utc = Trajectory(times - 18.0, path.xyz)
    with pytest.raises(
        InputError, match=r"no common time; \+18 s .* would make them fit: UTC taken for GPS time\?"
    ):
        check_trajectory_covers(utc, facts)


@pytest.mark.parametrize("size", [(60.0, 40.0, 9.0), (0.4, 0.4, 12.0), (2.0, 1.0, 150.0), (0.01, 0.01, 0.4)])
def test_small_local_surveys_are_no_degrees(tmp_path, size):
    xyz = np.random.default_rng(5).uniform(-0.5, 0.5, (500, 3)) * size
    write_las(Points(xyz), tmp_path / "a.laz", crs="local")
    assert len(read_survey_points(open_survey([tmp_path / "a.laz"], crs="local")).points) == 500


@pytest.mark.parametrize("file", ["kitti-drive0005/kitti_drive0005_154scans.laz", "av2"])
def test_real_local_surveys_are_no_degrees(file):
    path = REAL / file
    files = sorted(path.glob("*.la[sz]")) if path.is_dir() else [path]
    if not files or not files[0].exists():
        pytest.skip(f"{file} is not beside this checkout")
    assert len(read_survey_points(open_survey(files[:1], crs="local")).points) > 10_000


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ((), "2 left and 2 right images, but no survey.toml: the times of the images, the path of the vehicle, a calibration are"),
        (("calib.txt",), "2 left and 2 right images and calib.txt, but no survey.toml: the times of the images, the path of the"
         " vehicle, where the cameras are in it are missing"),
    ],
)  # fmt: skip
def test_a_folder_of_stereo_images_alone_says_what_is_missing(tmp_path, more, words):
    for name in ("left_0.png", "left_1.png", "right_0.png", "right_1.png", *more):
        (tmp_path / name).write_bytes(b"x")
    with pytest.raises(InputError, match="images") as caught:
        open_survey(tmp_path)
    assert words in str(caught.value) and "[cameras.left]" in str(caught.value)


def test_images_of_one_side_are_no_pairs(tmp_path):
    (tmp_path / "left_0.png").write_bytes(b"x")
    with pytest.raises(InputError, match="folder without points"):
        open_survey(tmp_path)
