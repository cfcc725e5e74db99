"""What must not change a picked edge: where the world's origin is, which image was picked in, running it again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.scenes.edge_scenes import bend, circular_poses, drive_over, followed, pixel_of
from tests.scenes.effort import examples

from linework.imaging.rectify import directions, distorted, original_pixels, rectified_pixels, rectifier_of
from linework.methods.picked_edge.method import PosedPairs
from linework.model.camera import LOOKING_AHEAD, Camera, StereoRig

PLACE = (9.0, -1.1, 0.0)


@pytest.fixture(scope="module")
def drive() -> PosedPairs:
    return drive_over(bend, circular_poses(2))


def test_the_worlds_origin_does_not_matter(drive: PosedPairs) -> None:
    far = np.array([500_000.0, 5_400_000.0, 120.0])
    pick = pixel_of(drive, 0, PLACE)
    here, _ = followed(drive, pick)
    there, _ = followed(replace(drive, poses=replace(drive.poses, xyz=drive.poses.xyz + far)), pick)
    np.testing.assert_allclose(there.lines.xyz - far, here.lines.xyz, atol=1e-4)


def test_both_images_lead_to_the_same_line(drive: PosedPairs) -> None:
    i, col, row = pixel_of(drive, 0, PLACE)
    pair = drive.source(i)
    disparity = float(pair.rig.project(drive.poses.to_vehicle(i, np.array([PLACE])))[2][0])
    left, _ = followed(drive, (i, col, row))
    right, _ = followed(drive, (i, col - disparity, row), side="right")
    away = np.hypot(right.lines.xyz[:, 0], right.lines.xyz[:, 1] - 60.0)
    here = np.hypot(left.lines.xyz[:, 0], left.lines.xyz[:, 1] - 60.0)
    near = left.lines.xyz[:, 0] < 12.0, right.lines.xyz[:, 0] < 12.0
    assert abs(np.median(away[near[1]]) - np.median(here[near[0]])) < 0.005


def test_the_same_pick_gives_the_same_bytes(drive: PosedPairs) -> None:
    pick = pixel_of(drive, 0, PLACE)
    one, two = (followed(drive, pick)[0].lines for _ in range(2))
    assert one.xyz.tobytes() == two.xyz.tobytes() and one.sigma_xy_m.tobytes() == two.sigma_xy_m.tobytes()


@settings(max_examples=examples(30), deadline=None)
@given(st.floats(0.0, 639.0), st.floats(0.0, 479.0), st.floats(-0.3, 0.1), st.floats(-1e-3, 1e-3))
def test_pixels_go_to_the_rectified_image_and_back(col: float, row: float, k1: float, p1: float) -> None:
    lens = {"width": 640, "height": 480, "fx": 700.0, "fy": 705.0, "cx": 322.0, "cy": 236.0}
    left = Camera(**lens, distortion=(k1, 0.05, p1, -p1, 0.0), position_m=np.array([0.0, 0.3, 1.5]))
    turn = np.array([[np.cos(0.01), -np.sin(0.01), 0.0], [np.sin(0.01), np.cos(0.01), 0.0], [0.0, 0.0, 1.0]])
    right = Camera(**lens, position_m=np.array([0.0, -0.3, 1.5]), R_vehicle_camera=turn @ LOOKING_AHEAD)
    rig = rectifier_of(StereoRig(left, right)).rig
    for camera in (left, right):
        pixel = np.array([[col, row]])
        np.testing.assert_allclose(
            original_pixels(camera, rig, rectified_pixels(camera, rig, pixel)), pixel, atol=1e-5
        )
        np.testing.assert_allclose(distorted(camera, directions(camera, pixel)), pixel, atol=1e-5)
