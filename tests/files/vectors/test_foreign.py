"""Lines of others' files are read with care: odd geometries, formats in disguise, missing CRSs."""

import contextlib
import json
import sqlite3
import subprocess
import sys

import numpy as np
import pyogrio
import pytest
import shapely
from tests.scenes.drawing_scenes import some_lines

from linework.crs import parse_crs
from linework.errors import CrsError, InputError, LineworkWarning, UsageError
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.lines import LineSet

UTM = "EPSG:25832+7837"


def collection(*features, **members):
    return json.dumps({"type": "FeatureCollection", "features": features} | members)


def feature(kind, coordinates, **properties):
    return {
        "type": "Feature",
        "properties": properties,
        "geometry": {"type": kind, "coordinates": coordinates},
    }


LINE = [[500.0, 0, 1], [510, 0, 2]]
SQUARE = [[0, 0], [500, 0], [500, 500], [0, 0]]


def written(tmp_path, text, name="a.geojson"):
    path = tmp_path / name
    path.write_text(text)
    return path


def test_foreign_geometries_become_lines(tmp_path):
    path = written(tmp_path, collection(
        feature("MultiLineString", [LINE, LINE], mark="solid"),
        feature("Polygon", [SQUARE, SQUARE], mark="edge"),
        feature("Point", [1000, 1000], mark="solid"),
        {"type": "Feature", "properties": None, "geometry": None},
        feature("LineString", LINE, mark=7),
    ))  # fmt: skip
    lines = read_lines(path, kind_field="mark")
    assert lines.kind.tolist() == ["solid", "solid", "edge", "edge", "7"]
    assert np.isnan(lines[2].xyz[:, 2]).all()
    np.testing.assert_array_equal(lines[4].xyz, LINE)
    assert lines.crs == "local"
    mapped = read_lines(path, kind_field="mark", kinds={"edge": "road_boundary"})
    assert mapped.kind.tolist() == ["road_boundary", "road_boundary"]
    assert read_lines(path).kind.tolist() == ["a"] * 5


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("", InputError, "empty file"),
        ("<html>", InputError, "is not JSON"),
        ("[" * 100_000, InputError, "nested too deeply"),
        ('{"a": 1}', InputError, "not GeoJSON"),
        ('{"type": "FeatureCollection", "features": 3}', InputError, "features is not a list"),
        (collection(feature("LineString", [["x", 0], [1, 1]])), InputError, "feature 1: vertex 1 is not two"),
        (collection(feature("LineString", 5)), InputError, "feature 1: vertex 1 is not two"),
        (collection(feature("Blob", LINE)), InputError, "feature 1: an invalid geometry"),
        (collection(feature("LineString", [[1e999, 0], [500, 1]])), InputError, "finite numbers"),
        (collection(feature("LineString", [[9, 50], [9.1, 50]])), CrsError, "degrees"),
        (collection(feature("LineString", LINE), crs={"properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}),
         CrsError, "degrees"),
        (collection(feature("LineString", LINE), crs={"properties": {"name": "http://127.0.0.1:1/crs"}}),
         CrsError, "not a CRS"),
    ],
)  # fmt: skip
def test_foreign_geojson_that_is_refused(tmp_path, text, error, words):
    path = written(tmp_path, text)
    with pytest.raises(error) as caught:
        read_lines(path)
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"{path}: ")
    assert caught.value.advice


def test_small_local_coordinates_are_read_when_said_to_be_local(tmp_path):
    path = written(tmp_path, collection(feature("LineString", [[9, 50], [9.1, 50]])))
    assert read_lines(path, crs="local").crs == "local"
    assert read_lines(path, crs=UTM).crs == parse_crs(UTM)


VRT = """<OGRVRTDataSource><OGRVRTLayer name="x"><SrcDataSource>{}</SrcDataSource></OGRVRTLayer></OGRVRTDataSource>"""


@pytest.mark.parametrize("name", ["a.gpkg", "a.fgb", "a.shp", "a.geojson", "a.json", "a.dxf"])
def test_disguised_files_are_refused(tmp_path, name):
    secret = tmp_path / "secret.geojson"
    secret.write_text(collection(feature("LineString", LINE)))
    path = written(tmp_path, VRT.format(secret), name)
    with pytest.raises(InputError) as caught:
        read_lines(path)
    assert str(caught.value).startswith(f"{path}: ")


@pytest.mark.parametrize("name", ["a.vrt", "a.gpx", "a.gml", "a.tab", "a"])
def test_other_formats_are_refused(tmp_path, name):
    with pytest.raises(UsageError, match="cannot read lines"):
        read_lines(written(tmp_path, "x", name))


