"""Pieces of paint in a row: one line, or a few stripes and symbols that lie in a row."""

import numpy as np
import pytest
from tests.scenes.box_scenes import bend, boxes_on, everything_seen, nothing_seen, straight

from linework.methods.obb.method import Obb
from linework.methods.protocol import SurveyContext
from linework.methods.tracking import marking_lines
from linework.methods.tracking.line_odds import (
    BARE_ROW,
    POINT_ELSEWHERE,
    SYMBOLS,
    log_odds,
    log_odds_of_bend,
    odds_of_line,
)
from linework.methods.tracking.neighbours import LineAxis, half_lane_sides
from linework.methods.tracking.pattern import PaintRhythm
from linework.methods.tracking.smooth import smooth_line
from linework.methods.tracking.track import Tracks

#: Four pieces of 2.2 m over 31 m, and a line with half of its paint.
FEW = [straight(2.2, x=x) for x in (0.0, 4.5, 16.0, 29.0)]
HALF = [
    straight(3.0, x=x)
    for x in np.arange(0.0, 60.0, 6.3) + np.array([0, 0.9, 0.2, 1.4, 0.6, 0, 1.2, 0.3, 1.0, 0.1])
]


def rows_of(boxes, seen=everything_seen):
    """The lines, and the rows that are more likely something else, of boxes that are tracked as one line."""
    order = np.argsort(boxes.centre[:, 0], kind="stable")
    one = Tracks(order, np.ones(len(order)), np.array([0, len(order)]))
    lines, _, unlikely = marking_lines.marking_lines(boxes, one, seen)
    return lines, unlikely


def test_evidence_adds_up():
    assert log_odds(20.0, 20.0) > log_odds(10.0, 10.0) > log_odds(5.0, 10.0) > log_odds(2.0, 10.0)
    assert log_odds(3.0, 23.0) < 0.0 < log_odds(2.4, 0.0)


def test_a_worn_line_is_sure_and_hidden_road_says_nothing():
    (line,), _ = rows_of(boxes_on(*HALF, noise=0.005))
    assert line.confidence > 0.95
    few = boxes_on(straight(3.0), straight(3.0, x=7.0), noise=0.005)
    (hidden,), _ = rows_of(few, seen=nothing_seen)
    (seen,), _ = rows_of(few)
    assert hidden.confidence > seen.confidence + 0.2


@pytest.mark.parametrize(
    ("places", "period_m", "is_line"),
    [
        ([0, 2, 4, 6], 14.4, False),  # Arrows every 29 m, which no dashes are
        ([0, 2, 4, 6], 6.0, True),  # Dashes every 12 m are in use
        ([0, 1, 2, 4, 6], 14.4, True),  # Some are missing between the others
    ],
)
def test_a_row_at_equal_distances_beyond_any_in_use_is_no_line(places, period_m, is_line):
    dashes = period_m * np.array(places, dtype=np.float64)[:, None] + np.array([0.0, 3.0])
    boxes = boxes_on(*(straight(3.0, x=start) for start in dashes[:, 0]), noise=0.005)
    line = smooth_line(boxes, np.argsort(boxes.centre[:, 0]), (0.0, 0.0))
    odds = odds_of_line(line, dashes, PaintRhythm(period_m, 3.0, 1.0), dashes, everything_seen)
    assert (odds > 0.0) == is_line


@pytest.mark.parametrize(
    ("sides", "period_m", "is_line"), [(0, 20.0, True), (1, 20.0, True), (2, 20.0, False), (2, 6.0, True)]
)
def test_a_row_as_far_apart_as_arrows_in_the_middle_of_a_lane_is_no_line(sides, period_m, is_line):
    dashes = period_m * np.arange(5.0)[:, None] + np.array([0.0, 3.0])
    boxes = boxes_on(*(straight(3.0, x=start) for start in dashes[:, 0]), noise=0.005)
    line = smooth_line(boxes, np.argsort(boxes.centre[:, 0]), (0.0, 0.0))
    odds = odds_of_line(line, dashes, PaintRhythm(period_m, 3.0, 1.0), dashes, everything_seen, sides)
    assert (odds > 0.0) == is_line


def on_ring(radius_m, dash_m, period_m, n):
    """Boxes of dashes on a left-hand bend, and the dashes (n, 2) along it [m]."""
    starts = period_m * np.arange(n)
    xy, u = bend(radius_m, (starts[-1] + dash_m) / radius_m)
    t = 0.2 + 0.45 * np.arange(len(xy))
    own = ((t[:, None] >= starts) & (t[:, None] <= starts + dash_m)).any(axis=1)
    return boxes_on((xy[own], u[own]), noise=0.003, flip=False), starts[:, None] + np.array([0.0, dash_m])


