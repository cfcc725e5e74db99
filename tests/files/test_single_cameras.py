"""Cameras without a partner: their images in the photolog, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from tests.scenes.image_folders import camera_toml, stereo_folder, write_images

from linework.errors import ConfigError, InputError
from linework.evaluation.report.photolog import photolog_html
from linework.files.images.series import open_stereo
from linework.files.images.single import no_pairs_message, open_single_cameras
from linework.files.logs.photolog import van_log
from linework.files.survey.open import open_survey
from linework.files.vectors.point_layers import point_layers, read_point_layers
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.lines import LineSet
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory

TENTHS = [round(0.05 + 0.1 * i, 3) for i in range(6)]
VIDEO = '[cameras.video]\nimages = "video.csv"\nposition_m = [0.5, 0.0, 2.5]\n'


def east() -> Trajectory:
    """Return a drive to the east at 10 m/s."""
    time = np.arange(11) / 10.0
    xyz = np.stack([500_000.0 + 10.0 * time, np.full(11, 5_400_000.0), np.full(11, 100.0)], axis=1)
    return Trajectory(time, xyz, np.tile([0.0, 0.0, 90.0], (11, 1)))


def with_video(folder: Path, cameras: str | None = None, video: str = VIDEO) -> Survey:
    """Write a survey of pairs and colour frames between them; `cameras` replaces both tables of the pair."""
    stereo_folder(folder, TENTHS)
    write_images(folder, "video", [0.1, 0.3, 0.5, 9.0], ".jpg")
    for path in (folder / "video").iterdir():
        Image.new("RGB", (64, 48), (200, 60, 20)).save(path)
    text = (folder / "survey.toml").read_text()
    if cameras is not None:
        text = 'name = "one"\ncrs = "local"\n' + cameras
    (folder / "survey.toml").write_text(text + video)
    return open_survey([folder])


def test_frames_stand_between_the_pairs_with_time_and_place(tmp_path: Path) -> None:
    survey = with_video(tmp_path)
    single = open_single_cameras(survey)
    assert survey.has_pairs
    assert no_pairs_message(survey) == ()
    log = van_log(survey, open_stereo(survey), east(), single)
    assert log.photos is not None
    assert log.photos.camera == ("", "video", "", "", "video", "", "", "video", "")
    assert np.all(np.diff(log.photos.places.time_s) > 0.0)
    # 0.5 m ahead of the vehicle's origin and 2.5 m above it
    np.testing.assert_allclose(log.photos.places.xyz[1], [500_001.5, 5_400_000.0, 102.5], atol=1e-6)
    assert log.photos.number[[1, 4, 7]].tolist() == [0, 1, 2]
    assert "1 of 4 images of cameras.video cannot be placed, the first at 9.000 s" in log.warnings[0]


def test_the_layer_names_the_camera_of_each_image(tmp_path: Path) -> None:
    survey = with_video(tmp_path)
    log = van_log(survey, open_stereo(survey), east(), open_single_cameras(survey))
    (layer,) = point_layers(log)
    assert layer.fields["camera"].tolist()[:3] == ["pair", "video", "pair"]
    assert layer.fields["image"].tolist()[:3] == [None, "video/000000.jpg", None]
    assert layer.fields["left"].tolist()[:3] == ["left/000000.png", None, "left/000001.png"]
    assert layer.fields["right"].tolist()[:2] == ["right/000000.png", None]
    # Through both formats
    xyz = np.array([[500_000.0, 5_400_000.0, 100.0], [500_010.0, 5_400_001.0, 100.0]])
    lines = LineSet.from_lines([xyz], kind=["lane_marking"], id=["a"])
    write_lines(lines, tmp_path / "a.gpkg", points=log)
    write_lines(
        read_lines(tmp_path / "a.gpkg"), tmp_path / "b.geojson", points=read_point_layers(tmp_path / "a.gpkg")
    )
    (back,) = read_point_layers(tmp_path / "b.geojson")
    for name, values in layer.fields.items():
        assert back.fields[name].tolist() == values.tolist(), name
    # A log of pairs alone has the columns it had
    (pairs,) = point_layers(van_log(survey, open_stereo(survey), east()))
    assert list(pairs.fields) == ["pair", "left", "right", "time_s", "chainage_m", "heading_deg"]


def test_the_page_shows_the_frames_in_colour(tmp_path: Path) -> None:
    survey = with_video(tmp_path)
    log = van_log(survey, open_stereo(survey), east(), open_single_cameras(survey))
    page = photolog_html(log, tmp_path / "log.html", title="drive", every_m=1.0)
    assert page.n_pictures == 3
    assert "./video/000001.jpg" in page.html
    assert "left/" not in page.html
    assert "6 pairs, 3 of cameras.video, 3 shown, every 1 m" in page.html


@pytest.mark.parametrize("name", ["left", "right", "video"])
def test_one_camera_needs_images_and_no_calibration(tmp_path: Path, name: str) -> None:
    table = f'[cameras.{name}]\nimages = "{name}/*"\nrate_hz = 10\n'
    survey = with_video(tmp_path, table, video="")
    assert not survey.has_pairs
    (camera,) = open_single_cameras(survey)
    assert camera.name == name
    assert camera.time_s.tolist()[:2] == [0.0, 0.1]
    assert camera.position_m.tolist() == [0.0, 0.0, 0.0]
    (said,) = no_pairs_message(survey)
    assert f"no stereo pairs (only {name} in [cameras]), so no lines from images" in said
    photos = van_log(survey, None, east(), (camera,)).photos
    assert photos is not None
    page = photolog_html(van_log(survey, None, east(), (camera,)), tmp_path / "l.html", title="one")
    assert page.n_pictures == 1
    assert set(photos.camera) == {name}


@pytest.mark.parametrize(
    ("video", "error", "words"),
    [
        ("[cameras.video]\nrate_hz = 5\n", ConfigError, "cameras.video.images is missing"),
        ('[cameras.video]\nimages = "video/*.jpg"\n', ConfigError, "cameras.video: images is a pattern without times"),
        ('[cameras.video]\nimages = "film.csv"\n', InputError, "film.csv"),
        ('[cameras.video]\nimages = "video/*.mp4"\nrate_hz = 5\n', InputError, "matches no image"),
        ('[cameras.video]\nimages = "video.csv"\nzoom = 2\n', ConfigError, "unknown key cameras.video.zoom"),
        ("[cameras]\nvideo = 1\n", ConfigError, "cameras.video"),
    ],
)  # fmt: skip
def test_what_is_refused_is_one_line(tmp_path: Path, video: str, error: type[Exception], words: str) -> None:
    survey = with_video(tmp_path, "", video)
    with pytest.raises(error) as caught:
        open_single_cameras(survey)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_frames_that_are_all_missing_and_files_outside(tmp_path: Path) -> None:
    survey = with_video(tmp_path / "s")
    for path in (tmp_path / "s" / "video").iterdir():
        path.unlink()
    with pytest.raises(InputError, match=r"cameras\.video has no image: none of its 4 files exists"):
        open_single_cameras(survey)
    (tmp_path / "s" / "survey.toml").write_text(
        'crs = "local"\n' + camera_toml("video", images="../video.csv")
    )
    with pytest.raises(ConfigError, match=r"cameras\.video\.images: '\.\./video\.csv' is outside"):
        open_survey([tmp_path / "s"])
