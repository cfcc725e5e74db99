"""Words, groups, dashes and bridged stretches on cases small enough to work out by hand."""

import numpy as np
import pytest

from linework.errors import UsageError
from linework.evaluation.measures import evaluate, match_lines, scores_of
from linework.evaluation.report.tables import score_tables
from linework.model.lines import LineSet


def lines(*vertices, kind="lane_marking", **columns):
    return LineSet.from_lines(
        [np.array(v, dtype=float) for v in vertices], kind=[kind] * len(vertices), **columns
    )


def straight(y=0.0, x0=0.0, x1=100.0, step=100.0):
    x = np.linspace(x0, x1, max(round((x1 - x0) / step), 1) + 1)
    return np.stack([x, np.full_like(x, y), np.zeros_like(x)], axis=1)


def only(scores):
    (kind,) = scores.kinds
    return kind


def test_words_are_compared_over_the_found_truth():
    truth = lines(straight(0), straight(10), straight(20, 0, 50), pattern=["solid", "dashed", "solid"])
    found = lines(straight(0), straight(10), straight(30), pattern=["solid", "solid", "dashed"])
    pattern = only(evaluate(found, truth)).labels["pattern"]
    assert pattern.compared_m == pytest.approx(200)
    assert pattern.share_right == pytest.approx(0.5)
    assert pattern.mistaken_m == {"dashed > solid": pytest.approx(100)}


def test_a_word_that_is_missing_is_wrong_and_one_the_truth_has_not_is_not_asked_for():
    truth = lines(straight(0), straight(10), role=["edge", ""])
    labels = only(evaluate(lines(straight(0), straight(10), role=["", "lane"]), truth)).labels
    assert labels["role"].compared_m == pytest.approx(100)
    assert labels["role"].share_right == 0
    assert labels["role"].mistaken_m == {"edge > -": pytest.approx(100)}
    assert labels["form"].share_right is None


def test_a_double_line_is_one_of_a_pair():
    truth = lines(straight(0), straight(10), pattern=["solid", "solid"], double=[True, False])
    found = lines(straight(0), straight(10), pattern=["solid", "solid"], double=[True, True])
    double = only(evaluate(found, truth)).labels["double"]
    assert double.share_right == pytest.approx(0.5)
    assert list(double.mistaken_m) == ["single > double"]


def test_a_number_of_beams_is_a_word_and_no_error_in_centimetres():
    truth = lines(straight(0), straight(10), kind="guardrail", n_beams=[2, 1], lower_m=[0.4, 0.4])
    found = lines(straight(0), straight(10), kind="guardrail", n_beams=[3, 1], lower_m=[0.5, 0.4])
    scores = evaluate(found, truth)
    assert only(scores).labels["n_beams"].mistaken_m == {"2 > 3": pytest.approx(100)}
    assert only(scores).labels["n_beams"].share_right == pytest.approx(0.5)
    (table,) = (t for t in score_tables(scores) if t.title.startswith("Errors of height"))
    assert [row[1] for row in table.rows] == ["lower"]
    assert "lower edge" in table.title


def test_pipes_one_above_another_are_told_apart_by_their_heights():
    def pipes(*heights):
        return lines(*(straight() + np.array([0, 0, z]) for z in heights), kind="guardrail", form="tube")

    s = only(evaluate(pipes(1.01, 0.51), pipes(0.5, 1.0))).at
    assert (s.completeness, s.correctness) == (1, 1)
    assert s.height.rmse_m == pytest.approx(0.01)
    s = only(evaluate(pipes(1.01, 0.75), pipes(0.5, 1.0))).at
    assert (s.completeness, s.correctness) == (pytest.approx(0.5), pytest.approx(0.5))
    # Other rails are matched in plan
    w_beam = only(evaluate(pipes(1.01).with_columns(form="w_beam"), pipes(0.5).with_columns(form="w_beam")))
    assert (w_beam.at.completeness, w_beam.at.height.bias_m) == (1, pytest.approx(0.51))


