"""Projection of places of the world into both images of a pair, and whether an object hides them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.methods.picked_edge.fitted import CLEARLY_BETTER, NEARER_PX, NEARER_SHARE, SAME_WINDOW
from linework.model.images import Poses, RectifiedPair

#: Half size of the windows that are compared. [rows, columns]
_HALF = (4, 7)
#: Largest disparity that is searched, as a multiple of the place's own: a quarter of its distance.
_NEAREST = 4.0
#: Smallest depth of a place that is projected, and of one that may be hidden. [m]
_LEAST_DEPTH_M, _LEAST_HIDDEN_DEPTH_M = 0.1, 1.0


@dataclass(frozen=True, slots=True)
class PairView:
    """A rectified pair with the projections of both cameras.

    Parameters
    ----------
    number
        Number of the pair.
    images
        Left and right, (height, width) uint8.
    to_pixel
        (3, 4) projections of both images, from the local world [m] to homogeneous column and row.
    centre
        (3,) projection centre of the left camera. [m, local world]
    ahead
        (3,) unit direction of view.
    up
        (3,) unit normal of the road.
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
    ) -> PairView:
        """Return the view of a pair.

        Parameters
        ----------
        poses, i
            Poses of the survey and the index of the pair's own.
        origin
            (3,) origin of the local world. [m, world]
        up_vehicle
            (3,) unit normal of the road in the vehicle frame.
        """
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
        """Return (n, 2) columns and rows of (n, 3) places [m, local world] in one image; NaN behind the camera."""
        m = self.to_pixel[side]
        h = xyz @ m[:, :3].T + m[:, 3]
        depth = np.where(h[:, 2] > _LEAST_DEPTH_M, h[:, 2], np.nan)
        return np.asarray(h[:, :2] / depth[:, None])

    def jacobian(self, side: int, place: FloatArray) -> FloatArray:
        """Return (2, 3) the derivatives of column and row by the place. [pixels/m]"""  # noqa: D400
        m = self.to_pixel[side]
        h = m[:, :3] @ place + m[:, 3]
        return np.asarray((m[:2, :3] - np.outer(h[:2] / h[2], m[2, :3])) / h[2])

    def depth_m(self, xyz: FloatArray) -> FloatArray:
        """Return (n,) depths of (n, 3) places in front of the cameras. [m]"""  # noqa: D400
        return np.asarray((xyz - self.centre) @ self.ahead)

    def is_inside(self, side: int, xyz: FloatArray, margin_px: float = 2.0) -> AnyArray:
        """Return (n,) bool: the place is inside an image by at least a margin."""
        col, row = self.pixels(side, xyz).T
        height, width = self.images[side].shape
        with np.errstate(invalid="ignore"):
            return np.asarray(
                (col >= margin_px) & (row >= margin_px)
                & (col <= width - 1 - margin_px) & (row <= height - 1 - margin_px)
            )  # fmt: skip


def is_hidden(view: PairView, places: FloatArray) -> bool:
    """Return whether most of (n, 3) places [m, local world] are hidden by an object.

    Notes
    -----
    The window around each place in the left image is searched along its row of the right image. The place is hidden
    where a disparity larger than its own fits better.
    """
    ahead = places[view.is_inside(0, places) & (view.depth_m(places) > _LEAST_HIDDEN_DEPTH_M)]
    if len(ahead) == 0:
        return False
    left, right = view.pixels(0, ahead), view.pixels(1, ahead)
    votes = [
        _is_nearer(view.images, c, r, d) for (c, r), d in zip(left, left[:, 0] - right[:, 0], strict=True)
    ]
    return 2 * sum(votes) > len(votes)


def _is_nearer(images: tuple[AnyArray, AnyArray], col: float, row: float, disparity: float) -> bool:
    """Return whether a left pixel shows something nearer than its expected disparity says."""
    left, right = images
    c, r = round(col), round(row)
    high, wide = _HALF
    if not (high <= r < left.shape[0] - high and wide <= c < left.shape[1] - wide):
        return False
    window = _normal(left[r - high : r + high + 1, c - wide : c + wide + 1].astype(np.float64)[None])[0]
    first = max(c - wide - int(_NEAREST * disparity) - 1, 0)
    strip = right[r - high : r + high + 1, first : c + wide + 1 - max(int(disparity) - 2, 0)].astype(
        np.float64
    )
    if strip.shape[1] < 2 * wide + 1:
        return False
    shifted = np.lib.stride_tricks.sliding_window_view(strip, window.shape)[0]
    alike = np.einsum("krc,rc->k", _normal(shifted), window)
    found = c - wide - (first + np.arange(len(alike)))
    nearer = found > max(NEARER_SHARE * disparity, disparity + NEARER_PX)
    if not nearer.any() or nearer.all():
        return False
    best = alike[nearer].max()
    return bool(best > SAME_WINDOW and best > alike[~nearer].max() + CLEARLY_BETTER)


def _normal(windows: FloatArray) -> FloatArray:
    """Return (k, rows, columns) windows less their mean, scaled to unit norm; uniform ones stay 0."""
    out = windows - windows.mean(axis=(1, 2), keepdims=True)
    length = np.sqrt((out * out).sum(axis=(1, 2), keepdims=True))
    return np.asarray(out / np.maximum(length, 1.0))
