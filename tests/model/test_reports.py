"""The report of an extraction is short, whatever it holds."""

import pickle

import pytest
from tests.model.test_line_sets import page

from linework.model.lineset.report import InputReport, LeftOut, Report

FULL = Report(
    source="A7",
    kinds=("guardrail", "cable"),
    n_lines={"guardrail": 2, "cable": 1200},
    length_m={"guardrail": 130.0, "cable": 45.25},
    inputs=tuple(InputReport(f"{i}.laz", 1000, {"no time": 3, "far from all others": i}) for i in range(40)),
    left_out=tuple(LeftOut("tile", f"3_{i}", "of <no> use\nat all") for i in range(30)),
    warnings=tuple(f"{i}.laz: " + "times run backwards " * 20 for i in range(50)),
    timings_s={"read": 0.5, "find": 2.0},
    versions=dict.fromkeys(("linework", "numpy", "scipy", "numba", "laspy", "pyproj", "shapely"), "1.0"),
)


@pytest.mark.parametrize("report", [FULL, Report(source="A7", kinds=())])
def test_a_report_has_ten_lines_at_most(report):
    lines = repr(report).split("\n")
    assert len(lines) <= 10
    assert max(map(len, lines)) <= 110
    page(report._repr_html_())
    assert pickle.loads(pickle.dumps(report)) == report


def test_a_report_says_what_was_left_out():
    text = repr(FULL)
    assert text.startswith(
        "Report on A7: 1,202 lines, 175.2 m\n  guardrail 2 (130.0 m), cable 1,200 (45.2 m)\n"
    )
    assert "inputs: 40 (40,000 points or pairs used); left out: no time 120, far from all others 780" in text
    assert "left out: tile 3_0 (of <no> use at all); tile 3_1" in text
    assert "time: 2.5 s (find 2.0, read 0.5)" in text
    assert FULL.n_left_out == {"no time": 120, "far from all others": 780}
    html = FULL._repr_html_()
    assert html.count("of &lt;no&gt; use") == 33
    assert "<no>" not in html
    assert "left out: nothing" in repr(Report(source="A7", kinds=()))
