"""Maps in the forms that other programs write: what real example maps have and ours do not."""

import math

import numpy as np
import pytest

from linework.crs import parse_crs, unit_factors
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.lines import LineSet

HEAD = '<road id="1" length="60"><planView><geometry s="0" x="0" y="0" hdg="0" length="60"><line/></geometry></planView>'
WIDTH = '<width sOffset="0" a="{}" b="0" c="0" d="0"/>'


def xodr(path, lanes, *, before="", objects=""):
    path.write_text(
        f"<OpenDRIVE>{HEAD}{before}<lanes>{lanes}</lanes><objects>{objects}</objects></road></OpenDRIVE>"
    )
    return read_lines(path)


def section(lane, s=0.0, number=-1):
    side = "left" if number > 0 else "right"
    return f'<laneSection s="{s}"><{side}><lane id="{number}" type="driving">{lane}</lane></{side}></laneSection>'


def spans(lines):
    """Return the pattern of each line with the distances along x at which it begins and ends."""
    return sorted((str(line.pattern), *line.xyz[[0, -1], 0].round(3).tolist()) for line in lines)


def test_each_road_mark_goes_as_far_as_the_next(tmp_path):
    marks = "".join(
        f'<roadMark sOffset="{s}" type="{t}"/>' for s, t in ((10, "solid"), (20, "broken"), (35, "broken"))
    )
    marks += '<roadMark sOffset="50" type="none"/><roadMark sOffset="55" type="solid"/>'
    lines = xodr(tmp_path / "a.xodr", section(WIDTH.format(3.5) + marks))
    assert spans(lines) == [("dashed", 20, 50), ("solid", 10, 20), ("solid", 55, 60)]
    # A lane without any, beside one with
    bare = section(WIDTH.format(3.5) + marks).replace(
        "</right>", f'<lane id="-2">{WIDTH.format(1)}</lane></right>'
    )
    assert spans(xodr(tmp_path / "b.xodr", bare)) == spans(lines)


def test_a_mark_goes_on_over_sections_where_it_looks_the_same(tmp_path):
    def one(s, kind, a):
        return section(WIDTH.format(a) + f'<roadMark sOffset="0" type="{kind}"/>', s)

    lines = xodr(tmp_path / "a.xodr", one(0, "solid", 3) + one(20, "solid", 3) + one(40, "broken", 3))
    assert spans(lines) == [("dashed", 40, 60), ("solid", 0, 40)]
    # The border steps aside
    lines = xodr(tmp_path / "b.xodr", one(0, "solid", 3) + one(20, "solid", 3.2))
    assert [s[1:] for s in spans(lines)] == [(0, 20), (20, 60)]


def test_borders_that_are_given_as_such(tmp_path):
    border = (
        '<border sOffset="0" a="-3" b="-0.01" c="0" d="0"/><border sOffset="30" a="-3.3" b="0" c="0" d="0"/>'
    )
    lines = xodr(tmp_path / "a.xodr", section(border + '<roadMark sOffset="0" type="solid"/>'))
    x, y = lines[0].xyz[:, :2].T
    np.testing.assert_allclose(y, np.where(x < 30, -3 - 0.01 * x, -3.3), atol=1e-9)


def test_a_lane_above_the_road(tmp_path):
    height = '<height sOffset="0" inner="0.12" outer="0.15"/><height sOffset="30" inner="0" outer="0"/>'
    lines = xodr(
        tmp_path / "a.xodr", section(WIDTH.format(2) + '<roadMark sOffset="0" type="edge"/>' + height)
    )
    x, z = lines[0].xyz[:, 0], lines[0].xyz[:, 2]
    np.testing.assert_allclose(z, np.where(x < 30, 0.15, 0.0), atol=1e-9)


def test_rails_that_are_repeated_without_a_distance(tmp_path):
    rail = (
        '<object id="r" type="barrier" subtype="guardRail" s="0" t="0" zOffset="0" height="0.75"><repeat s="10" length="40" '
        'distance="0" tStart="-5" tEnd="-7" zOffsetStart="0.1" zOffsetEnd="0.1" heightStart="0.75" heightEnd="0.55"/></object>'
        '<object id="p" type="pole" s="0" t="-4" height="1"><repeat s="0" length="60" distance="20"/></object>'
    )
    up = '<elevationProfile><elevation s="0" a="5" b="0.1" c="0" d="0"/></elevationProfile>'
    mark = section(WIDTH.format(3) + '<roadMark sOffset="0" type="solid"/>')
    lines = xodr(tmp_path / "a.xodr", mark, before=up, objects=rail)
    assert sorted(lines.kind) == ["guardrail", "lane_marking"]
    (xyz,) = [line.xyz for line in lines if line.id == "r"]
    np.testing.assert_allclose(xyz[[0, -1]], [[10, -5, 6.85], [50, -7, 10.65]], atol=1e-9)


