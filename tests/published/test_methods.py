"""The published methods over whole surveys: reached by name, cut into tiles, set from outside; ours do without them."""

from __future__ import annotations

import ast
import json
from pathlib import Path

import numpy as np
import pytest

import linework as lw
from linework.errors import InputError, UsageError
from linework.files.las.write import write_las
from linework.files.trajectories.read import write_trajectory
from linework.library.extract import methods_asked
from linework.methods.kinds import KINDS_OF, PUBLISHED_KINDS_OF
from linework.published.stereo_1992 import Stereo1992Config
from linework.runs.settings import RunSettings
from linework.simulation.simulate import simulate_survey

SOURCE = Path(lw.__file__).parent


@pytest.fixture(scope="module")
def simulated():
    return simulate_survey("straight", 7, 80.0, points_per_m=4000)


@pytest.fixture(scope="module")
def survey(simulated, tmp_path_factory):
    folder = tmp_path_factory.mktemp("published") / "survey"
    write_las(simulated.points, folder / "points.laz", crs=simulated.crs)
    write_trajectory(simulated.trajectory, folder / "trajectory.csv")
    (folder / "survey.toml").write_text(
        'name = "road"\n[points]\nfiles = ["*.laz"]\n[trajectory]\nfile = "trajectory.csv"\n'
    )
    return folder


def test_nothing_of_ours_imports_them():
    own = [
        path
        for room in ("methods", "surface", "kernels", "imaging")
        for path in (SOURCE / room).rglob("*.py")
    ]
    assert len(own) > 50
    for path in own:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import | ast.ImportFrom):
                assert "linework.published" not in ast.unparse(node), path
                names = [alias.name for alias in node.names]
                assert getattr(node, "module", "") != "linework" or "published" not in names, path


def test_auto_and_all_do_not_take_them():
    names = {method.name for method in methods_asked("auto", None, RunSettings())}
    assert names == set(KINDS_OF)
    assert {method.name for method in methods_asked(None, None, RunSettings())} == set(KINDS_OF)


@pytest.mark.parametrize("name", sorted(PUBLISHED_KINDS_OF))
def test_each_is_reached_by_its_name(name):
    (method,) = methods_asked(name, None, RunSettings())
    assert (method.name, method.kinds) == (name, PUBLISHED_KINDS_OF[name])


def test_guardrails_as_published_are_the_same_in_any_tiles(linework, simulated, survey, tmp_path):
    whole = lw.extract(survey, methods="radon-2002")
    score = lw.evaluate(whole, simulated.truth.with_columns(crs=whole.crs), kinds=["guardrail"])[
        "guardrail"
    ].at
    assert score.completeness > 0.9
    assert score.lateral.rmse_m < 0.02
    assert set(whole.method.tolist()) == {"radon-2002"}
    output = tmp_path / "lines.gpkg"
    small = (
        "--set",
        "tiling.max_points=10000",
        "--set",
        "tiling.core_m=64",
        "--set",
        "tiling.least_core_m=16",
    )
    found = linework("extract", survey, "-o", output, "--method", "radon-2002", *small, "--json", "--quiet")
    assert json.loads(found.stdout)["counts"]["tiles"] > 3
    tiles = lw.read_lines(output)
    assert [line.xyz.tolist() for line in tiles] == [line.xyz.tolist() for line in whole]


def test_markings_as_published_are_found_where_they_are_asked_for(simulated, survey):
    lines = lw.extract(survey, methods="obb-2023", kinds="lane_marking")
    assert lines.kinds == ("lane_marking",)
    truth = simulated.truth.with_columns(crs=lines.crs)
    assert lw.evaluate(lines, truth, kinds=["lane_marking"])["lane_marking"].at.completeness > 0.5


def test_settings_of_stereo_reach_it():
    (method,) = methods_asked("stereo-1992", None, RunSettings(stereo_1992=Stereo1992Config(least_px=40)))
    assert method.config.least_px == 40


