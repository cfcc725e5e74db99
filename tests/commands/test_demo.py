"""`linework demo`: the whole job as a newcomer runs it first."""

import json
import re

import pytest

from linework.cli.app import main


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A finished demo."""
    path = tmp_path_factory.mktemp("demo") / "here"
    assert main(["demo", str(path), "--quiet"]) == 0
    return path


def test_everything_is_there(folder):
    assert sorted(p.name for p in folder.iterdir()) == ["lines.gpkg", "report.html", "run.json", "survey"]
    held = {p.name for p in (folder / "survey").iterdir()}
    logs = {"gnss.csv", "gyro.csv", "wheels.csv"}
    assert held == {".linework", "points", "survey.toml", "trajectory.csv", "truth.gpkg", *logs}
    counts = json.loads((folder / "run.json").read_text())["counts"]
    assert 300_000 < counts["points_used"] < 1_500_000
    assert counts["lines"]["guardrail"] > 0
    assert counts["lines"]["cable"] > 0


def test_the_report_is_a_page_of_its_own(folder):
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.count("<img ") == 8
    for title in (
        "Close-ups",
        "Across the road boundary",
        "Across markings",
        "Across a guardrail",
        "Along a cable span",
        "Found, missed and wrong",
        "Scores by tolerance",
    ):
        assert f"<h2>{title}" in page
    assert not re.search(r'(src|href)="(?!data:image/png;base64,)', page)


def test_the_lines_are_good(folder, linework):
    said = linework("evaluate", folder / "lines.gpkg", folder / "survey" / "truth.gpkg", "--json")
    assert said.code == 0
    for kind in json.loads(said.stdout)["kinds"]:
        if kind["kind"] in ("guardrail", "cable"):
            assert kind["at"]["completeness"] > 0.9
            assert kind["at"]["correctness"] > 0.9


def test_a_folder_in_use_is_not_touched(folder, linework):
    before = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    said = linework("demo", folder)
    assert said.code == 6
    assert "--overwrite" in said.line
    assert {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()} == before


def test_seeds_count_from_zero(tmp_path, linework):
    said = linework("demo", tmp_path / "new", "--seed", "-1")
    assert said.code == 2
    assert "seed" in said.line
    assert not (tmp_path / "new").exists()
