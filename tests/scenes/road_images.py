"""Stereo pairs of a level road with stripes of paint, drawn ray by ray: every line is known exactly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.model.camera import LOOKING_AHEAD, RectifiedRig
from linework.model.images import Poses, RectifiedPair
from linework.navigation.poses import rotations_of

#: Offset to the left of the road's axis [m], width [m], period and dash [m] (0: solid).
Stripe = tuple[float, float, float, float]
STRIPES: tuple[Stripe, ...] = ((3.5, 0.15, 0.0, 0.0), (0.0, 0.12, 9.0, 3.0), (-3.5, 0.25, 0.0, 0.0))
#: Half the base to the left and 1.6 m above the vehicle's origin.
RIG = RectifiedRig(
    focal_px=360.0, cx=299.5, cy=50.0, width=600, height=190, base_m=0.6,
    position_m=np.array([0.0, 0.3, 1.6]), R_vehicle_camera=LOOKING_AHEAD,
)  # fmt: skip
_RAYS = (np.arange(2) + 0.5) / 2 - 0.5


def road_pair(
    number: int, poses: Poses, stripes: Sequence[Stripe] = STRIPES, *, contrast: float = 1.5, noise: float = 2.0,
    rig: RectifiedRig = RIG, seed: int = 5,
) -> RectifiedPair:  # fmt: skip
    """Return the pair that the rig takes at pose `number` of a road along the world's x-axis, at height 0."""
    rng = np.random.default_rng([seed, number])
    images = []
    for shift in (0.0, rig.base_m):
        grey = _grey_of(rig, poses, number, shift, stripes, contrast)
        images.append(np.clip(np.round(grey + rng.normal(0.0, noise, grey.shape)), 0, 255).astype(np.uint8))
    return RectifiedPair(images[0], images[1], rig, number, float(poses.time_s[number]))


def straight_poses(n: int = 4, step_m: float = 3.0, origin: Sequence[float] = (0.0, 0.0, 0.0)) -> Poses:
    """Return poses of a van that drives east, exactly known."""
    xyz = np.column_stack([step_m * np.arange(n), np.full(n, 0.4), np.zeros(n)]) + np.asarray(origin)
    nothing = np.zeros((n, 3))
    return Poses(0.2 * np.arange(n), xyz, rotations_of(np.tile([0.0, 0.0, 90.0], (n, 1))), nothing, nothing)


def _grey_of(
    rig: RectifiedRig, poses: Poses, i: int, shift: float, stripes: Sequence[Stripe], contrast: float
) -> FloatArray:
    total = np.zeros((rig.height, rig.width))
    eye = (
        poses.R_world_vehicle[i] @ (rig.position_m + rig.R_vehicle_camera @ [shift, 0.0, 0.0]) + poses.xyz[i]
    )
    turn = poses.R_world_vehicle[i] @ rig.R_vehicle_camera
    row, col = np.mgrid[: rig.height, : rig.width].astype(np.float64)
    for dr in _RAYS:
        for dc in _RAYS:
            x, y = (col + dc - rig.cx) / rig.focal_px, (row + dr - rig.cy) / rig.focal_px
            ray = np.stack([x, y, np.ones_like(x)], -1) @ turn.T
            down = ray[..., 2] < -1e-3
            t = np.where(down, eye[2] / np.where(down, -ray[..., 2], 1.0), 0.0)
            ground = eye[:2] + t[..., None] * ray[..., :2]
            total += np.where(down, _road_grey(ground, stripes, contrast), 180.0)
    return np.asarray(total / len(_RAYS) ** 2)


def _road_grey(xy: FloatArray, stripes: Sequence[Stripe], contrast: float) -> FloatArray:
    grain = _grain(xy)
    grey = 70.0 * (1.0 + 0.15 * grain)
    for offset, width, period, dash in stripes:
        on = np.abs(xy[..., 1] - offset) <= 0.5 * width
        if period:
            on &= np.mod(xy[..., 0], period) <= dash
        grey = np.where(on, 70.0 * (1.0 + contrast), grey)
    return np.asarray(grey)


def _grain(xy: FloatArray) -> FloatArray:
    """Return smooth noise about 0 of the place alone, in cells of 8 cm."""
    table = np.random.default_rng(3).uniform(-1.0, 1.0, (257, 263))
    place = np.floor(xy / 0.08)
    part = xy / 0.08 - place
    i, j = (place[..., k].astype(np.int64) for k in range(2))

    def at(a: int, b: int) -> AnyArray:
        return np.asarray(table[(i + a) % 257, (j + b) % 263])

    low = at(0, 0) + part[..., 1] * (at(0, 1) - at(0, 0))
    high = at(1, 0) + part[..., 1] * (at(1, 1) - at(1, 0))
    return np.asarray(low + part[..., 0] * (high - low))
