"""Lanelet2 maps: read by Lanelet2 itself to the millimetre, ids the same in every run, other maps read."""

import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from tests.files.maps.checkers import checker
from tests.scenes.map_scenes import UTM, road_lines

from linework.crs import parse_crs
from linework.errors import CrsError, InputError, LineworkWarning
from linework.files.maps.degrees import from_degrees, in_degrees
from linework.files.maps.lanelets import NEAREST_M
from linework.files.vectors.read_write import not_expressed, read_lines, write_lines
from linework.model.lines import LineSet

#: Lanelet2 is a library of C++ whose types are registered once per process.
_READ = """
import sys, json
import lanelet2
from lanelet2.projection import GeocentricProjector
projector = GeocentricProjector()
lanelet_map, problems = lanelet2.io.loadRobust(sys.argv[1], projector)
found = []
for line in lanelet_map.lineStringLayer:
    places = [projector.reverse(lanelet2.core.BasicPoint3d(p.x, p.y, p.z)) for p in line]
    tags = dict(line.attributes.items())
    found.append([line.id, [[p.lat, p.lon, p.alt] for p in places], tags])
print(json.dumps({"problems": list(map(str, problems)), "lines": found}))
"""


def by_lanelet2(path):
    """Return what Lanelet2 reads of a file: problems, and id, places and tags of each line."""
    import json

    done = subprocess.run([sys.executable, "-c", _READ, str(path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_lanelet2_reads_the_same_positions(tmp_path):
    lines, path = road_lines(), tmp_path / "map.osm"
    write_lines(lines, path)
    found = by_lanelet2(path)
    assert found["problems"] == []
    there = {tags["linework:id"]: (places, tags) for _, places, tags in found["lines"]}
    assert set(there) == {"edge", "dashed", "kerb", "verge", "rail", "wall", "stop"}
    for i, name in enumerate(lines.id.tolist()):
        if name in there:
            places, _ = there[name]
            xyz = from_degrees(np.array(places), lines.crs)
            np.testing.assert_allclose(xyz, lines[i].xyz, atol=1e-3)
    types = {name: (tags["type"], tags.get("subtype", "")) for name, (_, tags) in there.items()}
    assert types == {
        "edge": ("line_thick", "solid"), "dashed": ("line_thin", "dashed"), "kerb": ("curbstone", "high"),
        "verge": ("road_border", ""), "rail": ("guard_rail", ""), "wall": ("jersey_barrier", ""),
        "stop": ("stop_line", ""),
    }  # fmt: skip
    assert float(there["kerb"][1]["height"]) == 0.12
    assert "height" not in there["rail"][1]  # the line of a rail is its upper edge


def test_every_node_has_a_height_and_neighbours_are_apart(tmp_path):
    """What Lanelet2's validator checks of lines, with the height that its reader takes for 0 where it is absent."""
    lines, path = road_lines(), tmp_path / "map.osm"
    level = lines.with_columns(xyz=lines.xyz * [1, 1, 0])
    close = LineSet.concatenate([level, LineSet.from_lines([level.xyz[:1] + np.linspace(0, 1, 51)[:, None] * [1, 0, 0]],
                                                          kind=["guardrail"], id=["close"], crs=UTM)])  # fmt: skip
    write_lines(close, path)
    root = ElementTree.parse(path).getroot()
    places = {node.get("id"): node for node in root.iter("node")}
    assert {tag.get("v") for node in places.values() for tag in node.iter("tag")} == {"0.0000"}
    assert all(len(node.findall("tag[@k='ele']")) == 1 for node in places.values())
    for way in root.iter("way"):
        degrees = np.array(
            [[float(places[n.get("ref")].get(k)) for k in ("lat", "lon")] for n in way.iter("nd")]
        )
        xyz = from_degrees(np.column_stack([degrees, np.zeros(len(degrees))]), parse_crs(UTM))
        assert np.linalg.norm(np.diff(xyz, axis=0), axis=1).min() >= NEAREST_M - 1e-6
    assert len(list(root.iter("way"))) == 8
    assert "34 vertices nearer than 5 cm" in not_expressed(close, path)[0]


def test_ids_are_those_of_the_run_before(tmp_path):
    lines = road_lines()
    write_lines(lines, tmp_path / "a.osm")
    write_lines(lines.take(np.arange(len(lines))[::-1]), tmp_path / "b.osm")
    nodes = [{n.get("id"): (n.get("lat"), n.get("lon")) for n in ElementTree.parse(tmp_path / f).iter("node")}
             for f in ("a.osm", "b.osm")]  # fmt: skip
    assert nodes[0] == nodes[1]
    ids = [[way.get("id") for way in ElementTree.parse(tmp_path / f).iter("way")] for f in ("a.osm", "b.osm")]
    assert ids[0] == ids[1][::-1]


def test_our_own_map_comes_back_with_its_attributes(tmp_path):
    lines = road_lines()
    write_lines(lines, tmp_path / "map.osm")
    back = read_lines(tmp_path / "map.osm")
    kept = lines.take(np.isin(lines.id, back.id))
    assert back.crs == lines.crs
    np.testing.assert_allclose(back.xyz, kept.xyz, atol=1e-4)
    for name in ("id", "kind", "pattern", "form", "double", "width_m", "height_m", "confidence"):
        np.testing.assert_array_equal(getattr(back, name), getattr(kept, name))


def test_what_has_no_type_is_said(tmp_path):
    (text,) = not_expressed(road_lines(), tmp_path / "map.osm")
    assert "1 lines of kerb_top, 1 lines of cable" in text and "standard deviations of the vertices" in text


def test_heights_above_the_ellipsoid_need_a_grid(tmp_path):
    xyz = np.array([[500_000.0, 5_400_000.0, 100.0]])
    with pytest.raises(CrsError, match=r"no exact transformation .* with heights above the ellipsoid"):
        in_degrees(xyz, parse_crs(UTM), heights="ellipsoid", where=tmp_path)


def test_local_lines_have_no_degrees(tmp_path):
    with pytest.raises(CrsError, match="these are local"):
        write_lines(road_lines().with_columns(crs="local"), tmp_path / "map.osm")


FOREIGN = """<osm version="0.6">
<node id="1" lat="49.00345654351" lon="8.42427590707"><tag k="ele" v="1.5"/></node>
<node id="2" lat="49.00345654351" lon="8.42437590707"/>
<node id="-3" lat="49.00355654351" lon="8.42437590707"/>
<node id="4" lat="x" lon="8"/>
<way id="10"><nd ref="1"/><nd ref="2"/><nd ref="-3"/><tag k="type" v="line_thin"/><tag k="subtype" v="solid_dashed"/></way>
<way id="11"><nd ref="1"/><nd ref="2"/><tag k="type" v="curbstone"/><tag k="subtype" v="high"/></way>
<way id="12"><nd ref="1"/><nd ref="99"/><tag k="type" v="virtual"/></way>
<way id="13"><nd ref="1"/><nd ref="4"/></way>
<relation id="20"><member type="way" ref="10" role="left"/><tag k="type" v="lanelet"/></relation>
</osm>"""


def test_maps_of_others_are_read_in_a_crs_that_is_given(tmp_path):
    path = tmp_path / "other.osm"
    path.write_text(FOREIGN)
    with pytest.raises(CrsError, match="the middle is in EPSG:32632"):
        read_lines(path)
    with pytest.warns(LineworkWarning, match="left out way 12: node 99 is not in the file and 1 other"):
        lines = read_lines(path, crs="EPSG:32632")
    assert lines.kind.tolist() == ["lane_marking", "road_boundary"]
    assert lines.pattern.tolist() == ["solid_dashed", ""] and lines.double.tolist() == [True, False]
    assert lines.form.tolist() == ["", "kerb"]
    assert lines.xyz[:2, 2].tolist() == [1.5, 0.0]
    assert abs(lines.length_m[1] - 7.3) < 0.1  # 0.0001 degrees of longitude at latitude 49
    with pytest.warns(LineworkWarning):
        assert read_lines(path, crs="EPSG:32632", kind_field="type").kind.tolist() == [
            "line_thin",
            "curbstone",
        ]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty file"),
        ("<osm", "is not XML"),
        ("<html/>", "not osm: its root is html"),
        ('<!DOCTYPE osm [<!ENTITY a "aaaa">]><osm/>', "document type is not read"),
        ('<osm><MetaInfo crs="nonsense"/></osm>', "is not a CRS"),
    ],
)
def test_what_is_no_map_is_one_line(tmp_path, text, words):
    path = tmp_path / "a.osm"
    path.write_text(text)
    with pytest.raises((InputError, CrsError), match=words) as caught:
        read_lines(path)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)


