"""Where the van was: positions, and attitudes where known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray, checked


@dataclass(frozen=True, slots=True)
class Trajectory:
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
    """

    time_s: FloatArray
    xyz: FloatArray
    attitude_deg: FloatArray | None = None
    sigma_xyz_m: FloatArray | None = None
    sigma_attitude_deg: FloatArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "time_s", checked("time_s", self.time_s, np.float64, (None,)))
        n = len(self.time_s)
        object.__setattr__(self, "xyz", checked("xyz", self.xyz, np.float64, (n, 3)))
        for name in ("attitude_deg", "sigma_xyz_m", "sigma_attitude_deg"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, checked(name, value, np.float64, (n, 3)))
        if n and np.any(np.diff(self.time_s) <= 0):
            raise ValueError("time_s: must be strictly increasing")

    def __len__(self) -> int:
        return len(self.time_s)
