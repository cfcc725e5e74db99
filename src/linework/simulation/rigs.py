"""Stereo cameras on simulated vans, and where each of their pixels looks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.spatial.transform import Rotation

from linework.arrays import FloatArray
from linework.errors import UsageError
from linework.imaging.rectify import distorted
from linework.model.camera import LOOKING_AHEAD, Camera, StereoRig


@dataclass(frozen=True, slots=True)
class Mount:
    """A kind of rig: its images, its base, its place on the vehicle, and the range of how far it is tilted down."""

    size: tuple[int, int]
    focal_px: float
    horizon: float
    base_m: float
    position_m: tuple[float, float, float]
    down_deg: tuple[float, float]


#: The cameras of He and Novak's van (Cohu 4110: 732 x 484) on its roof, and those of a car like KITTI's.
MOUNTS: dict[str, Mount] = {
    "732x484": Mount((732, 484), 820.0, 0.5, 1.2, (1.5, 0.0, 2.3), (3.0, 7.0)),
    "1240x376": Mount((1240, 376), 718.0, 0.49, 0.54, (1.6, 0.0, 1.65), (-1.0, 2.0)),
}
SIZES = tuple(MOUNTS)


def draw_rig(size: str, rng: np.random.Generator, *, is_ideal: bool = False) -> StereoRig:
    """Return the cameras of one van.

    Parameters
    ----------
    size
        "732x484" or "1240x376".
    is_ideal
        Without distortion, looking exactly the same way: images need no rectification.

    Notes
    -----
    Each camera is turned by up to 1 degree about each axis against the other; k1 is -0.3 to -0.05 (barrel, as of
    wide lenses), p1 and p2 up to 0.001, the principal point up to 10 pixels off the middle.
    """
    if size not in MOUNTS:
        raise UsageError(f"there are no cameras of {size!r}", advice=f"choose one of {', '.join(SIZES)}")
    mount = MOUNTS[size]
    tilt = np.radians([-rng.uniform(*mount.down_deg), *rng.uniform(-1.0, 1.0, 2)])
    common = LOOKING_AHEAD @ Rotation.from_euler("XYZ", tilt).as_matrix()
    cameras = []
    for side in (0.5, -0.5):
        turn = np.radians(rng.uniform(-0.5, 0.5, 3))
        k1, off = float(rng.uniform(-0.30, -0.05)), rng.uniform(-10.0, 10.0, 2).tolist()
        k2 = float(rng.uniform(0.3, 0.6)) * -k1
        p1, p2 = rng.uniform(-0.001, 0.001, 2).tolist()
        focal = mount.focal_px * (1.0 + 0.005 * float(rng.uniform(-1.0, 1.0)))
        place = np.asarray(mount.position_m) + side * mount.base_m * -common[:, 0]
        width, height = mount.size
        cx, cy = 0.5 * (width - 1), mount.horizon * height
        cameras.append(
            Camera(width=width, height=height, fx=mount.focal_px, fy=mount.focal_px, cx=cx, cy=cy,
                   position_m=place, R_vehicle_camera=common)
            if is_ideal
            else Camera(width=width, height=height, fx=focal, fy=focal, cx=cx + off[0], cy=cy + off[1],
                        distortion=(k1, k2, p1, p2, 0.0), position_m=place,
                        R_vehicle_camera=common @ Rotation.from_rotvec(turn).as_matrix())
        )  # fmt: skip
    return StereoRig(*cameras)


def undistorted(camera: Camera, pixels: FloatArray) -> FloatArray:
    """Return the directions x/z, y/z in the camera frame that are seen at (..., 2) pixels.

    Newton's method on `distorted` with the Jacobian of an ideal lens; for the lenses drawn here each step leaves
    under half the error, so that 40 leave less than 1e-9 pixel.
    """
    scale, middle = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
    ideal = (pixels - middle) / scale
    for _ in range(40 if any(camera.distortion) else 0):
        ideal = ideal - (distorted(camera, ideal) - pixels) / scale
    return np.asarray(ideal)


def pixel_offsets(n: int) -> FloatArray:
    """Return (n, 3) where in a pixel, and when in the exposure, its n rays look: column, row, time in -0.5 to 0.5.

    Columns are evenly spaced, rows and times a golden-ratio sequence each; their means are exactly 0, so that
    nothing is displaced.
    """
    k = np.arange(n)
    offsets = np.stack(
        [(k + 0.5) / n, (k * 0.6180339887 + 0.5 / n) % 1.0, (k * 0.7548776662 + 0.5) % 1.0], axis=1
    )
    return np.asarray(offsets - offsets.mean(axis=0))


def pixel_rays(camera: Camera, offset: FloatArray) -> FloatArray:
    """Return (height, width, 3) directions [vehicle] of all pixels, moved by `offset` (col, row); depth 1."""
    # A lens is so smooth that cubic splines over 8 pixels leave it by less than 0.00001 pixel
    rows, cols = (np.arange(-8.0, n + 9.0, 8.0) for n in (camera.height, camera.width))
    nodes = undistorted(camera, np.stack(np.meshgrid(cols, rows), axis=-1))
    row, col = np.arange(camera.height) + offset[1], np.arange(camera.width) + offset[0]
    x, y = (RectBivariateSpline(rows, cols, nodes[..., i])(row, col) for i in (0, 1))
    return np.asarray(np.stack([x, y, np.ones(x.shape)], axis=-1) @ camera.R_vehicle_camera.T)
