"""What is left of paint, from points with a known share of it."""

from __future__ import annotations

import numpy as np
import pytest
from tests.conftest import CRS

from linework.crs import parse_crs
from linework.evaluation.chainage.paint_along import paint_left, paint_samples, paint_stretches
from linework.evaluation.chainage.paint_changes import paint_changes
from linework.evaluation.chainage.paint_points import paint_pieces
from linework.evaluation.chainage.rows import chainage_report
from linework.files.las.write import write_las
from linework.files.vectors.read_write import write_lines
from linework.lines.crosscuts import axis_along
from linework.model.lines import LineSet
from linework.model.points import Points

ORIGIN = np.array([500_000.0, 5_400_000.0, 0.0])
LENGTH_M, WIDTH_M, CONTRAST = 40.0, 0.12, 2.5


def marking(pattern="solid", **columns):
    shape = np.array([[0.0, 0.0, 5.0], [LENGTH_M / 2, 0.0, 5.0], [LENGTH_M, 0.0, 5.0]])
    return LineSet.from_lines(
        [shape], kind="lane_marking", id="middle", pattern=pattern, width_m=WIDTH_M, **columns
    )


def points(
    left, *, seed=1, road=100.0, zero=0.0, noise=0.08, per_m2=1500, verge=1.0, offset_m=0.0, y_m=(-0.6, 0.6)
):
    """Return points about a marking of which a share is left, in patches of 10 cm."""
    rng = np.random.default_rng(seed)
    n = int(LENGTH_M * (y_m[1] - y_m[0]) * per_m2)
    xy = np.column_stack([rng.uniform(0.0, LENGTH_M, n), rng.uniform(*y_m, n)])
    patch = np.random.default_rng(seed + 1).random((int(LENGTH_M / 0.1), 3))
    column = np.clip(((xy[:, 1] + 0.15) / 0.1).astype(int), 0, 2)
    there = patch[(xy[:, 0] / 0.1).astype(int), column] < left
    value = np.where((np.abs(xy[:, 1]) < WIDTH_M / 2) & there, CONTRAST * road, road)
    value = np.where(xy[:, 1] > 0.2, verge * value, value) * (1.0 + noise * rng.normal(size=n)) + zero
    xyz = np.column_stack([xy[:, 0], xy[:, 1] + offset_m, np.full(n, 5.0)])
    return Points(xyz, intensity=value.astype(np.float32))


def share_of(left, *, seed=1, from_m=0.0, to_m=LENGTH_M):
    """Return the share of the core of the marking [%] that the patches of `points` cover."""
    patch = np.random.default_rng(seed + 1).random((int(LENGTH_M / 0.1), 3))[:, 1]
    return 100 * np.mean(patch[round(from_m / 0.1) : round(to_m / 0.1)] < left)


def within(cloud):
    def inside(bounds):
        x, y = cloud.xyz[:, 0], cloud.xyz[:, 1]
        return cloud.take((x >= bounds.west) & (x < bounds.east) & (y >= bounds.south) & (y < bounds.north))

    return inside


def measured(lines, cloud):
    axis = axis_along("road", lines[0].xyz)
    found = {"remaining_paint": [], "contrast": [], "width": []}
    for one in paint_samples(lines, axis, paint_pieces(lines, within(cloud))):
        found[one.quantity].append((np.nan if one.value is None else one.value, one.sigma))
    return {name: np.array(values) for name, values in found.items()}


@pytest.mark.parametrize("left", [1.0, 0.8, 0.5, 0.2])
def test_the_share_that_is_left_is_measured_with_its_deviation(left):
    found = measured(marking(), points(left))
    share, sigma = found["remaining_paint"].T
    assert len(share) == LENGTH_M / 2
    true = np.array([share_of(left, from_m=2.0 * k, to_m=2.0 * k + 2.0) for k in range(20)])
    assert abs(share.mean() - true.mean()) < 1.5
    assert np.all(np.abs(share - true) < 4 * sigma + 1.0)
    # Patches of 10 cm are seen by 9 points each: the deviation is that of the points, not that of so many patches
    assert np.sqrt(np.mean(sigma**2)) < 100 * np.sqrt(0.25 / 60)
    assert np.nanmedian(found["contrast"][:, 0]) == pytest.approx(CONTRAST, rel=0.04)
    if left == 1.0:
        width, width_sigma = found["width"].T
        assert width.mean() == pytest.approx(WIDTH_M, abs=0.002)
        assert np.sqrt(np.mean(((width - WIDTH_M) / width_sigma) ** 2)) < 1.6


