"""Drawings with damage: what is damaged is left out and said, and the good lines beside it are read."""

import warnings

import ezdxf
import numpy as np
import pytest

from linework.errors import LineworkWarning
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