def test_settings_reach_them(survey):
    few = lw.extract(survey, methods="radon-2002", settings={"radon_2002": {"threshold_m": 400.0}})
    assert len(few) == 0


def test_kinds_that_they_do_not_find_are_refused(survey):
    with pytest.raises(UsageError, match="no method finds cable"):
        lw.extract(survey, methods="radon-2002", kinds="cable")


def test_the_command_takes_their_names_and_single_settings(linework, survey, tmp_path):
    output = tmp_path / "lines.gpkg"
    found = linework(
        "extract",
        survey,
        "-o",
        output,
        "--method",
        "radon-2002",
        "--set",
        "radon_2002.threshold_m=400",
        "--json",
        "--quiet",
    )
    assert found.code == 0, found.stderr
    record = json.loads(found.stdout)
    assert record["parameters"]["method"] == "radon-2002"
    assert record["parameters"]["settings"]["radon_2002"]["threshold_m"] == 400.0
    assert record["counts"]["lines"] == {"guardrail": 0}


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--set", "radon_2002.cel_m=1"), "--set: unknown key radon_2002.cel_m. Did you mean cell_m?"),
        (("--set", "radon_2002.cell_m=wide"), "--set: radon_2002.cell_m is 'wide', expected a number"),
        (("--set", "radon_2002.cell_m"), "is not a setting and its value"),
        (("--set", "=1"), "is not a setting and its value"),
        (("--method", "radon-2003"), "unknown method radon-2003. Did you mean radon-2002?"),
        (("--method", "obb-2023", "--features", "cable"), "method obb-2023 does not find cable"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(linework, survey, tmp_path, options, says):
    found = linework("extract", survey, "-o", tmp_path / "lines.gpkg", *options)
    assert found.code == 2
    assert says in found.line
    assert not (tmp_path / "lines.gpkg").exists()


def middle_of(truth, kind):
    """A place on a line that is visible all along."""
    line = truth[kind][2].xyz
    return line[len(line) // 2, :2]


def test_a_picked_kerb_is_followed_as_published():
    street = simulate_survey("urban", 7, 80.0, points_per_m=9000)
    points = lw.Points(street.points.xyz, intensity=street.points.intensity, crs=street.crs)
    lengths = []
    for kerb in street.truth["road_boundary"]:
        for share in (0.3, 0.5, 0.7):
            place = kerb.xyz[int(share * len(kerb.xyz)), :2]
            try:
                line = lw.trace(points, place, kind="road_boundary", method="obb-2023")
            except InputError:  # behind a parked car
                continue
            truth = street.truth.with_columns(crs=line.crs)
            at = lw.evaluate(line, truth, kinds=["road_boundary"])["road_boundary"].at
            lengths.append(at.matched_extracted_m)
    assert max(lengths) > 10.0


@pytest.mark.parametrize("kind", ["lane_marking"])
def test_a_picked_line_is_followed_as_published(simulated, survey, kind):
    place = middle_of(simulated.truth, kind)
    line = lw.trace(survey, place, kind=kind, method="obb-2023")
    assert line.method.tolist() == ["obb-2023"]
    assert float(line.length_m[0]) > 15.0
    score = lw.evaluate(line, simulated.truth.with_columns(crs=line.crs), kinds=[kind])[kind].at
    assert score.correctness > 0.9
    shorter = lw.trace(
        survey, place, kind=kind, method="obb-2023", toward=simulated.truth[kind][2].xyz[0, :2]
    )
    assert 0.2 < float(shorter.length_m[0] / line.length_m[0]) < 0.8


def test_a_search_area_is_explained_before_the_pick_is_refused(linework, simulated, survey, tmp_path):
    east, north = middle_of(simulated.truth, "lane_marking")
    found = linework(
        "trace", survey, "--at", f"{east},{north}", "-o", tmp_path / "line.gpkg", "--method", "obb-2023",
        "--intensity", "1e8,2e8", "--feature", "lane_marking", "--explain", "--quiet",
    )  # fmt: skip
    assert found.code == 3
    assert "the marking's intensities are not in the range 1e+08 to 2e+08" in found.line  # figure 8c
    assert "proposed range of paint: " in found.stdout
    assert "with upright normals" in found.stdout
    low, high = found.stdout.split("proposed range of paint: ")[1].split()[0].split(",")
    found = linework(
        "trace", survey, "--at", f"{east},{north}", "-o", tmp_path / "line.gpkg", "--method", "obb-2023",
        "--intensity", f"{low},{high}", "--feature", "lane_marking", "--json", "--quiet",
    )  # fmt: skip
    assert found.code == 0, found.stderr
    assert json.loads(found.stdout)["length_m"] > 5.0


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--method", "obb"), "--method: lines are not traced by obb. Choose from auto, obb-2023"),
        (("--radius", "1"), "are settings of obb-2023"),
        (("--method", "obb-2023", "--intensity", "9,3"), "--intensity: '9,3' is not a range"),
        (
            ("--method", "obb-2023", "--search-length", "0"),
            "obb_2023.search_length_m is 0.0, expected a number",
        ),
        (("--method", "obb-2023", "--feature", "cable"), "--feature: obb-2023 does not find cable"),
    ],
)
def test_wrong_picks_are_refused(linework, simulated, survey, tmp_path, options, says):
    east, north = middle_of(simulated.truth, "lane_marking")
    found = linework("trace", survey, "--at", f"{east},{north}", "-o", tmp_path / "line.gpkg", *options)
    assert found.code == 2
    assert says in found.line
    assert not (tmp_path / "line.gpkg").exists()