def test_a_bright_verge_and_studs_are_not_taken_for_paint():
    cloud = points(0.7, verge=2.2)
    bright = cloud.intensity.copy()
    studs = (np.abs(cloud.xyz[:, 1]) < 0.05) & (cloud.xyz[:, 0] % 6.0 < 0.5)
    bright[studs] = 2500.0
    share = measured(marking(), Points(cloud.xyz, intensity=bright))["remaining_paint"][:, 0]
    # Studs cover 8 % of the paint, and of the bare places
    assert abs(share.mean() - 72.4) < 6.0


def test_whole_paint_on_brighter_asphalt_is_whole():
    # Same paint, brighter road: 1.5 times as bright as it beyond 25 m, before 2.5 times
    cloud = points(1.0)
    plain = (np.abs(cloud.xyz[:, 1]) >= WIDTH_M / 2) & (cloud.xyz[:, 0] > 25.0)
    cloud = Points(cloud.xyz, intensity=np.where(plain, cloud.intensity * 2.5 / 1.5, cloud.intensity))
    share = measured(marking(), cloud)["remaining_paint"][:, 0]
    # Where the asphalt changes, one piece may have that of the other
    assert np.count_nonzero(np.abs(share - 100.0) > 12.0) <= 1


def with_factor(cloud, where, factor):
    return Points(cloud.xyz, intensity=np.where(where, cloud.intensity * factor, cloud.intensity))


def test_bare_places_on_a_road_that_is_brighter_on_one_side_are_no_paint():
    """A wheel track beside worn paint is darker than the road under it, which is as bright as that on the other side."""
    cloud = points(0.25)
    y = cloud.xyz[:, 1]
    share = measured(marking(), with_factor(cloud, y < -0.075, 0.7))["remaining_paint"][:, 0]
    assert abs(share.mean() - share_of(0.25)) < 4.0
    # Farther away another road begins, on which the paint does not lie
    share = measured(marking(), with_factor(cloud, np.abs(y) > 0.25, 0.5))
    assert abs(np.nanmedian(share["contrast"][:, 0]) - CONTRAST) < 0.1


def test_few_points_beside_paint_are_looked_for_farther_away():
    """From the air a strip of 10 cm has 6 points in 2 m."""
    cloud = points(1.0, noise=0.03)
    beside = np.abs(cloud.xyz[:, 1]) > WIDTH_M / 2
    cloud = cloud.take(~beside | (np.arange(len(beside)) % 50 == 0))
    share = measured(marking(), cloud)["remaining_paint"][:, 0]
    assert np.isfinite(share).all() and share.min() > 90.0


def test_remains_are_no_whole_paint_where_nothing_else_is_left():
    """Of 20 m and more only thin remains are left, 1.2 times as bright as road."""
    thin = with_factor(points(0.0), np.abs(points(0.0).xyz[:, 1]) < WIDTH_M / 2, 1.2)
    share = measured(marking(), worn_from(points(0.9), thin, 16.0))["remaining_paint"][:, 0]
    assert share[:8].mean() > 80.0 and share[8:].max() < 10.0


def test_paint_is_as_bright_on_a_short_dark_patch():
    """Whole paint on asphalt that is a third as bright for 4 m is 7.5 times as bright as that, before and behind 2.5 times."""
    cloud = points(0.8)
    x, y = cloud.xyz[:, 0], cloud.xyz[:, 1]
    bare = (np.abs(y) >= WIDTH_M / 2) | (cloud.intensity < 160.0)
    for factor in (1.0 / 3.0, 1.7):
        patched = with_factor(cloud, bare & (x > 16.0) & (x < 20.0), factor)
        share = measured(marking(), patched)["remaining_paint"][:, 0]
        true = [share_of(0.8, from_m=2.0 * k, to_m=2.0 * k + 2.0) for k in range(20)]
        np.testing.assert_allclose(share, true, atol=15.0)


