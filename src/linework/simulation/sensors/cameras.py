"""Stereo images of a simulated drive: what cameras on the van would have taken, with exact poses.

>>> from linework.simulation.roads.draw import draw_scenario
>>> drive = stereo_survey(draw_scenario("straight", 1, 40.0), size="1240x376", every_m=10.0)
>>> len(drive), drive.rig.left.width
(3, 1240)
>>> pairs = images_of(drive)  # drawn one by one, as they are asked for
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from numbers import Real

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray
from linework.crs import parse_crs
from linework.errors import UsageError, argument
from linework.imaging.rectify import distorted
from linework.model.camera import Camera, StereoRig
from linework.model.images import Poses
from linework.model.lines import LineSet
from linework.navigation.poses import rotations_of
from linework.simulation.roads.scenario import Scenario
from linework.simulation.scene.scene import truth_lines
from linework.simulation.sensors.drive import Drive
from linework.simulation.sensors.picture import Shutter, Stage
from linework.simulation.sensors.view import PassScene, draw_rig, pixel_offsets
from linework.simulation.sensors.visible import Light, draw_light, draw_wear, reflectances
from linework.simulation.simulate import SIMULATED_CRS, drives_of

#: Cameras are triggered at whole multiples of this. [s]
_TRIGGER_S = 0.1


@dataclass(frozen=True, slots=True)
class StereoDrive:
    """When which cameras take pictures along the first pass of a survey, and in what light.

    Parameters
    ----------
    scenario
        The survey's.
    rig
        The cameras.
    time_s
        (n,) float64 [s]: middle of each exposure, by the survey's clock.
    poses
        True poses at these times, world frame.
    light
        Sun, sky, exposure.
    rays_per_pixel
        How finely a pixel is sampled.
    """

    scenario: Scenario
    rig: StereoRig
    time_s: FloatArray
    poses: Poses
    light: Light
    rays_per_pixel: int

    def __len__(self) -> int:
        return len(self.time_s)


@dataclass(frozen=True, slots=True)
class SimulatedPair:
    """Two images, (height, width) uint8, taken at one time."""

    number: int
    time_s: float
    left: AnyArray
    right: AnyArray


def stereo_survey(
    scenario: Scenario,
    *,
    size: str = "1240x376",
    every_m: float = 3.0,
    rays_per_pixel: int = 4,
    is_ideal: bool = False,
) -> StereoDrive:
    """Return the stereo survey of a scenario's first pass; nothing is drawn yet.

    Parameters
    ----------
    scenario
        From `draw_scenario`, or `SimulatedSurvey.scenario`.
    size
        "732x484" or "1240x376".
    every_m
        About how far the van drives between pairs: the nearest multiple of 0.1 s at its speed.
    rays_per_pixel
        1 is coarse and quick; 4 takes a few seconds a pair.
    is_ideal
        Cameras without distortion that look exactly the same way.

    Raises
    ------
    UsageError
        There are no such cameras; a distance that is not above 0.
    """
    if not isinstance(every_m, Real) or isinstance(every_m, bool) or not 0.0 < every_m < np.inf:
        shown = f"{every_m:g}" if isinstance(every_m, Real) else repr(every_m)
        raise UsageError(
            f"a pair every {shown} m", where=argument("image_every_m"), advice="choose more than 0"
        )
    kind = sum(map(ord, scenario.kind))
    rng = np.random.default_rng([scenario.seed, 41, kind])
    rig, light = draw_rig(size, rng, is_ideal=is_ideal), draw_light(rng)
    way = drives_of(scenario)[0]
    step = max(round(every_m / scenario.passes[0].speed_mps / _TRIGGER_S), 1) * _TRIGGER_S
    # Half a step from the ends: every exposure is within the drive
    n = max(int(np.floor((way.time_s[-1] - way.time_s[0]) / step)), 1)
    # Rounded as they are written: poses are those of the written times
    time = np.round(way.time_s[0] + step * (np.arange(n) + 0.5), 6)
    poses = poses_of(way, time, np.asarray(scenario.origin_m))
    return StereoDrive(scenario, rig, time, poses, light, rays_per_pixel)


def images_of(drive: StereoDrive, numbers: Sequence[int] | None = None) -> Iterator[SimulatedPair]:
    """Yield the pairs of a drive, or those of the given numbers, one by one as they are drawn.

    Notes
    -----
    Each image depends on the drive and its own number only. One pair of 1240 x 376 with 4 rays per pixel takes
    about 4 s on one core.
    """
    scenario = drive.scenario
    rng = np.random.default_rng([scenario.seed, 42])
    view = PassScene(scenario)
    wear = draw_wear(scenario.layout, scenario.length_m, rng)
    reflectance = reflectances(view.scene, view.scenario.layout, drive.light.asphalt, rng)
    stage = Stage(view, drive.light, wear, reflectance, scenario.seed + 500)
    way = drives_of(scenario)[0]
    when = drive.light.exposure_s * pixel_offsets(drive.rays_per_pixel)[:, 2]
    cameras = (drive.rig.left, drive.rig.right)
    shutters = [Shutter(stage, c, drive.rays_per_pixel) for c in cameras]
    gains = (drive.light.gain, drive.light.gain * drive.light.gain_right)
    for i in range(len(drive)) if numbers is None else numbers:
        poses = poses_of(way, drive.time_s[i] + when, np.zeros(3))
        left, right = (
            shutter.grey(shutter.light_at(poses), gain, np.random.default_rng([scenario.seed, 43, i, side]))
            for side, (shutter, gain) in enumerate(zip(shutters, gains, strict=True))
        )
        yield SimulatedPair(i, float(drive.time_s[i]), left, right)


def poses_of(way: Drive, time_s: FloatArray, origin_m: FloatArray) -> Poses:
    """Return the true poses of a drive at given times; known exactly, sigmas 0."""
    columns = (way.roll_rad, way.pitch_rad, 0.5 * np.pi - way.yaw_rad)
    attitude = np.stack([np.degrees(np.interp(time_s, way.time_s, c)) for c in columns], axis=-1)
    xyz = np.stack([np.interp(time_s, way.time_s, c) for c in way.xyz.T], axis=-1)
    nothing = np.zeros((len(time_s), 3))
    return Poses(time_s, xyz + origin_m, rotations_of(attitude), nothing, nothing)


def camera_pixels(camera: Camera, poses: Poses, i: int, xyz_world: FloatArray) -> FloatArray:
    """Return (n, 2) where a camera at pose i sees places of the world; NaN behind it, also outside the image."""
    xyz = (poses.to_vehicle(i, xyz_world) - camera.position_m) @ camera.R_vehicle_camera
    depth = np.where(xyz[:, 2] > 0.1, xyz[:, 2], np.nan)
    return distorted(camera, xyz[:, :2] / depth[:, None])


# Which truth vertices the stereo cameras of a simulated drive could see

#: A vertex is looked at this far above itself: the chords of a curved surface leave it by less than a millimetre,
#: which at 20 m and 2 degrees of grazing hides what lies on it. [m]
_LIFTED_M = 0.02


def observed_in_images(
    truth: LineSet, drive: StereoDrive, *, max_range_m: float = 20.0, least_pairs: int = 3
) -> BoolArray:
    """Return which vertices at least `least_pairs` pairs show from within `max_range_m`, (n,) bool.

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
    return _observed(truth, drive, PassScene(drive.scenario), max_range_m, least_pairs)


def _observed(
    truth: LineSet, drive: StereoDrive, view: PassScene, max_range_m: float, least_pairs: int
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
    view = PassScene(drive.scenario)
    lines = truth_lines(drive.scenario, view.scene, nothing, parse_crs(SIMULATED_CRS))
    lines = lines.take(np.isin(lines.kind, kinds))
    return lines.with_columns(observed=_observed(lines, drive, view, max_range_m, least_pairs))
