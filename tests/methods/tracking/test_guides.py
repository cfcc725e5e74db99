"""Remains of worn dashes are joined along the line beside them that is most surely parallel to them."""

import numpy as np
from tests.scenes.box_scenes import boxes_on, straight

from linework.methods.tracking.guides import join_along
from linework.methods.tracking.neighbours import AXIS_STATION_M, LineAxis
from linework.methods.tracking.track import TrackConfig, track_lines
from linework.model.boxes import BoxSet


def axis(y_m, start_m, end_m):
    """The axis of a line whose offset is given along it."""
    x = np.arange(start_m, end_m, AXIS_STATION_M)
    y = np.asarray(y_m(x)) if callable(y_m) else np.full(len(x), y_m)
    return LineAxis.of(x, np.column_stack([x, y, np.zeros(len(x))]))


def worn(*starts_m):
    """Remains of 2 m of dashes, in a row."""
    return BoxSet.concatenate([boxes_on(straight(2.0, x=x), noise=0.005, seed=int(x)) for x in starts_m])


def joined(boxes, guides):
    """Return how many lines the remains make."""
    config = TrackConfig()
    pieces = track_lines(boxes, config, width_m=0.06, least_boxes=1)
    return len(join_along(boxes, pieces, guides, 40.0).with_boxes(3)), len(pieces)


def ragged(x):
    """A pavement's edge that is 0.4 m farther out over some metres."""
    return -4.0 - 0.4 * np.exp(-(((x - 34.0) / 4.0) ** 2))


def test_paint_guides_where_a_longer_edge_is_ragged():
    boxes = worn(0.0, 34.0, 68.0)
    edge, paint = axis(ragged, -20.0, 120.0), axis(3.5, -10.0, 90.0)
    assert joined(boxes, [edge, paint]) == (1, 3)
    # The last guide counts: along the edge alone they are three
    assert joined(boxes, [paint, edge])[0] == joined(boxes, [edge])[0] == 3


def test_a_line_does_not_guide_its_own_pieces():
    boxes = worn(0.0, 18.0, 36.0, 54.0)
    own, edge = axis(0.0, 0.0, 38.0), axis(-4.0, -20.0, 120.0)
    # The fourth lies beyond the end of what is known of the line
    assert joined(boxes, [edge, own]) == (1, 4)
