"""CRS texts: only codes and WKT, one text per CRS, feet and axes understood."""

import struct

import numpy as np
import pyproj
import pytest

from linework.crs import (
    crs_text,
    describe_crs,
    epsg_text,
    has_height,
    metric_twin,
    parse_crs,
    same_crs,
    same_plan,
    unit_factors,
)
from linework.errors import CrsError
from linework.files.las.crs import resolve_crs

CODES = [
    "EPSG:25832",
    "EPSG:25832+7837",
    "EPSG:2263+6360",
    "EPSG:2225",
    "EPSG:28992+5709",
    "EPSG:2180",
    "EPSG:3413",
]


@pytest.mark.parametrize("code", CODES)
@pytest.mark.parametrize("form", ["WKT1_GDAL", "WKT1_ESRI", "WKT2_2015", "WKT2_2019"])
def test_every_form_of_a_crs_becomes_one_text(code, form):
    own = parse_crs(code)
    wkt = pyproj.CRS.from_user_input(code).to_wkt(form)
    assert parse_crs(wkt) == own
    assert parse_crs(own) == own
    assert epsg_text(own) == code


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is not a CRS"),
        ("http://127.0.0.1:1/crs", "is not a CRS"),
        ("/etc/passwd", "is not a CRS"),
        ("../../secret.prj", "is not a CRS"),
        ("urn:ogc:def:crs:EPSG::25832", "is not a CRS"),
        ("+proj=utm +zone=32 +nadgrids=/etc/passwd", "is not a CRS"),
        ('{"type": "ProjectedCRS"}', "is not a CRS"),
        ("EPSG:999999", "not known to PROJ"),
        ("EPSG:25832+4326", "not known to PROJ"),
        ("PROJCRS[", "not known to PROJ"),
        ("PROJCRS[" * 8000, "not known to PROJ"),
        ("PROJCRS[" + "x" * 70_000, "70008 characters, at most 65536"),
        ("EPSG:4326", "geographic (degrees)"),
        ("EPSG:4979", "geographic (degrees)"),
        ("EPSG:4326+5773", "geographic (degrees)"),
        ("EPSG:4978", "geocentric"),
        ("EPSG:7837", "for heights only"),
        ("EPSG:2053", "axes west and south"),
        ('LOCAL_CS["site",UNIT["foot",0.3048]]', "local, but not in metres"),
    ],
)
def test_what_is_refused(text, words):
    with pytest.raises(CrsError) as caught:
        parse_crs(text, where="a.laz")
    line = str(caught.value)
    assert words in line
    assert line.startswith("a.laz: ")
    assert len(line) < 300
    assert caught.value.advice


def test_a_crs_is_given_as_text_code_or_object():
    expected = parse_crs("EPSG:25832")
    for given in (
        25832,
        np.int64(25832),
        pyproj.CRS.from_epsg(25832),
        pyproj.CRS.from_epsg(25832).to_wkt("WKT1_GDAL"),
    ):
        assert parse_crs(given) == expected
    compound = pyproj.CRS("EPSG:25832+7837")
    assert parse_crs(compound) == parse_crs("EPSG:25832+7837")


@pytest.mark.parametrize("wrong", [2.5, True, ("EPSG", 25832), b"EPSG:25832", object()])
def test_what_is_not_a_crs_is_refused_in_one_line(wrong):
    with pytest.raises(CrsError, match=r"^crs: .* is not a CRS: expected EPSG:n.* or crs=\"local\"\.$"):
        crs_text(wrong)


@pytest.mark.parametrize(
    ("code", "words"), [(4326, "degrees"), (999_999, "not known to PROJ"), (-1, "is not a CRS")]
)
def test_a_code_that_cannot_be_used_is_refused(code, words):
    with pytest.raises(CrsError, match=words):
        parse_crs(code)


@pytest.mark.parametrize("text", ["local", " Local ", 'LOCAL_CS["site",UNIT["metre",1]]'])
def test_local(text):
    assert parse_crs(text) == "local"
    assert unit_factors("local") == (1.0, 1.0)
    assert metric_twin("local") == "local"


@pytest.mark.parametrize(
    "code", ["EPSG:2225", "EPSG:2263+6360", "EPSG:2992+6360", "EPSG:2991+6360", "EPSG:2263+5703"]
)
def test_metric_twin_is_in_metres_and_keeps_its_datum(code):
    wkt = parse_crs(code)
    twin = metric_twin(wkt)
    assert unit_factors(wkt) != (1.0, 1.0)
    assert unit_factors(twin) == (1.0, 1.0)
    assert not same_crs(wkt, twin)
    assert parse_crs(twin) == twin
    assert metric_twin(twin) == twin
    own, new = pyproj.CRS(wkt), pyproj.CRS(twin)
    plan = (own.sub_crs_list or [own])[0], (new.sub_crs_list or [new])[0]
    assert plan[0].geodetic_crs == plan[1].geodetic_crs


