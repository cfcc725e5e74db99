"""Lanes beside older paint and lines that are unsure: what is not known is stated, or no lane."""

import numpy as np
import pytest
from tests.lines.test_lanes import CENTRE, EDGE, FAR, pairs, road

from linework.lines.lanes import find_lanes


def worn_left_stripe(*others):
    """Return a road with a double line in its middle, whose left stripe is worn away every ten metres."""
    left = ("left", "lane_marking", 0.15, "centre", "solid")
    right = ("right", "lane_marking", -0.15, "centre", "solid")
    lines = road(EDGE, left, right, FAR, *others)
    worn = (lines.xyz[:, 0] % 10.0 < 3.0) & (lines.id[lines.line_of_vertex] == "left")
    return lines.with_columns(bridged=worn)


def test_a_worn_stripe_of_the_only_double_line_bounds_its_lane():
    assert {frozenset(p) for p in pairs(find_lanes(worn_left_stripe()))} == {
        frozenset({"left", "edge"}), frozenset({"right", "far"}),
    }  # fmt: skip


def test_where_two_lines_were_painted_anew_the_worn_ones_are_older():
    """Beside the left edge line lies other paint too: the road was painted twice."""
    lanes = find_lanes(worn_left_stripe(AGAIN))
    assert "left" not in {*lanes.left_id.tolist(), *lanes.right_id.tolist()}
    # Neither of the two left edges is worn: which of them counts is not known, and stated
    vague = lanes.sigma_width_m > 0.2
    is_left = np.array(["edge" in pair or "again" in pair for pair in pairs(lanes)])
    np.testing.assert_array_equal(vague, is_left)
    assert is_left.any() and lanes.centre.confidence[is_left].max() <= 0.5
    assert lanes.sigma_width_m[is_left] == pytest.approx(0.4 * 0.71, abs=0.01)


def test_lines_that_were_all_shifted_bound_no_lane_with_those_they_replaced():
    """Temporary lines 0.7 m aside, all of them whole: a lane lies between lines of one set, and which is not known."""
    sets = [(f"{name} {shift}", "lane_marking", y + shift, role, pattern)
            for shift in (0.0, 0.7) for name, _, y, role, pattern in (EDGE, CENTRE, FAR)]  # fmt: skip
    assert len(find_lanes(road(*sets))) == 0
    # Paint beside both edge lines and not beside the centre, as pale stones, is no second set
    beside = [("a", "lane_marking", 4.2, "", "solid"), ("b", "lane_marking", -4.1, "", "solid")]
    assert len(find_lanes(road(EDGE, CENTRE, FAR, *beside))) == 2


AGAIN = ("again", "lane_marking", 3.9, "", "solid")
SHIFTED = [("edge 2", "lane_marking", 4.2, "edge", "solid"), ("centre 2", "lane_marking", 0.7, "centre", "dashed"),
           ("far 2", "lane_marking", -2.7, "edge", "solid")]  # fmt: skip


@pytest.mark.parametrize(
    "lines",
    [worn_left_stripe(), worn_left_stripe(AGAIN), worn_left_stripe(*SHIFTED), road(EDGE, CENTRE, FAR, AGAIN)],
)
def test_lanes_beside_other_paint_do_not_depend_on_the_order_of_lines(lines):
    """Nor do they where neither of two lines is worn more, and either may count."""
    lanes = find_lanes(lines)
    rng = np.random.default_rng(7)
    for _ in range(6):
        other = find_lanes(lines.take(rng.permutation(len(lines))))
        assert other.centre.id.tolist() == lanes.centre.id.tolist()
        assert other.left_id.tolist() == lanes.left_id.tolist()
        assert other.right_id.tolist() == lanes.right_id.tolist()
        np.testing.assert_allclose(other.width_m, lanes.width_m, atol=1e-9)
        np.testing.assert_allclose(other.sigma_width_m, lanes.sigma_width_m, atol=1e-9)
        np.testing.assert_allclose(other.centre.confidence, lanes.centre.confidence, atol=1e-9)


@pytest.mark.parametrize(("left_m", "n"), [(3.5, 1), (4.2, 0)])
def test_a_lane_is_one_by_either_paint_beside_each_other(left_m, n):
    """Paint 0.45 m within an edge line: the lane is 4.2 m wide, or 4.65 m and none."""
    edge, other = (
        ("edge", "lane_marking", left_m, "edge", "solid"),
        ("other", "lane_marking", -0.45, "", "solid"),
    )
    found = find_lanes(road(edge, ("far", "lane_marking", 0.0, "edge", "solid"), other))
    assert sum("far" in pair for pair in pairs(found)) == n


@pytest.mark.parametrize(("confidence", "n"), [(0.6, 2), (0.4, 1)])
def test_what_is_less_likely_a_line_than_none_bounds_no_lane(confidence, n):
    lines = road(EDGE, CENTRE, FAR)
    sure = np.where(lines.id == "far", confidence, 0.9)
    assert len(find_lanes(lines.with_columns(confidence=sure))) == n


@pytest.mark.parametrize(("sigma_m", "n"), [(0.3, 2), (0.5, 1)])
def test_a_width_that_may_be_none_of_a_lane_makes_none(sigma_m, n):
    """Three deviations of a width are less than half of 2.2 m, the range of widths of lanes."""
    lines = road(EDGE, CENTRE, FAR)
    sigma = np.where(lines.id[lines.line_of_vertex] == "far", sigma_m, 0.01)
    assert len(find_lanes(lines.with_columns(sigma_xy_m=sigma))) == n


