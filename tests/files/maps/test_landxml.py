"""LandXML: an own reader of the text finds the same places, and files in the form of design programs are read."""

import math
from xml.etree import ElementTree

import numpy as np
import pytest
from tests.files.vectors.test_vectors import sample
from tests.scenes.map_scenes import road_lines

from linework.crs import parse_crs
from linework.errors import CrsError, InputError, LineworkWarning
from linework.files.vectors.read_write import not_expressed, read_lines, write_lines
from linework.model.lines import LineSet

SPACE = "{http://www.landxml.org/schema/LandXML-1.2}"


def places(text):
    """Return east, north, up of a list of northing, easting, elevation."""
    return np.array(text.split(), dtype=float).reshape(-1, 3)[:, [1, 0, 2]]


def test_the_text_has_northing_easting_elevation_and_units(tmp_path):
    lines, path = road_lines(), tmp_path / "road.landxml"
    write_lines(lines, path)
    root = ElementTree.parse(path).getroot()
    assert root.tag == f"{SPACE}LandXML" and root.get("version") == "1.2"
    assert root.find(f"{SPACE}Units/{SPACE}Metric").get("linearUnit") == "meter"
    system = root.find(f"{SPACE}CoordinateSystem")
    assert system.get("epsgCode") == "25832" and parse_crs(system.get("ogcWktCode")) == lines.crs
    found = {f.get("name"): f for f in root.iter(f"{SPACE}PlanFeature")}
    assert set(found) == set(lines.id.tolist())
    for i, name in enumerate(lines.id.tolist()):
        line = found[name].find(f"{SPACE}CoordGeom/{SPACE}IrregularLine")
        xyz = places(line.find(f"{SPACE}PntList3D").text)
        np.testing.assert_array_equal(xyz, lines[i].xyz)
        np.testing.assert_array_equal(places(line.find(f"{SPACE}Start").text)[0], xyz[0])
        np.testing.assert_array_equal(places(line.find(f"{SPACE}End").text)[0], xyz[-1])
    broken = {b.get("name"): b for b in root.iter(f"{SPACE}Breakline")}
    assert set(broken) == {"kerb", "verge", "top"}
    assert {b.get("brkType") for b in broken.values()} == {"standard"}
    np.testing.assert_array_equal(places(broken["top"].find(f"{SPACE}PntList3D").text), lines[4].xyz)


@pytest.mark.parametrize("crs", ["EPSG:25832+7837", "local"])
@pytest.mark.parametrize("name", ["a.landxml", "a.xml"])
def test_our_own_file_comes_back(tmp_path, crs, name):
    lines = sample(crs)
    write_lines(lines, tmp_path / name)
    back = read_lines(tmp_path / name)
    bare = {"sigma_xy_m": np.full(57, np.nan), "bridged": np.zeros(57, dtype=bool)}
    assert back == lines.with_columns(**bare)
    assert (
        "the standard deviations of the vertices, where lines are bridged"
        in not_expressed(lines, tmp_path / name)[0]
    )


def test_texts_that_xml_cannot_hold(tmp_path):
    lines = LineSet.from_lines([np.eye(3)], id=["a\x01<&\"'\n"], kind=["]]>"], note=["\ufffe"])
    write_lines(lines, tmp_path / "a.landxml")
    back = read_lines(tmp_path / "a.landxml")
    assert back.id.tolist() == ["a\ufffd<&\"'\n"] and back.kind.tolist() == ["]]>"]


#: As a design program writes survey figures: points that others refer to, arcs, feet, no list of points.
DESIGN = """<?xml version="1.0"?>
<LandXML xmlns="http://www.landxml.org/schema/LandXML-1.2" date="2024-05-03" time="11:20:39" version="1.2"
 language="English" readOnly="false">
<Units><Imperial areaUnit="squareFoot" linearUnit="USSurveyFoot" volumeUnit="cubicYard" temperatureUnit="fahrenheit"
 pressureUnit="inHG" diameterUnit="inch" angularUnit="decimal degrees" directionUnit="decimal degrees"></Imperial></Units>
<Project name="C:\\Design\\road.dwg"></Project>
<Application name="a design program" version="2024"></Application>
<CgPoints><CgPoint name="1">1000. 2000. 10.</CgPoint><CgPoint name="2">1000. 2100. 12.</CgPoint></CgPoints>
<PlanFeatures name="Site 1">
<PlanFeature name="EP-1"><CoordGeom>
 <Line><Start pntRef="1"/><End pntRef="2"/></Line>
 <Curve rot="ccw" radius="50." crvType="arc"><Start>1000. 2100. 12.</Start><Center>1050. 2100.</Center><End>1100. 2100. 14.</End></Curve>
</CoordGeom></PlanFeature>
<PlanFeature name="CL"><CoordGeom><Spiral length="3" radiusEnd="5" radiusStart="INF" rot="cw" spiType="clothoid">
 <Start>0 0</Start><PI>1 1</PI><End>2 2</End></Spiral></CoordGeom></PlanFeature>
</PlanFeatures>
<Surfaces><Surface name="EG"><SourceData><Breaklines>
<Breakline brkType="standard" desc="kerb"><PntList3D>0 0 1 0 100 2</PntList3D></Breakline>
<Breakline brkType="standard"><PntList3D>0 0 1 0</PntList3D></Breakline>
</Breaklines></SourceData></Surface></Surfaces>
</LandXML>"""