def test_the_road_between_two_stripes_is_none_to_refer_to():
    """What the stripes of a double line leave between them is brighter by their blurred edges, and has few points."""
    cloud = points(1.0, per_m2=500, noise=0.04)
    y = cloud.xyz[:, 1]
    bright = with_factor(cloud, np.abs(y - 0.26) < WIDTH_M / 2, CONTRAST)
    bright = with_factor(bright, (y > 0.115) & (y < 0.145), 1.4)
    line = marking()[0].xyz
    shapes = [line, line + np.array([0.0, 0.26, 0.0])]
    lines = LineSet.from_lines(shapes, kind="lane_marking", id=["a", "b"], pattern="solid", width_m=WIDTH_M)
    contrast = measured(lines, bright)["contrast"][:, 0]
    assert len(contrast) == LENGTH_M and np.nanmax(np.abs(contrast - CONTRAST)) < 0.25


def test_contrast_is_no_bin_and_its_deviation_that_of_the_road_beside():
    """Patches of other asphalt beside paint: what both sides of one piece differ by is often small by chance."""
    errors = []
    for seed in range(4):
        cloud = points(1.0, seed=seed, per_m2=600)
        side = np.random.default_rng(50 + seed).normal(1.0, 0.06, (20, 2))
        piece, left = (cloud.xyz[:, 0] / 2.0).astype(int).clip(0, 19), (cloud.xyz[:, 1] > 0.0).astype(int)
        beside = np.where(np.abs(cloud.xyz[:, 1]) > WIDTH_M / 2, side[piece, left], 1.0)
        value, sigma = measured(marking(), with_factor(cloud, True, beside))["contrast"].T
        errors.append((value - CONTRAST) / sigma)
    assert 0.6 < np.sqrt(np.mean(np.square(errors))) < 1.4
    even = measured(marking(), points(1.0, noise=0.02))["contrast"]
    assert np.abs(even[:, 0] - CONTRAST).max() < 0.03
    # Recorded in steps of a tenth of the road, whose middle may lie anywhere in one
    coarse = points(1.0, noise=0.02)
    coarse = Points(coarse.xyz, intensity=np.floor(coarse.intensity / 10.0) * 10.0)
    assert measured(marking(), coarse)["contrast"][:, 1].min() > CONTRAST * 0.1 / np.sqrt(12.0)


def clipped(cloud, most):
    return Points(cloud.xyz, intensity=np.minimum(cloud.intensity, most))


def test_paint_brighter_than_a_scanner_can_record_has_no_contrast():
    """Its share is known all the same, and its contrast where a good part of the points was recorded."""
    found = measured(marking(), clipped(points(1.0), 150.0))
    assert np.isnan(found["contrast"][:, 0]).all() and found["remaining_paint"][:, 0].min() > 95.0
    # Six of ten points are clipped: their median is no measure of paint, though that of all is
    contrast = measured(marking(), clipped(points(1.0), 245.0))["contrast"]
    assert np.median(contrast[:, 0]) == pytest.approx(CONTRAST, rel=0.02)
    # Of worn paint the points that were recorded may lie on its edges
    assert np.isnan(measured(marking(), clipped(points(0.3), 245.0))["contrast"][:, 0]).mean() > 0.9


def test_few_points_show_contrast_though_not_the_share_that_is_left():
    cloud = points(1.0)
    core = np.abs(cloud.xyz[:, 1]) < WIDTH_M / 4
    found = measured(marking(), cloud.take(~core | (np.cumsum(core) % 30 == 0)))
    contrast, sigma = found["contrast"].T
    assert np.isnan(found["remaining_paint"][:, 0]).mean() > 0.8 and np.isfinite(contrast).mean() > 0.8
    assert np.sqrt(np.nanmean(((contrast - CONTRAST) / sigma) ** 2)) < 1.5


