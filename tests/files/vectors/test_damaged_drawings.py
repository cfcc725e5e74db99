"""Drawings with damage: what is damaged is left out and said, and the good lines beside it are read."""

import warnings

import ezdxf
import numpy as np
import pytest

from linework.errors import InputError, LineworkWarning
from linework.files.vectors.read_write import read_lines

SNAKE = [(0, 0, 0), (5, 1, 0), (10, 0, 0), (15, 3, 0)]


@pytest.fixture
def drawing(tmp_path):
    """Return a drawing with a good line on the layer "good", and a function that reads its lines and what is said."""
    document = ezdxf.new("R2018")
    document.modelspace().add_line((0, 0, 1), (9, 0, 1), dxfattribs={"layer": "good"})

    def read():
        document.saveas(tmp_path / "damaged.dxf")
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", LineworkWarning)
            lines = read_lines(tmp_path / "damaged.dxf", crs="local")
        return lines, " ".join(str(w.message) for w in caught)

    return document, read


def missing_block(document, space):
    space.add_blockref("NOPE", (0, 0))


def empty_spline(document, space):
    space.add_spline(dxfattribs={"layer": "bad"})


def wrong_knots(document, space):
    space.add_open_spline(SNAKE, dxfattribs={"layer": "bad"}).knots = [0, 0, 0, 1]


@pytest.mark.parametrize("in_block", [False, True], ids=["plain", "in_block"])
@pytest.mark.parametrize(
    ("add", "named"), [(missing_block, "NOPE"), (empty_spline, "SPLINE"), (wrong_knots, "SPLINE")]
)
def test_good_lines_beside_damage_are_read(drawing, add, named, in_block):
    document, read = drawing
    expected = ["good"]
    if in_block:
        block = document.blocks.new("B")
        add(document, block)
        block.add_line((0, 0), (4, 0), dxfattribs={"layer": "beside"})
        document.modelspace().add_blockref("B", (100, 0, 5))
        expected = ["beside", "good"]
    else:
        add(document, document.modelspace())
    lines, said = read()
    assert sorted(lines.kind.tolist()) == expected
    assert "left out" in said and named in said
    if in_block:
        beside = lines[lines.kind.tolist().index("beside")]
        np.testing.assert_allclose(beside.xyz, [[100, 0, 5], [104, 0, 5]])


def test_a_block_is_named_once(drawing):
    document, read = drawing
    for i in range(5):
        document.modelspace().add_blockref("NOPE", (i, 0))
    assert read()[1].endswith("left out block NOPE on layer 0: there is no such block")


def test_blocks_that_multiply_are_refused(drawing):
    document, read = drawing
    document.blocks.new("B0").add_line((0, 0), (1, 0))
    for i in range(3):
        document.blocks.new(f"B{i + 1}").add_blockref(
            f"B{i}", (0, 0), dxfattribs={"row_count": 100, "column_count": 100, "row_spacing": 1}
        )
    row = document.modelspace().add_blockref("B1", (0, 0))
    assert len(read()[0]) == 101
    row.dxf.name = "B3"
    with pytest.raises(InputError, match="its blocks draw more than 1,000,000 entities"):
        read()


@pytest.mark.parametrize("bulge", [1e6, -1e6, 1e12, float("nan")])
def test_absurd_bulges_are_left_out(drawing, bulge):
    document, read = drawing
    document.modelspace().add_lwpolyline([(0, 0, 0, 0, bulge), (900, 0, 0, 0, 0)], dxfattribs={"layer": "b"})
    lines, said = read()
    assert lines.kind.tolist() == ["good"] and "radius of more than" in said


@pytest.mark.parametrize("bulge", [1e-15, 0.3, -0.3, 1.0, 4.0, -4.0])
def test_arcs_turn_as_their_bulge_says(drawing, bulge):
    document, read = drawing
    points = [(10, 20, 0, 0, bulge), (16, 28, 0, 0, 0)]
    document.modelspace().add_lwpolyline(points, dxfattribs={"layer": "arc", "elevation": 3.0})
    lines = read()[0]
    xyz = lines[lines.kind.tolist().index("arc")].xyz
    assert xyz[0].tolist() == [10, 20, 3] and xyz[-1].tolist() == [16, 28, 3]
    radius = 10.0 * (1 + bulge**2) / (4 * abs(bulge))
    length = np.hypot(*np.diff(xyz[:, :2], axis=0).T).sum()
    assert length == pytest.approx(4 * np.arctan(abs(bulge)) * radius, rel=1e-3)
    # The middle of an arc is its bulge times half the chord to the right of it
    middle = np.array([13, 24]) + bulge * np.array([4, -3])
    assert np.hypot(*(xyz[:, :2] - middle).T).min() < 0.2 or len(xyz) == 2


def test_vertices_keep_their_heights_where_the_polyline_has_none(drawing):
    document, read = drawing
    for layer, up in (("own", 0.0), ("plane", 7.0)):
        line = document.modelspace().add_polyline2d([(0, 0), (10, 0)], dxfattribs={"layer": layer})
        line.dxf.elevation = (0, 0, up)
        for vertex, z in zip(line.vertices, (112.5, 113.5), strict=True):
            vertex.dxf.location = (vertex.dxf.location.x, 0, z)
    lines = read()[0]
    heights = {kind: line.xyz[:, 2].tolist() for kind, line in zip(lines.kind.tolist(), lines, strict=True)}
    assert heights["own"] == [112.5, 113.5] and heights["plane"] == [7.0, 7.0]
