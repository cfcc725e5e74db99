"""Position and attitude at any time, by interpolation on the group of rotations."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.model.images import Poses
from linework.model.trajectory import Trajectory


def rotations_of(attitude_deg: FloatArray) -> FloatArray:
    """Return (n, 3, 3) R_world_vehicle = Rz(90 deg - heading) Ry(-pitch) Rx(roll) of (n, 3) roll, pitch, heading.

    >>> rotations_of(np.array([[0.0, 0.0, 90.0]])).round(9)[0].tolist()  # heading east: forward is east
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    from scipy.spatial.transform import Rotation

    roll, pitch, heading = np.radians(np.asarray(attitude_deg, dtype=np.float64)).T
    angles = np.stack([np.pi / 2.0 - heading, -pitch, roll], axis=-1)
    return np.asarray(Rotation.from_euler("ZYX", angles).as_matrix())


def attitude_deg_of(R_world_vehicle: FloatArray) -> FloatArray:
    """Return (n, 3) roll, pitch, heading [deg, heading 0 to 360] of (n, 3, 3) rotations."""
    from scipy.spatial.transform import Rotation

    yaw, minus_pitch, roll = Rotation.from_matrix(R_world_vehicle).as_euler("ZYX", degrees=True).T
    return np.stack([roll, -minus_pitch, (90.0 - yaw) % 360.0], axis=-1)


def poses_at(trajectory: Trajectory, time_s: FloatArray) -> Poses:
    """Return where the vehicle was and how it was turned at (n,) times [s] within the trajectory.

    Raises
    ------
    ValueError
        The trajectory has no attitude, or a time is outside of it: with the first such time.

    Notes
    -----
    Positions and sigmas go linearly from one pose to the next, rotations at constant rate about the one axis
    that turns the one into the other (slerp).
    """
    from scipy.spatial.transform import Rotation, Slerp

    if trajectory.attitude_deg is None:
        raise ValueError("the trajectory has no attitude (roll_deg, pitch_deg, heading_deg)")
    time_s = np.asarray(time_s, dtype=np.float64)
    known = trajectory.time_s
    outside = (time_s < known[0]) | (time_s > known[-1])
    if outside.any():
        first = float(time_s[outside][0])
        raise ValueError(f"time {first:.3f} s, the trajectory is from {known[0]:.3f} to {known[-1]:.3f} s")
    between = Slerp(known, Rotation.from_matrix(rotations_of(trajectory.attitude_deg)))
    sigma_attitude = trajectory.sigma_attitude_deg
    return Poses(
        time_s,
        _interpolated(time_s, known, trajectory.xyz),
        between(time_s).as_matrix(),
        _interpolated(time_s, known, trajectory.sigma_xyz_m),
        np.radians(_interpolated(time_s, known, sigma_attitude)),
    )


def _interpolated(time_s: FloatArray, known_s: FloatArray, values: FloatArray | None) -> FloatArray:
    if values is None:
        return np.full((len(time_s), 3), np.nan)
    return np.stack([np.interp(time_s, known_s, column) for column in values.T], axis=-1)
