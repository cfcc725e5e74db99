"""The main job with a method of our own: what it is given, what becomes of what it returns."""

import dataclasses
import json
import re

import numpy as np
import pytest
from tests.conftest import CRS, road_points
from tests.scenes.opened import of_points

from linework.errors import InputError, MachineError, OwnCodeError, PartialError
from linework.files.las.write import write_las
from linework.files.survey.open import open_survey
from linework.files.trajectories.read import write_trajectory
from linework.files.vectors.read_write import read_lines
from linework.model.lines import LineSet
from linework.model.trajectory import Trajectory
from linework.runs import outputs
from linework.runs.extraction import with_sources
from linework.runs.find import find_lines
from linework.runs.opened.points import opened_survey
from linework.runs.opened.work_folder import work_folder
from linework.runs.resume import run_folder
from linework.runs.settings import RunSettings, TilingConfig
from linework.runs.steps import RunSteps

#: So many tiles that the 40 m of road lie in at least two.
SMALL = RunSettings(tiling=TilingConfig(core_m=64.0, shift_east_m=20.0, max_points=10_000))


class Diagonal:
    """Finds one guardrail: the diagonal of its tile's points; keeps what it was given."""

    name = "diagonal"
    kinds = ("cable", "guardrail")
    buffer_m = 5.0
    least_height_m = -np.inf
    recording = "points"
    evidence = LineSet

    def __init__(self):
        self.tiles = []

    def look(self, tile):
        self.tiles.append(tile)
        xyz = tile.points.xyz
        line = np.array([xyz.min(axis=0), xyz.max(axis=0)])
        return LineSet.from_lines([line], kind=["guardrail"], method=[self.name], source=[tile.source])

    def join(self, found, survey):
        assert survey.cores
        return found


class Fails(Diagonal):
    """Fails in every tile whose core begins west of the road's middle."""

    def look(self, tile):
        if tile.core.west < 500_020.0:
            raise ArithmeticError("no line here")
        return super().look(tile)


@pytest.fixture
def method():
    return Diagonal()


@pytest.fixture
def extracted(tmp_path):
    """Extract with one method; the work folder is kept from one call to the next."""

    def run_it(path, method, **settings):
        survey, work = open_survey([path]), work_folder(tmp_path, tmp_path / "work")
        with (
            opened_survey(survey, work, steps=settings.get("steps")) as opened,
            run_folder(work, tmp_path / "lines.gpkg", {}) as folder,
        ):
            return find_lines(of_points(opened), [method], folder, **settings)

    return run_it


def spread_points():
    """Return 12,000 points along 140 m of road: more than one small tile may hold."""
    parts = [road_points(4000, east_m=500_000.0 + 50 * i, seed=i) for i in range(3)]
    xyz = np.concatenate([part.xyz for part in parts])
    return dataclasses.replace(parts[0], xyz=xyz, intensity=None, time_s=None)


@pytest.fixture
def long_file(tmp_path):
    path = tmp_path / "survey" / "long.laz"
    write_las(spread_points(), path, crs=CRS)
    return path


def test_a_method_gets_all_points_and_its_lines_come_back_in_the_survey_crs(las_file, method, extracted):
    found = extracted(las_file, method)
    (tile,) = method.tiles
    assert len(tile.points) == 400
    assert tile.trajectory is None
    assert tile.surface is not None
    assert tile.origin == (499_200.0, 5_398_800.0, 0.0)
    assert found.kinds == ("guardrail", "cable")
    assert found.lines.crs == open_survey([las_file]).crs
    assert "DHHN2016" in found.lines.crs
    assert found.lines.id[0].startswith("guardrail-")


def test_several_tiles_see_core_and_buffer_only(long_file, method, extracted):
    found = extracted(long_file, method, settings=SMALL)
    assert len(method.tiles) == len(found.tiles) > 1
    for tile, report in zip(method.tiles, found.tiles, strict=True):
        inside = tile.core.grown(5.0)
        assert tile.points.xyz[:, 0].min() >= inside.west
        assert tile.points.xyz[:, 0].max() < inside.east
        assert len(tile.points) == report.n_points < 12_000
        assert tile.origin == method.tiles[0].origin
    assert [t.tile.tile_id for t in found.tiles] == [tile.tile_id for tile in method.tiles]
    assert [t.name for t in found.tiles] == [f"cable+guardrail-{tile.tile_id}" for tile in method.tiles]


