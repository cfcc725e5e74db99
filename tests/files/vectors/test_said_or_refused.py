"""Vector files that lose something on the way: refused, or said, and never read as if they were whole."""

import json
import sqlite3
import warnings

import numpy as np
import pytest

import linework
from linework.errors import CrsError, InputError, LineworkWarning, UsageError
from linework.model.lines import LineSet

CORNER = np.array([500_000.0, 5_400_000.0, 100.0])


@pytest.fixture
def lines():
    rng = np.random.default_rng(1)
    parts = [np.cumsum(rng.uniform(0.5, 1.5, (60, 3)), axis=0) + CORNER for _ in range(30)]
    return LineSet.from_lines(parts, kind=["guardrail"] * 30, crs="EPSG:25832")


def collection(*geometries, **more):
    features = [{"type": "Feature", "properties": {"kind": "cable"}, "geometry": g} for g in geometries]
    return json.dumps({"type": "FeatureCollection", "features": features, **more})


LINE = {"type": "LineString", "coordinates": [[0, 0, 1], [5, 0, 1]]}
POINT = {"type": "Point", "coordinates": [1, 2, 3]}
RING = {"type": "MultiPoint", "coordinates": [[1, 2, 3], [2, 2, 3]]}


def test_a_file_of_points_has_no_lines(tmp_path):
    (tmp_path / "p.geojson").write_text(collection(POINT, POINT, None))
    with pytest.raises(InputError, match="no lines in it: its features are 2 Point, 1 nothing"):
        linework.read_lines(tmp_path / "p.geojson", crs="local")


def test_what_is_no_line_beside_lines_is_said(tmp_path):
    (tmp_path / "m.geojson").write_text(collection(LINE, RING))
    with pytest.warns(LineworkWarning, match="left out feature 2: a MultiPoint is no line"):
        assert len(linework.read_lines(tmp_path / "m.geojson", crs="local")) == 1


def test_lines_without_heights_are_named(tmp_path):
    (tmp_path / "flat.geojson").write_text(
        collection({"type": "LineString", "coordinates": [[0, 0], [5, 0]]})
    )
    flat = linework.read_lines(tmp_path / "flat.geojson", crs="local")
    with pytest.raises(UsageError, match="line 0 has a vertex without a height"):
        linework.write_lines(flat, tmp_path / "out.gpkg")


def test_two_crss_in_one_file_are_refused(tmp_path, lines):
    linework.write_lines(lines, tmp_path / "own.geojson")
    document = json.loads((tmp_path / "own.geojson").read_text())
    assert len(linework.read_lines(tmp_path / "own.geojson")) == 30
    document["crs"]["properties"]["name"] = "urn:ogc:def:crs:EPSG::25833"
    (tmp_path / "two.geojson").write_text(json.dumps(document))
    with pytest.raises(CrsError, match="names two CRSs: crs is EPSG:25833, crs_wkt is EPSG:25832"):
        linework.read_lines(tmp_path / "two.geojson")


def test_a_damaged_geopackage_is_not_read_as_if_it_were_whole(tmp_path, lines):
    """GDAL reads on at the next sound page, and says nothing."""
    path = tmp_path / "lines.gpkg"
    linework.write_lines(lines, path)
    whole = path.read_bytes()
    n_refused = 0
    for at in range(4096, len(whole) - 3000, 4096):
        path.write_bytes(whole[: at + 500] + bytes(3000) + whole[at + 3500 :])
        with sqlite3.connect(path) as db, warnings.catch_warnings():
            warnings.simplefilter("ignore", LineworkWarning)
            try:
                is_sound = db.execute("PRAGMA integrity_check(1)").fetchone() == ("ok",)
            except sqlite3.DatabaseError:
                is_sound = False
            try:
                found = linework.read_lines(path)
            except InputError:
                n_refused += 1
                continue
        db.close()
        assert is_sound
        assert found.crs == lines.crs
    assert n_refused > 3


@pytest.mark.parametrize("name", [" lead.gpkg", "trail .gpkg", " d/a.gpkg"])
def test_names_that_begin_with_a_space(tmp_path, lines, name, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / " d").mkdir()
    linework.write_lines(lines, name)
    assert linework.read_lines(name) == lines
