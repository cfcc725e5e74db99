"""Stereo pairs of a level ground whose grey values are a function of the place, and drives over it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from tests.scenes.road_images import RIG, _grain

from linework.arrays import FloatArray
from linework.methods.picked_edge.method import EdgeStep, PickedEdge, PosedPairs, follow_picked
from linework.model.camera import RectifiedRig
from linework.model.images import Poses, RectifiedPair
from linework.navigation.poses import rotations_of

Ground = Callable[[FloatArray], FloatArray]
#: Bend of the line and of the drive in `bend`. [m]
RADIUS_M = 60.0
_RAYS = (np.arange(2) + 0.5) / 2 - 0.5


def asphalt(xy: FloatArray) -> FloatArray:
    """Return grey values of bare asphalt."""
    return np.asarray(80.0 + 8.0 * _grain(xy))


def bend(xy: FloatArray) -> FloatArray:
    """Return asphalt with a line of paint, 0.12 m wide, on a circle to the left of 60 m radius through 0, -1.75."""
    away = np.hypot(xy[..., 0], xy[..., 1] - RADIUS_M) - (RADIUS_M + 1.75)
    return np.where(np.abs(away) <= 0.06, 190.0, asphalt(xy))


def edge(xy: FloatArray) -> FloatArray:
    """Return asphalt to the right of y = 2 and something 20 grey values brighter, and coarser, to the left."""
    beyond = asphalt(xy) + 20.0 + 10.0 * _grain(0.4 * xy)
    return np.where(xy[..., 1] > 2.0, beyond, asphalt(xy))


def shaded(ground: Ground) -> Ground:
    """Return a ground with a shadow across the road, from 8 to 11 m."""
    return lambda xy: ground(xy) * np.where((xy[..., 0] > 8.0) & (xy[..., 0] < 11.0), 0.35, 1.0)


def drive_over(
    ground: Ground, poses: Poses, *, rig: RectifiedRig = RIG, said: Poses | None = None, noise: float = 2.0
) -> PosedPairs:
    """Return the drive of a van at `poses` over a ground; `said` is where the poses say it was."""
    pairs = {}

    def source(i: int) -> RectifiedPair:
        if i not in pairs:
            rng = np.random.default_rng([5, i])
            left, right = (_image(ground, poses, i, rig, shift) for shift in (0.0, rig.base_m))
            images = [
                np.clip(np.round(grey + rng.normal(0.0, noise, grey.shape)), 0, 255).astype(np.uint8)
                for grey in (left, right)
            ]
            pairs[i] = RectifiedPair(images[0], images[1], rig, i, float(poses.time_s[i]))
        return pairs[i]

    return PosedPairs(source, list(range(len(poses))), said or poses)


def circular_poses(n: int = 4, step_m: float = 3.0) -> Poses:
    """Return poses of a van that drives from 0, 0 along a circle to the left of 60 m radius."""
    turn = step_m * np.arange(n) / RADIUS_M
    xyz = np.column_stack([RADIUS_M * np.sin(turn), RADIUS_M * (1.0 - np.cos(turn)), np.zeros(n)])
    attitude = np.column_stack([np.zeros(n), np.zeros(n), 90.0 - np.degrees(turn)])
    nothing = np.zeros((n, 3))
    return Poses(0.2 * np.arange(n), xyz, rotations_of(attitude), nothing, nothing)


def pixel_of(drive: PosedPairs, i: int, xyz: tuple[float, float, float]) -> tuple[int, float, float]:
    """Return a pick: the pair, and where its left image shows a place."""
    col, row, _ = drive.source(i).rig.project(drive.poses.to_vehicle(i, np.array([xyz])))
    return i, float(col[0]), float(row[0])


def followed(
    drive: PosedPairs, pick: tuple[int, float, float], **how: str
) -> tuple[PickedEdge, list[EdgeStep]]:
    """Return a picked edge with all its steps."""
    steps, following = [], follow_picked(drive, pick, **how)
    while True:
        try:
            steps.append(next(following))
        except StopIteration as end:
            return end.value, steps


def _image(ground: Ground, poses: Poses, i: int, rig: RectifiedRig, shift: float) -> FloatArray:
    eye = poses.to_world(i, (rig.position_m + rig.R_vehicle_camera @ [shift, 0.0, 0.0])[None])[0]
    turn = poses.R_world_vehicle[i] @ rig.R_vehicle_camera
    row, col = np.mgrid[: rig.height, : rig.width].astype(np.float64)
    total = np.zeros(row.shape)
    for dr in _RAYS:
        for dc in _RAYS:
            x, y = (col + dc - rig.cx) / rig.focal_px, (row + dr - rig.cy) / rig.focal_px
            ray = np.stack([x, y, np.ones_like(x)], -1) @ turn.T
            down = ray[..., 2] < -1e-3
            t = np.where(down, eye[2] / np.where(down, -ray[..., 2], 1.0), 0.0)
            total += np.where(down, ground(eye[:2] + t[..., None] * ray[..., :2]), 180.0)
    return np.asarray(total / len(_RAYS) ** 2)
