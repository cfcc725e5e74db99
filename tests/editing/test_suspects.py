"""What in a set of lines is worth a look: on made-up roads where it is known what is wrong."""

import numpy as np
import pytest

from linework.editing.queue.gaps import GAP_DRIFT_M, GAP_DRIFT_SHARE, LEAST_SUSPECT_GAP_M, gap_suspects
from linework.editing.queue.suspects import (
    loose_wires,
    missing_dashes,
    rank_suspects,
    sure_lines,
    unlisted_lines,
    unsure_lines,
)
from linework.lines.along import DrivenPath
from linework.model.lines import LineSet
from linework.workbench.review.suspects import suspects

ORIGIN = np.array([500_000.0, 5_800_000.0])


def everywhere(xy):
    return np.ones(len(xy), dtype=bool)


def nowhere(xy):
    return np.zeros(len(xy), dtype=bool)


def road(length=200.0, radius=0.0):
    """A way: straight to the east, or a bend to the left."""
    s = np.arange(0.0, length, 0.5)
    xy = (
        np.column_stack([radius * np.sin(s / radius), radius - radius * np.cos(s / radius)])
        if radius
        else np.column_stack([s, 0.0 * s])
    )
    return np.column_stack([xy + ORIGIN, np.zeros(len(s))])


def beside(path, start, end, left, *, kind="lane_marking", name="", turned=False, **columns):
    """A line beside a path, from one chainage to another."""
    way = np.gradient(path[:, :2], axis=0)
    way /= np.hypot(*way.T)[:, None]
    s = np.arange(len(path)) * 0.5
    inside = (s >= start) & (s <= end)
    xyz = path[inside].copy()
    xyz[:, :2] += left * np.stack([-way[inside, 1], way[inside, 0]], axis=1)
    xyz = xyz[::-1] if turned else xyz
    return LineSet.from_lines([xyz], kind=[kind], id=[name or f"{kind}{start}"], **columns)


def cable(start, end, *, left=5.0, up=7.0, name=""):
    t = np.linspace(start, end, 9)
    sag = 4.0 * ((t - start) / (end - start) - 0.5) ** 2
    xyz = np.column_stack([t + ORIGIN[0], np.full(9, left + ORIGIN[1]), up + 0.3 * sag])
    return LineSet.from_lines([xyz], kind=["cable"], id=[name or f"cable{start}"])


def together(*lines):
    return LineSet.concatenate(lines)


def of_type(found, kind):
    return [s for s in found if s.kind == kind]


@pytest.mark.parametrize("radius", [0.0, 80.0])
@pytest.mark.parametrize("turned", [False, True])
def test_a_gap_between_two_pieces_of_a_line_is_one_of_both_without_a_proposal(radius, turned):
    path = road(radius=radius)
    lines = together(
        beside(path, 0, 100, 1.7, name="a"), beside(path, 110, 200, 1.7, name="b", turned=turned)
    )
    (gap,) = gap_suspects(lines, DrivenPath.of(path), everywhere)
    assert (gap.type, gap.kind, gap.proposal, gap.ids) == ("gap", "lane_marking", "", ("a", "b"))
    assert gap.length_m == pytest.approx(9.0, abs=1.5)
    assert gap.at == pytest.approx(tuple(lines[0].xyz[-1, :2]))


def test_what_is_hidden_is_not_missing():
    path = road()
    lines = together(beside(path, 0, 80, 1.7), beside(path, 110, 200, 1.7))
    assert rank_suspects(gap_suspects(lines, DrivenPath.of(path), nowhere)) == []


def test_a_line_that_ends_in_view_has_no_proposal():
    path = road()
    (end,) = rank_suspects(
        gap_suspects(beside(path, 0, 120, -1.7, name="a"), DrivenPath.of(path), everywhere)
    )
    assert (end.proposal, end.ids) == ("", ("a",))
    assert end.length_m == pytest.approx(40.0, abs=2.0)
    assert "ends although" in end.reason