def test_paint_that_cannot_be_told_apart_is_unknown():
    plain = points(0.0)
    assert np.isnan(measured(marking(), plain)["remaining_paint"][:, 0]).all()
    noisy = points(0.5, noise=1.5)
    assert np.isnan(measured(marking(), noisy)["remaining_paint"][:, 0]).all()
    # Nothing was hit in the second half
    half = points(1.0)
    share = measured(marking(), half.take(half.xyz[:, 0] < 20.0))["remaining_paint"][:, 0]
    assert np.isfinite(share).tolist() == [True] * 10 + [False] * 10


def test_without_intensities_and_without_a_width_nothing_is_measured():
    cloud = points(1.0)
    share = measured(marking(), Points(cloud.xyz))["remaining_paint"][:, 0]
    assert len(share) == 20 and np.isnan(share).all()
    lines = marking().with_columns(width_m=[np.nan])
    assert len(paint_pieces(lines, within(cloud))) == 0
    # A dashed marking has paint where its dashes are, and none were found
    assert len(paint_pieces(marking("dashed"), within(cloud))) == 0


def test_a_report_has_rows_of_paint():
    lines = marking()
    pieces = paint_pieces(lines, within(points(0.6)))
    report = chainage_report(lines, [axis_along("road", lines[0].xyz)], paint=pieces)
    rows = [r for r in report.rows if (r.quantity, r.statistic) == ("remaining_paint", "mean")]
    assert [r.line for r in rows] == ["middle"] * 4 and {r.unit for r in rows} == {"%"}
    for row in rows:
        assert abs(row.value - share_of(0.6, from_m=row.from_m, to_m=row.to_m)) < 4 * row.sigma
        assert row.sigma < 4.0 and row.n == 5


def test_the_command_reads_the_points_where_the_lines_are(linework, tmp_path):
    cloud = points(0.6)
    placed = Points(cloud.xyz + ORIGIN, intensity=np.maximum(cloud.intensity, 0.0))
    write_las(placed, tmp_path / "road.laz", crs=CRS)
    write_las(placed, tmp_path / "elsewhere.laz", crs="EPSG:25833+7837")
    lines = marking(crs=parse_crs(CRS))
    write_lines(lines.with_columns(xyz=lines.xyz + ORIGIN), tmp_path / "lines.gpkg")
    found = linework(
        "report", tmp_path / "lines.gpkg", "-o", tmp_path / "r.csv", "--survey", tmp_path / "road.laz"
    )
    assert found.code == 0, found.stderr
    rows = [
        row.split(",")
        for row in (tmp_path / "r.csv").read_text().splitlines()
        if "remaining_paint,mean" in row
    ]
    assert len(rows) == 4
    assert all(abs(float(row[9]) - 60.0) < 20.0 for row in rows)
    for wrong, problem in (
        (["--survey", tmp_path / "no.laz"], "no.laz"),
        (["--survey", tmp_path / "elsewhere.laz"], "the lines in"),
    ):
        found = linework("report", tmp_path / "lines.gpkg", "-o", tmp_path / "q.csv", *wrong)
        assert found.code in (2, 3) and problem in found.line
        assert not (tmp_path / "q.csv").exists()


def test_stretches_of_a_marking_are_means_of_its_pieces_with_their_deviation():
    """Worn to 90 % up to the middle, to 30 % from there on; hidden pieces are unknown, never 0."""
    cloud = worn_from(points(0.9), points(0.3, seed=5), LENGTH_M / 2)
    lines = marking()
    found = paint_stretches(lines, paint_pieces(lines, within(cloud)))
    assert [(one.line, one.from_m, one.to_m) for one in found] == [
        (0, 10.0 * k, 10.0 * k + 10.0) for k in range(4)
    ]
    left, sigma = np.array([one.values["remaining_paint"] for one in found]).T
    np.testing.assert_allclose(left, [90, 90, 30, 30], atol=12.0)
    worn = [(0.9, 1), (0.9, 1), (0.3, 5), (0.3, 5)]
    true = [share_of(a, seed=b, from_m=10.0 * k, to_m=10.0 * k + 10.0) for k, (a, b) in enumerate(worn)]
    assert (sigma > 0.5).all() and (sigma < 4.0).all() and (np.abs(left - true) < 4 * sigma).all()
    assert [one.measured_share for one in found] == [1.0] * 4
    hidden = cloud.take(cloud.xyz[:, 0] < 30.0)
    last = paint_stretches(lines, paint_pieces(lines, within(hidden)))[-1]
    assert last.measured_share == 0.0 and set(last.values.values()) == {(None, None)}


