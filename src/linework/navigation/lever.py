"""Lever arms: from the unit that a trajectory describes (antenna, IMU) to the origin of the vehicle frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from linework.arrays import FloatArray
from linework.model.trajectory import Trajectory
from linework.navigation.poses import attitude_deg_of, rotations_of

#: Shortest step that has a direction; over shorter ones it is the noise of the positions. [m]
_MIN_STEP_M = 0.05


def at_vehicle_origin(
    trajectory: Trajectory,
    lever_m: tuple[float, float, float],
    boresight_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Trajectory:
    """Return the trajectory of the origin of the vehicle from that of another unit on it.

    Parameters
    ----------
    lever_m
        Position of the described unit. [m, vehicle: forward, left, up]
    boresight_deg
        Roll, pitch, heading of the described unit in the vehicle: how it is mounted. [deg; right side down, nose
        up, clockwise from above]

    Notes
    -----
    ``xyz_origin = xyz_point - R_world_vehicle @ lever`` with
    ``R_world_vehicle = Rz(90 deg - heading) Ry(-pitch) Rx(roll)``, and with a boresight ``R_world_vehicle =
    R_world_unit R_vehicle_unit^T``, ``R_vehicle_unit = Rz(-heading) Ry(-pitch) Rx(roll)``. Where the trajectory has
    no attitude the vehicle is assumed level and heading along its path.

    Examples
    --------
    An antenna 1 m ahead and 2 m up on a van that drives north:

    >>> path = Trajectory(np.array([0.0, 1.0]), np.array([[0.0, 0.0, 2.0], [0.0, 5.0, 2.0]]))
    >>> at_vehicle_origin(path, (1.0, 0.0, 2.0)).xyz.round(9).tolist()
    [[0.0, -1.0, 0.0], [0.0, 4.0, 0.0]]
    """
    if len(trajectory) == 0:
        return trajectory
    if any(boresight_deg) and trajectory.attitude_deg is not None:
        roll, pitch, heading = boresight_deg
        # The vehicle's x-axis as east
        mounted = rotations_of(np.array([[roll, pitch, heading + 90.0]]))[0]
        turned = attitude_deg_of(rotations_of(trajectory.attitude_deg) @ mounted.T)
        trajectory = replace(trajectory, attitude_deg=turned)
    if not any(lever_m):
        return trajectory
    if trajectory.attitude_deg is None:
        attitude = np.zeros((len(trajectory), 3))
        attitude[:, 2] = headings_deg(trajectory.xyz)
    else:
        attitude = trajectory.attitude_deg
    return replace(trajectory, xyz=trajectory.xyz - rotated(attitude, np.asarray(lever_m)))


def rotated(attitude_deg: FloatArray, vector_vehicle: FloatArray) -> FloatArray:
    """Return a vector (3,) of the vehicle frame in the world frame, (n, 3), for roll, pitch, heading (n, 3) [deg]."""
    roll, pitch, heading = np.radians(attitude_deg).T
    x, y, z = vector_vehicle
    # Rx(roll)
    y, z = y * np.cos(roll) - z * np.sin(roll), y * np.sin(roll) + z * np.cos(roll)
    # Ry(-pitch): nose up raises what is ahead
    x, z = x * np.cos(pitch) - z * np.sin(pitch), x * np.sin(pitch) + z * np.cos(pitch)
    # Rz(90 deg - heading)
    east = x * np.sin(heading) - y * np.cos(heading)
    north = x * np.cos(heading) + y * np.sin(heading)
    return np.stack([east, north, z], axis=-1)


def headings_deg(xyz: FloatArray) -> FloatArray:
    """Return the heading along a path (n, 3) at each position, (n,) [deg]; at rest that of the step before."""
    steps = np.gradient(xyz[:, :2], axis=0) if len(xyz) > 1 else np.zeros((1, 2))
    moving = np.flatnonzero(np.hypot(steps[:, 0], steps[:, 1]) > _MIN_STEP_M)
    if len(moving) == 0:
        return np.zeros(len(xyz))
    last = np.clip(np.searchsorted(moving, np.arange(len(xyz)), side="right") - 1, 0, None)
    east, north = steps[moving[last]].T
    return np.asarray(np.degrees(np.arctan2(east, north)), dtype=np.float64)
