"""What a user is told: advice that leads out, the place that is wrong, and nothing that a terminal would carry out."""

import json

import numpy as np
from tests.conftest import CRS, road_points

from linework.crs import parse_crs
from linework.files.las.write import write_las
from linework.files.vectors.read_write import write_lines
from linework.model.lines import LineSet

#: Clears the screen, sets the title, and goes back over what was printed; with a control character of 8 bits.
ESCAPES = "a\x1b[2J\x1b]0;owned\x07\r\x9b31mb"


def test_the_advice_of_a_file_in_degrees_does_not_lead_back_to_it(linework, tmp_path):
    collection = {
        "type": "FeatureCollection", "crs": {"type": "name", "properties": {"name": "EPSG:4326"}}, "features": [
            {"type": "Feature", "properties": {}, "geometry": {"type": "LineString", "coordinates": [[9, 48], [9.1, 48]]}}
        ],
    }  # fmt: skip
    path = tmp_path / "a.geojson"
    path.write_text(json.dumps(collection))
    first = linework("convert", path, tmp_path / "b.gpkg")
    again = linework("convert", path, tmp_path / "b.gpkg", "--crs", "EPSG:25832")
    assert first.code == again.code == 3
    assert "--crs" not in first.line
    assert "ransform" in first.line


def test_kinds_and_values_of_files_do_not_reach_the_terminal(linework, tmp_path):
    xyz = np.array([[500_000.0, 5_400_000.0, 100.0], [500_040.0, 5_400_000.0, 100.0]])
    lines = LineSet.from_lines([xyz, xyz + 9], crs=parse_crs(CRS), kind=[ESCAPES, "kerb_top"])
    path, reference = tmp_path / "a.geojson", tmp_path / "b.geojson"
    write_lines(lines, path)
    write_lines(lines, reference)
    for arguments in (
        ("evaluate", path, reference),
        ("evaluate", path, reference, "--kinds", "kerb_top"),
        ("evaluate", path, reference, "--kinds", "nothing"),
        ("evaluate", path, reference, "--kind-map", "x=kerb_top"),
    ):
        found = linework(*arguments)
        text = found.stdout + found.stderr
        assert all(c.isprintable() or c == "\n" for c in text), repr(text)
    assert "\\x1b[2J" in linework("evaluate", path, reference).stdout


def test_names_of_files_and_surveys_do_not_reach_the_terminal(linework, tmp_path):
    folder = tmp_path / f"f{ESCAPES}"
    write_las(road_points(), folder / f"{ESCAPES}.laz", crs=CRS)
    name = json.dumps(ESCAPES)
    (folder / "survey.toml").write_text(f"name = {name}\n[points]\nfiles = ['*.laz']\n".replace("\x7f", ""))
    out = tmp_path / f"{ESCAPES}.geojson"
    for arguments in (
        ("info", folder), ("info", folder / f"{ESCAPES}.laz"), ("info", tmp_path / ESCAPES), ("clean", folder),
        ("extract", folder, "-o", out), ("convert", out, tmp_path / f"{ESCAPES}.kml"), ("extract", folder, "-o", out),
    ):  # fmt: skip
        found = linework(*arguments)
        text = found.stdout + found.stderr
        assert found.code in (0, 2, 3, 4, 5, 6), text
        assert all(c.isprintable() or c == "\n" for c in text), repr(text)