def worn_from(cloud, worn, x_m):
    """Points of one survey up to a place, of another beyond it."""
    parts = cloud.take(cloud.xyz[:, 0] < x_m), worn.take(worn.xyz[:, 0] >= x_m)
    return Points(
        np.concatenate([p.xyz for p in parts]), intensity=np.concatenate([p.intensity for p in parts])
    )


def changes(old_lines, new_lines, old, new, shift_m=(0.0, 0.0)):
    return paint_changes(old_lines, new_lines, old, new, old.xy + np.array(shift_m))


def test_the_paint_left_of_pieces_is_that_of_the_samples():
    pieces = paint_pieces(marking(), within(points(0.7)))
    left, sigma = paint_left(pieces)
    assert np.array_equal(np.column_stack([left, sigma]), measured(marking(), points(0.7))["remaining_paint"])


@pytest.mark.parametrize("seed", [1, 4, 7])
def test_paint_that_was_worn_away_or_renewed_is_found_and_other_paint_is_not(seed):
    whole, worn = points(0.95, seed=seed), points(0.55, seed=seed + 10, road=60.0)
    old = paint_pieces(marking(), within(whole))
    # Another scanner with a gain of its own, a few centimetres beside
    again = points(0.95, seed=seed + 1, road=60.0)
    assert changes(marking(), marking(), old, paint_pieces(marking(), within(again))) == []
    new = paint_pieces(marking(), within(worn_from(again, worn, 20.0)))
    (change,) = changes(marking(), marking(), old, new)
    assert (change.from_m, change.to_m) == (pytest.approx(20.0, abs=2.1), pytest.approx(40.0, abs=2.1))
    assert abs(change.before - 95) < 5 and abs(change.after - 55) < 5
    (renewed,) = changes(marking(), marking(), new, old)
    assert renewed.after > renewed.before + 30


def test_what_a_marking_errs_by_together_is_drawn_once_a_marking():
    """20 points of paint are five of these deviations: more than one of a few markings errs by, whatever its length."""
    old = paint_pieces(marking(), within(points(0.95, seed=1)))
    worn = worn_from(points(0.95, seed=2, road=60.0), points(0.75, seed=11, road=60.0), 20.0)
    (change,) = changes(marking(), marking(), old, paint_pieces(marking(), within(worn)))
    assert change.from_m == pytest.approx(20.0, abs=2.1) and abs(change.before - change.after - 20) < 4


def test_unknown_paint_is_no_change():
    pieces = paint_pieces(marking(), within(points(0.95)))
    unknown = paint_pieces(marking(), within(points(0.0)))
    assert changes(marking(), marking(), pieces, unknown) == []
    assert changes(marking(), marking(), pieces.empty(), pieces) == []


def test_stretches_that_were_not_measured_are_no_part_of_a_change():
    line = marking()
    old = paint_pieces(line, within(points(0.95)))
    worn = points(0.5, seed=12)
    shown = worn.take((worn.xyz[:, 0] < 10.0) | (worn.xyz[:, 0] > 30.0))
    found = changes(line, line, old, paint_pieces(line, within(shown)))
    assert [(c.from_m, c.to_m) for c in found] == [(0.0, 10.0), (30.0, 40.0)]


