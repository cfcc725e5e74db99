"""Lines go to shapely, GeoPandas and Arrow and come back with nothing lost."""

import subprocess
import sys

import duckdb
import geopandas
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
import shapely
from hypothesis import given, settings
from tests.scenes.drawing_scenes import some_lines
from tests.scenes.effort import examples
from tests.scenes.line_sets import line_sets

from linework.errors import CrsError, InputError, LineworkWarning, MissingPackageError, needed
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet

ODD = settings(max_examples=examples(60), deadline=None)


def columns_of(lines: LineSet) -> dict[str, np.ndarray]:
    return {name: getattr(lines, name) for name in VERTEX_COLUMNS + LINE_COLUMNS}


@ODD
@given(line_sets())
def test_shapely_and_back(lines):
    shapes = lines.to_shapely()
    assert shapes.shape == (len(lines),)
    assert all(shape.geom_type == "LineString" and shape.has_z for shape in shapes)
    assert LineSet.from_shapely(shapes, crs=lines.crs, **columns_of(lines)) == lines


@ODD
@given(line_sets())
def test_geopandas_and_back(lines):
    frame = lines.to_geopandas()
    assert len(frame) == len(lines)
    assert (frame.crs is None) == (lines.crs == "local")
    assert LineSet.from_geopandas(frame, crs="local") == lines
    flat = lines.to_geopandas(per_vertex=False)
    assert not set(VERTEX_COLUMNS) & set(flat.columns)


@ODD
@given(line_sets(fewest_vertices=0))
def test_arrow_and_back(lines):
    assert LineSet.from_arrow(lines) == lines
    assert LineSet.from_arrow(pa.table(lines)) == lines
    assert LineSet.from_arrow(pl.DataFrame(lines)) == lines
    assert LineSet.from_arrow(duckdb.sql("FROM lines"), crs=lines.crs) == lines


@ODD
@given(line_sets())
def test_geopandas_reads_and_writes_the_arrow_stream(lines):
    frame = geopandas.GeoDataFrame.from_arrow(lines)
    assert LineSet.from_geopandas(frame, crs=lines.crs) == lines
    if lines.crs != "local":
        assert frame.crs == lines.crs
    for encoding in ("WKB", "geoarrow"):
        if len(lines) or encoding == "WKB":
            assert LineSet.from_arrow(frame.to_arrow(geometry_encoding=encoding)) == lines


@ODD
@given(line_sets())
def test_features_are_those_of_the_lines(lines):
    collection = lines.__geo_interface__
    assert collection["type"] == "FeatureCollection"
    shapes = [shapely.geometry.shape(feature["geometry"]) for feature in collection["features"]]
    own = {
        name: [np.nan if v is None else v for f in collection["features"] for v in f["properties"][name]]
        for name in VERTEX_COLUMNS
    }
    for name in LINE_COLUMNS:
        values = [feature["properties"][name] for feature in collection["features"]]
        own[name] = [np.nan if v is None else v for v in values]
    stated = collection.get("crs", {"properties": {"name": "local"}})["properties"]["name"]
    assert LineSet.from_shapely(shapes, crs=stated, **own) == lines
    for line, feature in zip(lines, collection["features"], strict=True):
        assert line.__geo_interface__ == feature
        assert shapely.equals_exact(
            shapely.geometry.shape(line.__geo_interface__["geometry"]), line.to_shapely()
        )
    if len(lines):
        read = geopandas.GeoDataFrame.from_features(lines)
        assert read.geometry.tolist() == shapes


@pytest.mark.parametrize("crs", ["local", "EPSG:25832", "EPSG:25832+7837"])
@pytest.mark.parametrize("suffix", [".gpkg", ".geojson"])
def test_files_by_text_or_path_and_back(tmp_path, suffix, crs):
    rng = np.random.default_rng(1)
    lines = some_lines(8).with_crs(crs)
    lines = lines.with_columns(
        observed=rng.random(len(lines.xyz)) < 0.8, note=[f"Brücke {i} „ß“" for i in range(8)], review="edited",
        double=rng.random(8) < 0.5, time_start_s=3.0e8 + rng.random(8), role="edge", xyz=np.round(lines.xyz, 3),
    )  # fmt: skip
    path = tmp_path / f"lines{suffix}"
    write_lines(lines, str(path))
    back = read_lines(str(path), crs=crs if crs == "local" else None)
    order = np.argsort(back.id)
    assert back[order] == read_lines(path)[order] == lines[np.argsort(lines.id)]
    assert LineSet.from_geopandas(back.to_geopandas()) == back


def test_duckdb_and_polars_ask_questions_of_lines():
    lines = some_lines(6)
    rows = duckdb.sql(
        "SELECT kind, count(*), max(list_max(sigma_xy_m)) FROM lines GROUP BY kind ORDER BY kind"
    ).fetchall()
    expected = [(k, len(lines[k]), lines[k].sigma_xy_m.max()) for k in sorted(lines.kinds)]
    assert rows == expected
    frame = pl.DataFrame(lines)
    share = frame.select(pl.col("bridged").list.mean())["bridged"]
    np.testing.assert_allclose(share.to_list(), [line.bridged.mean() for line in lines])
    first = duckdb.sql("SELECT geometry[1].x, geometry[1].z FROM lines").fetchall()
    assert first == [tuple(line.xyz[0, [0, 2]]) for line in lines]
    table = pa.table(lines).slice(2, 3)
    assert LineSet.from_arrow(table) == lines[2:5]
    assert LineSet.from_arrow(pa.concat_tables([table, table])) == LineSet.concatenate([lines[2:5]] * 2)