def test_metric_twin_of_a_text_with_a_transformation_in_it():
    wkt = pyproj.CRS.from_epsg(2263).to_wkt("WKT1_GDAL")
    bound = wkt.replace('AUTHORITY["EPSG","6269"]', 'TOWGS84[0,0,0,0,0,0,0],AUTHORITY["EPSG","6269"]', 1)
    assert pyproj.CRS(bound).is_bound
    assert parse_crs(bound) == parse_crs("EPSG:2263")
    strange = bound.replace('"false_easting",984250', '"false_easting",984260')
    assert strange != bound
    assert unit_factors(metric_twin(parse_crs(strange))) == (1.0, 1.0)


@pytest.mark.parametrize("code", ["EPSG:25832", "EPSG:2263"])
def test_a_changed_definition_is_not_the_crs_it_claims_to_be(code):
    wkt = pyproj.CRS.from_user_input(code).to_wkt("WKT1_GDAL")
    changed = wkt.replace('"false_northing",0', '"false_northing",100')
    assert changed != wkt
    assert not same_plan(parse_crs(changed), parse_crs(code))
    assert epsg_text(parse_crs(changed)) == ""


def test_heights_without_a_crs_are_in_the_unit_of_the_plan():
    assert unit_factors(parse_crs("EPSG:2994")) == (0.3048, 0.3048)


def test_comparisons():
    compound, plan, other = (parse_crs(c) for c in ("EPSG:25832+7837", "EPSG:25832", "EPSG:25833"))
    assert same_plan(compound, plan)
    assert not same_crs(compound, plan)
    assert not same_plan(plan, other)
    assert not same_crs(plan, "local")
    assert has_height(compound)
    assert not has_height(plan)
    assert not has_height("local")
    assert describe_crs("local") == "local"
    assert describe_crs("") == "none"


def test_reading_a_crs_sends_nothing(monkeypatch):
    import socket

    def refuse(*_):
        raise AssertionError("a socket was opened")

    monkeypatch.setattr(socket.socket, "connect", refuse)
    with pytest.raises(CrsError):
        parse_crs("https://127.0.0.1:1/crs.wkt")


def keys(*entries):
    """A GeoKeyDirectory with values in place."""
    return struct.pack("<4H", 1, 1, 0, len(entries)) + b"".join(
        struct.pack("<4H", k, 0, 1, v) for k, v in entries
    )


OWN_PROJECTION = ((1024, 1), (3072, 32767))


@pytest.mark.parametrize(
    ("entries", "given", "factors"),
    [
        (OWN_PROJECTION, "local", (1.0, 1.0)),
        ((*OWN_PROJECTION, (3076, 9001)), "local", (1.0, 1.0)),
        ((*OWN_PROJECTION, (3076, 9003)), "local", (1200 / 3937, 1200 / 3937)),
        ((*OWN_PROJECTION, (3076, 9002), (4099, 9001)), "local", (0.3048, 1.0)),
        ((*OWN_PROJECTION, (3076, 9001), (4099, 9002)), "EPSG:25832", (1.0, 0.3048)),
        ((*OWN_PROJECTION, (3076, 9002)), "EPSG:2994", (0.3048, 0.3048)),
    ],
)
def test_units_of_a_projection_without_a_code(entries, given, factors):
    resolved = resolve_crs([(34735, keys(*entries))], given)
    assert resolved.factors == factors
    assert resolved.warnings[0].endswith("without EPSG code: taken from the CRS that was given")
    assert any("feet converted" in text for text in resolved.warnings) == (factors != (1.0, 1.0))


def test_units_of_a_projection_without_a_code_that_contradict_the_given_crs():
    with pytest.raises(CrsError) as caught:
        resolve_crs([(34735, keys(*OWN_PROJECTION, (3076, 9003)))], "EPSG:25832", where="a.las")
    assert str(caught.value) == (
        'a.las: its GeoTIFF keys state a unit of 0.30480061 m, crs="ETRS89 / UTM zone 32N (EPSG:25832)" has 1 m.'
        " Give the CRS that the coordinates are in, or correct the header."
    )


def test_a_crs_may_be_a_number_or_an_object():
    compound = parse_crs("EPSG:25832+7837")
    assert parse_crs(25832) == parse_crs("EPSG:25832") == parse_crs(np.int32(25832))
    assert parse_crs(pyproj.CRS.from_user_input("EPSG:25832+7837")) == compound
    for wrong in (None, 3.5, True, ["EPSG:25832"]):
        with pytest.raises(CrsError, match="is not a CRS"):
            parse_crs(wrong)
    with pytest.raises(CrsError, match="degrees"):
        parse_crs(4326)
