"""A geometry that cannot be read is named with its feature and vertex, and the other lines of its file are used."""

from __future__ import annotations

import json
import sqlite3
import struct
from contextlib import closing
from pathlib import Path

import ezdxf
import numpy as np
import pyogrio
import pytest
import shapely

import linework as lw
from linework.errors import InputError, LineworkWarning
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.lines import LineSet

UTM = "EPSG:25832"
GOOD = [
    [[0.0, 1.0, 1.0], [9.0, 1.0, 1.0]],
    [[0.0, 2.0, 1.0], [9.0, 2.0, 1.0]],
    [[0.0, 3.0, 1.0], [9.0, 3.0, 1.0]],
]


def geojson(folder: Path, second: object, kind: str = "LineString") -> Path:
    """Write three features, of which the second has these coordinates."""
    features = [
        {
            "type": "Feature",
            "properties": {"kind": "guardrail"},
            "geometry": {"type": "LineString", "coordinates": xyz},
        }
        for xyz in GOOD
    ]
    features[1]["geometry"] = {"type": kind, "coordinates": second}
    crs = {"type": "name", "properties": {"name": UTM}}
    path = folder / "a.geojson"
    path.write_text(
        json.dumps({"type": "FeatureCollection", "crs": crs, "features": features}), encoding="utf-8"
    )
    return path


@pytest.mark.parametrize(
    ("second", "kind", "problem"),
    [
        ([[0, 1], [2]], "LineString", "vertex 2 is not two or three finite numbers"),
        ([[0, 1], [2, "3"]], "LineString", "vertex 2 is not two or three finite numbers"),
        ([[0, 1], [2, 3], None], "LineString", "vertex 3 is not two or three finite numbers"),
        ([[0, 1], [float("nan"), 3]], "LineString", "vertex 2 is not two or three finite numbers"),
        ([[0, 1], [float("inf"), 3]], "LineString", "vertex 2 is not two or three finite numbers"),
        (
            [[[0, 1], [2, 3]], [[4, 5], [6, {}]]],
            "MultiLineString",
            "vertex 4 is not two or three finite numbers",
        ),
        ("text", "LineString", "vertex 1 is not two or three finite numbers"),
        ([[0, 1]], "LineString", "an invalid geometry"),
        ([[0, 1], [2, 3]], "Nonsense", "an invalid geometry"),
    ],
)
def test_geojson(tmp_path, second, kind, problem):
    path = geojson(tmp_path, second, kind)
    with pytest.warns(LineworkWarning) as warned:
        lines = read_lines(path)
    assert [str(w.message).startswith(f"{path}: left out feature 2: {problem}") for w in warned] == [True]
    assert lines.xyz[:, 1].tolist() == [1, 1, 3, 3]


def test_our_own_geojson(tmp_path):
    path = tmp_path / "a.geojson"
    write_lines(LineSet.from_lines([np.array(xyz) for xyz in GOOD], kind="guardrail", crs=UTM), path)
    path.write_text(path.read_text().replace("[0.0,2.0,1.0]", "[0.0,NaN,1.0]"))
    with pytest.warns(
        LineworkWarning, match="left out feature 2: vertex 1 is not two or three finite numbers"
    ):
        assert len(read_lines(path)) == 2


def cut(blob: bytes) -> bytes:
    return blob[:-5]


def zeros(blob: bytes) -> bytes:
    return b"\0" * len(blob)


def not_finite(blob: bytes) -> bytes:
    return blob[:-16] + struct.pack("<d", np.nan) + blob[-8:]


