"""Stretches of a drive: together they hold every line once, whatever the road does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.scenes.road_images import RIG

from linework.live import stretches
from linework.live.notices import Notices, SkipNotices
from linework.live.queue import UNFINISHED_S, PairQueue
from linework.live.stretches import LIVE_STRETCH_M, PlacedPair, Stretches
from linework.model.images import ImagePair, Poses
from linework.model.lines import LineSet
from linework.model.sightings import Sightings
from linework.navigation.poses import rotations_of


class Beside:
    """A method that finds one line 3 m to the left of the poses, from the first pair to 30 m ahead of the last."""

    def join(self, found, survey):
        poses = survey.poses
        assert np.array_equal(np.unique(found.pair), np.arange(len(poses)))
        ahead, left = poses.R_world_vehicle[:, :, 0], poses.R_world_vehicle[:, :, 1]
        xyz = poses.xyz + 3.0 * left
        beyond = xyz[-1] + np.arange(1.0, 31.0)[:, None] * ahead[-1]
        return LineSet.from_lines([np.concatenate([xyz, beyond])], kind="lane_marking")


def pair(i: int, chainage_m: float, radius_m: float) -> PlacedPair:
    """A pair on a circle to the left."""
    turn = chainage_m / radius_m
    xyz = np.array([[radius_m * np.sin(turn), radius_m * (1.0 - np.cos(turn)), 0.0]])
    none = np.zeros((1, 3))
    pose = Poses(
        np.array([0.2 * i]), xyz, rotations_of(np.array([[0.0, 0.0, 90.0 - np.degrees(turn)]])), none, none
    )
    return PlacedPair(i, 0.2 * i, pose, chainage_m, Sightings(xyz=np.zeros((1, 3))))


@pytest.mark.parametrize("radius_m", [1e6, 400.0])
def test_stretches_hold_every_line_once(radius_m):
    found, open_ = [], Stretches(Beside(), RIG)
    for i, chainage in enumerate(np.arange(0.0, 1100.0, 4.0)):
        open_.add(pair(i, float(chainage), radius_m))
        if open_.is_complete:
            found.append(open_.completed())
    assert len(found) == 4
    assert len(open_) < (LIVE_STRETCH_M + 2 * stretches.AHEAD_M) / 4.0
    for lines in found:
        assert lines.length_m.sum() == pytest.approx(LIVE_STRETCH_M * (radius_m - 3.0) / radius_m, abs=1.5)
    lines = LineSet.concatenate([*found, open_.lines()])
    ends = [(lines[i].xyz[-1], lines[i + 1].xyz[0]) for i in range(len(lines) - 1)]
    assert max(np.hypot(*(b - a)[:2]) for a, b in ends) < 0.2


def test_a_van_that_stands_adds_nothing():
    open_ = Stretches(Beside(), RIG)
    for i in range(200):
        open_.add(pair(i, 100.0, 1e6))
    assert len(open_) == 1


def images(i: int, time_s: float) -> ImagePair:
    return ImagePair(i, time_s, Path(f"{i}.png"), Path(f"{i}.png"))


def test_the_oldest_pairs_are_skipped():
    queue = PairQueue(1.0)
    queue.add([images(i, 0.2 * i) for i in (3, 1, 2, 0)])
    assert queue.skipped() == []
    queue.add([images(9, 1.5)])
    assert [one.number for one in queue.skipped()] == [0, 1, 2]
    assert [queue.next(0.0).number, queue.next(0.0).number] == [3, 9]


def test_a_pair_that_cannot_be_read_waits_beside_the_others():
    queue = PairQueue(10.0)
    queue.add([images(0, 0.0), images(1, 0.2)])
    bad = queue.next(0.0)
    assert queue.try_again(bad, 0.0)
    assert queue.next(0.1).number == 1
    assert queue.next(0.1) is None
    assert queue.next(0.5) is bad
    assert not queue.try_again(bad, UNFINISHED_S + 0.1)
    assert len(queue) == 0


def test_a_trouble_is_reported_when_it_begins_and_when_it_ends():
    lines = []
    notices = Notices(lines.append)
    for now in range(3):
        notices.begin("gyro", "gyro stopped", now)
    assert [notice.lasts for notice in notices.shown()] == [True]
    notices.end("gyro", "gyro runs", 4.0)
    notices.end("gyro", "gyro runs", 5.0)
    assert lines == ["gyro stopped", "gyro runs"]


def test_skipped_pairs_are_gathered():
    lines = []
    skips = SkipNotices(Notices(lines.append))
    for i in range(40):
        skips.add([images(2 * i, 0.0)], 0.5 * i)
    skips.report(20.0)
    assert len(lines) == 3
    assert sum(int(line.split()[0]) for line in lines) == 40
