"""Solid and dashed lines that end at mouths, where the boundary beside them leads away: bare road there is no wear."""

import numpy as np
import pytest
from tests.scenes.box_scenes import bend, boxes_on, everything_seen, straight

from linework.methods.tracking.line_ends import from_longest_gap
from linework.methods.tracking.marking_lines import marking_lines
from linework.methods.tracking.mouths import LEAST_MOUTH_M, NO_MOUTHS, Mouths
from linework.methods.tracking.neighbours import LineAxis
from linework.methods.tracking.smooth import smooth_line
from linework.methods.tracking.track import TrackConfig, track_lines

#: Where five mouths begin, their width, and where paint is worn off over 1.5 m. [m]
MOUTHS, MOUTH_M = np.array([15.0, 45.0, 75.0, 105.0, 135.0]), 13.0
WORN = np.array([6.0, 34.0, 64.0, 94.0, 124.0, 156.0])
LENGTH_M = 163.0


def axis(x, y):
    xy = np.column_stack([x, y])
    return LineAxis.of(np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))]), xy)


def kerbs(mouths=MOUTHS, *, turns=True, y=1.0, width_m=MOUTH_M):
    """Kerbs beside a line along x, which turn into the mouths with corners of 4 m, or only leave off there."""
    ends = [0.0, *np.ravel(np.column_stack([mouths, mouths + width_m])).tolist(), LENGTH_M]
    a = np.linspace(0.0, 0.5 * np.pi, 20)
    corner = 4.0 * np.column_stack([np.sin(a), 1.0 - np.cos(a)])
    found = []
    for start, end in zip(ends[::2], ends[1::2], strict=True):
        x, y_of = np.linspace(start, end, 40), np.full(40, y)
        if turns and end < LENGTH_M:
            x, y_of = np.concatenate([x, end + corner[1:, 0]]), np.concatenate([y_of, y + corner[1:, 1]])
        if turns and start > 0.0:
            x = np.concatenate([start - corner[:0:-1, 0], x])
            y_of = np.concatenate([y + corner[:0:-1, 1], y_of])
        found.append(axis(x, y_of))
    return found


def paint(*bare):
    """Boxes of a solid line along x without those in stretches that are bare: starts, length."""
    boxes = boxes_on(straight(LENGTH_M))
    x = boxes.centre[:, 0]
    gone = [((x[:, None] >= start) & (x[:, None] <= start + length)).any(axis=1) for start, length in bare]
    return boxes.take(~np.any(gone, axis=0))


def lines_through(boxes, bounds=(), seen=everything_seen):
    """Return lowest and highest x of the lane markings of boxes beside boundaries [m]."""
    tracks = track_lines(boxes, TrackConfig(), width_m=0.06)
    mouths = Mouths(bounds, seen) if bounds else NO_MOUTHS
    found, *_ = marking_lines(boxes, tracks, everything_seen, mouths=mouths)
    return sorted((float(m.line.xyz[:, 0].min()), float(m.line.xyz[:, 0].max())) for m in found)


def chance_at_the_gap(boxes, bounds):
    """Return how likely boundaries beside the only gap of boxes would be open by chance."""
    box = np.arange(len(boxes))
    (before,) = np.flatnonzero(np.diff(boxes.along(box)) > LEAST_MOUTH_M)
    return float(Mouths(bounds, everything_seen).chances(boxes, box, np.array([before]))[0])


def test_a_little_worn_line_ends_at_mouths_that_take_a_third_of_it():
    found = lines_through(paint((MOUTHS, MOUTH_M), (WORN, 1.5)), kerbs())
    assert len(found) == 6
    np.testing.assert_allclose([end for _, end in found[:-1]], MOUTHS, atol=1.0)
    np.testing.assert_allclose([start for start, _ in found[1:]], MOUTHS + MOUTH_M, atol=1.0)


@pytest.mark.parametrize(
    "bounds",
    [(), kerbs(np.zeros(0)), kerbs(turns=False)],
    ids=["without boundaries", "beside a kerb that goes on", "beside a kerb that may not have been seen"],
)
def test_a_worn_line_goes_on_where_no_boundary_leads_away(bounds):
    assert len(lines_through(paint((MOUTHS, MOUTH_M), (WORN, 1.5)), bounds)) == 1


def test_a_boundary_on_the_other_side_closes_no_mouth():
    # A line 0.4 m beside a kerb, and as near to another on its other side: a lane between two islands
    mouth = np.array([45.0])
    boxes = paint((mouth, MOUTH_M))
    other = axis(np.linspace(0.0, LENGTH_M, 60), np.full(60, -0.4))
    alone = chance_at_the_gap(boxes, kerbs(mouth, y=0.4))
    assert alone < 0.1
    assert chance_at_the_gap(boxes, [*kerbs(mouth, y=0.4), other]) == alone


def test_what_leads_away_on_the_other_side_opens_no_mouth():
    mouth = np.array([45.0])
    boxes = paint((mouth, MOUTH_M))
    leaves_off = kerbs(mouth, turns=False, y=0.4)
    for y, chance in (([0.1, 0.7], 0.06), ([-0.1, -0.7], 1.0)):
        ends = [axis([x, x], y) for x in (50.0, 53.0)]
        assert chance_at_the_gap(boxes, [*leaves_off, *ends]) == pytest.approx(chance, abs=0.01)


