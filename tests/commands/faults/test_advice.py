"""Advice that leads out: what a message says to do is done, and then it works, or the next message is another one."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyproj
import pytest
from tests.commands.faults.test_bad_input import with_crs
from tests.conftest import CRS, road_points

import linework as lw
from linework.errors import CrsError
from linework.files.las.write import write_las
from linework.files.survey.open import open_survey
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.lines import LineSet

UTM = "EPSG:25832"
#: What no option can change is not sent there.
NO_WAY_OUT = "--crs"


@pytest.mark.parametrize("crs", [(), ("--crs", UTM), ("--crs", "local")], ids=["none", "another", "local"])
def test_degrees_that_a_laser_file_states_are_not_sent_to_the_option(linework, tmp_path, crs):
    path = with_crs(tmp_path / "a.las", pyproj.CRS(4326).to_wkt(), scale=1e-7, xyz=road_points().xyz * 1e-5)
    found = linework("info", path, *crs)
    assert found.code == 3
    assert found.line == (
        f"error: {path}: CRS 'WGS 84' is geographic (degrees), lengths need metres. Transform to a projected CRS, or"
        " correct the CRS that is stated there."
    )


@pytest.mark.parametrize("wkt", ["no CRS at all", 'PROJCS["nonsense"]', "x" * 60_000])
def test_a_laser_file_with_a_crs_that_is_not_understood_takes_the_one_that_is_given(linework, tmp_path, wkt):
    path = with_crs(tmp_path / "a.las", wkt)
    found = linework("info", path, "--quiet")
    assert (found.code, found.line) == (
        3, f"error: {path}: the file's WKT is not understood. Give --crs EPSG:... or --crs local.",
    )  # fmt: skip
    helped = linework("info", path, "--quiet", "--crs", UTM)
    assert (helped.code, helped.stdout.count("EPSG:25832")) == (0, 1)


def geojson(path: Path, crs: object) -> Path:
    """Write a line as another program would, with any CRS that can be stated."""
    feature = {
        "type": "Feature", "properties": {"kind": "guardrail"},
        "geometry": {"type": "LineString", "coordinates": [[5e5, 5e6, 1.0], [5e5 + 9, 5e6, 1.0]]},
    }  # fmt: skip
    document = {"type": "FeatureCollection", "features": [feature]}
    if crs is not None:
        document["crs"] = {"type": "name", "properties": {"name": crs}}
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def test_a_line_file_with_a_crs_that_is_not_understood_takes_the_one_that_is_given(linework, tmp_path):
    path, out = geojson(tmp_path / "a.geojson", "urn:ogc:def:crs:EPSG::999999"), tmp_path / "b.gpkg"
    found = linework("convert", path, out)
    assert found.code == 3
    assert found.line.endswith(
        "'EPSG:999999' is not known to PROJ. Give --crs EPSG:... (projected, metres) or --crs local."
    )
    assert linework("convert", path, out, "--crs", UTM).code == 0
    assert pyproj.CRS(read_lines(out).crs) == pyproj.CRS(UTM)


@pytest.mark.parametrize("crs", [(), ("--crs", UTM)])
def test_degrees_that_a_line_file_states_are_not_sent_to_the_option(linework, tmp_path, crs):
    path = geojson(tmp_path / "a.geojson", "urn:ogc:def:crs:OGC:1.3:CRS84")
    found = linework("convert", path, tmp_path / "b.gpkg", *crs)
    assert found.code == 3
    assert "degrees" in found.line
    assert NO_WAY_OUT not in found.line


def test_a_dxf_takes_the_crs_that_is_given_where_its_prj_is_not_understood(linework, tmp_path):
    path = tmp_path / "a.dxf"
    write_lines(LineSet.from_lines([np.array([[0.0, 0, 1], [9, 0, 1]])], kind="guardrail"), path)
    path.with_suffix(".prj").write_text("nonsense", encoding="utf-8")
    found = linework("convert", path, tmp_path / "b.gpkg")
    assert found.code == 3
    assert found.line.startswith(f"error: {path.with_suffix('.prj')}: 'nonsense' is not a CRS")
    assert linework("convert", path, tmp_path / "b.gpkg", "--crs", UTM).code == 0


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson", ".fgb", ".dxf"])
def test_a_line_file_of_another_crs_than_the_option_is_refused(linework, tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    write_lines(LineSet.from_lines([np.array([[0.0, 0, 1], [9, 0, 1]])], kind="guardrail", crs=UTM), path)
    found = linework("convert", path, tmp_path / "b.gpkg", "--crs", "EPSG:25833")
    assert (found.code, found.line) == (
        3,
        f"error: {path}: two different CRSs: the file says ETRS89 / UTM zone 32N (EPSG:25832), --crs says ETRS89 / UTM zone"
        " 33N (EPSG:25833). Leave --crs out, or correct what the file states.",
    )
    assert linework("convert", path, tmp_path / "b.gpkg").code == 0


def survey(folder: Path, crs: str, *, stated: str = CRS) -> Path:
    """Write a survey folder whose survey.toml gives a CRS, and whose points state one ("": none)."""
    if stated:
        write_las(road_points(), folder / "a.laz", crs=stated)
    else:
        with_crs(folder / "a.las", "")
    (folder / "survey.toml").write_text(f'crs = "{crs}"\n[points]\nfiles = ["a.la*"]\n', encoding="utf-8")
    return folder


@pytest.mark.parametrize("crs", ["nonsense", "EPSG:999999", "EPSG:4326", "EPSG:5783", "EPSG:25832+4326"])
@pytest.mark.parametrize("option", [(), ("--crs", UTM)], ids=["alone", "with the option"])
def test_a_wrong_crs_in_survey_toml_is_corrected_there(linework, tmp_path, crs, option):
    folder = survey(tmp_path / "drive", crs, stated="")
    found = linework("info", folder, *option)
    assert found.code == 3
    assert found.line.startswith(f"error: {folder / 'survey.toml'}: crs: ")
    assert found.line.endswith("orrect the CRS that is stated there.")
    assert NO_WAY_OUT not in found.line


def test_a_wrong_option_is_named_where_survey_toml_is_right(linework, tmp_path):
    found = linework("info", survey(tmp_path / "drive", UTM, stated=""), "--crs", "EPSG:4326")
    assert found.code == 3
    assert found.line.startswith("error: --crs: CRS 'WGS 84' is geographic")


@pytest.mark.parametrize("kinds", [(), ("--features", "guardrail")])
def test_what_contradicts_the_laser_file_is_named(linework, tmp_path, kinds):
    command = ("extract", "-o", tmp_path / "lines.gpkg", *kinds) if kinds else ("info",)
    folder = survey(tmp_path / "drive", "EPSG:25833")
    found = linework(command[0], folder, *command[1:])
    assert found.code == 3
    assert found.line.startswith(f"error: {folder / 'a.laz'}: two different CRSs: the file says ")
    assert found.line.endswith(
        "crs in survey.toml says ETRS89 / UTM zone 33N (EPSG:25833). Correct crs in survey.toml, or correct the file's"
        " header."
    )
    alone = linework(command[0], folder / "a.laz", *command[1:], "--crs", "EPSG:25833")
    assert alone.line.endswith(" Leave --crs out, or correct the file's header.")


def test_heights_of_another_datum_are_named_by_what_gave_them(linework, tmp_path):
    found = linework("info", survey(tmp_path / "drive", "EPSG:25832+5783"))
    assert found.code == 3
    assert "crs in survey.toml says" in found.line


COMMANDS = [
    ("info", "{survey}"),
    ("extract", "{survey}", "-o", "{out}.gpkg"),
    ("trace", "{survey}", "--at", "1,2", "-o", "{out}.gpkg"),
    ("raster", "{survey}", "-o", "{out}"),
    ("locate", "{survey}", "-o", "{out}.csv"),
    ("photolog", "{survey}", "-o", "{out}.html"),
    ("serve", "{survey}"),
    ("convert", "{lines}", "{out}.gpkg"),
    ("evaluate", "{lines}", "{lines}"),
    ("calibrate", "{survey}", "-o", "{out}.toml"),
]


@pytest.mark.parametrize("words", COMMANDS, ids=lambda words: words[0])
@pytest.mark.parametrize("crs", ["", " ", "EPSG:", "EPSG:4326"])
def test_no_command_takes_a_wrong_option(linework, tmp_path, words, crs):
    """An empty text is what a script gives whose variable was never set."""
    lines = geojson(tmp_path / "a.geojson", None)
    folder = survey(tmp_path / "drive", UTM, stated="")
    named = {"survey": folder, "lines": lines, "out": tmp_path / "out"}
    found = linework(*(word.format(**named) for word in words), "--crs", crs)
    assert found.code == 3
    assert found.line.startswith("error: --crs: ")
    assert "is not a CRS" in found.line or "geographic" in found.line


def test_an_empty_text_in_survey_toml_is_no_crs(linework, tmp_path):
    folder = survey(tmp_path / "drive", "")
    found = linework("info", folder)
    assert found.code == 2
    assert found.line.startswith(f"error: {folder / 'survey.toml'}: crs is '', expected")


@pytest.mark.parametrize(
    "call",
    [
        lambda path, lines: open_survey(path, crs=""),
        lambda path, lines: lw.extract(path, crs=""),
        lambda path, lines: lw.trace(path, (0.0, 0.0), crs=""),
        lambda path, lines: lw.read_points(path, crs=""),
        lambda path, lines: lw.read_trajectory(path, crs=""),
        lambda path, lines: lw.locate(path, crs=""),
        lambda path, lines: lw.read_lines(lines, crs=""),
        lambda path, lines: lw.LineSet.from_lines([np.zeros((2, 3))], crs=""),
        lambda path, lines: lw.LineSet.from_shapely([], crs=""),
    ],
)  # fmt: skip
def test_an_empty_text_is_no_crs_in_python(tmp_path, call):
    folder = survey(tmp_path / "drive", UTM, stated="")
    with pytest.raises(CrsError, match=r"^crs: '' is not a CRS"):
        call(folder, geojson(tmp_path / "a.geojson", None))
