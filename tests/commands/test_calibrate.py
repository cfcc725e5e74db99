"""`linework calibrate` and `extract --calibrate` on images of a road of noise that end at a wall."""

import json
import pickle
import shutil
import tomllib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.scenes.road_views import views_folder
from tests.scenes.stereo_folders import make_stereo_folder

import linework
from linework.files.survey.calibration import cameras_text, read_cameras
from linework.files.survey.open import open_survey
from linework.runs.cameras import calibrate
from linework.runs.extract import extraction_request
from linework.runs.settings import RunSettings

#: The right camera as it is given looks to the right by this. [deg]
YAW_DEG = 0.3


@pytest.fixture(scope="module")
def views(tmp_path_factory):
    """Return a survey of six windows, and one whose right camera is given wrongly."""
    right = views_folder(tmp_path_factory.mktemp("calibrate") / "views", n=37, grain_m=(0.3, 0.4))
    wrong = right.parent / "wrong"
    shutil.copytree(right, wrong)
    survey = open_survey(right)
    cameras = {side: dict(survey.settings["cameras"][side]) for side in ("left", "right")}
    table = cameras["right"]
    w, x, y, z = table["rotation_wxyz"]
    error = Rotation.from_rotvec(np.radians([0.0, YAW_DEG, 0.0]))
    x, y, z, w = (Rotation.from_quat([x, y, z, w]) * error).as_quat().tolist()
    table["rotation_wxyz"] = [w, x, y, z]
    text = (right / "survey.toml").read_text()
    (wrong / "survey.toml").write_text(text.split("[cameras.left]")[0] + cameras_text(cameras))
    return right, wrong


@pytest.fixture(scope="module", autouse=True)
def looked_at_once():
    """Follow the corners of a survey and adjust them once: to the same images and cameras the answer is the same."""
    known, real = {}, (calibrate.followed, calibrate.calibrated_by_corners)

    def followed(stereo, advance):
        key = pickle.dumps((stereo.survey.root, stereo.series.rig))
        if key not in known:
            known[key] = real[0](stereo, advance)
        return known[key]

    def adjusted(rig, windows, *, progress):
        key = pickle.dumps((rig, windows))
        if key not in known:
            known[key] = real[1](rig, windows, progress=progress)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(calibrate, "followed", followed)
        patch.setattr(calibrate, "calibrated_by_corners", adjusted)
        yield


def test_a_turned_camera_is_found_and_the_file_takes_its_place(linework, views, tmp_path):
    output = tmp_path / "calibration.toml"
    done = linework("calibrate", views[1], "-o", output, "--work", tmp_path / "work", "--json", "--quiet")
    assert done.code == 0, done.stderr
    document = json.loads(done.stdout)
    by_name = {p["name"]: p for p in document["parameters"]}
    found = by_name["relative_yaw"]
    assert found["supported"] and found["reason"].endswith("windows left out improve")
    assert found["before"] == pytest.approx(YAW_DEG, abs=1e-6)
    assert abs(found["after"]) < min(3.0 * found["sigma"], 0.1 * YAW_DEG)
    assert not by_name["time_offset"]["supported"]
    assert by_name["time_offset"]["reason"].startswith("not determined: needs changes of speed")
    assert document["residual_after_px"] < document["residual_before_px"]
    tables = read_cameras(output)
    assert tables == document["cameras"]
    # The file says why, and its tables can stand in the survey.toml
    text = output.read_text()
    assert "# relative_yaw" in text and " yes " in text
    own = tmp_path / "own"
    shutil.copytree(views[1], own)
    before = (own / "survey.toml").read_text().split("[cameras.left]")[0]
    (own / "survey.toml").write_text(before + text)
    assert dict(open_survey(own).settings["cameras"]) == tables
    again = linework("calibrate", views[1], "-o", output, "--work", tmp_path / "work", "--quiet")
    assert again.code == 6
    assert output.read_text() == text


def test_a_right_calibration_is_written_as_it_was(linework, views, tmp_path):
    output = tmp_path / "calibration.toml"
    done = linework("calibrate", views[0], "-o", output, "--work", tmp_path / "work", "--quiet")
    assert done.code == 0, done.stderr
    given = open_survey(views[0]).settings["cameras"]
    assert read_cameras(output) == {side: given[side] for side in ("left", "right")}
    assert " yes " not in done.stdout
    assert "boresight_yaw" in done.stdout and "the given value agrees" in done.stdout


