"""Tables, pictures and the page."""

import re
from dataclasses import replace

import numpy as np
import pytest

from linework.evaluation.chains import Chains, cut_into_pieces
from linework.evaluation.measures import evaluate, match_lines, scores_of
from linework.evaluation.report.page import ReportContent, report_html
from linework.evaluation.report.plan import plan_figure
from linework.evaluation.report.scores_figure import chosen_stretches, hits_figure, plot_png, tolerance_figure
from linework.evaluation.report.sections import cable_section, rail_sections
from linework.evaluation.report.tables import kinds_table, lines_table, score_tables
from linework.model.lines import LineSet
from linework.model.points import Points

ORIGIN = np.array([691_000.0, 5_336_000.0, 500.0])


def sagging(z):
    x = np.linspace(0, 40, 21)
    return np.stack([x, np.full_like(x, 5.0), z + 2 * (x / 20 - 1) ** 2], axis=1)


@pytest.fixture
def truth():
    rail = np.array([[0, 0, 0.75], [60, 0, 0.75]])
    lines = [rail + ORIGIN, sagging(6.0) + ORIGIN, sagging(6.6) + ORIGIN]
    return LineSet.from_lines(
        lines,
        kind=["guardrail", "cable", "cable"],
        id=["rail-1", "cable-1", "cable-2"],
        height_m=[0.75, np.nan, np.nan],
    )


@pytest.fixture
def points():
    rng = np.random.default_rng(5)
    ground = np.stack([rng.uniform(-5, 65, 20_000), rng.uniform(-8, 8, 20_000), np.zeros(20_000)], axis=1)
    return Points(ground + ORIGIN)


def test_tables_have_a_text_in_every_cell(truth):
    found = truth.with_columns(
        xyz=truth.xyz + np.array([0, 0.02, 0]), sigma_xy_m=np.full(len(truth.xyz), 0.02)
    )
    tables = [*score_tables(evaluate(found, truth)), kinds_table(found), lines_table(found)]
    assert len(tables) == 8
    for table in tables:
        assert table.rows
        assert all(len(row) == len(table.columns) for row in table.rows)
        assert all(isinstance(text, str) for row in table.rows for text in row)
    assert [row[0] for row in tables[0].rows] == ["guardrail", "cable", "overall"]
    assert tables[1].rows[0][3:7] == ("2.0", "2.0", "2.0", "2.0")
    assert lines_table(found).rows[0][:5] == ("rail-1", "guardrail", "", "", "60.0")


def test_one_kind_needs_no_overall(truth):
    scores = evaluate(truth, truth, kinds=["guardrail"])
    assert [row[0] for row in next(score_tables(scores)).rows] == ["guardrail"]


def test_runs_join_pieces_and_break_at_gaps_and_lines():
    lines = LineSet.from_lines([[[0, 0, 0], [10, 0, 0]], [[0, 5, 0], [10, 5, 0]]], kind=["fence", "fence"])
    chains = Chains.of(lines, np.zeros(3), 2)
    pieces = cut_into_pieces(chains)
    chosen = np.ones(len(pieces), dtype=bool)
    chosen[30:50] = False
    runs = chosen_stretches(chains, pieces, chosen)
    ends = [run[[0, -1]].round(6).tolist() for run in runs]
    assert ends == [[[0, 0], [3, 0]], [[5, 0], [10, 0]], [[0, 5], [10, 5]]]
    assert chosen_stretches(chains, pieces, np.zeros(len(pieces), dtype=bool)) == []


def test_pictures_are_the_same_twice(truth):
    parts = match_lines(truth, truth)
    for draw in (
        lambda: hits_figure(parts, 0.1), lambda: tolerance_figure(scores_of(parts)), lambda: plan_figure(truth, None),
    ):  # fmt: skip
        image = plot_png(draw())
        assert image.startswith(b"\x89PNG")
        assert image == plot_png(draw())


def test_nothing_is_drawn_without_failing():
    nothing = LineSet.empty()
    assert plot_png(hits_figure(match_lines(nothing, nothing, kinds=["cable"]), 0.1)).startswith(b"\x89PNG")
    assert plot_png(plan_figure(nothing, None)).startswith(b"\x89PNG")
    assert plot_png(plan_figure(nothing, Points(np.zeros((0, 3))))).startswith(b"\x89PNG")


def test_a_rail_is_cut_at_even_distances_above_the_road(truth, points):
    sections = rail_sections(points, truth, truth)
    assert [s.title for s in sections] == [f"rail-1, {m} m from its start" for m in (10, 30, 50)]
    for section in sections:
        assert section.datum == "the road"
        assert section.found[0].tolist() == [[0, pytest.approx(0.75)]]
        assert section.truth[0].tolist() == [[pytest.approx(0), pytest.approx(0.75)]]
        assert np.abs(section.points[:, 0]).max() <= 1.6
        assert section.points[:, 1] == pytest.approx(0)
        # 20 000 points on 70 m x 16 m, a slice of 3.2 m x 0.6 m
        assert 15 < len(section.points) < 60


def test_right_of_a_rail_is_right(truth):
    # Drawn eastward: south is to the right
    south = Points(np.array([[30.0, -1.0, 0.0]]) + ORIGIN)
    assert rail_sections(south, truth, None)[1].points.tolist() == [[1, pytest.approx(0)]]


def test_cables_above_one_another_are_in_one_section(truth, points):
    section = cable_section(points, truth, truth)
    assert section.title == "2 cables along a span of 40 m"
    one = truth.take(np.flatnonzero(truth.kind == "cable")[:1])
    assert cable_section(points, one, None).title == "1 cable along a span of 40 m"
    assert len(section.found) == len(section.truth) == 2
    lowest = [line[:, 1].min() for line in section.found]
    assert lowest == pytest.approx([6.0, 6.6])
    assert np.ptp(section.found[0][:, 0]) == pytest.approx(40)


def test_no_rail_no_cable_no_section(points):
    fence = LineSet.from_lines([ORIGIN + np.array([[0, 0, 0], [9, 0, 0]])], kind=["fence"])
    assert rail_sections(points, fence, None) == ()
    assert cable_section(points, fence, None) is None


def test_the_page_is_whole_and_safe(truth, points):
    parts = match_lines(truth, truth)
    report = ReportContent(
        title="<script>alert(1)</script>", lines=truth, points=points, reference=truth, parts=parts,
        scores=scores_of(parts), facts={"survey": "a & b"},
    )  # fmt: skip
    page = report_html(report)
    assert "<script" not in page
    assert "a &amp; b" in page
    assert page.count("<img ") == 6
    # Nothing is fetched: pictures are inside, and the page forbids the rest
    assert not re.search(r'(src|href)="(?!data:image/png;base64,)', page)
    assert "default-src 'none'" in page
    assert page == report_html(report)


def test_a_page_without_reference_says_what_was_found(truth, points):
    page = report_html(ReportContent(title="lines", lines=truth, points=points))
    assert page.count("<img ") == 4
    assert "rail-1" in page
    assert "complete" not in page
    bare = report_html(ReportContent(title="lines", lines=truth))
    assert bare.count("<img ") == 1
    nothing = report_html(replace(ReportContent(title="lines", lines=LineSet.empty()), points=points))
    assert nothing.count("<img ") == 2