def test_the_shortest_of_three_lines_within_a_metre_bounds_no_lane():
    """Scraped paint beside a double line: the lane goes on to the stripe."""
    left, right = (
        ("left", "lane_marking", 0.15, "centre", "solid"),
        ("right", "lane_marking", -0.15, "centre", "solid"),
    )

    def scraped(y):
        return (
            "scraped",
            "lane_marking",
            lambda x: np.where((x > 20) & (x < 80), y, np.nan),
            "centre",
            "dashed",
        )

    expected = pairs(find_lanes(road(EDGE, left, right, FAR)))
    assert len(expected) == 2
    for y in (0.6, -0.6):
        assert pairs(find_lanes(road(EDGE, left, right, FAR, scraped(y)))) == expected
    # So it does between them
    assert pairs(find_lanes(road(EDGE, left, right, FAR, scraped(0.0)))) == expected


def test_lines_are_unsure_only_where_others_lie_beside_them():
    """Temporary lines leave the lines of a road after 40 m: before, there is one set."""

    def aside(y):
        return lambda x: np.where(x < 40, np.nan, y + np.interp(x, [40, 60], [0.0, 0.7]))

    sets = [
        (f"{name} 2", "lane_marking", aside(y), role, pattern)
        for name, _, y, role, pattern in (EDGE, CENTRE, FAR)
    ]
    lanes = find_lanes(road(EDGE, CENTRE, FAR, *sets))
    assert len(lanes) == 2 and lanes.centre.xyz[:, 0].max() == pytest.approx(40.0, abs=8.0)
    assert lanes.sigma_width_m.max() < 0.02


def test_a_stripe_that_was_found_twice_leaves_the_other_one():
    """Two pieces of the left stripe, 2 cm apart, and the right one for half the way: no third line."""

    def stripe(name, begin, end, y):
        return (
            name,
            "lane_marking",
            lambda x: np.where((x >= begin) & (x <= end), y, np.nan),
            "centre",
            "solid",
        )

    double = [stripe("left", 0, 100, 0.15), stripe("again", 0, 80, 0.17), stripe("right", 10, 60, -0.15)]
    lanes = find_lanes(road(EDGE, *double, FAR))
    assert ["far", "right"] in [sorted(pair) for pair in pairs(lanes)]
    of_right = [pair == {"far", "right"} for pair in pairs_in_order(lanes)]
    assert lanes.width_m[of_right] == pytest.approx([3.25], abs=0.01)


def test_lines_are_settled_between_two_places_at_which_others_lie_beside_them():
    """Other paint lies beside the edge line at both its ends, and leaves it between."""
    away = (
        "edge 2",
        "lane_marking",
        lambda x: 3.5 + np.interp(x, [34, 40, 60, 66], [0.3, 3.0, 3.0, 0.3]),
        "edge",
        "solid",
    )
    lanes = find_lanes(road(EDGE, CENTRE, FAR, away))
    spans = [
        (round(lane.xyz[:, 0].min()), round(lane.xyz[:, 0].max()))
        for lane, pair in zip(lanes.centre, pairs_in_order(lanes), strict=True)
        if pair == {"centre", "edge"}
    ]
    assert any(begin <= 45 and end >= 55 for begin, end in spans)


def pairs_in_order(lanes):
    return [set(pair) for pair in zip(lanes.right_id.tolist(), lanes.left_id.tolist(), strict=True)]


def patchy(lines, **every_m):
    """Return lines of which some are bare for 2 m, every so many metres along the road."""
    x, own = lines.xyz[:, 0], lines.id[lines.line_of_vertex]
    bare = np.zeros(len(x), dtype=bool)
    for name, every in every_m.items():
        bare |= (own == name) & (x % every < 2.0) & (x > 1.0)
    return lines.with_columns(bridged=bare)


def test_how_worn_two_sets_are_tells_of_the_lines_of_which_neither_is_much():
    """The older edge lines are worn every 6 m; the older centre line in three places, which alone may be cars."""
    old = [("old_edge", "lane_marking", 3.8, "edge", "solid"), ("old_far", "lane_marking", -3.75, "edge", "solid"),
           ("old_centre", "lane_marking", -0.45, "centre", "dashed")]  # fmt: skip
    lanes = find_lanes(patchy(road(EDGE, CENTRE, FAR, *old), old_edge=6.0, old_far=6.0, old_centre=45.0))
    assert {frozenset(pair) for pair in pairs(lanes)} == {
        frozenset({"centre", "edge"}),
        frozenset({"far", "centre"}),
    }
    assert lanes.sigma_width_m.max() < 0.02
    # Without the edge lines of both sets it is not known
    vague = find_lanes(
        patchy(road(EDGE, CENTRE, FAR, old[2], ("x", "lane_marking", 3.9, "", "solid")), old_centre=45.0)
    )
    assert not len(vague) or vague.sigma_width_m.max() > 0.2


def test_a_line_that_is_double_by_older_paint_is_no_centre_line():
    """Beyond an edge line with older paint beside it there is a shoulder, whatever its role."""
    edge, far = ((name, "lane_marking", y, "centre", "solid") for name, y in (("edge", 3.5), ("far", -3.4)))
    older = [("a", "lane_marking", 3.1, "centre", "solid"), ("b", "lane_marking", -3.0, "centre", "solid")]
    shoulder = ("shoulder", "road_boundary", 6.3, "", "")
    lines = road(edge, CENTRE, far, *older, shoulder).with_columns(
        double=[True, False, True, True, True, False]
    )
    assert "shoulder" not in {
        name for pair in pairs(find_lanes(patchy(lines, a=8.0, b=8.0))) for name in pair
    }
    # The only double line of a road is its middle
    alone = road(edge, ("2nd", "lane_marking", 3.2, "centre", "solid"), shoulder).with_columns(
        double=[True, True, False]
    )
    assert {"edge", "shoulder"} in pairs_in_order(find_lanes(alone))
