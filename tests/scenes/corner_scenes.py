"""Corners that cameras with known errors see along a known path, with noise of pixels and of poses: exact truth."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from linework.arrays import FloatArray
from linework.imaging.calibration.bundle import CornerWindow
from linework.imaging.calibration.corners import CornerTracks
from linework.imaging.calibration.parameters import adjusted_rig, turned
from linework.imaging.rectify import distorted
from linework.model.camera import LOOKING_AHEAD, Camera, StereoRig
from linework.model.images import Poses
from linework.model.trajectory import Trajectory
from linework.navigation.poses import poses_at

SIZE, FOCAL_PX, PRINCIPAL = np.array([1240.0, 376.0]), 718.0, np.array([607.0, 185.0])
HEIGHT_M = 1.65


def given_rig() -> StereoRig:
    """Return the rig as it is given, level and looking ahead."""
    left, right = (
        Camera(
            width=1240, height=376, fx=FOCAL_PX, fy=FOCAL_PX, cx=PRINCIPAL[0], cy=PRINCIPAL[1],
            distortion=(-0.2, 0.08, 0.0, 0.0, 0.0), position_m=np.array([1.6, y, HEIGHT_M]),
        )
        for y in (0.27, -0.27)
    )  # fmt: skip
    return StereoRig(left, right)


def van_path(*, is_straight: bool = False) -> Trajectory:
    """Return 30 s of a van at 50 Hz: straight on at 10 m/s, or through bends, faster and slower, swaying."""
    time_s = np.arange(0.0, 30.0, 0.02)
    moves = 0.0 if is_straight else 1.0
    speed = 10.0 + moves * 3.0 * np.sin(2.0 * np.pi * time_s / 9.0)
    heading = np.cumsum(moves * 0.25 * np.sin(2.0 * np.pi * time_s / 7.0)) * 0.02
    east, north = (np.cumsum(speed * f(heading)) * 0.02 for f in (np.sin, np.cos))
    sway = [moves * np.degrees(0.01 * np.sin(w * time_s)) for w in (1.3, 1.7)]
    return Trajectory(
        time_s, np.stack([east, north, 0.0 * east], 1), np.stack([*sway, np.degrees(heading) % 360.0], 1)
    )


def corner_windows(
    errors: Mapping[str, float], path: Trajectory, seed: int, *, n_windows: int = 8, n_corners: int = 40,
    sigma_px: float = 0.1, sigma_m: float = 0.01, sigma_deg: float = 0.02,
) -> list[CornerWindow]:  # fmt: skip
    """Return windows of 6 pairs, 0.2 s apart, of cameras that differ from `given_rig` by `errors`."""
    rng = np.random.default_rng(seed)
    rig, offset_s = adjusted_rig(given_rig(), errors)
    windows = []
    for w in range(n_windows):
        time_s = 1.0 + 3.2 * w + 0.2 * np.arange(6)
        part = path.take(np.abs(path.time_s - time_s.mean()) < 2.0)
        true = poses_at(part, time_s + offset_s)
        world = true.to_world(0, _before_the_van(n_corners, rng))
        shift, turn = rng.normal(0.0, sigma_m, (6, 3)), rng.normal(0.0, np.radians(sigma_deg), (6, 3))

        def reported(later_s: float, part=part, time_s=time_s, shift=shift, turn=turn) -> Poses:
            poses = poses_at(part, time_s + later_s)
            return Poses(
                poses.time_s, poses.xyz + shift, poses.R_world_vehicle @ turned(turn),
                poses.sigma_xyz_m, poses.sigma_attitude_rad,
            )  # fmt: skip

        windows.append(CornerWindow(_seen_by(rig, true, world, sigma_px, rng), reported))
    return windows


def _before_the_van(n: int, rng: np.random.Generator) -> FloatArray:
    """Return (n, 3) places 8 to 60 m before the left camera, half of them on the road [m, vehicle]."""
    z = np.exp(rng.uniform(np.log(8.0), np.log(60.0), n))
    col, high = rng.uniform(0.0, SIZE[0], n), rng.uniform(0.0, 250.0, n)
    row = np.where(rng.random(n) < 0.5, PRINCIPAL[1] + FOCAL_PX * HEIGHT_M / z, high)
    ray = np.stack([(col - PRINCIPAL[0]) / FOCAL_PX, (row - PRINCIPAL[1]) / FOCAL_PX, np.ones(n)], axis=1)
    return ray * z[:, None] @ LOOKING_AHEAD.T + given_rig().left.position_m


def _seen_by(rig: StereoRig, poses: Poses, world: FloatArray, sigma_px: float, rng) -> CornerTracks:
    rows = []
    for frame in range(len(poses)):
        pixels, is_seen = [], np.ones(len(world), dtype=bool)
        for camera in (rig.left, rig.right):
            seen = (poses.to_vehicle(frame, world) - camera.position_m) @ camera.R_vehicle_camera
            pixel = distorted(camera, seen[:, :2] / seen[:, 2:]) + rng.normal(0.0, sigma_px, (len(world), 2))
            is_seen &= (seen[:, 2] > 2.0) & ((pixel > 0.0) & (pixel < SIZE)).all(axis=1)
            pixels.append(pixel)
        corner = np.flatnonzero(is_seen)
        rows += [
            (np.full(len(corner), frame), np.full(len(corner), side), corner, pixels[side][corner])
            for side in (0, 1)
        ]
    return CornerTracks(*(np.concatenate(column) for column in zip(*rows, strict=True)))
