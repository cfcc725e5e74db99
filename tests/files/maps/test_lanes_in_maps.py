"""Lanes in files: a layer, lanelets that Lanelet2 finds routes on, and lanes of OpenDRIVE; none without being asked."""

import json
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pyogrio
import pytest
from tests.files.maps.checkers import checker
from tests.scenes.map_scenes import UTM

from linework.errors import UsageError
from linework.files.line_file.carried_history import added_by_others
from linework.files.line_file.file import LineFile
from linework.files.vectors.read_write import not_expressed, read_lines, write_lines
from linework.lines.lane_sections import lane_roads
from linework.lines.lanes import find_lanes
from linework.model.lines import LineSet

_ROUTE = """
import sys, json
import lanelet2
from lanelet2.projection import UtmProjector
found, problems = lanelet2.io.loadRobust(sys.argv[1], UtmProjector(lanelet2.io.Origin(49.0, 8.9)))
rules = lanelet2.traffic_rules.create(
    lanelet2.traffic_rules.Locations.Germany, lanelet2.traffic_rules.Participants.Vehicle)
graph = lanelet2.routing.RoutingGraph(found, rules)
longest = 0
for a in found.laneletLayer:
    for b in found.laneletLayer:
        path = graph.shortestPath(a, b)
        longest = max(longest, len(path) if path is not None else 0)
lengths = [lanelet2.geometry.length2d(one) for one in found.laneletLayer]
print(json.dumps({"problems": [*map(str, problems), *map(str, graph.checkValidity())], "lengths": lengths,
    "longest": longest,
    "beside": sum(graph.left(one) is not None or graph.right(one) is not None for one in found.laneletLayer)}))
"""


def road_of_lanes():
    """Return three lanes of a bend: the third begins later, and one edge line is hidden for a while."""
    s = np.linspace(0.0, 120.0, 121)
    table = {
        "left": (3.5, s, "edge", "solid"), "middle": (0.0, s, "lane", "dashed"),
        "right": (-3.4, s, "edge", "solid"), "outer": (-6.8, s[40:], "edge", "solid"),
    }  # fmt: skip
    shapes, bridged = [], []
    for name, (offset, along, _, _) in table.items():
        angle, radius = along / 300.0, 300.0 - offset
        shapes.append(
            np.column_stack([
                radius * np.sin(angle) + 512_345.6, 300.0 - radius * np.cos(angle) + 5_403_210.9,
                101.5 + 0.02 * along - 0.02 * abs(offset),
            ])
        )  # fmt: skip
        bridged += [name in ("left", "middle") and 70 <= a <= 80 for a in along.tolist()]
    return LineSet.from_lines(
        shapes, crs=UTM, id=list(table), kind=["lane_marking"] * 4, role=[v[2] for v in table.values()],
        pattern=[v[3] for v in table.values()], bridged=bridged, sigma_xy_m=np.full(len(bridged), 0.01),
    )  # fmt: skip


