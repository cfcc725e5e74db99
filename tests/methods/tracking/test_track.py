"""Boxes tracked into lines: bends, gaps, neighbours, forks."""

import numpy as np
import pytest
from tests.scenes.box_scenes import bend, boxes_on, straight

from linework.methods.tracking.track import TrackConfig, track_lines
from linework.model.boxes import BoxForm, BoxSet

CONFIG = TrackConfig()


def tracked(boxes, width=0.06):
    return track_lines(boxes, CONFIG, width_m=width)


def lengths(boxes, tracks):
    return sorted(float(boxes.along(tracks.line(i)[0])[-1]) for i in range(len(tracks)))


@pytest.mark.parametrize(
    "course", [straight(60.0, heading=0.7), bend(18.0, 2.5), bend(5.0, 1.5), bend(300.0, 0.2)]
)
def test_a_line_is_tracked_whole_in_one_piece(course):
    boxes = boxes_on(course)
    tracks = tracked(boxes)
    assert len(tracks) == 1
    assert len(tracks.box) > 0.9 * len(boxes)
    assert len(set(tracks.box.tolist())) == len(tracks.box)


def test_a_u_turn_is_survived():
    first, turn = straight(30.0), bend(6.0, np.pi, x=30.0)
    back = straight(30.0, x=30.0, y=12.0, heading=np.pi)
    assert lengths(b := boxes_on(first, turn, back), tracked(b))[-1] == pytest.approx(
        60.0 + 6.0 * np.pi, abs=1.5
    )


def test_gaps_of_dashes_and_cars_are_carried_over_by_what_was_seen_before():
    dashes = [straight(3.0, x=12.0 * k) for k in range(6)]
    tracks = tracked(b := boxes_on(*dashes))
    assert len(tracks) == 1
    assert lengths(b, tracks)[0] == pytest.approx(63.0, abs=1.0)


def test_two_boxes_do_not_lead_over_a_long_gap():
    tracks = tracked(boxes_on(straight(1.6), straight(20.0, x=20.0)))
    assert len(tracks) == 2


def test_double_lines_stay_apart():
    tracks = tracked(b := boxes_on(straight(50.0), straight(50.0, y=0.25), noise=0.008))
    assert lengths(b, tracks) == pytest.approx([49.4, 49.4], abs=0.6)
    for i in range(2):
        assert np.ptp(b.centre[tracks.line(i)[0], 1]) < 0.1


def test_a_fork_gives_both_branches():
    stem, branch = straight(60.0), bend(60.0, 0.6, x=25.0)
    tracks = tracked(b := boxes_on(stem, branch))
    assert len(tracks) == 2
    ends = np.concatenate([b.centre[tracks.line(i)[0][[0, -1]], :2] for i in range(2)])
    for corner in ((60.0, 0.0), (25.0 + 60.0 * np.sin(0.6), 60.0 * (1 - np.cos(0.6)))):
        assert np.hypot(*(ends - corner).T).min() < 1.0


def test_the_order_of_boxes_does_not_matter():
    boxes = boxes_on(straight(40.0), bend(30.0, 1.0, y=4.0), keep=0.8)
    mixed = np.random.default_rng(1).permutation(len(boxes))
    one, other = tracked(boxes), tracked(boxes.take(mixed))
    np.testing.assert_array_equal(one.offsets, other.offsets)
    np.testing.assert_array_equal(boxes.centre[one.box], boxes.centre[mixed[other.box]])


def test_boundaries_keep_the_carriageway_on_their_left():
    there = boxes_on(straight(30.0), form=BoxForm.KERB)
    other = boxes_on(straight(30.0, x=30.0, y=0.05, heading=np.pi), form=BoxForm.KERB, seed=2)
    tracks = tracked(b := BoxSet.concatenate([there, other]))
    for i in range(len(tracks)):
        east = b.u[tracks.line(i)[0], 0] > 0
        assert east.all() or not east.any()


def test_no_boxes_no_lines():
    assert len(tracked(BoxSet.empty())) == 0
