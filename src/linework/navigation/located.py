"""A positioned drive: poses, gaps, and estimates of the sensors; and the settings of positioning."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.model.settings import Settings, setting
from linework.model.trajectory import Trajectory
from linework.navigation.noise import NoiseModel


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveStretch:
    """Estimates of the sensors between two clock jumps.

    Parameters
    ----------
    first_s, last_s
        Time span. [s]
    estimates
        Value and sigma of what was estimated, by name with unit: gyro_bias_deg_h (at the end), gyro_scale,
        wheel_scale_left, wheel_scale_right, gnss_delay_s.
    noise
        Noise of the sensors.
    """

    first_s: float
    last_s: float
    estimates: Mapping[str, tuple[float, float]]
    noise: NoiseModel


@dataclass(frozen=True, slots=True, kw_only=True)
class LocatedDrive:
    """A positioned drive.

    Parameters
    ----------
    trajectory
        Smoothed; without poses where the drive is not covered.
    forward
        The same as it was known at each moment (but for the sensors' noise, which is that of the whole drive).
    distance_m
        Distance driven. [m]
    outages_s
        (k, 2) spans without fixes. [s]
    left_out_s
        (k, 2) spans without poses. [s]
    fix_time_s, residual_m, residual_sigma_m, is_outlier
        (m,) times of the fixes [s], (m, 3) residuals from the smoothed path and their sigmas [m], (m,) bool.
    """

    trajectory: Trajectory
    forward: Trajectory
    distance_m: float
    outages_s: FloatArray
    left_out_s: FloatArray
    fix_time_s: FloatArray
    residual_m: FloatArray
    residual_sigma_m: FloatArray
    is_outlier: BoolArray
    stretches: tuple[DriveStretch, ...]
    warnings: tuple[str, ...] = field(default=())


def concatenated_drives(
    parts: Sequence[LocatedDrive], refused_s: Sequence[tuple[float, float]], warnings: Sequence[str]
) -> LocatedDrive:
    """Return the parts of a drive as one drive.

    Parameters
    ----------
    refused_s
        Spans of parts that could not be positioned. [s]
    """
    left_out = np.concatenate([np.reshape(refused_s, (-1, 2)), *(p.left_out_s for p in parts)])

    def joined(name: str) -> FloatArray:
        return np.concatenate([getattr(p, name) for p in parts])

    return LocatedDrive(
        trajectory=_joined([p.trajectory for p in parts]),
        forward=_joined([p.forward for p in parts]),
        distance_m=sum(p.distance_m for p in parts),
        outages_s=joined("outages_s"),
        left_out_s=left_out[np.argsort(left_out[:, 0], kind="stable")],
        fix_time_s=joined("fix_time_s"),
        residual_m=joined("residual_m"),
        residual_sigma_m=joined("residual_sigma_m"),
        is_outlier=joined("is_outlier").astype(bool),
        stretches=tuple(s for p in parts for s in p.stretches),
        warnings=(*warnings, *(w for p in parts for w in p.warnings)),
    )


def _joined(parts: Sequence[Trajectory]) -> Trajectory:
    columns = ("time_s", "xyz", "attitude_deg", "sigma_xyz_m", "sigma_attitude_deg")
    return Trajectory(*(np.concatenate([getattr(p, name) for p in parts]) for name in columns))


def kept_poses(trajectory: Trajectory, kept: BoolArray) -> Trajectory:
    """Return the poses of a trajectory that are kept (n,) bool."""
    columns = ("time_s", "xyz", "attitude_deg", "sigma_xyz_m", "sigma_attitude_deg")
    return Trajectory(*(getattr(trajectory, name)[kept] for name in columns))


# Settings of positioning


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigationConfig(Settings):
    """Settings of positioning: limits of dead reckoning."""

    longest_outage_s: float = setting(
        180.0, unit="s", low=1.0, high=3600.0,
        reason="of longer ones the middle is left out: dead reckoning keeps 0.1 % of the way, 5 m at 100 km/h",
    )  # fmt: skip
    max_sigma_m: float = setting(
        20.0, unit="m", low=0.01, high=1000.0,
        reason="less certain places are left out: that far away is another road",
    )  # fmt: skip
