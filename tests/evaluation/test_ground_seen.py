"""A line is new or gone only where the other survey saw the ground at its place."""

from __future__ import annotations

from functools import partial

import numpy as np
from tests.conftest import CRS

from linework.evaluation.changes.epochs import compare_epochs
from linework.evaluation.changes.ground_seen import Places, look_at_ground
from linework.files.las.write import write_las
from linework.files.vectors.read_write import write_lines
from linework.model.lines import LineSet
from linework.model.points import Points

ORIGIN = np.array([500_000.0, 5_400_000.0, 50.0])
LENGTH_M, WIDTH_M = 200.0, 0.12


def road(*offsets_m):
    """Return markings along x."""
    x = np.arange(0.0, LENGTH_M + 0.1, 2.0)
    rows = [ORIGIN + np.column_stack([x, np.full(len(x), y), 0.0 * x]) for y in offsets_m]
    return LineSet.from_lines(
        rows, kind="lane_marking", id=[f"at {y:g}" for y in offsets_m], pattern="solid", width_m=WIDTH_M, sigma_xy_m=0.01,
        sigma_z_m=0.01, confidence=0.98, crs="EPSG:25832",
    )  # fmt: skip


def seen(*offsets_m, shadow=None, seed=1, per_m2=300.0):
    """Return points of a road, bright on its markings, with none where something else hides it."""
    rng = np.random.default_rng(seed)
    n = int(LENGTH_M * 9.0 * per_m2)
    x, y = rng.uniform(0.0, LENGTH_M, n), rng.uniform(-4.5, 4.5, n)
    is_paint = np.any([np.abs(y - q) < WIDTH_M / 2 for q in (*offsets_m, 9.0)], axis=0)
    kept = np.ones(n, dtype=bool) if shadow is None else (y < shadow[0]) | (y > shadow[1])
    value = np.where(is_paint, 250.0, 100.0) * (1.0 + 0.08 * rng.normal(size=n))
    points = Points(
        ORIGIN + np.column_stack([x, y, rng.normal(0.0, 0.005, n)]), intensity=value.astype(np.float32)
    )
    return points.take(kept)


def look(points):
    def within(area):
        x, y = points.xyz[:, 0], points.xyz[:, 1]
        return points.take((x >= area.west) & (x < area.east) & (y >= area.south) & (y < area.north))

    return partial(look_at_ground, points_in=within)


def statuses(old, new, looks=None):
    return [(c.status, str(c.line.id[0])) for c in compare_epochs(old, new, looks=looks)[0]]


def test_a_marking_half_of_which_lies_in_a_shadow_is_not_gone():
    old, new, before = road(0.0, 3.0, -3.0), road(0.0, -3.0), look(seen(0.0, 3.0, -3.0))
    assert statuses(old, new) == [("gone", "at 3")]
    hidden = look(seen(0.0, -3.0, shadow=(3.02, 3.6), seed=2))
    assert statuses(old, new, (before, hidden)) == [("not visible", "at 3")]
    assert statuses(new, old, (hidden, before)) == [("not visible", "at 3")]
    bare = look(seen(0.0, -3.0, seed=2))
    assert statuses(old, new, (before, bare)) == [("gone", "at 3")]
    assert statuses(new, old, (bare, before)) == [("new", "at 3")]


def test_few_points_are_enough_where_the_survey_has_no_more_beside_its_own_lines():
    old, new = road(0.0, 3.0, -3.0), road(0.0, -3.0)
    sparse = look(seen(0.0, -3.0, seed=2, per_m2=30.0))
    assert statuses(old, new, (look(seen(0.0, 3.0, -3.0)), sparse)) == [("gone", "at 3")]


def test_a_height_in_which_both_surveys_differ_hides_nothing():
    up = np.array([0.0, 0.0, 0.5])
    old, new, after = road(0.0, 3.0, -3.0), road(0.0, -3.0), seen(0.0, -3.0, seed=2)
    new, after = new.with_columns(xyz=new.xyz + up), Points(after.xyz + up, intensity=after.intensity)
    looks = look(seen(0.0, 3.0, -3.0)), look(after)
    assert statuses(old, new, looks) == [("gone", "at 3")]
    assert statuses(new, old, looks[::-1]) == [("new", "at 3")]