@pytest.mark.parametrize("program", ["lanelet2", "simple-lanelet2"])
def test_routes_are_found_on_lanelets(tmp_path, program):
    path = tmp_path / "map.osm"
    write_lines(road_of_lanes(), path, lanes=True, location="nonurban")
    python = sys.executable if program == "lanelet2" else checker("python")
    done = subprocess.run([python, "-c", _ROUTE, str(path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["problems"] == []
    # Left lane: before and behind where both bounds are hidden. Middle lane: cut there, and where the third begins
    lanes = find_lanes(road_of_lanes())
    assert sum(found["lengths"]) == pytest.approx(lanes.centre.length_m.sum(), rel=0.02)
    assert found["longest"] >= 2
    assert found["beside"] >= 4


def test_bounds_are_shared_and_where_the_lines_are(tmp_path):
    lines, path = road_of_lanes(), tmp_path / "map.osm"
    write_lines(lines, path, lanes=True, location="urban")
    root = ElementTree.parse(path).getroot()
    ways = {way.get("id"): [n.get("ref") for n in way.iter("nd")] for way in root.iter("way")}
    lanelets = list(root.iter("relation"))
    used = [
        {m.get("role"): m.get("ref") for m in one.iter("member") if m.get("type") == "way"}
        for one in lanelets
    ]
    assert all(set(one) == {"left", "right"} and set(one.values()) <= set(ways) for one in used)
    sides = [ref for one in used for ref in one.values()]
    assert len(set(sides)) < len(sides)  # lanes beside each other have one way between them
    tags = [{tag.get("k"): tag.get("v") for tag in one.iter("tag")} for one in lanelets]
    assert {(t["type"], t["subtype"], t["location"], t["one_way"]) for t in tags} == {
        ("lanelet", "road", "urban", "no")
    }
    assert not any("speed" in name for t in tags for name in t)
    # Read back as lines, the pieces are the lines
    back = read_lines(path)
    assert back.length_m.sum() == pytest.approx(lines.length_m.sum(), abs=1e-3)
    assert {name.partition(".")[0] for name in back.id.tolist()} == set(lines.id)


def test_stretches_of_lanes_that_are_left_out_are_reported(tmp_path, monkeypatch):
    """Two roads whose lanes lie between the same lines: the first has them."""
    monkeypatch.setattr("linework.files.maps.lanelets.lane_roads", lambda lines: 2 * lane_roads(lines))
    write_lines(road_of_lanes(), tmp_path / "map.osm", lanes=True, location="urban")
    (text,) = not_expressed(road_of_lanes(), tmp_path / "map.osm", "urban")
    n = len(list(ElementTree.parse(tmp_path / "map.osm").iter("relation")))
    assert n > 0 and " stretches of lanes whose lines bound another road there (the first at 5123" in text
    assert "stretches of lanes" not in "".join(not_expressed(road_of_lanes(), tmp_path / "map.osm"))


def test_lanelets_have_the_same_ids_in_every_run(tmp_path):
    for name in ("a.osm", "b.osm"):
        write_lines(road_of_lanes(), tmp_path / name, lanes=True, location="urban")
    assert (tmp_path / "a.osm").read_bytes() == (tmp_path / "b.osm").read_bytes()


def test_without_lanes_there_are_none(tmp_path):
    write_lines(road_of_lanes(), tmp_path / "map.osm")
    assert not list(ElementTree.parse(tmp_path / "map.osm").iter("relation"))
    write_lines(road_of_lanes(), tmp_path / "lines.gpkg")
    assert "lane" not in [name for name, _ in pyogrio.list_layers(tmp_path / "lines.gpkg")]
    write_lines(road_of_lanes(), tmp_path / "road.xodr")
    assert {lane.get("type") for lane in ElementTree.parse(tmp_path / "road.xodr").iter("lane")} == {"none"}


def test_opendrive_has_the_lanes_to_drive_on(tmp_path):
    """A parking strip beside an edge line is in the file, but not of the type driving."""
    lines = road_of_lanes()
    strip = lines.take([0]).with_columns(
        id=["kerb"], kind=["road_boundary"], role=[""], pattern=[""],
        xyz=lines[0].xyz + 2.5 * np.array([[-np.sin(a), np.cos(a), 0] for a in np.linspace(0, 0.4, 121)]),
    )  # fmt: skip
    path = tmp_path / "road.xodr"
    write_lines(LineSet.concatenate([lines, strip]), path, lanes=True)
    root = ElementTree.parse(path).getroot()
    types = [lane.get("type") for lane in root.iter("lane") if lane.get("id") != "0"]
    assert set(types) == {"driving", "none"}


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson"])
def test_a_layer_of_lanes_is_beside_the_lines(tmp_path, suffix):
    lines, path = road_of_lanes(), tmp_path / f"lines{suffix}"
    write_lines(lines, path, lanes=True)
    assert read_lines(path) == lines
    lanes = find_lanes(lines)
    if suffix == ".gpkg":
        meta, _, _, values = pyogrio.raw.read(path, layer="lane")
        assert pyogrio.read_info(path, layer="lane")["geometry_type"] == "LineString Z"
        table = dict(zip(meta["fields"], values, strict=True))
        # Neither the workbench nor a new extraction takes the layer for something of another program
        assert added_by_others(path) == []
        with LineFile.opened(path, crs=lines.crs) as opened:
            assert opened.lines.id.tolist() == lines.id.tolist()
    else:
        rows = [
            f["properties"]
            for f in json.loads(path.read_text())["features"]
            if f["properties"]["kind"] == "lane"
        ]
        table = {name: [row[name] for row in rows] for name in rows[0]}
    assert list(table["id"]) == lanes.centre.id.tolist()
    for name in ("left_id", "right_id"):
        assert list(table[name]) == getattr(lanes, name).tolist()
    for name in ("width_m", "width_min_m", "width_max_m", "sigma_width_m", "measured_share"):
        np.testing.assert_allclose(np.array(table[name], dtype=float), getattr(lanes, name), atol=1e-4)
    assert "next_id" in table and "confidence" in table


def test_lines_without_ids_get_those_that_lanes_name(tmp_path):
    write_lines(road_of_lanes().with_columns(id=[""] * 4), tmp_path / "a.gpkg", lanes=True)
    meta, _, _, values = pyogrio.raw.read(tmp_path / "a.gpkg", layer="lane")
    table = dict(zip(meta["fields"], values, strict=True))
    ids = set(read_lines(tmp_path / "a.gpkg").id.tolist())
    assert "" not in ids and {*table["left_id"], *table["right_id"]} <= ids


def test_rejected_lines_bound_no_lane(tmp_path):
    lines = road_of_lanes()
    write_lines(lines.with_columns(review=["", "rejected", "", ""]), tmp_path / "a.gpkg", lanes=True)
    meta, _, _, values = pyogrio.raw.read(tmp_path / "a.gpkg", layer="lane")
    table = dict(zip(meta["fields"], values, strict=True))
    assert "middle" not in {*table["left_id"], *table["right_id"]}


@pytest.mark.parametrize(
    ("name", "given", "words"),
    [
        ("a.osm", {"lanes": True}, "lanelets need a location"),
        ("a.osm", {"location": "urban"}, "is for lanes in .osm files"),
        ("a.gpkg", {"lanes": True, "location": "urban"}, "is for lanes in .osm files"),
        (
            "a.osm",
            {"lanes": True, "location": "town"},
            "unknown location 'town'. Use urban, nonurban, private",
        ),
        ("a.dxf", {"lanes": True}, "'.dxf' files hold no lanes"),
        ("a.parquet", {"lanes": True}, "'.parquet' files hold no lanes"),
    ],
)
def test_what_cannot_be_is_one_line(tmp_path, name, given, words):
    with pytest.raises(UsageError, match=words) as caught:
        write_lines(road_of_lanes(), tmp_path / name, **given)
    assert "\n" not in str(caught.value) and not list(tmp_path.iterdir())


def test_convert_writes_lanes(linework, tmp_path):
    write_lines(road_of_lanes(), tmp_path / "a.gpkg")
    found = linework("convert", tmp_path / "a.gpkg", tmp_path / "a.osm", "--lanes")
    assert found.code == 2 and "Give --location urban, nonurban or private" in found.line
    found = linework("convert", tmp_path / "a.gpkg", tmp_path / "a.osm", "--lanes", "--location", "private")
    assert found.code == 0, found.stderr
    assert 'k="location" v="private"' in (tmp_path / "a.osm").read_text()
    found = linework("convert", tmp_path / "a.gpkg", tmp_path / "a.kml", "--lanes")
    assert found.code == 2 and "leave --lanes out" in found.line.lower()
    assert linework("convert", tmp_path / "a.gpkg", tmp_path / "b.gpkg", "--lanes").code == 0
    # A project has the layer, too
    assert linework("convert", tmp_path / "b.gpkg", tmp_path / "b.qgz").stdout.startswith("2 layers")


def test_extract_checks_before_any_work(linework, las_file, tmp_path):
    found = linework("extract", las_file, "-o", tmp_path / "a.osm", "--lanes")
    assert found.code == 2 and "lanelets need a location" in found.line
    assert not (las_file.parent / ".linework").exists()
    found = linework("extract", las_file, "-o", tmp_path / "a.gpkg", "--lanes", "--features", "lane_marking")
    assert found.code == 0, found.stderr
    assert "lane                0 lanes" in found.stdout
    record = json.loads((tmp_path / "run.json").read_text())
    assert record["counts"]["lanes"] == 0 and record["parameters"]["lanes"] is True
    assert pyogrio.read_info(tmp_path / "a.gpkg", layer="lane")["features"] == 0
