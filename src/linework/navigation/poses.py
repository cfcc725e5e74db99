"""Position and attitude at any time, by interpolation on the group of rotations."""

from __future__ import annotations

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.kernels import navigation as kernel
from linework.model.images import Poses
from linework.model.trajectory import Trajectory
from linework.navigation.dead_reckoning import DeadReckoning, Motion
from linework.navigation.filter import FilterEstimate, FilterProblem


def rotations_of(attitude_deg: FloatArray) -> FloatArray:
    """Return R_world_vehicle = Rz(90 deg - heading) Ry(-pitch) Rx(roll), (n, 3, 3), of roll, pitch, heading (n, 3) [deg].

    >>> rotations_of(np.array([[0.0, 0.0, 90.0]])).round(9)[0].tolist()  # heading east: forward is east
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    from scipy.spatial.transform import Rotation

    roll, pitch, heading = np.radians(np.asarray(attitude_deg, dtype=np.float64)).T
    angles = np.stack([np.pi / 2.0 - heading, -pitch, roll], axis=-1)
    return np.asarray(Rotation.from_euler("ZYX", angles).as_matrix())


def attitude_deg_of(R_world_vehicle: FloatArray) -> FloatArray:
    """Return roll, pitch, heading (0 to 360) of rotations (n, 3, 3), (n, 3) [deg]."""
    from scipy.spatial.transform import Rotation

    yaw, minus_pitch, roll = Rotation.from_matrix(R_world_vehicle).as_euler("ZYX", degrees=True).T
    return np.stack([roll, -minus_pitch, (90.0 - yaw) % 360.0], axis=-1)


def poses_at(trajectory: Trajectory, time_s: FloatArray) -> Poses:
    """Return position and attitude of the vehicle at (n,) times [s] within the trajectory.

    Raises
    ------
    ValueError
        When the trajectory has no attitude, or a time is outside of it; the message names the first such time.

    Notes
    -----
    Positions and sigmas are interpolated linearly, rotations at a constant rate about one axis (slerp).
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


# Poses at any rate between the nodes of the filter: dead reckoned, and adjusted to both neighbours


def trajectory_at(
    time_s: FloatArray,
    problem: FilterProblem,
    estimate: FilterEstimate,
    motion: Motion,
    reckoned: DeadReckoning,
    *,
    origin_m: FloatArray,
    tilt_sigma_rad: FloatArray,
) -> Trajectory:
    """Return poses and their sigmas at (n,) times within the nodes.

    Notes
    -----
    From the node before, gyro and wheels are integrated with the estimated scales and bias; the misclosure at the
    node after is distributed over the time between both.
    """
    nodes, x = problem.time_s, estimate.x
    k = np.clip(np.searchsorted(nodes, time_s, side="right") - 1, 0, len(nodes) - 2)
    share = (time_s - nodes[k]) / (nodes[k + 1] - nodes[k])
    at, node = reckoned.at(time_s), reckoned.at(nodes)
    pose = _moved(x[k], node, at, k, time_s - nodes[k])
    whole = _moved(x[:-1], node, node, np.arange(len(nodes) - 1), np.diff(nodes), to_next=True)
    pose += share[:, None] * (x[1:, :4] - whole)[k]
    tilt = np.stack([np.interp(time_s, motion.turn_time_s, t) for t in motion.tilt_rad.T], axis=1)
    offset = x[:, [kernel.ROLL, kernel.PITCH]]
    tilt += (1.0 - share)[:, None] * offset[k] + share[:, None] * offset[k + 1]
    var = np.diagonal(estimate.p, axis1=1, axis2=2)
    sigma = np.sqrt(np.maximum((1.0 - share)[:, None] * var[k] + share[:, None] * var[k + 1], 0.0))
    attitude = np.degrees(np.column_stack([tilt, pose[:, 3]]))
    attitude[:, 2] %= 360.0
    sigma_tilt = np.hypot(sigma[:, [kernel.ROLL, kernel.PITCH]], tilt_sigma_rad)
    return Trajectory(
        time_s,
        pose[:, :3] + origin_m,
        attitude,
        sigma[:, :3],
        np.degrees(np.column_stack([sigma_tilt, sigma[:, kernel.NAV_HEADING]])),
    )


def _moved(
    x: FloatArray,
    node: DeadReckoning,
    at: DeadReckoning,
    k: AnyArray,
    dt: FloatArray,
    *,
    to_next: bool = False,
) -> FloatArray:
    """Return position and heading (n, 4) dead reckoned from nodes `k` (n,) over `dt` (n,) [s]."""
    to = slice(1, None) if to_next else slice(None)
    turn_read = at.heading_rad[to] - node.heading_rad[k]
    turn = (1.0 + x[:, kernel.GYRO_SCALE]) * turn_read + (x[:, kernel.NAV_TURN] - x[:, kernel.BIAS]) * dt
    way = at.way_m[to] - node.way_m[k]
    scale = 1.0 + 0.5 * (x[:, kernel.LEFT] + x[:, kernel.RIGHT])
    far = way.mean(axis=1)
    free = x[:, kernel.SPEED] * dt
    along = at.xy[to] - node.xy[k]
    # Rotated to the heading of the node, plus half of the correction of the gyro
    h = x[:, kernel.NAV_HEADING] - node.heading_rad[k] + 0.5 * (turn - turn_read)
    east = along[:, 0] * np.cos(h) + along[:, 1] * np.sin(h)
    north = along[:, 1] * np.cos(h) - along[:, 0] * np.sin(h)
    heading = x[:, kernel.NAV_HEADING] + 0.5 * turn
    rise = at.rise_m[to] - node.rise_m[k] + far * np.sin(x[:, kernel.PITCH])
    return np.column_stack(
        [
            x[:, kernel.E] + scale * east + free * np.sin(heading),
            x[:, kernel.N] + scale * north + free * np.cos(heading),
            x[:, kernel.U] + rise,
            x[:, kernel.NAV_HEADING] + turn,
        ]
    )
