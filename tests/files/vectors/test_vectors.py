"""Lines: our files come back as they were, and nothing is lost where a file cannot be written."""

import hashlib
import json
import sqlite3
import time
from dataclasses import fields
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pyogrio
import pytest
import shapely

from linework.crs import parse_crs
from linework.errors import CrsError, InputError, MachineError, OutputExistsError, UsageError
from linework.files.vectors.gpkg import verify_gpkg, write_gpkg
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.lines import LineSet

UTM = "EPSG:25832+7837"
LOSSLESS = (".gpkg", ".geojson")
LOSSY = (".dxf", ".fgb")


def sample(crs=UTM):
    rng = np.random.default_rng(0)
    lines = [np.cumsum(rng.random((n, 3)), 0) + np.array([5e5, 5.6e6, 100]) for n in (2, 5, 3, 40, 7)]
    return LineSet.from_lines(
        lines, crs=parse_crs(crs), kind=["cable", "guardrail", "cable", "lane_marking", "Weird kind"],
        id=["a", "b", "", "d'\"<é", "e"], double=[True, False, False, False, True],
        width_m=[0.1, np.nan, 0.2, 0.3, 0.4], clearance_m=[5.5, np.nan, 6, np.nan, np.nan],
        sigma_xy_m=rng.random(57), bridged=rng.random(57) < 0.3, confidence=[0.5, 0.6, 0.7, 0.8, 0.9],
    )  # fmt: skip


def assert_equal(a, b, leave_out=()):
    for f in fields(LineSet):
        if f.name in leave_out:
            continue
        x, y = getattr(a, f.name), getattr(b, f.name)
        if f.name == "crs":
            assert x == y
        else:
            np.testing.assert_array_equal(x, y, err_msg=f.name)


@pytest.mark.parametrize("suffix", LOSSLESS)
@pytest.mark.parametrize("crs", ["local", UTM, "EPSG:25832", "EPSG:2180"])
def test_round_trip(tmp_path, suffix, crs):
    path = tmp_path / f"lines{suffix}"
    write_lines(sample(crs), path)
    assert_equal(read_lines(path), sample(crs))
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("suffix", LOSSLESS)
@pytest.mark.parametrize(
    ("columns", "is_written"),
    [({}, False), ({"observed": np.arange(57) < 50}, True), ({"method": ["truth"] * 5}, True)],
)
def test_observed_is_written_for_truth_only_and_never_lost(tmp_path, suffix, columns, is_written):
    path, lines = tmp_path / f"lines{suffix}", sample().with_columns(**columns)
    write_lines(lines, path)
    assert_equal(read_lines(path), lines)
    if suffix == ".gpkg":
        assert ("observed" in pyogrio.read_info(path, layer="vertex")["fields"]) == is_written
    else:
        assert ("vertex_observed" in path.read_text()) == is_written


@pytest.mark.parametrize("suffix", LOSSY)
@pytest.mark.parametrize("crs", ["local", UTM])
def test_round_trip_without_vertex_columns(tmp_path, suffix, crs):
    path = tmp_path / f"lines{suffix}"
    write_lines(sample(crs), path)
    assert_equal(read_lines(path), sample(crs), ("sigma_xy_m", "sigma_z_m", "bridged", "observed"))


@pytest.mark.parametrize("suffix", [*LOSSLESS, *LOSSY])
def test_no_lines_keep_crs_and_layers(tmp_path, suffix):
    path = tmp_path / f"lines{suffix}"
    write_lines(LineSet.empty(parse_crs(UTM)), path, kinds=["guardrail", "cable"])
    back = read_lines(path)
    assert len(back) == 0
    assert back.crs == parse_crs(UTM)


@pytest.mark.parametrize("suffix", [*LOSSLESS, *LOSSY, ".kml"])
def test_equal_lines_give_equal_bytes(tmp_path, suffix):
    hashes = set()
    for name in ("a", "b"):
        path = tmp_path / name / f"lines{suffix}"
        write_lines(sample(), path)
        hashes.add(hashlib.sha256(path.read_bytes()).hexdigest())
        time.sleep(1.01 if name == "a" else 0)  # GeoPackage and DXF would hold the second
    assert len(hashes) == 1


