"""Remains of worn dashes are joined along the line beside them that is most surely parallel to them."""

import itertools

import numpy as np
from tests.scenes.box_scenes import boxes_on, straight

from linework.methods.tracking.guides import cut_at_jumps, join_along
from linework.methods.tracking.neighbours import AXIS_STATION_M, LineAxis
from linework.methods.tracking.track import TrackConfig, Tracks, track_lines
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


def generations(*, shift=0.25, n=6):
    """Dashes of an old and a new line side by side, 18 m apart, of which tracking took every second one for the other's."""
    old, new = (
        [
            boxes_on(straight(4.0, x=18.0 * k + x, y=y), noise=0.003, seed=2 * k + x // 9, flip=False)
            for k in range(n)
        ]
        for x, y in ((0, 0.0), (9, shift))
    )
    boxes = BoxSet.concatenate([*old, *new])
    size = len(old[0])
    ends = np.arange(0, 2 * n * size + 1, size)
    dash = [np.arange(a, b) for a, b in itertools.pairwise(ends)]
    crossed = [[dash[k + n * (k % 2)] for k in range(n)], [dash[k + n * ((k + 1) % 2)] for k in range(n)]]
    box = np.concatenate([np.concatenate(line) for line in crossed])
    return boxes, Tracks(box, np.ones(len(box)), np.array([0, n * size, 2 * n * size]))


def offsets_across(boxes, tracks):
    """Return how far each line reaches across. [m]"""
    return [float(np.ptp(boxes.centre[tracks.line(i)[0], 1])) for i in range(len(tracks))]


def test_dashes_of_two_generations_are_told_apart_by_the_solid_line_beside_them():
    boxes, crossed = generations()
    solid = axis(3.5, -10.0, 130.0)
    assert min(offsets_across(boxes, crossed)) > 0.2
    cut = cut_at_jumps(boxes, crossed, [solid])
    lines = join_along(boxes, cut.tracks, [solid], 32.0, cut.links)
    assert len(lines) == 2 and max(offsets_across(boxes, lines)) < 0.05
    # As many boxes as before, each once
    assert sorted(lines.box.tolist()) == sorted(crossed.box.tolist())


def test_a_line_that_changes_its_offset_stays_one_where_nothing_fits_better():
    boxes, crossed = generations()
    alone = crossed.take(np.array([True, False]))
    along, x = np.arange(140.0), np.arange(130.0, -10.0, -1.0)
    against = LineAxis.of(along, np.column_stack([x, np.full(140, 3.5)]))
    for guide in (axis(3.5, -10.0, 130.0), against):
        cut = cut_at_jumps(boxes, alone, [guide])
        assert len(cut.tracks) == len(cut.links) + 1 == 6
        # Nothing joins the pieces but the track itself
        lines = join_along(boxes, cut.tracks, [guide], 12.0, cut.links)
        assert len(lines) == 1
        assert lines.box.tolist() in (alone.box.tolist(), alone.box[::-1].tolist())


def test_nothing_is_cut_without_a_solid_line():
    boxes, crossed = generations()
    assert cut_at_jumps(boxes, crossed, []).tracks is crossed
    assert len(cut_at_jumps(boxes, crossed, [axis(40.0, -10.0, 130.0)]).links) == 0
