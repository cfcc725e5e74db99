"""The line that passes a picked place, as it is shown while it grows, and why it ends where it does."""

import numpy as np
import pytest
from tests.scenes.box_scenes import bend, boxes_on, everything_seen, nothing_seen, straight

from linework.methods.obb.trace import TraceStop, may_continue, near_line, oriented_like, stop_reasons
from linework.methods.tracking.track import TrackConfig
from linework.model.boxes import BoxForm, BoxSet
from linework.model.lines import LineSet

CONFIG = TrackConfig()


def near(boxes, place, kind="", seen=everything_seen):
    return near_line(boxes, np.asarray(place, dtype=float), kind, CONFIG, seen)


@pytest.mark.parametrize(("y", "line_y"), [(0.4, 0.0), (3.2, 3.5), (3.9, 3.5)])
def test_the_nearest_line_is_meant(y, line_y):
    boxes = boxes_on(straight(60.0), straight(60.0, y=3.5))
    one = near(boxes, (30.0, y))
    assert one.kind.tolist() == ["lane_marking"]
    assert np.abs(one.xyz[:, 1] - line_y).max() < 0.03
    assert np.ptp(one.xyz[:, 0]) == pytest.approx(60.0, abs=1.0)


def test_a_place_off_all_lines_means_none():
    boxes = boxes_on(straight(60.0), straight(60.0, y=3.5))
    assert near(boxes, (30.0, 1.7)) is None
    assert near(boxes, (70.0, 0.0)) is None
    assert near(BoxSet.empty(), (0.0, 0.0)) is None


def test_only_the_kind_that_is_asked_for_is_looked_at():
    boxes = BoxSet.concatenate([boxes_on(straight(60.0)), boxes_on(straight(60.0, y=0.3), form=BoxForm.KERB)])
    for kind, y in (("lane_marking", 0.0), ("road_boundary", 0.3)):
        one = near(boxes, (30.0, 0.15), kind)
        assert one.kind.tolist() == [kind]
        assert np.median(one.xyz[:, 1]) == pytest.approx(y, abs=0.01)


def test_it_grows_with_the_boxes_that_are_found():
    boxes = boxes_on(straight(100.0))
    lengths = []
    for end in (20.0, 50.0, 100.0):
        one = near(boxes.take(boxes.centre[:, 0] <= end), (10.0, 0.1))
        lengths.append(float(one.length_m[0]))
    assert lengths == pytest.approx([20.0, 50.0, 100.0], abs=1.0)


def line_of(*xy):
    xyz = np.zeros((len(xy), 3))
    xyz[:, :2] = xy
    return LineSet.from_lines([xyz], kind=["lane_marking"], sigma_xy_m=0.01 * np.arange(len(xy)))


def test_a_line_runs_as_it_did_before():
    before = line_of((0.0, 0.0), (10.0, 0.0))
    longer = line_of((-5.0, 0.0), (0.0, 0.0), (10.0, 0.0), (15.0, 0.0))
    turned = longer.with_columns(xyz=longer.xyz[::-1], sigma_xy_m=longer.sigma_xy_m[::-1])
    for one in (longer, turned):
        again = oriented_like(one, before)
        assert again.xyz[:, 0].tolist() == [-5.0, 0.0, 10.0, 15.0]
        assert again.sigma_xy_m.tolist() == longer.sigma_xy_m.tolist()


@pytest.mark.parametrize(
    ("other", "may"),
    [
        ([(45.0, 0.5), (60.0, 1.0)], True),  # ahead of the end
        ([(-20.0, 0.0), (-5.0, 0.0)], True),  # behind the start
        ([(20.0, 0.1), (60.0, 0.1)], True),  # it begins on the line
        ([(0.0, 3.5), (30.0, 3.5)], False),  # beside it
        ([(70.0, 0.0), (90.0, 0.0)], False),  # too far
    ],
)
def test_what_may_go_on_is_ahead_or_on_the_line(other, may):
    one = line_of(*((x, 0.0) for x in range(31)))
    assert may_continue(one.xyz, line_of(*other).xyz, 32.0) is may


def test_why_a_line_ends():
    line = np.column_stack([np.arange(20.0), np.zeros(20), np.zeros(20)])
    assert stop_reasons(line, everything_seen) == (TraceStop.FADED, TraceStop.FADED)
    assert stop_reasons(line, nothing_seen) == (TraceStop.END_OF_DATA, TraceStop.END_OF_DATA)
    ring = np.column_stack([bend(8.0, 2.0 * np.pi - 0.05)[0], np.zeros(111)])
    assert stop_reasons(ring, everything_seen) == (TraceStop.RING, TraceStop.RING)
