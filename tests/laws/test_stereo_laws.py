"""Laws of lines from stereo pairs: mirrors, brightness, shifts of the world, the order of the pairs."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from tests.scenes.road_images import RIG, road_pair, straight_poses

from linework.methods.protocol import SurveyContext
from linework.methods.stereo.method import Stereo
from linework.model.images import Poses, RectifiedPair
from linework.model.lines import LineSet
from linework.model.sightings import Sightings

POSES = straight_poses(4)
METHOD = Stereo()


@cache
def pairs() -> tuple[RectifiedPair, ...]:
    return tuple(road_pair(i, POSES) for i in range(len(POSES)))


@cache
def seen() -> tuple[Sightings, ...]:
    return tuple(METHOD.look(pair) for pair in pairs())


def joined(poses: Poses = POSES, order: tuple[int, ...] = (0, 1, 2, 3)) -> LineSet:
    return METHOD.join(Sightings.concatenate([seen()[i] for i in order]), SurveyContext(poses=poses, rig=RIG))


def test_the_order_of_pairs_does_not_matter() -> None:
    one, other = joined(), joined(order=(2, 0, 3, 1))
    assert len(one) == len(other) >= 3
    assert one.xyz.tobytes() == other.xyz.tobytes()
    assert one.sigma_xy_m.tobytes() == other.sigma_xy_m.tobytes()


def test_a_pair_always_shows_the_same() -> None:
    again = METHOD.look(pairs()[1])
    assert again.xyz.tobytes() == seen()[1].xyz.tobytes()


@pytest.mark.parametrize("shift", [(5e5, 5e6, 300.0), (1.2e6, -3.6e6, 0.0)])
def test_a_shift_of_the_world_shifts_the_lines(shift: tuple[float, float, float]) -> None:
    poses = replace(POSES, xyz=POSES.xyz + np.asarray(shift))
    moved, lines = joined(poses), joined()
    assert len(moved) == len(lines)
    np.testing.assert_allclose(moved.xyz - np.asarray(shift), lines.xyz, atol=1e-4)


def test_a_brighter_light_shows_the_same_lines() -> None:
    # Grey values of the road are about 70, so that twice as bright is not yet white
    for pair, own in zip(pairs()[:2], seen(), strict=False):
        dim = replace(pair, left=pair.left // 2, right=pair.right // 2)
        other = METHOD.look(dim)
        assert len(np.unique(other.line)) == len(np.unique(own.line))
        for offset in (3.1, -0.4, -3.9):
            a, b = (s.xyz[np.abs(s.xyz[:, 1] - offset) < 0.1, 1] for s in (own, other))
            assert len(a) > 0 and len(b) > 0
            assert abs(float(np.median(a)) - float(np.median(b))) < 0.01


def test_a_mirrored_road_has_mirrored_lines() -> None:
    for pair, own in zip(pairs()[:2], seen(), strict=False):
        # Seen in a mirror the right camera is the left one
        mirrored = replace(
            pair, left=pair.right[:, ::-1], right=pair.left[:, ::-1],
            rig=replace(RIG, cx=RIG.width - 1.0 - RIG.cx, position_m=RIG.position_m * (1.0, -1.0, 1.0) + (0, 0.6, 0)),
        )  # fmt: skip
        other = METHOD.look(mirrored)
        for offset in (3.1, -0.4, -3.9):
            a = own.xyz[np.abs(own.xyz[:, 1] - offset) < 0.1, 1]
            b = other.xyz[np.abs(other.xyz[:, 1] + offset) < 0.1, 1]
            assert len(a) > 0 and len(b) > 0
            assert abs(float(np.median(a)) + float(np.median(b))) < 0.01


def test_numbers_of_pairs_need_not_be_those_of_poses() -> None:
    numbers = np.array([10, 12, 13, 20])
    renamed = [replace(s, pair=numbers[s.pair]) for s in seen()]
    lines = METHOD.join(
        Sightings.concatenate(renamed), SurveyContext(poses=POSES, rig=RIG, pair_numbers=numbers)
    )
    assert lines.xyz.tobytes() == joined().xyz.tobytes()


def test_better_poses_are_believed_more() -> None:
    worse = replace(POSES, sigma_xyz_m=np.full((4, 3), 0.10), sigma_attitude_rad=np.full((4, 3), 1e-3))
    assert (joined(worse).sigma_xy_m > 0.02).mean() > 0.5
    assert (joined().sigma_xy_m < 0.02).mean() > 0.9
