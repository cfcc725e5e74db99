"""A line that only one survey found is a change where the ground looks otherwise, and was missed where it looks the same."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from tests.evaluation.test_ground_seen import LENGTH_M, ORIGIN, WIDTH_M, look, road, seen

from linework.evaluation.changes.epochs import compare_epochs
from linework.evaluation.changes.ground_compared import move_ratio, shape_ratio
from linework.evaluation.changes.ground_seen import Places, look_at_ground
from linework.model.lines import LineSet
from linework.model.points import Points


def told(old, new, looks=None):
    """Return status and rounded probability of each change but for what is hidden."""
    changes = compare_epochs(old, new, looks=looks)[0]
    return [(c.status, str(c.line.id[0]), round(c.probability, 1)) for c in changes]


def stretch(lines, from_m, to_m):
    """Return lines of which only a stretch along x is left."""
    rows = [one.xyz[(one.xyz[:, 0] - ORIGIN[0] >= from_m) & (one.xyz[:, 0] - ORIGIN[0] <= to_m)] for one in
            (lines[i] for i in range(len(lines)))]  # fmt: skip
    return LineSet.from_lines(
        rows, kind=lines.kind, id=lines.id, form=lines.form, pattern=lines.pattern, width_m=lines.width_m,
        sigma_xy_m=0.01, sigma_z_m=0.01, confidence=0.98, crs=lines.crs,
    )  # fmt: skip


def beside(points, height_m, value, from_m=3.05, *, right=False):
    """Return points with other ground beyond a distance to the left or right: higher, and of another brightness."""
    xyz, brightness = points.xyz.copy(), points.intensity.copy()
    there = (ORIGIN[1] - xyz[:, 1] if right else xyz[:, 1] - ORIGIN[1]) > from_m
    xyz[there, 2] += height_m
    brightness[there] *= value
    return Points(xyz, intensity=brightness)


def as_edges(lines, form):
    n = len(lines)
    return lines.with_columns(
        kind=["road_boundary"] * n, form=[form] * n, pattern=[""] * n, width_m=np.full(n, np.nan)
    )


def test_a_marking_that_the_points_still_show_was_missed():
    old, new = road(0.0, 3.0, -3.0), road(0.0, -3.0)
    before, after = look(seen(0.0, 3.0, -3.0)), seen(0.0, 3.0, -3.0, seed=2)
    assert told(old, new, (before, look(seen(0.0, -3.0, seed=2)))) == [("gone", "at 3", 1.0)]
    # Whatever the gain of the other scanner
    for gain in (1.0, 0.3):
        shown = look(Points(after.xyz, intensity=gain * after.intensity))
        for (status, name, chance), *more in (
            told(old, new, (before, shown)),
            told(new, old, (shown, before)),
        ):
            assert (status, name, more) == ("unsure", "at 3", [])
            assert chance <= 0.5


def test_a_short_marking_is_new_where_the_road_was_bare():
    old, whole = road(0.0, -3.0), road(0.0, 3.0, -3.0)
    new = LineSet.concatenate([old, stretch(whole.take([1]), 40.0, 47.0)])
    assert told(old, new) == [("unsure", "at 3", 0.6)]
    bare, painted = look(seen(0.0, -3.0)), look(seen(0.0, 3.0, -3.0, seed=2))
    assert told(old, new, (bare, painted)) == [("new", "at 3", 1.0)]


def test_a_kerb_that_is_called_an_edge_is_one_where_the_ground_has_changed():
    other_side = as_edges(road(-3.0), "kerb")
    kerb, edge = as_edges(road(3.0), "kerb"), as_edges(road(3.0), "edge")
    old, new = LineSet.concatenate([other_side, kerb]), LineSet.concatenate([other_side, edge])

    def street(height_m, value, seed):
        points = beside(seen(seed=seed), 0.08, 1.4, 3.0, right=True)
        return look(beside(points, height_m, value, 3.0))

    before, same, flush = street(0.08, 1.4, 1), street(0.08, 1.4, 2), street(0.0, 1.0, 2)
    assert [one[:2] for one in told(old, new, (before, flush))] == [("changed", "at 3")]
    assert [one[:2] for one in told(old, new, (before, same))] == [("unsure", "at 3")]


@pytest.mark.parametrize(("height_m", "other_m"), [(0.2, 0.12), (0.1, -0.1), (0.1, 0.0)])
def test_a_height_that_only_lines_state_has_changed_where_the_step_has(height_m, other_m):
    kerbs = as_edges(road(-3.0, 3.0), "kerb")
    old = kerbs.with_columns(height_m=[height_m, height_m])
    new = kerbs.with_columns(height_m=[height_m, other_m])

    def street(up_m, seed):
        # The footway is as bright as before
        points = beside(seen(seed=seed), height_m, 2.0, 3.0, right=True)
        return look(beside(points, up_m, 2.0, 3.0))

    before, same, other = street(height_m, 1), street(height_m, 2), street(other_m, 2)
    (change,) = compare_epochs(old, new, looks=(before, other))[0]
    assert change.status == "changed" and change.probability > 0.999
    assert [one[0] for one in told(old, new, (before, same))] == ["unsure"]
    # Of what is flat there is no multiple: lines alone tell
    (back,) = compare_epochs(new, old, looks=(other, before))[0]
    assert back.status == "changed" and (
        other_m != 0.0 or back.probability == pytest.approx(0.9966, abs=1e-3)
    )


def test_half_a_kerb_is_neither_there_nor_gone():
    """What is far from both, for cars, leaves and wear, says little: tails are long."""
    kerbs = as_edges(road(-3.0, 3.0), "kerb")

    def street(height_m, seed):
        points = beside(seen(seed=seed), 0.1, 1.0, 3.0, right=True)
        return look(beside(points, height_m, 1.0, 3.0))

    alone = compare_epochs(kerbs, kerbs.take([0]))[0][0].probability
    for height_m in (0.04, 0.06):
        (change,) = compare_epochs(kerbs, kerbs.take([0]), looks=(street(0.1, 1), street(height_m, 2)))[0]
        assert change.probability == pytest.approx(alone, abs=0.1)


@pytest.mark.parametrize(("before_m", "after_m"), [(0.6, 1.3), (0.75, 0.6)])
def test_points_do_not_tell_how_high_a_rail_stands(before_m, after_m):
    lines = road(0.0, -3.0)
    (old, its_points), (new, other_points) = (rail(40.0, 160.0, top_m) for top_m in (before_m, after_m))
    old, new = (one.with_columns(height_m=[top]) for one, top in ((old, before_m), (new, after_m)))
    looks = (
        look(with_more(seen(0.0, -3.0), its_points)),
        look(with_more(seen(0.0, -3.0, seed=2), other_points)),
    )
    both = LineSet.concatenate([lines, old]), LineSet.concatenate([lines, new])
    assert told(*both, looks) == told(*both)
    assert "changed" in {one[0] for one in told(*both)}


def test_noise_of_few_points_is_no_outlier():
    """A kerb of which 25 points a square metre show as much as before is still there."""
    kerbs = as_edges(road(-3.0, 3.0), "kerb")

    def street(height_m, seed):
        points = beside(seen(seed=seed, per_m2=25.0), 0.1, 1.0, 3.0, right=True)
        return look(beside(points, height_m, 1.0, 3.0))

    def chance(height_m):
        changes = compare_epochs(kerbs, kerbs.take([0]), looks=(street(0.1, 1), street(height_m, 2)))[0]
        return changes[0].probability

    assert chance(0.1) < 0.2
    assert chance(0.0) > 0.9


def test_the_edge_of_the_pavement_does_not_pass_for_paint_beside_it():
    def shown(seed, *offsets):
        return at_line(beside(seen(*offsets, seed=seed), -0.04, 2.5, 0.36), WIDTH_M / 2)

    painted, bare = shown(1, 0.0), shown(2)
    assert shape_ratio(painted, bare).ratio == pytest.approx(0.0, abs=0.05)
    assert shape_ratio(painted, shown(3, 0.0)).ratio == pytest.approx(1.0, abs=0.05)


def test_what_is_bridged_or_hidden_within_a_marking_that_is_gone_is_gone_too():
    old, new = road(0.0, 3.0, -3.0), road(0.0, -3.0)
    y, x = old.xyz[:, 1] - ORIGIN[1], old.xyz[:, 0] - ORIGIN[0]
    old = old.with_columns(bridged=(y == 3.0) & (x > 60.0) & (x < 80.0))
    after = seen(0.0, -3.0, seed=2)
    x = after.xyz[:, 0] - ORIGIN[0]
    after = after.take((x < 120.0) | (x > 140.0) | (np.abs(after.xyz[:, 1] - ORIGIN[1] - 3.0) > 0.5))
    changes = compare_epochs(old, new, looks=(look(seen(0.0, 3.0, -3.0)), look(after)))[0]
    assert [(c.status, c.from_m, c.to_m) for c in changes] == [("gone", 0.0, LENGTH_M)]


def rail(from_m, to_m, top_m=0.75, offset_m=3.6):
    """Return a rail beside a road, and its points."""
    x = np.arange(from_m, to_m + 0.1, 2.0)
    line = LineSet.from_lines(
        [ORIGIN + np.column_stack([x, np.full(len(x), offset_m), np.full(len(x), top_m)])], kind="guardrail", id="rail",
        form="w_beam", sigma_xy_m=0.01, sigma_z_m=0.01, confidence=0.98, crs="EPSG:25832",
    )  # fmt: skip
    rng = np.random.default_rng(5)
    n = int(60 * (to_m - from_m))
    at = np.column_stack(
        [rng.uniform(from_m, to_m, n), np.full(n, offset_m), rng.uniform(top_m - 0.3, top_m, n)]
    )
    return line, Points(ORIGIN + at, intensity=np.full(n, 90.0, dtype=np.float32))


def with_more(points, more):
    return Points(
        np.concatenate([points.xyz, more.xyz]), intensity=np.concatenate([points.intensity, more.intensity])
    )


def test_a_rail_of_which_the_other_survey_has_points_was_missed():
    lines = road(0.0, -3.0)
    line, its_points = rail(40.0, 80.0)
    # Rails of the road that one survey often misses
    often = [rail(a, a + 30.0, offset_m=-3.6)[0] for a in (0.0, 50.0, 100.0)]
    old, new = LineSet.concatenate([lines, *often, line]), lines
    before = with_more(seen(0.0, -3.0), its_points)
    bare = look(seen(0.0, -3.0, seed=2))
    there = look(with_more(seen(0.0, -3.0, seed=2), rail(40.0, 80.0)[1]))

    def of_rail(looks=None):
        return [(s, p) for s, name, p in told(old, new, looks) if p == p][-1]

    assert of_rail((look(before), bare))[1] > of_rail()[1] > of_rail((look(before), there))[1]
    # Behind a row of cars nobody knows
    cars = seen(0.0, -3.0, seed=2)
    hidden = look(cars.take(cars.xyz[:, 1] - ORIGIN[1] < 2.5))
    changes = compare_epochs(old, new, looks=(look(before), hidden))[0]
    assert [c.status for c in changes if np.isclose(c.from_m, 0.0) and c.line.xyz[0, 1] > ORIGIN[1]] == [
        "not visible"
    ]


@pytest.mark.parametrize("top_m", [1.0, 2.5])
def test_a_fence_is_gone_however_high_it_was(top_m):
    line, its_points = rail(40.0, 120.0, top_m=top_m)
    old = LineSet.concatenate([road(0.0, -3.0), line.with_columns(kind=["fence"])])
    looks = look(with_more(seen(0.0, -3.0), its_points)), look(seen(0.0, -3.0, seed=2))
    assert [one[:2] for one in told(old, road(0.0, -3.0), looks)] == [("gone", "rail")]


def test_what_was_hidden_for_longer_than_was_seen_beside_it_is_not_gone():
    old, new = road(0.0, 3.0, -3.0), road(0.0, -3.0)
    after = seen(0.0, -3.0, seed=2)
    x = after.xyz[:, 0] - ORIGIN[0]
    after = after.take((x < 30.0) | (x > 170.0) | (np.abs(after.xyz[:, 1] - ORIGIN[1] - 3.0) > 0.5))
    changes = compare_epochs(old, new, looks=(look(seen(0.0, 3.0, -3.0)), look(after)))[0]
    assert [c.status for c in changes] == ["gone", "gone", "not visible"]
    assert max(c.length_m for c in changes if c.status == "gone") < 35.0


def test_a_rail_in_the_place_of_a_part_of_a_line_parts_what_is_gone():
    edge = as_edges(road(3.0), "edge").with_columns(kind=["fence"])
    between = rail(80.0, 120.0, top_m=0.0, offset_m=3.0)[0].with_columns(id=["instead"])
    old = LineSet.concatenate([road(0.0, -3.0), edge])
    new = LineSet.concatenate([road(0.0, -3.0), between])
    changes = compare_epochs(old, new)[0]
    stretches = sorted((c.from_m, c.to_m) for c in changes if c.line.id[0] == "at 3")
    assert len(stretches) == 3
    assert all(a[1] <= b[0] + 1.0 for a, b in pairwise(stretches))


def test_paint_on_the_crown_of_a_road_is_told_by_its_brightness_alone():
    def crowned(seed, *offsets, bright=True):
        points = seen(*offsets, seed=seed)
        up = -0.025 * np.abs(points.xyz[:, 1] - ORIGIN[1])
        xyz = points.xyz + np.column_stack([0.0 * up, 0.0 * up, up])
        return at_line(Points(xyz, intensity=points.intensity if bright else None), WIDTH_M / 2)

    assert shape_ratio(crowned(1, 0.0), crowned(2)).ratio == pytest.approx(0.0, abs=0.05)
    # The crown stays, whether paint lies on it or not
    assert shape_ratio(crowned(1, 0.0, bright=False), crowned(2, bright=False)) is None


def test_how_alike_surveys_are_is_taken_from_neighbouring_stations():
    x = np.arange(0.0, 900.1, 2.0)
    rows = [ORIGIN + np.column_stack([x, np.full(len(x), y), 0.0 * x]) for y in (0.0, 3.0, -3.0)]
    lines = LineSet.from_lines(rows, kind="lane_marking", width_m=WIDTH_M, sigma_xy_m=0.01, sigma_z_m=0.01)
    asked = []

    def shown(places):
        asked.append(places.xyz)
        return look_at_ground(places, lambda area: Points(np.zeros((0, 3))))

    compare_epochs(lines, lines.take([0, 2]), looks=(shown, shown))
    at = asked[0][np.abs(asked[0][:, 1] - ORIGIN[1]) < 1.0, 0]
    assert 200 < len(at) < 700
    assert np.median(np.diff(np.sort(at))) == pytest.approx(1.0)


def test_what_is_no_longer_than_a_lorry_may_have_driven_away():
    lines = road(0.0, -3.0)
    line, its_points = rail(40.0, 52.0)
    before, after = look(with_more(seen(0.0, -3.0), its_points)), look(seen(0.0, -3.0, seed=2))
    old = LineSet.concatenate([lines, line])
    assert told(old, lines, (before, after)) == told(old, lines)


@pytest.mark.parametrize(("left", "ratio"), [(1.0, 1.0), (0.5, 0.5), (0.0, 0.0)])
def test_the_ratio_of_shapes_is_what_is_left(left, ratio):
    whole, other, none = seen(0.0), seen(0.0, seed=2), seen(seed=3)
    rng = np.random.default_rng(4)
    worn = np.where(rng.uniform(size=len(other)) < left, other.intensity, np.minimum(other.intensity, 100.0))
    worn_points = Points(other.xyz, intensity=worn.astype(np.float32))
    shown = [at_line(points, WIDTH_M / 2) for points in (whole, worn_points, none)]
    found = shape_ratio(shown[0], shown[1])
    # Relative to all that is there, paint included, which half of the paint makes darker by 8 %
    assert found.ratio == pytest.approx(ratio, abs=0.08)
    # Bare road has no shape of which the other could be a multiple
    assert shape_ratio(shown[2], shown[0]) is None


@pytest.mark.parametrize("away_m", [0.1, 0.25, -0.4])
@pytest.mark.parametrize("is_paint", [True, False])
def test_a_line_has_moved_as_far_as_its_shape_has_gone_over(away_m, is_paint):
    half_m = WIDTH_M / 2 if is_paint else 0.0

    def shown(place_m, seed):
        points = seen(place_m, seed=seed) if is_paint else beside(seen(seed=seed), 0.06, 1.5, place_m)
        return at_line(points, half_m)

    before, moved, stayed = shown(0.0, 1), shown(away_m, 2), shown(0.0, 3)
    assert move_ratio(before, moved, away_m).ratio == pytest.approx(1.0, abs=0.1)
    assert move_ratio(before, stayed, away_m).ratio == pytest.approx(0.0, abs=0.1)


def at_line(points, half_m):
    """Return what points show along a line in the middle of the road."""
    x = np.arange(0.5, 60.0, 1.0)
    at = ORIGIN + np.column_stack([x, 0.0 * x, 0.0 * x])
    return look_at_ground(
        Places(at, np.tile([0.0, 1.0], (len(x), 1)), np.full(len(x), half_m)), within(points)
    )


def within(points):
    return look(points).keywords["points_in"]
