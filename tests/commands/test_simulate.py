"""`linework simulate`: the folder it makes, and what it refuses."""

from __future__ import annotations

import json

import pytest

SMALL = ("--length-m", "40", "--points-per-m", "800", "--no-images")


def test_the_folder_is_a_survey_with_truth_and_the_same_bytes_again(linework, tmp_path):
    made = linework("simulate", "-o", tmp_path / "a", "--seed", "2", "--road", "bends", *SMALL, "--json")
    assert made.code == 0, made.stderr
    told = json.loads(made.stdout)
    assert told["n_points"] > 10_000
    assert told["n_truth_lines"]["guardrail"] >= 1
    assert linework("simulate", "-o", tmp_path / "b", "--seed", "2", "--road", "bends", *SMALL).code == 0
    files = {
        p.relative_to(tmp_path / "a"): p.read_bytes() for p in (tmp_path / "a").rglob("*") if p.is_file()
    }
    assert {str(p) for p in files} >= {"survey.toml", "truth.gpkg", "trajectory.csv", "points/pass_1.laz"}
    for name, content in files.items():
        assert (tmp_path / "b" / name).read_bytes() == content, name
    info = linework("info", tmp_path / "a", "--json", "--quiet")
    assert info.code == 0, info.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "b"]  # no part folder is left


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (("--road", "lunar"), 2, "choose one of straight, bends, urban, motorway"),
        (("--length-m", "5"), 2, "a road of 5 m cannot be simulated"),
        (("--seed", "-1"), 2, "the seed is -1"),
        (("--points-per-m", "0"), 2, "0 points per metre"),
        (("--scanner", "spinning8"), 2, "there is no scanner 'spinning8'. did you mean spinning"),
        (("--conditions", "harsh"), 2, "choose one of usual, hard"),
    ],
)
def test_what_cannot_be_simulated_is_refused_in_one_line(linework, tmp_path, options, code, words):
    refused = linework("simulate", "-o", tmp_path / "a", *options)
    assert refused.code == code
    assert words in refused.stderr.lower()
    assert refused.stderr.count("\n") == 1
    assert not (tmp_path / "a").exists()


def test_a_folder_with_content_is_left_alone(linework, tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "mine.txt").write_text("mine")
    refused = linework("simulate", "-o", tmp_path / "a", *SMALL)
    assert refused.code == 6
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["mine.txt"]
    again = linework("simulate", "-o", tmp_path / "a", *SMALL, "--overwrite")
    assert again.code == 0, again.stderr
    assert (tmp_path / "a" / "mine.txt").read_text() == "mine"
    assert (tmp_path / "a" / "truth.gpkg").exists()


def test_stereo_images_are_taken_along_the_way(linework, tmp_path):
    made = linework(
        "simulate", "-o", tmp_path / "a", "--length-m", "40", "--points-per-m", "300", "--json",
        "--image-size", "732x484", "--image-every-m", "40",
    )  # fmt: skip
    assert made.code == 0, made.stderr
    assert json.loads(made.stdout)["n_pairs"] == 1
    assert "render images" in made.stderr
    files = sorted(str(p.relative_to(tmp_path / "a")) for p in (tmp_path / "a").rglob("*.png"))
    assert files == ["left/000000.png", "right/000000.png"]
    assert "[cameras.right]" in (tmp_path / "a" / "survey.toml").read_text()
    assert (tmp_path / "a" / "truth_images.gpkg").exists()


def test_cameras_that_there_are_not_are_refused(linework, tmp_path):
    refused = linework("simulate", "-o", tmp_path / "a", "--image-size", "640x480")
    assert refused.code == 2
    assert "choose one of 732x484, 1240x376" in refused.stderr.lower()
    assert not (tmp_path / "a").exists()