def test_lines_of_another_lane_are_not_the_same_line():
    path = road()
    lines = together(beside(path, 0, 80, 1.7, name="a"), beside(path, 90, 200, -1.7, name="b"))
    assert all(len(gap.ids) == 1 for gap in gap_suspects(lines, DrivenPath.of(path), everywhere))


def test_of_a_double_line_each_goes_on_as_itself():
    path = road()
    parts = [(0, 80, 0.15, "a"), (0, 82, -0.15, "b"), (100, 200, 0.15, "c"), (101, 200, -0.15, "d")]
    lines = together(*(beside(path, s, e, q, name=name) for s, e, q, name in parts))
    found = gap_suspects(lines, DrivenPath.of(path), everywhere)
    assert {gap.ids for gap in found} == {("a", "c"), ("b", "d")}


@pytest.mark.parametrize("seed", range(5))
def test_of_many_pieces_those_that_fit_best_go_on_as_each_other(seed):
    rng, path = np.random.default_rng(seed), road(600.0)
    start = rng.integers(0, 1100, 60) / 2.0
    end = np.minimum(start + rng.integers(10, 120, 60) / 2.0, 598.0)
    left = rng.uniform(-2.0, 2.0, 60)
    lines = together(*(beside(path, start[k], end[k], left[k], name=f"{k}") for k in range(60)))
    found = gap_suspects(lines, DrivenPath.of(path), everywhere)
    # All pairs that fit, the best first
    gap, drift = start[None, :] - end[:, None], np.abs(left[None, :] - left[:, None])
    fits = (gap > -1.0) & (drift <= GAP_DRIFT_M + GAP_DRIFT_SHARE * np.maximum(gap, 0.0))
    after = {}
    for _, k, m in sorted((gap[k, m] + 50.0 * drift[k, m], k, m) for k, m in np.argwhere(fits)):
        if k not in after and m not in after.values():
            after[k] = m
    expected = {(f"{k}", f"{m}") for k, m in after.items() if gap[k, m] >= LEAST_SUSPECT_GAP_M}
    assert len(expected) > 20
    assert {item.ids for item in found if len(item.ids) == 2} == expected


def test_a_side_without_a_boundary():
    path = road()
    kinds = {"kind": "road_boundary"}
    lines = together(
        beside(path, 0, 200, -4.0, **kinds),
        beside(path, 0, 60, 4.0, **kinds),
        beside(path, 100, 200, 4.3, **kinds),
    )
    (bare,) = gap_suspects(lines, DrivenPath.of(path), everywhere)
    # It may be the mouth of a side road
    assert (bare.type, bare.proposal) == ("boundary", "")
    assert "left" in bare.reason
    assert bare.length_m == pytest.approx(32.0, abs=2.0)


@pytest.mark.parametrize(("kind", "most_m"), [("fence", 9.0), ("lane_marking", 90.0)])
def test_of_a_long_gap_of_rails_little_is_missing(kind, most_m):
    path = road(length=400.0)
    lines = together(
        beside(path, 0, 100, -6.0, kind=kind, name="a"), beside(path, 200, 400, -6.0, kind=kind, name="b")
    )
    (gap,) = gap_suspects(lines, DrivenPath.of(path), everywhere)
    assert gap.ids == ("a", "b")
    assert gap.length_m == pytest.approx(most_m, abs=1.0)


def test_an_accepted_line_may_end():
    path = road()
    line = beside(path, 0, 120, -1.7).with_columns(review=np.array(["accepted"]))
    assert gap_suspects(line, DrivenPath.of(path), everywhere) == []


def test_without_a_way_nothing_is_missing():
    path = road()
    assert gap_suspects(beside(path, 0, 80, 1.7), DrivenPath.of(path[:0]), everywhere) == []