def test_geopackage_is_as_the_manual_says(tmp_path):
    path = tmp_path / "lines.gpkg"
    write_lines(sample(), path, kinds=["fence"])
    layers = {str(n): g for n, g in pyogrio.list_layers(path)}
    assert list(layers) == ["lane_marking", "guardrail", "fence", "cable", "line", "vertex", "layer_styles"]
    assert layers["fence"] == "LineString Z"
    names = pyogrio.read_info(path, layer="fence")["fields"].tolist()
    assert names == [
        "id", "kind", "role", "pattern", "double", "form", "width_m", "height_m", "length_m", "confidence",
        "sigma_xy_m", "sigma_z_m", "bridged_m", "method", "source", "time_start_s", "time_end_s",
    ]  # fmt: skip
    info = pyogrio.read_info(path, layer="cable")
    assert info["fields"][-1] == "clearance_m"
    assert info["features"] == 2
    with sqlite3.connect(path) as db:
        assert db.execute("PRAGMA user_version").fetchone()[0] == 10200
        assert db.execute("SELECT count(*) FROM layer_styles WHERE useAsDefault").fetchone()[0] == 5
        length, sigma = db.execute("SELECT length_m, sigma_xy_m FROM guardrail").fetchone()
        rows = db.execute("SELECT layer, line_fid, vertex, bridged FROM vertex WHERE line = 2").fetchall()
        assert db.execute("SELECT count(*) FROM gpkg_geometry_columns WHERE z = 1").fetchone()[0] == 5
    db.close()
    lines = sample()
    assert length == pytest.approx(lines.length_m[1], abs=1e-4)
    assert sigma == pytest.approx(np.sqrt(np.mean(lines.sigma_xy_m[2:7] ** 2)), abs=1e-4)
    assert rows == [("cable", 2, i, int(lines.bridged[7 + i])) for i in range(3)]
    crs = pyogrio.read_info(path, layer="cable")["crs"]
    assert parse_crs(crs) == parse_crs(UTM)


def test_geopackage_can_be_edited_by_gdal(tmp_path, recwarn):
    path = tmp_path / "lines.gpkg"
    write_lines(sample(), path)
    shape = shapely.to_wkb(shapely.LineString([[5e5, 5.6e6, 1], [5e5 + 9, 5.6e6, 2]]), flavor="iso")
    pyogrio.raw.write(path, np.array([shape]), [np.array(["new"])], ["id"], layer="cable", driver="GPKG",
                      geometry_type="LineString Z", append=True, crs=sample().crs)  # fmt: skip
    assert [str(w.message) for w in recwarn] == []
    with sqlite3.connect(path) as db:
        assert db.execute("PRAGMA integrity_check").fetchone()[0] == "ok"
        assert db.execute("SELECT count(*) FROM rtree_cable_geom").fetchone()[0] == 3
    db.close()
    lines = read_lines(path)
    assert len(lines) == 6
    assert "new" in lines.id.tolist()
    box = (5e5 - 1, 5.6e6 - 1, 5e5 + 10, 5.6e6 + 1)
    assert "new" in pyogrio.raw.read(path, layer="cable", bbox=box)[3][0].tolist()


def test_geopackage_whose_index_is_missing_does_not_verify(tmp_path):
    part = tmp_path / "p.gpkg"
    write_gpkg(sample(), part)
    verify_gpkg(part, sample(), part)
    with sqlite3.connect(part) as db:
        db.execute("DELETE FROM rtree_cable_geom WHERE id = 1")
    db.close()
    with pytest.raises(MachineError, match="layer cable has 2 features, 1 in its index"):
        verify_gpkg(part, sample(), part)


