"""`linework classify` as a user runs it."""

import dataclasses
import json

import laspy
import numpy as np
import pytest

import linework as package
from linework.cli.commands.of_lines.survey_points import LinesAndPoints
from linework.errors import InputError, OutputExistsError, PartialError, UsageError
from linework.evaluation.chainage.paint_points import paint_pieces
from linework.files.vectors.read_write import read_usable_lines
from linework.library.classify import classify_files, classify_points
from linework.methods.classes.point_class import ASPRS_CLASSES, PointClass
from linework.model.grid import holds
from linework.model.lines import LineSet
from linework.scanlines.sampled import gains_of_points
from linework.simulation.folder import write_survey_folder
from linework.simulation.simulate import simulate_survey

NUMBERS = np.array([ASPRS_CLASSES[kind][0] for kind in PointClass])


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    folder = tmp_path_factory.mktemp("classify") / "survey"
    simulated = simulate_survey("urban", 931, 60.0, points_per_m=2500)
    write_survey_folder(simulated, folder)
    return folder, simulated


def test_copies_hold_the_classes_and_the_record_says_what_they_are(linework, survey, tmp_path):
    folder, simulated = survey
    out = tmp_path / "out"
    done = linework(
        "classify", folder, "--lines", folder / "truth.gpkg", "-o", out, "--work", tmp_path / "w", "--json"
    )
    assert done.code == 0, done.stderr
    record = json.loads(done.stdout)
    assert record == json.loads((out / "classes.json").read_text())
    assert {found["name"]: found["number"] for found in record["classes"]}["road"] == 11
    right = total = 0
    for i, copy in enumerate(record["files"]):
        las = laspy.read(out / copy["copy"])
        of_pass = simulated.point_class[simulated.strip == i]
        truth = np.isin(of_pass, (PointClass.ROAD, PointClass.MARKING))
        there = np.isin(las.classification, (11, 65))
        right += np.count_nonzero(truth & there)
        total += np.count_nonzero(truth | there)
        line = np.asarray(las["line_number"])
        kinds = {row["number"]: row["kind"] for row in record["lines"]}
        of_wires = np.unique(line[las.classification == 14])
        assert {kinds[number] for number in of_wires.tolist()} == {"cable"}
    assert right / total > 0.97
    assert sum(found["points"] for found in record["classes"]) == len(simulated.points)
    # The same again gives the same bytes, whoever does it
    again = tmp_path / "again"
    classify_files(folder, folder / "truth.gpkg", again, workers=1)
    for copy in record["files"]:
        assert (again / copy["copy"]).read_bytes() == (out / copy["copy"]).read_bytes()


def test_a_table_of_classes_for_people(linework, survey, tmp_path):
    folder, _ = survey
    done = linework(
        "classify", folder, "--lines", folder / "truth.gpkg", "-o", tmp_path / "out", "--work", tmp_path / "w"
    )
    assert done.code == 0
    assert "road        11" in done.stdout
    assert f"files in {tmp_path / 'out'}" in done.stdout
    assert "classify points" in done.stderr


def test_nothing_is_overwritten_without_being_asked(linework, survey, tmp_path):
    folder, _ = survey
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine.txt").write_text("mine")
    arguments = ("classify", folder, "--lines", folder / "truth.gpkg", "-o", out, "--work", tmp_path / "w")
    assert linework(*arguments).code == OutputExistsError.exit_code
    assert sorted(out.iterdir()) == [out / "mine.txt"]
    assert linework(*arguments, "--overwrite").code == 0
    assert (out / "mine.txt").read_text() == "mine"
    # Copies beside their originals would be read as more files of the survey
    refused = linework("classify", folder, "--lines", folder / "truth.gpkg", "-o", folder, "--overwrite")
    assert refused.code == UsageError.exit_code


