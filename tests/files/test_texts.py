"""Numbers of thousands of digits and deep nesting, in every text that linework reads: an error in one line, never a fault."""

import json
from pathlib import Path

import pytest
from tests.conftest import CRS, road_points

from linework.errors import ConfigError
from linework.files.documents import read_json, read_toml
from linework.files.las.write import write_las

LONG = "9" * 5000
HEX = "0x" + "f" * 5000
DOTTED = ".".join(["a"] * 5000)
NESTED = "[" * 50_000
#: What follows "key = " in TOML, or stands for a whole line ("{}" left out).
VALUES = {
    "long": LONG, "signed": "-" + LONG, "underscores": "_".join(["9"] * 5000), "hex": HEX, "float": f"1.{LONG}",
    "exponent": f"1e{LONG}", "a number just too large": "9" * 300, "lists": NESTED, "closed lists": "[" * 900 + "]" * 900,
    "tables": "{a=" * 900 + "1" + "}" * 900, "date": f"{LONG}-01-01",
}  # fmt: skip
LINES = {
    "dotted key": f"{DOTTED} = 1", "dotted table": f"[{DOTTED}]", "dotted with spaces": " . ".join(["a"] * 5000) + " = 1",
    "quoted dots": ".".join(['"a"'] * 5000) + " = 1", "text without end": 'crs = "' + "\\\"" * 400_000,
    "texts without end": "crs = " + '"""\\"' * 200_000, "in one table": "a = {" + f"{DOTTED} = 1" + "}",
}  # fmt: skip


@pytest.mark.parametrize(
    "text", [*[f"crs = {v}" for v in VALUES.values()], *LINES.values()], ids=[*VALUES, *LINES]
)
def test_a_survey_file_and_a_run_file(linework, tmp_path, las_file, text):
    (las_file.parent / "survey.toml").write_text(text)
    found = linework("info", las_file.parent)
    assert found.code == 2, found.stderr
    assert len(found.line) < 400
    run = tmp_path / "run.toml"
    run.write_text(text)
    found = linework("extract", las_file, "-o", tmp_path / "a.gpkg", "--config", run)
    assert found.code == 2, found.stderr
    assert found.line.startswith(f"error: {run}: ")
    assert len(found.line) < 700  # it lists the known keys


def test_bounds_do_not_refuse_what_people_write(tmp_path):
    path = tmp_path / "survey.toml"
    text = 'name = "' + "v1.2." * 100 + '"\n' + "# a comment" + "." * 100 + "9" * 300 + "\n"
    text += "files = [" + ", ".join(f'"tile_{i}.part.laz"' for i in range(200)) + "]\n"
    text += "note = '''" + "[" * 50 + "\n'''\n[a.b.c]\nd = [[1, 2.5], [3]]\nx = 1_000_000\n"
    path.write_text(text)
    found = read_toml(path)
    assert found["a"] == {"b": {"c": {"d": [[1, 2.5], [3]], "x": 1_000_000}}}
    path.write_text('a = """\n[[\n"""\nb = ' + LONG)
    with pytest.raises(ConfigError, match="line 4"):
        read_toml(path)


def collection(coordinates: str, properties: str = "{}", more: str = "") -> str:
    return (
        '{"type": "FeatureCollection", "crs": {"type": "name", "properties": {"name": "EPSG:25832"}}, "features": [{"type":'
        f' "Feature", "properties": {properties}, "geometry": {{"type": "LineString", "coordinates": {coordinates}}}}}]{more}}}'
    )


SOUND = "[[500000, 5400000, 1], [500010, 5400000, 1]]"
JSON = {
    "coordinate": collection(f"[[{LONG}, 0, 0], [1, 1, 1]]"),
    "coordinate of 400 digits": collection(f"[[{'9' * 400}, 0, 0], [1, 1, 1]]"),
    "nested coordinates": collection("[" * 900 + "]" * 900),
    "nested without end": collection(NESTED),
    "nested collection": '{"type": "GeometryCollection", "geometries": [' * 5000,
    "nested member": collection(SOUND, more=', "a": ' + '{"a": ' * 50_000),
    "surrogate": collection(SOUND, '{"kind": "\\ud800"}'),
    "not utf-8": collection(SOUND).replace("LineString", "\udcff"),
}


