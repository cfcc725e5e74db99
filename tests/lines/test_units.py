"""Lines in feet: what measures them and what is always in metres gets metres, and the CRS stays right."""

import re
import subprocess
from dataclasses import replace
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pyproj
import pytest
from tests.files.maps.checkers import checker
from tests.files.maps.test_opendrive import _BY_PYXODR
from tests.scenes.map_scenes import road_lines

from linework.crs import metric_twin, parse_crs
from linework.errors import CrsError, InputError
from linework.evaluation.changes.epochs import compare_epochs
from linework.files.vectors.lane_layer import lane_options
from linework.files.vectors.read_write import read_lines, write_lines
from linework.lines.units import in_metres, in_units_of, unit_scale
from linework.model.lines import LineSet

#: New York in US survey feet, and Oregon in international feet with heights in US survey feet.
FEET = ["EPSG:2263+6360", "EPSG:2992+6360"]


def in_feet(crs):
    """Return the lines of a road in metres, and the same in feet."""
    metres = replace(road_lines(), crs=metric_twin(parse_crs(crs)))
    near = metres.xyz - metres.xyz[0] + [300_000.0, 60_000.0, 10.0]
    metres = replace(metres, xyz=near)
    return metres, in_units_of(metres, parse_crs(crs))


@pytest.mark.parametrize("crs", FEET)
def test_there_and_back(crs):
    metres, feet = in_feet(crs)
    back = in_metres(feet)
    assert back.crs == metres.crs
    np.testing.assert_allclose(back.xyz, metres.xyz, rtol=1e-14)
    assert in_metres(metres) is metres


@pytest.mark.parametrize("crs", FEET)
def test_opendrive_is_in_metres_and_others_read_it_so(tmp_path, crs):
    metres, feet = in_feet(crs)
    write_lines(feet, tmp_path / "feet.xodr")
    write_lines(metres, tmp_path / "metres.xodr")
    root = ElementTree.parse(tmp_path / "feet.xodr")
    proj = root.find("header").findtext("geoReference")
    assert "units=m" in proj or "to_meter" not in proj
    back = read_lines(tmp_path / "feet.xodr")
    same = read_lines(tmp_path / "metres.xodr")
    assert back.crs == same.crs == metres.crs and back.id.tolist() == same.id.tolist()
    np.testing.assert_allclose(back.xyz, same.xyz, atol=1e-6)
    # Roads are as wide as they are
    width = float(root.find(".//lane/width").get("a"))
    assert 2.2 < width < 6.0
    # Who gives the CRS in feet gets feet
    given = read_lines(tmp_path / "feet.xodr", crs=crs)
    assert given.crs == feet.crs
    np.testing.assert_allclose(in_metres(given).xyz, same.xyz, atol=1e-6)


