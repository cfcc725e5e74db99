"""OpenDRIVE: no issue in ASAM's checker, the same positions read back, and roads of others evaluated."""

import json
import subprocess
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
from tests.files.maps.checkers import checker
from tests.scenes.map_scenes import UTM, road_lines

from linework.crs import parse_crs
from linework.errors import CrsError, InputError, LineworkWarning, UsageError
from linework.files.vectors.read_write import not_expressed, read_lines, write_lines
from linework.lines.lane_sections import lane_roads
from linework.lines.reference_curve import reference_curve
from linework.model.lines import LineSet


def issues(path):
    """Return the issues that ASAM's checker finds, and the checks that it skipped."""
    config = path.with_suffix(".config.xml")
    result = path.with_suffix(".xqar")
    config.write_text(
        f'<Config><Param name="InputFile" value="{path}"/><CheckerBundle application="xodrBundle">'
        f'<Param name="resultFile" value="{result}"/></CheckerBundle></Config>'
    )
    done = subprocess.run([checker("qc_opendrive"), "-c", config], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    root = ElementTree.parse(result).getroot()
    checks = list(root.iter("Checker"))
    assert len(checks) == 23
    found = [f"{c.get('checkerId')}: {i.get('description')}" for c in checks for i in c.iter("Issue")]
    return found, [c.get("checkerId") for c in checks if c.get("status") != "completed"]


def changing_lines():
    """Return a road of 120 m whose edge line begins later, whose lane is hidden in the middle, in a bend of 60 m."""
    s = np.linspace(0.0, 120.0, 121)
    table = {"middle": (0.0, s, "lane_marking", "dashed"), "left": (3.4, s, "lane_marking", "solid"),
             "right": (-3.3, s, "lane_marking", "solid"), "curb": (-3.8, s[20:90], "road_boundary", ""),
             "rail": (-5.0, s[10:110], "guardrail", "")}  # fmt: skip
    shapes, bridged = [], []
    for name, (offset, along, _, _) in table.items():
        angle, radius = along / 60.0, 60.0 - offset
        xy = np.column_stack([radius * np.sin(angle), 60.0 - radius * np.cos(angle)]) + np.array(
            [401_234.5, 5_655_432.1]
        )
        shapes.append(
            np.column_stack([xy, 200 - 0.03 * along - 0.02 * abs(offset) + (0.75 if name == "rail" else 0)])
        )
        bridged += [name in ("middle", "left") and 50 <= a <= 60 for a in along.tolist()]
    return LineSet.from_lines(shapes, crs=UTM, id=list(table), kind=[v[2] for v in table.values()],
                              pattern=[v[3] for v in table.values()], bridged=bridged)  # fmt: skip


@pytest.mark.parametrize("lanes", [False, True], ids=["spaces", "lanes"])
@pytest.mark.parametrize("lines", [road_lines(), changing_lines()], ids=["bend", "changing"])
def test_asam_finds_no_issue(tmp_path, lines, lanes):
    path = tmp_path / "road.xodr"
    write_lines(lines, path, lanes=lanes)
    # One check is for versions up to 1.7
    assert issues(path) == ([], ["check_asam_xodr_junctions_connection_one_connection_element"])


def test_the_checker_would_find_an_issue(tmp_path):
    path = tmp_path / "road.xodr"
    write_lines(road_lines(), path)
    path.write_text(path.read_text().replace('junction="-1"', ""))
    assert issues(path)[0]


@pytest.mark.parametrize("lines", [road_lines(), changing_lines()], ids=["bend", "changing"])
def test_positions_are_on_the_lines_to_the_millimetre(tmp_path, lines):
    path = tmp_path / "road.xodr"
    write_lines(lines, path)
    back = read_lines(path)
    assert back.crs == lines.crs
    kinds = {"lane_marking", "road_boundary", "guardrail", "barrier", "cable"}
    assert set(back.id) == set(lines.id[np.isin(lines.kind, list(kinds))])
    for line in back:
        i = lines.id.tolist().index(line.id)
        own = shapely.LineString(lines[i].xyz)
        assert line.kind == lines[i].kind and line.pattern == lines[i].pattern
        points = shapely.points(line.xyz)
        # At its stations the writer has checked a millimetre; between them lines here are chords, the road is a curve: a
        # metre of 60 m radius rises by 2.1 mm
        assert shapely.distance(shapely.force_2d(points), shapely.force_2d(own)).max() < 2.1e-3
        at = shapely.line_locate_point(shapely.force_2d(own), shapely.force_2d(points))
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(lines[i].xyz[:, :2], axis=0).T))])
        np.testing.assert_allclose(line.xyz[:, 2], np.interp(at, along, lines[i].xyz[:, 2]), atol=2e-3)


