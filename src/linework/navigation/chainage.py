"""Distance driven, and positions at given times, for logs: also without attitude and across gaps."""

from __future__ import annotations

import math

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.model.logs import LoggedPlaces
from linework.model.trajectory import Trajectory
from linework.navigation.lever import headings_deg
from linework.navigation.poses import attitude_deg_of, poses_at

#: Step of the odometer. Positions wander by centimetres while the van stands; in a bend of 25 m radius the path is
#: 0.01 % longer than its chords of this length. [m]
_STEP_M = 1.0
#: Longest time between poses in which the position is known: braking or turning at 3 m/s2 the van is 1.5 m off the
#: straight line between them. [s]
PATH_HOLE_S = 2.0


def chainage_m(trajectory: Trajectory) -> FloatArray:
    """Return the distance driven in plan up to each pose, (n,) [m], never decreasing.

    Notes
    -----
    The odometer advances whenever the van is a metre from where it last advanced, so that positions that wander at
    rest add nothing.

    Examples
    --------
    >>> x = np.array([0.0, 3.0, 3.02, 2.99, 3.01, 6.0])
    >>> chainage_m(Trajectory(np.arange(6.0), np.stack([x, 0 * x, 0 * x], axis=1))).round(2).tolist()
    [0.0, 3.0, 3.02, 3.02, 3.02, 6.0]
    """
    odometer = Odometer()
    return np.array([odometer.advance(x, y) for x, y in trajectory.xyz[:, :2].tolist()])


class Odometer:
    """The distance driven in plan, place after place; see `chainage_m`.

    Parameters
    ----------
    start_m
        Reading at the first place. [m]
    at
        East and north of the first place [m]; None: that of the first call.
    """

    def __init__(self, start_m: float = 0.0, at: tuple[float, float] | None = None) -> None:
        self._clicked_m, self._driven_m = start_m, start_m
        self._at = (math.nan, math.nan) if at is None else at

    def advance(self, east: float, north: float) -> float:
        """Return the distance driven up to the next place [m], never less than before."""
        if math.isnan(self._at[0]):
            self._at = east, north
        away = math.hypot(east - self._at[0], north - self._at[1])
        self._driven_m = max(self._driven_m, self._clicked_m + away)
        if away >= _STEP_M:
            self._clicked_m, self._at = self._clicked_m + away, (east, north)
        return self._driven_m


def is_placed(trajectory: Trajectory, time_s: FloatArray) -> BoolArray:
    """Return the times (n,) [s] at which the position is known, (n,) bool: within the trajectory, and not in a gap."""
    known = trajectory.time_s
    after = np.clip(np.searchsorted(known, time_s), 1, max(len(known) - 1, 1))
    inside = (time_s >= known[0]) & (time_s <= known[-1])
    if len(known) < 2:
        return np.asarray(inside)
    is_pose = (known[after] == time_s) | (known[after - 1] == time_s)
    return np.asarray(inside & (is_pose | (known[after] - known[after - 1] <= PATH_HOLE_S)))


def places_at(
    trajectory: Trajectory,
    time_s: FloatArray,
    lever_m: FloatArray | tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> LoggedPlaces:
    """Return the positions of a point of the vehicle at (n,) times [s] within the trajectory.

    Parameters
    ----------
    lever_m
        The point [m, vehicle]. Without attitude the vehicle is assumed level and heading along its path.
    """
    from dataclasses import replace

    if trajectory.attitude_deg is None:
        attitude = np.zeros((len(trajectory), 3))
        attitude[:, 2] = headings_deg(trajectory.xyz)
        trajectory = replace(trajectory, attitude_deg=attitude)
    poses = poses_at(trajectory, time_s)
    xyz = poses.xyz + poses.R_world_vehicle @ np.asarray(lever_m, dtype=np.float64)
    driven = np.interp(time_s, trajectory.time_s, chainage_m(trajectory))
    heading = attitude_deg_of(poses.R_world_vehicle)[:, 2] if len(poses) else np.zeros(0)
    return LoggedPlaces(time_s=poses.time_s, xyz=xyz, heading_deg=heading, chainage_m=driven)
