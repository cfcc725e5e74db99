"""Stereo pairs of a survey with their times (files not opened yet), rectified pairs, and vehicle poses."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.arrays import AnyArray, FloatArray, checked
from linework.model.camera import RectifiedRig, StereoRig
from linework.model.columns import Columns, column


@dataclass(frozen=True, slots=True)
class ImagePair:
    """Two images taken at one time.

    Parameters
    ----------
    number
        Number in the series, from 0, counting also pairs that cannot be used.
    time_s
        Time of exposure on the survey's clock. [s]
    left, right
        The files.
    """

    number: int
    time_s: float
    left: Path
    right: Path


@dataclass(frozen=True, slots=True)
class StereoSeries:
    """All pairs of a survey in time order, and the cameras that took them.

    Parameters
    ----------
    warnings
        One line each about images without a partner.
    unpaired
        Those images.
    left_out
        (file, reason) of images without a certain time.
    """

    rig: StereoRig
    pairs: tuple[ImagePair, ...]
    warnings: tuple[str, ...] = ()
    unpaired: tuple[Path, ...] = ()
    left_out: tuple[tuple[Path, str], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class SingleCamera:
    """Images of a camera that are in no pair: for the photolog.

    Parameters
    ----------
    name
        "video", "left" or "right", as in [cameras].
    files
        Its images in time order.
    time_s
        (n,) float64 times of exposure on the survey's clock. [s]
    position_m
        (3,) projection centre in the vehicle frame; the vehicle's origin where it is not known. [m]
    warnings
        One line each about images left out.
    """

    name: str
    files: tuple[Path, ...]
    time_s: FloatArray
    position_m: FloatArray
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class RectifiedPair:
    """Two grey images whose rows are epipolar lines.

    Parameters
    ----------
    left, right
        (height, width) uint8.
    rig
        Their geometry.
    number, time_s
        As in `ImagePair`.
    """

    left: AnyArray
    right: AnyArray
    rig: RectifiedRig
    number: int = 0
    time_s: float = 0.0

    def __post_init__(self) -> None:
        size = (self.rig.height, self.rig.width)
        object.__setattr__(self, "left", checked("left", self.left, np.uint8, size))
        object.__setattr__(self, "right", checked("right", self.right, np.uint8, size))


@dataclass(frozen=True, slots=True)
class Poses(Columns):
    """Position and orientation of the vehicle at given times.

    Parameters
    ----------
    time_s
        (n,) float64 [s].
    xyz
        (n, 3) float64 [m, world]: origin of the vehicle frame.
    R_world_vehicle
        (n, 3, 3) float64.
    sigma_xyz_m
        (n, 3) float64 [m, world]; NaN where unknown.
    sigma_attitude_rad
        (n, 3) float64: of roll, pitch, heading; NaN where unknown.
    """

    time_s: FloatArray = column()
    xyz: FloatArray = column(np.float64, 3)
    R_world_vehicle: FloatArray = column(np.float64, 3, 3)
    sigma_xyz_m: FloatArray = column(np.float64, 3)
    sigma_attitude_rad: FloatArray = column(np.float64, 3)

    def to_world(self, i: int, xyz_vehicle: FloatArray) -> FloatArray:
        """Return (k, 3) positions [m, world] of positions [m, vehicle] of pose i."""
        return np.asarray(np.asarray(xyz_vehicle) @ self.R_world_vehicle[i].T + self.xyz[i])

    def to_vehicle(self, i: int, xyz_world: FloatArray) -> FloatArray:
        """Return (k, 3) positions [m, vehicle of pose i] of positions [m, world]."""
        return np.asarray((np.asarray(xyz_world) - self.xyz[i]) @ self.R_world_vehicle[i])