def test_a_way_driven_twice_is_one_road():
    path = road()
    back = path[::-1].copy()
    back[:, 1] += 3.0
    assert len(DrivenPath.of(np.concatenate([path, back]))) == pytest.approx(200, abs=16)


def test_places_come_back_from_their_offsets():
    way = DrivenPath.of(road(radius=60.0))
    along, left = np.array([20.0, 100.0, 150.0]), np.array([3.0, -4.0, 0.5])
    places = way.places(along, left)
    assert way.offsets(places, 25.0)[0] == pytest.approx(along, abs=0.2)
    assert way.offsets(places, 25.0)[1] == pytest.approx(left, abs=0.05)
    assert np.isnan(way.offsets(ORIGIN[None] - 500.0, 25.0)[0]).all()


def test_long_unsure_lines_come_before_short_and_sure_ones():
    path = road()
    lines = together(
        beside(path, 0, 50, 1.0, name="sure", confidence=[0.99]),
        beside(path, 0, 10, 2.0, name="short", confidence=[0.3]),
        beside(path, 0, 50, 3.0, name="worst", confidence=[0.5]),
        beside(path, 0, 50, 4.0, name="seen", confidence=[0.1], review=["accepted"]),
    )
    found = rank_suspects(unsure_lines(lines, DrivenPath.of(path)))
    assert [s.ids[0] for s in found] == ["worst", "short"]
    # Neither is sure enough for a proposal
    assert [s.proposal for s in found] == ["", ""]
    assert found[0].length_m == pytest.approx(25.0)


@pytest.mark.parametrize(("bridged", "proposal"), [(0.3, "accept"), (0.7, "")])
def test_nobody_is_asked_to_accept_what_was_hardly_seen(bridged, proposal):
    path = road()
    line = beside(path, 0, 50, 1.0, name="a", confidence=[0.96])
    line = line.with_columns(bridged=np.arange(len(line.xyz)) < bridged * len(line.xyz))
    (found,) = unsure_lines(line, DrivenPath.of(path))
    assert found.proposal == proposal


def test_bars_that_are_too_long_are_one_thing_to_settle():
    path = road()
    bars = [beside(path, s, s + 30, -3.0, kind="road_marking_other", name=f"bar{s}") for s in (0, 50, 100)]
    arrow = beside(path, 20, 24, 1.0, kind="road_marking_other", name="arrow", confidence=[1.0])
    (item,) = rank_suspects(unsure_lines(together(*bars, arrow), DrivenPath.of(path)))
    assert item.ids == ("bar0", "bar50", "bar100")
    # A person decides, and the key of the kind does it
    assert (item.proposal, item.as_kind) == ("", "lane_marking")


def test_a_regular_line_lacks_dashes():
    path = road()
    line = beside(path, 0, 199, 0.0, name="line", pattern=["dashed"])
    starts = [k * 9.0 for k in range(22) if k not in (4, 5, 11)]
    dashes = [beside(path, s, s + 3.0, 0.0, kind="lane_marking_dash", name=f"d{s}") for s in starts]
    other = beside(path, 36, 39, 3.0, kind="lane_marking_dash", name="elsewhere")
    (item,) = missing_dashes(together(line, *dashes, other))
    assert (item.ids, item.proposal) == (("line",), "")
    assert item.length_m == pytest.approx(9.0, abs=0.1)


def test_each_line_that_lacks_dashes_is_an_item():
    path = road()
    bare = beside(path, 0, 199, 0.0, name="bare", pattern=["dashed"])
    unknown = beside(path, 0, 199, 3.0, name="unknown", pattern=[""])
    solid = beside(path, 0, 199, -3.0, name="solid", pattern=["solid"])
    short = beside(path, 0, 20, 6.0, name="short", pattern=["dashed"])
    (item,) = missing_dashes(together(bare, unknown, solid, short))
    # A third of a dashed line is paint; nobody knows where, so nothing is proposed
    assert (item.ids, item.proposal) == (("bare",), "")
    assert item.length_m == pytest.approx(199 / 3, rel=0.02)


