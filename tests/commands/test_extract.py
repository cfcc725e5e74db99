"""`linework extract` where all is well: outputs, record, options."""

from __future__ import annotations

import json

import numpy as np
import pyogrio
import pytest
from tests.conftest import CRS, road_points

from linework.files.las.write import write_las
from linework.files.trajectories.read import write_trajectory
from linework.methods.kinds import ALL_KINDS
from linework.model.trajectory import Trajectory


def test_nothing_found_is_typed_empty_layers_and_a_warning(linework, las_file, tmp_path):
    output = tmp_path / "lines.gpkg"
    found = linework("extract", las_file, "-o", output, "--features", "guardrail,cable")
    assert found.code == 0
    assert "nothing found" in found.stderr
    for kind in ("guardrail", "cable"):
        layer = pyogrio.read_info(output, layer=kind)
        assert layer["features"] == 0
        assert layer["geometry_type"] == "LineString Z"
        assert "DHHN2016" in layer["crs"] or "7837" in layer["crs"]


def test_the_record_says_what_was_asked_and_done(linework, las_file, tmp_path):
    settings = tmp_path / "run.toml"
    settings.write_text("[radon]\ncell_m = 0.25\n")
    found = linework(
        "extract",
        las_file,
        "-o",
        tmp_path / "lines.geojson",
        "--features",
        "cable",
        "--config",
        settings,
        "--json",
    )
    assert found.code == 0, found.stderr
    record = json.loads(found.stdout)
    assert record == json.loads((tmp_path / "run.json").read_text())
    assert record["parameters"]["features"] == ["cable"]
    assert record["parameters"]["settings"]["radon"]["cell_m"] == 0.25
    assert record["versions"]["linework"]
    assert record["inputs"][0]["file"] == str(las_file)


def test_the_summary_is_on_stdout_and_progress_on_stderr(linework, las_file, tmp_path):
    found = linework("extract", las_file, "-o", tmp_path / "lines.gpkg", "--features", "guardrail")
    assert found.stdout.split() == ["guardrail", "0", "lines", "0.0", "m"]
    assert "read points" in found.stderr
    quiet = linework("extract", las_file, "-o", tmp_path / "more.gpkg", "--features", "guardrail", "--quiet")
    assert "read points" not in quiet.stderr


@pytest.mark.parametrize("features", ["", "barrier", "cable,barrier", "cable,kerb_top"])
def test_every_kind_asked_for_is_told_recorded_and_has_its_layer(linework, las_file, tmp_path, features):
    output = tmp_path / "lines.gpkg"
    asked = [kind for kind in ALL_KINDS if kind in (features or kind)]
    found = linework("extract", las_file, "-o", output, *(["--features", features] if features else []))
    assert found.code == 0, found.stderr
    assert [line.split()[0] for line in found.stdout.splitlines()] == asked
    counts = json.loads((tmp_path / "run.json").read_text())["counts"]
    assert list(counts["lines"]) == list(counts["length_m"]) == asked
    assert [name for name, _ in pyogrio.list_layers(output)][: len(asked)] == asked


def test_each_output_in_a_folder_has_its_own_record(linework, las_file, tmp_path):
    linework("extract", las_file, "-o", tmp_path / "one.gpkg")
    first = (tmp_path / "run.json").read_text()
    for name in ("two.gpkg", "one.geojson", "one.dxf"):
        output = tmp_path / name
        assert linework("extract", las_file, "-o", output, "--overwrite").code == 0
        record = json.loads((tmp_path / f"{name}.run.json").read_text())
        assert record["output"]["file"] == str(output)
        assert (tmp_path / "run.json").read_text() == first


def test_overwriting_gives_the_same_bytes_and_leaves_only_lines_and_record(linework, las_file, tmp_path):
    output = tmp_path / "out" / "lines.gpkg"
    assert linework("extract", las_file, "-o", output).code == 0
    first = output.read_bytes()
    for workers in (1, 2):
        assert linework("extract", las_file, "-o", output, "--overwrite", "--workers", workers).code == 0
        assert output.read_bytes() == first
    assert sorted(p.name for p in output.parent.iterdir()) == ["lines.gpkg", "run.json"]


def test_a_trajectory_given_by_hand_is_used_and_recorded(linework, las_file, tmp_path):
    xyz = np.array([[500_000.0, 5_400_000.0, 100.0], [500_040.0, 5_400_000.0, 100.0]])
    path = tmp_path / "path.csv"
    write_trajectory(Trajectory(np.array([3.0e8, 3.0e8 + 4]), xyz), path)
    found = linework(
        "extract", las_file, "-o", tmp_path / "lines.gpkg", "--trajectory", path, "--json", "--quiet"
    )
    assert found.code == 0, found.stderr
    record = json.loads(found.stdout)
    assert record["parameters"]["trajectory"] == str(path)
    assert [entry["file"] for entry in record["inputs"]] == [str(las_file), str(path)]


@pytest.mark.parametrize(
    "name", ["with space.laz", "Straße äöü.laz", "100%#?;.laz", "-dash.laz", "emoji🛣.laz"]
)
def test_names_of_all_kinds(linework, tmp_path, name):
    folder = tmp_path / "in"
    write_las(road_points(), folder / name, crs=CRS)
    output = tmp_path / name.replace(".laz", ".gpkg")
    found = linework("extract", folder, "-o", output)
    assert found.code == 0, found.stderr
    assert output.exists()


def test_a_report_is_a_page_of_its_own(linework, las_file, tmp_path):
    report = tmp_path / "report.html"
    found = linework("extract", las_file, "-o", tmp_path / "lines.gpkg", "--report", report)
    assert found.code == 0, found.stderr
    page = report.read_text()
    assert "<html" in page
    assert "400" in page
    again = linework("extract", las_file, "-o", tmp_path / "more.gpkg", "--report", report)
    assert again.code == 6
    assert not (tmp_path / "more.gpkg").exists()
    wrong = linework("extract", las_file, "-o", tmp_path / "more.gpkg", "--report", tmp_path / "report.doc")
    assert wrong.code == 2


def test_candidates_are_written_where_they_are_asked_for(linework, las_file, tmp_path):
    output = tmp_path / "lines.gpkg"
    found = linework("extract", las_file, "-o", output, "--features", "road_boundary", "--candidates")
    assert found.code == 0, found.stderr
    assert [line.split()[0] for line in found.stdout.splitlines()] == ["road_boundary", "candidate"]
    assert [name for name, _ in pyogrio.list_layers(output)][:2] == ["road_boundary", "candidate"]
    record = json.loads((tmp_path / "run.json").read_text())
    assert record["parameters"]["candidates"] is True
    assert record["parameters"]["features"] == ["road_boundary"]
    styles = pyogrio.raw.read(output, layer="layer_styles", columns=["f_table_name", "styleQML"])[3]
    assert 'line_style" type="QString" value="dash"' in dict(zip(*styles, strict=True))["candidate"]


def test_candidates_need_a_method_that_has_them(linework, las_file, tmp_path):
    found = linework(
        "extract", las_file, "-o", tmp_path / "lines.gpkg", "--features", "cable", "--candidates"
    )
    assert found.code == 2
    assert "candidates: only obb keeps lines" in found.stderr
    assert not (tmp_path / "lines.gpkg").exists()
