"""Read poses in KITTI's odometry format: camera to first camera, 3 x 4, one line per image."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.files.logs.text import read_number_rows
from linework.files.trajectories.content import TrajectoryContent, ordered_content
from linework.navigation.poses import attitude_deg_of

#: Camera axes in a vehicle whose origin is the camera: forward = z, left = -x, up = -y.
R_VEHICLE_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
#: Largest deviation of R R^T from the identity: the files print six digits.
_MAX_NO_ROTATION = 1e-3


def read_kitti_poses_content(path: Path, times_s: FloatArray) -> TrajectoryContent:
    """Read a poses.txt: each line a pose ``[R | t]``, row by row, that takes the camera's frame to the first camera's.

    Parameters
    ----------
    times_s
        (n,) float64 [s]: time of the image of each line; images without a pose may follow.

    Returns
    -------
    TrajectoryContent
        Of a vehicle whose origin is the camera (x forward, y left, z up), in a world that is the first camera's
        frame turned: east = its z (forward), north = -x (left), up = -y. The first pose has heading 90 deg.

    Raises
    ------
    InputError
        Lines that are not poses (the first is named), more poses than times.

    Notes
    -----
    With A the matrix that takes camera axes to vehicle axes: ``R_world_vehicle = A R A^T``, ``xyz = A t``.
    """
    rows = read_number_rows(path, 12)
    poses = rows.values.reshape(-1, 3, 4)
    check_rotations(path, poses[:, :, :3], rows.line_numbers)
    place = rows.rows.astype(np.int64)
    if len(place) and place[-1] >= len(times_s):
        raise InputError(f"{place[-1] + 1} poses, but {len(times_s)} times", where=path,
                         advice="there is one line for every image")  # fmt: skip
    return ordered_content(
        path,
        np.asarray(times_s, dtype=np.float64)[place],
        rows.line_numbers,
        {
            "xyz": poses[:, :, 3] @ R_VEHICLE_CAMERA.T,
            "attitude_deg": attitude_deg_of(R_VEHICLE_CAMERA @ poses[:, :, :3] @ R_VEHICLE_CAMERA.T),
        },
        warnings=rows.warnings,
    )


def check_rotations(path: Path, rotations: FloatArray, line_numbers: FloatArray) -> None:
    """Refuse (n, 3, 3) matrices that are not rotations.

    Raises
    ------
    InputError
        With the line of the first.
    """
    off = np.abs(rotations @ rotations.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    wrong = (off > _MAX_NO_ROTATION) | (np.linalg.det(rotations) < 0.0)
    if wrong.any():
        raise InputError(
            f"line {int(line_numbers[np.argmax(wrong)])} is not a rotation ({int(wrong.sum())} of {len(wrong)} lines)",
            where=path, advice="each line is [R | t], 3 x 4, row by row",
        )  # fmt: skip
