"""Tracks into lines: smoothing and its sigma, patterns and dashes, what is cut, bridged, or no line."""

from dataclasses import replace

import numpy as np
import pytest
from tests.scenes.box_scenes import bend, boxes_on, everything_seen, nothing_seen, straight
from tests.scenes.worn_lines import worn_dashes, worn_solid

from linework.methods.obb.method import Obb
from linework.methods.protocol import SurveyContext
from linework.methods.tracking import boundary_lines, marking_lines
from linework.methods.tracking.arrangement import (
    GUTTER,
    HIDDEN,
    NOTHING_IN_FRONT,
    SEAM,
    along_lines,
    behind_boundaries,
    beside_kerb,
    bounds_carriageway,
    has_road_behind,
    is_double,
    paint_forms,
    roles,
)
from linework.methods.tracking.boundary_lines import facing
from linework.methods.tracking.neighbours import LineAxis, places_apart
from linework.methods.tracking.pattern import (
    find_rhythm,
    merged_intervals,
)
from linework.methods.tracking.smooth import smooth_line
from linework.methods.tracking.track import TrackConfig, track_lines
from linework.model.boxes import BoxForm, BoxSet


def lines_of(boxes, seen=everything_seen):
    tracks = track_lines(boxes, TrackConfig(), width_m=0.06)
    return marking_lines.marking_lines(boxes, tracks, seen)[:2]


def smoothed(boxes):
    order = np.argsort(boxes.centre[:, 0])
    return smooth_line(boxes, order, (0.0, 0.0))


def test_smoothing_a_straight_line_is_better_than_its_boxes_and_knows_how_good_it_is():
    ratios, errors = [], []
    for seed in range(20):
        line = smoothed(boxes_on(straight(60.0), noise=0.02, seed=seed))
        error = line.xyz[line.is_measured, 1]
        errors.append(np.sqrt(np.mean(error**2)))
        ratios.append(np.mean((error / line.sigma_xy_m[line.is_measured]) ** 2))
    assert np.mean(errors) < 0.01
    # Search areas overlap: boxes are taken to share half of their error, these here do not
    assert 0.5 < np.sqrt(np.mean(ratios)) < 1.1


def test_bends_are_not_flattened():
    boxes = boxes_on(bend(18.0, 1.5), noise=0.01)
    line = smooth_line(boxes, np.arange(len(boxes)), (0.0, 0.0))
    radius = np.hypot(line.xyz[:, 0], line.xyz[:, 1] - 18.0)
    assert np.sqrt(np.mean((radius - 18.0) ** 2)) < 0.008


def test_sigma_grows_over_a_gap_and_covers_the_error_there():
    boxes = boxes_on(straight(20.0), straight(20.0, x=32.0))
    line = smoothed(boxes)
    gap = (line.xyz[:, 0] > 21.0) & (line.xyz[:, 0] < 31.0)
    assert gap.sum() >= 9
    assert line.sigma_xy_m[gap].max() > 2.0 * np.median(line.sigma_xy_m[~gap])
    assert np.all(np.abs(line.xyz[gap, 1]) < 3.0 * line.sigma_xy_m[gap] + 0.01)


def test_a_wild_box_does_not_pull_the_line():
    boxes = boxes_on(straight(40.0), noise=0.005)
    centre = boxes.centre.copy()
    centre[40, 1] += 0.08
    moved = type(boxes)(**{name: getattr(boxes, name) for name in ("u", "half_u_m", "half_v_m", "sigma_v_m",
                        "sigma_z_m", "sigma_u_rad", "score", "form")}, centre=centre)  # fmt: skip
    assert np.abs(smoothed(moved).xyz[:, 1]).max() < 0.02


@pytest.mark.parametrize("left", [1.0, 0.5])
@pytest.mark.parametrize(("dash", "gap"), [(3.0, 6.0), (6.0, 12.0), (1.5, 1.5), (3.0, 9.0), (3.0, 3.0)])
def test_dashes_have_a_rhythm_however_worn(dash, gap, left):
    rng = np.random.default_rng(4)
    start = np.arange(0.0, 90.0, dash + gap)
    pieces = [(a + x, min(a + x + 0.3, a + dash)) for a in start for x in np.arange(0.0, dash, 0.3)]
    kept = [p for p in pieces if rng.random() < left]
    rhythm = find_rhythm(merged_intervals(*np.array(kept).T, 0.05))
    assert rhythm is not None
    assert rhythm.period_m == pytest.approx(dash + gap, rel=0.03)


