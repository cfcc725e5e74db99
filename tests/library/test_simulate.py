"""`simulate` from Python: what the command writes, opened; what cannot be simulated is refused before any work."""

import json

import numpy as np
import pytest

from linework.errors import OutputExistsError, UsageError
from linework.files.vectors.read_write import read_lines
from linework.library.simulate import simulate

SMALL = {"road": "bends", "seed": 2, "length_m": 40, "points_per_m": 800, "images": False}


def test_the_survey_is_that_of_the_command_opened(linework, tmp_path):
    stages = []
    survey = simulate(str(tmp_path / "a"), **SMALL, progress=lambda stage, done, total: stages.append(stage))
    arguments = ("--road", "bends", "--seed", "2", "--length-m", "40", "--points-per-m", "800", "--no-images")
    assert linework("simulate", "-o", tmp_path / "b", *arguments).code == 0
    for path in (*survey.point_files, survey.trajectory_file, survey.root / "truth.gpkg"):
        assert path.read_bytes() == (tmp_path / "b" / path.relative_to(survey.root)).read_bytes(), path
    assert len(read_lines(survey.root / "truth.gpkg")) > 0
    assert dict.fromkeys(stages) == {"simulate scans": None, "write the survey": None}
    with pytest.raises(OutputExistsError, match=r"Choose another folder or give overwrite=True\.$"):
        simulate(tmp_path / "a", **SMALL)
    assert simulate(tmp_path / "a", **SMALL, overwrite=True) == survey


def test_front_wheels_are_counted_and_located_as_rear_ones_are(linework, tmp_path):
    made = simulate(tmp_path / "a", **SMALL, front_wheels=True)
    assert made.settings["vehicle"]["axle"] == "front"
    arguments = ("--road", "bends", "--seed", "2", "--length-m", "40", "--points-per-m", "800", "--no-images")
    assert linework("simulate", "-o", tmp_path / "b", *arguments, "--front-wheels").code == 0
    assert linework("simulate", "-o", tmp_path / "rear", *arguments).code == 0
    same = [name for name in ("gnss.csv", "gyro.csv", "wheels.csv", "survey.toml") if
            (tmp_path / "a" / name).read_bytes() == (tmp_path / "rear" / name).read_bytes()]  # fmt: skip
    assert same == ["gnss.csv", "gyro.csv"]
    assert (tmp_path / "a" / "wheels.csv").read_bytes() == (tmp_path / "b" / "wheels.csv").read_bytes()
    front, rear = (read_wheels(tmp_path / name / "wheels.csv") for name in ("a", "rear"))
    # Bends of 18 to 30 m: 0.5 to 1.4 % farther in front
    assert 1.0005 < front / rear < 1.02


def read_wheels(path):
    """Return the counts of both wheels from the first row to the last."""
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    return np.sum(rows[-1, 1:] - rows[0, 1:])


@pytest.mark.parametrize(
    ("wrong", "line"),
    [
        (
            {"road": "bend"},
            "road: there is no road 'bend'. Did you mean bends? Choose one of straight, bends",
        ),
        (
            {"road": "lunar"},
            "road: there is no road 'lunar'. Choose one of straight, bends, urban, motorway, ",
        ),
        ({"road": None}, "road: there is no road None. Did you mean tunnel? Choose one of"),
        ({"length_m": 5}, "length_m: a road of 5 m cannot be simulated. Choose 40 to 5000 m."),
        ({"length_m": -100.0}, "length_m: a road of -100 m cannot be simulated. Choose 40 to"),
        ({"length_m": float("nan")}, "length_m: a road of nan m cannot be simulated. Choose 40 to"),
        ({"length_m": float("inf")}, "length_m: a road of inf m cannot"),
        ({"length_m": "100"}, "length_m: a road of '100' m cannot"),
        ({"seed": -1}, "seed: the seed is -1. Choose a whole number from 0."),
        ({"seed": 1.5}, "seed: the seed is 1.5. Choose"),
        ({"seed": None}, "seed: the seed is None. Choose"),
        ({"scanner": None}, "scanner: there is no scanner None. Did you mean one? Choose one of"),
        (
            {"conditions": "harsh"},
            "conditions: there are no conditions 'harsh'. Did you mean hard? Choose one of usual, hard.",
        ),
        ({"points_per_m": 0}, "points_per_m: 0 points per metre. Choose more than 0"),
        ({"points_per_m": float("nan")}, "points_per_m: nan points per metre"),
        ({"points_per_m": float("inf")}, "points_per_m: inf points per metre"),
        (
            {"images": True, "image_size": "640x480"},
            "image_size: there are no cameras of '640x480'. Choose one of",
        ),
        ({"images": True, "image_every_m": 0}, "image_every_m: a pair every 0 m. Choose more than 0."),
        ({"images": True, "image_every_m": float("nan")}, "image_every_m: a pair every nan m"),
        ({"images": True, "image_every_m": "3"}, "image_every_m: a pair every '3' m"),
    ],
)
def test_what_cannot_be_simulated_is_refused_with_the_parameter(tmp_path, wrong, line):
    with pytest.raises(UsageError) as caught:
        simulate(tmp_path / "a", **(SMALL | wrong))
    assert str(caught.value).startswith(line)
    assert not (tmp_path / "a").exists()


def test_a_survey_after_a_paper(linework, tmp_path):
    found = linework(
        "simulate", "-o", tmp_path / "a", "--like", "radon-2002", "--length-m", 40, "--no-images", "--json"
    )
    assert found.code == 0, found.stderr
    made = json.loads(found.stdout)
    assert (made["like"], made["road"], made["scanner"]) == ("radon-2002", "motorway", "one")
    same = simulate(
        tmp_path / "b", road="motorway", scanner="one", points_per_m=2400.0, length_m=40.0, images=False
    )
    assert (tmp_path / "a" / "truth.gpkg").read_bytes() == (same.root / "truth.gpkg").read_bytes()
    # What is given stands
    other = simulate(tmp_path / "c", like="radon-2002", road="bends", length_m=40.0, images=False)
    assert "bends" in other.name
    with pytest.raises(UsageError, match=r"unknown paper 'radon-2003'. Did you mean radon-2002\?"):
        simulate(tmp_path / "d", like="radon-2003")
