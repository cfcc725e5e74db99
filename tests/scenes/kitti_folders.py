"""KITTI folders, made up: a raw drive and an odometry sequence."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation
from tests.scenes.image_folders import HEIGHT, WIDTH, picture

from linework.model.camera import LOOKING_AHEAD

FOCAL_PX, BASE_M = 50.0, 0.54
#: Where the reference camera really is in the vehicle frame (the inertial unit lowered to the road).
REFERENCE_M = np.array([1.08, 0.32, 1.65])
#: A little turned, as cameras are: roll, pitch, yaw of the camera itself.
TURN = Rotation.from_euler("xyz", [1.0, -2.0, 0.5], degrees=True).as_matrix()
#: The rectified frame is turned against the reference camera's own.
RECTIFYING = Rotation.from_euler("xyz", [0.3, 0.2, -0.4], degrees=True).as_matrix()


def projection(offset_m: Sequence[float], focal_px: float = FOCAL_PX) -> np.ndarray:
    """Return K [I | t] of a rectified camera whose centre is at -t."""
    K = np.array([[focal_px, 0.0, 31.5], [0.0, focal_px, 23.5], [0.0, 0.0, 1.0]])
    return np.hstack([K, (K @ np.array(offset_m))[:, None]])


def _row(name: str, values: object) -> str:
    numbers = " ".join(f"{v:.12e}" for v in np.ravel(values))
    return f"{name}: {numbers}\n" if name else f"{numbers}\n"


def write_views(folder: Path, numbers: Sequence[int], digits: int, seed: int = 0) -> None:
    """Write images with numbers for names."""
    folder.mkdir(parents=True)
    for i in numbers:
        picture(seed + i).save(folder / f"{i:0{digits}d}.png")


def write_sequence(
    folder: Path, n: int = 6, *, names: tuple[str, str] = ("image_0", "image_1"), named_rows: bool = True,
    with_times: bool = True,
) -> Path:  # fmt: skip
    """Write an odometry sequence that drives 1 m per image straight ahead, and return it."""
    for seed, name in zip((0, 100), names, strict=True):
        write_views(folder / name, range(n), 6, seed)
    rows = [projection((0, 0, 0)), projection((-BASE_M, 0, 0))]
    if named_rows:
        rows += [projection((0.06, 0, 0)), projection((0.06 - BASE_M, 0.0002, 0))]
    text = "".join(_row(f"P{i}" if named_rows else "", row) for i, row in enumerate(rows))
    (folder / "calib.txt").write_text(text)
    poses = [np.hstack([np.eye(3), [[0.0], [0.0], [float(i)]]]) for i in range(n)]
    (folder / "poses.txt").write_text("".join(_row("", pose) for pose in poses))
    if with_times:
        (folder / "times.txt").write_text("".join(f"{0.1 * i:e}\n" for i in range(n)))
    return folder


def write_calibration(folder: Path, number_of_left: int = 0) -> None:
    """Write the three calibration files of a day."""
    left, right = (f"{number_of_left + i:02d}" for i in range(2))
    T_rectified_vehicle = np.eye(4)
    R_vehicle_rectified = LOOKING_AHEAD @ TURN
    T_rectified_vehicle[:3, :3] = R_vehicle_rectified.T
    T_rectified_vehicle[:3, 3] = -R_vehicle_rectified.T @ REFERENCE_M
    lowered = np.eye(4)
    lowered[2, 3] = 0.93
    # The laser scanner stands anywhere in between
    T_velo_imu = np.eye(4)
    T_velo_imu[:3, :3] = Rotation.from_euler("z", 0.8, degrees=True).as_matrix()
    T_velo_imu[:3, 3] = (-0.81, 0.32, -0.80)
    unrectify = np.eye(4)
    unrectify[:3, :3] = RECTIFYING.T
    T_camera_velo = unrectify @ T_rectified_vehicle @ lowered @ np.linalg.inv(T_velo_imu)
    text = "calib_time: 09-Jan-2012 13:57:47\ncorner_dist: 9.95e-02\n"
    for number, x in ((left, 0.0), (right, -BASE_M)):
        text += _row(f"S_{number}", (80, 60)) + _row(f"K_{number}", projection((0, 0, 0))[:, :3])
        text += _row(f"D_{number}", (-0.3, 0.2, 0.001, 0.001, -0.1)) + _row(f"R_{number}", np.eye(3))
        text += _row(f"T_{number}", (x, 0.0, 0.0)) + _row(f"S_rect_{number}", (WIDTH, HEIGHT))
        text += _row(f"P_rect_{number}", projection((x, 0, 0)))
        text += _row(f"R_rect_{number}", RECTIFYING)
    if number_of_left:
        text += _row("R_rect_00", RECTIFYING)
    (folder / "calib_cam_to_cam.txt").write_text(text)
    for name, T in (("velo_to_cam", T_camera_velo), ("imu_to_velo", T_velo_imu)):
        text = "calib_time: 15-Mar-2012 11:37:16\n" + _row("R", T[:3, :3]) + _row("T", T[:3, 3])
        (folder / f"calib_{name}.txt").write_text(text)


def stamps(n: int, first: float = 25.0) -> str:
    """Return KITTI's timestamps, ten a second."""
    return "".join(f"2011-09-26 13:02:{first + 0.1 * i:012.9f}\n" for i in range(n))


def write_drive(folder: Path, n: int = 6, *, number_of_left: int = 0) -> Path:
    """Write a raw drive that goes east at 10 m/s, its calibration above it, and return it."""
    for i in range(2):
        camera = folder / f"image_{number_of_left + i:02d}"
        write_views(camera / "data", range(n), 10, 100 * i)
        (camera / "timestamps.txt").write_text(stamps(n))
    (folder / "oxts/data").mkdir(parents=True)
    for i in range(n + 1):
        longitude = 8.4 + i / (111_320.0 * np.cos(np.radians(49.0)))
        values = [49.0, longitude, 116.0, 0.0, 0.0, 0.0, *[0.0] * 24]
        (folder / f"oxts/data/{i:010d}.txt").write_text(" ".join(f"{v:.12f}" for v in values) + "\n")
    (folder / "oxts/timestamps.txt").write_text(stamps(n + 1, 24.95))
    write_calibration(folder.parent, number_of_left)
    return folder