def test_heights_above_the_ellipsoid_where_the_crs_has_them(tmp_path):
    """In a CRS with heights above the ellipsoid (ETRS89, three dimensions) both are the same numbers."""
    import pyproj

    crs = pyproj.CRS.from_epsg(25832).to_3d().to_wkt("WKT2_2019")
    lines = LineSet.from_lines(
        [[[500_000, 5_400_000, 140.0], [500_010, 5_400_000, 141.0]]], crs=crs, kind=["guardrail"]
    )
    write_lines(lines, tmp_path / "a.osm", heights="ellipsoid")
    texts = [
        tag.get("v") for tag in ElementTree.parse(tmp_path / "a.osm").iter("tag") if tag.get("k") == "ele"
    ]
    assert sorted(texts) == ["140.0000", "141.0000"]
    np.testing.assert_allclose(read_lines(tmp_path / "a.osm").xyz, lines.xyz, atol=1e-4)


def test_heights_are_for_lanelet2(linework, tmp_path):
    write_lines(road_lines(), tmp_path / "a.gpkg")
    found = linework("convert", tmp_path / "a.gpkg", tmp_path / "a.geojson", "--heights", "ellipsoid")
    assert found.code == 2 and "--heights ellipsoid is for .osm files" in found.line
    found = linework("convert", tmp_path / "a.gpkg", tmp_path / "a.osm", "--heights", "ellipsoid")
    assert found.code == 3 and "with heights above the ellipsoid. Leave --heights" in found.line
    assert linework("convert", tmp_path / "a.gpkg", tmp_path / "a.osm", "--heights", "sea").code == 2
    found = linework("convert", tmp_path / "a.gpkg", tmp_path / "a.osm")
    assert found.code == 0 and "left out 1 lines of kerb_top, 1 lines of cable" in found.stderr


def test_a_second_reader_finds_the_same_positions(tmp_path):
    """The reimplementation in Rust has the name of the original, so it lives in an environment of its own."""
    import json

    lines, path = road_lines(), tmp_path / "map.osm"
    write_lines(lines, path)
    done = subprocess.run([checker("python"), "-c", _READ, str(path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["problems"] == []
    for _, places, tags in found["lines"]:
        xyz = from_degrees(np.array(places), lines.crs)
        np.testing.assert_allclose(xyz, lines[lines.id.tolist().index(tags["linework:id"])].xyz, atol=1e-3)
