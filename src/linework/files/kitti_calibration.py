"""Calibrations of KITTI folders: named rows of numbers, and the cameras they describe.

References
----------
A. Geiger, P. Lenz, C. Stiller, R. Urtasun, "Vision meets robotics: the KITTI dataset", International Journal of
Robotics Research 32 (2013), doi:10.1177/0278364913491297, section 3.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.files.text_tables import finite_number, text_lines
from linework.model.camera import LOOKING_AHEAD

#: Rows that are no numbers.
_TEXTS = ("calib_time", "corner_dist")


def read_calibration(path: Path) -> dict[str, FloatArray]:
    """Read the rows ``NAME: numbers`` of a KITTI calibration; rows without a name are "0", "1" and so on.

    Raises
    ------
    InputError
        A row that is not of finite numbers, with its line.
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
        No such row, or another number of values.
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
        raise InputError(f"row {name} is no projection of a rectified camera", where=where,
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