def test_an_independent_reader_finds_the_borders_of_lines_in_feet(tmp_path):
    metres, feet = in_feet(FEET[0])
    found = []
    for name, lines in (("feet", feet), ("metres", metres)):
        path = tmp_path / f"{name}.xodr"
        write_lines(lines, path)
        done = subprocess.run(
            [checker("python"), "-c", _BY_PYXODR, str(path)], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        found.append([float(number) for number in re.findall(r"-?\d+\.\d+", done.stdout)])
    np.testing.assert_allclose(found[0], found[1], atol=1e-6)


def test_opendrive_of_others_with_a_reference_in_feet_is_in_metres(tmp_path):
    path = tmp_path / "others.xodr"
    reference = pyproj.CRS.from_epsg(2263).to_wkt()
    path.write_text(
        f'<OpenDRIVE><header revMajor="1" revMinor="6"><geoReference><![CDATA[{reference}]]></geoReference></header>'
        '<road id="1" length="20.0" junction="-1"><planView><geometry s="0" x="300000" y="60000" hdg="0" length="20">'
        '<line/></geometry></planView><lanes><laneSection s="0"><center><lane id="0" type="none">'
        '<roadMark sOffset="0" type="solid"/></lane></center></laneSection></lanes></road></OpenDRIVE>'
    )
    lines = read_lines(path)
    assert lines.crs == metric_twin(parse_crs("EPSG:2263"))
    np.testing.assert_allclose(lines.xyz[[0, -1]], [[300_000, 60_000, 0], [300_020, 60_000, 0]], atol=1e-9)


@pytest.mark.parametrize("suffix", [".osm", ".kml"])
def test_heights_in_degrees_are_metres(tmp_path, suffix):
    metres, feet = in_feet(FEET[0])
    for name, lines in (("feet", feet), ("metres", metres)):
        write_lines(lines, tmp_path / f"{name}{suffix}")
    a, b = (
        np.array(
            [
                float(v)
                for v in re.findall(
                    r'(?:lat="|lon="|v="|,)(-?\d+\.\d{3,})', (tmp_path / f"{n}{suffix}").read_text()
                )
            ]
        )
        for n in ("feet", "metres")
    )
    assert len(a) > 100
    np.testing.assert_allclose(a, b, atol=2e-3)


@pytest.mark.parametrize("unit", ["", "meter", "USSurveyFoot"])
def test_landxml_without_a_crs_takes_one_in_feet(tmp_path, unit):
    path = tmp_path / "road.landxml"
    system = "Imperial" if "Foot" in unit else "Metric"
    units = f'<Units><{system} linearUnit="{unit}"/></Units>' if unit else ""
    path.write_text(
        f'<LandXML xmlns="http://www.landxml.org/schema/LandXML-1.2" version="1.2">{units}<PlanFeatures name="edge">'
        '<PlanFeature name="a"><CoordGeom><IrregularLine><PntList3D>60000 300000 30 60010 300000 31</PntList3D>'
        "</IrregularLine></CoordGeom></PlanFeature></PlanFeatures></LandXML>"
    )
    lines = read_lines(path, crs="EPSG:2263+6360")
    assert lines.crs == parse_crs("EPSG:2263+6360")
    expected = np.array([[300_000, 60_000, 30], [300_000, 60_010, 31]])
    scale = np.ones(3) if "Foot" in unit else unit_scale(lines.crs)
    np.testing.assert_allclose(lines.xyz * scale, expected, rtol=1e-12)


def test_lanes_of_lines_in_feet_are_those_of_metres(tmp_path):
    metres, feet = in_feet(FEET[0])
    a, b = (
        lane_options(lines, tmp_path / "a.gpkg", lanes=True, location="")["lanes"] for lines in (feet, metres)
    )
    assert len(a) == len(b) > 0
    np.testing.assert_allclose(a.width_m, b.width_m, atol=1e-6)
    np.testing.assert_allclose(a.centre.xyz * unit_scale(feet.crs), b.centre.xyz, atol=1e-6)
    write_lines(feet, tmp_path / "feet.gpkg", lanes=True)


@pytest.mark.parametrize("suffix", [".xodr", ".osm"])
@pytest.mark.parametrize(
    ("written", "given"), [("EPSG:2225+6360", "EPSG:2225"), ("EPSG:2225", "EPSG:2225+6360")]
)
def test_a_crs_in_feet_with_or_without_heights_gives_feet(tmp_path, suffix, written, given):
    """A map is in metres; whether it, or the CRS that is given, states the datum of the heights does not matter."""
    xyz = np.column_stack([np.arange(6.0e6, 6.0e6 + 400, 20), np.full(20, 2.0e6), np.full(20, 100.0)])
    lines = LineSet.from_lines([xyz, xyz + np.array([0.0, 12.0, 0.0])], crs=written, kind="lane_marking")
    write_lines(lines, tmp_path / f"a{suffix}")
    back = read_lines(tmp_path / f"a{suffix}", crs=given)
    assert back.crs == parse_crs(given)
    ends = [[xyz.min(axis=0), xyz.max(axis=0)] for xyz in (back.xyz, lines.xyz)]
    np.testing.assert_allclose(*ends, atol=0.01)


def test_another_datum_of_heights_is_refused(tmp_path):
    xyz = np.array([[6.0e6, 2.0e6, 100.0], [6.0001e6, 2.0e6, 100.0]])
    lines = LineSet.from_lines(
        [xyz, xyz + np.array([0.0, 12.0, 0.0])], crs="EPSG:2225+6360", kind="lane_marking"
    )
    write_lines(lines, tmp_path / "a.xodr")
    with pytest.raises(CrsError, match="two different CRSs"):
        read_lines(tmp_path / "a.xodr", crs="EPSG:2225+5702")


def test_a_drawing_says_its_unit(tmp_path):
    metres, feet = in_feet(FEET[0])
    for lines, code in ((metres, 6), (feet, 21), (in_feet(FEET[1])[1], 2)):
        write_lines(lines, tmp_path / "a.dxf", overwrite=True)
        assert ezdxf.readfile(tmp_path / "a.dxf").header["$INSUNITS"] == code


def test_a_drawing_in_feet_needs_a_crs(tmp_path):
    metres, feet = in_feet(FEET[0])
    for lines in (metres, feet):
        write_lines(lines, tmp_path / "a.dxf", overwrite=True)
        (tmp_path / "a.prj").unlink(missing_ok=True)
        if lines is feet:
            with pytest.raises(InputError, match=r"a\.dxf: the drawing is in feet"):
                read_lines(tmp_path / "a.dxf")
            assert read_lines(tmp_path / "a.dxf", crs=FEET[0]).crs == feet.crs
        else:
            assert read_lines(tmp_path / "a.dxf").crs == "local"


def test_commands_measure_in_metres(linework, tmp_path):
    metres, feet = in_feet(FEET[0])
    reports = []
    for name, lines in (("feet", feet), ("metres", metres)):
        write_lines(lines, tmp_path / f"{name}.gpkg")
        linework("report", tmp_path / f"{name}.gpkg", "-o", tmp_path / f"{name}.csv")
        reports.append((tmp_path / f"{name}.csv").read_text())
    a, b = (
        [[float(v) for v in re.findall(r"-?\d+\.\d+", row)] for row in text.splitlines()] for text in reports
    )
    assert len(a) == len(b) > 20
    for one, other in zip(a, b, strict=True):
        np.testing.assert_allclose(one, other, atol=2e-3)
    linework("compare", tmp_path / "feet.gpkg", tmp_path / "metres.gpkg", "-o", tmp_path / "changes.csv")
    assert len((tmp_path / "changes.csv").read_text().splitlines()) == 1
    assert not compare_epochs(in_metres(feet), metres)[0]
    linework("evaluate", tmp_path / "feet.gpkg", tmp_path / "metres.gpkg")


def test_a_set_of_no_lines():
    assert len(in_metres(LineSet.empty(parse_crs(FEET[0])))) == 0
