"""`linework convert` between the formats lines are written in, and `linework config`."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from tests.conftest import CRS

from linework.crs import parse_crs
from linework.files.vectors.point_layers import PointLayer
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.lines import LineSet


@pytest.fixture
def lines(tmp_path):
    xyz = np.array(
        [[500_000.0, 5_400_000.0, 100.7], [500_010.0, 5_400_001.0, 100.8], [500_020.0, 5_400_004.0, 100.9]]
    )
    found = LineSet.from_lines(
        [xyz, xyz + np.array([0, 9, 7])], crs=parse_crs(CRS), kind=["guardrail", "cable"], id=["guardrail-1", "cable-1"],
        method=["radon"] * 2, confidence=[0.9, 0.8], height_m=[0.75, np.nan], clearance_m=[np.nan, 7.5],
    )  # fmt: skip
    write_lines(found, tmp_path / "lines.gpkg")
    return tmp_path / "lines.gpkg"


def test_lines_that_a_map_cannot_hold_are_not_counted(linework, lines, tmp_path):
    found = linework("convert", lines, tmp_path / "map.osm")
    assert "left out 1 lines of cable" in found.stderr
    assert found.stdout == f"1 lines in {tmp_path / 'map.osm'}\n"


@pytest.mark.parametrize("suffix", [".geojson", ".gpkg", ".fgb"])
def test_there_and_back(linework, lines, tmp_path, suffix):
    there, back = tmp_path / f"there{suffix}", tmp_path / "back.gpkg"
    found = linework("convert", lines, there)
    assert found.code == 0, found.stderr
    assert found.stdout == f"2 lines in {there}\n"
    assert linework("convert", there, back).code == 0
    one, two = read_lines(lines), read_lines(back)
    two = two.take([two.id.tolist().index(name) for name in one.id])
    np.testing.assert_allclose(two.xyz, one.xyz, atol=1e-4)
    assert two.kind.tolist() == one.kind.tolist()
    np.testing.assert_allclose(two.clearance_m, one.clearance_m)


@pytest.mark.parametrize("suffix", [".dxf", ".kml"])
def test_formats_for_drawing(linework, lines, tmp_path, suffix):
    assert linework("convert", lines, tmp_path / f"out{suffix}").code == 0
    assert (tmp_path / f"out{suffix}").stat().st_size > 500


def test_what_is_there_is_not_touched_without_overwrite(linework, lines, tmp_path):
    there = tmp_path / "there.geojson"
    there.write_text("mine")
    assert linework("convert", lines, there).code == 6
    assert there.read_text() == "mine"
    assert linework("convert", lines, there, "--overwrite").code == 0


def test_a_file_is_not_converted_into_itself(linework, lines):
    found = linework("convert", lines, lines, "--overwrite")
    assert found.code == 2
    assert "the output is the input file" in found.line


@pytest.mark.parametrize(
    ("name", "content"), [("no.gpkg", None), ("no.gpkg", b""), ("no.geojson", b"{"), ("no.txt", b"")]
)
def test_what_cannot_be_read_is_one_line(linework, tmp_path, name, content):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    found = linework("convert", tmp_path / name, tmp_path / "sub" / "out.gpkg")
    assert found.code in (2, 3)
    assert found.line.startswith(f"error: {tmp_path / name}: ")
    assert not (tmp_path / "sub").exists()


def test_the_default_run_file_is_accepted_and_says_units_and_reasons(linework, las_file, tmp_path):
    said = linework("config")
    assert said.code == 0
    assert tomllib.loads(said.stdout)["radon"]["cell_m"] == 0.20
    fields = [line for line in said.stdout.splitlines() if "=" in line]
    assert all("  # [" in line for line in fields)
    path = tmp_path / "run.toml"
    path.write_text(said.stdout)
    assert linework("extract", las_file, "-o", tmp_path / "lines.gpkg", "--config", path).code == 0
    assert linework("config", "radon").stdout in said.stdout
    assert linework("config", "magic").code == 2


def test_the_points_of_the_vans_log_go_along_or_are_told(linework, tmp_path):
    xyz = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]])
    layer = PointLayer("event", xyz[:1], {"key": np.array(["m"], dtype=object)})
    source = tmp_path / "a.gpkg"
    write_lines(LineSet.from_lines([xyz], kind=["cable"], crs="local"), source, points=[layer])
    found = linework("convert", source, tmp_path / "b.geojson")
    assert found.code == 0 and found.stderr == ""
    assert '"key":"m"' in (tmp_path / "b.geojson").read_text()
    found = linework("convert", source, tmp_path / "b.dxf")
    assert found.code == 0 and "event (1 points) left out, .dxf files hold only lines" in found.stderr


def test_feature_codes_name_the_layers_of_a_drawing(linework, lines, tmp_path):
    (tmp_path / "codes.csv").write_text("kind,layer,code\nguardrail,B-RAIL,77\n")
    found = linework("convert", lines, tmp_path / "a.dxf", "--codes", tmp_path / "codes.csv")
    assert found.code == 0
    assert "no row for cable" in found.stderr
    assert "B-RAIL" in (tmp_path / "a.dxf").read_text()
    found = linework("convert", lines, tmp_path / "a.kml", "--codes", tmp_path / "codes.csv")
    assert found.code == 2
    assert "--codes is for .dxf files" in found.stderr
    assert not (tmp_path / "a.kml").exists()
