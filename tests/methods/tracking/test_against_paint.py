"""What speaks against paint: bright strips in the place of a line, with paint on them or without."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from tests.scenes.box_scenes import boxes_on, everything_seen, straight

from linework.methods.obb.method import OBB_KINDS, Obb
from linework.methods.protocol import SurveyContext
from linework.methods.tracking import marking_lines
from linework.methods.tracking.against_paint import (
    OTHER_STRIP,
    STRIP_BESIDE,
    BrightStrips,
    bare_road,
    chance_of_one_plane,
    chances_beside_paint,
    is_other_strip,
)
from linework.methods.tracking.neighbours import LineAxis
from linework.methods.tracking.track import TrackConfig, track_lines
from linework.model.boxes import BoxForm, BoxSet
from linework.model.lines import CANDIDATE


def strip_along(*courses, seed=5):
    """Boxes 0.4 m wide that are more likely a strip between wheel tracks than paint."""
    boxes = boxes_on(*courses, seed=seed)
    return replace(boxes, half_v_m=np.full(len(boxes), 0.2), score=np.full(len(boxes), 0.05))


def joined(*sets):
    return Obb(kinds=(*OBB_KINDS, CANDIDATE)).join(
        BoxSet.concatenate(sets), SurveyContext(origin=(0.0, 0.0, 0.0))
    )


def test_dashes_on_a_bright_strip_are_a_dashed_line():
    dashes = boxes_on(*[straight(4.0, x=12.0 * k) for k in range(8)])
    lines = joined(dashes, strip_along(straight(90.0)))
    markings = lines["lane_marking"]
    assert markings.pattern.tolist() == ["dashed"]
    assert len(lines["lane_marking_dash"]) == 8
    # Not the strip's own boxes make it sure or unsure
    assert markings.confidence[0] > 0.95


@pytest.mark.parametrize(("width_m", "lines"), [(None, 2), (0.7, 1)])
def test_a_gap_with_paint_that_is_too_wide_is_not_bare(width_m, lines):
    parts = [boxes_on(straight(20.0), straight(20.0, x=34.0))]
    if width_m is not None:
        wide = boxes_on(straight(13.0, x=20.5), form=BoxForm.OTHER_PAINT, seed=7)
        parts.append(replace(wide, half_v_m=np.full(len(wide), 0.5 * width_m)))
    found = joined(*parts)["lane_marking"]
    assert len(found) == lines
    assert found.bridged.any() == (lines == 1)


def test_paint_beside_a_place_leaves_its_road_bare():
    """A solid line 0.25 m beside dashes, and a place between two dashes."""
    bright = boxes_on(straight(20.0), straight(4.0, y=0.25), straight(4.0, x=12.0, y=0.25), noise=0.001)
    is_bare = bare_road(everything_seen, bright)
    assert is_bare(np.array([[2.0, 0.0], [2.0, 0.25], [8.0, 0.25], [8.0, 0.0]])).tolist() == [
        False,
        False,
        True,
        False,
    ]
    assert is_bare(np.zeros((0, 2))).shape == (0,)
    assert bare_road(everything_seen, bright.take([]))(np.array([[2.0, 0.0]])).tolist() == [True]


def test_no_line_is_taken_and_left_out_as_well():
    gap = boxes_on(straight(13.0, x=20.5), form=BoxForm.OTHER_PAINT, seed=7)
    found = joined(
        boxes_on(straight(20.0), straight(20.0, x=34.0)), replace(gap, half_v_m=np.full(len(gap), 0.35))
    )
    assert len(found["lane_marking"]) == 1
    left_out = found.take(found.kind == CANDIDATE)
    assert not np.any(left_out.candidate_kind == "lane_marking")


def test_a_bright_strip_with_some_crisp_places_is_no_line():
    crisp = boxes_on(straight(90.0, y=0.01), keep=0.35, seed=3)
    lines = joined(crisp, strip_along(straight(90.0)))
    assert len(lines["lane_marking"]) == 0
    refused = lines.take((lines.kind == CANDIDATE) & (lines.candidate_kind == "lane_marking"))
    assert OTHER_STRIP in refused.reason.tolist()
    # The same places on plain road are a worn line
    assert len(joined(crisp)["lane_marking"]) == 1


def test_only_strips_in_the_place_of_the_line_speak_against_it():
    solid = boxes_on(straight(40.0))
    expected = np.array([[0.0, 40.0]])
    tracks = track_lines(solid, TrackConfig(), width_m=0.06)
    (line,), *_ = marking_lines.marking_lines(solid, tracks, everything_seen)

    def against(*courses, own_xy=solid.centre[:, :2]):
        strips = strip_along(*courses)
        return len(BrightStrips(strips).scores_where(line.line, own_xy, expected))

    far = np.array([[-100.0, 0.0]])
    assert against(straight(10.0, x=10.0), own_xy=far) >= 20
    assert against(straight(10.0, x=10.0)) == 0, "paint lies on it"
    assert against(straight(10.0, x=10.0, y=0.3), own_xy=far) == 0, "beside it"
    assert against(straight(10.0, x=60.0), own_xy=far) == 0, "beyond its end"
    assert against(straight(10.0, x=20.0, y=-5.0, heading=np.pi / 2.0), own_xy=far) == 0, "across it"


def test_a_narrow_box_is_no_strip_however_unlikely():
    line = boxes_on(straight(20.0))
    unsure = replace(line, score=np.full(len(line), 0.1))
    assert not is_other_strip(BoxSet.concatenate([line, unsure])).any()
    assert is_other_strip(BoxSet.concatenate([line, strip_along(straight(20.0))])).sum() == len(line)
    assert not is_other_strip(unsure).any() and len(is_other_strip(BoxSet.empty())) == 0


def test_dashes_in_a_row_that_are_no_line_are_not_bridged():
    # Two arrows of a lane, 20 m apart: shorter paint, each by itself
    boxes = boxes_on(straight(3.0), straight(3.0, x=23.0))
    tracks = track_lines(boxes, TrackConfig(), width_m=0.06)
    markings, other, _ = marking_lines.marking_lines(boxes, tracks, everything_seen)
    assert not markings
    assert [round(float(np.ptp(m.paint))) for m in other] == [3, 3]


def one_plane(rise_m, *, alternating=False):
    """Chance of one plane under a straight line whose ground on the left lies higher by `rise_m` (n,), box by box."""
    rise_m = np.asarray(rise_m, dtype=float)
    boxes = boxes_on(straight(0.45 * len(rise_m)), noise=0.001, flip=False)
    sense = np.where(np.arange(len(boxes)) % 2 == 1, -1.0, 1.0) if alternating else np.ones(len(boxes))
    boxes = replace(boxes, u=boxes.u * sense[:, None], height_m=rise_m[: len(boxes)] * sense)
    return chance_of_one_plane(boxes, np.arange(len(boxes)))


@pytest.mark.parametrize("spread_m", [0.005, 0.02, 0.05, 0.1, 0.25, 0.3])
@pytest.mark.parametrize("n", [32, 160])
def test_noise_alone_makes_no_stone_of_paint(spread_m, n):
    # Boxes of one airborne strip err together over metres
    stretches = spread_m * np.array([1.0, -1.0, 0.0, 0.6, -0.6])
    rise = np.resize(stretches, n) if n < 48 else np.repeat(stretches, n // 5)
    assert one_plane(rise) > 0.85


def test_a_stone_keeps_its_step_from_one_stretch_to_the_next():
    rng = np.random.default_rng(4)
    assert one_plane(0.02 + 0.002 * rng.normal(size=48)) < 0.1
    # 60 m, of which every other box faces the other way
    assert one_plane(-0.02 + 0.002 * rng.normal(size=134), alternating=True) < 0.1


def test_uneven_ground_with_the_step_of_a_stone_on_the_mean_is_one_plane():
    rng = np.random.default_rng(4)
    uneven = np.repeat([0.0, 0.04, 0.0, 0.04, 0.01, 0.03], 16) + 0.002 * rng.normal(size=96)
    assert np.mean(uneven) == pytest.approx(0.02, abs=0.001)
    assert one_plane(uneven) > 0.8


def test_a_step_that_neither_explains_is_no_plane():
    for step_m in (0.05, 0.1, 0.4):
        assert one_plane(np.full(64, step_m)) < 0.01


def test_boxes_with_an_unknown_step_say_nothing():
    rise = np.where(np.arange(64) % 4 == 0, 0.02, np.nan)
    assert one_plane(np.full(64, np.nan)) == 1.0
    assert one_plane(np.where(np.isnan(rise), np.nan, 0.0)) > 0.9
    assert one_plane(rise) < 0.1


def test_a_stone_that_is_no_line_does_not_come_back_in_pieces():
    stones = boxes_on(*[straight(6.2, x=x) for x in (0.0, 30.0)])
    rise = 0.02 * np.sign(stones.u[:, 0]) + 0.003 * np.random.default_rng(1).normal(size=len(stones))
    lines = joined(replace(stones, height_m=rise))
    assert set(lines.kind) == {CANDIDATE}


def test_few_stretches_that_agree_by_chance_are_no_stone():
    # Boxes that err by 5 cm each, of which three stretches of 16 have a median of 2 cm
    rng = np.random.default_rng(2)
    some = 0.05 * rng.normal(size=(3, 16))
    rise = (some - np.median(some, axis=1, keepdims=True) + np.array([[0.019], [0.021], [0.02]])).ravel()
    assert one_plane(rise) > 0.8


def beside(offset_m, contrast, width_m, *, length_m=60.0, pieces=1, confidence=1.0, is_rail=False):
    """Chance of a line of paint beside one of 60 m, 2.0 brighter than the road and 0.1 m wide, in one piece or several."""
    ends = np.linspace(0.0, 60.0, pieces + 1)
    first = [LineAxis.of(np.array([a, b]), np.array([[a, 0.0], [b, 0.0]])) for a, b in pairwise(ends)]
    own = LineAxis.of(np.array([0.0, length_m]), np.array([[0.0, offset_m], [length_m, offset_m]]))
    columns = ([*[2.0] * pieces, contrast], [*[0.1] * pieces, width_m], [*[confidence] * pieces, 1.0])
    rails = np.array([*[is_rail] * pieces, False])
    *paint, chance = chances_beside_paint([*first, own], *(np.array(c) for c in columns), rails).tolist()
    assert paint == [1.0] * pieces, "the brighter one is paint whatever is beside it"
    return chance


def test_a_strip_of_stone_is_fainter_and_wider_than_the_line_of_paint_beside_it():
    assert beside(0.5, 0.6, 0.45) < 0.1
    assert beside(0.5, 0.6, 0.45, pieces=3) < 0.1, "of a line in several pieces"
    assert beside(0.3, 2.0, 0.25) == 1.0, "a broad line of the same paint"
    assert beside(0.3, 1.7, 0.25) > 0.95, "a broad line, a little worn"
    assert beside(0.3, 0.7, 0.11) > 0.8, "an older line as wide"
    assert beside(2.5, 0.6, 0.45) == 1.0, "the line of another lane"
    assert beside(0.5, np.nan, 0.45) == 1.0, "nobody knows how bright it is"
    assert beside(0.5, 0.6, 0.08) == 1.0, "narrower"
    assert beside(0.5, 0.6, 0.45, confidence=0.3) > 0.7, "what is hardly paint itself says little"


def test_a_line_says_nothing_of_a_strip_most_of_which_lies_elsewhere():
    assert beside(0.5, 0.6, 0.45, length_m=150.0) == 1.0


def test_a_gutter_beside_an_edge_line_is_a_candidate():
    def stripe(y, contrast, width_m, x=80.0):
        boxes = boxes_on(straight(x, y=y), noise=0.004)
        n = len(boxes)
        return replace(boxes, contrast=np.full(n, contrast), half_v_m=np.full(n, 0.5 * width_m))

    edge, gutter = stripe(0.0, 3.0, 0.12), stripe(0.6, 1.6, 0.42)
    # One box whose contrast is unknown hides no other
    gutter = replace(gutter, contrast=np.where(np.arange(len(gutter)) == 5, np.nan, gutter.contrast))
    lines = joined(edge, gutter)
    assert np.abs(lines["lane_marking"].xyz[:, 1]).max() < 0.1
    refused = lines.take((lines.kind == CANDIDATE) & (lines.reason == STRIP_BESIDE))
    assert len(refused) == 1 and refused.confidence[0] > 0.9
    assert len(joined(edge, stripe(0.6, 3.0, 0.24))["lane_marking"]) == 2


def test_a_rail_tells_what_lies_on_its_bed_alone():
    assert beside(0.3, 0.4, 0.25, is_rail=True) < 0.5
    assert beside(0.6, 0.4, 0.25, is_rail=True) == 1.0
    assert beside(0.6, 0.4, 0.25) < 0.5
