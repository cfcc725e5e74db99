"""Lanes between lines: only where both bounds were measured, never outside an edge line, and as wide as they are."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from linework.lines.lanes import find_lanes
from linework.model.lines import LineSet
from linework.simulation.roads.draw import ROADS, draw_scenario
from linework.simulation.roads.true_lanes import LANE_STEP_M, true_lanes
from linework.simulation.scene.scene import build_scene, truth_lines

X = np.arange(0.0, 101.0)


def road(*rows, **columns):
    """Return lines along the road: (id, kind, offset, role, pattern), the offset a number or a function of x."""
    shapes = []
    for _, _, offset, _, _ in rows:
        y = offset(X) if callable(offset) else np.full(len(X), offset)
        shapes.append(np.column_stack([X, y, 100 - 0.02 * np.abs(y)])[np.isfinite(y)])
    names, kinds, _, roles, patterns = zip(*rows, strict=True)
    n = sum(map(len, shapes))
    given = {"sigma_xy_m": np.full(n, 0.01), **columns}
    return LineSet.from_lines(shapes, id=names, kind=kinds, role=roles, pattern=patterns, **given)


EDGE = ("edge", "lane_marking", 3.5, "edge", "solid")
CENTRE = ("centre", "lane_marking", 0.0, "centre", "dashed")
FAR = ("far", "lane_marking", -3.4, "edge", "solid")
KERB = ("kerb", "road_boundary", 6.2, "", "")


def pairs(lanes):
    return sorted(zip(lanes.right_id.tolist(), lanes.left_id.tolist(), strict=True))


def test_a_lane_has_both_lines_its_width_and_its_sigma():
    lanes = find_lanes(road(EDGE, CENTRE, FAR))
    assert {frozenset(pair) for pair in pairs(lanes)} == {
        frozenset({"centre", "edge"}),
        frozenset({"far", "centre"}),
    }
    own = {frozenset(pair): i for i, pair in enumerate(zip(lanes.right_id, lanes.left_id, strict=True))}
    i = own[frozenset({"centre", "edge"})]
    assert lanes.width_m[i] == pytest.approx(3.5, abs=1e-6)
    assert lanes.width_min_m[i] == pytest.approx(3.5, abs=1e-6) == lanes.width_max_m[i]
    assert lanes.sigma_width_m[i] == pytest.approx(0.01 * np.sqrt(2))
    assert lanes.measured_share[i] == 1.0 and lanes.centre.confidence[i] == 1.0
    assert lanes.centre.kind.tolist() == ["lane", "lane"] and len(set(lanes.centre.id)) == 2
    np.testing.assert_allclose(np.abs(lanes.centre[i].xyz[:, 1]), 1.75, atol=1e-6)
    assert lanes.next_id.tolist() == ["", ""]
    # Left is to the left of the centreline's direction
    way = np.sign(lanes.centre[i].xyz[-1, 0] - lanes.centre[i].xyz[0, 0])
    assert (lanes.left_id[i] == "edge") == (way > 0)


def test_outside_an_edge_line_there_is_none():
    """A parking strip of 2.7 m is as wide as a lane; so is a shoulder, whatever the role of the line beside it."""
    assert ("edge", "kerb") not in pairs(find_lanes(road(EDGE, CENTRE, FAR, KERB)))
    mistaken = ("edge", "lane_marking", 3.5, "centre", "solid")
    found = {frozenset(p) for p in pairs(find_lanes(road(mistaken, CENTRE, FAR, KERB)))}
    assert frozenset({"edge", "kerb"}) not in found and frozenset({"centre", "edge"}) in found


def test_a_centre_line_alone_has_lanes_on_both_sides_up_to_the_boundaries():
    left, right = ("left", "road_boundary", 3.0, "", ""), ("right", "road_boundary", -3.0, "", "")
    found = {frozenset(p) for p in pairs(find_lanes(road(CENTRE, left, right)))}
    assert found == {frozenset({"centre", "left"}), frozenset({"centre", "right"})}
    # Without a role nobody knows whether it is an edge line
    unknown = ("centre", "lane_marking", 0.0, "", "solid")
    assert len(find_lanes(road(unknown, left, right))) == 0
    # Boundaries without paint between them are the land beside the road as often as a road
    assert len(find_lanes(road(left, right))) == 0


def test_short_paint_bounds_a_lane_where_it_goes_on():
    """Fifteen metres alone may be a bay; two pieces in one line are a line that is hidden between them."""

    def paint(name, from_m, to_m, y):
        along = lambda x: np.where((x >= from_m) & (x <= to_m), y, np.nan)  # noqa: E731
        return name, "lane_marking", along, "centre", "solid"

    first, second = paint("first", 20, 35, 0.0), paint("second", 60, 75, 0.1)
    aside = paint("aside", 60, 75, 0.6)
    assert len(find_lanes(road(EDGE, first))) == 0
    assert len(find_lanes(road(EDGE, first, aside))) == 0
    lanes = find_lanes(road(EDGE, first, second))
    assert {frozenset(p) for p in pairs(lanes)} == {
        frozenset({"edge", "first"}),
        frozenset({"edge", "second"}),
    }


@pytest.mark.parametrize(("width_m", "n"), [(2.1, 0), (2.3, 1), (4.3, 1), (4.5, 0), (6.5, 0)])
def test_two_lanes_whose_line_is_worn_away_are_not_one(width_m, n):
    lines = road(CENTRE, ("edge", "lane_marking", width_m, "edge", "solid"))
    assert len(find_lanes(lines)) == n
    assert len(find_lanes(lines, widths_m=(2.0, 6.0))) == (1 if width_m <= 6.0 else 0)


def test_what_stands_between_ends_a_lane():
    """Only where the rail is: before it and behind it the lane is two lanes, and no successor of each other."""
    rail = ("rail", "guardrail", lambda x: np.where((x >= 40) & (x <= 60), 1.7, np.nan), "", "")
    lanes = find_lanes(road(EDGE, CENTRE, rail))
    spans = sorted((float(c.xyz[:, 0].min()), float(c.xyz[:, 0].max())) for c in lanes.centre)
    # Stations are not quite at whole metres
    np.testing.assert_allclose(spans, [(0.0, 39.0), (61.0, 100.0)], atol=1.0)
    assert lanes.next_id.tolist() == ["", ""]


def test_one_bridged_bound_lowers_the_confidence_and_two_end_the_lane():
    one, other = np.zeros(101, dtype=bool), np.zeros(101, dtype=bool)
    one[20:80] = True
    lanes = find_lanes(road(EDGE, CENTRE, bridged=np.concatenate([one, other])))
    assert len(lanes) == 1
    assert lanes.measured_share[0] == pytest.approx(0.4, abs=0.03)
    assert lanes.centre.confidence[0] == pytest.approx(0.7, abs=0.02)
    other[40:60] = True
    lanes = find_lanes(road(EDGE, CENTRE, bridged=np.concatenate([one, other])))
    spans = sorted((float(c.xyz[:, 0].min()), float(c.xyz[:, 0].max())) for c in lanes.centre)
    # Stations are not quite at whole metres
    np.testing.assert_allclose(spans, [(0.0, 39.0), (61.0, 100.0)], atol=1.0)
    assert len(find_lanes(road(EDGE, CENTRE, bridged=np.ones(202, dtype=bool)))) == 0


@pytest.mark.parametrize(("hidden_m", "n"), [(4, 1), (8, 2)])
def test_a_lane_goes_on_over_a_few_metres_where_neither_bound_was_measured(hidden_m, n):
    """A parked car hides both bounds at once; the mouth of a side street is wider."""
    hidden = (X >= 40) & (40 + hidden_m > X)
    lanes = find_lanes(road(EDGE, CENTRE, bridged=np.concatenate([hidden, hidden])))
    assert len(lanes) == n
    if n == 1:
        assert lanes.centre.length_m[0] == pytest.approx(100.0)
        assert 0.9 < lanes.measured_share[0] < 1.0


@pytest.mark.parametrize("begin_m", [40.0, 40.2, 40.4, 40.5, 40.7, 40.95])
@pytest.mark.parametrize(("gap_m", "n"), [(5.5, 1), (6.0, 1), (7.5, 2)])
def test_the_gap_that_a_lane_goes_over_does_not_depend_on_where_stations_are(gap_m, n, begin_m):
    gap = begin_m + gap_m * np.array([0.0, 0.5, 1.0])
    x = np.union1d(X[(gap[0] > X) | (gap[2] < X)], gap)
    shapes = [np.column_stack([x, np.full(len(x), y), np.full(len(x), 100.0)]) for y in (0.0, 3.5)]
    lines = LineSet.from_lines(
        shapes, id=["centre", "edge"], kind=["lane_marking"] * 2, role=["centre", "edge"],
        sigma_xy_m=np.full(2 * len(x), 0.01), bridged=np.tile(x == gap[1], 2),
    )  # fmt: skip
    assert len(find_lanes(lines)) == n


def test_a_lane_whose_bound_was_hardly_measured_is_less_sure():
    guessed = X % 20 > 4
    (lane,) = find_lanes(
        road(EDGE, CENTRE, bridged=np.concatenate([np.zeros(101, dtype=bool), guessed]))
    ).centre
    assert 0.5 < lane.confidence < 0.7


def test_a_bound_needs_as_much_measured_paint_as_any_other():
    """Eight metres of paint are no bound because something drew a line of 100 m through them."""
    measured = (X >= 40) & (X <= 48)
    bridged = np.concatenate([np.zeros(101, dtype=bool), ~measured])
    assert len(find_lanes(road(EDGE, CENTRE, bridged=bridged))) == 0


def test_pieces_far_apart_do_not_continue_each_other():
    """Two pieces of 12 m with 30 m between them are more gap than paint."""
    first = ("first", "lane_marking", lambda x: np.where(x <= 12, 0.0, np.nan), "centre", "solid")
    second = (
        "second",
        "lane_marking",
        lambda x: np.where((x >= 42) & (x <= 54), 0.0, np.nan),
        "centre",
        "solid",
    )
    near = ("near", "lane_marking", lambda x: np.where((x >= 30) & (x <= 42), 0.0, np.nan), "centre", "solid")
    assert len(find_lanes(road(EDGE, first, second))) == 0
    assert len(find_lanes(road(EDGE, first, near))) == 2


def test_a_long_piece_goes_on_in_a_short_one():
    """Over a gap no longer than both together: 22 m and 12 m with 28 m between, but not with 48 m."""
    long = ("long", "lane_marking", lambda x: np.where(x <= 22, 0.0, np.nan), "centre", "solid")
    for begin_m, n in ((50, 2), (70, 1)):
        along = lambda x, at=begin_m: np.where((x >= at) & (x <= at + 12), 0.0, np.nan)  # noqa: E731
        assert len(find_lanes(road(EDGE, long, ("short", "lane_marking", along, "centre", "solid")))) == n


@pytest.mark.parametrize(("y", "n"), [(-2.0, 0), (-1.5, 0), (-0.5, 2)])
def test_pieces_of_paint_within_a_lane_do_not_make_a_bound(y, n):
    """Patches one behind the other, as far from the edge line as a cycle lane is wide; and what is a lane from it."""
    pieces = [
        (f"piece {k}", "lane_marking", lambda x, k=k: np.where((x >= k) & (x <= k + 12), y, np.nan), "lane", "solid")
        for k in (20, 40)
    ]  # fmt: skip
    found = pairs(find_lanes(road(EDGE, *pieces, FAR), widths_m=(2.2, 6.5)))
    assert sum(any("piece" in name for name in pair) for pair in found) == 2 * n


@pytest.mark.parametrize(("y", "n"), [(-2.0, 0), (-0.5, 1)])
def test_patches_that_were_joined_to_one_line_count_one_by_one_too(y, n):
    """Eight metres of every thirteen; what is a lane away from other paint is a worn line."""
    patches = ("patches", "lane_marking", y, "lane", "solid")
    bridged = np.tile(False, (3, 101))
    bridged[1] = X % 13 > 8
    found = pairs(find_lanes(road(EDGE, patches, FAR, bridged=bridged.ravel()), widths_m=(2.2, 6.5)))
    assert sum("patches" in pair for pair in found) == 2 * n


@pytest.mark.parametrize("sides", [(1.0,), (-1.0,), (1.0, -1.0)])
def test_lines_on_both_sides_are_beside_a_line_along_no_more_of_it_than_one(sides):
    """A worn lane line with others 1.5 m beside it along a third of it, on one side or on both: most of it is alone."""
    inner = ("inner", "lane_marking", lambda x: np.where(x >= 40, 0.0, np.nan), "lane", "solid")
    # They run away from it where the third ends
    beside = [
        (f"beside {side:+.0f}", "lane_marking", lambda x, side=side: side * (1.5 + np.clip((x - 55) * 0.1, 0, 2)), "lane", "solid")
        for side in sides
    ]  # fmt: skip
    bridged = np.tile(False, (1 + len(sides), 101)).tolist()
    bridged[0] = (X[40:] % 18 > 15).tolist()
    lines = road(inner, *beside, bridged=[flag for row in bridged for flag in row])
    found = pairs(find_lanes(lines))
    assert any("inner" in pair for pair in found)


@pytest.mark.parametrize(("role", "n"), [("", 0), ("lane", 1)])
def test_short_paint_of_unknown_role_beside_other_paint_bounds_no_lane(role, n):
    """Too far from the edge line for a double line, too near for a cycle lane."""
    stray = ("stray", "lane_marking", lambda x: np.where(x < 50, -2.4, np.nan), role, "solid")
    found = pairs(find_lanes(road(EDGE, stray, FAR), widths_m=(2.2, 6.5)))
    assert sum("stray" in pair for pair in found) == n


@pytest.mark.parametrize(
    ("offsets", "outer", "n"),
    [
        # Bright patches here and there, joined to one line as well
        ((2.15, 1.5, 1.85), "edge", 1),
        # Pieces that keep their distance are a line, and so is what lies between two edge lines
        ((1.7, 1.7, 1.7), "edge", 0),
        ((2.15, 1.5, 1.85), "both", 0),
    ],
)
def test_patches_within_a_lane_do_not_end_it(offsets, outer, n):
    places = [10, 25, 45, 60, 80, 95], np.repeat(offsets, 2)
    patches = ("patches", "lane_marking", lambda x: np.interp(x, *places), "lane", "solid")
    centre = ("centre", "lane_marking", 0.0, "edge" if outer == "both" else "centre", "solid")
    lines = road(EDGE, centre, patches)
    x, is_patches = lines.xyz[:, 0], lines.id[lines.line_of_vertex] == "patches"
    bridged = is_patches & ~np.any([(x >= a) & (x <= a + 15) for a in (10, 45, 80)], axis=0)
    lanes = find_lanes(lines.with_columns(bridged=bridged))
    assert [set(pair) for pair in pairs(lanes)] == [{"centre", "edge"}] * n
    assert all(lanes.centre.length_m > 99.0) and all(lanes.width_min_m > 3.49)


def test_patches_of_one_line_that_is_the_centre_elsewhere_do_not_bound_lanes():
    """What a line goes aside to at its end is judged by itself, where the line that goes on there was found too."""
    aside = lambda x: np.interp(x, [8, 25], [1.2, 0.0])  # noqa: E731
    jumping = ("jumping", "lane_marking", aside, "centre", "dashed")
    other = ("other", "lane_marking", lambda x: np.where(x <= 40, 0.0, np.nan), "centre", "dashed")
    lines = road(EDGE, jumping, other)
    x, is_jumping = lines.xyz[:, 0], lines.id[lines.line_of_vertex] == "jumping"
    lanes = find_lanes(lines.with_columns(bridged=is_jumping & (x > 8) & (x < 25)))
    assert lanes.width_min_m.min() > 3.4
    assert lanes.centre.xyz[:, 0].min() == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("longer_m", [0.0, 2.0])
def test_paint_beside_a_stray_bounds_lanes_whatever_the_order_of_lines(longer_m):
    """Of two lines as long as each other as well: one of them is left, and the space up to it is a lane."""
    outer = ("outer", "lane_marking", 3.5, "", "solid")
    inner = ("inner", "lane_marking", lambda x: np.where(x < 101 - longer_m, 2.4, np.nan), "", "solid")
    centre = ("centre", "lane_marking", 0.0, "centre", "dashed")
    lines = road(outer, inner, centre)
    found = [find_lanes(lines.take(order)) for order in ([0, 1, 2], [1, 0, 2], [2, 1, 0], [2, 0, 1])]
    (pair,) = {frozenset(pair) for lanes in found for pair in pairs(lanes)}
    assert [len(lanes) for lanes in found] == [1] * 4
    assert "centre" in pair and (pair == {"centre", "outer"} or longer_m == 0.0)


def test_a_stray_between_paint_and_a_kerb_does_not_end_the_lane():
    stray = ("stray", "lane_marking", lambda x: np.where(x < 60, 1.0, np.nan), "", "solid")
    left, right = ("left", "road_boundary", 3.0, "", ""), ("right", "road_boundary", -3.0, "", "")
    found = {frozenset(p) for p in pairs(find_lanes(road(CENTRE, stray, left, right)))}
    assert found == {frozenset({"centre", "left"}), frozenset({"centre", "right"})}


@pytest.mark.parametrize(
    ("worn", "bounds"), [(0.3, {"far", "edge"}), (0.0, {"far", "older"}), (0.04, {"far", "older"})]
)
def test_lanes_lie_between_the_newer_lines_not_the_older_beside_them(worn, bounds):
    # Two generations 0.4 m apart: the one that is worn more is older; stripes worn alike are a double line
    older = ("older", "lane_marking", 3.1, "edge", "solid")
    centre = ("centre", "lane_marking", 0.0, "centre", "dashed")
    lines = road(EDGE, older, centre, FAR)
    is_worn = (
        np.isin(lines.xyz[:, 0] % 10.0, np.arange(10.0)[: round(10 * worn)])
        if worn >= 0.1
        else lines.xyz[:, 0] < 100 * worn
    )
    lines = lines.with_columns(bridged=is_worn & (lines.id[lines.line_of_vertex] == "older"))
    lanes = find_lanes(lines)
    assert set(np.concatenate([lanes.left_id, lanes.right_id])) == bounds | {"centre"}
    assert lanes.width_m.max() == pytest.approx(3.5 if worn >= 0.1 else 3.4, abs=1e-6)


@pytest.mark.parametrize("hidden_m", [15, 34])
def test_what_a_car_hides_of_a_double_line_makes_no_stripe_older(hidden_m):
    left = ("left", "lane_marking", 0.15, "centre", "solid")
    right = ("right", "lane_marking", -0.15, "centre", "solid")
    lines = road(EDGE, left, right, FAR)
    x = lines.xyz[:, 0]
    hidden = (x >= 30) & (x < 30 + hidden_m) & (lines.id[lines.line_of_vertex] == "left")
    double = np.array([False, True, True, False])
    lanes = find_lanes(lines.with_columns(bridged=hidden, double=double))
    # Each stripe bounds the lane on its own side only
    assert {frozenset(p) for p in pairs(lanes)} == {frozenset({"left", "edge"}), frozenset({"right", "far"})}


def test_a_wedge_is_no_lane():
    """Behind the end of a lane its two lines run together over 60 m: the lane ends where that begins."""
    closing = (
        "edge",
        "lane_marking",
        lambda x: np.where(x < 40, 3.5, 3.5 - 0.055 * (x - 40)),
        "edge",
        "solid",
    )
    (lane,) = find_lanes(road(closing, CENTRE)).centre
    assert lane.xyz[:, 0].max() == pytest.approx(40.0, abs=6.0)


def test_a_line_that_jumps_cuts_the_lane():
    jumping = ("edge", "lane_marking", lambda x: 3.2 + 0.5 * np.clip((x - 50) / 2.0, 0, 1), "edge", "solid")
    lanes = find_lanes(road(jumping, CENTRE))
    assert len(lanes) == 2
    assert sorted(lanes.width_m.round(2).tolist()) == pytest.approx([3.2, 3.7], abs=0.03)


def test_a_lane_continues_where_a_line_begins_at_the_end_of_another():
    first = ("first", "lane_marking", lambda x: np.where(x <= 50, 3.5, np.nan), "edge", "solid")
    second = ("second", "lane_marking", lambda x: np.where(x >= 50, 3.5, np.nan), "edge", "dashed")
    lanes = find_lanes(road(CENTRE, first, second))
    assert len(lanes) == 2
    i = next(k for k in range(2) if lanes.next_id[k])
    assert lanes.next_id[i] == lanes.centre.id[1 - i] and lanes.next_id[1 - i] == ""
    apart = ("second", "lane_marking", lambda x: np.where(x >= 50, 3.6, np.nan), "edge", "dashed")
    assert find_lanes(road(CENTRE, first, apart)).next_id.tolist() == ["", ""]


def test_lanes_do_not_depend_on_the_order_or_direction_of_lines():
    lines = road(EDGE, CENTRE, FAR, KERB)
    one = find_lanes(lines)
    other = find_lanes(lines.take([3, 1, 0, 2]))
    assert one.left_id.tolist() == other.left_id.tolist() and one.right_id.tolist() == other.right_id.tolist()
    assert one.centre.id.tolist() == other.centre.id.tolist()
    # A road follows one of the longest lines: of two as long as each other either
    np.testing.assert_allclose(one.right_xyz, other.right_xyz, atol=1e-9)


def test_no_lines_have_no_lanes():
    assert len(find_lanes(LineSet.empty("EPSG:25832"))) == 0
    assert find_lanes(LineSet.empty("EPSG:25832")).centre.crs.startswith("PROJCRS")


@pytest.mark.parametrize("kind", ROADS)
def test_between_exact_lines_all_lanes_are_found_and_none_invented(kind):
    """Lanes that the simulator states, which are not made from lines: at least 85 %, as wide to 3 cm."""
    scenario = draw_scenario(kind, 77, 120.0)
    empty = (np.zeros((1, 3)), np.zeros(1, dtype=np.int64), np.zeros(1))
    lines = truth_lines(scenario, build_scene(scenario), empty, "local")
    # Which of two generations of paint is in force is not told by where the lines are
    lines = lines[lines.note != "older"]
    lanes, true = find_lanes(lines), true_lanes(scenario, most_m=4.4)
    middle = 0.5 * (true.right_xyz + true.left_xyz)
    width = np.hypot(*(true.left_xyz - true.right_xyz)[:, :2].T)
    for lane, own in zip(lanes.centre, lanes.width_m, strict=True):
        assert len(middle)
        distance, nearest = cKDTree(middle[:, :2]).query(lane.xyz[:, :2])
        # The lines, but not the lanes that are stated, continue beyond the drive
        along, _ = scenario.layout.road.alignment.locate(lane.xyz[:, :2] - scenario.origin_m[:2])
        driven = (along >= 0.0) & (along <= scenario.length_m)
        assert (distance[driven] < 1.0).mean() > 0.9
        assert own == pytest.approx(np.median(width[nearest]), abs=0.03)
    if kind not in ("junction", "roundabout", "mixed"):
        asked = LANE_STEP_M * np.count_nonzero(width >= 2.2)
        assert lanes.centre.length_m.sum() >= 0.85 * asked


def test_a_strip_beside_the_only_line_of_a_road_is_no_part_of_its_lane():
    """The only line is in the middle: where the kerb of one side was not found, the wall behind it bounds no lane."""
    left, right = ("left", "road_boundary", 2.5, "", ""), ("right", "road_boundary", -2.6, "", "")
    assert len(pairs(find_lanes(road(left, CENTRE, right)))) == 2
    for y in (-4.3, -3.7):
        (lane,) = pairs(find_lanes(road(left, CENTRE, ("wall", "road_boundary", y, "", ""))))
        assert set(lane) == {"left", "centre"}
    # A lane that is widened in a bend is still one
    wide = ("wide", "road_boundary", lambda x: -2.6 - 0.8 * np.sin(np.pi * x / 100.0), "", "")
    assert len(pairs(find_lanes(road(left, CENTRE, wide)))) == 2


def test_two_pieces_of_one_centre_line_beside_each_other_are_no_edge_line():
    """Where they overlap by 20 m, one of them lies between the other and the boundary."""

    def centre(name, begin, end, y):
        return (
            name,
            "lane_marking",
            lambda x: np.where((x >= begin) & (x <= end), y, np.nan),
            "centre",
            "dashed",
        )

    lanes = find_lanes(
        road(centre("a", 0, 60, 0.0), centre("b", 40, 100, -0.06), ("kerb", "road_boundary", 3.4, "", ""))
    )
    assert {name for pair in pairs(lanes) for name in pair} == {"a", "b", "kerb"}
    assert lanes.centre.length_m.sum() == pytest.approx(100.0, abs=22.0)
