"""Drawings of CAD programs: arcs, curves, blocks and mirrored planes are where they are drawn; flat lines beside others."""

import warnings

import ezdxf
import numpy as np
import pytest
import shapely

from linework.errors import LineworkWarning, UsageError
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.lines import LineSet

#: Bulge of a quarter of a circle.
QUARTER = np.tan(np.pi / 8)


@pytest.fixture
def drawing(tmp_path):
    """Return a modelspace, and a function that saves the drawing and reads its lines by layer."""
    document = ezdxf.new("R2018")

    def lines():
        document.saveas(tmp_path / "others.dxf")
        found = read_lines(tmp_path / "others.dxf", crs="EPSG:25832")
        return dict(zip(found.kind.tolist(), (line.xyz for line in found), strict=True))

    return document, lines


def farthest(xyz, middle, radius):
    """Return how far places are from a circle."""
    return np.abs(np.hypot(*(xyz[:, :2] - middle).T) - radius).max()


def test_arcs_in_polylines_are_round(drawing):
    document, lines = drawing
    space = document.modelspace()
    corners = [
        (500_000, 5_400_000, 0, 0, QUARTER),
        (500_010, 5_400_010, 0, 0, 0),
        (500_010, 5_400_040, 0, 0, 0),
    ]
    space.add_lwpolyline(corners, dxfattribs={"layer": "kerb", "elevation": 101.5})
    flat = [(500_020, 5_400_000, 0), (500_030, 5_400_010, 0)]
    space.add_polyline2d(flat, dxfattribs={"layer": "old"}).vertices[0].dxf.bulge = QUARTER
    found = lines()
    kerb = found["kerb"]
    assert farthest(kerb[:-1], [500_000, 5_400_010], 10.0) < 1e-6 and (kerb[:, 2] == 101.5).all()
    length = shapely.LineString(kerb[:, :2]).length
    assert length == pytest.approx(5 * np.pi + 30, abs=0.005) and tuple(kerb[-1, :2]) == (500_010, 5_400_040)
    assert farthest(found["old"], [500_020, 5_400_010], 10.0) < 1e-6


def test_curves_are_read(drawing):
    document, lines = drawing
    space = document.modelspace()
    space.add_arc((500_050, 5_400_050, 7), 10, 0, 90, dxfattribs={"layer": "arc"})
    space.add_circle((500_000, 5_400_110), 5, dxfattribs={"layer": "circle"})
    space.add_ellipse((500_050, 5_400_110), (5, 0), 0.5, dxfattribs={"layer": "ellipse"})
    fit = [(500_000, 5_400_060, 100), (500_020, 5_400_062, 100.2), (500_040, 5_400_060, 100.1)]
    space.add_spline(fit, dxfattribs={"layer": "spline"})
    found = lines()
    assert farthest(found["arc"], [500_050, 5_400_050], 10.0) < 1e-6 and (found["arc"][:, 2] == 7).all()
    assert farthest(found["circle"], [500_000, 5_400_110], 5.0) < 1e-6
    assert shapely.LineString(found["circle"][:, :2]).is_ring
    assert np.ptp(found["ellipse"], axis=0).round(3).tolist() == [10.0, 5.0, 0.0]
    away = shapely.distance(shapely.points(np.array(fit)[:, :2]), shapely.LineString(found["spline"][:, :2]))
    assert away.max() < 2e-3


def test_closed_polylines_end_where_they_begin(drawing):
    document, lines = drawing
    square = [(0, 0), (10, 0), (10, 10)]
    document.modelspace().add_lwpolyline(square, close=True, dxfattribs={"layer": "flat"})
    document.modelspace().add_polyline3d([(*p, 5) for p in square], close=True, dxfattribs={"layer": "space"})
    for xyz in lines().values():
        assert len(xyz) == 4 and (xyz[0] == xyz[-1]).all()