def test_a_file_that_cannot_be_copied_is_named_and_the_others_are_written(linework, survey, tmp_path):
    folder, _ = survey
    points = tmp_path / "points"
    points.mkdir()
    first = laspy.read(folder / "points" / "pass_1.laz")
    half = laspy.LasData(first.header, first.points[: len(first.points) // 2])
    half.write(points / "a.laz")
    first.points = first.points[len(first.points) // 2 :]
    first.add_extra_dim(laspy.ExtraBytesParams("line_number", "u4"))
    first.write(points / "b.laz")
    done = linework(
        "classify", points, "--lines", folder / "truth.gpkg", "-o", tmp_path / "out", "--trajectory",
        folder / "trajectory.csv", "--quiet",
    )  # fmt: skip
    assert done.code == PartialError.exit_code
    assert "b.laz: has the dimension line_number already" in done.stderr
    assert (tmp_path / "out" / "a.laz").is_file()
    assert not (tmp_path / "out" / "b.laz").exists()
    (points / "a.laz").unlink()
    done = linework("classify", points, "--lines", folder / "truth.gpkg", "-o", tmp_path / "none", "--quiet")
    assert done.code == InputError.exit_code
    assert not (tmp_path / "none").exists()


def test_lines_that_cannot_be_used(linework, survey, tmp_path):
    folder, _ = survey
    package.write_lines(
        LineSet.empty(package.open_survey(folder).crs), tmp_path / "empty.gpkg", kinds=["cable"]
    )
    done = linework("classify", folder, "--lines", tmp_path / "empty.gpkg", "-o", tmp_path / "out")
    assert done.code == UsageError.exit_code
    assert "empty.gpkg: holds no lines" in done.stderr
    rejected = LineSet.from_lines([[[0, 0, 0], [9, 0, 0]]], kind=["cable"], review=["rejected"])
    package.write_lines(rejected, tmp_path / "rejected.gpkg")
    done = linework("classify", folder, "--lines", tmp_path / "rejected.gpkg", "-o", tmp_path / "out")
    assert "rejected.gpkg: holds no lines" in done.stderr
    other = LineSet.from_lines([[[0, 0, 0], [9, 0, 0]]], kind=["cable"], crs="EPSG:25833")
    package.write_lines(other, tmp_path / "other.gpkg")
    done = linework("classify", folder, "--lines", tmp_path / "other.gpkg", "-o", tmp_path / "out")
    assert done.code == 3
    assert not (tmp_path / "out").exists()


def test_gains_of_lasers_are_taken_out_of_classes_and_of_paint(tmp_path):
    folder = tmp_path / "survey"
    spun = simulate_survey("urban", 932, 40.0, points_per_m=5000, scanner="spinning16")
    write_survey_folder(spun, folder)
    lines = folder / "truth.gpkg"
    classify_files(folder, lines, tmp_path / "out")
    (copy,) = (tmp_path / "out").glob("*.laz")
    found = np.asarray(laspy.read(copy).classification) == 65
    is_paint = spun.point_class == PointClass.MARKING
    evened = gains_of_points(spun.points).without(spun.points)
    with_gains = dataclasses.replace(spun.points, columns={})
    both = [
        classify_points(points, spun.truth, spun.trajectory).classes == PointClass.MARKING
        for points in (with_gains, spun.points)
    ]
    recall = [np.mean(one[is_paint]) for one in both]
    assert recall[1] > recall[0] + 0.1
    assert abs(np.count_nonzero(found) - np.count_nonzero(both[1])) < 0.02 * np.count_nonzero(found)
    # What a report says of paint
    truth = read_usable_lines(lines, crs=spun.truth.crs)[0]
    shown = LinesAndPoints(
        lines=truth, paths=[folder], options=(), crs=None, allow_outside=False, allow_remote=False, work=tmp_path / "w",
        quiet=True,
    ).paint()  # fmt: skip
    wanted, kept = (
        paint_pieces(truth, lambda area, points=points: points.take(holds(area, points.xyz[:, :2]))).on
        for points in (evened, spun.points)
    )
    # Files round places and intensities
    assert np.abs(shown.on - wanted).sum() < 0.2 * np.abs(kept - wanted).sum()
