"""The command `linework serve` as a user runs it."""

from __future__ import annotations


def test_serves_the_survey(served):
    survey = served.get("/api/survey")
    assert survey["n_points"] > 10_000
    assert survey["n_pairs"] == 7
    assert survey["lines_file"] == "lines.gpkg"
    lines = served.get("/api/lines")
    assert {line["kind"] for line in lines["lines"]} >= {"lane_marking", "road_boundary"}


def test_page(page):
    assert page.title()