def geopackage(path: Path, *, is_ours: bool, change) -> Path:
    """Write three lines, change the bytes of the second's geometry, and add one that has none."""
    if is_ours:
        write_lines(LineSet.from_lines([np.array(xyz) for xyz in GOOD], kind="guardrail", crs=UTM), path)
    else:
        shapes = shapely.to_wkb(np.array([shapely.LineString(xyz) for xyz in GOOD], dtype=object))
        pyogrio.raw.write(
            path,
            shapes,
            [np.array([1, 2, 3])],
            ["n"],
            layer="guardrail",
            geometry_type="LineString Z",
            crs=UTM,
        )
    with closing(sqlite3.connect(path)) as db:
        for (name,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            db.execute(f'DROP TRIGGER "{name}"')
        ((blob,),) = db.execute("SELECT geom FROM guardrail WHERE fid = 2").fetchall()
        db.execute("UPDATE guardrail SET geom = ? WHERE fid = 2", (change(bytes(blob)),))
        db.execute("INSERT INTO guardrail (fid, geom) VALUES (9, NULL)")
        db.commit()
    return path


@pytest.mark.parametrize("is_ours", [True, False], ids=["ours", "of another program"])
@pytest.mark.parametrize("change", [cut, zeros, not_finite])
def test_geopackage(tmp_path, change, is_ours):
    """GDAL drops a damaged geometry without a word; one that was never there is no damage."""
    path = geopackage(tmp_path / "a.gpkg", is_ours=is_ours, change=change)
    what = r": vertex [12] is not finite" if change is not_finite else ": its geometry is damaged"
    with pytest.warns(LineworkWarning, match=f"left out feature 2 of layer guardrail{what}$"):
        lines = read_lines(path)
    assert lines.xyz[:, 1].tolist() == [1, 1, 3, 3]


@pytest.mark.parametrize("suffix", ["fgb", "shp"])
def test_flatgeobuf_and_shapefile(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    xyz = np.array(GOOD)
    xyz[1, 1, 0] = 7.5
    shapes = shapely.to_wkb(np.array([shapely.LineString(line) for line in xyz], dtype=object))
    more = {"layer_options": {"SPATIAL_INDEX": "NO"}} if suffix == "fgb" else {}
    pyogrio.raw.write(
        path, shapes, [np.array([1, 2, 3])], ["n"], geometry_type="LineString Z", crs=UTM, **more
    )
    data = path.read_bytes()
    at = data.rfind(struct.pack("<d", 7.5))
    path.write_bytes(data[:at] + struct.pack("<d", np.nan) + data[at + 8 :])
    with pytest.warns(LineworkWarning, match="left out feature 1 of layer a: vertex 2 is not finite$"):
        assert read_lines(path).xyz[:, 1].tolist() == [1, 1, 3, 3]


def test_dxf(tmp_path):
    path = tmp_path / "a.dxf"
    drawing = ezdxf.new()
    for x, y, _ in np.array(GOOD)[:, 0]:
        drawing.modelspace().add_line(
            (x, y, 0), (np.nan if y == 2 else 9, y, 0), dxfattribs={"layer": "kerb"}
        )
    handle = drawing.modelspace()[1].dxf.handle
    drawing.saveas(path)
    with pytest.warns(
        LineworkWarning, match=f"left out LINE {handle} on layer kerb: vertex 2 is not finite$"
    ):
        assert len(read_lines(path)) == 2


def test_many_are_counted_and_a_file_of_nothing_else_is_refused(tmp_path):
    path = geojson(tmp_path, [[0]])
    document = json.loads(path.read_text())
    document["features"] += document["features"][1:2] * 20
    path.write_text(json.dumps(document))
    with pytest.warns(LineworkWarning, match=r"left out feature 2: vertex 1 is .* and 20 other features$"):
        assert len(read_lines(path)) == 2
    document["features"] = document["features"][1:2]
    path.write_text(json.dumps(document))
    with pytest.raises(
        InputError, match="no line can be read: feature 1: vertex 1 is not two or three finite numbers"
    ):
        read_lines(path)


def test_what_nobody_asked_for_is_no_loss(tmp_path):
    path = geojson(tmp_path, [[0, 1], [2, 3]])
    text = path.read_text().replace('"guardrail"', '"kerb"', 1)
    path.write_text(text)
    assert len(read_lines(path, kinds={"guardrail": "guardrail"})) == 2


def test_commands_use_the_rest_and_end_with_4(linework, tmp_path):
    path = geojson(tmp_path, [[0, 1], [2]])
    out = tmp_path / "out.gpkg"
    found = linework("convert", path, out)
    assert (found.code, found.line) == (
        4, f"error: {path}: left out feature 2: vertex 2 is not two or three finite numbers. The other lines are converted.",
    )  # fmt: skip
    assert len(lw.read_lines(out)) == 2
    scored = linework("evaluate", out, path)
    assert scored.code == 4
    assert "guardrail" in scored.stdout
    assert "left out feature 2: vertex 2" in scored.line


def test_a_line_is_not_added_to_a_file_that_would_lose_others(linework, tmp_path):
    from linework.cli.commands.trace import _joined_to_output

    path = geojson(tmp_path, [[0, 1], [2]])
    with pytest.raises(InputError, match=r"left out feature 2.*Correct them, or write to another file\."):
        _joined_to_output(path, LineSet.empty(UTM))