def test_a_line_goes_on_where_what_is_beside_it_is_hidden():
    hidden = lines_through(paint((MOUTHS, MOUTH_M), (WORN, 1.5)), kerbs(), lambda xy: xy[:, 1] < 0.5)
    assert len(hidden) == 1


def test_a_gap_is_not_explained_by_the_wear_that_it_would_be():
    # 12 m of crisp paint, in which 17 m are bare: nothing else says that the line is worn
    crisp = paint((np.array([3.0]), 17.0), (np.array([32.0]), 140.0))
    (line,) = lines_through(crisp)
    assert line == pytest.approx((20.0, 32.0), abs=0.6)
    # Where most of the rest is gone, too, it is a worn line
    worn = boxes_on(straight(90.0), keep=0.3, seed=2)
    x = worn.centre[:, 0]
    assert len(lines_through(worn.take((x < 40.0) | (x > 49.0)))) == 1


def test_a_worn_line_goes_on_between_mouths():
    # Each gap alone is as long as wear makes them where as much is worn as here
    bare = np.arange(10.0, 160.0, 12.0)
    whole = lines_through(paint((bare, 6.0)), kerbs(np.array([94.0])))
    assert whole[0][0] < 1.0
    assert whole[-1][1] > LENGTH_M - 1.0
    assert len(whole) <= 2


def test_dashes_end_at_a_mouth_where_one_is_missing():
    start = np.array([k * 9.0 for k in range(19) if k != 10])
    boxes = boxes_on(*(straight(3.0, x=x) for x in start))
    assert len(lines_through(boxes)) == 1
    first, second = lines_through(boxes, kerbs(np.array([87.0])))
    assert first[1] == pytest.approx(84.0, abs=0.5)
    assert second[0] == pytest.approx(99.0, abs=0.5)


def test_lines_between_mouths_at_equal_distances_are_no_dashes():
    # Between the arms of a roundabout: 6 m of paint every 24 m, as long as dashes in use
    start = np.arange(28.0, 110.0, 24.0)
    boxes = boxes_on(*(straight(6.0, x=x) for x in start))
    assert len(lines_through(boxes)) == 1
    at_mouths = lines_through(boxes, kerbs(np.arange(11.0, 130.0, 24.0), width_m=16.0))
    np.testing.assert_allclose(at_mouths, np.column_stack([start, start + 6.0]), atol=0.6)


def test_dashes_beside_mouths_at_other_distances_are_one_line():
    start = np.arange(28.0, 110.0, 24.0)
    boxes = boxes_on(*(straight(6.0, x=x) for x in start))
    assert len(lines_through(boxes, kerbs(np.array([37.0, 87.0]), width_m=8.0))) == 1


def test_a_ring_begins_behind_its_longest_gap():
    xy, u = bend(12.0, 2.0 * np.pi)
    t = np.arange(len(xy)) * 0.45
    whole = boxes_on((xy, u))
    boxes = whole.take((t < 20.0) | (t > 30.0))
    order = np.arange(len(boxes))
    ring = from_longest_gap(boxes, order)
    assert np.hypot(*(boxes.centre[ring[0], :2] - boxes.centre[ring[-1], :2])) > 8.0
    assert sorted(ring) == order.tolist()
    straight_on = boxes_on(straight(50.0))
    some = straight_on.take(np.abs(straight_on.centre[:, 0] - 20.0) > 5.0)
    np.testing.assert_array_equal(from_longest_gap(some, np.arange(len(some))), np.arange(len(some)))


def test_a_short_gap_is_no_end_without_a_reason():
    # The third of four lines between mouths is worn over 2 m, where nobody can tell a mouth
    boxes = boxes_on(straight(110.0))
    line = smooth_line(boxes, np.arange(len(boxes)), (0.0, 0.0))
    whole = np.column_stack([np.arange(20.0, 100.0, 21.0), np.arange(27.0, 100.0, 21.0)])
    worn = np.array([*whole[:2], [62.0, 67.0], [69.0, 71.0], whole[3]])
    mouths = Mouths(kerbs(np.array([5.0, 28.0, 50.0, 72.0, 92.0]), width_m=12.0), everything_seen)
    assert mouths.log_odds_of_rhythm(line, whole) < 0.0
    assert mouths.log_odds_of_rhythm(line, worn) < 0.0
    # Nor does a gap count beside which no boundary is known
    few = Mouths(kerbs(np.array([5.0, 28.0, 50.0, 72.0, 92.0]), width_m=12.0)[:3], everything_seen)
    assert few.log_odds_of_rhythm(line, whole) < 3.0


def test_mouths_in_all_gaps_do_not_explain_each_other():
    mouths = np.arange(16.0, 140.0, 32.0)
    boxes = paint((mouths, 16.0))
    box = np.arange(len(boxes))
    gaps = np.flatnonzero(np.diff(boxes.along(box)) > LEAST_MOUTH_M)
    assert len(gaps) == len(mouths)
    chances = Mouths(kerbs(mouths, width_m=16.0), everything_seen).chances(boxes, box, gaps)
    # The boundary is open beside half of the line, and beside none of its paint
    assert chances.max() <= 0.2
