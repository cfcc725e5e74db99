"""Points from arrays in the tile store: what is kept, scaled, refused and counted as for files."""

import numpy as np
import pytest

from linework.errors import CrsError, UsageError
from linework.files.las.write import write_las
from linework.files.store.build import build_store
from linework.files.store.from_points import store_points
from linework.files.store.read import PointStore
from linework.files.survey.open import open_survey
from linework.model.points import Points

UTM = "EPSG:25832+7837"


def some(n=3000, *, seed=1, **columns):
    rng = np.random.default_rng(seed)
    xyz = np.round(rng.uniform(0, 150, (n, 3)) + np.array([500_000, 5_400_000, 100]), 3)
    known = {"intensity": rng.integers(1, 4000, n), "time_s": 3e8 + np.arange(n) * 0.01, "crs": UTM}
    return Points(xyz, **(known | columns))


def stored(points, folder, **options):
    folder.mkdir()
    facts = store_points(points, folder, **options)
    return facts, PointStore.open(folder).points()


def test_arrays_and_a_file_of_them_have_equal_stores(tmp_path):
    points = some()
    write_las(points, tmp_path / "a.laz", crs=UTM)
    (tmp_path / "files").mkdir()
    of_file = build_store(open_survey([tmp_path / "a.laz"]), tmp_path / "files", n_threads=1)
    facts, found = stored(points, tmp_path / "arrays", name="a.laz")
    assert found == PointStore.open(tmp_path / "files").points()
    assert found.crs == of_file.crs == facts.crs
    for name in (
        "n_points",
        "bounds",
        "rejected",
        "gps_time_kind",
        "has_intensity",
        "has_time",
        "in_time_order",
        "times",
    ):
        assert getattr(facts, name) == getattr(of_file, name), name
    assert facts.files[0].bounds == of_file.files[0].bounds


def test_batches_and_order_do_not_matter(tmp_path):
    points = some(p_paint=np.random.default_rng(3).random(3000), label=np.arange(3000) % 7)
    mixed = points.take(np.random.default_rng(2).permutation(3000))
    _, one = stored(points, tmp_path / "one")
    progress = []
    facts, many = stored(mixed, tmp_path / "many", batch_points=700, progress=lambda *n: progress.append(n))
    assert one == many
    assert facts.columns == ("label", "p_paint") == tuple(one.columns)
    assert np.array_equal(np.sort(one["p_paint"]), np.sort(points["p_paint"]))
    assert progress == [(700, 3000), (1400, 3000), (2100, 3000), (2800, 3000), (3000, 3000)]
    assert not facts.in_time_order


@pytest.mark.parametrize(
    ("given", "kept", "text"),
    [
        ([0, 1, 255, 65535], [0, 1, 255, 65535], ""),
        ([0.0, 0.25, 0.5, 1.0], [0, 16384, 32768, 65535], "from 0 to 1 are not whole numbers"),
        ([0, 1000, 65536, 131070], [0, 500, 32768, 65535], "0 to 131070 became 0 to 65,535"),
        ([-10, 0, 0, 10], [0, 32768, 32768, 65535], "-10 to 10 became"),
        ([0, 0, 0.25, 65535], [0, 0, 0, 65535], "not whole numbers"),
        ([-5, -5, -5, -5], [0, 0, 0, 0], "-5 to 0 became"),
        ([0, 0, 0, 0], None, "no intensity (0 for all points)"),
        (None, None, ""),
    ],
)
def test_intensities_have_16_bits(tmp_path, given, kept, text):
    points = Points(np.arange(12.0).reshape(4, 3), intensity=given)
    facts, found = stored(points, tmp_path / "s", name="scan")
    assert (None if found.intensity is None else found.intensity.tolist()) == kept
    assert [text in warning and warning.startswith("scan: ") for warning in facts.warnings] == (
        [True] if text else []
    )


def test_strays_are_left_out_and_counted(tmp_path):
    points = some()
    xyz = points.xyz.copy()
    xyz[7] += [0.0, 1e6, 0.0]
    facts, found = stored(Points(xyz, crs=UTM), tmp_path / "s")
    assert len(found) == 2999
    assert facts.rejected == {"far from all others": 1}
    assert facts.warnings[-1] == "1 points far from all others left out"


def test_points_given_twice_are_reported(tmp_path):
    facts, _ = stored(Points.concatenate([some(), some()]), tmp_path / "s")
    assert facts.warnings == (
        "points: about 50% of the points repeat others (same place, time and intensity)",
    )


def test_times_that_are_all_0_are_none(tmp_path):
    facts, found = stored(some(time_s=np.zeros(3000)), tmp_path / "s")
    assert found.time_s is None
    assert (facts.has_time, facts.gps_time_kind) == (False, "none")
    assert facts.warnings == ("points: no times (0 for all points)",)


def with_value(name, value):
    columns = {key: column.copy() for key, column in some().by_name().items()}
    columns[name][5] = value
    return Points(columns.pop("xyz"), **columns, crs=UTM)


@pytest.mark.parametrize(
    ("points", "error", "text"),
    [
        (Points.empty(), UsageError, "points: no points"),
        (with_value("xyz", np.nan), UsageError, r"xyz: 1 of 3,000 points have NaN or infinity there\. Leave them out"),
        (with_value("xyz", -np.inf), UsageError, r"isfinite\(points\.xyz\)\.all\(axis=1\)"),
        (with_value("xyz", -2e8), UsageError, "xyz: 1 of 3,000 points have coordinates of 1e8 m or more"),
        (with_value("time_s", np.nan), UsageError, "time_s: 1 of 3,000 points have NaN"),
        (with_value("intensity", np.inf), UsageError, "intensity: 1 of 3,000 points have NaN"),
        (with_value("time_s", 1.7e12), UsageError, "time_s: times from 3e.08 to 1.7e.12 are not seconds"),
        (Points([[0, 0, 0]], crs="EPSG:4326"), CrsError, r"crs: .*\(degrees\)"),
        (Points([[0, 0, 0]], crs="EPSG:2263"), CrsError, "crs: lengths in units of 0.3048"),
        (Points([[0, 0, 0]], crs="UTM"), CrsError, "crs: 'UTM' is not a CRS"),
    ],
)  # fmt: skip
def test_what_cannot_be_used_is_refused_by_name(tmp_path, points, error, text):
    with pytest.raises(error, match=text):
        stored(points, tmp_path / "s")
    assert list((tmp_path / "s").iterdir()) == []


def test_degrees_are_refused_whatever_the_crs(tmp_path):
    rng = np.random.default_rng(4)
    xyz = rng.uniform([8.60, 49.40, 100.0], [8.602, 49.401, 130.0], (5000, 3))
    with pytest.raises(CrsError, match=r"scan: coordinates are geographic \(degrees\)"):
        stored(Points(xyz, crs=UTM), tmp_path / "s", name="scan")
