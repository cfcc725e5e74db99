"""Solid lines that end at every mouth of a ring or a street: bare road there is no wear."""

import numpy as np
from tests.scenes.box_scenes import boxes_on, everything_seen, straight

from linework.methods.tracking.marking_lines import marking_lines
from linework.methods.tracking.track import TrackConfig, track_lines

#: Where four mouths begin, their width, and where paint is worn off over 1.5 m. [m]
MOUTHS, MOUTH_M = np.array([20.0, 58.0, 96.0, 134.0]), 13.0
WORN = np.array([8.0, 44.0, 83.0, 120.0, 152.0])


def lines_through(boxes):
    """Return the lane markings of boxes on a road that was seen everywhere, as lowest and highest x [m]."""
    tracks = track_lines(boxes, TrackConfig(), width_m=0.06)
    found, _ = marking_lines(boxes, tracks, everything_seen)
    return sorted((float(m.line.xyz[:, 0].min()), float(m.line.xyz[:, 0].max())) for m in found)


def test_a_little_worn_line_ends_at_mouths_that_take_a_third_of_it():
    boxes = boxes_on(straight(164.0))
    x = boxes.centre[:, 0]
    is_mouth = ((x[:, None] >= MOUTHS) & (x[:, None] <= MOUTHS + MOUTH_M)).any(axis=1)
    is_worn = ((x[:, None] >= WORN) & (x[:, None] <= WORN + 1.5)).any(axis=1)
    found = lines_through(boxes.take(~is_mouth & ~is_worn))
    assert len(found) == 5
    np.testing.assert_allclose([end for _, end in found[:-1]], MOUTHS, atol=0.6)
    np.testing.assert_allclose([start for start, _ in found[1:]], MOUTHS + MOUTH_M, atol=0.6)


def test_a_much_worn_line_goes_on():
    boxes = boxes_on(straight(164.0))
    # Half of it is gone in patches of 2.5 m, one run of three of them
    gone = np.random.default_rng(5).random(66) < 0.5
    gone[[0, 30, 31, 32, 65]] = [False, True, True, True, False]
    found = lines_through(boxes.take(~gone[np.minimum(boxes.centre[:, 0] // 2.5, 65).astype(int)]))
    assert len(found) == 1