@pytest.mark.parametrize("left", [0.3, 0.5, 0.8, 1.0])
def test_a_worn_solid_line_has_none(left):
    for seed in range(10):
        rng = np.random.default_rng(seed)
        start = np.arange(0.0, 100.0, 0.45)
        start = start[rng.random(len(start)) < left]
        assert find_rhythm(merged_intervals(start, start + 0.45, 0.05)) is None


@pytest.mark.parametrize(("dash", "gap"), [(1.5, 1.5), (3.0, 3.0), (2.0, 4.0), (3.0, 9.0)])
def test_dashes_have_a_rhythm_along_bends(dash, gap):
    rng = np.random.default_rng(11)
    found = [find_rhythm(worn_dashes(rng, length_m=140.0, dash_m=dash, gap_m=gap)) for _ in range(12)]
    right = [r for r in found if r is not None and r.period_m == pytest.approx(dash + gap, rel=0.04)]
    assert len(right) >= 10


def test_patches_of_wear_make_no_rhythm():
    rng = np.random.default_rng(12)
    found = [
        find_rhythm(worn_solid(rng, length_m=length, bare_m=bare, left=left))
        for length in (60.0, 150.0, 300.0)
        for bare in (0.5, 1.25, 2.5)
        for left in (0.2, 0.5, 0.7)
        for _ in range(5)
    ]
    assert sum(rhythm is not None for rhythm in found) <= 2


def test_a_piece_of_a_dashed_line_is_dashed_too():
    # Behind a side street lie three dashes, too few to show a rhythm of their own
    there = [straight(1.5, x=3.0 * k) for k in range(20)]
    markings, _ = lines_of(boxes_on(*there, *(straight(1.5, x=75.0 + 3.0 * k) for k in range(3))))
    assert len(markings) == 2
    lines = marking_lines.marking_line_set(markings, "lane_marking")
    assert lines.pattern.tolist() == ["dashed", "dashed"]
    assert len(marking_lines.dash_lines(markings, ["centre", "centre"])) == 23


def test_a_dashed_line_is_one_line_with_its_dashes():
    markings, other = lines_of(boxes_on(*[straight(3.0, x=9.0 * k) for k in range(7)]))
    assert len(markings) == 1 and not other
    lines = marking_lines.marking_line_set(markings, "lane_marking")
    assert lines.pattern.tolist() == ["dashed"]
    assert not lines.bridged.any()
    dashes = marking_lines.dash_lines(markings, ["centre"])
    assert len(dashes) == 7
    assert set(dashes.pattern) == {"dashed"} and set(dashes.role) == {"centre"}
    np.testing.assert_allclose(dashes.length_m, 3.0, atol=0.5)
    starts = sorted(dashes[k].xyz[:, 0].min() for k in range(7))
    np.testing.assert_allclose(starts, 9.0 * np.arange(7), atol=0.46)


def test_a_line_changes_its_pattern_before_a_junction():
    before = [straight(3.0, x=9.0 * k) for k in range(6)]
    behind = [straight(3.0, x=80.0 + 9.0 * k) for k in range(6)]
    markings, other = lines_of(boxes_on(*before, straight(22.0, x=54.0), *behind))
    assert not other
    lines = marking_lines.marking_line_set(markings, "lane_marking")
    order = np.argsort([lines[k].xyz[:, 0].min() for k in range(len(lines))])
    assert lines.pattern[order].tolist() == ["dashed", "solid", "dashed"]
    # One smooth line, cut: no gap where the pattern changes
    assert lines.length_m.sum() == pytest.approx(128.0, abs=1.0)
    assert len(marking_lines.dash_lines(markings, [""] * 3)) == 12


def test_a_long_worn_line_in_many_pieces_is_a_marking_not_a_row_of_symbols():
    at = (0.0, 8.3, 17.0, 30.0, 38.4, 52.7, 60.1, 75.0)
    markings, _ = lines_of(boxes_on(*[straight(2.2, x=x) for x in at]))
    assert len(markings) == 1


def test_the_head_of_a_rail_is_too_narrow_for_paint():
    boxes = boxes_on(straight(60.0))
    assert len(lines_of(boxes)[0]) == 1
    assert not lines_of(replace(boxes, half_v_m=np.full(len(boxes), 0.028)))[0]
    # Nor are boxes paint that are more likely something else
    assert not lines_of(replace(boxes, score=np.full(len(boxes), 0.3)))[0]