def test_boundaries_are_scored_by_form():
    truth = lines(
        straight(0), straight(10, 0, 50), kind="road_boundary", form=["kerb", "edge"], height_m=[0.12, 0.03]
    )
    found = lines(
        straight(0.02, 0, 80), straight(10.04, 0, 50), straight(40, 0, 20), straight(60, 0, 10),
        kind="road_boundary", form=["kerb", "kerb", "kerb", "edge"], height_m=[0.13, 0.05, 0.1, 0.1],
    )  # fmt: skip
    scores = only(evaluate(found, truth))
    edge, kerb = scores.groups
    assert (edge.value, edge.n_reference, kerb.value, kerb.n_reference) == ("edge", 1, "kerb", 1)
    # What lies on the edge counts there, whatever it calls itself; what lies on nothing where it says
    assert (edge.extracted_m, kerb.extracted_m) == (pytest.approx(60), pytest.approx(100))
    assert edge.at.completeness == 1
    assert edge.at.correctness == pytest.approx(50 / 60)
    assert kerb.at.completeness == pytest.approx(0.801)
    assert kerb.at.correctness == pytest.approx(0.8)
    assert edge.at.lateral.bias_m == pytest.approx(0.04)
    assert kerb.at.lateral.bias_m == pytest.approx(0.02)
    assert (edge.at.lateral.n, kerb.at.lateral.n, kerb.at.n_missed) == (100, 160, 40)
    assert kerb.height.rmse_m == pytest.approx(0.01)
    assert edge.height.rmse_m == pytest.approx(0.02)
    assert scores.labels["form"].share_right == pytest.approx(80.1 / 130.1, abs=0.001)


def test_groups_add_up_to_the_kind():
    rng = np.random.default_rng(5)
    patterns = np.array(["solid", "dashed", ""])
    truth = lines(*(straight(4 * i, 0, 40) for i in range(6)), pattern=patterns[[0, 1, 0, 1, 2, 0]])
    moved = [straight(4 * i + rng.normal(0, 0.06), rng.uniform(0, 10), 38) for i in range(8)]
    scores = only(evaluate(lines(*moved, pattern=patterns[[0, 0, 1, 1, 2, 0, 1, 2]]), truth))
    assert [group.value for group in scores.groups] == ["", "dashed", "solid"]
    assert sum(g.extracted_m for g in scores.groups) == pytest.approx(scores.extracted_m)
    assert sum(g.reference_m for g in scores.groups) == pytest.approx(scores.reference_m)
    for name in ("matched_extracted_m", "matched_reference_m", "n_missed"):
        assert sum(getattr(g.at, name) for g in scores.groups) == pytest.approx(getattr(scores.at, name))
    assert sum(g.at.lateral.n for g in scores.groups) == scores.at.lateral.n


def dashes(*spans, y=0.0, **columns):
    return lines(*(straight(y, *span) for span in spans), kind="lane_marking_dash", **columns)


def test_dashes_are_paired_one_to_one():
    truth = dashes((0, 3), (9, 12), (18, 21), (27, 30))
    # Right; 4 cm too long and 2 cm too short; in two halves, one longer; one run through two and on
    found = dashes((0, 3), (8.96, 11.98), (18, 19.9), (20, 21), (24, 40))
    d = only(evaluate(found, truth)).dashes
    assert (d.n_reference, d.n_found, d.n_extracted, d.n_right) == (4, 4, 5, 4)
    assert (d.share_found, d.share_right) == (1.0, 0.8)
    errors = np.array([0, 0, 0.04, -0.02, 0, -1.1, 3, 10])
    assert d.ends.n == 8
    assert d.ends.bias_m == pytest.approx(errors.mean())
    assert d.ends.rmse_m == pytest.approx(np.sqrt(np.mean(errors**2)))
    assert d.share_ends_within == pytest.approx(5 / 8)


def test_the_drawing_direction_of_a_dash_does_not_matter():
    truth, found = dashes((0, 3)), lines(straight(0, 0.05, 3.02)[::-1], kind="lane_marking_dash")
    d = only(evaluate(found, truth)).dashes
    assert d.ends.bias_m == pytest.approx((-0.05 + 0.02) / 2)
    back = lines(straight(0, 0, 3)[::-1], kind="lane_marking_dash")
    assert only(evaluate(found, back)).dashes.ends.bias_m == pytest.approx(d.ends.bias_m)


def test_a_dash_is_asked_for_where_half_of_it_was_seen():
    vertices = (0.0, 1.0, 2.0, 3.0)
    truth = dashes((0, 3, 1.0), (9, 12, 1.0), observed=[True, True, True, False, False, False, True, True])
    assert len(truth.xyz) == 2 * len(vertices)
    d = only(evaluate(dashes((0, 3.2), (9, 12)), truth)).dashes
    # Of the first the hidden end is not judged; the second was hidden, and is right all the same
    assert (d.n_reference, d.n_found, d.n_right) == (1, 1, 2)
    assert d.ends.n == 2
    assert d.ends.bias_m == pytest.approx(0)


def test_an_end_may_be_off_by_the_distance_of_the_scan_lines():
    truth, found = dashes((0, 3)), dashes((0.15, 3.3))
    for limit_m, share in ((0.10, 0.0), (0.20, 0.5), (0.30, 1.0)):
        d = only(scores_of(match_lines(found, truth, dash_end_m=limit_m))).dashes
        assert (d.end_limit_m, d.share_ends_within) == (limit_m, share)