_BY_PYXODR = """
import json, sys
from pyxodr.road_objects.network import RoadNetwork
found = []
for road in RoadNetwork(sys.argv[1], resolution=0.5).get_roads():
    for section in road.lane_sections:
        found += [[lane.id, lane.boundary_line[:, :2].tolist()] for lane in section.lanes if lane.id]
print(json.dumps(found))
"""


def test_another_reader_finds_the_same_borders(tmp_path):
    path, lines = tmp_path / "road.xodr", road_lines()
    write_lines(lines, path)
    done = subprocess.run([checker("python"), "-c", _BY_PYXODR, str(path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    offset = np.array([float(ElementTree.parse(path).find("header/offset").get(axis)) for axis in "xy"])
    whole = shapely.union_all([shapely.LineString(line.xyz[:, :2]) for line in lines if line.kind != "cable"])
    found = json.loads(done.stdout)
    assert {lane for lane, _ in found} == {-1, 1, 2}
    for _, border in found:
        # Its places are 0.5 m apart, and headings between them are those of chords
        away = shapely.distance(shapely.points(np.array(border) + offset), whole)
        assert np.median(away) < 1.5e-3 and away.max() < 5e-3


def test_the_file_says_what_was_measured_and_no_more(tmp_path):
    path = tmp_path / "road.xodr"
    write_lines(road_lines(), path)
    root = ElementTree.parse(path).getroot()
    assert not list(root.iter("junction")) and not [
        r for r in root.iter("road") if r.find("link") is not None
    ]
    header = root.find("header")
    assert (header.get("revMajor"), header.get("revMinor")) == ("1", "8")
    assert "+proj=utm +zone=32" in header.findtext("geoReference")
    assert header.find("dataQuality/error").get("xyAbsolute") == "0.0100"
    assert "COMPOUNDCRS" in header.find("userData").get("value")
    # Coordinates are small; the offset holds the rest
    assert all(abs(float(g.get("x"))) < 1000 and abs(float(g.get("y"))) < 1000 for g in root.iter("geometry"))
    assert {m.get("laneChange") for m in root.iter("roadMark")} <= {"none", "both"}
    assert all(m.get("height") is None for m in root.iter("roadMark"))
    lanes = {(lane.get("id"), lane.get("type")) for lane in root.iter("lane")}
    assert lanes == {("-1", "none"), ("0", "none"), ("1", "none"), ("2", "none")}
    assert {o.get("id") for o in root.iter("object")} == {"rail", "wall", "wire"}
    text = not_expressed(road_lines(), path)[0]
    assert "1 lines of kerb_top, 1 lines of road_marking_other" in text


@pytest.mark.parametrize("is_right_hidden", [False, True])
def test_hidden_lanes_are_not_invented(is_right_hidden):
    """Where both bounds were carried across a gap there is no lane, unless a line beside them says where they are."""
    lines = changing_lines()
    if is_right_hidden:
        # With all that stands beside the lane
        away_m = np.hypot(*(lines.xyz[:, None, :2] - lines.xyz[lines.bridged, :2]).T).min(axis=0)
        lines = lines.with_columns(bridged=away_m < 6.0)
    roads = lane_roads(lines)
    assert len(roads) == (2 if is_right_hidden else 1)
    for road in roads:
        for section in road.sections:
            ids = [str(lines.id[i]) for i in section.bounds]
            xy = road.curve.places(road.station_m[section.first : section.last + 1])
            along = 60 * np.arctan2(*(xy - np.array([401_234.5, 5_655_492.1])).T * np.array([[1], [-1]]))
            if is_right_hidden:
                assert ((along <= 51) | (along >= 59)).all()
            if "curb" in ids:
                assert along.min() > 19 and along.max() < 90
            assert section.is_lane == tuple(np.diff(section.offset_m[0]) >= 2.2)
    names = [[str(lines.id[i]) for i in section.bounds] for road in roads for section in road.sections]
    assert {"right", "middle", "left"} in map(set, names)


def test_nothing_is_a_lane_that_is_no_lane():
    s = np.linspace(0.0, 60.0, 31)

    def roads(*rows):
        shapes = [np.column_stack([s, np.full(31, y), np.zeros(31)]) for y, _ in rows]
        return lane_roads(
            LineSet.from_lines(shapes, kind=[kind for _, kind in rows], id=[str(y) for y, _ in rows])
        )

    assert len(roads((0.0, "lane_marking"), (3.5, "lane_marking"))) == 1
    assert not roads((0.0, "lane_marking"), (2.1, "lane_marking"))
    assert not roads((0.0, "lane_marking"), (6.1, "lane_marking"))
    assert not roads((0.0, "road_boundary"), (3.5, "road_boundary"))
    assert not roads((0.0, "lane_marking"), (1.5, "guardrail"), (3.5, "lane_marking"))
    # Each lane belongs to one road
    found = roads((0.0, "lane_marking"), (3.5, "lane_marking"), (7.0, "lane_marking"))
    assert sum(sum(section.is_lane) for road in found for section in road.sections) == 2


@pytest.mark.parametrize("radius_m", [30.0, 50.0, 150.0, 1000.0])
def test_pieces_are_as_long_as_their_parameter(radius_m):
    along = np.arange(0.0, min(radius_m * 3.0, 300.0), 1.0)
    noise = np.random.default_rng(0).normal(0, 0.003, len(along))
    xy = (radius_m + noise)[:, None] * np.column_stack([np.sin(along / radius_m), -np.cos(along / radius_m)])
    curve = reference_curve(xy)
    fine = np.linspace(0.0, curve.length_m, 200_001)
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(curve.places(fine), axis=0).T))])
    np.testing.assert_allclose(np.interp(curve.starts_m, fine, length), curve.starts_m, atol=1e-3)
    # Chords of 1 m are inside the circle by s^2 / 8 R
    assert np.abs(np.hypot(*curve.places(fine).T) - radius_m).max() < 0.01 + 1 / (8 * radius_m)
    s, t = curve.nearest(curve.places(np.array([5.0, 20.0])) + 2.0 * np.array([[0.0, 0.0], [0.0, 0.0]]))
    np.testing.assert_allclose(s, [5.0, 20.0], atol=1e-6)
    np.testing.assert_allclose(t, 0.0, atol=1e-6)