def test_only_points_that_matter_are_loaded(las_file, method, extracted):
    high = road_points(100, seed=5)
    high = dataclasses.replace(high, xyz=high.xyz + np.array([0, 0, 6.0]))
    write_las(high, las_file.with_name("high.laz"), crs=CRS)
    method.least_height_m = 2.0
    extracted(las_file.parent, method)
    (tile,) = method.tiles
    assert len(tile.points) == 100
    assert tile.points.xyz[:, 2].min() > 105.0


def test_a_tile_that_fails_is_named_and_the_others_go_on(long_file, extracted):
    found = extracted(long_file, Fails(), settings=SMALL)
    failed = [report for report in found.tiles if report.problem]
    assert 0 < len(failed) < len(found.tiles)
    for report in failed:
        assert re.fullmatch(
            r"diagonal: ArithmeticError: no line here \(test_run\.py, line \d+, in look\)\.", report.problem
        )
    assert [failure.name for failure in found.failures] == [report.name for report in failed]
    assert {"in look" in failure.trace for failure in found.failures} == {True}
    assert len(found.lines) >= 1


def test_a_survey_of_failed_tiles_only_is_no_result(las_file, extracted):
    with pytest.raises(OwnCodeError, match=r"^diagonal: ArithmeticError: no line here") as caught:
        extracted(las_file, Fails())
    assert "in look" in caught.value.__notes__[0]

    class Refuses(Diagonal):
        def look(self, tile):
            raise InputError("too many cells", where="grid", advice="take larger ones")

    with pytest.raises(
        PartialError, match=r"a: none of 1 tiles could be processed: grid: too many cells. Take larger"
    ):
        extracted(las_file, Refuses())


def test_tiles_that_are_done_are_not_done_again(long_file, method, tmp_path):
    survey, work = open_survey([long_file]), work_folder(tmp_path, tmp_path / "work")

    class Stops(Diagonal):
        def look(self, tile):
            if self.tiles:
                raise MachineError("the disk is full")
            return super().look(tile)

    def go(method):
        with (
            opened_survey(survey, work) as opened,
            run_folder(work, tmp_path / "lines.gpkg", {}, resume=True) as folder,
        ):
            return find_lines(of_points(opened), [method], folder, settings=SMALL)

    undisturbed = go(Diagonal())
    with pytest.raises(MachineError):
        go(Stops())
    resumed = go(method)
    assert len(method.tiles) == len(undisturbed.tiles) - 1
    np.testing.assert_array_equal(resumed.lines.xyz, undisturbed.lines.xyz)
    assert resumed.tiles == undisturbed.tiles


def test_a_damaged_file_among_good_ones_is_listed_and_has_its_hash(las_file, method, extracted):
    bad = las_file.with_name("b.laz")
    bad.write_bytes(las_file.read_bytes()[:-200])
    found = extracted(las_file.parent, method)
    ((failed, problem),) = found.read.failures
    assert failed == bad
    assert str(bad) in problem
    assert set(found.hashes) == {las_file, bad}


def test_the_record_balances_and_hashes(las_file, tmp_path, method, extracted):
    steps = RunSteps()
    found = extracted(las_file, method, steps=steps)
    record = outputs.publish_extraction(found, tmp_path / "lines.gpkg", {"features": []}, steps=steps)
    assert json.loads((tmp_path / "run.json").read_text()) == record
    counts = record["counts"]
    assert counts["points_in_files"] == counts["points_used"] + sum(counts["points_rejected"].values()) == 400
    assert counts["lines"] == {"guardrail": 1, "cable": 0}
    assert (counts["files"], counts["tiles"]) == (1, 1)
    assert len(record["inputs"][0]["sha256"]) == 64
    assert list(record["timings_s"]) == [
        "read points",
        "find the road",
        "find lines",
        "join lines",
        "write lines",
    ]
    assert len(read_lines(tmp_path / "lines.gpkg")) == 1


def test_lines_of_a_kind_not_looked_for_are_a_fault(las_file, tmp_path, method, extracted):
    found = extracted(las_file, method)
    astray = dataclasses.replace(found, lines=found.lines.with_columns(kind=["fence"]))
    (tmp_path / "lines.gpkg").touch()
    with pytest.raises(RuntimeError, match=r"1 lines, but .*'guardrail': 0"):
        outputs.record_of(astray, tmp_path / "lines.gpkg", {}, RunSteps(), written=tmp_path / "lines.gpkg")


