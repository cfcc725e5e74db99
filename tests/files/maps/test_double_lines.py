"""Double lines in maps: one border between two lanes, named from the left, where the middle of both stripes is."""

import json
import subprocess
import sys
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pyogrio
import pytest
from tests.files.maps.checkers import checker
from tests.files.maps.test_lanes_in_maps import _ROUTE
from tests.files.maps.test_opendrive import issues
from tests.scenes.map_scenes import UTM

from linework.files.vectors.read_write import not_expressed, read_lines, write_lines
from linework.lines.doubles import merged_doubles
from linework.model.lines import LineSet

_APART_M = 0.26


def bend_of_doubles(left="solid", right="dashed"):
    """Return two lanes in a bend of 300 m, from its inside out, with a double line between them; dashes of 3/6 m."""
    s = np.linspace(0.0, 120.0, 121)
    table = {
        "inner": (3.5, s, "edge", "solid", False), "a": (_APART_M / 2, s, "centre", left, True),
        "b": (-_APART_M / 2, s, "centre", right, True), "outer": (-3.5, s, "edge", "solid", False),
    }  # fmt: skip
    for side, pattern in ((1, left), (-1, right)):
        if pattern == "dashed":
            for k in range(13):
                table[f"dash{side}{k}"] = (
                    side * _APART_M / 2,
                    s[9 * k + 1 : 9 * k + 5],
                    "",
                    "dashed",
                    False,
                )
    shapes = []
    for offset, along, *_ in table.values():
        angle, radius = along / 300.0, 300.0 - offset
        plan = [radius * np.sin(angle) + 512_345.6, 300.0 - radius * np.cos(angle) + 5_403_210.9]
        shapes.append(np.column_stack([*plan, 101.5 + 0.02 * along - 0.02 * abs(offset)]))
    n = sum(map(len, shapes))
    return LineSet.from_lines(
        shapes, crs=UTM, id=list(table), kind=["lane_marking" if v[2] else "lane_marking_dash" for v in table.values()],
        role=[v[2] for v in table.values()], pattern=[v[3] for v in table.values()],
        double=[v[4] for v in table.values()], width_m=[0.12] * len(table), sigma_xy_m=np.full(n, 0.01),
    )  # fmt: skip


def away_from_middle(xyz):
    """Return the distances of places from the middle of the double line, in plan and in height."""
    east, north = xyz[:, 0] - 512_345.6, 300.0 - (xyz[:, 1] - 5_403_210.9)
    up = 101.5 + 0.02 * 300.0 * np.arctan2(east, north) - 0.02 * _APART_M / 2
    return np.abs(np.hypot(east, north) - 300.0), np.abs(xyz[:, 2] - up)


@pytest.mark.parametrize(
    ("left", "right"), [("solid", "solid"), ("solid", "dashed"), ("dashed", "solid"), ("dashed", "dashed")]
)
@pytest.mark.parametrize("suffix", [".osm", ".xodr"])
def test_a_double_line_is_one_line_and_comes_back(tmp_path, suffix, left, right):
    path = tmp_path / f"map{suffix}"
    write_lines(bend_of_doubles(left, right), path)
    back = read_lines(path)
    (middle,) = back.take(back.double)
    assert middle.id == "a+b" and middle.pattern == f"{left}_{right}" and middle.role == "centre"
    assert middle.width_m == pytest.approx(_APART_M + 0.12, abs=1e-3)
    plan, height = away_from_middle(middle.xyz)
    # Chords of 1 m are 0.4 mm inside the bend
    assert plan.max() < 1e-3 and height.max() < 1e-3
    assert set(back.id) == {"inner", "a+b", "outer"}
    text = not_expressed(bend_of_doubles(left, right), path)[0]
    assert "the places of both stripes of 1 double lines" in text


