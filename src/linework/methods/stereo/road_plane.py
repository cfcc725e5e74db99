"""The road surface of a stereo pair: a plane in disparity and a polynomial above it, fitted to textured places.

The height of the cameras above the road need not be known: it follows from the pair itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray
from linework.kernels.images.road_disparity import (
    MATCHED_COL,
    MATCHED_DISPARITY,
    MATCHED_ROW,
    PLANE_D,
    PLANE_SUPPORT,
    PLANE_U,
    PLANE_V,
    PLANE_WEIGHT,
    best_plane,
    cell_disparities,
)
from linework.methods.stereo.fitted import (
    LEAST_SUPPORT,
    SHAPE_GATES_M,
    SHAPE_NOISE,
    SHARED_PLACES,
    TOLERANCE_PX,
)
from linework.model.camera import RectifiedRig
from linework.model.images import RectifiedPair

#: Smallest and largest height of cameras on cars and vans above the road. [m]
CAMERA_HEIGHT_M = (1.0, 4.0)
#: Largest tilt of the road ahead relative to the vehicle: crossfall, springs, changes of grade. [rad]
TILT_RAD = math.radians(8.0)
#: Size of the cells that give one place each. [columns, rows]
CELL = (12, 5)
#: Range ahead and to the sides of the cameras in which the plane is fitted, and its shape. [m]
PLANE_AHEAD_M, PLANE_ASIDE_M = 20.0, 4.0
SHAPE_AHEAD_M, SHAPE_ASIDE_M = 25.0, 8.0
#: Distance to the side at which a place has half the weight: it may be beyond the crown, or on the verge. [m]
HALF_WEIGHT_M = 2.0
#: Terms of the shape with X across and Z ahead [m]: 1, X, Z, X^2, Z^2, X Z.
LEVEL_TERM, X_TERM, Z_TERM, XX_TERM, ZZ_TERM, XZ_TERM = range(6)
N_TERMS = 6
#: Standard deviations of the terms beforehand: height [m], slopes across and ahead, crown (4 % to both sides, over 4 m:
#: 0.01/m), crests and sags (500 m radius: 0.001/m), change of crossfall (1 % in 10 m: 0.001/m).
SHAPE_SIGMAS = (0.10, 0.03, 0.02, 0.01, 0.001, 0.001)
#: Terms that say how the road lies to the sides of the van's own lane.
ASIDE_TERMS = np.isin(np.arange(N_TERMS), (X_TERM, XX_TERM, XZ_TERM))
#: Number of trials of three places: if a third of the places are on the plane, one trial in 27 has three of them.
N_TRIALS = 300
#: Seed of the trials: the same pair gives the same plane.
TRIALS_SEED = 7
#: Fewest places that a plane is fitted to.
LEAST_PLANE_PLACES = 25
#: Rounds of the least-squares fit of the plane after the trials.
PLANE_ROUNDS = 4
#: Smallest disparity that a row must allow, and of a place below the horizon, to be searched or used. [pixels]
LEAST_SEARCHED_PX, LEAST_ROAD_PX = 2.0, 1.0
#: Largest departure of the surface from the plane, as a share of the camera's height, in disparities.
MOST_DEPARTURE = 0.5
#: Factor on the smallest slope of disparities over rows that is allowed. How it was chosen is not recorded.
SLOPE_SLACK = 0.95


@dataclass(frozen=True, slots=True)
class RoadPlane:
    """The plane of the road, as disparities in the left image.

    Parameters
    ----------
    d0, du, dv
        ``d = d0 + du (col - cx) + dv (row - cy)``. [pixels, 1, 1]
    """

    d0: float
    du: float
    dv: float

    def disparity(self, rig: RectifiedRig, col: FloatArray, row: FloatArray) -> FloatArray:
        """Return (n,) disparities of the plane at left pixels (n,); 0 or less above its horizon. [pixels]"""  # noqa: D400
        return np.asarray(self.d0 + self.du * (col - rig.cx) + self.dv * (row - rig.cy))

    def in_right(self) -> RoadPlane:
        """Return the same plane as a function of pixels of the right image."""
        return RoadPlane(*(p / (1.0 - self.du) for p in (self.d0, self.du, self.dv)))

    def up(self, rig: RectifiedRig) -> FloatArray:
        """Return (3,) the unit normal of the road in the camera frame, upwards."""
        n = -np.array([self.du, self.dv, self.d0 / rig.focal_px])
        return np.asarray(n / np.linalg.norm(n))

    def camera_height_m(self, rig: RectifiedRig) -> float:
        """Return the height of the left camera above the road. [m]"""  # noqa: D400
        return rig.base_m / math.hypot(self.du, self.dv, self.d0 / rig.focal_px)


@dataclass(frozen=True, slots=True)
class RoadShape:
    """The road surface of a pair: its plane, and heights above it as a polynomial of second order.

    Parameters
    ----------
    plane
        Plane of the road in front of the van.
    shape
        (6,) coefficients of `LEVEL_TERM` to `XZ_TERM`, with X across and Z ahead of the left camera. [m]
    """

    plane: RoadPlane
    shape: FloatArray

    def disparity(self, rig: RectifiedRig, col: FloatArray, row: FloatArray) -> FloatArray:
        """Return (n,) disparities of the surface at left pixels (n,) below the horizon of the plane. [pixels]"""  # noqa: D400
        return self._disparity(rig, col, row, self.shape)

    def level_disparity(self, rig: RectifiedRig, col: FloatArray, row: FloatArray) -> FloatArray:
        """Return (n,) disparities of the van's own lane extended to the sides: roads fall below it, kerbs rise. [pixels]"""  # noqa: D400
        return self._disparity(rig, col, row, np.where(ASIDE_TERMS, 0.0, self.shape))

    def heights_m(self, x: FloatArray, z: FloatArray) -> FloatArray:
        """Return (n,) heights above the plane at places across and ahead of the left camera (n,); NaN beyond what was fitted. [m]"""  # noqa: D400
        inside = (z > 0.0) & (z <= SHAPE_AHEAD_M) & (np.abs(x) <= SHAPE_ASIDE_M)
        return np.where(inside, _terms(x, z) @ self.shape, np.nan)

    def _disparity(
        self, rig: RectifiedRig, col: FloatArray, row: FloatArray, shape: FloatArray
    ) -> FloatArray:
        d = np.maximum(self.plane.disparity(rig, col, row), 1e-3)
        per_px = rig.base_m / d
        z = np.minimum(rig.focal_px * per_px, SHAPE_AHEAD_M)
        x = np.clip((col - rig.cx) * per_px, -SHAPE_ASIDE_M, SHAPE_ASIDE_M)
        height = _terms(x, z) @ shape
        share = np.clip(height / self.plane.camera_height_m(rig), -MOST_DEPARTURE, MOST_DEPARTURE)
        return np.asarray(d / (1.0 - share))