def test_the_crossfall_of_the_lines_is_the_superelevation(tmp_path):
    """One slope over the whole road, which turns from 2.5 % down to the right to 4 % down to the left over 60 m."""
    x = np.arange(0.0, 121.0)
    slope = np.interp(x, [30.0, 90.0], [0.025, -0.04])
    table = {"left": (3.5, "lane_marking"), "middle": (0.0, "lane_marking"), "right": (-3.5, "lane_marking"),
             "kerb": (-5.9, "road_boundary"), "rail": (-8.0, "guardrail")}  # fmt: skip
    shapes = [
        np.column_stack([x + 400_000, np.full(121, y) + 5_600_000, 9.0 + slope * y])
        for y, _ in table.values()
    ]
    lines = LineSet.from_lines(shapes, kind=[k for _, k in table.values()], id=list(table), crs=UTM,
                               pattern=["solid", "dashed", "solid", "", ""])  # fmt: skip
    path = tmp_path / "banked.xodr"
    write_lines(lines, path)
    (road,) = ElementTree.parse(path).getroot().findall("road")
    records = road.findall("lateralProfile/superelevation")
    at, bank = (np.array([float(r.get(k)) for r in records]) for k in ("s", "a"))
    sign = 1.0 if float(road.find("planView/geometry").get("hdg")) < 1.0 else -1.0
    along = at if sign > 0 else 120.0 - at
    away = np.min(np.abs(along[:, None] - [30.0, 90.0]), axis=1)
    np.testing.assert_allclose(
        sign * np.tan(bank)[away > 10], np.interp(along, x, slope)[away > 10], atol=3e-4
    )
    # What is left is the twist within 10 m
    shapes = road.findall("lateralProfile/shape")
    assert max(abs(float(s.get("a"))) for s in shapes) < 0.025
    back = read_lines(path)
    for line in back:
        y = table[str(line.id)][0]
        np.testing.assert_allclose(line.xyz[:, 1], 5_600_000 + y, atol=1e-3)
        expected = 9.0 + np.interp(line.xyz[:, 0] - 400_000, x, slope) * y
        np.testing.assert_allclose(line.xyz[:, 2], expected, atol=1e-3)
    assert len(back) == 5


