"""A positioned drive: its poses, what is not covered, and what was found out about the sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.model.settings import setting
from linework.model.trajectory import Trajectory
from linework.navigation.noise import NoiseModel


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveStretch:
    """What was found out about the sensors between two clock jumps.

    Parameters
    ----------
    first_s, last_s
        The time it is about.
    estimates
        Value and sigma by name with unit: gyro_bias_deg_h (at the end), gyro_scale, wheel_scale_left,
        wheel_scale_right, gnss_delay_s; those that were estimated.
    noise
        What the sensors' noise was taken for.
    """

    first_s: float
    last_s: float
    estimates: Mapping[str, tuple[float, float]]
    noise: NoiseModel


@dataclass(frozen=True, slots=True, kw_only=True)
class LocatedDrive:
    """A drive, positioned.

    Parameters
    ----------
    trajectory
        Smoothed; where the drive is not covered there are no poses.
    forward
        The same as it was known at each moment (but for the sensors' noise, which is that of the whole drive).
    distance_m
        Driven.
    outages_s
        (k, 2) from when to when there were no fixes.
    left_out_s
        (k, 2) what of the drive has no poses.
    fix_time_s, residual_m, residual_sigma_m, is_outlier
        (m,), (m, 3), (m, 3), (m,): fixes, what they are off by from the smoothed track, and its sigma.
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
    """Return the parts of a drive as one.

    Parameters
    ----------
    refused_s
        From when to when there is a part that could not be positioned.
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
    """Return the poses that are kept."""
    columns = ("time_s", "xyz", "attitude_deg", "sigma_xyz_m", "sigma_attitude_deg")
    return Trajectory(*(getattr(trajectory, name)[kept] for name in columns))


# What may be chosen about positioning


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigationConfig:
    """Limits of what dead reckoning is trusted with."""

    longest_outage_s: float = setting(
        180.0, unit="s", low=1.0, high=3600.0,
        reason="of longer ones the middle is left out: dead reckoning keeps 0.1 % of the way, 5 m at 100 km/h",
    )  # fmt: skip
    max_sigma_m: float = setting(
        20.0, unit="m", low=0.01, high=1000.0,
        reason="less certain places are left out: that far away is another road",
    )  # fmt: skip