def test_paint_is_compared_with_that_of_its_own_marking():
    """Of a double line one is worn, in both surveys; what is left of a shift must not exchange them."""
    shape = marking().xyz
    double = LineSet.from_lines(
        [shape, shape + np.array([0.0, 0.3, 0.0])],
        kind="lane_marking",
        id=["a", "b"],
        pattern="solid",
        width_m=WIDTH_M,
    )
    whole, worn = points(0.95, y_m=(-0.6, 0.15)), points(0.4, seed=12, y_m=(-0.15, 0.6))
    beside = Points(worn.xyz + np.array([0.0, 0.3, 0.0]), intensity=worn.intensity)
    lower, upper = whole.take(whole.xyz[:, 1] < 0.15), beside.take(beside.xyz[:, 1] >= 0.15)
    cloud = Points(
        np.concatenate([lower.xyz, upper.xyz]), intensity=np.concatenate([lower.intensity, upper.intensity])
    )
    old = paint_pieces(double, within(cloud))
    moved = double.with_columns(xyz=double.xyz + np.array([0.0, 0.2, 0.0]))
    there = Points(cloud.xyz + np.array([0.0, 0.2, 0.0]), intensity=cloud.intensity)
    new = paint_pieces(moved, within(there))
    assert changes(double, moved, old, new, shift_m=(0.0, 0.2)) == []
    # A marking a width away from where it was is another one
    assert changes(double.take([0]), moved.take([1]), paint_pieces(double.take([0]), within(cloud)),
                   paint_pieces(moved.take([1]), within(there))) == []  # fmt: skip


def test_compare_takes_the_points_of_both_surveys(linework, tmp_path):
    lines = marking().with_columns(crs=parse_crs("EPSG:25832"))
    shifted = LineSet.from_lines(
        [lines.xyz + ORIGIN],
        kind="lane_marking",
        id="middle",
        pattern="solid",
        width_m=WIDTH_M,
        crs="EPSG:25832",
    )
    old, worn = points(0.95), points(0.5, seed=12)
    for name, cloud in (("old", old), ("new", worn_from(old, worn, 10.0))):
        (tmp_path / name).mkdir()
        write_lines(shifted, tmp_path / f"{name}.gpkg")
        write_las(
            Points(cloud.xyz + ORIGIN, intensity=cloud.intensity), tmp_path / name / "points.laz", crs=CRS
        )
    both = ["--old-survey", tmp_path / "old", "--new-survey", tmp_path / "new"]
    call = ["compare", tmp_path / "old.gpkg", tmp_path / "new.gpkg", "-o", tmp_path / "c.csv", "--quiet"]
    done = linework(*call, *both)
    assert done.code == 0, done.stderr
    (row,) = [line for line in (tmp_path / "c.csv").read_text().splitlines() if "remaining paint" in line]
    assert row.startswith("changed,lane_marking,middle")
    assert not list(tmp_path.rglob("*.tmp"))
    assert "paint compared on at most 40 m of markings" in done.stdout
    # Points of another place, and points without intensities, are no comparison
    (tmp_path / "far").mkdir()
    write_las(
        Points(old.xyz + ORIGIN + np.array([5000.0, 0.0, 0.0]), intensity=old.intensity),
        tmp_path / "far" / "p.laz",
        crs=CRS,
    )
    far = linework(*call, "--overwrite", *both[:2], "--new-survey", tmp_path / "far")
    assert (far.code, far.line) == (
        3, f"error: {tmp_path / 'far'}: has no points beside any marking of {tmp_path / 'new.gpkg'}. Give the points from"
        " which these lines are.",
    )  # fmt: skip
    # Too few points to see paint are enough to see ground
    (tmp_path / "sparse").mkdir()
    write_las(
        Points(old.xyz[::400] + ORIGIN, intensity=old.intensity[::400]),
        tmp_path / "sparse" / "p.laz",
        crs=CRS,
    )
    sparse = linework(*call, "--overwrite", *both[:2], "--new-survey", tmp_path / "sparse")
    assert sparse.code == 0, sparse.stderr
    assert "too few points on the markings" in sparse.stderr
    alone = linework(*call, "--overwrite", *both[:2])
    assert (alone.code, alone.line) == (
        2, "error: the points of both surveys are compared. Give --new-survey too."
    )  # fmt: skip
