"""Lanes to the end of the pavement, where an edge line may not have been found."""

import numpy as np
import pytest
from tests.lines.test_lanes import CENTRE, EDGE, X, pairs, road

from linework.lines.lanes import find_lanes


def test_a_lane_to_the_verge_is_less_sure_where_an_edge_line_may_not_have_been_found():
    """With an edge line on one side there may be one on the other, 0.2 to 0.4 m inside, unless a kerb is there."""
    verge = ("verge", "road_boundary", -3.7, "", "")
    lines = road(EDGE, CENTRE, verge)
    open_, kerb = find_lanes(lines), find_lanes(lines.with_columns(form=["", "", "kerb"]))
    for lanes in (open_, kerb):
        assert {frozenset(p) for p in pairs(lanes)} == {
            frozenset({"centre", "edge"}),
            frozenset({"centre", "verge"}),
        }
    is_verge = ["verge" in pair for pair in zip(open_.left_id, open_.right_id, strict=True)]
    order = np.argsort(is_verge)
    assert open_.centre.confidence[order].tolist() == [1.0, 0.5] and set(kerb.centre.confidence) == {1.0}
    assert open_.sigma_width_m[order] == pytest.approx([0.014, 0.21], abs=0.001)


def test_a_short_edge_of_the_pavement_is_not_enough_where_an_edge_line_may_be_missing():
    verge = ("verge", "road_boundary", lambda x: np.where(x < 15, -3.0, np.nan), "", "")
    assert pairs(find_lanes(road(EDGE, CENTRE, verge))) == pairs(find_lanes(road(EDGE, CENTRE)))
    # So does a long one of which as little was measured
    whole = ("verge", "road_boundary", -3.0, "", "")
    bridged = np.concatenate([np.zeros(202, dtype=bool), X > 15])
    assert pairs(find_lanes(road(EDGE, CENTRE, whole, bridged=bridged))) == pairs(
        find_lanes(road(EDGE, CENTRE))
    )
    assert len(find_lanes(road(EDGE, CENTRE, whole))) == 2


def test_a_solid_line_beside_dashes_may_be_an_edge_line_whatever_its_role():
    """The far half of a motorway, whose edge line on the near side is hidden: nobody sees which line is which."""
    solid = ("solid", "lane_marking", 3.5, "centre", "solid")
    short = ("verge", "road_boundary", lambda x: np.where(x < 15, -4.4, np.nan), "", "")
    assert pairs(find_lanes(road(solid, CENTRE, short))) == pairs(find_lanes(road(solid, CENTRE)))
    # Dashes on both sides are lanes side by side, and a short edge bounds one of them
    dashed = ("dashed", "lane_marking", 3.5, "lane", "dashed")
    assert len(find_lanes(road(dashed, CENTRE, short))) == 2
    # A long edge bounds a lane, less surely
    long = ("verge", "road_boundary", -4.4, "", "")
    lanes = find_lanes(road(solid, CENTRE, long))
    assert sorted(lanes.centre.confidence.tolist()) == [0.5, 1.0]


def test_a_hard_shoulder_is_no_lane_whatever_the_role_of_its_line():
    """What passes for a double centre line is the edge line of a carriageway, with 2.4 m of shoulder behind it."""
    edge = ("solid", "lane_marking", 3.7, "centre", "solid")
    shoulder, lane = (("verge", "road_boundary", offset, "", "") for offset in (6.1, 7.2))
    double = np.array([True, False, False])
    inner = {frozenset({"solid", "centre"})}
    assert {frozenset(p) for p in pairs(find_lanes(road(edge, CENTRE, shoulder, double=double)))} == inner
    # As wide as the lane beside it, to 0.25 m, it is one: so is a narrow one to a kerb
    wide = find_lanes(road(edge, CENTRE, lane, double=double))
    kerb = find_lanes(road(edge, CENTRE, shoulder, double=double, form=["", "", "kerb"]))
    for lanes in (wide, kerb):
        assert {frozenset(p) for p in pairs(lanes)} == {*inner, frozenset({"solid", "verge"})}