@pytest.mark.parametrize("program", ["lanelet2", "simple-lanelet2"])
def test_lanes_on_both_sides_of_a_double_line_are_neighbours(tmp_path, program):
    path = tmp_path / "map.osm"
    write_lines(bend_of_doubles("dashed", "dashed"), path, lanes=True, location="nonurban")
    python = sys.executable if program == "lanelet2" else checker("python")
    done = subprocess.run([python, "-c", _ROUTE, str(path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["problems"] == [] and len(found["lengths"]) == 2 and found["beside"] == 2


@pytest.mark.parametrize("subtype", ["solid_solid", "solid_dashed", "dashed_solid"])
def test_lanelets_share_the_way_of_a_double_line(tmp_path, subtype):
    path = tmp_path / "map.osm"
    write_lines(bend_of_doubles(*subtype.split("_")), path, lanes=True, location="urban")
    root = ElementTree.parse(path).getroot()
    tags = {way.get("id"): {t.get("k"): t.get("v") for t in way.iter("tag")} for way in root.iter("way")}
    sides = [[m.get("ref") for m in one.iter("member")] for one in root.iter("relation")]
    (shared,) = set(sides[0]) & set(sides[1])
    assert tags[shared]["subtype"] == subtype and tags[shared]["type"] == "line_thin"


@pytest.mark.parametrize(
    ("left", "right"), [("solid", "solid"), ("solid", "dashed"), ("dashed", "solid"), ("dashed", "dashed")]
)
def test_asam_finds_no_issue_in_double_lines(tmp_path, left, right):
    path = tmp_path / "road.xodr"
    write_lines(bend_of_doubles(left, right), path, lanes=True)
    assert issues(path) == ([], ["check_asam_xodr_junctions_connection_one_connection_element"])
    root = ElementTree.parse(path).getroot()
    lanes = [lane for lane in root.iter("lane") if lane.get("id") != "0"]
    assert [lane.get("type") for lane in lanes] == ["driving", "driving"]
    (mark,) = (mark for mark in root.iter("roadMark") if " " in mark.get("type"))
    lines = {float(line.get("tOffset")): line for line in mark.iter("line")}
    assert sorted(lines) == pytest.approx([-_APART_M / 2, _APART_M / 2], abs=1e-3)
    # The road runs along the longest line, whichever way that goes; here as drawn, so left is the inside of the bend
    for t, line in lines.items():
        space = float(line.get("space"))
        assert (space == pytest.approx(6.0, abs=0.01)) == ((left if t > 0 else right) == "dashed")


def test_what_one_stripe_is_longer_by_stays_a_line():
    s = np.linspace(0.0, 100.0, 101)
    shapes = [
        np.column_stack([s, 0 * s, 0 * s]),
        np.column_stack([s[20:60], 0 * s[20:60] + 0.25, 0 * s[20:60]]),
    ]
    lines = LineSet.from_lines(shapes, kind=["lane_marking"] * 2, id=["long", "short"], pattern=["solid", "dashed"],
                               double=[False, True])  # fmt: skip
    for order in ([0, 1], [1, 0]):
        found = merged_doubles(lines.take(order)).lines
        assert sorted(found.id.tolist()) == ["long.1", "long.2", "short+long"]
        assert found.length_m[found.id == "short+long"][0] == pytest.approx(39.0, abs=0.3)
        assert found.length_m.sum() == pytest.approx(100.0, abs=0.3)
    # Nobody says that they are one line; other kinds of lines are none; crossing lines are none
    for other in (
        lines.with_columns(double=[False, False]),
        lines.with_columns(kind=["lane_marking", "road_boundary"]),
        lines.with_columns(review=["", "rejected"]),
    ):
        assert merged_doubles(other).lines == other


def test_convert_merges_double_lines_on_request(linework, tmp_path):
    write_lines(bend_of_doubles(), tmp_path / "a.gpkg")
    found = linework("convert", tmp_path / "a.gpkg", tmp_path / "b.gpkg", "--merge-doubles", "--lanes")
    assert found.code == 0, found.stderr
    back = read_lines(tmp_path / "b.gpkg")
    assert sorted(back.pattern[back.kind == "lane_marking"].tolist()) == ["solid", "solid", "solid_dashed"]
    _, _, _, values = pyogrio.raw.read(tmp_path / "b.gpkg", layer="lane", columns=["left_id", "right_id"])
    assert "a+b" in {*values[0]} & {*values[1]}
    assert linework("convert", tmp_path / "a.gpkg", tmp_path / "a.dxf", "--merge-doubles").code == 0
    layers = {e.dxf.layer for e in ezdxf.readfile(tmp_path / "a.dxf").modelspace()}
    assert {"lane_marking_solid_dashed", "lane_marking_solid"} <= layers
    found = linework("convert", tmp_path / "a.gpkg", tmp_path / "a.qgz", "--merge-doubles")
    assert found.code == 2 and "merge into a .gpkg first" in found.line.lower()
