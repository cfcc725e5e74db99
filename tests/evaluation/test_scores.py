"""Scores: refused comparisons, short text, and as a frame."""

import json

import numpy as np
import pytest
from tests.evaluation.test_measures import lines, straight

from linework.errors import CrsError, UsageError
from linework.evaluation.measures import evaluate
from linework.model.lines import KINDS, LineSet


def scores():
    truth = lines(straight(), straight(9), straight(20), kind=["guardrail", "cable", "fence"])
    return evaluate(lines(straight(0.03), straight(30), kind=["guardrail", "barrier"]), truth)


def test_kinds_that_only_one_side_has_are_scored_and_listed():
    found = scores()
    assert [one.kind for one in found.kinds] == ["guardrail", "barrier", "fence", "cable"]
    assert found.missed == ("fence", "cable")
    assert found.unexpected == ("barrier",)
    assert (found["cable"].at.completeness, found["cable"].at.correctness) == (0, None)
    assert (found["barrier"].at.completeness, found["barrier"].at.correctness) == (None, 0)
    with pytest.raises(KeyError, match=r"unknown kind 'cabel'\. Did you mean cable\?"):
        found["cabel"]


def test_the_text_has_ten_lines_and_its_figures():
    text = repr(scores())
    assert text.splitlines()[0].startswith("Scores at 0.1 m: completeness 33.3 %, correctness 50.0 %")
    assert "nothing found of: fence, cable; none in the truth of: barrier" in text
    assert (
        repr(scores()["guardrail"])
        == "KindScores of guardrail: completeness 100.0 %, correctness 100.0 %, lateral rmse 0.030 m"
    )
    many = [*KINDS, "wall\n", "x" * 200, ""]
    every = lines(*[straight(20 * i) for i in range(len(many))], kind=many)
    for found in (every, lines(straight(), kind="other")):
        shown = repr(evaluate(found, every)).split("\n")
        assert len(shown) <= 10
        assert max(map(len, shown[:-1])) < 130


def test_a_frame_holds_the_main_figures_by_kind():
    found = scores()
    frame = found.to_frame()
    assert frame.index.tolist() == ["guardrail", "barrier", "fence", "cable", "overall"]
    for one in (*found.kinds, found.overall):
        row = frame.loc[one.kind]
        figures = {
            "completeness": one.at.completeness, "correctness": one.at.correctness, "n_found": one.n_extracted,
            "n_truth": one.n_reference, "lateral_rmse_m": one.at.lateral.rmse_m, "truth_m": one.reference_m,
            "space_p95_m": one.at.space.p95_m, "hausdorff_m": one.hausdorff_m,
        }  # fmt: skip
        for name, value in figures.items():
            np.testing.assert_equal(row[name], np.nan if value is None else value)
    assert all(dtype.kind in "fi" for dtype in frame.dtypes)
    curve = found.to_frame(curve=True)
    assert curve.index.names == ["kind", "tolerance_m"]
    assert curve.loc["guardrail"].index.tolist() == [0.05, 0.1, 0.2, 0.5]
    assert curve.loc[("guardrail", 0.05), "completeness"] == found["guardrail"].curve[0].completeness
    assert json.loads(json.dumps(found.to_dict()))["tolerance_m"] == 0.1


def test_what_cannot_be_compared_is_refused():
    truth = lines(straight())
    with pytest.raises(
        CrsError, match=r"lines are in ETRS89 / UTM zone 32N .*, reference in ETRS89 / UTM zone 33N"
    ):
        evaluate(truth.with_crs(25832), truth.with_crs(25833))
    with pytest.raises(UsageError, match=r"^found: str, expected a LineSet\. Read a file with read_lines\."):
        evaluate("lines.gpkg", truth)
    with pytest.raises(UsageError, match="neither"):
        evaluate(LineSet.empty(), LineSet.empty())
    assert evaluate(truth, truth, kinds="guardrail") == evaluate(truth, truth)
