"""Boxes on paint: centre, width, ends, height and sigma on made-up roads, and what is no paint."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.scenes.box_scenes import boxes_on, everything_seen, straight
from tests.scenes.paint_scenes import Stripe, in_scene, level_surface, road_points, tile_of

from linework.arrays import FloatArray
from linework.kernels.paint import stripes
from linework.methods.obb.marking import MarkingConfig, chance_by_sides, find_marking_boxes
from linework.methods.tracking import marking_lines
from linework.methods.tracking.against_paint import ON_STEP
from linework.methods.tracking.track import TrackConfig, track_lines
from linework.model.boxes import BoxForm, BoxSet

SLANTED = Stripe((1.0, 2.0), (11.0, 8.0))


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20)


def boxes_in(
    xyz: FloatArray, intensity: FloatArray | None, time_s: FloatArray | None = None, **settings: float
) -> BoxSet:
    return find_marking_boxes(tile_of(xyz, intensity, time_s), level_surface(), MarkingConfig(**settings))


def sure(boxes: BoxSet) -> BoxSet:
    return boxes.take((boxes.form == BoxForm.STRIPE) & (boxes.score > 0.5))


def test_a_stripe_has_a_box_in_every_cell_and_each_lies_on_it(rng: np.random.Generator) -> None:
    boxes = sure(boxes_in(*road_points(rng, [SLANTED])))
    along = np.sort((in_scene(boxes.centre) - SLANTED.start) @ SLANTED.direction)
    assert np.diff(along).max() < 0.75, "no gap"
    error = SLANTED.across(in_scene(boxes.centre))
    assert np.sqrt(np.mean(error**2)) < 0.005
    assert 0.5 < np.sqrt(np.mean((error / boxes.sigma_v_m) ** 2)) < 1.5
    assert np.abs(2.0 * boxes.half_v_m - 0.12).mean() < 0.01
    assert np.abs(np.abs(boxes.u @ SLANTED.direction) - 1.0).max() < 0.002
    assert np.abs(boxes.centre[:, 2] - 31.0).max() < 0.004
    assert np.abs(boxes.contrast - 2.0).max() < 0.15
    assert np.abs(np.median(boxes.height_m)) < 0.005 and np.isnan(boxes.time_start_s).all()
    cells = np.floor(boxes.centre[:, :2] / 0.5)
    assert len(np.unique(cells, axis=0)) == len(boxes), "one box to a cell"


def test_sigma_is_honest(rng: np.random.Generator) -> None:
    ratios = []
    for per_m2, contrast in ((900.0, 3.0), (250.0, 1.5), (60.0, 3.0), (20.0, 3.0)):
        stripe = Stripe((0.5, 3.0), (11.5, 5.0), 0.15, contrast)
        boxes = sure(boxes_in(*road_points(rng, [stripe], per_m2=per_m2)))
        assert len(boxes) >= 10
        ratios.append(np.mean((stripe.across(in_scene(boxes.centre)) / boxes.sigma_v_m) ** 2) ** 0.5)
    assert min(ratios) > 0.5 and max(ratios) < 1.5


@pytest.mark.parametrize("gap_m", [0.10, 0.20, 0.45])
def test_both_lines_of_a_double_line_are_found(rng: np.random.Generator, gap_m: float) -> None:
    near, far = Stripe((1.0, 3.0), (11.0, 3.0)), Stripe((1.0, 3.12 + gap_m), (11.0, 3.12 + gap_m))
    places = in_scene(sure(boxes_in(*road_points(rng, [near, far], per_m2=800.0))).centre)
    for stripe in (near, far):
        own = np.abs(stripe.across(places)) < 0.03
        assert own.sum() >= 18
    assert (np.minimum(np.abs(near.across(places)), np.abs(far.across(places))) < 0.03).all()


def test_the_boxes_end_where_the_dash_ends(rng: np.random.Generator) -> None:
    dash = Stripe((3.0, 4.0), (7.3, 6.2), 0.15)
    xyz, intensity = road_points(rng, [dash], per_m2=300.0)
    boxes = sure(boxes_in(xyz, intensity))
    ends = [(in_scene(boxes.centre) + sign * boxes.u * boxes.half_u_m[:, None]) for sign in (-1.0, 1.0)]
    along = (np.concatenate(ends) - dash.start) @ dash.direction
    assert abs(along.min()) < 0.05 and abs(along.max() - dash.length_m) < 0.05


def test_wide_paint_is_no_line(rng: np.random.Generator) -> None:
    bar = Stripe((4.0, 5.0), (8.0, 5.0), 0.60)
    boxes = boxes_in(*road_points(rng, [bar]))
    boxes = boxes.take(boxes.score > 0.5)
    assert len(boxes) >= 6
    assert (boxes.form == BoxForm.OTHER_PAINT).all()
    inner = np.abs(in_scene(boxes.centre)[:, 0] - 6.0) < 1.2
    assert np.abs(2.0 * boxes.half_v_m[inner] - 0.60).max() < 0.05


def test_a_strip_that_fades_into_the_road_is_no_paint(rng: np.random.Generator) -> None:
    xyz, intensity = road_points(rng, [])
    off = np.abs(xyz[:, 1] - 6.0)
    # Between wheel tracks: as wide as a bar, its edges fade over 0.3 m
    boxes = boxes_in(xyz, intensity * (1.0 + 0.4 * np.clip((0.35 - off) / 0.3 + 0.5, 0.0, 1.0)))
    assert len(boxes) >= 10
    assert np.mean(boxes.score) < 0.2
    crisp = boxes_in(xyz, intensity * np.where(off < 0.35, 1.4, 1.0))
    assert len(crisp) >= 10
    assert np.mean(crisp.score) > 0.8


def test_paint_on_a_strip_that_fades_is_found_on_the_strip(rng: np.random.Generator) -> None:
    line = Stripe((0.5, 6.0), (11.5, 6.0), 0.12, 1.5)
    xyz, intensity = road_points(rng, [line], per_m2=900.0)
    off = np.abs(xyz[:, 1] - 6.0)
    boxes = sure(boxes_in(xyz, intensity * (1.0 + 0.5 * np.clip((0.25 - off) / 0.2 + 0.5, 0.0, 1.0))))
    assert len(boxes) >= 16
    assert np.abs(2.0 * boxes.half_v_m - 0.12).mean() < 0.02
    assert np.abs(line.across(in_scene(boxes.centre))).max() < 0.02


def test_the_stone_between_two_materials_is_no_paint(rng: np.random.Generator) -> None:
    stone = Stripe((0.0, 6.0), (12.0, 6.0), 0.15, 2.0)
    xyz, intensity = road_points(rng, [stone])
    beyond = (xyz[:, 1] > 6.0) & ~stone.holds(xyz[:, :2])
    assert len(sure(boxes_in(xyz, intensity))) >= 18
    intensity[beyond] *= 1.6
    assert len(sure(boxes_in(xyz, intensity))) <= 2


def test_the_shoulder_of_a_wheel_track_along_a_sealed_joint_is_no_paint(rng: np.random.Generator) -> None:
    xyz, intensity = road_points(rng, [], per_m2=900.0)
    y = xyz[:, 1]
    # The road grows brighter over 0.25 m up to a dark joint of 0.09 m, and goes on as bright behind it
    track = intensity * (1.0 + 0.7 * np.clip((y - 5.75) / 0.25, 0.0, 1.0))
    joint = np.where((y > 6.0) & (y < 6.09), 0.5 * intensity, track)
    boxes = boxes_in(xyz, joint)
    assert np.sum(np.abs(in_scene(boxes.centre)[:, 1] - 5.9) < 0.1) >= 10
    assert len(sure(boxes)) <= 2


def test_a_line_along_a_sealed_joint_is_found(rng: np.random.Generator) -> None:
    line = Stripe((0.5, 6.0), (11.5, 6.0), 0.12, 1.7)
    xyz, intensity = road_points(rng, [line], per_m2=900.0)
    joint = np.abs(xyz[:, 1] - 6.105) < 0.045
    boxes = sure(boxes_in(xyz, np.where(joint, 0.5 * intensity, intensity)))
    assert len(boxes) >= 18
    assert np.abs(line.across(in_scene(boxes.centre))).max() < 0.03


def test_bright_ground_on_one_side_is_no_paint(rng: np.random.Generator) -> None:
    xyz, intensity = road_points(rng, [])
    intensity[xyz[:, 1] > 6.0] *= 3.0
    assert len(sure(boxes_in(xyz, intensity))) == 0


def test_an_edge_line_beside_bright_grass_is_found(rng: np.random.Generator) -> None:
    line = Stripe((0.5, 5.6), (11.5, 5.6), 0.12, 1.6)
    xyz, intensity = road_points(rng, [line])
    intensity[xyz[:, 1] > 5.86] *= 3.0
    boxes = sure(boxes_in(xyz, intensity))
    assert len(boxes) >= 18
    assert np.abs(line.across(in_scene(boxes.centre))).max() < 0.02


def test_an_edge_line_beside_a_shoulder_is_found_where_points_are_far_apart(rng: np.random.Generator) -> None:
    line = Stripe((0.5, 6.0), (11.5, 6.0), 0.3, 1.8)
    found = []
    for per_m2 in (20.0, 400.0):
        xyz, intensity = road_points(rng, [line], per_m2=per_m2, noise=0.05)
        intensity[(xyz[:, 1] > 6.0) & ~line.holds(xyz[:, :2])] *= 1.32
        boxes = sure(boxes_in(xyz, intensity))
        found.append(int(np.sum(np.abs(line.across(in_scene(boxes.centre))) < 0.15)))
    # Of 22 cells; from near by the two sides are known to differ: it may be the stone between them
    assert found[0] >= 8 and found[1] <= 4


def test_what_two_sides_say_depends_on_noise_and_spacing() -> None:
    def chance(sides: float, t: float, spacing_m: float) -> float:
        row = np.zeros((1, stripes.STRIPE_COLUMNS))
        row[0, [stripes.STRIPE_SIDES, stripes.STRIPE_T, stripes.STRIPE_SPACING]] = sides, t, spacing_m
        return float(chance_by_sides(row)[0])

    assert chance(0.0, 20.0, 0.05) > 0.95
    assert 2.0 * chance(0.6, 20.0, 0.05) < chance(0.6, 3.0, 0.05), "noise"
    assert 5.0 * chance(0.6, 20.0, 0.05) < chance(0.6, 20.0, 0.25), "what lies beyond the road is measured"
    assert chance(0.3, 20.0, 0.05) > chance(0.4, 20.0, 0.05) > chance(0.5, 20.0, 0.05)


def test_a_bright_kerb_is_no_paint(rng: np.random.Generator) -> None:
    kerb = Stripe((0.0, 6.0), (12.0, 6.0), 0.15, 2.0)
    xyz, intensity = road_points(rng, [kerb])
    xyz[xyz[:, 1] > 6.0, 2] += 0.10
    assert len(boxes_in(xyz, intensity)) == 0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_stone_of_a_dropped_kerb_is_no_paint(rng: np.random.Generator, side: float) -> None:
    stone = Stripe((0.0, 6.0), (12.0, 6.0), 0.15, 2.0)
    xyz, intensity = road_points(rng, [stone])

    def lines_of(xyz: FloatArray) -> tuple[list[marking_lines.SmoothMarking], list[str]]:
        boxes = boxes_in(xyz, intensity)
        boxes = boxes.take(boxes.form == BoxForm.STRIPE)
        tracks = track_lines(boxes, TrackConfig(), width_m=0.06)
        found, _, unlikely = marking_lines.marking_lines(boxes, tracks, everything_seen)
        return found, [m.why_unlikely for m in unlikely]

    (line,), why = lines_of(xyz)
    assert line.confidence > 0.95 and not why
    # Too low for a step in one box, but always on the same side
    xyz[side * (xyz[:, 1] - 6.0) > 0.0, 2] += 0.02
    assert lines_of(xyz) == ([], [ON_STEP])


def test_a_row_of_manholes_is_no_dashed_line() -> None:
    boxes = boxes_on(*[straight(3.0, x=9.0 * k) for k in range(7)])
    (line,), *_ = marking_lines.marking_lines(
        boxes, track_lines(boxes, TrackConfig(), width_m=0.06), everything_seen
    )
    assert marking_lines.has_its_dashes(line)
    # As many pieces at the right places, each 20 cm of the 3 m that the rhythm expects there
    stains = np.column_stack([line.paint[:, 0], line.paint[:, 0] + 0.2])
    assert not marking_lines.has_its_dashes(replace(line, paint=stains))


def test_the_rough_face_of_a_kerb_is_no_paint(rng: np.random.Generator) -> None:
    face = Stripe((0.0, 6.0), (12.0, 6.0), 0.06, 2.0)
    xyz, intensity = road_points(rng, [face])
    xyz[xyz[:, 1] > 6.0, 2] += 0.08
    on = face.holds(xyz[:, :2])
    xyz[on, 2] = rng.uniform(0.0, 0.08, on.sum())
    assert len(sure(boxes_in(xyz, intensity))) <= 2


def test_passes_of_different_gain_do_not_matter(rng: np.random.Generator) -> None:
    first, second = road_points(rng, [SLANTED]), road_points(rng, [SLANTED], level=200.0)
    xyz, intensity = np.concatenate([first[0], second[0]]), np.concatenate([first[1], second[1]])
    time_s = np.repeat([100.0, 160.0], [len(first[0]), len(second[0])])
    boxes = sure(boxes_in(xyz, intensity, time_s))
    assert len(boxes) >= 22
    assert np.abs(SLANTED.across(in_scene(boxes.centre))).max() < 0.01
    assert (boxes.time_start_s == 100.0).all() and (boxes.time_end_s == 160.0).all()


def test_sparse_points_are_looked_at_in_larger_areas(rng: np.random.Generator) -> None:
    stripe = Stripe((0.5, 3.0), (11.5, 5.0), 0.15, 3.0)
    boxes = sure(boxes_in(*road_points(rng, [stripe], per_m2=20.0)))
    assert len(boxes) >= 10
    assert np.median(boxes.half_u_m) > 0.5
    off = np.abs(stripe.across(in_scene(boxes.centre)))
    assert np.sort(off)[-2] < 0.10 and np.median(off) < 0.03


def test_intensities_of_the_paint_only(rng: np.random.Generator) -> None:
    xyz, intensity = road_points(rng, [SLANTED])
    boxes = sure(boxes_in(xyz, np.where(intensity < 1500.0, 0.0, intensity)))
    assert len(boxes) >= 22
    assert np.abs(SLANTED.across(in_scene(boxes.centre))).max() < 0.01
    assert np.isnan(boxes.contrast).all(), "the road's is not known"


def test_few_grey_levels(rng: np.random.Generator) -> None:
    xyz, intensity = road_points(rng, [SLANTED])
    boxes = sure(boxes_in(xyz, np.floor(intensity / 300.0)))
    assert len(boxes) >= 20
    assert np.abs(SLANTED.across(in_scene(boxes.centre))).max() < 0.02


def test_a_given_range_chooses_the_paint(rng: np.random.Generator) -> None:
    dim, bright = Stripe((1.0, 3.0), (11.0, 3.0), 0.12, 2.0), Stripe((1.0, 8.0), (11.0, 8.0), 0.12, 4.0)
    xyz, intensity = road_points(rng, [dim, bright])
    places = in_scene(sure(boxes_in(xyz, intensity, min_intensity=1500.0, max_intensity=2700.0)).centre)
    assert len(places) >= 18
    assert np.abs(dim.across(places)).max() < 0.02


def test_without_intensities_there_are_no_boxes(rng: np.random.Generator) -> None:
    xyz, intensity = road_points(rng, [SLANTED])
    assert len(boxes_in(xyz, None)) == 0
    assert len(boxes_in(xyz, np.full_like(intensity, 7.0))) == 0


@pytest.mark.parametrize("zero", [0.0, 4_000.0, 30_000.0])
def test_the_zero_of_the_intensities_does_not_matter(rng: np.random.Generator, zero: float) -> None:
    """With 30,000 counts added, paint of twice the road's 1,000 is 1.03 times as bright as the road."""
    xyz, intensity = road_points(rng, [SLANTED])
    boxes = sure(boxes_in(xyz, intensity + np.float32(zero)))
    assert len(boxes) >= 22
    assert np.abs(SLANTED.across(in_scene(boxes.centre))).max() < 0.01


def test_a_contrast_may_be_asked_for(rng: np.random.Generator) -> None:
    points = road_points(rng, [SLANTED])
    assert len(sure(boxes_in(*points, least_contrast=1.8))) >= 22
    assert len(sure(boxes_in(*points, least_contrast=2.3))) == 0


def test_plain_road_has_next_to_no_boxes(rng: np.random.Generator) -> None:
    assert len(sure(boxes_in(*road_points(rng, [])))) <= 1
