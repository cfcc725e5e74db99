"""Tables of feature codes: a firm's own layers and codes in DXF files."""

from __future__ import annotations

import re

import ezdxf
import numpy as np
import pytest

from linework.errors import InputError, UsageError
from linework.files.vectors.cad_codes import read_cad_codes
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.lines import LineSet


def sample():
    line = np.array([[500_000.0, 5_400_000.0, 100.0], [500_010.0, 5_400_001.0, 100.5]])
    return LineSet.from_lines(
        [line + i for i in range(5)], kind=["lane_marking"] * 3 + ["guardrail", "cable"],
        pattern=["solid", "dashed", "", "", ""],
    )  # fmt: skip


CODES = """kind,pattern,role,form,layer,code,color,linetype
lane_marking,dashed,,,V-MARK-DASH,MD,#ffcc00,
lane_marking,,,,V-MARK,ML,,dashed
cable,,,,V-WIRE,W1,#0000ff,
"""


def test_dxf_has_the_layers_and_codes_of_a_table(tmp_path):
    (tmp_path / "codes.csv").write_text(CODES)
    path = tmp_path / "lines.dxf"
    lines = sample()
    write_lines(lines, path, codes=read_cad_codes(tmp_path / "codes.csv"))
    document = ezdxf.readfile(path)
    polylines = document.modelspace().query("POLYLINE")
    assert [p.dxf.layer for p in polylines] == ["V-MARK", "V-MARK-DASH", "V-MARK", "guardrail", "V-WIRE"]
    assert ("code=W1") in [tag.value for tag in polylines[4].get_xdata("LINEWORK")]
    assert document.layers.get("V-MARK-DASH").rgb == (0xFF, 0xCC, 0x00)
    assert document.layers.get("V-MARK").dxf.linetype == "LINEWORK_DASHED"
    assert not document.audit().errors
    assert read_lines(path).kind.tolist() == lines.kind.tolist()
    with pytest.raises(UsageError, match=r"codes= is for \.dxf files"):
        write_lines(lines, tmp_path / "lines.kml", codes=read_cad_codes(tmp_path / "codes.csv"))


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "empty"),
        ("kind,code\ncable,1\n", "layer"),
        ("kind,layer\n", "has no rows"),
        ("kind,layer\ncable,\n", "line 2: '' is not a name of a layer"),
        ("kind,layer\ncable,A/B\n", "line 2: 'A/B' is not a name of a layer"),
        ("kind,layer,color\ncable,A,red\n", "line 2: 'red' is not a color"),
        ("kind,layer,linetype\ncable,A,\ncable,B,dotted\n", "line 3: unknown linetype 'dotted'"),
        ("kind,layer\ncable,A,B\n", "line 2 has other cells than the header"),
    ],
)
def test_a_wrong_table_of_codes_is_one_line(tmp_path, text, problem):
    path = tmp_path / "codes.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError, match=re.escape(problem)):
        read_cad_codes(path)


def test_layers_of_every_drawing_and_shared_ones_keep_the_looks_of_their_rows(tmp_path):
    (tmp_path / "codes.csv").write_text(
        "kind,pattern,layer,color\nlane_marking,solid,L,#ff0000\nlane_marking,dashed,l,#00ff00\n"
        "guardrail,,Defpoints,\ncable,,0,#0000ff\n"
    )
    path = tmp_path / "lines.dxf"
    write_lines(sample(), path, codes=read_cad_codes(tmp_path / "codes.csv"))
    document = ezdxf.readfile(path)
    first, second, *_ = document.modelspace().query("POLYLINE")
    assert document.layers.get("L").rgb == (255, 0, 0)
    assert not first.dxf.hasattr("true_color") and second.rgb == (0, 255, 0)
    assert second.dxf.linetype == "LINEWORK_DASHED"
    assert document.layers.get("0").rgb == (0, 0, 255)
    assert not document.audit().errors


def test_a_table_of_another_encoding_is_refused(tmp_path):
    path = tmp_path / "codes.csv"
    path.write_bytes("kind,layer\nkerb_top,BORDÜRE\n".encode("latin-1"))
    with pytest.raises(InputError, match=r"codes\.csv: is not UTF-8 text"):
        read_cad_codes(path)