def test_paint_says_which_dashes_are_missing_but_not_of_a_solid_line():
    path = road()
    names = ("solid", "bare", "whole", "worn")
    lines = [beside(path, 0, 199, 3.0 * k, name=name, pattern=["dashed"]) for k, name in enumerate(names)]
    lines[0] = lines[0].with_columns(pattern=np.array(["solid"]))
    dash = beside(path, 0, 3, 6.0, kind="lane_marking_dash", name="dash")
    two = np.array([[9.0, 12.0], [18.0, 21.0]])
    paint = {"solid": two, "bare": np.zeros((0, 2)), "whole": np.array([[0.0, 3.0]]), "worn": two}
    (item,) = missing_dashes(together(*lines, dash), paint)
    assert (item.ids, item.proposal) == (("worn",), "")
    assert item.length_m == pytest.approx(6.0)


def test_what_is_sure_is_one_item_after_all_others():
    path = road()
    lines = together(
        beside(path, 0, 50, 1.0, name="sure", confidence=[0.99]),
        beside(path, 0, 50, 3.0, name="sure too", confidence=[0.985]),
        beside(path, 0, 50, 5.0, name="unsure", confidence=[0.9]),
        beside(path, 0, 50, 7.0, name="accepted", confidence=[0.99], review=["accepted"]),
    )
    (item,) = sure_lines(lines)
    assert (item.ids, item.proposal) == (("sure", "sure too"), "accept")
    # Dismissed, it comes again with other lines
    (other,) = sure_lines(lines.take(lines.id != "sure too"))
    assert item.key.startswith("sure ") and other.key.startswith("sure ") and item.key != other.key
    assert "2 lines of 100 m, at least 98 % sure" in item.reason
    assert [s.ids for s in unsure_lines(lines, DrivenPath.of(path))] == [("unsure",)]
    assert suspects(lines, DrivenPath.of(path[:0]), everywhere)[-1] == item


def test_the_least_confidence_is_not_rounded_up():
    """A line that is 99.6 % sure is not "at least 100 % sure"."""
    (item,) = sure_lines(beside(road(), 0, 50, 1.0, name="sure", confidence=[0.996]))
    assert item.reason == "a line of 50 m, at least 99 % sure"


def test_boundaries_are_not_accepted_with_all_that_is_sure():
    path = road()
    lines = together(
        beside(path, 0, 50, 1.0, name="marking", confidence=[1.0]),
        beside(path, 0, 50, 4.0, kind="road_boundary", name="kerb", confidence=[1.0]),
    )
    *_, rest, sure = suspects(lines, DrivenPath.of(path[:0]), everywhere)
    assert (sure.type, sure.ids) == ("sure", ("marking",))
    assert (rest.type, rest.ids, rest.proposal) == ("rest", ("kerb",), "")


def test_no_unreviewed_line_is_left_out():
    path = road()
    short = [beside(path, 10 * k, 10 * k + 9, 1.0, name=f"s{k}", confidence=[0.8]) for k in range(5)]
    likely = beside(path, 100, 139, 1.0, name="likely", confidence=[0.95])
    long = beside(path, 0, 50, 3.0, name="long", confidence=[0.5])
    accepted = beside(path, 60, 69, 3.0, name="done", confidence=[0.8], review=["accepted"])
    dash = beside(path, 70, 73, 3.0, kind="lane_marking_dash", name="dash", confidence=[0.8])
    found = suspects(together(*short, likely, long, accepted, dash), DrivenPath.of(path[:0]), everywhere)
    assert [s.type for s in found] == ["line", "rest"]
    assert found[1].ids == ("s0", "s1", "s2", "s3", "s4", "likely")
    assert found[1].reason == "6 lines of 84 m, at least 80 % sure"
    assert found[1].length_m == pytest.approx(5 * 9 * 0.2 + 39 * 0.05)
    assert unlisted_lines(long, found) == []


