"""The road of a stereo pair: a plane in disparity, and how the road departs from it, from textured places.

How high the cameras stand above the road need not be known: the pair shows it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray
from linework.kernels.images.road_disparity import best_plane, cell_disparities
from linework.model.camera import RectifiedRig
from linework.model.images import RectifiedPair

#: Cameras on cars and vans stand so high above the road. [m]
CAMERA_HEIGHT_M = (1.0, 4.0)
#: The road ahead is so far from level to the vehicle: crossfall, springs, changes of grade. [rad]
TILT_RAD = math.radians(8.0)
#: Cells that give one place each. [columns, rows]
CELL = (12, 5)
#: The road's plane is looked for so far ahead and to the sides of the cameras, its shape so far. [m]
PLANE_AHEAD_M, PLANE_ASIDE_M = 20.0, 4.0
SHAPE_AHEAD_M, SHAPE_ASIDE_M = 25.0, 8.0
#: A place this far to the side counts half as much for the plane: it may be beyond the crown, or on the verge. [m]
HALF_WEIGHT_M = 2.0
#: Largest heights that belong to the road's shape, pass by pass [m], and the noise of a place [m, pixels].
SHAPE_GATES_M = (0.40, 0.25, 0.15, 0.10)
SHAPE_NOISE = (0.02, 0.5)
#: What is known of the shape beforehand, as standard deviations: height, slopes across and ahead, crown (4 % to
#: both sides, over 4 m: 0.01/m), crests and sags (500 m radius), change of crossfall (1 % in 10 m).
SHAPE_SIGMAS = (0.10, 0.03, 0.02, 0.01, 0.001, 0.001)
#: Which of them is the crown: positive, it would be a hollow.
HOLLOW = 3
#: Which of them say how the road lies to the sides of the van's own lane.
ASIDE_TERMS = np.array([False, True, False, True, False, True])
#: Places of one plane differ by the noise of matching slanted windows, and by the road's shape. [pixels]
TOLERANCE_PX = 1.0
#: Trials of three places: a plane that a third of the places are on is met once in 27.
N_TRIALS = 300
#: Fewer places in agreement are no road.
LEAST_PLANE_PLACES, LEAST_SUPPORT = 25, 8.0
#: Neighbouring places err together where the road is not what a polynomial says: so many as one.
SHARED_PLACES = 5.0


@dataclass(frozen=True, slots=True)
class RoadPlane:
    """Disparity of the road in the left image.

    Parameters
    ----------
    d0, du, dv
        ``d = d0 + du (col - cx) + dv (row - cy)`` [pixels].
    """

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


@dataclass(frozen=True, slots=True)
class RoadShape:
    """The road of a pair: its plane, and its height above it as a polynomial of second order.

    Parameters
    ----------
    plane
        In front of the van.
    shape
        (6,) of 1, X, Z, X^2, Z^2, X Z with X across and Z ahead of the left camera [m].
    """

    plane: RoadPlane
    shape: FloatArray

    def disparity(self, rig: RectifiedRig, col: FloatArray, row: FloatArray) -> FloatArray:
        """Return the road's disparity at left pixels below the plane's horizon."""
        return self._disparity(rig, col, row, self.shape)

    def level_disparity(self, rig: RectifiedRig, col: FloatArray, row: FloatArray) -> FloatArray:
        """Return the disparity of the van's own lane carried on to the sides: roads fall from it, kerbs rise."""
        return self._disparity(rig, col, row, np.where(ASIDE_TERMS, 0.0, self.shape))

    def _disparity(
        self, rig: RectifiedRig, col: FloatArray, row: FloatArray, shape: FloatArray
    ) -> FloatArray:
        d = np.maximum(self.plane.disparity(rig, col, row), 1e-3)
        per_px = rig.base_m / d
        z = np.minimum(rig.focal_px * per_px, SHAPE_AHEAD_M)
        x = np.clip((col - rig.cx) * per_px, -SHAPE_ASIDE_M, SHAPE_ASIDE_M)
        height = _terms(x, z) @ shape
        return np.asarray(d / (1.0 - np.clip(height / self.plane.camera_height_m(rig), -0.5, 0.5)))


def _terms(x: FloatArray, z: FloatArray) -> FloatArray:
    return np.column_stack([np.ones(len(x)), x, z, x * x, z * z, x * z])


