"""Lever arms, against the rotation matrices of the conventions."""

import numpy as np
from scipy.spatial.transform import Rotation

from linework.model.trajectory import Trajectory
from linework.navigation.lever import at_vehicle_origin, headings_deg, rotated


def test_rotated_is_the_product_of_the_three_rotations():
    rng = np.random.default_rng(3)
    attitude = rng.uniform([-30, -30, -180], [30, 30, 360], (50, 3))
    lever = np.array([1.2, -0.6, 2.3])
    for (roll, pitch, heading), got in zip(attitude, rotated(attitude, lever), strict=True):
        turn = Rotation.from_euler("ZYX", [90 - heading, -pitch, roll], degrees=True)
        np.testing.assert_allclose(got, turn.apply(lever), atol=1e-12)


def test_signs_are_those_of_the_conventions():
    ahead, left = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    # heading east; nose up lifts what is ahead; right side down lifts what is left
    np.testing.assert_allclose(rotated(np.array([[0, 0, 90.0]]), ahead), [[1, 0, 0]], atol=1e-12)
    assert rotated(np.array([[0, 5.0, 90.0]]), ahead)[0, 2] > 0
    assert rotated(np.array([[5.0, 0, 90.0]]), left)[0, 2] > 0


def test_headings_hold_while_the_van_stands():
    xyz = np.array([[0.0, 0, 0], [0, 5, 0], [0, 10, 0], [0, 10, 0], [0, 10, 0], [5, 10, 0], [10, 10, 0]])
    headings = headings_deg(xyz)
    assert headings[:3].tolist() == [0, 0, 0]
    assert headings[3] == 0
    assert headings[-1] == 90


def test_no_lever_changes_nothing():
    path = Trajectory(np.array([0.0, 1.0]), np.zeros((2, 3)))
    assert at_vehicle_origin(path, (0.0, 0.0, 0.0)) is path


def test_a_unit_that_is_mounted_askew():
    # Looks to the right, leans to its right, at a van that heads north and climbs
    unit = Rotation.from_euler("ZYX", [-90, 0, 10], degrees=True)  # in the vehicle
    van = Rotation.from_euler("ZYX", [90, -5, 0], degrees=True)
    yaw, minus_pitch, roll = (van * unit).as_euler("ZYX", degrees=True)
    path = Trajectory(np.arange(2.0), np.zeros((2, 3)), np.array([[roll, -minus_pitch, 90 - yaw]] * 2))
    back = at_vehicle_origin(path, (1.0, 0.0, 0.0), (10.0, 0.0, 90.0))
    np.testing.assert_allclose(back.attitude_deg % 360, [[0, 5, 0]] * 2, atol=1e-9)
    np.testing.assert_allclose(back.xyz[0], [0, -np.cos(np.radians(5)), -np.sin(np.radians(5))], atol=1e-12)