@pytest.mark.parametrize(
    ("radius_m", "dash_m", "period_m", "least", "most"),
    [
        (17.0, 4.0, 21.0, -200.0, -20.0),  # Between the arms of a roundabout
        (6.0, 1.0, 2.0, -0.2, 0.0),  # A lane of a small one
        (60.0, 3.0, 12.0, -0.5, 0.0),  # A country road
    ],
)
def test_dashes_point_at_one_another(radius_m, dash_m, period_m, least, most):
    boxes, dashes = on_ring(radius_m, dash_m, period_m, 4)
    line = smooth_line(boxes, np.arange(len(boxes)), (0.0, 0.0))
    assert least <= log_odds_of_bend(line, PaintRhythm(period_m, dash_m, 1.0), dashes) <= most


def test_pieces_between_the_arms_of_a_ring_are_lines_of_their_own():
    boxes, _ = on_ring(17.0, 4.6, 21.0, 4)
    one = Tracks(np.arange(len(boxes)), np.ones(len(boxes)), np.array([0, len(boxes)]))
    lines, _, unlikely = marking_lines.marking_lines(boxes, one, everything_seen)
    assert [round(float(np.ptp(m.paint)), 1) for m in lines] == pytest.approx([4.5] * 4, abs=0.5)
    assert [m.why_unlikely for m in unlikely] == [POINT_ELSEWHERE]


def joined(boxes, **choices):
    lines = Obb(**choices).join(boxes, SurveyContext())
    return lines["lane_marking"], lines


@pytest.mark.parametrize(("lines", "is_line"), [(0, True), (1, False), (2, False)])
def test_arrows_half_a_lane_beside_a_line_are_no_line(lines, is_line):
    arrows = [straight(4.5, x=20.0, y=0.0), straight(3.5, x=28.5, y=0.0)]
    beside = [straight(60.0, y=1.75), straight(60.0, y=-1.75)][:lines]
    markings, all_lines = joined(boxes_on(*arrows, *beside, noise=0.005))
    assert len(markings) == lines + is_line
    if not is_line:
        other = all_lines["road_marking_other"]
        assert len(other) == 2 and np.all(np.abs(other.xyz[:, 1]) < 0.05)
        kinds = ("lane_marking", "candidate")
        kept = joined(boxes_on(*arrows, *beside, noise=0.005), kinds=kinds)[1]["candidate"]
        assert SYMBOLS in kept.reason


def test_a_long_piece_half_a_lane_beside_a_line_is_one():
    markings, _ = joined(boxes_on(straight(25.0, x=10.0), straight(60.0, y=1.75), noise=0.005))
    assert len(markings) == 2


def test_the_sides_on_which_a_line_is_half_a_lane_away_are_counted():
    axes = [LineAxis.of(np.linspace(0.0, 40.0, 41), np.column_stack([np.linspace(0.0, 40.0, 41), np.full(41, y)]))
            for y in (0.0, 1.7, -1.8, 5.0)]  # fmt: skip
    assert half_lane_sides(axes, axes, (1.2, 2.2)).tolist() == [2, 1, 1, 0]


def test_a_row_of_few_pieces_over_bare_road_is_kept_with_the_reason():
    lines, unlikely = rows_of(boxes_on(*FEW, noise=0.005))
    assert not lines
    assert [row.why_unlikely for row in unlikely] == [BARE_ROW]


def test_two_stripes_near_each_other_that_are_no_line_are_other_paint():
    # 6.4 m with 2.7 m bare: too bare for a line, without a gap to cut it at
    boxes = boxes_on(straight(2.2), straight(1.5, x=5.1), noise=0.005)
    assert [row.why_unlikely for row in rows_of(boxes)[1]] == [BARE_ROW]
    markings, all_lines = joined(boxes)
    (other,) = all_lines["road_marking_other"]
    assert len(markings) == 0
    assert float(all_lines["road_marking_other"].length_m[0]) == pytest.approx(6.4, abs=0.3)
    # As likely as it is paint, not as it is a line
    assert other.confidence > 0.95


def test_pieces_of_a_row_of_symbols_that_are_no_line_themselves_are_other_paint():
    row = [straight(2.2, x=16.0), straight(1.5, x=21.1), straight(6.0, x=30.0), straight(4.0, x=40.0)]
    beside = [straight(60.0, y=1.75), straight(60.0, y=-1.75)]
    markings, all_lines = joined(boxes_on(*row, *beside, noise=0.005))
    assert len(markings) == 2
    # The pair at the beginning, 6.4 m, is judged a row over bare road in its turn
    assert sorted(all_lines["road_marking_other"].length_m) == pytest.approx([4.0, 5.8, 6.4], abs=0.3)