def test_a_design_in_feet_with_arcs_is_read(tmp_path):
    path = tmp_path / "design.xml"
    path.write_text(DESIGN)
    with pytest.warns(
        LineworkWarning,
        match="left out plan feature CL: its Spiral ends 0.10 m from where it should and 1 other",
    ):
        lines = read_lines(path, crs="EPSG:25832")
    assert lines.kind.tolist() == ["Site 1", "breakline"]
    assert lines.id.tolist() == ["EP-1", ""]
    foot = 1200 / 3937
    xyz = lines[0].xyz / foot
    np.testing.assert_allclose(
        xyz[[0, 1, -1]], [[2000, 1000, 10], [2100, 1000, 12], [2100, 1100, 14]], atol=1e-9
    )
    arc = xyz[1:]
    np.testing.assert_allclose(np.hypot(arc[:, 0] - 2100, arc[:, 1] - 1050), 50, atol=1e-9)
    assert arc[:, 0].max() > 2149.9  # anticlockwise: by the east
    # Chords are a millimetre from the arc at most
    assert abs(lines.length_m[0] / foot - 100 - 50 * math.pi) < 0.01
    np.testing.assert_allclose(lines[1].xyz, np.array([[0, 0, 1], [100, 0, 2]]) * foot)


def test_two_dimensions_have_no_heights(tmp_path):
    path = tmp_path / "a.xml"
    path.write_text('<LandXML><PlanFeatures><PlanFeature name="x"><CoordGeom><IrregularLine><Start>0 0</Start><End>1 1</End>'
                    "<PntList2D>0 0 0 1 1 1</PntList2D></IrregularLine></CoordGeom></PlanFeature></PlanFeatures></LandXML>")  # fmt: skip
    lines = read_lines(path)
    assert lines.kind.tolist() == ["plan_feature"] and np.isnan(lines.xyz[:, 2]).all() and len(lines.xyz) == 3


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("", InputError, "empty file"),
        ("<LandXML>", InputError, "is not XML"),
        ("<gml/>", InputError, "not LandXML: its root is gml"),
        ("<!DOCTYPE a [<!ENTITY b SYSTEM 'file:///etc/passwd'>]><LandXML/>", InputError, "document type is not read"),
        ('<LandXML><Units><Metric linearUnit="cubit"/></Units></LandXML>', InputError, "'cubit'.* is not a unit"),
        ('<LandXML><CoordinateSystem epsgCode="4326"/></LandXML>', CrsError, "degrees"),
        ('<LandXML><CoordinateSystem ogcWktCode="hello"/></LandXML>', CrsError, "is not a CRS"),
        ('<LandXML><PlanFeatures><PlanFeature name="x"><CoordGeom><IrregularLine><PntList3D>1 2 x</PntList3D>'
         "</IrregularLine></CoordGeom></PlanFeature></PlanFeatures></LandXML>",
         InputError, "no line can be read: plan feature x: its IrregularLine has no places"),
    ],
)  # fmt: skip
def test_what_is_no_landxml_is_one_line(tmp_path, text, error, words):
    path = tmp_path / "a.landxml"
    path.write_text(text)
    with pytest.raises(error, match=words) as caught:
        read_lines(path)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)


def test_entities_that_grow_are_refused(tmp_path):
    path = tmp_path / "a.xml"
    grown = "".join(f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">' for i in range(1, 10))
    path.write_text(f'<!DOCTYPE LandXML [<!ENTITY a0 "aaaaaaaaaa">{grown}]><LandXML>&a9;</LandXML>')
    with pytest.raises(InputError, match="document type is not read"):
        read_lines(path)
