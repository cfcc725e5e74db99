"""Fields of LAS files that points carry as columns: written, and read back as they were."""

import laspy
import numpy as np
import pytest

from linework.errors import UsageError
from linework.files.las.write import write_las
from linework.files.store.in_memory import read_survey_points
from linework.files.survey.open import open_survey
from linework.model.points import Points

TOPS = {
    "classification": 255, "return_number": 15, "number_of_returns": 15, "user_data": 255, "point_source_id": 65_535,
    "scanner_channel": 3, "scan_direction_flag": 1, "edge_of_flight_line": 1,
}  # fmt: skip


def some_points(n=500, **columns):
    rng = np.random.default_rng(3)
    return Points(np.round(rng.uniform(0, 90, (n, 3)), 3), time_s=3e8 + np.arange(n) * 0.5, columns=columns)


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_fields_and_extra_dimensions_read_back(tmp_path, suffix):
    rng = np.random.default_rng(5)
    columns = {name: rng.integers(0, top + 1, 500).astype(np.float32) for name, top in TOPS.items()}
    # Points of noise classes are left out when read
    columns["classification"] = rng.integers(8, 16, 500).astype(np.float32)
    columns["scan_angle"] = rng.uniform(-180, 180, 500).astype(np.float32)
    columns["ring"], columns["p_paint"] = rng.integers(0, 128, 500), rng.random(500).astype(np.float32)
    path = tmp_path / f"a{suffix}"
    write_las(some_points(**columns), path, crs="local")
    by_laspy = laspy.read(path)
    assert tuple(by_laspy.point_format.extra_dimension_names) == ("ring", "p_paint")
    for name in TOPS:
        np.testing.assert_array_equal(np.asarray(by_laspy[name]), columns[name], err_msg=name)
    points = read_survey_points(open_survey([path], crs="local", carry=tuple(columns))).points
    points = points.take(np.argsort(points.time_s))
    for name, values in columns.items():
        within = 0.0031 if name == "scan_angle" else 0.0
        np.testing.assert_allclose(points[name], values, rtol=0, atol=within, err_msg=name)


def test_values_that_a_field_cannot_hold_are_refused(tmp_path):
    for name, value in (("scanner_channel", 4.0), ("return_number", np.nan), ("scan_angle", 181.0)):
        with pytest.raises(UsageError, match=f"column '{name}'"):
            write_las(some_points(9, **{name: np.full(9, value)}), tmp_path / "a.laz", crs="local")
    assert not (tmp_path / "a.laz").exists()