def test_a_solid_line_ends_where_there_is_road_and_no_paint():
    axes = straight(20.0), straight(20.0, x=30.0)
    assert len(lines_of(boxes_on(*axes), everything_seen)[0]) == 2
    hidden, _ = lines_of(boxes_on(*axes), nothing_seen)
    assert len(hidden) == 1
    assert marking_lines.marking_line_set(hidden, "lane_marking").bridged_m[0] == pytest.approx(10.0, abs=1.5)


def test_a_short_piece_of_paint_is_no_lane_marking():
    markings, other = lines_of(boxes_on(straight(3.5)))
    assert not markings and len(other) == 1


def test_a_boundary_runs_on_through_drives_and_ends_at_mouths():
    def found(gap, seen=everything_seen):
        boxes = boxes_on(straight(20.0), straight(20.0, x=20.0 + gap), form=BoxForm.KERB)
        tracks = track_lines(boxes, TrackConfig(), width_m=0.15)
        return boundary_lines.smooth_boundaries(boxes, tracks, seen)

    assert len(found(8.0)) == 1
    assert len(found(12.0)) == 2
    assert len(found(12.0, nothing_seen)) == 1
    whole = found(6.0)
    lines, tops = boundary_lines.boundary_line_set(whole), boundary_lines.top_lines(whole)
    assert lines.form.tolist() == ["kerb"]
    assert lines.height_m[0] == pytest.approx(0.12, abs=0.003)
    assert 4.0 < lines.bridged_m[0] < 8.0
    np.testing.assert_allclose(tops.xyz[:, 2], 0.12, atol=0.01)
    np.testing.assert_allclose(tops.xyz[:, 1], -0.03, atol=0.02)


def axis(y, *, turned=False, length=40.0):
    t = np.linspace(0.0, length, 81)
    xyz = np.column_stack([t[::-1] if turned else t, np.full(81, y), np.zeros(81)])
    return LineAxis.of(t, xyz)


def bounds(axes, kerbs, lanes=()):
    return [not why for why in reasons(axes, kerbs, lanes)]


def reasons(axes, kerbs, lanes=()):
    return bounds_carriageway(axes, np.array(kerbs), np.array(kerbs), (), lanes).tolist()


def test_what_stands_behind_a_kerb_is_no_boundary():
    # Carriageway north of both: kerb at 0, wall at -2; across the road a kerb that looks back
    axes = [axis(0.0), axis(-2.0), axis(7.0, turned=True)]
    assert bounds(axes, [True, False, True]) == [True, False, True]


def test_an_edge_does_not_hide_a_kerb_and_is_none_beside_it():
    axes = [axis(0.0), axis(1.0), axis(7.0, turned=True)]
    assert bounds(axes, [True, False, True]) == [True, False, True]


def test_a_seam_of_the_asphalt_is_no_boundary():
    axes = [axis(0.0), axis(4.0), axis(8.0, turned=True)]
    assert bounds(axes, [False, False, False], [axis(3.5)]) == [True, False, True]


def test_an_edge_needs_a_carriageway_and_a_kerb_shows_it():
    elsewhere = axis(100.0)
    assert bounds([axis(0.0)], [False], [elsewhere]) == [False]
    assert bounds([axis(0.0)], [True], [elsewhere]) == [True]
    assert bounds([axis(0.0)], [False], [axis(3.0)]) == [True]
    assert bounds([axis(0.0)], [False], [axis(-2.0)]) == [False]
    # Without paint or a van's way there is nothing to ask
    assert bounds([axis(0.0)], [False]) == [True]
    # ... nor where the only paint is on another road
    assert bounds_carriageway(
        [axis(0.0)], np.array([False]), np.array([False]), [elsewhere], ()
    ).tolist() == [""]


def test_what_is_no_boundary_is_said_why():
    across = axis(7.0, turned=True)
    assert reasons([axis(0.0), axis(-2.0), across], [True, False, True]) == ["", HIDDEN, ""]
    assert reasons([axis(0.0), axis(1.0), across], [True, False, True]) == ["", GUTTER, ""]
    assert reasons([axis(0.0), axis(4.0), across], [False] * 3, [axis(3.5)]) == ["", SEAM, ""]
    assert reasons([axis(0.0)], [False], [axis(100.0)]) == [NOTHING_IN_FRONT]