def test_a_pixel_is_not_picked_as_published(linework, survey, tmp_path):
    found = linework(
        "trace",
        survey,
        "--image",
        "left/1.png",
        "--at-px",
        "1,2",
        "-o",
        tmp_path / "line.gpkg",
        "--method",
        "obb-2023",
    )
    assert found.code == 2
    assert "--method: only valid with --at" in found.line


def test_lines_of_a_survey_without_points_in_reach_are_refused(linework, simulated, survey, tmp_path):
    east, north, _ = simulated.truth.xyz.min(axis=0) - 500.0
    found = linework(
        "trace", survey, "--at", f"{east},{north}", "-o", tmp_path / "line.gpkg", "--method", "obb-2023"
    )
    assert found.code == 3
    assert "no points in the search area" in found.line
    assert "no marking" not in found.line


def test_stereo_lines_as_published_are_in_the_world():
    from linework.methods.protocol import SurveyContext
    from linework.model.images import Poses
    from linework.model.sightings import Sightings
    from linework.published.methods import Stereo1992

    seen = Sightings(
        xyz=np.array([[6.0, 1.0, -2.0], [20.0, 1.0, -2.0], [6.0, -1.0, -2.0], [20.0, -1.0, -2.0]]),
        pair=np.array([4, 4, 5, 5]), line=np.array([0, 0, 0, 0]), score=np.array([0.9, 0.9, 0.3, 0.3]),
    )  # fmt: skip
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    poses = Poses(
        time_s=np.zeros(2), xyz=np.array([[100.0, 0.0, 2.0], [200.0, 0.0, 2.0]]), R_world_vehicle=np.stack([turn, turn]),
        sigma_xyz_m=np.zeros((2, 3)), sigma_attitude_rad=np.zeros((2, 3)),
    )  # fmt: skip
    lines = Stereo1992().join(seen, SurveyContext(poses=poses, pair_numbers=np.array([4, 5])))
    assert lines[0].xyz.tolist() == [[99.0, 6.0, 0.0], [99.0, 20.0, 0.0]]
    assert lines[1].xyz.tolist() == [[201.0, 6.0, 0.0], [201.0, 20.0, 0.0]]
    assert lines.pattern.tolist() == ["solid", "dashed"]
