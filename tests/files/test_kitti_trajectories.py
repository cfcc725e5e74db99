"""Poses of KITTI's layouts: frames, signs, times, what is damaged."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.scenes.places import REAL

from linework.crs import parse_crs
from linework.errors import InputError
from linework.files.geodetic import EarthFrame
from linework.files.trajectories.kitti_poses import read_kitti_poses_content
from linework.files.trajectories.oxts import read_oxts_content
from linework.navigation.lever import headings_deg

DATA = REAL


def poses_file(folder, rotations, places):
    rows = np.concatenate([rotations, np.asarray(places)[:, :, None]], axis=2).reshape(-1, 12)
    np.savetxt(folder / "poses.txt", rows, fmt="%.6e")
    return folder / "poses.txt"


def test_a_camera_that_drives_ahead_turns_right_and_climbs(tmp_path):
    # Camera: x right, y down, z ahead. Turning right is about +y by the right hand (z goes to x)
    turn = Rotation.from_euler("y", [[0], [10], [20]], degrees=True).as_matrix()
    places = [[0, 0, 0], [0.2, -0.1, 2], [1, -0.2, 4]]  # to the right and up
    path = read_kitti_poses_content(poses_file(tmp_path, turn, places), np.array([0.0, 0.1, 0.2])).trajectory
    np.testing.assert_array_equal(path.time_s, [0, 0.1, 0.2])
    # East is ahead, right is south
    np.testing.assert_allclose(path.xyz, [[0, 0, 0], [2, -0.2, 0.1], [4, -1, 0.2]], atol=1e-6)
    np.testing.assert_allclose(path.attitude_deg, [[0, 0, 90], [0, 0, 100], [0, 0, 110]], atol=1e-4)


def test_tilts_of_the_camera(tmp_path):
    # About x (right) by the right hand: z (ahead) goes to -y (up): nose up. About z: x (right) goes to y (down)
    turn = [Rotation.from_euler(axis, 3, degrees=True).as_matrix() for axis in ("x", "z")]
    path = read_kitti_poses_content(poses_file(tmp_path, turn, np.zeros((2, 3))), np.arange(2.0)).trajectory
    np.testing.assert_allclose(path.attitude_deg, [[0, 3, 90], [3, 0, 90]], atol=1e-4)


def test_a_damaged_pose_keeps_the_times_of_the_others(tmp_path):
    file = poses_file(tmp_path, np.tile(np.eye(3), (5, 1, 1)), np.arange(15.0).reshape(5, 3))
    lines = file.read_text().splitlines()
    lines[2] = lines[2][:20]
    file.write_text("\n".join(lines))
    path = read_kitti_poses_content(file, np.arange(7.0)).trajectory
    np.testing.assert_array_equal(path.time_s, [0, 1, 3, 4])
    with pytest.raises(InputError, match="5 poses, but 4 times"):
        read_kitti_poses_content(file, np.arange(4.0))


def test_matrices_that_do_not_turn(tmp_path):
    mirrored = np.stack([np.eye(3), np.diag([1.0, 1.0, -1.0]), 2 * np.eye(3)])
    with pytest.raises(InputError, match=r"line 2 is not a rotation \(2 of 3 lines\)"):
        read_kitti_poses_content(poses_file(tmp_path, mirrored, np.zeros((3, 3))), np.arange(3.0))


@pytest.mark.skipif(not DATA.is_dir(), reason=f"no real surveys in {DATA}")
def test_the_real_slip_road_is_driven_ahead(tmp_path):
    path = read_kitti_poses_content(DATA / "stereo-ramp/poses.txt", np.arange(51) / 10).trajectory
    assert len(path) == 51
    assert abs(path.attitude_deg[0, 2] - 90.0) < 1e-3
    # A car goes where its nose points, and leans no more than a slip road does
    off = (headings_deg(path.xyz) - path.attitude_deg[:, 2] + 180.0) % 360.0 - 180.0
    assert np.abs(off).max() < 3.0
    assert np.abs(path.attitude_deg[:, :2]).max() < 8.0
    assert 35.0 < np.hypot(*(path.xyz[-1] - path.xyz[0])[:2]) < 80.0


def oxts_folder(folder, rows, times=None):
    (folder / "oxts/data").mkdir(parents=True)
    for i, row in enumerate(rows):
        cells = [*row, *np.zeros(17), 0.05, 0.02, 4, 8, 4, 4, 0]
        (folder / f"oxts/data/{i:010d}.txt").write_text(" ".join(map(str, cells)) + "\n")
    times = times or [f"2011-09-26 13:02:{25 + i // 10:02d}.{i % 10}00000123" for i in range(len(rows))]
    (folder / "oxts/timestamps.txt").write_text("\n".join(times) + "\n")
    return folder


ROWS = [[49.0, 8.43 + i * 1e-5, 112.0 + i, 0.01, -0.02, 0.5] for i in range(12)]


def test_oxts_in_a_local_frame(tmp_path):
    content = read_oxts_content(oxts_folder(tmp_path, ROWS), EarthFrame(crs="local"))
    path = content.trajectory
    np.testing.assert_array_equal(path.xyz[0], [0, 0, 0])
    # 1e-5 degrees of longitude at 49 degrees, on the parallel's circle of WGS 84
    e2 = 1 - (1 - 1 / 298.257223563) ** 2
    radius = 6378137.0 / np.sqrt(1 - e2 * np.sin(np.radians(49)) ** 2) * np.cos(np.radians(49))
    np.testing.assert_allclose(np.diff(path.xyz[:, 0]), np.radians(1e-5) * radius, rtol=1e-4)
    np.testing.assert_allclose(path.xyz[:, 2], np.arange(12), atol=1e-4)
    # Pitch is nose down positive there; yaw 0 is east and anticlockwise
    expected = [np.degrees(0.01), np.degrees(0.02), 90 - np.degrees(0.5)]
    np.testing.assert_allclose(path.attitude_deg[0], expected, atol=1e-9)
    np.testing.assert_allclose(path.sigma_xyz_m[0], [0.05, 0.05, 0.075])
    np.testing.assert_allclose(np.diff(path.time_s), 0.1, atol=1e-6)
    assert abs(path.time_s[0] - 1317042145.0) < 1e-3  # 2011-09-26 13:02:25 as UTC
    assert content.epoch == "unix"
    (said,) = content.warnings
    assert "latitude 49.0000000, longitude 8.4300000, height 112.00 m" in said


def test_oxts_on_the_grid_loses_the_convergence(tmp_path):
    folder = oxts_folder(tmp_path, ROWS)
    path = read_oxts_content(folder, EarthFrame(crs=parse_crs("EPSG:32632"))).trajectory
    # gamma = (lon - lon0) sin(lat) near the central meridian of zone 32, 9 degrees
    gamma = (8.43 - 9.0) * np.sin(np.radians(49.0))
    assert abs(path.attitude_deg[0, 2] - (90 - np.degrees(0.5) - gamma)) < 1e-3
    # Along a parallel to the east: 90 degrees from true north
    heading = np.degrees(np.arctan2(*(path.xyz[-1] - path.xyz[0])[:2]))
    assert abs(heading - (90.0 - gamma)) < 1e-2


def test_oxts_with_damage(tmp_path):
    folder = oxts_folder(tmp_path, ROWS * 10)
    (folder / "oxts/data/0000000003.txt").write_text("49.0 8.4")
    content = read_oxts_content(folder / "oxts", EarthFrame(crs="local"))
    assert len(content.trajectory) == 119
    assert content.warnings[0] == "1 of 120 files left out, the first is file 4"
    (folder / "oxts/data/0000000007.txt").unlink()
    times = read_oxts_content(
        folder, EarthFrame(crs="local")
    ).trajectory.time_s  # the files' numbers are the lines' numbers
    assert len(times) == 118
    np.testing.assert_allclose(np.diff(times)[[2, 5]], [0.2, 0.2], atol=1e-6)


def test_oxts_that_is_none(tmp_path):
    with pytest.raises(InputError, match="holds no data"):
        read_oxts_content(tmp_path, EarthFrame(crs="local"))
    folder = oxts_folder(tmp_path, ROWS, times=["2011-09-26 13:02:25.1"] * 3)
    with pytest.raises(InputError, match="12 files of data, but 3 times"):
        read_oxts_content(folder, EarthFrame(crs="local"))