def turned(length_m, first, last, start, heading):
    """Return the end of a clothoid and its heading, by many small steps."""
    s = (np.arange(400_000) + 0.5) * length_m / 400_000
    angle = heading + first * s + (last - first) * s**2 / (2 * length_m)
    step = length_m / 400_000
    end = np.array(start) + step * np.array([np.cos(angle).sum(), np.sin(angle).sum()])
    return end, heading + 0.5 * (first + last) * length_m


def alignment(tmp_path, *, kind="clothoid", radius=250.0):
    """A straight line of 50 m, a clothoid of 60 m to the left, and an arc."""
    start, heading = np.array([500.0, 1000.0]), 0.4
    tangent = start + 50 * np.array([math.cos(heading), math.sin(heading)])
    end, turn = turned(60.0, 0.0, 1 / 250.0, tangent, heading)
    # Both tangents meet in a corner
    a, b = (np.array([math.cos(h), math.sin(h)]) for h in (heading, turn))
    away = end - tangent
    corner = tangent + a * (away[0] * b[1] - away[1] * b[0]) / (a[0] * b[1] - a[1] * b[0])
    centre = end + 250.0 * np.array([-math.sin(turn), math.cos(turn)])
    last = centre - 250.0 * np.array([-math.sin(turn + 0.2), math.cos(turn + 0.2)])

    def text(xy, up=""):
        return f"{xy[1]:.8f} {xy[0]:.8f} {up}"

    path = tmp_path / "design.xml"
    path.write_text(f"""<LandXML version="1.2"><Units><Metric linearUnit="meter"/></Units><Alignments><Alignment name="axis 7">
<CoordGeom><Line><Start>{text(start, 10)}</Start><End>{text(tangent, 11)}</End></Line>
<Spiral length="60" radiusStart="INF" radiusEnd="{radius}" rot="ccw" spiType="{kind}"><Start>{text(tangent, 11)}</Start>
<PI>{text(corner)}</PI><End>{text(end, 14)}</End></Spiral>
<Curve rot="ccw" radius="250"><Start>{text(end, 14)}</Start><Center>{text(centre)}</Center><End>{text(last, 15)}</End></Curve>
</CoordGeom></Alignment></Alignments></LandXML>""")
    return path, tangent, heading, end, centre


def test_alignments_with_clothoids_are_read(tmp_path):
    path, tangent, heading, end, centre = alignment(tmp_path)
    lines = read_lines(path)
    assert lines.kind.tolist() == ["alignment"] and lines.id.tolist() == ["axis 7"]
    xyz = lines[0].xyz
    half, _ = turned(30.0, 0.0, 0.5 / 250.0, tangent, heading)
    away = np.hypot(*(xyz[:, :2] - half).T)
    k = int(np.argmin(away))
    assert away[k] < 1e-3 and abs(xyz[k, 2] - 12.5) < 1e-6
    arc = xyz[int(np.argmin(np.hypot(*(xyz[:, :2] - end).T))) :]
    assert len(arc) > 5
    np.testing.assert_allclose(np.hypot(*(arc[:, :2] - centre).T), 250.0, atol=1e-3)


@pytest.mark.parametrize(
    ("changes", "words"),
    [({"kind": "bloss"}, "a Spiral of the type bloss"), ({"radius": 200.0}, "its Spiral ends"), ({"radius": "x"}, "no numbers")],
)  # fmt: skip
def test_transitions_that_are_not_understood_are_said(linework, tmp_path, changes, words):
    path, *_ = alignment(tmp_path, **changes)
    found = linework("convert", path, tmp_path / "a.gpkg")
    assert found.code == 3 and words in found.line


