"""Points as users make them: columns, CRS, and what is refused."""

from __future__ import annotations

import copy
import pickle
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pyproj
import pytest

from linework.errors import CrsError
from linework.model.points import Points

XYZ = np.arange(12.0).reshape(4, 3)


def four(**columns: object) -> Points:
    """Return four points with intensity, times and a further column."""
    return Points(
        XYZ, intensity=[1, 2, 3, 4], time_s=np.arange(4.0), p_paint=[0.0, 0.5, 1.0, np.nan], **columns
    )


def test_further_columns_are_float32_and_read_only():
    points = four(label=np.array([0, 1, 2, 255], np.uint8), crs=25832)
    assert list(points.columns) == ["p_paint", "label"]
    assert points["label"].dtype == np.float32
    assert points["label"].tolist() == [0, 1, 2, 255]
    assert points["xyz"] is points.xyz
    assert points["time_s"] is points.time_s
    assert list(points.by_name()) == ["xyz", "intensity", "time_s", "p_paint", "label"]
    with pytest.raises(ValueError, match="read-only"):
        points.columns["p_paint"][0] = 1.0
    with pytest.raises(TypeError):
        points.columns["p_paint"] = points["label"]  # type: ignore[index]
    with pytest.raises(FrozenInstanceError):
        points.crs = "local"  # type: ignore[misc]


def test_columns_may_be_a_mapping_for_names_that_are_not_python_words():
    points = Points(XYZ, columns={"Range deviation": [1, 2, 3, 4]}, label=[0, 0, 1, 1])
    assert list(points.columns) == ["label", "Range deviation"]


def test_take_and_concatenate_keep_columns_and_crs():
    points = four(crs="EPSG:25832")
    some = points.take([3, 0])
    assert some.crs == "EPSG:25832"
    assert some["p_paint"][1] == 0.0
    assert (
        Points.concatenate([points.take(slice(0, 1)), points.take(np.array([False, True, True, True]))])
        == points
    )
    assert Points.concatenate([points, Points(XYZ, crs="EPSG:25832")]).columns == {}
    assert Points.concatenate([Points.empty(), points]).crs == "EPSG:25832"
    assert len(Points.concatenate([])) == 0
    with pytest.raises(ValueError, match="2 CRSs, the first two 'EPSG:25832' and 'local'"):
        Points.concatenate([points, four()])


def test_copies_are_equal():
    points = four(crs=25832)
    for other in (pickle.loads(pickle.dumps(points)), copy.deepcopy(points), replace(points)):
        assert other == points
        assert other["p_paint"].flags.writeable is False
    assert replace(points, intensity=None).columns.keys() == {"p_paint"}
    assert points != replace(points, crs="local")
    assert points != replace(points, intensity=None)
    assert points != replace(points, columns={"p_paint": [0.0, 0.5, 1.0, 2.0]})
    assert points != "points"


@pytest.mark.parametrize(
    ("crs", "text"),
    [
        (25832, "EPSG:25832"),
        (np.int64(25832), "EPSG:25832"),
        (" EPSG:25832+7837 ", "EPSG:25832+7837"),
        (pyproj.CRS(25832), pyproj.CRS(25832).to_wkt("WKT2_2019")),
    ],
)
def test_crs_is_kept_as_text(crs: object, text: str):
    assert Points(XYZ, crs=crs).crs == text


@pytest.mark.parametrize("crs", [None, "", " ", True, 25832.0, ("EPSG", 25832)])
def test_what_is_no_crs_is_refused(crs: object):
    with pytest.raises(CrsError, match=r"crs: .* is not a CRS"):
        Points(XYZ, crs=crs)


def test_wrong_columns_are_refused_by_name():
    with pytest.raises(ValueError, match=r"xyz: shape \(3, 4\), expected \(n, 3\)"):
        Points(XYZ.T)
    with pytest.raises(ValueError, match=r"intensity: shape \(3,\), expected \(4\)"):
        Points(XYZ, intensity=[1, 2, 3])
    with pytest.raises(ValueError, match=r"p_paint: shape \(4, 1\), expected \(4\)"):
        Points(XYZ, p_paint=np.zeros((4, 1)))
    with pytest.raises(ValueError, match="p_paint: expected numbers"):
        Points(XYZ, p_paint=["a", "b", "c", "d"])
    with pytest.raises(ValueError, match="xyz: expected numbers"):
        Points("a")
    with pytest.raises(ValueError, match="columns: 'xyz' cannot be the name"):
        Points(XYZ, columns={"xyz": XYZ})
    with pytest.raises(TypeError, match="columns: expected a mapping"):
        Points(XYZ, columns=[1, 2, 3, 4])
    with pytest.raises(TypeError):
        Points(XYZ, [1, 2, 3, 4])  # type: ignore[misc]
    with pytest.raises(KeyError, match="no column 'p' in points with xyz, intensity, time_s, p_paint"):
        four()["p"]


def test_repr_is_one_short_line():
    points = four(crs=pyproj.CRS("EPSG:25832+7837"))
    assert "\n" not in repr(points)
    assert len(repr(points)) < 200
    assert repr(points).startswith(
        "Points(n=4, 9.0 x 9.0 m from 0.0, 1.0, columns xyz intensity time_s p_paint"
    )
    assert repr(Points.empty()) == "Points(n=0, columns xyz, crs local)"