def test_wires_come_after_markings_of_which_more_is_wrong():
    path = road()
    lines = together(
        cable(0, 40).with_columns(confidence=np.array([0.5])),
        beside(path, 0, 40, 1.7, name="marking", confidence=[0.8]),
    )
    assert [s.kind for s in rank_suspects(unsure_lines(lines, DrivenPath.of(path)))] == [
        "lane_marking",
        "cable",
    ]


def test_a_span_is_missing_between_two_wires():
    lines = together(cable(0, 40, name="a"), cable(80, 120, name="b"))
    found = loose_wires(lines, everywhere)
    between = [s for s in found if len(s.ids) == 2]
    assert [set(s.ids) for s in between] == [{"a", "b"}]
    assert between[0].length_m == pytest.approx(36.0)
    assert len(found) == 1  # one wire alone leads from a pole to a house
    assert loose_wires(lines, nowhere) == []


def test_wires_that_go_on_at_their_pole_are_not_loose():
    lines = together(cable(0, 40), cable(40.3, 80), cable(80.2, 120))
    assert len(loose_wires(lines, everywhere)) == 2  # only the outer ends of the whole


def test_keys_stay_while_the_thing_is_there():
    path = road()
    lines = together(
        beside(path, 0, 80, 1.7, name="a"),
        beside(path, 110, 200, 1.7, name="b"),
        beside(path, 0, 50, -3.0, name="c"),
    )
    before = gap_suspects(lines, DrivenPath.of(path), everywhere)
    after = gap_suspects(lines.take([2, 1, 0]), DrivenPath.of(path), everywhere)
    assert {s.key for s in before} == {s.key for s in after}
    assert len({s.key for s in before}) == len(before)


def test_a_sure_line_with_a_long_bridge_is_worth_a_look():
    path = road()
    n = len(beside(path, 0, 190, 1.0).xyz)
    lines = together(
        beside(path, 0, 190, 1.0, name="bridged", bridged=np.arange(n) > 20),
        beside(path, 0, 190, 3.0, name="measured"),
    )
    found = rank_suspects(unsure_lines(lines, DrivenPath.of(path)))
    assert [s.ids[0] for s in found] == ["bridged"]
    assert "180 m of it bridged" in found[0].reason


def test_a_sure_boundary_without_a_kerb_says_why_it_is_listed():
    path = road()
    lines = together(
        beside(path, 0, 190, 4.0, kind="road_boundary", name="edge", confidence=[1.0], form=["edge"]),
        beside(path, 0, 190, -4.0, kind="road_boundary", name="kerb", confidence=[0.9], form=["kerb"]),
    )
    reasons = {item.ids: item.reason for item in unsure_lines(lines, DrivenPath.of(path))}
    assert "without a kerb: 16 % of such were wrong" in reasons["edge",]
    assert "kerb" not in reasons["kerb",]


@pytest.mark.parametrize("kind", ["lane_marking", "cable", "guardrail", "barrier", "fence", "road_boundary"])
def test_what_was_hardly_counted_is_neither_proposed_nor_accepted_with_the_others(kind):
    """Of barriers, fences and kerbs too few were counted on fresh worlds (decision 134)."""
    path = road()
    form = ["kerb"] if kind == "road_boundary" else [""]
    lines = [
        beside(path, 0, 150, k, kind=kind, name=f"{sure}", confidence=[sure], form=form)
        for k, sure in ((1.0, 0.96), (4.0, 1.0))
    ]
    is_counted = kind in ("lane_marking", "cable", "guardrail")
    likely = [item for item in unsure_lines(together(*lines), DrivenPath.of(path)) if item.ids == ("0.96",)]
    assert [item.proposal for item in likely] == ["accept" if is_counted else ""]
    assert [item.ids for item in sure_lines(together(*lines))] == ([("1.0",)] if is_counted else [])