@pytest.mark.parametrize("unit", ["foot", "USSurveyFoot", "meter"])
def test_coordinates_and_crs_have_one_unit(tmp_path, unit):
    """EPSG:2263 is in US survey feet; programs that know one foot only write the other one's name."""
    path = tmp_path / "design.xml"
    path.write_text(f"""<LandXML><Units><Metric linearUnit="{unit}"/></Units><CoordinateSystem epsgCode="2263"/><Surfaces>
<Surface><SourceData><Breaklines><Breakline><PntList3D>200000 1000000 30 200100 1000100 31</PntList3D></Breakline></Breaklines>
</SourceData></Surface></Surfaces></LandXML>""")
    lines = read_lines(path)
    own_m = unit_factors(lines.crs)[0]
    np.testing.assert_allclose(own_m, 1.0 if unit == "meter" else 1200 / 3937, rtol=1e-9)
    np.testing.assert_allclose(lines.xyz[0], [1e6, 2e5, 30.0], rtol=1e-12)
    # Written and read again: what was feet is said to be feet
    write_lines(lines, tmp_path / "back.landxml")
    text = (tmp_path / "back.landxml").read_text()
    assert ('linearUnit="USSurveyFoot"' in text) == (unit != "meter")
    back = read_lines(tmp_path / "back.landxml")
    np.testing.assert_array_equal(back.xyz, lines.xyz)
    assert parse_crs(back.crs) == parse_crs(lines.crs)


def test_a_design_in_feet_in_a_metric_crs_is_in_metres(tmp_path):
    path = tmp_path / "design.xml"
    path.write_text("""<LandXML><Units><Imperial linearUnit="foot"/></Units><CoordinateSystem epsgCode="25832"/><Surfaces>
<Surface><SourceData><Breaklines><Breakline><PntList3D>0 1000 30 100 1000 31</PntList3D></Breakline></Breaklines>
</SourceData></Surface></Surfaces></LandXML>""")
    lines = read_lines(path)
    np.testing.assert_allclose(lines.xyz[0], [304.8, 0.0, 9.144])
    assert unit_factors(lines.crs)[0] == 1.0


FT_US = 1200 / 3937


@pytest.mark.parametrize(
    ("unit", "crs", "factors", "units_m"),
    [
        ("USSurveyFoot", "EPSG:2225+5703", (1.0, FT_US), (FT_US, 1.0)),
        ("USSurveyFoot", "EPSG:2225+6360", (1.0, 1.0), (FT_US, FT_US)),
        ("USSurveyFoot", "EPSG:26941+6360", (FT_US, 1.0), (1.0, FT_US)),
        ("meter", "EPSG:26941+6360", (1.0, 1 / FT_US), (1.0, FT_US)),
        ("meter", "EPSG:2225+6360", (1.0, 1.0), (1.0, 1.0)),
        ("meter", "EPSG:2225+5703", (1.0, 1.0), (1.0, 1.0)),
    ],
)
def test_heights_in_another_unit_than_the_plan(tmp_path, unit, crs, factors, units_m):
    """A file has one unit for all coordinates, a CRS one for its plan and one for its heights."""
    path = tmp_path / "design.xml"
    path.write_text(f"""<LandXML><Units><Metric linearUnit="{unit}"/></Units><CoordinateSystem ogcWktCode="{crs}"/><Surfaces><Surface><SourceData>
<Breaklines><Breakline><PntList3D>200000 1000000 100 200100 1000100 101</PntList3D></Breakline></Breaklines></SourceData></Surface></Surfaces>
</LandXML>""")
    lines = read_lines(path)
    plan, up = factors
    np.testing.assert_allclose(lines.xyz[0], [1e6 * plan, 2e5 * plan, 100.0 * up], rtol=1e-12)
    assert unit_factors(lines.crs) == pytest.approx(units_m, rel=1e-9)
    # Written: all coordinates in the unit of the plan; read again: the same lines
    write_lines(lines, tmp_path / "back.landxml")
    text = (tmp_path / "back.landxml").read_text()
    assert ('linearUnit="USSurveyFoot"' in text) == (units_m[0] != 1.0)
    up_in_file = float(text.split("<Start>")[1].split("<")[0].split()[2])
    assert up_in_file * units_m[0] == pytest.approx(lines.xyz[0, 2] * units_m[1], rel=1e-12)
    back = read_lines(tmp_path / "back.landxml")
    np.testing.assert_allclose(back.xyz, lines.xyz, rtol=1e-12)
    assert back.crs == lines.crs


def test_a_plan_in_links_is_written_in_metres(tmp_path):
    """LandXML has no name for the links of Trinidad's grid."""
    lines = LineSet.from_lines(
        [np.array([[4e5, 3e5, 10.0], [4e5, 3.1e5, 20.0]])], kind=["kerb_top"], crs="EPSG:30200"
    )
    write_lines(lines, tmp_path / "a.landxml")
    back = read_lines(tmp_path / "a.landxml")
    own_m = unit_factors(lines.crs)[0]
    assert own_m == pytest.approx(0.2011662) and unit_factors(back.crs) == (1.0, 1.0)
    np.testing.assert_allclose(back.xyz, lines.xyz * own_m, rtol=1e-12)
