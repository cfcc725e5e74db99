"""Describe KITTI folders (a raw drive, or a sequence of the odometry benchmark) in terms of a survey.toml.

Separate from `open`, which reads any survey from its description: KITTI's folders have none, and this makes it from
their calibration files.

The vehicle frame of a raw drive is that of its inertial unit, lowered to the road; that of a sequence is the left
camera's with axes forward, left, up, because its height above the road is not stated.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.files.images.lists import find_images
from linework.files.images.read import image_size
from linework.files.logs.tables import finite_number
from linework.files.logs.text import text_lines
from linework.model.camera import LOOKING_AHEAD

#: Height of the inertial unit over the road (Geiger et al., figure 3). [m]
IMU_HEIGHT_M = 0.93
#: Image rate of all KITTI recordings. [Hz]
KITTI_RATE_HZ = 10.0
#: Camera pairs in order of preference: grey ones have no colour filter.
_RAW_PAIRS = (("00", "01"), ("02", "03"))
_SEQUENCE_PAIRS = (("image_0", "image_1"), ("image_l", "image_r"), ("image_2", "image_3"))
_CAM_TO_CAM, _VELO_TO_CAM, _IMU_TO_VELO = (
    f"calib_{name}.txt" for name in ("cam_to_cam", "velo_to_cam", "imu_to_velo")
)


@dataclass(frozen=True, slots=True)
class KittiFolder:
    """Content of a KITTI folder in the keys of a survey.toml.

    Parameters
    ----------
    settings
        Tables name, cameras and trajectory.
    calibration
        File with the calibration of the cameras.
    warnings
        What was assumed, one line each.
    """

    settings: dict[str, Any]
    calibration: Path
    warnings: tuple[str, ...] = ()


def read_kitti_folder(folder: Path) -> KittiFolder | None:
    """Describe a KITTI raw drive or odometry sequence; None where the folder is neither.

    Raises
    ------
    InputError
        The folder has the images of one, but its calibration is missing or wrong, or one camera has no images.
    """
    for left, right in _RAW_PAIRS:
        if (folder / f"image_{left}/data").is_dir() or (folder / f"image_{right}/data").is_dir():
            return _raw_drive(folder, left, right)
    for left, right in _SEQUENCE_PAIRS:
        if (folder / left).is_dir() and (folder / right).is_dir():
            return _sequence(folder, left, right)
    return None


def _raw_drive(folder: Path, left: str, right: str) -> KittiFolder:
    """Describe a raw drive; rectified images (synchronised drives) and others differ in size."""
    path = _beside_or_above(folder, _CAM_TO_CAM)
    rows = read_calibration(path)
    mount = _mount(folder, rows, path)
    cameras: dict[str, Any] = {}
    for side, number in (("left", left), ("right", right)):
        images = f"image_{number}/data"
        size = _size_of_images(folder, images)
        if f"S_{number}" in rows and size == tuple(matrix_of(rows, f"S_{number}", (2,), path).astype(int)):
            keys = original_camera(rows, number, path, mount)
        else:
            name = f"P_rect_{number}"
            P = matrix_of(rows, name, (3, 4), path)
            whole = matrix_of(rows, f"S_rect_{number}", (2,), path).astype(int)
            keys = rectified_camera(P, (int(whole[0]), int(whole[1])), name, path, mount)
        cameras[side] = {"images": f"{images}/*", "times": f"image_{number}/timestamps.txt"} | keys
    # Images and poses have time stamps of one computer
    settings: dict[str, Any] = {"time": {"epoch": "unix"}, "cameras": cameras}
    if (folder / "oxts").is_dir():
        settings["trajectory"] = {"file": "oxts", "lever_m": [0.0, 0.0, IMU_HEIGHT_M]}
    warnings = []
    if (folder / "velodyne_points").is_dir():
        warnings.append(f"{folder / 'velodyne_points'}: not read, its scans are not corrected for motion")
    return KittiFolder(settings, path, tuple(warnings))


def _mount(folder: Path, rows: dict[str, FloatArray], path: Path) -> FloatArray:
    """Return (4, 4) T_vehicle_rectified: from the rectified frame of camera 00 to the vehicle."""
    rectifying = np.eye(4)
    rectifying[:3, :3] = matrix_of(rows, "R_rect_00", (3, 3), path)
    T_rectified_imu = rectifying @ _motion(folder, _VELO_TO_CAM) @ _motion(folder, _IMU_TO_VELO)
    T_vehicle_imu = np.eye(4)
    T_vehicle_imu[2, 3] = IMU_HEIGHT_M
    return np.asarray(T_vehicle_imu @ _inverse(T_rectified_imu))


def _motion(folder: Path, name: str) -> FloatArray:
    """Return the (4, 4) transformation in a calibration file."""
    path = _beside_or_above(folder, name)
    rows = read_calibration(path)
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = matrix_of(rows, "R", (3, 3), path), matrix_of(rows, "T", (3,), path)
    R = motion[:3, :3]
    # Published with seven digits
    if not np.allclose(R @ R.T, np.eye(3), atol=1e-4) or np.linalg.det(R) < 0:
        raise InputError("R is not a rotation", where=path, advice="correct the file")
    return motion


def _inverse(T: FloatArray) -> FloatArray:
    inverse = np.eye(4)
    inverse[:3, :3], inverse[:3, 3] = T[:3, :3].T, -T[:3, :3].T @ T[:3, 3]
    return inverse


def _beside_or_above(folder: Path, name: str) -> Path:
    """Return the calibration file of a drive: in its folder, or in the folder of the day."""
    places = [folder, folder.resolve().parent]
    for place in places:
        if (place / name).is_file():
            return place / name
    raise InputError(f"KITTI drive without {name}, looked here and in {places[1]}", where=folder,
                     advice="copy the calibration of that day there")  # fmt: skip


def _sequence(folder: Path, left: str, right: str) -> KittiFolder:
    """Describe a sequence of the odometry benchmark."""
    path = folder / "calib.txt"
    if not path.is_file():
        raise InputError(f"images in {left} and {right}, but no calib.txt", where=folder,
                         advice="copy it there, or write a survey.toml")  # fmt: skip
    rows = read_calibration(path)
    names = [f"P{left[-1]}", f"P{right[-1]}"]
    if names[0] not in rows:
        # Two rows belong to the two cameras, four to all four
        first = int(left[-1]) if len(rows) >= 4 and left[-1].isdecimal() else 0
        names = [str(first), str(first + 1)] if "0" in rows else ["P0", "P1"]
    warnings, times = [], {"times": "times.txt"}
    if not (folder / "times.txt").is_file():
        times = {"rate_hz": KITTI_RATE_HZ}  # type: ignore[dict-item]
        warnings.append(f"{folder}: no times.txt, image rate assumed to be {KITTI_RATE_HZ:g} Hz (KITTI's)")
    cameras = {
        side: {"images": f"{images}/*"} | times
        | rectified_camera(matrix_of(rows, name, (3, 4), path), _size_of_images(folder, images), name, path)
        for side, images, name in zip(("left", "right"), (left, right), names, strict=True)
    }  # fmt: skip
    settings: dict[str, Any] = {"cameras": cameras}
    # As the benchmark has them: sequences/00/ and poses/00.txt
    resolved = folder.resolve()
    for poses in (folder / "poses.txt", resolved.parent.parent / "poses" / f"{resolved.name}.txt"):
        if poses.is_file():
            settings["trajectory"] = {"file": str(poses.name if poses.parent == folder else poses)} | times
            break
    return KittiFolder(settings, path, tuple(warnings))


def _size_of_images(folder: Path, name: str) -> tuple[int, int]:
    """Return the commonest size (width, height) of the first, middle and last readable image of a folder."""
    files = find_images(folder / name)
    if not files:
        raise InputError("no images in it", where=folder / name, advice="copy the images there")
    sizes: Counter[tuple[int, int]] = Counter()
    problem: InputError | None = None
    for i in sorted({0, len(files) // 2, len(files) - 1}):
        try:
            sizes[image_size(files[i])] += 1
        except InputError as error:
            problem = error
    if not sizes:
        assert problem is not None
        raise problem
    return sizes.most_common(1)[0][0]


#: Calibration rows that are not numbers.
_TEXTS = ("calib_time", "corner_dist")


def read_calibration(path: Path) -> dict[str, FloatArray]:
    """Read the rows ``NAME: numbers`` of a KITTI calibration; rows without a name are "0", "1" and so on.

    Raises
    ------
    InputError
        A row that does not hold finite numbers, with its line.
    """
    rows: dict[str, FloatArray] = {}
    for number, line in text_lines(path):
        name, colon, rest = line.partition(":")
        texts = (rest if colon else line).split()
        name = name.strip() if colon else str(len(rows))
        if name in _TEXTS:
            continue
        values = [finite_number(text) for text in texts]
        if not values or None in values:
            raise InputError(f"line {number} is not a row of numbers", where=path, advice="correct the file")
        rows[name] = np.array(values, dtype=np.float64)
    return rows


def matrix_of(rows: Mapping[str, FloatArray], name: str, shape: tuple[int, ...], where: Path) -> FloatArray:
    """Return a row as a matrix of that shape.

    Raises
    ------
    InputError
        The row is missing, or has another number of values.
    """
    if name not in rows:
        raise InputError(f"has no row {name} (there are: {', '.join(list(rows)[:12])})", where=where,
                         advice="name the calibration that belongs to these images")  # fmt: skip
    if rows[name].size != np.prod(shape):
        raise InputError(f"row {name} has {rows[name].size} numbers, expected {int(np.prod(shape))}",
                         where=where, advice="correct the file")  # fmt: skip
    return rows[name].reshape(shape)


def rectified_camera(
    P: FloatArray, size: tuple[int, int], name: str, where: Path, mount: FloatArray | None = None
) -> dict[str, Any]:
    """Return the keys of a camera in a survey.toml, from its projection matrix.

    Parameters
    ----------
    P
        (3, 4) float64: from the rectified frame of the reference camera to homogeneous pixels,
        ``K [I | t]``: the camera's centre is ``-t`` there.
    size
        Width and height of its images. [pixels]
    mount
        (4, 4) float64: from the rectified frame of the reference camera to the vehicle. Without it the vehicle
        frame is that camera's, with its axes turned to forward, left, up.
    """
    fx, fy, cx, cy = P[0, 0], P[1, 1], P[0, 2], P[1, 2]
    if P[0, 1] != 0.0 or P[1, 0] != 0.0 or P[2, :3].tolist() != [0.0, 0.0, 1.0] or 0.0 in (fx, fy):
        raise InputError(f"row {name} is not the projection of a rectified camera", where=where,
                         advice="expected fx 0 cx a, 0 fy cy b, 0 0 1 c")  # fmt: skip
    offset = np.array([(P[0, 3] - cx * P[2, 3]) / fx, (P[1, 3] - cy * P[2, 3]) / fy, P[2, 3]])
    return camera_keys((fx, fy, cx, cy), size, -offset, np.eye(3), mount)


def original_camera(
    rows: Mapping[str, FloatArray], number: str, where: Path, mount: FloatArray
) -> dict[str, Any]:
    """Return the keys of a camera whose images are not rectified: rows K, D, R, T and S of its number."""
    K, R = (matrix_of(rows, f"{name}_{number}", (3, 3), where) for name in "KR")
    T, D = matrix_of(rows, f"T_{number}", (3,), where), matrix_of(rows, f"D_{number}", (5,), where)
    size = matrix_of(rows, f"S_{number}", (2,), where)
    rectifying = np.eye(4)
    rectifying[:3, :3] = matrix_of(rows, "R_rect_00", (3, 3), where)
    # T_cam_reference takes the reference camera's frame to this one's
    keys = camera_keys((K[0, 0], K[1, 1], K[0, 2], K[1, 2]), (int(size[0]), int(size[1])), -R.T @ T, R.T,
                       mount @ rectifying)  # fmt: skip
    return keys | {"distortion": D.tolist()}


def camera_keys(
    intrinsics: tuple[float, float, float, float], size: tuple[int, int], centre: FloatArray,
    turn: FloatArray, mount: FloatArray | None,
) -> dict[str, Any]:  # fmt: skip
    """Return the keys of [cameras.left] of a camera at `centre`, turned by `turn` in the frame that `mount` places."""
    from scipy.spatial.transform import Rotation

    placed = np.eye(4)
    placed[:3, :3] = LOOKING_AHEAD
    if mount is not None:
        placed = mount
    x, y, z, w = Rotation.from_matrix(placed[:3, :3] @ turn).as_quat().tolist()
    fx, fy, cx, cy = map(float, intrinsics)
    return {
        "width": size[0], "height": size[1], "fx": fx, "fy": fy, "cx": cx, "cy": cy,
        "position_m": (placed[:3, :3] @ centre + placed[:3, 3]).tolist(), "rotation_wxyz": [w, x, y, z],
    }  # fmt: skip
