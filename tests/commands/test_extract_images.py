"""`extract` on surveys with stereo images: what is wrong is one line, and the rest is done."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pyogrio
import pytest
import shapely
from PIL import Image
from tests.scenes.stereo_folders import TOML, make_stereo_folder


@pytest.fixture
def output(tmp_path: Path) -> Path:
    (tmp_path / "out").mkdir()
    return tmp_path / "out" / "lines.gpkg"


@pytest.fixture
def extracted(linework, output):
    def run(folder: Path, *arguments: object, code: int = 0):
        found = linework("extract", folder, "-o", output, "--quiet", *arguments)
        assert found.code == code, found.stderr
        record = output.with_name("run.json")
        return found, json.loads(record.read_text()) if record.exists() else None

    return run


def grey_tail(path: Path) -> None:
    """Make the image a JPEG that ends half-way: many readers fill the rest with grey."""
    held = io.BytesIO()
    Image.fromarray(np.arange(64 * 48, dtype=np.uint8).reshape(48, 64)).save(held, "JPEG")
    path.write_bytes(held.getvalue()[: len(held.getvalue()) // 2])


def other_size(path: Path) -> None:
    Image.fromarray(np.zeros((40, 64), dtype=np.uint8)).save(path)


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def as_text(path: Path) -> None:
    path.write_text("<html>not found</html>")


def test_images_alone_are_a_survey(extracted, tmp_path):
    found, record = extracted(make_stereo_folder(tmp_path / "survey"))
    assert "nothing found" in found.stderr
    assert record["counts"]["stereo_pairs"] == record["counts"]["stereo_pairs_used"] == 6
    assert record["counts"]["points_used"] == 0
    assert list(record["counts"]["lines"]) == ["lane_marking", "lane_marking_dash"]
    assert sum(entry["file"].endswith(".png") for entry in record["inputs"]) == 12


@pytest.mark.parametrize("harm", [Path.unlink, grey_tail, cut, other_size, as_text])
def test_one_bad_image_is_named_and_the_rest_is_done(extracted, tmp_path, harm):
    folder = make_stereo_folder(tmp_path / "survey")
    harm(folder / "right" / "000003.png")
    found, record = extracted(folder, code=4)
    assert "000003.png" in found.line
    assert "1 of 6 stereo pairs left out" in found.line
    assert record["counts"]["stereo_pairs_used"] == 5
    assert len(record["failures"]) == 1


def test_an_image_missing_from_one_list_is_named(extracted, tmp_path):
    folder = make_stereo_folder(tmp_path / "survey")
    rows = (folder / "right.csv").read_text().splitlines()
    (folder / "right.csv").write_text("\n".join(rows[:3] + rows[4:]) + "\n")
    found, record = extracted(folder, code=4)
    assert "000002.png" in found.line
    assert record["counts"]["stereo_pairs_used"] == 5


@pytest.mark.parametrize(
    ("was", "is_now", "says"),
    [
        ("fx = 60.0", "fx = -60.0", "fx"),
        ("[1.0, -0.25, 1.6]", "[1.0, 0.25, 1.6]", "base"),
        ("[1.0, -0.25, 1.6]", "[1.0, 0.75, 1.6]", "swapped"),
        ("[0.5, -0.5, 0.5, -0.5]", "[0.7, -0.5, 0.5, -0.5]", "quaternion"),
        ("width = 64\n", "", "width"),
        ("height = 48", "height = 0", "height"),
    ],
)
def test_an_impossible_calibration_is_refused_by_its_key(extracted, tmp_path, was, is_now, says):
    folder = make_stereo_folder(tmp_path / "survey")
    text = (folder / "survey.toml").read_text()
    assert was in text
    (folder / "survey.toml").write_text(text.replace(was, is_now))
    found, record = extracted(folder, code=3)
    assert "survey.toml" in found.line
    assert says in found.line
    assert record is None


def test_times_that_do_not_overlap_are_refused(extracted, tmp_path):
    found, _ = extracted(make_stereo_folder(tmp_path / "survey", pose_times=[500.0, 501.0, 502.0]), code=3)
    assert "no image has a pose" in found.line
    assert "500.00 to 502.00" in found.line


def test_a_hole_in_the_trajectory_costs_the_pairs_in_it(extracted, tmp_path):
    folder = make_stereo_folder(
        tmp_path / "survey", pose_times=[-0.5, 0.0, 0.5, 1.0, 3.5, 4.0, 4.5, 5.0, 5.5]
    )
    found, record = extracted(folder, code=4)
    assert "2 of 6 stereo pairs left out" in found.line
    assert "hole of the trajectory (1.00 to 3.50 s)" in found.line
    assert record["counts"]["stereo_pairs_used"] == 4


def test_a_trajectory_without_attitude_is_refused(extracted, tmp_path):
    found, _ = extracted(make_stereo_folder(tmp_path / "survey", with_attitude=False), code=3)
    assert "trajectory.csv: has no attitude" in found.line


def test_jumping_times_are_told(extracted, tmp_path):
    folder = make_stereo_folder(
        tmp_path / "survey", times=[0.0, 0.1, 0.2, 0.3, 4.0, 4.1], pose_times=np.arange(-1, 8, 0.5)
    )
    found, record = extracted(folder)
    assert any("pause" in warning for warning in record["warnings"])
    assert "0.300" in found.stderr


def test_what_only_points_show_cannot_be_asked_of_images(extracted, tmp_path):
    found, _ = extracted(make_stereo_folder(tmp_path / "survey"), "--features", "guardrail", code=2)
    assert "guardrail" in found.line


def test_images_cannot_be_asked_of_points(linework, las_file, output):
    found = linework("extract", las_file, "-o", output, "--method", "stereo")
    assert found.code == 3
    assert "no stereo images" in found.line


def test_points_are_worked_where_the_images_cannot_be(linework, las_file, output, tmp_path):
    toml = TOML.replace('"EPSG:25832"', '"EPSG:25832+7837"') + f'[points]\nfiles = ["{las_file}"]\n'
    folder = make_stereo_folder(tmp_path / "both", with_attitude=False, toml=toml)
    lines = ["time_s,easting_m,northing_m,height_m"]
    lines += [f"{3.0e8 + t},{500000 + 10 * t},5400000,100" for t in (-1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0)]
    (folder / "trajectory.csv").write_text("\n".join(lines) + "\n")
    found = linework("extract", folder, "-o", output, "--quiet", "--allow-outside")
    assert found.code == 4, found.stderr
    assert "1 recording left out: " in found.line
    assert "has no attitude" in found.line
    record = json.loads(output.with_name("run.json").read_text())
    assert record["counts"]["points_used"] == 400


def with_events(folder: Path, text: str) -> Path:
    (folder / "events.csv").write_text(text)
    toml = folder / "survey.toml"
    toml.write_text(toml.read_text() + '[events]\nfile = "events.csv"\n')
    return folder


def test_images_and_keys_are_points_beside_the_lines(extracted, output, tmp_path):
    folder = make_stereo_folder(tmp_path / "survey")
    _, record = extracted(with_events(folder, "time_s,key,note\n2.5,sign,speed limit\n4.0,tree,\n"))
    assert (record["counts"]["photolog"], record["counts"]["events"]) == (6, 2)
    layers = dict(pyogrio.list_layers(output).tolist())
    assert layers["photolog"] == layers["event"] == "Point Z"
    meta, _, shapes, values = pyogrio.raw.read(output, layer="event")
    rows = dict(zip(meta["fields"], values, strict=True))
    assert rows["key"].tolist() == ["sign", "tree"]
    places = shapely.get_coordinates(shapely.from_wkb(shapes))
    np.testing.assert_allclose(places[:, 0], [500_025.0, 500_040.0], atol=1e-6)


def test_keys_that_cannot_be_read_stop_nothing_else(extracted, tmp_path):
    folder = make_stereo_folder(tmp_path / "survey")
    found, record = extracted(with_events(folder, "when,what\n1,2\n"), code=4)
    assert "events.csv" in found.line
    assert record["counts"]["stereo_pairs_used"] == 6


def test_images_are_worked_where_the_points_cannot_be(extracted, las_file, tmp_path):
    toml = TOML.replace('"EPSG:25832"', '"EPSG:25832+7837"') + f'[points]\nfiles = ["{las_file}"]\n'
    folder = make_stereo_folder(tmp_path / "both", toml=toml)
    las_file.write_bytes(las_file.read_bytes()[:200])
    found, record = extracted(folder, "--allow-outside", code=4)
    assert "1 recording left out: " in found.line
    assert "a.laz" in found.line
    assert record["counts"]["stereo_pairs_used"] == 6


def test_images_of_which_none_can_be_used_write_nothing(extracted, output, tmp_path):
    folder = make_stereo_folder(tmp_path / "survey")
    for image in (folder / "right").iterdir():
        cut(image)
    found, record = extracted(folder, code=3)
    assert "none of 6 stereo pairs can be used" in found.line
    assert record is None
    assert not output.exists()


def test_a_run_is_not_resumed_with_other_times(extracted, linework, output, tmp_path):
    folder = make_stereo_folder(tmp_path / "survey")
    extracted(folder)
    text = (folder / "left.csv").read_text()
    (folder / "left.csv").write_text(text.replace(",1.000", ",1.100"))
    found = linework("extract", folder, "-o", output, "--quiet", "--resume")
    assert found.code == 6, found.stderr  # another run than the one that made the output