def test_the_back_of_a_footway_stays_one_where_it_goes_on_from_a_kerb():
    t = np.linspace(0.0, 40.0, 81)
    ahead = LineAxis.of(t, np.column_stack([t + 41.0, np.full(81, -2.0), np.zeros(81)]))
    back = [axis(0.0), axis(-2.0), ahead, axis(7.0, turned=True)]
    assert reasons(back, [True] * 4) == ["", HIDDEN, "", ""]
    # Behind a gutter, which is no boundary, it is one
    assert reasons([axis(0.5), axis(0.0), axis(7.0, turned=True)], [False, True, True]) == [GUTTER, "", ""]


def test_kerb_stones_are_no_paint():
    stone, paint = boxes_on(straight(20.0, y=-0.1)), boxes_on(straight(20.0, y=0.3))
    assert beside_kerb(stone, [axis(0.0)], -0.45, 0.04).all()
    assert not beside_kerb(paint, [axis(0.0)], -0.45, 0.04).any()


def test_bright_strips_behind_a_kerb_are_no_markings():
    kerbs = [axis(0.0), axis(7.0, turned=True)]
    lanes = [axis(3.0), axis(-5.0), axis(9.0)]
    assert behind_boundaries(lanes, kerbs, np.full(2, 15.0)).tolist() == [False, True, True]
    # Behind the edge of one carriageway the next may begin
    assert behind_boundaries(lanes, kerbs, np.full(2, 3.0)).tolist() == [False, False, True]
    assert behind_boundaries(lanes[:1], [], np.zeros(0)).tolist() == [False]


def test_changes_are_turned_to_the_path():
    there = boxes_on(straight(20.0), form=BoxForm.CHANGE).take([3])
    back = facing(there, [axis(-4.0)])
    np.testing.assert_array_equal(back.u, -there.u)
    np.testing.assert_array_equal(back.height_m, -there.height_m)
    np.testing.assert_array_equal(facing(there, [axis(4.0)]).u, there.u)
    np.testing.assert_array_equal(facing(there, [axis(40.0)]).u, there.u)
    assert len(facing(there.take([]), [axis(4.0)])) == 0


def test_the_path_tells_on_which_side_of_a_step_the_road_is():
    steps = [axis(0.0), axis(7.0, turned=True)]
    assert has_road_behind(steps, [], [axis(3.0)]).tolist() == [False, False]
    # The verge beside the first is lower: it faces away
    assert has_road_behind([axis(0.0, turned=True), steps[1]], [], [axis(3.0)]).tolist() == [True, False]
    # The path outweighs a strip on the verge, and what another boundary parts tells nothing
    assert has_road_behind([axis(0.0, turned=True)], [axis(-4.0)], [axis(3.0)]).tolist() == [True]
    assert has_road_behind([axis(0.0), axis(-2.0, turned=True)], [], [axis(3.0)]).tolist() == [False, False]


def test_without_a_path_paint_tells_it_but_for_kerb_stones():
    away = [axis(0.0, turned=True)]
    assert has_road_behind(away, [axis(3.0), axis(6.0)], []).tolist() == [True]
    assert has_road_behind(away, [axis(3.0), axis(-3.0)], []).tolist() == [False], "paint on both sides"
    assert has_road_behind(away, [axis(0.2)], []).tolist() == [False]
    assert has_road_behind(away, [], []).tolist() == [False]
    assert has_road_behind([], [axis(3.0)], [axis(1.0)]).tolist() == []


def test_a_step_down_runs_along_its_top_with_the_road_to_its_left():
    boxes = boxes_on(straight(30.0), form=BoxForm.KERB)
    tracks = track_lines(boxes, TrackConfig(), width_m=0.15)
    (kerb,) = boundary_lines.smooth_boundaries(boxes, tracks, everything_seen)
    down = boundary_lines.step_down(kerb)
    assert down.form == "edge"
    assert np.all(down.height_m < -0.1)
    assert np.allclose(down.line.xyz, kerb.top.xyz[::-1])
    assert np.allclose(down.line.normal, -kerb.line.normal[::-1])
    assert np.all(np.diff(down.line.t_m) > 0)
    assert np.array_equal(down.line.t_m[[0, -1]], kerb.line.t_m[[0, -1]])
    assert np.array_equal(down.boxes, kerb.boxes[::-1])
    again = boundary_lines.step_down(down)
    assert np.allclose(again.line.xyz, kerb.line.xyz)


