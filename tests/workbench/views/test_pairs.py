"""Stereo pairs for the page: the list, images as they were taken, lines in them."""

import io
import os
from pathlib import Path

import numpy as np
import PIL.Image
import pytest

from linework.errors import AbsentError, InputError
from linework.files.vectors.read_write import read_lines
from linework.model.lines import LineSet
from linework.workbench.views import pairs
from linework.workbench.worker.order import SurveyOrder
from linework.workbench.worker.session import SurveySession


@pytest.fixture
def session(drive):
    return SurveySession(SurveyOrder((drive,)), lambda _value: None)


def decoded(content):
    with PIL.Image.open(io.BytesIO(content)) as image:
        assert image.format == "JPEG"
        return np.asarray(image)


def image_of(drive, side, name):
    with PIL.Image.open(drive / side / name) as image:
        return np.asarray(image)


def test_the_list(served):
    listed = served.get("/api/pairs")
    assert [pair["number"] for pair in listed] == list(range(7))
    assert listed[0]["left"] == "000000.png"
    chainage = np.array([pair["chainage_m"] for pair in listed])
    assert np.diff(chainage) == pytest.approx(6.0, abs=1.0)
    # The van looks where it drives
    at = np.array([pair["at"] for pair in listed])
    east, north = np.diff(at[:, :2], axis=0).mean(axis=0)
    assert listed[3]["heading_deg"] == pytest.approx(np.degrees(np.arctan2(east, north)) % 360.0, abs=5.0)
    assert served.get("/api/survey")["n_pairs"] == 7


def test_images_are_as_they_were_taken(served):
    for side in ("left", "right"):
        answer = served.client.get(f"/api/pairs/2/{side}")
        assert answer.headers["content-type"] == "image/jpeg"
        assert answer.headers["cache-control"] == "no-store"
        shown, taken = decoded(answer.content), image_of(served.survey, side, "000002.png")
        assert shown.shape == taken.shape
        assert np.abs(shown.astype(float) - taken).mean() < 2.0
    small = decoded(served.client.get("/api/pairs/2/thumbnail").content)
    assert max(small.shape) == 160


@pytest.mark.parametrize("path", [
    "99/left", "99/thumbnail", "99/lines", "2147483647/right",
])  # fmt: skip
def test_pairs_that_are_not_there(served, path):
    answer = served.client.get(f"/api/pairs/{path}")
    assert answer.status_code == 404
    assert answer.json()["problem"].startswith("there is no pair")


@pytest.mark.parametrize("path", [
    "-1/left", "0/top", "0/..%2f..%2fsurvey.toml", "left%2f000000.png/left", "1e3/left", "99999999999999999999/left",
])  # fmt: skip
def test_nothing_but_numbers(served, path):
    answer = served.client.get(f"/api/pairs/{path}")
    assert answer.status_code in (404, 422)
    assert answer.headers["content-type"] == "application/json"


def test_the_lines_of_a_pair(served):
    shown = served.get("/api/pairs/1/lines")
    assert (shown["number"], shown["width"], shown["height"]) == (1, 732, 484)
    there = {line["id"]: line["kind"] for line in served.get("/api/lines")["lines"]}
    for side in ("left", "right"):
        assert {line["kind"] for line in shown[side]} >= {"lane_marking", "road_boundary"}
        for line in shown[side]:
            assert there[line["id"]] == line["kind"]
            assert len(line["runs"]) == len(line["bridged"])
            for run in line["runs"]:
                assert len(run) >= 2
                assert min(col for col, _ in run) > -40
                assert max(col for col, _ in run) < 732 + 40


def test_true_lines_lie_on_the_paint(drive, session):
    """Against the simulated images: the middle of the paint across each projected marking."""
    truth = read_lines(drive / "truth.gpkg")["lane_marking"]
    camera = session.recordings.stereo.series.rig.left
    found = []
    for number in session.recordings.stereo.numbers.tolist():
        grey = image_of(drive, "left", f"{number:06d}.png").astype(float)
        seen = pairs.projected(truth, camera, session.recordings.stereo.poses, number)
        for col, row in seen.pixels[seen.pixels[:, 1] > 0.7 * grey.shape[0]]:
            found += paint_beside(grey, col, row)
    found = np.array(found)
    assert len(found) > 100
    assert abs(np.median(found)) < 0.5
    assert np.median(np.abs(found)) < 1.0


def paint_beside(grey, col, row, half=14):
    """Return how far to the right of a pixel the middle of the paint is that lies there, or nothing."""
    r, c = round(row), round(col)
    if not (0 <= r < grey.shape[0] and half <= c < grey.shape[1] - half):
        return []
    profile = grey[r, c - half : c + half + 1]
    low, high = np.median(profile), profile.max()
    if high - low < 25:
        return []
    bright = np.flatnonzero(profile > 0.5 * (low + high))
    middle = bright[np.argmin(np.abs(bright - half))]
    first = last = middle
    while first - 1 in bright:
        first -= 1
    while last + 1 in bright:
        last += 1
    if abs(middle - half) > 4 or first == 0 or last == 2 * half:
        return []
    cols = np.arange(first - 1, last + 2)
    weight = np.clip(profile[cols] - low, 0.0, None)
    return [float((weight * cols).sum() / weight.sum() - half + c - col)]