def test_frames_of_others_are_read_as_far_as_they_go():
    shapes = [
        shapely.LineString([(0, 0), (1, 1)]),
        shapely.MultiLineString([[(0, 0, 1), (1, 1, 1)], [(2, 2, 2), (3, 3, 2)]]),
        shapely.Polygon([(0, 0), (1, 0), (1, 1)]),
    ]
    frame = geopandas.GeoDataFrame(
        {"note": ["ä", None, np.nan], "width_m": pd.array([0.1, None, 0.3], dtype="Float64"), "owner": [1, 2, 3],
         "sigma_xy_m": [0.01, 0.02, 0.03]},
        geometry=shapes, crs="EPSG:25832", index=[7, 7, 9],
    )  # fmt: skip
    with pytest.warns(LineworkWarning) as said:
        lines = LineSet.from_geopandas(frame, kind="fence")
    assert [str(one.message).split(":")[1].strip() for one in said] == ["sigma_xy_m", "owner"]
    assert lines.kind.tolist() == ["fence"] * 4
    assert lines.note.tolist() == ["ä", "", "", ""]
    np.testing.assert_array_equal(lines.width_m, [0.1, np.nan, np.nan, 0.3])
    assert np.isnan(lines.xyz[:2, 2]).all()
    # One number per line is the rms that files of linework hold, not the sigma at each vertex
    assert np.isnan(lines.sigma_xy_m).all()
    assert lines.crs == LineSet.empty(25832).crs
    with pytest.raises(CrsError, match="degrees"):
        LineSet.from_geopandas(frame.to_crs(4326))
    frame["sigma_xy_m"] = [np.zeros(2), np.zeros(4), np.zeros(3)]
    with pytest.raises(InputError, match="sigma_xy_m of line 2 has 3 values for 4 vertices"):
        LineSet.from_geopandas(frame)


@pytest.mark.parametrize(
    ("shapes", "message"),
    [([shapely.Point(1, 2)], "geometry 0 is a Point"), ([shapely.LineString([(0, 0), (1, 1)]), None], "geometry 1 is nothing")],
)  # fmt: skip
def test_what_is_not_a_line_is_named(shapes, message):
    with pytest.raises(InputError, match=message):
        LineSet.from_shapely(shapes)
    with pytest.raises(InputError, match=message):
        LineSet.from_geopandas(geopandas.GeoDataFrame(geometry=shapes))


def test_tables_without_lines_are_named():
    with pytest.raises(InputError, match="no column of lines among a, b"):
        LineSet.from_arrow(pa.table({"a": [1], "b": [2]}))
    with pytest.raises(InputError, match="column geometry holds"):
        LineSet.from_arrow(pa.table({"geometry": [[1.0, 2.0]]}))
    with pytest.raises(TypeError, match="takes an Arrow table or stream, not list"):
        LineSet.from_arrow([1])
    short = pa.table({"geometry": [[{"x": 0.0, "y": 0.0}, {"x": 1.0, "y": 0.0}]], "bridged": [[True]]})
    with pytest.raises(InputError, match="bridged has other numbers of values"):
        LineSet.from_arrow(short)
    lines = LineSet.from_arrow(short.drop_columns("bridged"), crs=25832, kind="cable")
    assert (lines.kind.tolist(), lines.crs) == (["cable"], LineSet.empty(25832).crs)
    assert np.isnan(lines.xyz[:, 2]).all()
    with pytest.raises(TypeError, match="no column 'colour'"):
        LineSet.from_shapely([], colour="red")


def test_a_line_of_one_vertex_has_no_linestring_and_says_so():
    lines = LineSet.from_lines([np.eye(3), np.zeros((1, 3))])
    with pytest.raises(InputError, match="line 1 has 1 vertex"):
        lines.to_shapely()
    assert LineSet.from_arrow(lines) == lines


def test_what_is_missing_is_said_with_the_command_that_installs_it():
    code = (
        "import sys\n"
        "for name in ('geopandas', 'arro3', 'arro3.core', 'matplotlib', 'pandas', 'xarray'): sys.modules[name] = None\n"
        "import numpy as np\n"
        "from linework.model.lines import LineSet\n"
        "lines = LineSet.from_lines([np.eye(3)])\n"
        "for call in (lines.to_geopandas, lines.plot, lines.__arrow_c_stream__):\n"
        "    try: call()\n"
        "    except ImportError as error: print(error)\n"
        "print(lines._repr_html_()[:5], repr(lines)[:7])\n"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.splitlines() == [
        "to_geopandas(): needs the package geopandas. pip install 'linework[tables]'",
        "plot(): needs the package matplotlib. pip install 'linework[reports]'",
        "__arrow_c_stream__(): needs the package arro3-core. pip install 'linework[tables]'",
        "<div> LineSet",
    ]
    with pytest.raises(MissingPackageError) as caught:
        needed("no_such_package", "tables")
    assert caught.value.exit_code == 5