def _terms(x: FloatArray, z: FloatArray) -> FloatArray:
    """Return (n, 6) `LEVEL_TERM` to `XZ_TERM` at places."""
    return np.column_stack([np.ones(len(x)), x, z, x * x, z * z, x * z])


def fit_pair_road(pair: RectifiedPair) -> RoadShape | None:
    """Return the road surface of a pair; None where no plane lies where a road must.

    Notes
    -----
    A plane n . P = -h in the camera frame has disparities ``-(B / h) n . (u, v, f)``, linear in the pixel. The plane
    is the one that most places agree with, among those of possible height and tilt, refined by least squares.
    """
    rig = pair.rig
    up = rig.R_vehicle_camera[2]
    limits = _disparity_limits(rig, up)
    first = int(np.argmax(limits[:, 1] > LEAST_SEARCHED_PX))
    found = cell_disparities(pair.left, pair.right, limits, CELL, first)
    u, v, d = found[:, MATCHED_COL] - rig.cx, found[:, MATCHED_ROW] - rig.cy, found[:, MATCHED_DISPARITY]
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
    """Return the plane that most of the places (n, 4) agree with: columns `PLANE_U` to `PLANE_WEIGHT`."""
    if len(places) < LEAST_PLANE_PLACES:
        return None
    trials = np.random.default_rng(TRIALS_SEED).integers(0, len(places), (N_TRIALS, 3))
    best = best_plane(places, trials, limits, TOLERANCE_PX)
    if best[PLANE_SUPPORT] < LEAST_SUPPORT:
        return None
    p = best[:PLANE_SUPPORT]
    design = np.column_stack([np.ones(len(places)), places[:, PLANE_U], places[:, PLANE_V]])
    for _ in range(PLANE_ROUNDS):
        residual = np.abs(places[:, PLANE_D] - design @ p) / TOLERANCE_PX
        weight = np.sqrt(np.clip(1.0 - residual**2, 0.0, None) * places[:, PLANE_WEIGHT])
        p, *_ = np.linalg.lstsq(design * weight[:, None], places[:, PLANE_D] * weight, rcond=None)
    plane = RoadPlane(*p.tolist())
    return plane if plane.dv > 0.0 else None