def test_lines_far_away_are_not_looked_at():
    at = (1000.0, 2000.0, 5.0)
    lines = LineSet.from_lines([
        np.array([[1100.0, 2000.0, 0.0], [1110.0, 2000.0, 0.0]]),
        np.array([[0.0, 1900.0, 0.0], [9000.0, 2000.0, 0.0]]),   # passes by without a vertex near
        np.array([[1500.0, 2000.0, 0.0], [1510.0, 2000.0, 0.0]]),
        np.array([[1000.0, 2500.0, 0.0], [1000.0, 2600.0, 0.0]]),
    ], id=["near", "long", "east", "north"])  # fmt: skip
    assert pairs.lines_near_camera(lines, at).id.tolist() == ["near", "long"]
    assert len(pairs.lines_near_camera(LineSet.empty(), at)) == 0


def test_images_in_colour_keep_it(drive, session):
    grey = image_of(drive, "left", "000000.png")
    tinted = np.stack([grey, grey // 2, grey // 3], axis=2)
    PIL.Image.fromarray(tinted).save(drive / "left" / "000000.png")
    shown = decoded(pairs.image_jpeg(session, 0, "left")).astype(float)
    assert shown.shape == (*grey.shape, 3)
    assert shown[..., 0].mean() > 1.5 * shown[..., 1].mean()


def test_a_damaged_image_is_one_line(drive, session):
    assert session.recordings.stereo
    path = drive / "left" / "000001.png"
    path.write_bytes(path.read_bytes()[:5000])
    for ask in (lambda: pairs.image_jpeg(session, 1, "left"), lambda: pairs.thumbnail_jpeg(session, 1)):
        with pytest.raises(InputError, match=r"000001\.png") as raised:
            ask()
        assert "\n" not in str(raised.value)
    assert decoded(pairs.image_jpeg(session, 1, "right")).size


def test_what_is_no_image_is_not_handed_out(drive, session):
    assert session.recordings.stereo
    (drive / "left" / "000001.png").write_text("<svg onload='alert(1)'/>")
    with pytest.raises(InputError, match="not an image"):
        pairs.image_jpeg(session, 1, "left")


def test_links_out_of_the_survey_are_refused(drive, session, tmp_path):
    """J08: a link in the image folder that leads elsewhere, or to a pipe; one within the survey is fine."""
    assert session.recordings.stereo
    elsewhere = tmp_path / "elsewhere.png"
    left = drive / "left"
    (left / "000002.png").rename(elsewhere)
    (left / "000002.png").symlink_to(elsewhere)
    (left / "000003.png").rename(drive / "moved.png")
    (left / "000003.png").symlink_to(Path("..") / "moved.png")
    (left / "000004.png").unlink()
    os.mkfifo(left / "000004.png")
    (left / "000005.png").unlink()
    problems = set()
    for number in (2, 4, 5):
        for ask in (pairs.image_jpeg, lambda session, number, _: pairs.thumbnail_jpeg(session, number)):
            with pytest.raises(InputError) as raised:
                ask(session, number, "left")
            problems.add(raised.value.problem)
    assert problems == {"missing, or not a file in the survey's folder"}
    assert decoded(pairs.image_jpeg(session, 3, "left")).size


def test_an_image_folder_that_the_survey_names_elsewhere(drive, tmp_path):
    (drive / "left").rename(tmp_path / "disk")
    listed = (drive / "left.csv").read_text().replace("left/", "../disk/")
    (drive / "left.csv").write_text(listed)
    session = SurveySession(SurveyOrder((drive,), allow_outside=True), lambda _value: None)
    assert decoded(pairs.image_jpeg(session, 0, "left")).size
    # but what lies there may not lead on
    (tmp_path / "disk" / "000000.png").rename(tmp_path / "other.png")
    (tmp_path / "disk" / "000000.png").symlink_to(tmp_path / "other.png")
    with pytest.raises(InputError, match="not a file in the survey's folder"):
        pairs.image_jpeg(session, 0, "left")


def test_pairs_without_a_pose_are_left_out(drive):
    lines = (drive / "left.csv").read_text().splitlines()
    late = [f"{line.rpartition(',')[0]},{float(line.rpartition(',')[2]) + 9000.0}" for line in lines[-2:]]
    for side in ("left", "right"):
        path = drive / f"{side}.csv"
        text = path.read_text().splitlines()
        path.write_text("\n".join([*text[:-2], *(line.replace("left/", f"{side}/") for line in late)]) + "\n")
    session = SurveySession(SurveyOrder((drive,)), lambda _value: None)
    assert [pair["number"] for pair in pairs.list_pairs(session)] == list(range(5))
    with pytest.raises(AbsentError):
        pairs.image_jpeg(session, 6, "left")


def test_keys(drive):
    toml = drive / "survey.toml"
    time_s = float((drive / "left.csv").read_text().splitlines()[3].rpartition(",")[2])
    (drive / "keys.csv").write_text(
        f"time_s,key,note\n{time_s},k,<b>kerb</b> damaged, twice\n1.0,x,long ago\n"
    )
    toml.write_text(toml.read_text() + '\n[events]\nfile = "keys.csv"\n')
    session = SurveySession(SurveyOrder((drive,)), lambda _value: None)
    (key,) = pairs.list_keys(session)
    assert (key["key"], key["note"]) == ("k", "<b>kerb</b> damaged, twice")
    pair = pairs.list_pairs(session)[2]
    assert key["chainage_m"] == pytest.approx(pair["chainage_m"], abs=0.01)
    # A file of keys that is damaged is told where they are asked for, and costs no image
    (drive / "keys.csv").write_text("nothing\n")
    with pytest.raises(InputError, match=r"keys\.csv"):
        pairs.list_keys(session)
    assert len(pairs.list_pairs(session)) == 7


def test_a_survey_without_images(drive):
    session = SurveySession(SurveyOrder((drive / "points",)), lambda _value: None)
    assert pairs.list_pairs(session) == []
    assert pairs.list_keys(session) == []
    with pytest.raises(AbsentError):
        pairs.image_jpeg(session, 0, "left")
