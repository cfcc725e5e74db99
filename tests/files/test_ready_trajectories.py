"""Ready trajectories: SBET, TUM, kinds told apart, the survey's clock and heights."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.scenes import gnss_files as made
from tests.scenes.places import REAL

from linework.crs import parse_crs
from linework.errors import InputError
from linework.files.geodetic import EarthFrame
from linework.files.images.lists import read_image_list
from linework.files.logs.clock import to_survey_time
from linework.files.logs.sensors import read_navigation_logs
from linework.files.survey.open import open_survey
from linework.files.trajectories.of_survey import (
    on_clock_of,
    read_survey_trajectory_content,
    stereo_on_clock_of,
)
from linework.files.trajectories.read import (
    TrajectorySettings,
    read_trajectory_content,
    write_trajectory,
)
from linework.model.camera import Camera, StereoRig
from linework.model.images import ImagePair, StereoSeries
from linework.model.trajectory import Trajectory
from linework.navigation.lever import headings_deg

DATA = REAL
UTM = TrajectorySettings(frame=EarthFrame(crs=parse_crs("EPSG:25832")))


def sbet_rows(n=20):
    """Return a drive to true north at 11 degrees east, 46 north, 20 m/s, platform azimuth with a wander angle."""
    rows = np.zeros((n, 8))
    rows[:, 0] = 216_000 + np.arange(n) / 200
    rows[:, 1] = np.radians(46.0 + np.arange(n) * 0.1 / 111_200)
    rows[:, 2:4] = np.radians(11.0), 300.0
    rows[:, 4:] = np.radians([1.0, 2.0, 30.0, 30.0])
    return rows


def test_sbet(tmp_path):
    made.sbet(sbet_rows(), tmp_path / "a.out")
    content = read_trajectory_content(tmp_path / "a.out", UTM)
    path = content.trajectory
    assert content.epoch == "gps_week"
    assert content.warnings == ()
    np.testing.assert_allclose(np.diff(path.time_s), 0.005, atol=1e-9)
    np.testing.assert_allclose(path.xyz[:, 2], 300.0)
    # (lon - lon0) sin(lat), 9 degrees being the central meridian; the next term is 0.1 % of it
    gamma = 2.0 * np.sin(np.radians(46.0))
    np.testing.assert_allclose(path.attitude_deg[0], [1.0, 2.0, 360.0 - gamma], atol=3e-3)
    off = (headings_deg(path.xyz) - path.attitude_deg[:, 2] + 180.0) % 360.0 - 180.0
    np.testing.assert_allclose(off, 0.0, atol=1e-3)


def test_sbet_with_damage(tmp_path):
    file = tmp_path / "a.sbet"
    rows = sbet_rows(150)
    rows[7, 1] = np.nan
    made.sbet(rows, file)
    file.write_bytes(file.read_bytes()[:-36])
    content = read_trajectory_content(file, UTM)
    assert len(content.trajectory) == 148
    assert content.warnings == (
        "1 of 149 records left out, the first is record 8",
        "the last record is cut off (100 of 136 bytes)",
    )


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"x" * 100, "100 bytes, expected 136 per record of an SBET"),
        (np.random.default_rng(1).bytes(136 * 50), "no usable rows (50 records"),
        (b"", "0 bytes, expected 136 per record of an SBET"),
    ],
)
def test_what_is_no_sbet(tmp_path, data, words):
    (tmp_path / "a.out").write_bytes(data)
    with pytest.raises(InputError) as caught:
        read_trajectory_content(tmp_path / "a.out")
    assert words in str(caught.value)


def test_an_sbet_over_the_end_of_the_week_on_the_points_clock(tmp_path):
    rows = sbet_rows(400)
    rows[:, 0] = (604_799.0 + np.arange(400) / 200) % 604_800.0
    made.sbet(rows, tmp_path / "a.out")
    (tmp_path / "survey.toml").write_text('crs = "EPSG:25832"\n[trajectory]\nfile = "a.out"\n')
    survey = open_survey([tmp_path])
    content = read_survey_trajectory_content(survey)
    assert len(content.trajectory) == 400
    assert "the GPS week ends within the log, after 604799.99 s" in content.warnings[0]
    sunday = 2316 * 604_800.0 - 1e9  # adjusted
    moved = on_clock_of(content, (sunday - 0.5, sunday + 0.5), "gps_adjusted", survey)
    np.testing.assert_allclose(moved.trajectory.time_s[[0, -1]], [sunday - 1, sunday + 0.995], atol=1e-6)
    assert moved.warnings[-1] == "times are GPS seconds of the week: converted to adjusted GPS seconds"


def test_the_stated_epoch_and_week_hold(tmp_path):
    made.sbet(sbet_rows(), tmp_path / "a.out")
    text = 'crs = "EPSG:25832"\n[time]\nepoch = "unix"\nweek = 2316\n[trajectory]\nfile = "a.out"\n'
    (tmp_path / "survey.toml").write_text(text)
    content = read_survey_trajectory_content(open_survey([tmp_path]))
    assert content.epoch == "unix"
    # 2024-05-28 12:00:00 GPS is 11:59:42 UTC
    assert content.trajectory.time_s[0] == 1_716_897_582.0


def tum(folder, rotations, places, name="poses.txt"):
    quaternions = Rotation.from_matrix(rotations).as_quat()
    times = 1.7e9 + np.arange(len(places)) / 10
    np.savetxt(
        folder / name, np.column_stack([times, places, quaternions]), header="timestamp tx ty tz qx qy qz qw"
    )
    return folder / name


CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # axes: vehicle from camera


def drive():
    """Return headings, R_world_vehicle and places of a vehicle that turns right as it drives, in a world of z up."""
    headings = np.linspace(90, 150, 30)
    turn = Rotation.from_euler("Z", (90 - headings)[:, None], degrees=True).as_matrix()
    steps = np.stack([np.sin(np.radians(headings)), np.cos(np.radians(headings)), np.zeros(30)], axis=1)
    return headings, turn, np.cumsum(steps, axis=0)


@pytest.mark.parametrize("body", ["camera", "vehicle"])
@pytest.mark.parametrize("world", ["first camera", "z up"])
def test_tum(tmp_path, body, world):
    headings, turn, places = drive()
    rotations = turn @ CAMERA if body == "camera" else turn
    if world == "first camera":
        rotations, places_there = CAMERA.T @ rotations, places @ CAMERA
    else:
        places_there = places
    content = read_trajectory_content(tum(tmp_path, rotations, places_there))
    np.testing.assert_allclose(content.trajectory.xyz, places, atol=1e-9)
    np.testing.assert_allclose(content.trajectory.attitude_deg[:, 2], headings, atol=1e-6)
    np.testing.assert_allclose(content.trajectory.attitude_deg[:, :2], 0.0, atol=1e-6)
    assert content.warnings == (f"poses of a {body} (moves along its {'z' if body == 'camera' else 'x'})",)


def test_tum_that_cannot_be_used(tmp_path):
    _, turn, places = drive()
    lying = Rotation.from_euler("Y", 90, degrees=True).as_matrix()
    with pytest.raises(InputError, match=r"up is \(1\.00, 0\.00, 0\.00\) in this world"):
        read_trajectory_content(tum(tmp_path, lying @ turn, places @ lying.T))
    (tmp_path / "q.txt").write_text("1 0 0 0 0 0 0 1\n2 1 0 0 1 1 0 1\n")
    with pytest.raises(InputError, match=r"line 2 has no unit quaternion \(1 of 2 lines\)"):
        read_trajectory_content(tmp_path / "q.txt")


def test_kinds_are_told_by_content(tmp_path):
    poses = tmp_path / "00.txt"
    poses.write_text("1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 2\n")
    with pytest.raises(InputError, match="poses without times"):
        read_trajectory_content(poses)
    (tmp_path / "times.txt").write_text("0.5\n0.6\n")
    assert read_trajectory_content(poses).trajectory.time_s.tolist() == [0.5, 0.6]
    assert read_trajectory_content(poses, TrajectorySettings(rate_hz=10)).trajectory.time_s.tolist() == [
        0.0,
        0.1,
    ]
    table = tmp_path / "table.txt"
    path = Trajectory(np.arange(3.0), np.arange(9.0).reshape(3, 3))
    write_trajectory(path, table)
    np.testing.assert_array_equal(read_trajectory_content(table).trajectory.xyz, path.xyz)


@pytest.mark.skipif(not DATA.is_dir(), reason=f"no real surveys in {DATA}")
def test_a_real_trajectory_in_degrees_falls_on_its_own_coordinates(tmp_path):
    rows = np.genfromtxt(DATA / "here-a22/trajectory_utm32n.csv", delimiter=",", names=True)
    head = "time_s,latitude_deg,longitude_deg,ellipsoid_height_m,sigma_e_m,sigma_n_m,sigma_z_m\n"
    lines = [f"{i},{lat},{lon},{h},.1,.1,.1" for i, (_, _, h, lat, lon) in enumerate(rows)]
    (tmp_path / "gnss.csv").write_text(head + "\n".join(lines))
    toml = 'crs = "EPSG:32632"\n[navigation]\ngnss = "gnss.csv"\n'
    (tmp_path / "survey.toml").write_text(toml)
    xyz = read_navigation_logs(open_survey([tmp_path])).logs.gnss.xyz
    np.testing.assert_allclose(xyz, np.stack([rows["e"], rows["n"], rows["h"]], axis=1), atol=2e-3)


def test_images_get_the_trajectorys_clock(tmp_path):
    noon = to_survey_time(np.array([1_716_897_582.0]), "unix", "gps_adjusted")[0]
    path = Trajectory(noon + np.arange(10.0), np.zeros((10, 3)))
    (tmp_path / "survey.toml").write_text('crs = "local"\n')
    survey = open_survey([tmp_path])
    camera = Camera(
        width=8, height=8, fx=5.0, fy=5.0, cx=4.0, cy=4.0, distortion=(0.0,) * 5,
        position_m=np.zeros(3), R_vehicle_camera=CAMERA,
    )  # fmt: skip
    rig = StereoRig(camera, replace(camera, position_m=np.array([0.0, -1.0, 0.0])))
    unix = tuple(ImagePair(i, 1_716_897_584.0 + i, Path("l.png"), Path("r.png")) for i in range(2))
    series = stereo_on_clock_of(StereoSeries(rig, unix), path, survey)
    assert [pair.time_s - noon for pair in series.pairs] == [2.0, 3.0]
    assert series.warnings == ("cameras: times are seconds since 1970: converted to adjusted GPS seconds",)
    assert stereo_on_clock_of(series, path, survey) is series


def test_images_stamped_in_nanoseconds_or_not_at_all(tmp_path):
    stamps = [1_403_636_579_763_555_584 + i * 50_000_000 for i in range(5)]
    (tmp_path / "left.csv").write_text("file,time_s\n" + "".join(f"{t}.png,{t}\n" for t in stamps))
    images = read_image_list({"images": "left.csv"}, tmp_path, "cameras.left")
    np.testing.assert_allclose(images.time_s, 1_403_636_579.763_555_6 + np.arange(5) / 20, atol=1e-6)
    assert images.warnings == ("cameras.left: times are in nanoseconds: converted to seconds",)
    (tmp_path / "left.csv").write_text("file,time_s\n1.png,0\n2.png,0\n")
    with pytest.raises(InputError, match="all 2 times are 0"):
        read_image_list({"images": "left.csv"}, tmp_path, "cameras.left")