def test_blocks_are_at_their_places_and_on_their_layers(drawing):
    document, lines = drawing
    post = document.blocks.new("POST")
    post.add_line((0, 0), (1, 0), dxfattribs={"layer": "0"})
    rail = document.blocks.new("RAIL")
    rail.add_lwpolyline([(0, 0), (4, 0)], dxfattribs={"layer": "beam"})
    rail.add_blockref("POST", (2, 0), dxfattribs={"layer": "posts"})
    document.modelspace().add_blockref("RAIL", (100, 200, 30), dxfattribs={"rotation": 90})
    found = lines()
    np.testing.assert_allclose(found["beam"], [[100, 200, 30], [100, 204, 30]], atol=1e-9)
    np.testing.assert_allclose(found["posts"], [[100, 202, 30], [101 - 1, 203, 30]], atol=1e-9)


def test_planes_seen_from_below_are_mirrored(drawing):
    document, lines = drawing
    document.modelspace().add_lwpolyline(
        [(-1, 0), (-5, 0)], dxfattribs={"layer": "a", "extrusion": (0, 0, -1)}
    )
    np.testing.assert_allclose(lines()["a"], [[1, 0, 0], [5, 0, 0]], atol=1e-12)


def test_what_is_no_line_or_no_road_is_named(drawing):
    document, lines = drawing
    space = document.modelspace()
    space.add_line((0, 0, 1), (9, 0, 1), dxfattribs={"layer": "good"})
    space.add_arc((0, 0), 1e9, 0, 90, dxfattribs={"layer": "huge"})
    space.add_polymesh((3, 3), dxfattribs={"layer": "mesh"})
    document.blocks.new("MANY").add_line((0, 0), (1, 0))
    space.add_blockref(
        "MANY", (0, 0), dxfattribs={"row_count": 30_000, "column_count": 30_000, "row_spacing": 1}
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", LineworkWarning)
        found = lines()
    text = " ".join(str(w.message) for w in caught)
    assert list(found) == ["good"] and "3" in text and "huge" in text


def test_flat_lines_beside_others_are_left_out_and_said(linework, drawing, tmp_path):
    flat = [[0.0, 0.0], [9.0, 0.0]]
    rows = [np.column_stack([flat, np.full(2, z)]) for z in (5.0, np.nan, 6.0)]
    path = tmp_path / "maps.xml"
    texts = [" ".join(f"{y} {x}" + ("" if z != z else f" {z}") for x, y, z in row.tolist()) for row in rows]
    kinds = ["PntList2D" if "nan" in str(row) else "PntList3D" for row in rows]
    path.write_text('<LandXML version="1.2"><PlanFeatures name="edge">' + "".join(
        f'<PlanFeature name="{i}"><CoordGeom><IrregularLine><{kind}>{text}</{kind}></IrregularLine></CoordGeom></PlanFeature>'
        for i, (kind, text) in enumerate(zip(kinds, texts, strict=True))
    ) + "</PlanFeatures></LandXML>")  # fmt: skip
    found = linework("convert", path, tmp_path / "a.geojson", "--crs", "local")
    assert found.code == 4 and "left out 1 of 3 lines without heights (the first is line 1)" in found.line
    assert len(read_lines(tmp_path / "a.geojson", crs="local")) == 2
    with pytest.raises(UsageError, match="without a height"):
        write_lines(LineSet.from_lines([rows[1]], kind="edge"), tmp_path / "b.geojson")


def test_maps_that_editors_hold_open_are_as_they_show_them(tmp_path):
    path = tmp_path / "josm.osm"
    path.write_text(
        "<osm version='0.6' generator='JOSM'><node id='-1' lat='49.0' lon='8.4'/>"
        "<node id='-2' lat='49.0' lon='8.401'><tag k='ele' v='112.5 m'/></node>"
        "<node id='-3' action='delete' lat='49.0' lon='8.402'/>"
        "<way id='-4' action='modify'><nd ref='-1'/><nd ref='-2'/><tag k='type' v='line_thin'/></way>"
        "<way id='-5' action='delete'><nd ref='-1'/><nd ref='-2'/><tag k='type' v='curbstone'/></way>"
        "<way id='-6' visible='false'><nd ref='-1'/><nd ref='-3'/></way></osm>"
    )
    found = read_lines(path, crs="EPSG:25832")
    assert found.kind.tolist() == ["lane_marking"] and found.xyz[:, 2].tolist() == [0.0, 112.5]
