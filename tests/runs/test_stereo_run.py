"""Time windows of stereo pairs: what a pair shows depends on it alone, and no bad pair stops another."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from tests.conftest import road_points
from tests.scenes.stereo_folders import TOML, make_stereo_folder

from linework.errors import ConfigError, InputError
from linework.files.images.series import open_stereo
from linework.files.las.write import write_las
from linework.files.survey.open import open_survey
from linework.methods.obb.method import Obb
from linework.methods.stereo.method import Stereo
from linework.model.boxes import BoxSet
from linework.model.lines import LineSet
from linework.model.sightings import Sightings
from linework.processes.executors import Serial
from linework.runs import pieces as window_task
from linework.runs.find import find_lines
from linework.runs.opened.recordings import opened_recordings
from linework.runs.resume import run_folder


@dataclass(frozen=True, slots=True)
class Brightness(Stereo):
    """Sees one place per pair, as far ahead as its left image is bright."""

    def look(self, pair):
        assert pair.left.shape == (48, 64)
        ahead = np.array([[float(pair.left.mean()) / 10.0, 0.0, 0.0]])
        return Sightings(xyz=ahead, pair=[pair.number])

    def join(self, seen, survey):
        poses, numbers = survey.poses, survey.pair_numbers
        at = {int(number): i for i, number in enumerate(numbers)}
        xyz = [poses.to_world(at[int(k)], seen.xyz[[row]])[0] for row, k in enumerate(seen.pair)]
        if len(xyz) < 2:
            return LineSet.empty()
        times = poses.time_s[[at[int(k)] for k in seen.pair]]
        return LineSet.from_lines(
            [np.array(xyz)], kind=["lane_marking"], method=["stereo"],
            time_start_s=[times.min()], time_end_s=[times.max()],
        )  # fmt: skip


def found_in(folder, work, executor=None, methods=(Brightness(),), **options):
    survey = open_survey([folder])
    with (
        opened_recordings(survey, work) as recordings,
        run_folder(work, work / "lines", {}, **options) as run,
    ):
        return find_lines(recordings, methods, run, executor=executor or Serial())


@dataclass(frozen=True, slots=True)
class NoBoxes(Obb):
    """Finds nothing in points, or fails in every tile."""

    fails: bool = False

    def look(self, tile):
        if self.fails:
            raise ArithmeticError("no box here")
        return BoxSet.empty()


def add_points(folder):
    """Add flat road to a survey of pairs."""
    write_las(replace(road_points(), time_s=None), folder / "a.laz", crs="EPSG:25832")
    toml = folder / "survey.toml"
    toml.write_text(toml.read_text().replace("[trajectory]", '[points]\nfiles = ["a.laz"]\n[trajectory]', 1))
    return folder


@pytest.fixture
def work(tmp_path):
    for name in ("runs", "stores"):
        (tmp_path / "work" / name).mkdir(parents=True)
    return tmp_path / "work"


def test_pairs_are_placed_by_their_poses(tmp_path, work):
    found = found_in(make_stereo_folder(tmp_path / "survey"), work)
    assert found.kinds == ("lane_marking", "lane_marking_dash")
    assert found.read is None
    assert (found.pairs.n_pairs, found.pairs.n_used, found.failures) == (6, 6, ())
    # Pair k is at 10 k metres east, and grey 60 to 120 is some 9 m ahead
    np.testing.assert_allclose(found.lines.xyz[:, 0], 500_009.0 + 10.0 * np.arange(6), atol=0.3)
    np.testing.assert_allclose(found.lines.xyz[:, 1:], [[5_400_000.0, 100.0]] * 6, atol=1e-6)
    assert found.lines.source.tolist() == ["000000.png to 000005.png"]


@pytest.mark.parametrize("fails", [False, True])
def test_points_that_show_nothing_stop_no_pair(tmp_path, work, fails):
    folder = add_points(make_stereo_folder(tmp_path / "survey"))
    found = found_in(folder, work, methods=(NoBoxes(fails=fails), Brightness()))
    assert found.kinds[-2:] == ("lane_marking_stereo", "lane_marking_dash_stereo")
    assert found.lines.kind.tolist() == ["lane_marking", "lane_marking_stereo"]
    assert (found.pairs.n_used, len(found.tiles)) == (6, 1)
    assert [one.what for one in found.failures] == ["tile"] * fails
    assert all(one.problem.startswith("obb: ArithmeticError: no box here (") for one in found.failures)
    assert all("in look" in one.trace for one in found.failures)


def test_windows_do_not_change_the_lines(tmp_path, work, monkeypatch):
    folder = make_stereo_folder(tmp_path / "survey")
    whole = found_in(folder, work).lines
    monkeypatch.setattr(window_task, "WINDOW_PAIRS", 2)
    parts = found_in(folder, work).lines
    assert whole.xyz.tobytes() == parts.xyz.tobytes()
    assert whole.id.tolist() == parts.id.tolist()


def test_a_pair_that_cannot_be_read_is_named_and_the_rest_is_done(tmp_path, work):
    folder = make_stereo_folder(tmp_path / "survey")
    image = folder / "right" / "000002.png"
    image.write_bytes(image.read_bytes()[:-200])
    found = found_in(folder, work)
    assert len(found.lines.xyz) == 5
    assert found.pairs.n_used == 5
    (failure,) = found.failures
    assert failure.what == "image"
    assert failure.name.endswith("left/000002.png")
    assert "right/000002.png" in failure.problem


def test_pairs_outside_the_trajectory_or_in_its_hole_are_left_out(tmp_path, work):
    times = [-0.9, -0.4, 0.1, 3.1, 3.6, 4.1]
    found = found_in(make_stereo_folder(tmp_path / "survey", pose_times=times), work)
    problems = {failure.name: failure.problem for failure in found.failures}
    assert len(problems) == 4  # 1 to 3 in the hole, 5 after the end
    assert sum("hole of the trajectory (0.10 to 3.10 s)" in text for text in problems.values()) == 3
    assert sum("outside of the trajectory (-0.90 to 4.10 s)" in text for text in problems.values()) == 1
    assert found.pairs.n_used == 2


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"with_attitude": False}, "has no attitude"),
        ({"pose_times": [100.0, 101.0]}, "no image has a pose"),
        ({"toml": TOML.replace('[trajectory]\nfile = "trajectory.csv"\n', "")}, "images but no trajectory"),
    ],
)
def test_without_poses_images_are_refused(tmp_path, work, options, says):
    folder = make_stereo_folder(tmp_path / "survey", **options)
    with pytest.raises(InputError, match=says):
        found_in(folder, work)


def test_a_survey_with_nothing_in_it_is_refused(tmp_path, work):
    (tmp_path / "survey.toml").write_text('name = "nothing"\ncrs = "local"\n')
    with pytest.raises(InputError, match=r"no laser points and no stereo images"):
        found_in(tmp_path, work)


def test_impossible_cameras_are_refused_by_their_key(tmp_path, work):
    swapped = TOML.replace("0.25, 1.6", "X").replace("-X", "0.25, 1.6").replace("X", "-0.25, 1.6")
    with pytest.raises(ConfigError, match="swapped"):
        open_stereo(open_survey([make_stereo_folder(tmp_path / "survey", toml=swapped)]))
