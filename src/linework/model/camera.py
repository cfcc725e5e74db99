"""Cameras of a van: lens and mounting of one camera, and two side by side as a stereo pair.

Pixels are (col, row) with (0, 0) in the middle of the upper left one. Camera frame: x right, y down, z forward.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from linework.arrays import FloatArray, checked

#: Shortest base of a stereo pair [m]: with less, a tenth of a pixel is 2 m at 10 m distance (focal length 1000 px).
LEAST_BASE_M = 0.005


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """A pinhole camera with lens distortion, fixed to the vehicle.

    Parameters
    ----------
    width, height
        Size of its images. [pixels]
    fx, fy, cx, cy
        Focal lengths and principal point. [pixels]
    distortion
        k1 k2 p1 p2 k3 of Brown's model as OpenCV has it.
    position_m
        (3,) float64 [m, vehicle]: projection centre.
    R_vehicle_camera
        (3, 3) float64: directions of the camera frame turned into the vehicle frame.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    position_m: FloatArray = field(default_factory=lambda: np.zeros(3))
    R_vehicle_camera: FloatArray = field(default_factory=lambda: LOOKING_AHEAD)

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise ValueError(f"image size {self.width} x {self.height}, expected at least one pixel")
        if not (self.fx > 0 and self.fy > 0 and math.isfinite(self.fx) and math.isfinite(self.fy)):
            raise ValueError(f"focal lengths {self.fx:g}, {self.fy:g}: expected finite numbers above 0")
        numbers = (self.cx, self.cy, *self.distortion)
        if len(self.distortion) != 5 or not all(map(math.isfinite, numbers)):
            raise ValueError("principal point and five distortion coefficients must be finite")
        position = checked("position_m", self.position_m, np.float64, (3,))
        rotation = checked("R_vehicle_camera", self.R_vehicle_camera, np.float64, (3, 3))
        if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6) or np.linalg.det(rotation) < 0:
            raise ValueError("R_vehicle_camera: not a rotation")
        object.__setattr__(self, "position_m", position)
        object.__setattr__(self, "R_vehicle_camera", rotation)

    @property
    def matrix(self) -> FloatArray:
        """(3, 3) float64: from the camera frame to homogeneous pixels, without distortion."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])


#: Directions of a level camera that looks straight ahead: its right is the vehicle's -y, its down is -z.
LOOKING_AHEAD: FloatArray = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
LOOKING_AHEAD.flags.writeable = False


@dataclass(frozen=True, slots=True)
class StereoRig:
    """A stereo pair: two cameras with parallel views, the right one to the right of the left one.

    Raises
    ------
    ValueError
        No base, cameras swapped, or views not parallel; with numbers.
    """

    left: Camera
    right: Camera

    def __post_init__(self) -> None:
        base = self.left.R_vehicle_camera.T @ (self.right.position_m - self.left.position_m)
        length = float(np.linalg.norm(base))
        if length < LEAST_BASE_M:
            raise ValueError(
                f"base of {length:.4f} m between the cameras, expected at least {LEAST_BASE_M:g} m"
            )
        if base[0] < -0.5 * length:
            raise ValueError(f"the right camera is {-base[0]:.3f} m to the left of the left one: swapped")
        if base[0] < 0.7 * length:
            raise ValueError("the base between the cameras is not perpendicular to their view")
        turn = float(self.left.R_vehicle_camera[:, 2] @ self.right.R_vehicle_camera[:, 2])
        if turn < math.cos(math.radians(30.0)):
            raise ValueError(
                f"the views of the cameras differ by {math.degrees(math.acos(max(turn, -1.0))):.0f} degrees"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class RectifiedRig:
    """Geometry of a pair after rectification: two equal ideal cameras, rows are epipolar lines.

    A point at (col, row) in the left image is at (col - disparity, row) in the right one.

    Parameters
    ----------
    focal_px, cx, cy
        Focal length and principal point of both. [pixels]
    width, height
        Size of both images. [pixels]
    base_m
        Distance between the projection centres. [m]
    position_m
        (3,) float64 [m, vehicle]: projection centre of the left one.
    R_vehicle_camera
        (3, 3) float64: of both; x is along the base.
    """

    focal_px: float
    cx: float
    cy: float
    width: int
    height: int
    base_m: float
    position_m: FloatArray
    R_vehicle_camera: FloatArray

    def intersect(self, col: FloatArray, row: FloatArray, disparity: FloatArray) -> FloatArray:
        """Return (n, 3) places [m, vehicle] of left pixels with their disparities [pixels].

        >>> rig = RectifiedRig(focal_px=700.0, cx=600.0, cy=180.0, width=1200, height=370, base_m=0.5,
        ...     position_m=np.array([0.0, 0.25, 1.6]), R_vehicle_camera=LOOKING_AHEAD)
        >>> rig.intersect(np.array([600.0]), np.array([292.0]), np.array([35.0])).round(9).tolist()
        [[10.0, 0.25, 0.0]]
        """
        depth = self.focal_px * self.base_m / np.asarray(disparity, dtype=np.float64)
        ray = np.stack(
            [(col - self.cx) / self.focal_px, (row - self.cy) / self.focal_px, np.ones_like(depth)], -1
        )
        return np.asarray((ray * depth[:, None]) @ self.R_vehicle_camera.T + self.position_m)

    def project(self, xyz_vehicle: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return column, row and disparity [pixels] of (n, 3) places [m, vehicle]; NaN behind the cameras."""
        x, y, z = ((np.asarray(xyz_vehicle) - self.position_m) @ self.R_vehicle_camera).T
        z = np.where(z > 0.0, z, np.nan)
        col, row = self.cx + self.focal_px * x / z, self.cy + self.focal_px * y / z
        return col, row, self.focal_px * self.base_m / z