def test_an_edge_line_above_a_low_verge_is_a_marking_and_the_step_an_edge():
    # The verge lies to the south, 12 cm lower than the pavement; the path runs 1.5 m north of its edge
    step = straight(60.0, y=-3.2, x=60.0, heading=np.pi)
    boxes = BoxSet.concatenate(
        [
            boxes_on(step, form=BoxForm.KERB),
            boxes_on(straight(60.0, y=-2.9)),
            boxes_on(straight(60.0, y=0.2)),
        ]
    )
    path = np.column_stack([np.arange(0.0, 60.0), np.full(60, -1.7), np.zeros(60)])
    lines = Obb().join(boxes, SurveyContext(origin=(0.0, 0.0, 0.0), path=path))
    markings = lines.take(lines.kind == "lane_marking")
    assert sorted(np.round([line.xyz[:, 1].mean() for line in markings], 1).tolist()) == [-2.9, 0.2]
    edge = lines.take(lines.kind == "road_boundary")
    assert edge.form.tolist() == ["edge"]
    assert edge.height_m[0] == pytest.approx(-0.12, abs=0.01)
    xyz = edge[0].xyz
    assert xyz[-1, 0] > xyz[0, 0], "the carriageway is to its left"
    # With the road on the lower side the same boxes are a kerb, and the strip on its stone no paint
    below = Obb().join(boxes, SurveyContext(origin=(0.0, 0.0, 0.0), path=path - [0.0, 4.0, 0.0]))
    assert below.form[below.kind == "road_boundary"].tolist() == ["kerb"]
    assert not np.any(below.kind == "lane_marking")


def test_a_piece_of_a_line_is_no_bar():
    bars = [axis(0.1, length=3.0), axis(1.0, length=3.0)]
    assert along_lines(bars, [axis(0.0)], 0.45).tolist() == [True, False]


def test_double_lines_and_roles():
    markings = [axis(0.0), axis(3.5), axis(3.75), axis(7.2)]
    kerbs = [axis(-0.8), axis(8.0, turned=True)]
    double = is_double(markings)
    assert double.tolist() == [False, True, True, False]
    assert roles(markings, kerbs, [], double) == ["edge", "centre", "centre", "edge"]
    one, kerbs = [axis(3.6)], [axis(-1.0), axis(8.2, turned=True)]
    assert roles(one, kerbs, [], is_double(one)) == ["centre"]
    motorway = [axis(0.0), axis(3.75), axis(7.5), axis(11.25)]
    assert roles(motorway, [], [], is_double(motorway)) == ["edge", "lane", "lane", "edge"]
    three = [axis(0.0), axis(3.75), axis(7.5)]
    assert roles(three, [], [axis(1.8), axis(5.6)], is_double(three)) == ["edge", "lane", "edge"]
    assert roles(three, [], [axis(1.8), axis(5.6, turned=True)], is_double(three)) == [
        "edge",
        "centre",
        "edge",
    ]


def test_bars_stop_lines_and_arrows():
    bars = [axis(float(y), length=3.5) for y in range(4)]
    stop = LineAxis.of(
        np.linspace(0, 3, 7), np.column_stack([np.full(7, 50.0), np.linspace(0, 3, 7), np.zeros(7)])
    )
    arrow = axis(20.0, length=3.5)
    road = [axis(-1.0, length=60.0), axis(22.0, length=60.0)]
    assert paint_forms([*bars, stop, arrow], road) == ["zebra"] * 4 + ["stop", "arrow"]


def test_a_path_is_thinned_as_pose_by_pose():
    rng = np.random.default_rng(68)
    # Standing for longer than the poses that are looked at together, and driving at all speeds
    step = np.where(np.arange(600) % 200 < 80, 0.001, rng.uniform(0.0, 1.5, 600))
    xy = np.column_stack([np.cumsum(step), rng.normal(0.0, 0.05, 600)])
    kept = [0]
    for i in range(1, len(xy)):
        if np.hypot(*(xy[i] - xy[kept[-1]])) >= 1.0:
            kept.append(i)
    assert places_apart(xy, 1.0) == kept
    assert max(np.diff(kept)) > 64
    assert places_apart(xy[:1], 1.0) == [0]


def test_a_rhythm_that_is_kept_belongs_to_its_paint():
    dashes = np.arange(8)[:, None] * 9.0 + np.array([0.0, 3.0])
    wider = np.arange(8)[:, None] * 12.0 + np.array([0.0, 3.0])
    first, second, again = (find_rhythm(paint) for paint in (dashes, wider, dashes.copy()))
    assert first is not None and second is not None
    assert first == again and abs(first.period_m - 9.0) < 0.3 and abs(second.period_m - 12.0) < 0.3
