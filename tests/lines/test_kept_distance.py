"""Lines that were not measured at a place are known where measured ones beside them keep their distance."""

import tracemalloc

import numpy as np
import pytest
from tests.lines.test_lanes import CENTRE, EDGE, FAR, X, pairs, road

from linework.lines.kept_distance import known_by_distance
from linework.lines.lane_evidence import Bound
from linework.lines.lanes import find_lanes

#: Where both lines of a lane are worn away, and the edge of the pavement beside them is in sight.
WORN_M = (40.0, 65.0)
PAVEMENT = ("pavement", "road_boundary", 3.9, "", "")


def worn(lines, *names):
    """Return lines of which some are worn away over the stretch."""
    here = (lines.xyz[:, 0] > WORN_M[0]) & (lines.xyz[:, 0] < WORN_M[1])
    return lines.with_columns(bridged=here & np.isin(lines.id[lines.line_of_vertex], names))


def lengths_m(lines):
    """Return the length of the lanes between the centre line and the left edge line, each [m]."""
    lanes = find_lanes(lines)
    own = [set(pair) == {"centre", "edge"} for pair in zip(lanes.right_id, lanes.left_id, strict=True)]
    return sorted(lanes.centre.length_m[np.array(own, dtype=bool)].round().tolist())


def test_a_lane_goes_on_where_another_line_says_where_its_worn_lines_are():
    lines = worn(road(EDGE, CENTRE, PAVEMENT), "edge", "centre")
    assert lengths_m(lines) == [100.0]
    lanes = find_lanes(lines)
    # It is said how much of it was measured
    assert lanes.measured_share.min() == pytest.approx(0.76, abs=0.02)


@pytest.mark.parametrize(
    "others",
    [
        (),
        # It turns away while they cannot be seen
        (("pavement", "road_boundary", lambda x: 3.9 + np.interp(x, [38, 42, 63, 67], [0, 0.15, 0.15, 0]), "", ""),),
        # It was never beside them in sight
        (("pavement", "road_boundary", lambda x: np.where((x > 36) & (x < 70), 3.9, np.nan), "", ""),),
        # It is that of another road
        (("pavement", "road_boundary", 17.0, "", ""),),
    ],
)  # fmt: skip
def test_where_nothing_says_where_both_lines_are_the_lane_ends(others):
    assert len(lengths_m(worn(road(EDGE, CENTRE, *others), "edge", "centre"))) == 2


def test_lines_that_are_known_by_their_distance_bound_a_lane_of_their_own():
    """The left edge line comes back where the centre line is worn away; the right one says where that is."""
    again = ("again", "lane_marking", lambda x: np.where((x > 42) & (x < 64), 3.5, np.nan), "edge", "solid")
    lines = worn(road(CENTRE, FAR, again), "centre")
    assert {"again", "centre"} in [set(pair) for pair in pairs(find_lanes(lines))]


def test_what_is_worn_away_itself_says_nothing():
    lines = worn(road(EDGE, CENTRE, FAR, PAVEMENT), "edge", "centre", "far", "pavement")
    assert len(lengths_m(lines)) == 2


def test_a_distance_counts_within_reach_of_the_station():
    """Two lines that were measured beside each other 60 m farther back say nothing; 20 m are needed within 50 m."""

    def rows_of(measured):
        return [[Bound(1, 0.0, 0.0, float(k), 0.01, k not in measured), Bound(2, 0.5, 0.0, float(k), 0.01, False)]
                for k in range(120)]  # fmt: skip

    def known(measured):
        return {k for k, lines in enumerate(known_by_distance(rows_of(measured))) if lines == {1}}

    assert known(range(20)) == set(range(20, 51))
    assert known(range(19)) == set()
    assert known([*range(10), *range(100, 110)]) == set()
    # What crosses a perpendicular twice has no distance there
    twice = [Bound(1, 0.3, 0.0, 200.0, 0.01, False)]
    assert not any(known_by_distance([[*row, *twice] for row in rows_of(range(60))]))
    assert known_by_distance([]) == [] and known_by_distance([[]]) == [frozenset()]


def most_memory_of(n_pieces):
    """Return the most memory that is used for a centre line with worn edges in pieces of 40 m. [bytes]"""
    rows = [[Bound(2 + k // 40, -3.5, 0.0, float(k % 40), 0.01, k % 5 == 0), Bound(1, 0.0, 0.0, float(k), 0.01, False)]
            for k in range(40 * n_pieces)]  # fmt: skip
    tracemalloc.start()
    try:
        assert any(known_by_distance(rows))
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_is_that_of_the_places_where_lines_lie_beside_each_other():
    assert most_memory_of(64) < 6 * most_memory_of(16)


def test_known_lines_do_not_depend_on_the_order_of_lines():
    lines = worn(road(EDGE, CENTRE, FAR, PAVEMENT), "edge", "centre")
    expected = pairs(find_lanes(lines))
    assert len(expected) == 2
    for order in ([3, 2, 1, 0], [1, 3, 0, 2]):
        assert pairs(find_lanes(lines.take(order))) == expected


def test_a_lane_as_narrow_as_the_limit_is_not_cut_where_its_lines_wobble():
    def beside(width_m):
        return ("left", "lane_marking", lambda x: width_m + 0.03 * np.sin(x), "edge", "solid")

    assert [len(find_lanes(road(CENTRE, beside(width_m)))) for width_m in (2.1, 2.15, 2.21, 3.0)] == [
        0,
        0,
        1,
        1,
    ]
    (length_m,) = find_lanes(road(CENTRE, beside(2.21))).centre.length_m
    assert length_m == pytest.approx(X[-1], abs=2.0)