@pytest.mark.parametrize("damage", ["cut", "zeros", "journal", "other"])
def test_damaged_geopackage_does_not_verify(tmp_path, damage):
    part = tmp_path / "p.gpkg"
    write_gpkg(sample(), part)
    data = part.read_bytes()
    expected = sample()
    if damage == "cut":
        part.write_bytes(data[: len(data) // 2])
    elif damage == "zeros":
        part.write_bytes(data[: len(data) // 2] + bytes(len(data) - len(data) // 2))
    elif damage == "journal":
        (tmp_path / "p.gpkg-journal").write_bytes(b"x")
    else:
        expected = LineSet.from_lines(
            [expected[0].xyz + 1, *(line.xyz for line in expected[1:5])], crs=expected.crs
        )
    with pytest.raises(MachineError, match="does not verify"):
        verify_gpkg(part, expected, part)


def test_lines_edited_in_another_program_are_read_without_the_vertex_table(tmp_path):
    path = tmp_path / "lines.gpkg"
    write_lines(sample(), path)
    with sqlite3.connect(path) as db:
        db.create_function("ST_IsEmpty", 1, lambda _: 0)
        for name in ("ST_MinX", "ST_MaxX", "ST_MinY", "ST_MaxY"):
            db.create_function(name, 1, lambda _: 0.0)
        db.execute("DELETE FROM cable WHERE fid = 1")
    db.close()
    back = read_lines(path)
    assert sorted(back.kind.tolist()) == ["Weird kind", "cable", "guardrail", "lane_marking"]
    assert np.isnan(back.sigma_xy_m).all()


def test_geojson_has_the_crs_gdal_reads(tmp_path):
    path = tmp_path / "lines.geojson"
    write_lines(sample(), path)
    info = pyogrio.read_info(path)
    assert parse_crs(info["crs"]) == parse_crs(UTM)
    assert info["features"] == 5
    document = json.loads(path.read_text())
    properties = document["features"][1]["properties"]
    assert len(properties["vertex_sigma_xy_m"]) == 5
    assert properties["width_m"] is None
    write_lines(sample("local"), tmp_path / "local.geojson")
    assert pyogrio.read_info(tmp_path / "local.geojson")["crs"].startswith('LOCAL_CS["local"')


def test_dxf_has_layers_colours_and_a_crs_beside_it(tmp_path):
    path = tmp_path / "lines.dxf"
    write_lines(sample(), path, kinds=["fence"])
    document = ezdxf.readfile(path)
    assert {"cable", "guardrail", "fence"} <= {layer.dxf.name for layer in document.layers}
    polylines = document.modelspace().query("POLYLINE")
    assert [p.dxf.layer for p in polylines] == ["cable", "guardrail", "cable", "lane_marking", "line"]
    assert document.units == 6
    assert not document.audit().errors
    assert "ETRS" in path.with_suffix(".prj").read_text()
    with pytest.raises(OutputExistsError):
        write_lines(sample(), path)


def test_dxf_has_a_layer_per_pattern_of_paint(tmp_path):
    path = tmp_path / "lines.dxf"
    lines = sample().with_columns(kind=["lane_marking"] * 3 + ["lane_marking_dash", "cable"],
                                  pattern=["solid", "dashed", "", "dashed", ""])  # fmt: skip
    write_lines(lines, path)
    document = ezdxf.readfile(path)
    polylines = document.modelspace().query("POLYLINE")
    names = ["lane_marking_solid", "lane_marking_dashed", "lane_marking", "lane_marking_dash_dashed", "cable"]
    assert [p.dxf.layer for p in polylines] == names and all(p.is_3d_polyline for p in polylines)
    assert document.layers.get("lane_marking_dashed").dxf.linetype == "LINEWORK_DASHED"
    assert document.layers.get("lane_marking_solid").rgb == document.layers.get("lane_marking_dashed").rgb
    assert read_lines(path).kind.tolist() == lines.kind.tolist()
    assert not document.audit().errors


def test_dxf_does_not_replace_a_foreign_prj(tmp_path):
    (tmp_path / "lines.prj").write_text("mine")
    with pytest.raises(OutputExistsError, match=r"lines\.prj"):
        write_lines(sample(), tmp_path / "lines.dxf")
    assert not (tmp_path / "lines.dxf").exists()


def test_kml_is_degrees(tmp_path):
    path = tmp_path / "lines.kml"
    write_lines(sample(), path)
    texts = [e.text for e in ElementTree.parse(path).iter("{http://www.opengis.net/kml/2.2}coordinates")]
    assert len(texts) == 5
    lon, lat, height = (float(v) for v in texts[0].split()[0].split(","))
    assert 8.9 < lon < 9.1
    assert 50.5 < lat < 50.6
    assert height > 100
    with pytest.raises(CrsError, match=rf"{path.name}: KML needs georeferenced lines"):
        write_lines(sample("local"), path, overwrite=True)


@pytest.mark.parametrize(
    ("lines", "name", "words"),
    [
        (sample(), "a.txt", "cannot write '.txt' files"),
        (
            LineSet.from_lines([np.full((2, 3), np.nan)]),
            "a.gpkg",
            "line 0 has a coordinate that is not finite",
        ),
        (LineSet.from_lines([np.zeros((2, 3)), np.zeros((1, 3))]), "a.gpkg", "line 1 has 1 vertices"),
    ],
)
def test_lines_that_cannot_be_written(tmp_path, lines, name, words):
    with pytest.raises(UsageError) as caught:
        write_lines(lines, tmp_path / name)
    assert words in str(caught.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["a.gpkg", "a.fgb"])
def test_cut_files(tmp_path, name):
    path = tmp_path / name
    write_lines(sample(), path)
    path.write_bytes(path.read_bytes()[:700])
    with pytest.raises(InputError) as caught:
        read_lines(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert caught.value.advice


@pytest.mark.parametrize(
    "name", ["sp ace.gpkg", "ünï.gpkg", "#?%;.gpkg", "-x.gpkg", "new\nline.gpkg", "a'b\"c.gpkg"]
)
def test_odd_names(tmp_path, name):
    write_lines(sample(), tmp_path / name)
    assert [p.name for p in tmp_path.iterdir()] == [name]
    if name.isprintable():
        assert_equal(read_lines(tmp_path / name), sample())
    else:  # GDAL would look for another file
        with pytest.raises(InputError, match="control characters in the name"):
            read_lines(tmp_path / name)
