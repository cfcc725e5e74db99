"""Read trajectories in the TUM format: time, position, quaternion.

Separate from `read`, which recognises formats: here the frames of the world and of the body are not stated and follow
from the motion.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.files.logs.text import read_number_rows
from linework.files.trajectories.content import TrajectoryContent, ordered_content
from linework.files.trajectories.kitti_poses import R_VEHICLE_CAMERA
from linework.navigation.poses import attitude_deg_of

#: Largest deviation of a quaternion's length from 1: they are printed with a few digits.
_MAX_OFF_UNIT = 0.01
#: Least upward component of the vehicle's z-axis: a car is tilted by less than 45 degrees.
_UP_SHARE = 0.707
#: Shorter steps between two poses are noise. [m]
_MIN_STEP_M = 0.05


def read_tum_content(path: Path) -> TrajectoryContent:
    """Read ``time x y z qx qy qz qw`` on each line: position and rotation of a camera, or a vehicle, in the world.

    Returns
    -------
    TrajectoryContent
        Of a vehicle whose origin is the described point (x forward, y left, z up). A body that moves along its z-axis
        is a camera (x right, y down, z forward), one that moves along its x-axis a vehicle. A world with z up is kept;
        in one with y down (that of a first camera) east becomes its z, north its -x, up its -y, so that the first
        camera's heading is 90 deg.

    Raises
    ------
    InputError
        No rows, quaternions that are not of unit length, a world whose up direction is unclear.
    """
    from scipy.spatial.transform import Rotation

    rows = read_number_rows(path, 8)
    quaternions = rows.values[:, 4:]
    wrong = np.abs(np.linalg.norm(quaternions, axis=1) - 1.0) > _MAX_OFF_UNIT
    if wrong.any():
        raise InputError(
            f"line {int(rows.line_numbers[np.argmax(wrong)])} has no unit quaternion ({int(wrong.sum())} of"
            f" {len(wrong)} lines)", where=path, advice="each line is time x y z qx qy qz qw",
        )  # fmt: skip
    R, xyz = Rotation.from_quat(quaternions).as_matrix(), rows.values[:, 1:4]
    is_camera = _moves_along_z(R, xyz)
    remarks = (
        "poses of a camera (moves along its z)" if is_camera else "poses of a vehicle (moves along its x)"
    )
    if is_camera:
        R = R @ R_VEHICLE_CAMERA.T
    world = _turned_world(R, path)
    attitude = attitude_deg_of(world @ R)
    return ordered_content(
        path, rows.values[:, 0], rows.line_numbers, {"xyz": xyz @ world.T, "attitude_deg": attitude},
        warnings=(*rows.warnings, remarks),
    )  # fmt: skip


def _moves_along_z(R: FloatArray, xyz: FloatArray) -> bool:
    """Return whether the body moves along its z-axis rather than its x-axis; True without motion."""
    steps = np.diff(xyz, axis=0)
    moving = np.linalg.norm(steps, axis=1) > _MIN_STEP_M
    along = np.einsum("nij,ni->nj", R[:-1][moving], steps[moving])
    return float(np.abs(along[:, 2]).sum()) >= float(np.abs(along[:, 0]).sum())


def _turned_world(R_world_vehicle: FloatArray, path: Path) -> FloatArray:
    """Return the rotation (3, 3) that turns the file's world so that z is up."""
    up = R_world_vehicle[:, :, 2].mean(axis=0)
    if up[2] >= _UP_SHARE:
        return np.eye(3)
    if -up[1] >= _UP_SHARE:
        return R_VEHICLE_CAMERA
    raise InputError(
        f"up is ({up[0]:.2f}, {up[1]:.2f}, {up[2]:.2f}) in this world, expected z up or y down", where=path,
        advice="turn the poses so that z is up",
    )  # fmt: skip