def test_extract_says_and_records_what_it_used(linework, views, tmp_path):
    output = tmp_path / "lines.gpkg"
    done = linework(
        "extract", views[1], "-o", output, "--calibrate", "--work", tmp_path / "work", "--workers", "1", "--quiet",
        "--features", "lane_marking",
    )  # fmt: skip
    assert done.code == 0, done.stderr
    row = next(line for line in done.stdout.splitlines() if line.startswith("relative_yaw"))
    assert " yes " in row
    parameters = json.loads((tmp_path / "run.json").read_text())["parameters"]
    used = {p["name"] for p in parameters["calibration"]["parameters"] if p["supported"]}
    assert "relative_yaw" in used
    # The record's cameras are those that the lines were found with
    assert parameters["cameras"]["left"] == parameters["calibration"]["cameras"]["left"]
    assert parameters["cameras"]["right"] != open_survey(views[1]).settings["cameras"]["right"]


def test_texts_of_a_calibration_are_read_back_whatever_they_hold():
    images = 'a\tb\x01\x7f\\"\u00e9.csv'
    assert tomllib.loads(cameras_text({"left": {"images": images}}))["cameras"]["left"]["images"] == images


def test_runs_that_are_resumed_are_not_compared_by_how_cameras_were_calibrated(views, tmp_path):
    survey, document = open_survey(views[0]), {"sigma_px": 0.1}
    order = extraction_request(
        tmp_path / "a.gpkg", survey, ("lane_marking",), "auto", RunSettings(), calibration=document
    )
    assert "calibration" not in order.parameters
    assert order.calibration == document


def test_in_python_the_calibrated_survey_can_be_extracted(views):
    given = linework.open_survey(views[1])
    found = linework.calibrate(given)
    assert "relative_yaw" in {v.name for v in found.supported}
    assert "relative_yaw" in repr(found)
    assert found.survey.settings["cameras"]["left"] == found.cameras["left"]
    assert given.settings["cameras"]["right"] != found.cameras["right"]


def test_what_cannot_be_calibrated_is_one_line(linework, views, tmp_path):
    output = tmp_path / "calibration.toml"
    noise = make_stereo_folder(tmp_path / "noise", n_pairs=6)
    one = tmp_path / "one"
    shutil.copytree(views[0], one)
    text = (one / "survey.toml").read_text()
    (one / "survey.toml").write_text(text.split("[cameras.right]")[0])
    still = tmp_path / "still"
    shutil.copytree(views[0], still)
    head, *rows = (still / "trajectory.csv").read_text().splitlines()
    rows = [",".join([row.split(",")[0], "500000", *row.split(",")[2:]]) for row in rows]
    (still / "trajectory.csv").write_text("\n".join([head, *rows]) + "\n")
    few = tmp_path / "few"
    shutil.copytree(views[0], few)
    for side in ("left", "right"):
        listed = (few / f"{side}.csv").read_text().splitlines()
        (few / f"{side}.csv").write_text("\n".join(listed[:13]) + "\n")
    for folder, words in (
        (one, "one camera ([cameras.left])"), (still, "no 6 pairs in a row"), (noise, "no 6 pairs in a row"),
        (few, "windows of pairs, at least"),
    ):  # fmt: skip
        done = linework("calibrate", folder, "-o", output, "--work", tmp_path / "work", "--quiet")
        assert done.code == 3
        assert words in done.line
        assert not output.exists()
    assert linework("calibrate", views[0], "-o", tmp_path / "a.txt").code == 2
    own = linework("calibrate", one, "-o", one / "survey.toml", "--overwrite")
    assert own.code == 2
    assert "would replace the description of the survey" in own.line


def test_an_offset_of_the_clock_moves_the_times_of_images(views, tmp_path):
    from linework.files.images.series import open_stereo

    later = tmp_path / "later"
    shutil.copytree(views[0], later)
    text = (later / "survey.toml").read_text()
    (later / "survey.toml").write_text(text.replace("width =", "time_offset_s = 0.25\nwidth ="))
    before, after = (open_stereo(open_survey(folder)) for folder in (views[0], later))
    moved = [b.time_s - a.time_s for a, b in zip(before.pairs, after.pairs, strict=True)]
    assert np.allclose(moved, 0.25)
