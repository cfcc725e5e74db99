"""GeoParquet: exactly what was written, conformant by a validator, read by other libraries, others' files read."""

import json
import shutil
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path

import duckdb
import geopandas
import numpy as np
import pyarrow
import pyarrow.parquet
import pyproj
import pytest
import shapely
from tests.files.vectors.test_vectors import sample

from linework.crs import parse_crs
from linework.errors import CrsError, InputError, LineworkWarning
from linework.files.maps import geoparquet
from linework.files.vectors.read_write import not_expressed, read_lines, write_lines
from linework.model.lines import LineSet


@pytest.mark.parametrize("crs", ["EPSG:25832+7837", "EPSG:25832", "local"])
def test_what_is_written_comes_back_exactly(tmp_path, crs):
    path = tmp_path / "lines.parquet"
    write_lines(sample(crs), path)
    back, lines = read_lines(path), sample(crs)
    for f in fields(LineSet):
        a, b = getattr(lines, f.name), getattr(back, f.name)
        assert np.array_equal(a, b, equal_nan=a.dtype.kind == "f") if isinstance(a, np.ndarray) else a == b, (
            f.name
        )
    assert not_expressed(lines, path) == ()


def many_lines(n=10_000):
    rng = np.random.default_rng(5)
    starts = rng.uniform(0, 5000, (n, 1, 2)) + np.array([500_000, 5_600_000])
    xyz = np.concatenate([starts + np.array([[[0, 0], [1, 1]]]), np.full((n, 2, 1), 7.0)], axis=2)
    return LineSet(xyz=xyz.reshape(-1, 3), offsets=np.arange(n + 1) * 2, crs="EPSG:25832", kind=["cable"] * n)


@pytest.mark.parametrize(
    "lines", [sample(), sample("local"), many_lines()], ids=["compound", "local", "many"]
)
def test_a_validator_finds_it_conformant(tmp_path, lines):
    path = tmp_path / "lines.parquet"
    write_lines(lines, path)
    validator = shutil.which("geoparquet-validator", path=str(Path(sys.executable).parent))
    done = subprocess.run([validator, "check", str(path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    assert "FAIL" not in done.stdout and "core: 1" in done.stdout
    assert "covering: 6 pass, 0 fail" in done.stdout


def test_a_crs_whose_units_have_names_of_their_own_comes_back(tmp_path):
    named = parse_crs("EPSG:2236").replace("US survey foot", "Foot of Florida").replace("degree", "Degree")
    write_lines(replace(sample("EPSG:2236"), crs=named), tmp_path / "lines.parquet")
    assert pyproj.CRS.from_wkt(read_lines(tmp_path / "lines.parquet").crs) == pyproj.CRS.from_wkt(named)


def test_rows_are_in_spatial_order_in_several_groups(tmp_path):
    path = tmp_path / "lines.parquet"
    write_lines(many_lines(), path)
    file = pyarrow.parquet.ParquetFile(path)
    assert file.metadata.num_row_groups == 3
    boxes = [file.read_row_group(i, columns=["bbox"])["bbox"].combine_chunks().flatten() for i in range(3)]
    areas = [np.prod([np.ptp(np.asarray(b[k])) for k in (0, 1)]) for b in boxes]
    # In the order of the set, each group would cover the whole square of 25 square kilometres
    assert sum(areas) < 2 * 25e6
    assert read_lines(path) == many_lines()


def test_other_libraries_read_it(tmp_path):
    path, lines = tmp_path / "lines.parquet", sample()
    write_lines(lines, path)
    frame = geopandas.read_parquet(path).sort_values("line")
    assert parse_crs(frame.crs.to_wkt()) == lines.crs
    np.testing.assert_array_equal(
        shapely.get_coordinates(frame.geometry.to_numpy(), include_z=True), lines.xyz
    )
    rows = duckdb.sql(f"SELECT kind, len(vertex_sigma_xy_m) AS n FROM '{path}' ORDER BY line").fetchall()
    assert rows == list(zip(lines.kind.tolist(), np.diff(lines.offsets).tolist(), strict=True))


def test_files_of_others_are_read(tmp_path):
    shapes = [shapely.LineString([[5e5, 5e6, 1], [5e5, 5e6 + 9, 2]]), shapely.Point(5e5, 5e6), None]
    frame = geopandas.GeoDataFrame({"class": ["rail", "post", "x"]}, geometry=shapes, crs=25832)
    frame.to_parquet(tmp_path / "a.parquet")
    with pytest.warns(LineworkWarning, match="left out row 2: a Point is no line"):
        lines = read_lines(tmp_path / "a.parquet", kind_field="class")
    assert lines.kind.tolist() == ["rail"] and lines.crs == parse_crs("EPSG:25832")
    assert (
        read_lines(tmp_path / "a.parquet", kind_field="class", kinds={"rail": "guardrail"}).kind[0]
        == "guardrail"
    )
    frame.to_crs(4326).to_parquet(tmp_path / "b.parquet")
    with pytest.raises(CrsError, match="degrees"):
        read_lines(tmp_path / "b.parquet")


def geo(**column):
    return {
        "geo": json.dumps({"version": "1.1.0", "primary_column": "geometry", "columns": {"geometry": column}})
    }


@pytest.mark.parametrize(
    ("metadata", "cells", "words"),
    [
        ({}, [b""], "not GeoParquet"),
        ({"geo": "[1"}, [b""], "cannot be read as Parquet"),
        ({"geo": "{}"}, [b""], "no column of geometries"),
        (geo(encoding="linestring", crs=None), [b""], "encoded as linestring, expected WKB"),
        (geo(encoding="WKB", crs=None), [b"\x01\x02\x00"], "row 1: its geometry is damaged"),
        (geo(encoding="WKB", crs={"type": "Nothing"}), [b""], "is not a CRS"),
    ],
)
def test_what_is_no_geoparquet_is_one_line(tmp_path, metadata, cells, words):
    path = tmp_path / "a.parquet"
    table = pyarrow.table({"geometry": pyarrow.array(cells, type=pyarrow.binary())})
    pyarrow.parquet.write_table(table.replace_schema_metadata(metadata), path)
    with pytest.raises((InputError, CrsError), match=words) as caught:
        read_lines(path)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)


@pytest.mark.parametrize("damage", [b"", b"PAR1", "cut", "zeros"])
def test_damaged_files_are_one_line(tmp_path, damage):
    path = tmp_path / "a.parquet"
    write_lines(sample(), path)
    data = path.read_bytes()
    half = len(data) // 2
    path.write_bytes({"cut": data[:half], "zeros": bytes(half) + data[half:]}.get(damage, damage))
    with pytest.raises(InputError) as caught:
        read_lines(path)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)


def test_an_edited_file_is_read_by_its_geometries(tmp_path):
    path = tmp_path / "a.parquet"
    write_lines(sample(), path)
    table = pyarrow.parquet.read_table(path)
    pyarrow.parquet.write_table(table.slice(0, 3), path)
    assert len(read_lines(path)) == 3
    assert np.isnan(read_lines(path).sigma_xy_m).all()


def test_the_order_of_rows_is_the_same_on_every_run():
    lines = many_lines(500)
    assert np.array_equal(geoparquet._spatial_order(lines), geoparquet._spatial_order(lines))
    assert sorted(geoparquet._spatial_order(lines)) == list(range(500))
