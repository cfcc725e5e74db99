"""One stereo pair as it is seen from the world: where places are in both of its images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.model.images import Poses, RectifiedPair


@dataclass(frozen=True, slots=True)
class View:
    """A rectified pair and where its cameras were.

    Parameters
    ----------
    images
        Left and right, (height, width) uint8.
    to_pixel
        Of both, (3, 4) float64 from places to homogeneous column and row.
    centre
        (3,) float64 [m, local world]: projection centre of the left camera.
    ahead
        (3,) float64: where the cameras look.
    up
        (3,) float64: normal of the road.
    """

    number: int
    images: tuple[AnyArray, AnyArray]
    to_pixel: tuple[FloatArray, FloatArray]
    centre: FloatArray
    ahead: FloatArray
    up: FloatArray

    @classmethod
    def of(
        cls, pair: RectifiedPair, poses: Poses, i: int, origin: FloatArray, up_vehicle: FloatArray
    ) -> View:
        """Return a pair as seen from the world, less an origin. [m]

        Parameters
        ----------
        poses, i
            Pose i belongs to the pair.
        up_vehicle
            (3,) normal of the road in the vehicle frame.
        """  # noqa: D400
        rig, turn = pair.rig, poses.R_world_vehicle[i]
        inside = np.array([[rig.focal_px, 0.0, rig.cx], [0.0, rig.focal_px, rig.cy], [0.0, 0.0, 1.0]])
        axes = turn @ rig.R_vehicle_camera
        centre = turn @ rig.position_m + poses.xyz[i] - origin
        left = inside @ np.column_stack([axes.T, -axes.T @ centre])
        right = left.copy()
        right[0, 3] -= rig.focal_px * rig.base_m
        return cls(
            pair.number, (np.ascontiguousarray(pair.left), np.ascontiguousarray(pair.right)), (left, right),
            centre, axes[:, 2], turn @ up_vehicle,
        )  # fmt: skip

    def pixels(self, side: int, xyz: FloatArray) -> FloatArray:
        """Return (n, 2) columns and rows of (n, 3) places in one image; NaN behind the camera."""
        m = self.to_pixel[side]
        h = xyz @ m[:, :3].T + m[:, 3]
        depth = np.where(h[:, 2] > 0.1, h[:, 2], np.nan)
        return np.asarray(h[:, :2] / depth[:, None])

    def jacobian(self, side: int, place: FloatArray) -> FloatArray:
        """Return (2, 3) how the pixel of a place moves with it. [pixels/m]"""  # noqa: D400
        m = self.to_pixel[side]
        h = m[:, :3] @ place + m[:, 3]
        return np.asarray((m[:2, :3] - np.outer(h[:2] / h[2], m[2, :3])) / h[2])

    def depth_m(self, xyz: FloatArray) -> FloatArray:
        """Return (n,) how far ahead of the cameras (n, 3) places are. [m]"""  # noqa: D400
        return np.asarray((xyz - self.centre) @ self.ahead)

    def is_inside(self, side: int, xyz: FloatArray, margin_px: float = 2.0) -> AnyArray:
        """Return (n,) whether places are inside an image."""
        col, row = self.pixels(side, xyz).T
        height, width = self.images[side].shape
        with np.errstate(invalid="ignore"):
            return np.asarray(
                (col >= margin_px) & (row >= margin_px)
                & (col <= width - 1 - margin_px) & (row <= height - 1 - margin_px)
            )  # fmt: skip
