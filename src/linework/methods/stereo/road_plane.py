"""The road of a stereo pair: a plane in disparity, from the textured places in front of the van.

How high the cameras stand above the road need not be known: the pair shows it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from linework.kernels.road_disparity import best_plane, cell_disparities
from linework.model.arrays import FloatArray
from linework.model.camera import RectifiedRig
from linework.model.images import RectifiedPair

#: Cameras on cars and vans stand so high above the road. [m]
HEIGHT_M = (1.0, 4.0)
#: The road ahead is so far from level to the vehicle: crossfall, springs, changes of grade. [rad]
TILT_RAD = math.radians(8.0)
#: Cells that give one place each. [columns, rows]
CELL = (16, 6)
#: The road's surface is looked for so far ahead and to the sides of the cameras. [m]
AHEAD_M, ASIDE_M = 30.0, 5.0
#: Places of one plane differ by the noise of matching slanted windows, and by the road's shape. [pixels]
TOLERANCE_PX = 1.0
#: Trials of three places: a plane that a third of the places are on is met once in 27.
N_TRIALS = 300
#: Fewer places in agreement are no road.
LEAST_PLACES = 25


@dataclass(frozen=True, slots=True)
class RoadPlane:
    """Disparity of the road in the left image: ``d = d0 + du (col - cx) + dv (row - cy)``. [pixels]"""

    d0: float
    du: float
    dv: float

    def disparity(self, rig: RectifiedRig, col: FloatArray, row: FloatArray) -> FloatArray:
        """Return the road's disparity at left pixels; 0 or less above its horizon."""
        return np.asarray(self.d0 + self.du * (col - rig.cx) + self.dv * (row - rig.cy))

    def in_right(self) -> RoadPlane:
        """Return the same road by its places in the right image."""
        return RoadPlane(*(p / (1.0 - self.du) for p in (self.d0, self.du, self.dv)))

    def up(self, rig: RectifiedRig) -> FloatArray:
        """Return (3,) the road's normal in the camera frame, upwards."""
        n = -np.array([self.du, self.dv, self.d0 / rig.focal_px])
        return np.asarray(n / np.linalg.norm(n))

    def camera_height_m(self, rig: RectifiedRig) -> float:
        """Return how high the left camera is above the road. [m]"""  # noqa: D400
        return rig.base_m / math.hypot(self.du, self.dv, self.d0 / rig.focal_px)

    def horizon_row(self, rig: RectifiedRig) -> float:
        """Return the row of the road's horizon in the middle column of the image."""
        return rig.cy - (self.d0 + self.du * (0.5 * rig.width - rig.cx)) / self.dv


def find_road_plane(pair: RectifiedPair) -> RoadPlane | None:
    """Return the road's plane in a pair, or None where no surface lies where a road must.

    Notes
    -----
    A plane n . P = -h in the camera frame has disparities ``-(B / h) n . (u, v, f)``, linear in the pixel. The
    plane is the one that most places agree with, among those that height and tilt allow; then least squares.
    """
    rig = pair.rig
    up = rig.R_vehicle_camera[2]
    limits = _disparity_limits(rig, up)
    first = int(np.argmax(limits[:, 1] > 2.0))
    found = cell_disparities(pair.left, pair.right, limits, CELL, first)
    u, v, d = found[:, 0] - rig.cx, found[:, 1] - rig.cy, found[:, 2]
    depth = rig.focal_px * rig.base_m / d
    ahead = (depth < AHEAD_M) & (np.abs(u * depth / rig.focal_px) < ASIDE_M)
    places = np.column_stack([u, v, d, np.ones(len(d))])[ahead]
    if len(places) < LEAST_PLACES:
        return None
    trials = np.random.default_rng(7).integers(0, len(places), (N_TRIALS, 3))
    plane = best_plane(places, trials, _plane_limits(rig, up), TOLERANCE_PX)
    if plane[3] < 0.5 * LEAST_PLACES:
        return None
    p = plane[:3]
    design = np.column_stack([np.ones(len(places)), places[:, :2]])
    for _ in range(4):
        residual = np.abs(places[:, 2] - design @ p) / TOLERANCE_PX
        weight = np.sqrt(np.clip(1.0 - residual**2, 0.0, None))
        p, *_ = np.linalg.lstsq(design * weight[:, None], places[:, 2] * weight, rcond=None)
    return RoadPlane(*p.tolist()) if p[2] > 0.0 else None


def _disparity_limits(rig: RectifiedRig, up: FloatArray) -> FloatArray:
    """Return (height, 2): the disparities that a road can have in each row."""
    row = np.arange(rig.height) - rig.cy
    # The angle of each row's rays below level
    below = np.arctan2(row, rig.focal_px) - math.atan2(up[2], -up[1])
    ray = np.hypot(row, rig.focal_px)
    least = rig.base_m / HEIGHT_M[1] * ray * np.sin(np.clip(below - TILT_RAD, 0.0, None))
    largest = rig.base_m / HEIGHT_M[0] * ray * np.sin(np.clip(below + TILT_RAD, 0.0, None))
    return np.column_stack([least, largest])


def _plane_limits(rig: RectifiedRig, up: FloatArray) -> FloatArray:
    roll = math.atan2(up[0], up[1])
    pitch = math.atan2(up[2], up[1])
    tilts = [sorted(math.tan(a + s * TILT_RAD) for s in (-1.0, 1.0)) for a in (_small(roll), _small(pitch))]
    scale = rig.focal_px
    slope = [rig.base_m / HEIGHT_M[1] * math.cos(_small(pitch)), rig.base_m / HEIGHT_M[0]]
    slope[0] *= 0.95
    return np.array([tilts[0], [t * scale for t in tilts[1]], slope])


def _small(angle: float) -> float:
    """Return the angle between -90 and 90 degrees that has the same tangent."""
    return math.remainder(angle, math.pi)
