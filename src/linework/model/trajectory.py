"""Trajectory: the van's positions over time, and its attitudes where known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray
from linework.model.columns import Columns, column, optional_column


@dataclass(frozen=True, slots=True, repr=False)
class Trajectory(Columns):
    """The vehicle's path in the survey's CRS, in time order.

    Parameters
    ----------
    time_s
        (n,) float64 [s], strictly increasing.
    xyz
        (n, 3) float64 [m, world]: origin of the vehicle frame (on the ground under the rear axle).
    attitude_deg
        (n, 3) float64 [deg]: roll, pitch, heading (clockwise from grid north), or None.
    sigma_xyz_m
        (n, 3) float64 [m], or None.
    sigma_attitude_deg
        (n, 3) float64 [deg]: of roll, pitch, heading, or None.

    Examples
    --------
    >>> Trajectory([0.0, 1.0, 2.0], [[0.0, 0.0, 5.0], [9.0, 0.0, 5.0], [9.0, 9.0, 5.0]])
    Trajectory(3 poses, 18.0 m in 2.0 s, without attitude)
    """

    time_s: FloatArray = column()
    xyz: FloatArray = column(np.float64, 3)
    attitude_deg: FloatArray | None = optional_column(np.float64, 3)
    sigma_xyz_m: FloatArray | None = optional_column(np.float64, 3)
    sigma_attitude_deg: FloatArray | None = optional_column(np.float64, 3)

    def __post_init__(self) -> None:
        Columns.__post_init__(self)
        if np.any(np.diff(self.time_s) <= 0):
            raise ValueError("time_s: must be strictly increasing")

    def __repr__(self) -> str:
        attitude = "without" if self.attitude_deg is None else "with"
        if len(self) == 0:
            return f"Trajectory(0 poses, {attitude} attitude)"
        length_m = float(np.hypot(*np.diff(self.xyz[:, :2], axis=0).T).sum())
        seconds = float(self.time_s[-1] - self.time_s[0])
        return f"Trajectory({len(self):,} poses, {length_m:,.1f} m in {seconds:,.1f} s, {attitude} attitude)"