def test_a_kind_that_the_other_survey_has_nowhere_is_looked_at_too():
    rails = LineSet.concatenate([road(-4.2), road(4.2)]).with_columns(
        kind=["guardrail"] * 2, pattern=[""] * 2, width_m=np.full(2, np.nan), id=["left rail", "right rail"]
    )
    old = LineSet.concatenate([road(3.0), rails])
    before, hidden = look(seen(3.0)), look(seen(shadow=(2.0, 3.6), seed=2))
    assert statuses(old, rails, (before, hidden)) == [("not visible", "at 3")]
    assert statuses(old, rails, (before, look(seen(seed=2)))) == [("gone", "at 3")]


def test_points_are_counted_alike_over_tiles_and_in_any_order():
    points = seen(0.0)
    x = np.arange(0.5, LENGTH_M, 1.0)
    places = Places(
        ORIGIN + np.column_stack([x, 0.0 * x, 0.0 * x]),
        np.tile([0.0, 1.0], (len(x), 1)),
        np.full(len(x), 0.06),
    )
    shown = look(points)(places)
    assert shown.fewest.min() > 10
    assert shown.number.sum(axis=1).min() > 200
    turned = np.random.default_rng(3).permutation(len(points))
    again = look(points.take(turned))(places)
    assert np.array_equal(again.fewest, shown.fewest)
    assert np.array_equal(again.sums, shown.sums)
    for i in range(28, 36):
        one = look(points)(Places(places.xyz[i : i + 1], places.left[i : i + 1], places.half_m[i : i + 1]))
        assert one.fewest[0] == shown.fewest[i]
        assert np.array_equal(one.sums[0], shown.sums[i])
    high = Places(places.xyz + np.array([0.0, 0.0, 2.0]), places.left, places.half_m)
    assert not look(points)(high).number.any()


def test_compare_says_what_the_points_could_not_show(linework, tmp_path):
    surveys = {
        "old": (road(0.0, 3.0, -3.0), seen(0.0, 3.0, -3.0)),
        "new": (road(0.0, -3.0), seen(0.0, -3.0, shadow=(3.02, 3.6), seed=2)),
    }
    for name, (lines, points) in surveys.items():
        (tmp_path / name).mkdir()
        write_lines(lines, tmp_path / f"{name}.gpkg")
        write_las(points, tmp_path / name / "points.laz", crs=CRS)
    call = ["compare", tmp_path / "old.gpkg", tmp_path / "new.gpkg", "-o", tmp_path / "c.csv", "--quiet"]
    done = linework(*call, "--old-survey", tmp_path / "old", "--new-survey", tmp_path / "new")
    assert done.code == 0, done.stderr
    rows = [line for line in (tmp_path / "c.csv").read_text().splitlines() if "at 3" in line]
    assert [row.split(",")[0] for row in rows] == ["not visible"]
    assert linework(*call, "--overwrite").code == 0
    rows = [line for line in (tmp_path / "c.csv").read_text().splitlines() if "at 3" in line]
    assert [row.split(",")[0] for row in rows] == ["gone"]


def test_boundaries_alone_are_compared_by_points_without_intensities(linework, tmp_path):
    edges = {"kind": "road_boundary", "pattern": "", "width_m": np.nan}
    surveys = {
        "old": (road(0.0, 3.0, -3.0), seen()),
        "new": (road(0.0, -3.0), seen(shadow=(3.02, 3.6), seed=2)),
    }
    for name, (lines, points) in surveys.items():
        lines = lines.with_columns(**{key: [value] * len(lines) for key, value in edges.items()})
        (tmp_path / name).mkdir()
        write_lines(lines, tmp_path / f"{name}.gpkg")
        write_las(Points(points.xyz), tmp_path / name / "points.laz", crs=CRS)
    call = ["compare", tmp_path / "old.gpkg", tmp_path / "new.gpkg", "-o", tmp_path / "c.csv", "--quiet"]
    done = linework(*call, "--old-survey", tmp_path / "old", "--new-survey", tmp_path / "new")
    assert done.code == 0, done.stderr
    rows = [line for line in (tmp_path / "c.csv").read_text().splitlines() if "at 3" in line]
    assert [row.split(",")[0] for row in rows] == ["not visible"]
    assert "paint compared" not in done.stdout
