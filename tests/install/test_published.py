"""What is published beside the code: the workflow of public CI, the citation, the Dockerfile, the distribution."""

from __future__ import annotations

import re
import tomllib

import pytest
from tests.scenes.places import ROOT

import linework

yaml = pytest.importorskip("yaml")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
WORKFLOW = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8"))
TARGETS = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))


def commands() -> list[str]:
    """Return the lines that the steps of the workflow run."""
    steps = [step for job in WORKFLOW["jobs"].values() for step in job["steps"]]
    return [line.strip() for step in steps for line in step.get("run", "").splitlines()]


def test_the_workflow_covers_the_systems_and_pythons_that_are_supported():
    for name in ("core", "everything"):
        matrix = WORKFLOW["jobs"][name]["strategy"]["matrix"]
        assert [system.split("-")[0] for system in matrix["system"]] == ["ubuntu", "windows", "macos"]
        stated = [c.rpartition(" ")[2] for c in PROJECT["classifiers"] if re.search(r"Python :: 3\.\d+$", c)]
        assert matrix["python"] == stated
    assert PROJECT["requires-python"] == f">={stated[0]}"


def test_the_workflow_runs_what_exists():
    found = commands()
    assert ".ci/run" in found and (ROOT / ".ci/run").stat().st_mode & 0o111
    for line in found:
        if line.startswith("make "):
            assert line.split()[1] in TARGETS, line
        for path in re.findall(r"\b(?:tests|src|docs)/[\w/.]+", line):
            assert (ROOT / path).exists(), line
        for name in re.findall(r"\.\[(\w+)\]", line):
            assert name in PROJECT["optional-dependencies"], line
    for line in (ROOT / ".ci/run").read_text(encoding="utf-8").splitlines():
        if line.startswith("make "):
            assert line.split()[1] in TARGETS, line


def test_the_citation_is_of_this_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["cff-version"] == "1.2.0"
    assert citation["title"] == PROJECT["name"]
    assert citation["license"] == PROJECT["license"]
    assert citation["version"] == PROJECT["version"] == linework.__version__
    assert [author["name"] for author in citation["authors"]] == [a["name"] for a in PROJECT["authors"]]


def test_the_image_is_built_from_files_that_exist_and_runs_as_a_user():
    lines = (ROOT / "Dockerfile").read_text(encoding="utf-8").splitlines()
    copied = [line.split()[1:-1] for line in lines if line.startswith("COPY ") and "--from" not in line]
    assert copied
    for name in (name for names in copied for name in names):
        assert (ROOT / name).exists(), name
    users = [line.split()[1] for line in lines if line.startswith("USER ")]
    assert users == ["linework"]
    for name in re.findall(r"linework\.(\w+)\(", "\n".join(lines)):
        assert name in linework.__all__, name


def test_pins_hold_no_address():
    for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines():
        assert re.fullmatch(r"[a-z0-9-]+==[\w.+!]+( ; .+)?", line), line