FOREIGN = """<OpenDRIVE><header revMajor="1" revMinor="6"><geoReference><![CDATA[{crs}]]></geoReference>
<offset x="100" y="200" z="5" hdg="0"/></header>
<road name="" length="{length}" id="7" junction="-1"><planView>
<geometry s="0" x="0" y="0" hdg="0" length="20"><line/></geometry>
<geometry s="20" x="20" y="0" hdg="0" length="30"><spiral curvStart="0" curvEnd="0.01"/></geometry>
<geometry s="50" x="{x:.12f}" y="{y:.12f}" hdg="0.15" length="40"><arc curvature="0.01"/></geometry>
</planView><elevationProfile><elevation s="0" a="1" b="0.02" c="0" d="0"/></elevationProfile>
<lateralProfile><superelevation s="0" a="0.025" b="0" c="0" d="0"/></lateralProfile>
<lanes><laneOffset s="0" a="0.5" b="0" c="0" d="0"/><laneSection s="0">
<left><lane id="1" type="driving"><width sOffset="0" a="3" b="0" c="0" d="0"/><roadMark sOffset="0" type="solid solid" color="white" width="0.12"/></lane></left>
<center><lane id="0" type="none"><roadMark sOffset="0" type="broken" color="white"/></lane></center>
<right><lane id="-1" type="driving"><width sOffset="0" a="2" b="0.01" c="0" d="0"/><roadMark sOffset="0" type="curb" color="white"/></lane>
<lane id="-2" type="none"><width sOffset="0" a="1" b="0" c="0" d="0"/><roadMark sOffset="0" type="none" color="white"/></lane></right>
</laneSection></lanes></road>
<road name="" length="5" id="8" junction="-1"><planView><geometry s="0" x="0" y="0" hdg="0" length="5"><helix/></geometry></planView>
<lanes><laneSection s="0"><center><lane id="0"/></center></laneSection></lanes></road></OpenDRIVE>"""


