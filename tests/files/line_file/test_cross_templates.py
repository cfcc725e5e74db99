"""The table of templates: what is wrong with it is said in one line that names the place."""

from __future__ import annotations

import pytest

from linework.errors import InputError
from linework.files.line_file.cross_templates import read_cross_templates, text_of_templates

HEADER = "template,node,edge,across_m,up_m,kind,role"
ROW = "kerb,top,top,0.020,0.100,kerb_top,"


def read(tmp_path, *lines):
    path = tmp_path / "lines.templates.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return read_cross_templates(path)


def test_a_table_is_read_as_it_was_written(tmp_path):
    rows = [ROW, "kerb,back,shade,-1e-1,.5,edge_other,footway_back"]
    (kerb,) = found = read(tmp_path, HEADER, *rows)
    assert [(node.across_m, node.up_m) for node in kerb.nodes] == [(0.02, 0.1), (-0.1, 0.5)]
    assert read(tmp_path, text_of_templates(found)) == found
    assert read(tmp_path, HEADER) == ()


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("kerb,foot,foot,1_0,0,road_boundary,", "line 3: across_m is a number in metres"),
        ("kerb,foot,foot,0,inf,road_boundary,", "line 3: up_m is a number in metres"),
        ("kerb,foot,foot,0,0,road_boundary,verge", "line 3: road_boundary has no role"),
        ("kerb,verge,fixed,0,0,edge_other,hedge", "line 3: the role of edge_other is one of gutter"),
        ("kerb,paint,stripe,0,0,lane_marking,verge", "line 3: the role of lane_marking is one of edge"),
    ],
)
def test_a_wrong_cell_is_named(tmp_path, row, said):
    with pytest.raises(InputError, match=said):
        read(tmp_path, HEADER, ROW, row)


@pytest.mark.parametrize("column", ["remark", "role", ""])
def test_an_unknown_column_is_refused(tmp_path, column):
    with pytest.raises(InputError, match=f"unknown column '{column}'"):
        read(tmp_path, f"{HEADER},{column}", f"{ROW},mine")
