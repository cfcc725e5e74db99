"""Which truth vertices the stereo cameras of a simulated drive could see."""

from __future__ import annotations

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray
from linework.files.crs import parse_crs
from linework.model.camera import Camera
from linework.model.lines import LineSet
from linework.simulation.cameras import StereoDrive, camera_pixels
from linework.simulation.simulate import SIMULATED_CRS
from linework.simulation.truth import truth_lines
from linework.simulation.view import View

#: A vertex is looked at this far above itself: the chords of a curved surface leave it by less than a millimetre,
#: which at 20 m and 2 degrees of grazing hides what lies on it. [m]
_LIFTED_M = 0.02


def observed_in_images(
    truth: LineSet, drive: StereoDrive, *, max_range_m: float = 20.0, least_pairs: int = 3
) -> BoolArray:
    """Return (n,) which vertices at least so many pairs saw from near enough.

    Parameters
    ----------
    truth
        Of the drive's scenario, world frame.
    max_range_m
        From the left camera, in plan. [m]

    Notes
    -----
    Seen by a pair: within both images and nothing in front of it. Light does not matter: paint in the shadow of a
    tree is seen. Neither does wear: where paint is worn through the vertex is still one of its line, as it is for
    the scanners.
    """
    return _observed(truth, drive, View(drive.scenario), max_range_m, least_pairs)


def _observed(
    truth: LineSet, drive: StereoDrive, view: View, max_range_m: float, least_pairs: int
) -> BoolArray:
    count = np.zeros(len(truth.xyz), dtype=np.int64)
    origin = np.asarray(drive.scenario.origin_m)
    for i in range(len(drive)):
        left = drive.poses.to_world(i, drive.rig.left.position_m[None])
        away = np.linalg.norm(truth.xyz[:, :2] - left[:, :2], axis=1)
        near = np.flatnonzero(away <= max_range_m)
        for camera in (drive.rig.left, drive.rig.right):
            near = near[_is_inside(camera, drive, i, truth.xyz[near])]
            eye = drive.poses.to_world(i, camera.position_m[None])[0] - origin
            target = truth.xyz[near] - origin + np.array([0.0, 0.0, _LIFTED_M])
            near = near[~view.is_hidden(eye, target)]
        count[near] += 1
    return np.asarray(count >= least_pairs)


def _is_inside(camera: Camera, drive: StereoDrive, i: int, xyz: FloatArray) -> BoolArray:
    pixels = camera_pixels(camera, drive.poses, i, xyz)
    col, row = pixels.T
    # Beyond the lens's own field the distortion's polynomial folds back: only what is in front counts
    ahead = (drive.poses.to_vehicle(i, xyz) - camera.position_m) @ camera.R_vehicle_camera
    straight = np.abs(ahead[:, 0]) * camera.fx < 0.75 * camera.width * ahead[:, 2]
    inside = (col >= 0.0) & (col <= camera.width - 1.0) & (row >= 0.0) & (row <= camera.height - 1.0)
    return np.asarray(inside & straight & (ahead[:, 2] > 0.0))


def stereo_truth(
    drive: StereoDrive,
    *,
    max_range_m: float = 20.0,
    least_pairs: int = 3,
    kinds: tuple[str, ...] = ("lane_marking", "lane_marking_dash", "road_marking_other", "road_boundary"),
) -> LineSet:
    """Return the truth lines of a drive without scanning it; `observed` is that of `observed_in_images`."""
    nothing: tuple[FloatArray, AnyArray, FloatArray] = (
        np.zeros((0, 3)),
        np.zeros(0, dtype=np.int64),
        np.zeros(0),
    )
    view = View(drive.scenario)
    lines = truth_lines(drive.scenario, view.scene, nothing, parse_crs(SIMULATED_CRS))
    lines = lines.take(np.isin(lines.kind, kinds))
    return lines.with_columns(observed=_observed(lines, drive, view, max_range_m, least_pairs))