def test_the_same_input_gives_the_same_bytes(las_file, tmp_path, method, extracted):
    for name in ("one.gpkg", "two.gpkg"):
        outputs.publish_extraction(extracted(las_file, method), tmp_path / name, {})
    assert (tmp_path / "one.gpkg").read_bytes() == (tmp_path / "two.gpkg").read_bytes()
    assert (tmp_path / "two.gpkg.run.json").exists()


def test_old_lines_and_their_record_stay_if_the_new_ones_cannot_be_written(
    las_file, tmp_path, method, extracted, monkeypatch
):
    output = tmp_path / "lines.gpkg"
    found = extracted(las_file, method)
    outputs.publish_extraction(found, output, {"try": 1})
    before = output.read_bytes(), (tmp_path / "run.json").read_bytes()

    def full(*_args, **_kwargs):
        raise MachineError("disk full")

    monkeypatch.setattr(outputs, "write_lines", full)
    with pytest.raises(MachineError):
        outputs.publish_extraction(found, output, {"try": 2}, overwrite=True)
    assert (output.read_bytes(), (tmp_path / "run.json").read_bytes()) == before


def test_the_store_is_made_once_and_anew_when_a_file_changes(las_file, method, extracted, tmp_path):
    stores = tmp_path / "work" / "stores"
    one, steps = extracted(las_file, method), RunSteps()
    (before,) = stores.iterdir()
    two = extracted(las_file, method, steps=steps)
    assert "read points" not in steps.timings_s
    np.testing.assert_array_equal(one.lines.xyz, two.lines.xyz)
    write_las(road_points(seed=9), las_file, crs=CRS, overwrite=True)
    three = extracted(las_file, method)
    (after,) = stores.iterdir()
    assert before != after
    assert not np.array_equal(one.lines.xyz, three.lines.xyz)


def test_a_trajectory_of_another_place_is_refused(las_file, method, extracted):
    away = Trajectory(np.array([3.0e8, 3.0e8 + 4]), np.array([[0.0, 0, 0], [40.0, 0, 0]]))
    write_trajectory(away, las_file.parent / "away.csv")
    (las_file.parent / "survey.toml").write_text(
        '[points]\nfiles = ["a.laz"]\n[trajectory]\nfile = "away.csv"\n'
    )
    with pytest.raises(InputError, match="km apart"):
        extracted(las_file.parent, method)


def test_the_lever_arm_is_taken_off(las_file, method, extracted):
    path = las_file.parent / "trajectory.csv"
    xyz = np.array([[500_000.0, 5_400_000.0, 102.0], [500_040.0, 5_400_000.0, 102.0]])
    write_trajectory(Trajectory(np.array([3.0e8, 3.0e8 + 4]), xyz), path)
    (las_file.parent / "survey.toml").write_text(
        '[points]\nfiles = ["a.laz"]\n[trajectory]\nfile = "trajectory.csv"\nlever_m = [1.0, 0.0, 2.0]\n'
    )
    found = extracted(las_file.parent, method)
    np.testing.assert_allclose(method.tiles[0].trajectory.xyz, xyz - [1.0, 0.0, 2.0])
    assert path in found.hashes


def test_two_files_are_one_survey(las_file, method, extracted):
    write_las(road_points(seed=2, east_m=500_040.0), las_file.with_name("b.las"), crs=CRS)
    found = extracted(las_file.parent, method)
    assert found.read.n_points == 800
    assert found.tiles[0].n_points == 800


def test_lines_without_a_source_name_the_files_about_them(las_file, method, extracted):
    beside = las_file.with_name("b.laz")
    write_las(road_points(seed=2, east_m=500_100.0), beside, crs=CRS)
    facts = extracted(las_file.parent, method).read.files
    lines = LineSet.from_lines(
        [np.array([[500_000.0 + e, 5_400_000.0, 0], [500_000.0 + e + dx, 5_400_001.0, 0]])
         for e, dx in ((10.0, 5.0), (110.0, 5.0), (10.0, 100.0), (60.0, 5.0), (10.0, 5.0))],
        source=["", "", "", "", "own"],
    )  # fmt: skip
    named = with_sources(lines, facts, "survey")
    assert named.source.tolist() == ["a.laz", "b.laz", "a.laz, b.laz", "survey", "own"]
    assert with_sources(named, facts, "survey") is named


def test_every_extracted_line_has_a_source(las_file, method, extracted):
    class Silent(Diagonal):
        def look(self, tile):
            return super().look(tile).with_columns(source=[""])

    assert extracted(las_file, Silent()).lines.source.tolist() == ["a.laz"]
    assert extracted(las_file, method).lines.source.tolist() == ["a"]
