"""Where places on the ground are in the images of a drive, and which image sees each of them best."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray
from linework.imaging.rectify import directions, distorted
from linework.model.camera import Camera
from linework.model.images import Poses

#: Longest footprint of a pixel on the ground that is shown: the width of the narrowest lines. [m]
LONGEST_FOOTPRINT_M = 0.10
#: Nearest depth that is shown: nearer is the van itself. [m]
NEAREST_DEPTH_M = 0.5
#: Margin inside an image in which nothing is taken, for interpolation. [pixels]
_MARGIN_PX = 1.0
#: Places along each edge of an image from which its field of view is computed.
_N_EDGE = 33


@dataclass(frozen=True, slots=True)
class GroundView:
    """How a camera sees places on the ground from one pose.

    Parameters
    ----------
    pixels
        (n, 2) column and row in the original image; NaN where it does not see the place. [pixels]
    footprint_m
        (n,) length of a pixel on the level ground there, away from the camera; infinite where it does not see it. [m]
    """

    pixels: FloatArray
    footprint_m: FloatArray


def ground_view(camera: Camera, field: FloatArray, poses: Poses, i: int, xyz: FloatArray) -> GroundView:
    """Return how a camera sees places on the ground at pose i.

    Parameters
    ----------
    field
        The camera's `field_of_view`.
    xyz
        (n, 3) places on the ground; NaN in height: not known. [m, world]

    Notes
    -----
    Nothing is hidden behind anything: what stands on the ground is laid down behind itself.
    """
    vehicle = poses.to_vehicle(i, xyz)
    seen = (vehicle - camera.position_m) @ camera.R_vehicle_camera
    depth = np.where(seen[:, 2] > NEAREST_DEPTH_M, seen[:, 2], np.nan)
    ideal = seen[:, :2] / depth[:, None]
    inside = ((ideal >= field[0]) & (ideal <= field[1])).all(axis=1)
    pixels = distorted(camera, np.where(inside[:, None], ideal, 0.0))
    low, high = _MARGIN_PX, np.array([camera.width, camera.height]) - 1.0 - _MARGIN_PX
    inside &= ((pixels >= low) & (pixels <= high)).all(axis=1)
    eye = poses.xyz[i] + camera.position_m @ poses.R_world_vehicle[i].T
    above_m = np.maximum(eye[2] - xyz[:, 2], 1e-3)
    range_m = np.linalg.norm(seen, axis=1)
    # An angle of a pixel, off the axis smaller, seen at the slope of the ray
    angle = np.nan_to_num(depth, nan=1.0) / (range_m * min(camera.fx, camera.fy))
    footprint_m = np.where(inside, range_m**2 * angle / above_m, np.inf)
    footprint_m[~np.isfinite(xyz[:, 2]) | ~(eye[2] > xyz[:, 2])] = np.inf
    pixels = np.where(np.isfinite(footprint_m)[:, None], pixels, np.nan)
    return GroundView(pixels, footprint_m)


def field_of_view(camera: Camera) -> FloatArray:
    """Return (2, 2) smallest and largest directions x/z, y/z that a camera sees.

    Far outside, the lens model folds back into the image.
    """
    share = np.linspace(0.0, 1.0, _N_EDGE)
    zero, one = np.zeros(_N_EDGE), np.ones(_N_EDGE)
    edges = np.concatenate(
        [np.column_stack(pair) for pair in ((share, zero), (share, one), (zero, share), (one, share))]
    )
    seen = directions(camera, edges * [camera.width - 1.0, camera.height - 1.0])
    return np.stack([np.nanmin(seen, axis=0), np.nanmax(seen, axis=0)])


@dataclass(slots=True)
class BestView:
    """Which of the poses looked at so far sees each place best; memory is that of one view, however many there are.

    Parameters
    ----------
    pose
        (n,) number of the pose with the shortest footprint, the first of equal ones; -1: none sees it well.
    footprint_m
        (n,) that footprint; `LONGEST_FOOTPRINT_M` where there is none. [m]
    pixels
        (n, 2) column and row in the original image of that pose; NaN where there is none. [pixels]
    """

    pose: IntArray
    footprint_m: FloatArray
    pixels: FloatArray

    @classmethod
    def of(cls, n: int) -> BestView:
        """Return that of n places before any pose was looked at."""
        return cls(np.full(n, -1, dtype=np.int64), np.full(n, LONGEST_FOOTPRINT_M), np.full((n, 2), np.nan))

    def look(self, pose: int, view: GroundView, at: IntArray | None = None) -> None:
        """Look from a pose, too; at some of the places (k,), or at all."""
        places = np.arange(len(self.pose)) if at is None else at
        is_better = view.footprint_m < self.footprint_m[places]
        better = places[is_better]
        self.pose[better] = pose
        self.footprint_m[better] = view.footprint_m[is_better]
        self.pixels[better] = view.pixels[is_better]


def image_values(image: AnyArray, pixels: FloatArray) -> AnyArray:
    """Return the values of an image (height, width) or (height, width, 3) at pixels (n, 2), between them by interpolation."""
    low = np.floor(pixels).astype(np.int64)
    share = pixels - low
    col, row = low[:, 0], low[:, 1]
    values = image.astype(np.float32)
    shape = (-1,) + (1,) * (image.ndim - 2)
    u, v = (share[:, k].reshape(shape) for k in (0, 1))
    above = values[row, col] * (1.0 - u) + values[row, col + 1] * u
    below = values[row + 1, col] * (1.0 - u) + values[row + 1, col + 1] * u
    return np.asarray(above * (1.0 - v) + below * v)


def poses_near(poses: Poses, low: FloatArray, high: FloatArray, within_m: float) -> IntArray:
    """Return the numbers of the poses within a distance of a rectangle in plan, in their order."""
    xy = poses.xyz[:, :2]
    away = np.maximum(np.maximum(low - xy, xy - high), 0.0)
    is_near: BoolArray = np.hypot(*away.T) <= within_m
    return np.flatnonzero(is_near)


def with_neighbours(numbers: IntArray, chosen: IntArray) -> IntArray:
    """Return those of the numbers (n,), in order, that were chosen, each with the ones before and after it.

    >>> with_neighbours(np.array([2, 4, 6, 8, 10]), np.array([4, 4, -1])).tolist()
    [2, 4, 6]
    """
    is_chosen = np.isin(numbers, chosen)
    kept = is_chosen.copy()
    kept[1:] |= is_chosen[:-1]
    kept[:-1] |= is_chosen[1:]
    return numbers[kept]


def moved_poses(poses: Poses, numbers: IntArray, least_m: float) -> IntArray:
    """Return those of the poses (n,) that are a distance from the last one returned; the first is. [m]"""  # noqa: D400
    kept: list[int] = []
    for i in numbers.tolist():
        if not kept or np.linalg.norm(poses.xyz[i] - poses.xyz[kept[-1]]) >= least_m:
            kept.append(i)
    return np.array(kept, dtype=np.int64)