@pytest.mark.parametrize("text", JSON.values(), ids=JSON)
def test_geojson(linework, tmp_path, text):
    path = tmp_path / "a.geojson"
    path.write_text(text, errors="surrogateescape")
    for arguments in (("convert", path, tmp_path / "b.gpkg"), ("evaluate", path, path)):
        found = linework(*arguments)
        assert found.code in (2, 3), found.stderr
        assert len(found.line) < 400


@pytest.mark.parametrize("number", [LONG, "-" + LONG, "9" * 400, "99999999999999999999", "1e999"])
@pytest.mark.parametrize("name", ["width_m", "kind", "photo"])
def test_attributes_that_no_number_can_hold(linework, tmp_path, name, number):
    path = tmp_path / "a.geojson"
    path.write_text(collection(SOUND, f'{{"kind": "kerb_top", "{name}": {number}}}'))
    found = linework("convert", path, tmp_path / "b.gpkg")
    assert found.code in (0, 2, 3), found.stderr


def test_whole_numbers_of_json():
    values = [0, -5, 2**63 - 1, -(2**63) + 1]
    assert read_json(json.dumps(values), "here") == values
    assert isinstance(read_json(str(2**63), "here"), float)


@pytest.mark.parametrize("place", ["run.json", "a description", "an index", "the record of a surface"])
def test_records_of_ours_that_were_spoilt(linework, tmp_path, place):
    """They are made again, or refused; a work folder may come from anywhere."""
    las = tmp_path / "survey" / "a.laz"
    write_las(road_points(), las, crs=CRS)
    output, work = tmp_path / "a.gpkg", tmp_path / "work"
    arguments = ("extract", las, "-o", output, "--work", work, "--workers", "1", "--quiet")
    assert linework(*arguments).code == 0
    names = {"run.json": [tmp_path / "run.json"]}
    spoilt: list[Path] = names.get(place, sorted(work.rglob("*.json")))
    assert spoilt
    for path in spoilt:
        path.write_text('{"a":' * 100_000)
    found = linework(*arguments, "--overwrite")
    assert found.code in (0, 3, 5), found.stderr
    assert linework(*arguments, "--resume").code in (0, 3, 5, 6)


def texts_of(number: str) -> dict[str, str]:
    """Return logs of each format with a number where one is expected."""
    good = "300000000.0,500000,5400000,100,0,0,90\n300000001.0,500010,5400000,100,0,0,90\n"
    columns = "time_s,easting_m,northing_m,height_m,roll_deg,pitch_deg,heading_deg\n"
    sentence = f"$GPGGA,120000.00,4830.{number},N,00900.0000,E,4,{number},0.8,100.0,M,48.0,M,,*00\n"
    return {
        "trajectory.csv": columns + good.replace("90", number),
        "times.csv": columns + good.replace("300000001.0", number),
        "column.csv": columns.replace("time_s", number) + good,
        "gnss.nmea": sentence * 20,
        "trajectory.txt": f"{number} 1 2 3 0 0 0 1\n" * 20,
        "gnss.pos": f"% GPST\n{number} {number} 48.5 9.0 100.0 1 8 0 0 0 0 0 0 0 0\n" * 20,
    }


@pytest.mark.parametrize(
    "number",
    [LONG, "1e" + "9" * 4000, "0x" + LONG, "٣" * 4000],
    ids=["long", "exponent", "hex", "other digits"],
)
@pytest.mark.parametrize("name", texts_of(""))
def test_logs_and_trajectories(linework, tmp_path, las_file, name, number):
    path = tmp_path / name
    path.write_text(texts_of(number)[name])
    folder = las_file.parent
    if name.startswith("gnss"):
        (folder / path.name).write_text(path.read_text())
        (folder / "survey.toml").write_text(
            f'[points]\nfiles = ["a.laz"]\n[navigation]\ngnss = "{path.name}"\ngyro = "{path.name}"\nwheels = "{path.name}"\n'
            "[vehicle]\ntick_m = 0.01\ntrack_m = 1.5\n"
        )
        found = linework("locate", folder, "-o", tmp_path / "t.csv", "--quiet")
    else:
        found = linework("info", las_file, "--trajectory", path)
        if found.code == 2:  # info has no such option
            found = linework("extract", las_file, "--trajectory", path, "-o", tmp_path / "o.gpkg", "--quiet")
    assert found.code in (2, 3, 4), found.stderr
    assert len(found.line) < 500