def test_gdal_lacks_the_drivers_that_read_other_files():
    # In a process of its own: other tests may have imported pyogrio before
    code = (
        "import os, linework.files.vectors.read_write, linework.files.images.geotiff, pyogrio\n"
        "from linework.files.vectors.gdal_input import FORBIDDEN_DRIVERS as forbidden\n"
        "print(sorted(set(forbidden) & set(pyogrio.list_drivers())), os.environ.get('OGR_SKIP'))\n"
        "print(sorted({'GPKG', 'FlatGeobuf', 'ESRI Shapefile'} - set(pyogrio.list_drivers())))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[] None\n[]\n"
    assert done.stderr == ""


def foreign_gpkg(path, crs, layer="kerbs", **options):
    shapes = shapely.to_wkb(shapely.linestrings([[[0, 0], [9, 9]], [[1, 1], [5, 5]]]))
    pyogrio.raw.write(path, shapes, [np.array(["x", None], dtype=object)], ["mark"], layer=layer, driver="GPKG",
                      geometry_type="LineString", crs=crs, **options)  # fmt: skip


def test_foreign_geopackage(tmp_path):
    path = tmp_path / "a.gpkg"
    foreign_gpkg(path, "EPSG:25832")
    foreign_gpkg(path, "EPSG:25832", "walls", append=True)
    lines = read_lines(path)
    assert lines.kind.tolist() == ["kerbs", "kerbs", "walls", "walls"]
    assert lines.crs == parse_crs("EPSG:25832")
    assert read_lines(path, kinds={"walls": "barrier"}).kind.tolist() == ["barrier", "barrier"]
    assert read_lines(path, kind_field="mark", kinds={"x": "fence"}).kind.tolist() == ["fence", "fence"]


def test_foreign_geopackage_in_degrees_or_in_two_crss(tmp_path):
    foreign_gpkg(tmp_path / "a.gpkg", "EPSG:4326")
    with pytest.raises(CrsError, match="degrees"):
        read_lines(tmp_path / "a.gpkg")
    foreign_gpkg(tmp_path / "b.gpkg", "EPSG:25832")
    foreign_gpkg(tmp_path / "b.gpkg", "EPSG:25833", "walls", append=True)
    with pytest.raises(CrsError, match="different CRSs"):
        read_lines(tmp_path / "b.gpkg")


def shapefile(folder, n=6):
    shapes = shapely.to_wkb(shapely.linestrings([[[i, 0], [i, 9], [i + 3, 9]] for i in range(n)]))
    marks = np.array([f"mark {i}" for i in range(n)], dtype=object)
    pyogrio.raw.write(folder / "a.shp", shapes, [marks], ["mark"], driver="ESRI Shapefile", geometry_type="LineString",
                      crs="EPSG:25832")  # fmt: skip
    return folder / "a.shp"


def test_features_whose_geometry_cannot_be_read_are_counted(tmp_path):
    path = shapefile(tmp_path)
    data = bytearray(path.read_bytes())
    # The second record, 104 bytes behind the first, says that it is of no type
    data[100 + 104 + 8] = 0
    path.write_bytes(data)
    with pytest.warns(LineworkWarning, match="left out feature 1 of layer a: no geometry can be read"):
        assert len(read_lines(path)) == 5


def test_of_a_shapefile_that_is_cut_off_the_rest_is_left_out_by_number(tmp_path):
    path = shapefile(tmp_path)
    path.write_bytes(path.read_bytes()[:300])
    with pytest.warns(LineworkWarning, match=r"left out feature 1 of layer a: .* and 4 other features"):
        assert len(read_lines(path)) == 1


def test_texts_of_a_shapefile_that_are_not_text_are_one_line(tmp_path):
    suffix, old, new = ".dbf", b"mark 3", b"\xa7\xff\xfe\x80 3"
    path = shapefile(tmp_path)
    beside = path.with_suffix(suffix)
    assert old in beside.read_bytes()
    beside.write_bytes(beside.read_bytes().replace(old, new))
    with pytest.raises((InputError, CrsError)) as caught:
        read_lines(path)
    assert str(caught.value).startswith(f"{path}: ") and len(str(caught.value)) - len(str(path)) < 290


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: data.replace(b"\n 10\n", b"\n 10\n9" + b"9" * 400, 1),
        lambda data: data[:14791] + b"\x07" * 54 + data[14791:],
        lambda data: data[:6600] + bytes(4096) + data[10696:],
    ],
)
def test_a_damaged_drawing_is_lines_or_one_line(tmp_path, damage):
    path = tmp_path / "a.dxf"
    write_lines(some_lines(), path)
    path.write_bytes(damage(path.read_bytes()))
    try:
        read_lines(path)
    except InputError as error:
        assert str(error).startswith(f"{path}: is not a DXF file") and "\n" not in str(error)


@pytest.mark.parametrize("count", [-1, 0, 1, 99])
def test_features_are_counted_whatever_a_table_says(tmp_path, count):
    foreign_gpkg(tmp_path / "a.gpkg", "EPSG:25832")
    with contextlib.closing(sqlite3.connect(tmp_path / "a.gpkg")) as db:
        db.execute("UPDATE gpkg_ogr_contents SET feature_count = ?", (count,))
        db.commit()
    assert len(read_lines(tmp_path / "a.gpkg")) == 2


def test_a_shapefile_whose_index_says_another_number_is_refused(tmp_path):
    path = shapefile(tmp_path)
    index = bytearray(path.with_suffix(".shx").read_bytes())
    # Length of the file in words of two bytes: of three records instead of six
    index[24:28] = (50 + 3 * 4).to_bytes(4, "big")
    path.with_suffix(".shx").write_bytes(index)
    with pytest.raises(InputError, match=r"its index has 6 records and says 3 "):
        read_lines(path)


def test_a_geopackage_whose_schema_is_not_text_is_one_line(tmp_path):
    foreign_gpkg(tmp_path / "a.gpkg", "EPSG:25832")
    data = (tmp_path / "a.gpkg").read_bytes()
    assert b"CREATE TABLE gpkg_contents" in data
    (tmp_path / "a.gpkg").write_bytes(
        data.replace(b"CREATE TABLE gpkg_contents", b"CREATE TABLE gpkg_c\xe8\xffte\xffts")
    )
    with pytest.raises(InputError, match=r"a\.gpkg: cannot be read \(.*Copy the file again"):
        read_lines(tmp_path / "a.gpkg")


@pytest.mark.parametrize("path", [None, 3.5, []])
def test_what_is_no_path_is_said_in_one_line(path):
    with pytest.raises(UsageError, match=r"^path: .* is not a path\. Name a file of lines\.$"):
        read_lines(path)
    with pytest.raises(UsageError, match="is not a path"):
        write_lines(LineSet.empty(), path)