def fit_pair_road(pair: RectifiedPair) -> RoadShape | None:
    """Return the road in a pair, or None where no surface lies where a road must.

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
    x, z = u * rig.base_m / d, rig.focal_px * rig.base_m / d
    weight = 1.0 / (1.0 + (x / HALF_WEIGHT_M) ** 2)
    places = np.column_stack([u, v, d, weight])
    ahead = (z < PLANE_AHEAD_M) & (np.abs(x) < PLANE_ASIDE_M)
    plane = _fitted_plane(places[ahead], _plane_limits(rig, up))
    if plane is None:
        return None
    near = (z < SHAPE_AHEAD_M) & (np.abs(x) < SHAPE_ASIDE_M)
    return RoadShape(plane, _fitted_shape(rig, plane, found[near]))


def _fitted_plane(places: FloatArray, limits: FloatArray) -> RoadPlane | None:
    """Return the plane of most of the places (n, 4): u, v, disparity, weight."""
    if len(places) < LEAST_PLANE_PLACES:
        return None
    trials = np.random.default_rng(7).integers(0, len(places), (N_TRIALS, 3))
    best = best_plane(places, trials, limits, TOLERANCE_PX)
    if best[3] < LEAST_SUPPORT:
        return None
    p = best[:3]
    design = np.column_stack([np.ones(len(places)), places[:, :2]])
    for _ in range(4):
        residual = np.abs(places[:, 2] - design @ p) / TOLERANCE_PX
        weight = np.sqrt(np.clip(1.0 - residual**2, 0.0, None) * places[:, 3])
        p, *_ = np.linalg.lstsq(design * weight[:, None], places[:, 2] * weight, rcond=None)
    return RoadPlane(*p.tolist()) if p[2] > 0.0 else None


def _fitted_shape(rig: RectifiedRig, plane: RoadPlane, found: FloatArray) -> FloatArray:
    """Return how the road departs from its plane, from places (n, 3): column, row, disparity."""
    road = plane.disparity(rig, found[:, 0], found[:, 1])
    below = road > 1.0
    road, d = road[below], found[below, 2]
    h = plane.camera_height_m(rig)
    height = h * (1.0 - road / d)
    terms = _terms((found[below, 0] - rig.cx) * rig.base_m / d, rig.focal_px * rig.base_m / d)
    sigma = np.hypot(SHAPE_NOISE[0], h * SHAPE_NOISE[1] / d)
    prior = np.diag(1.0 / np.array(SHAPE_SIGMAS))
    shape = np.zeros(6)
    for gate in SHAPE_GATES_M:
        off = (height - terms @ shape) / np.hypot(gate, 2.0 * sigma)
        weight = np.sqrt(np.clip(1.0 - off * off, 0.0, None) / SHARED_PLACES) / sigma
        a = np.vstack([terms * weight[:, None], prior])
        b = np.concatenate([height * weight, np.zeros(6)])
        shape = np.linalg.lstsq(a, b, rcond=None)[0]
        if shape[HOLLOW] > 0.0:
            # Roads fall to their sides: what rises there are footways
            level = np.arange(6) != HOLLOW
            shape[HOLLOW], shape[level] = 0.0, np.linalg.lstsq(a[:, level], b, rcond=None)[0]
    return np.asarray(shape)


def _disparity_limits(rig: RectifiedRig, up: FloatArray) -> FloatArray:
    """Return (height, 2): the disparities that a road can have in each row."""
    row = np.arange(rig.height) - rig.cy
    # The angle of each row's rays below level
    below = np.arctan2(row, rig.focal_px) - math.atan2(up[2], -up[1])
    ray = np.hypot(row, rig.focal_px)
    least = rig.base_m / CAMERA_HEIGHT_M[1] * ray * np.sin(np.clip(below - TILT_RAD, 0.0, None))
    largest = rig.base_m / CAMERA_HEIGHT_M[0] * ray * np.sin(np.clip(below + TILT_RAD, 0.0, None))
    return np.column_stack([least, largest])


def _plane_limits(rig: RectifiedRig, up: FloatArray) -> FloatArray:
    roll = math.atan2(up[0], up[1])
    pitch = math.atan2(up[2], up[1])
    tilts = [sorted(math.tan(a + s * TILT_RAD) for s in (-1.0, 1.0)) for a in (_small(roll), _small(pitch))]
    scale = rig.focal_px
    slope = [rig.base_m / CAMERA_HEIGHT_M[1] * math.cos(_small(pitch)), rig.base_m / CAMERA_HEIGHT_M[0]]
    slope[0] *= 0.95
    return np.array([tilts[0], [t * scale for t in tilts[1]], slope])


def _small(angle: float) -> float:
    """Return the angle between -90 and 90 degrees that has the same tangent."""
    return math.remainder(angle, math.pi)
