"""Stereo images of a survey: which pairs there are and when they were taken; nothing opened yet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.arrays import AnyArray, FloatArray, checked
from linework.model.camera import RectifiedRig, StereoRig


@dataclass(frozen=True, slots=True)
class ImagePair:
    """Two images taken at one time.

    Parameters
    ----------
    number
        Its place in the series, from 0, also counting pairs that cannot be used.
    time_s
        When it was taken, by the survey's clock. [s]
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
        One line each about images that are in no pair.
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
class Poses:
    """Where the vehicle was at given times, and how it was turned.

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

    time_s: FloatArray
    xyz: FloatArray
    R_world_vehicle: FloatArray
    sigma_xyz_m: FloatArray
    sigma_attitude_rad: FloatArray

    def __post_init__(self) -> None:
        n = len(self.time_s)
        for name, shape in (
            ("time_s", (n,)), ("xyz", (n, 3)), ("R_world_vehicle", (n, 3, 3)),
            ("sigma_xyz_m", (n, 3)), ("sigma_attitude_rad", (n, 3)),
        ):  # fmt: skip
            object.__setattr__(self, name, checked(name, getattr(self, name), np.float64, shape))

    def __len__(self) -> int:
        return len(self.time_s)

    def take(self, index: AnyArray | Sequence[int]) -> Poses:
        """Return the poses chosen by an index array, in that order."""
        chosen = np.asarray(index, dtype=np.int64)
        return Poses(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))

    def to_world(self, i: int, xyz_vehicle: FloatArray) -> FloatArray:
        """Return (k, 3) places of the vehicle frame of pose i in the world. [m]"""  # noqa: D400
        return np.asarray(np.asarray(xyz_vehicle) @ self.R_world_vehicle[i].T + self.xyz[i])

    def to_vehicle(self, i: int, xyz_world: FloatArray) -> FloatArray:
        """Return (k, 3) places of the world in the vehicle frame of pose i. [m]"""  # noqa: D400
        return np.asarray((np.asarray(xyz_world) - self.xyz[i]) @ self.R_world_vehicle[i])