def test_roads_of_others_are_evaluated(tmp_path):
    t = np.linspace(0, 30, 300_001)
    heading = 0.01 / 30 * t**2 / 2
    x = 20 + np.trapezoid(np.cos(heading), t)
    y = np.trapezoid(np.sin(heading), t)
    path = tmp_path / "other.xodr"
    path.write_text(
        FOREIGN.format(crs="+proj=utm +zone=32 +datum=WGS84 +units=m +no_defs", length=90, x=x, y=y)
    )
    with pytest.warns(LineworkWarning, match="left out road 8: a geometry of an unknown type"):
        lines = read_lines(path)
    assert lines.kind.tolist() == ["road_boundary", "lane_marking", "lane_marking"]
    assert lines.pattern.tolist() == ["", "dashed", "solid_solid"] and lines.double.tolist() == [
        False,
        False,
        True,
    ]
    assert lines.form.tolist() == ["kerb", "", ""] and lines.width_m[2] == 0.12
    left = lines[2].xyz - np.array([100, 200, 5])
    cos, sin = np.cos(0.025), np.sin(0.025)
    np.testing.assert_allclose(left[0], [0, 3.5 * cos, 1 + 3.5 * sin], atol=1e-9)
    # In the arc, whose centre is 100 m to the left of its start, at its own distance from it
    centre = np.array([x - 100 * np.sin(0.15), y + 100 * np.cos(0.15)])
    np.testing.assert_allclose(np.hypot(*(left[-35:, :2] - centre).T), 100 - 3.5 * cos, atol=1e-6)
    np.testing.assert_allclose(left[-1, 2], 1 + 0.02 * 90 + 3.5 * sin, atol=1e-9)
    right = lines[0].xyz[-1] - np.array([100, 200, 5])
    np.testing.assert_allclose(np.hypot(*(right[:2] - centre)), 100 + (2.9 - 0.5) * cos, atol=1e-6)


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("", InputError, "empty file"),
        ("<OpenDRIVE>", InputError, "is not XML"),
        ("<osm/>", InputError, "not OpenDRIVE: its root is osm"),
        ("<!DOCTYPE a><OpenDRIVE/>", InputError, "document type is not read"),
        ('<OpenDRIVE><header><offset x="?"/></header></OpenDRIVE>', InputError, "an offset that is not numbers"),
        ("<OpenDRIVE><header><geoReference>+proj=nowhere</geoReference></header></OpenDRIVE>", InputError, "not known to PROJ"),
        ("<OpenDRIVE><header><geoReference>+proj=longlat +datum=WGS84</geoReference></header></OpenDRIVE>", CrsError, "degrees"),
        ('<OpenDRIVE><road id="1"/></OpenDRIVE>', InputError, "no line can be read: road 1"),
        ('<OpenDRIVE><road id="1"><planView/></road></OpenDRIVE>', InputError, "road 1: no reference line"),
    ],
)  # fmt: skip
def test_what_is_no_road_is_one_line(tmp_path, text, error, words):
    path = tmp_path / "a.xodr"
    path.write_text(text)
    with pytest.raises(error, match=words) as caught:
        read_lines(path)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)


def test_lines_without_lanes_are_refused(tmp_path):
    with pytest.raises(UsageError, match="OpenDRIVE needs a road"):
        write_lines(road_lines()["guardrail"], tmp_path / "a.xodr")
    assert list(tmp_path.iterdir()) == []
    local = road_lines().with_columns(crs="local")
    write_lines(local, tmp_path / "b.xodr")
    assert read_lines(tmp_path / "b.xodr").crs == "local" != parse_crs(UTM)


def test_equal_lines_give_equal_bytes(tmp_path):
    for name in ("a", "b"):
        write_lines(changing_lines(), tmp_path / f"{name}.xodr")
    assert (tmp_path / "a.xodr").read_bytes() == (tmp_path / "b.xodr").read_bytes()


def test_widths_of_many_lanes_add_up_to_no_millimetre(tmp_path):
    x = np.arange(0.0, 150.0)
    rows = [
        np.column_stack(
            [400_000.0 + x, 5_650_000.0 + k * (3.5 + 1.5e-4 * np.sin(x / 4.0)), np.full(len(x), 90.0)]
        )
        for k in range(14)
    ]
    lines = LineSet.from_lines(
        rows, crs=UTM, id=[f"line-{k}" for k in range(14)], kind=["lane_marking"] * 14, pattern=["solid"] * 14
    )
    # Read back to the millimetre before it appears
    write_lines(lines, tmp_path / "wide.xodr")
    assert {name.partition(".")[0] for name in read_lines(tmp_path / "wide.xodr").id.tolist()} == set(
        lines.id.tolist()
    )