def test_an_end_limit_of_nothing_is_refused():
    with pytest.raises(UsageError, match="0 m"):
        match_lines(dashes((0, 3)), dashes((0, 3)), dash_end_m=0.0)


def test_a_dash_beside_or_half_covered_is_not_found():
    truth = dashes((0, 3), (9, 12))
    d = only(evaluate(dashes((0, 3), y=0.2), truth)).dashes
    assert (d.n_found, d.n_right, d.ends.rmse_m) == (0, 0, None)
    d = only(evaluate(dashes((0, 1.3), (9, 10.6)), truth)).dashes
    assert (d.n_found, d.n_right) == (1, 1)


def test_other_kinds_have_no_dashes():
    scores = evaluate(lines(straight()), lines(straight()))
    assert only(scores).dashes is None
    assert scores.overall.labels["role"].share_right is None


def test_bridged_stretches_are_scored_apart():
    # 100 m, of which 40 to 60 m hidden; bridged there, and from 60 to 70 m, 6 cm beside the truth
    x = np.array([0, 40, 40.001, 70, 70.001, 100.0])
    y = np.array([0.01, 0.01, 0.06, 0.06, 0.01, 0.01])
    found = lines(
        np.stack([x, y, 0 * x], axis=1),
        bridged=[False, False, True, True, False, False],
        sigma_xy_m=[0.01, 0.01, 0.03, 0.03, 0.01, 0.01],
    )
    observed = (np.arange(101) <= 40) | (np.arange(101) >= 60)
    scores = only(evaluate(found, lines(straight(step=1.0), observed=observed)))
    b = scores.bridged
    assert (b.hidden_m, b.hidden_found_m) == (pytest.approx(20), pytest.approx(20))
    assert b.bridged_m == pytest.approx(30, abs=0.2)
    assert b.share_right == 1
    assert (b.lateral.n, b.lateral.bias_m) == (60, pytest.approx(0.06))
    assert (b.lateral_measured.n, b.lateral_measured.bias_m) == (140, pytest.approx(0.01))
    assert [t.rms_ratio for t in scores.sigma_xy] == [pytest.approx(1)]
    assert [t.rms_ratio for t in b.sigma_xy] == [pytest.approx(2)]


def test_a_bridge_beyond_the_tolerance_still_has_its_error():
    found = lines(straight(0.2, 0, 30), bridged=[True, True])
    b = only(evaluate(found, lines(straight(0, 0, 30)))).bridged
    assert (b.share_right, b.bridged_m) == (0, pytest.approx(30))
    assert b.lateral.rmse_m == pytest.approx(0.2)
    assert b.lateral_measured.rmse_m is None


def test_groups_know_what_was_bridged_of_them():
    truth = lines(straight(0), straight(10), pattern=["solid", "dashed"])
    found = lines(
        straight(0.01), straight(10.04), pattern=["solid", "dashed"], bridged=[False, False, True, True]
    )
    dashed, solid = only(evaluate(found, truth)).groups
    assert dashed.bridged.bridged_m == pytest.approx(100)
    assert dashed.bridged.lateral.rmse_m == pytest.approx(0.04)
    assert dashed.bridged.lateral_measured.rmse_m is None
    assert solid.bridged.bridged_m == 0
    assert solid.bridged.lateral_measured.rmse_m == pytest.approx(0.01)


def test_the_tables_say_it():
    truth = lines(straight(0), straight(10), pattern=["solid", "dashed"], role=["edge", "lane"])
    found = lines(straight(0), straight(10), pattern=["solid", "solid"], role=["edge", "lane"])
    dash = dashes((0, 3), (9, 12))
    scores = evaluate(LineSet.concatenate([found, dash]), LineSet.concatenate([truth, dash]))
    tables = {table.title: table for table in score_tables(scores)}
    assert [row[:2] for row in tables["By form and pattern"].rows] == [
        ("lane_marking", "pattern dashed"),
        ("lane_marking", "pattern solid"),
    ]
    assert ("lane_marking", "pattern", "200.0", "50.0 %", "dashed > solid 50.0 %") in tables[
        "Attributes of the lines"
    ].rows
    assert tables["Dashes"].rows[0][:4] == ("lane_marking_dash", "2", "2", "100.0 %")
    assert "Bridged" not in tables
    hidden = truth.with_columns(observed=np.zeros(len(truth.xyz), dtype=bool))
    tables = {table.title: table for table in score_tables(evaluate(found, hidden))}
    assert tables["Bridged"].rows[0][:4] == ("lane_marking", "200.0", "100.0 %", "0.0")
