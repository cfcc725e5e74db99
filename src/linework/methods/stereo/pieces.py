"""Fusion of the sightings of all pairs: pieces of lines in the world, averaged place by place into oriented boxes.

A piece joins two neighbouring sightings of one line in one pair. Its variances follow from the image noise across the
line and along the ray, from the base, and from the pose. Near pairs are the most accurate: they weigh most, and the
nearest one determines where paint begins and ends. Separate from `method`, whose join tracks the boxes made here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.kernels.images.fuse import (
    FUSED_OFFSET,
    FUSED_SPREAD,
    FUSED_UX,
    FUSED_UY,
    FUSED_VAR,
    FUSED_VAR_Z,
    FUSED_Z,
    fuse,
    looked_at,
)
from linework.kernels.tracking.track import SHARED
from linework.methods.protocol import Sight
from linework.methods.stereo.fitted import LEAST_SEEN_SHARE, SURE_BY_PAIRS, SURE_SHARE
from linework.methods.stereo.sighted import SIGHTING_SPACING_M, SMOOTH_DISTANCE_M
from linework.model.boxes import BoxForm, BoxSet
from linework.model.camera import RectifiedRig
from linework.model.images import Poses
from linework.model.sightings import Sightings

#: Standard deviations of poses that give none: of a fair inertial system, from one pair to the next, in position [m] and
#: attitude (0.04 degrees) [rad].
POSE_SIGMA_M, POSE_SIGMA_RAD = 0.02, 0.0007
#: Half the length of a fused place: sightings on a line are half a metre apart. [m]
FUSED_HALF_LENGTH_M = 0.3
#: Largest distance across between pieces of one line beside 3 standard deviations; and in any case: less than between
#: the stripes of a double line. [m]
FUSED_ACROSS_M = (0.06, 0.20)
#: Largest distance at which a pair counts as one that should show a place: dashes have several rows there. [m]
LOOKED_M = 20.0
#: Number of neighbouring places whose heights come from the same disparities, beyond those that smoothing takes as one.
SHARED_HEIGHTS = max(SMOOTH_DISTANCE_M / SIGHTING_SPACING_M / SHARED, 1.0)
#: Largest number of pairs that err as one: calibration, and the drift of poses between neighbouring pairs.
PAIRS_AS_ONE = 4.0
#: Smallest standard deviation of a box's direction [rad]; shortest half length that it is computed from [m].
LEAST_TURN_SIGMA_RAD, LEAST_HALF_LENGTH_M = 0.02, 0.1
#: Quantile of the distances of pieces at which the road enters the image; the nearest one may be an outlier.
NEAREST_QUANTILE = 0.02
#: Shortest piece: sightings nearer together have no direction. [m]
SHORTEST_PIECE_M = 1e-3
#: Side of the cells in which pieces are looked up: more than the reach of a fused place. [m]
_CELL_M = 1.0


@dataclass(frozen=True, slots=True)
class SightingPieces:
    """Pieces of lines between neighbouring sightings, as columns.

    Parameters
    ----------
    centre
        (n, 3) middle. [m, local world]
    u
        (n, 2) unit direction in plan.
    half_u_m
        (n,) half length in plan. [m]
    var_v, var_z
        (n,) variances across and of the height. [m^2]
    width_m
        (n,) width of the paint. [m]
    score
        (n,) score of the sightings, 0 to 1.
    pose
        (n,) int64: pose of the pair.
    distance_m
        (n,) distance from the cameras. [m]
    """

    centre: FloatArray
    u: FloatArray
    half_u_m: FloatArray
    var_v: FloatArray
    var_z: FloatArray
    width_m: FloatArray
    score: FloatArray
    pose: IntArray
    distance_m: FloatArray


def pieces_of(
    seen: Sightings, poses: Poses, rig: RectifiedRig, pose: IntArray, origin: FloatArray
) -> SightingPieces:
    """Return the pieces between neighbouring sightings of one line in one pair.

    Parameters
    ----------
    pose
        (n,) int64: the pose of each sighting.
    origin
        (3,) origin of the local world. [m, world]
    """
    here = poses.xyz - origin
    xyz = np.einsum("nij,nj->ni", poses.R_world_vehicle[pose], seen.xyz) + here[pose]
    a = np.flatnonzero((np.diff(seen.pair) == 0) & (np.diff(seen.line) == 0))
    b = a + 1
    step = xyz[b] - xyz[a]
    length = np.hypot(step[:, 0], step[:, 1])
    good = length > SHORTEST_PIECE_M
    a, b, step, length = a[good], b[good], step[good], length[good]
    u = step[:, :2] / length[:, None]
    across = np.column_stack([-u[:, 1], u[:, 0], np.zeros(len(u))])
    var_v = 0.5 * (
        _variance(seen, poses, rig, pose, a, across) + _variance(seen, poses, rig, pose, b, across)
    )
    up = np.tile([0.0, 0.0, 1.0], (len(u), 1))
    var_z = 0.5 * (_variance(seen, poses, rig, pose, a, up) + _variance(seen, poses, rig, pose, b, up))
    return SightingPieces(
        0.5 * (xyz[a] + xyz[b]), u, 0.5 * length, var_v, var_z, seen.width_m[a], seen.score[a], pose[a],
        rig.focal_px * rig.base_m / np.minimum(seen.disparity[a], seen.disparity[b]),
    )  # fmt: skip


def _variance(
    seen: Sightings, poses: Poses, rig: RectifiedRig, pose: IntArray, at: IntArray, axis: FloatArray
) -> FloatArray:
    """Return (k,) the variance of the sightings `at` along directions `axis` (k, 3) of the world. [m^2]"""  # noqa: D400
    in_vehicle = np.einsum("kj,kji->ki", axis, poses.R_world_vehicle[pose[at]])
    in_camera = in_vehicle @ rig.R_vehicle_camera
    ray = (seen.xyz[at] - rig.position_m) @ rig.R_vehicle_camera
    depth = ray[:, 2]
    by_col = in_camera[:, 0] * depth / rig.focal_px * seen.sigma_px[at]
    by_disparity = np.sum(in_camera * ray, axis=1) * seen.sigma_disparity_px[at] / seen.disparity[at]
    place = np.where(np.isfinite(poses.sigma_xyz_m[pose[at]]), poses.sigma_xyz_m[pose[at]], POSE_SIGMA_M)
    turn = np.where(
        np.isfinite(poses.sigma_attitude_rad[pose[at]]), poses.sigma_attitude_rad[pose[at]], POSE_SIGMA_RAD
    )
    # Roll, pitch and heading are rotations about the vehicle's x, y and z: a place moves by their cross product with it
    lever = np.cross(seen.xyz[at], in_vehicle)
    return np.asarray(
        by_col**2
        + by_disparity**2
        + np.sum((axis * place) ** 2, axis=1)
        + np.sum((lever * turn) ** 2, axis=1)
    )


def fused_boxes(pieces: SightingPieces, poses: Poses, rig: RectifiedRig, origin: FloatArray) -> BoxSet:
    """Return one box per place on a line, fused over all pairs; places that few of the pairs in range show are left out."""
    if len(pieces.u) == 0:
        return BoxSet.empty()
    xy = pieces.centre[:, :2]
    west, south = (np.floor(xy.min(axis=0) / _CELL_M) * _CELL_M - 2.0 * _CELL_M).tolist()
    cell = np.floor((xy - (west, south)) / _CELL_M).astype(np.int64)
    n_cols = int(cell[:, 0].max()) + 4
    codes = cell[:, 1] * n_cols + cell[:, 0]
    # Sorted by position, so that the result does not depend on the order of the pairs
    rank = np.lexsort((xy[:, 0], xy[:, 1], codes))
    table = np.column_stack([pieces.centre, pieces.u, pieces.var_v, pieces.var_z])[rank]
    best = np.lexsort((table[:, 0], table[:, 1], pieces.distance_m[rank])).astype(np.int64)
    seeds, place, fused = fuse(
        table, best, codes[rank], (west, south, _CELL_M, n_cols), FUSED_HALF_LENGTH_M, FUSED_ACROSS_M
    )
    return _boxes(pieces, rank, seeds, place, fused, poses, PairCoverage.of(pieces, poses, rig, origin))


def _boxes(
    pieces: SightingPieces, rank: IntArray, seeds: IntArray, place: IntArray, fused: FloatArray,
    poses: Poses, looks: PairCoverage,
) -> BoxSet:  # fmt: skip
    """Return the boxes of fused places that enough pairs show."""
    m = len(seeds)
    seed = rank[seeds]
    normal = np.column_stack([-pieces.u[seed, 1], pieces.u[seed, 0]])
    centre = np.column_stack(
        [pieces.centre[seed, :2] + fused[:, FUSED_OFFSET, None] * normal, fused[:, FUSED_Z]]
    )
    pose = pieces.pose[rank]
    n_pairs = _distinct(place, pose, m)
    near = pieces.distance_m[rank] <= LOOKED_M
    n_near = _distinct(place[near], pose[near], m)
    n_looked = looks.count(centre[:, :2])
    share = np.minimum(n_near / np.maximum(n_looked, 1), 1.0)
    kept = (n_near >= 1) & (share >= LEAST_SEEN_SHARE)
    n = np.bincount(place, minlength=m)

    def mean(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(place, values[rank], m) / n)

    by_piece = np.empty((len(rank), fused.shape[1]))
    by_piece[rank] = fused[place]

    time = poses.time_s[pose]
    start, end = np.full(m, np.inf), np.full(m, -np.inf)
    np.minimum.at(start, place, time)
    np.maximum.at(end, place, time)
    inflation = np.maximum(fused[:, FUSED_SPREAD], 1.0)
    # Errors of pairs are correlated
    sigma_v = np.sqrt(fused[:, FUSED_VAR] * inflation * np.minimum(n_pairs, PAIRS_AS_ONE))
    # Heights also along the line: neighbouring places share most of their disparities
    differ_z = mean((pieces.centre[:, 2] - by_piece[:, FUSED_Z]) ** 2 / pieces.var_z)
    sigma_z = np.sqrt(
        fused[:, FUSED_VAR_Z] * np.maximum(differ_z, 1.0) * np.minimum(n_pairs, PAIRS_AS_ONE) * SHARED_HEIGHTS
    )
    sure = np.array(SURE_BY_PAIRS)[np.clip(np.where(n_looked == 1, 3, n_pairs), 1, 3) - 1]
    score = mean(pieces.score) * np.clip(SURE_SHARE + share, 0.0, 1.0) * sure
    turn = sigma_v / np.maximum(pieces.half_u_m[seed], LEAST_HALF_LENGTH_M)
    boxes = BoxSet(
        centre=centre, u=fused[:, FUSED_UX : FUSED_UY + 1], half_u_m=pieces.half_u_m[seed], half_v_m=0.5 * mean(pieces.width_m),
        sigma_v_m=sigma_v, sigma_z_m=sigma_z, sigma_u_rad=np.hypot(LEAST_TURN_SIGMA_RAD, turn), score=score,
        form=np.full(m, BoxForm.STRIPE), n_points=n, time_start_s=start, time_end_s=end,
    )  # fmt: skip
    return boxes.take(kept)


def _distinct(place: IntArray, pose: IntArray, m: int) -> IntArray:
    """Return (m,) the number of different poses of each place."""
    pairs = np.unique(np.column_stack([place, pose]), axis=0)
    return np.bincount(pairs[:, 0], minlength=m)


def _nearest_and_sides(pieces: SightingPieces, rig: RectifiedRig) -> tuple[float, float, float]:
    """Return the distance at which the road enters the image [m], and the largest slopes of rays to both sides."""
    nearest = float(np.quantile(pieces.distance_m, NEAREST_QUANTILE))
    # Less the strip at the left that the right image does not show
    left = rig.cx / rig.focal_px - rig.base_m / nearest
    return nearest, max(left, 0.0), (rig.width - 1.0 - rig.cx) / rig.focal_px


@dataclass(frozen=True, slots=True)
class PairCoverage:
    """The field of view of every pair on the road, in cells as large as its range.

    Parameters
    ----------
    stations
        (k, 4) position [m, local world] and direction of view of the left camera, in plan, in order of cells.
    codes, lattice, view
        As `linework.kernels.images.fuse.looked_at` takes them.
    """

    stations: FloatArray
    codes: IntArray
    lattice: tuple[float, float, float, int]
    view: tuple[float, float, float, float]

    @classmethod
    def of(cls, pieces: SightingPieces, poses: Poses, rig: RectifiedRig, origin: FloatArray) -> PairCoverage:
        """Return the coverage of all pairs, with the field of view that their pieces show."""
        eye = poses.R_world_vehicle @ rig.position_m + poses.xyz - origin
        ahead = (poses.R_world_vehicle @ rig.R_vehicle_camera)[:, :2, 2]
        ahead /= np.linalg.norm(ahead, axis=1)[:, None]
        nearest, left, right = _nearest_and_sides(pieces, rig)
        size = LOOKED_M * float(np.hypot(1.0, max(left, right)))
        west, south = (eye[:, :2].min(axis=0) - 2.0 * size).tolist()
        cell = np.floor((eye[:, :2] - (west, south)) / size).astype(np.int64)
        n_cols = int(cell[:, 0].max()) + 3
        codes = cell[:, 1] * n_cols + cell[:, 0]
        order = np.argsort(codes, kind="stable")
        stations = np.column_stack([eye[:, :2], ahead])[order]
        return cls(stations, codes[order], (west, south, size, n_cols), (nearest, LOOKED_M, left, right))

    def count(self, xy: FloatArray) -> IntArray:
        """Return (m,) int64: the number of pairs that have each of (m, 2) places [m, local world] in view."""
        places = np.ascontiguousarray(xy[:, :2])
        return np.asarray(looked_at(places, self.stations, self.codes, self.lattice, self.view))


def coverage_test(pieces: SightingPieces, poses: Poses, rig: RectifiedRig, origin: FloatArray) -> Sight:
    """Return a function from (n, 2) places [m, local world] to (n,) bool: whether a pair has them in view."""
    looks = PairCoverage.of(pieces, poses, rig, origin)

    def in_view(xy: FloatArray) -> BoolArray:
        return np.asarray(looks.count(xy) > 0)

    return in_view