def _fitted_shape(rig: RectifiedRig, plane: RoadPlane, found: FloatArray) -> FloatArray:
    """Return (6,) the shape of the surface above the plane, from places (n, 3): columns `MATCHED_COL` onwards."""
    road = plane.disparity(rig, found[:, MATCHED_COL], found[:, MATCHED_ROW])
    below = road > LEAST_ROAD_PX
    road, d = road[below], found[below, MATCHED_DISPARITY]
    h = plane.camera_height_m(rig)
    height = h * (1.0 - road / d)
    terms = _terms((found[below, MATCHED_COL] - rig.cx) * rig.base_m / d, rig.focal_px * rig.base_m / d)
    sigma = np.hypot(SHAPE_NOISE[0], h * SHAPE_NOISE[1] / d)
    prior = np.diag(1.0 / np.array(SHAPE_SIGMAS))
    shape = np.zeros(N_TERMS)
    for gate in SHAPE_GATES_M:
        off = (height - terms @ shape) / np.hypot(gate, 2.0 * sigma)
        weight = np.sqrt(np.clip(1.0 - off * off, 0.0, None) / SHARED_PLACES) / sigma
        a = np.vstack([terms * weight[:, None], prior])
        b = np.concatenate([height * weight, np.zeros(N_TERMS)])
        shape = np.linalg.lstsq(a, b, rcond=None)[0]
        if shape[XX_TERM] > 0.0:
            # A hollow across: roads fall to their sides, so what rises there are footways
            others = np.arange(N_TERMS) != XX_TERM
            shape[XX_TERM], shape[others] = 0.0, np.linalg.lstsq(a[:, others], b, rcond=None)[0]
    return np.asarray(shape)


def _disparity_limits(rig: RectifiedRig, up: FloatArray) -> FloatArray:
    """Return (height, 2): the smallest and largest disparity that a road can have in each row. [pixels]"""  # noqa: D400
    row = np.arange(rig.height) - rig.cy
    # Angle of the rays of each row below level
    below = np.arctan2(row, rig.focal_px) - math.atan2(up[2], -up[1])
    ray = np.hypot(row, rig.focal_px)
    least = rig.base_m / CAMERA_HEIGHT_M[1] * ray * np.sin(np.clip(below - TILT_RAD, 0.0, None))
    largest = rig.base_m / CAMERA_HEIGHT_M[0] * ray * np.sin(np.clip(below + TILT_RAD, 0.0, None))
    return np.column_stack([least, largest])


def _plane_limits(rig: RectifiedRig, up: FloatArray) -> FloatArray:
    """Return (3, 2) the limits of planes as `linework.kernels.images.road_disparity.best_plane` takes them."""
    roll = math.atan2(up[0], up[1])
    pitch = math.atan2(up[2], up[1])
    tilts = [sorted(math.tan(a + s * TILT_RAD) for s in (-1.0, 1.0)) for a in (_small(roll), _small(pitch))]
    scale = rig.focal_px
    slope = [rig.base_m / CAMERA_HEIGHT_M[1] * math.cos(_small(pitch)), rig.base_m / CAMERA_HEIGHT_M[0]]
    slope[0] *= SLOPE_SLACK
    return np.array([tilts[0], [t * scale for t in tilts[1]], slope])


def _small(angle: float) -> float:
    """Return the angle between -90 and 90 degrees that has the same tangent."""
    return math.remainder(angle, math.pi)
