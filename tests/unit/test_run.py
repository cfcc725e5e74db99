"""The main job with a method of our own: what it is given, what becomes of what it returns."""

import dataclasses
import json

import numpy as np
import pytest
from tests.conftest import CRS, road_points

from linework.errors import InputError, MachineError
from linework.files.las_write import write_las
from linework.files.survey import open_survey
from linework.files.trajectories import write_trajectory
from linework.files.vectors import read_lines
from linework.model.lines import LineSet
from linework.model.trajectory import Trajectory
from linework.tiling import outputs, run
from linework.tiling.plan import Tile, plan_tiles
from linework.tiling.sources import with_sources
from linework.tiling.steps import Steps


class Diagonal:
    """Finds one guardrail: the diagonal of its tile's points; keeps what it was given."""

    name = "diagonal"
    kinds = ("cable", "guardrail")
    buffer_m = 5.0

    def __init__(self):
        self.tiles = []

    def extract(self, tile):
        self.tiles.append(tile)
        xyz = tile.points.xyz
        line = np.array([xyz.min(axis=0), xyz.max(axis=0)])
        return LineSet.from_lines([line], kind=["guardrail"], method=[self.name], source=[tile.source])


@pytest.fixture
def method():
    return Diagonal()


def test_a_method_gets_all_points_uncopied_and_its_lines_come_back_in_the_survey_crs(las_file, method):
    survey = open_survey([las_file])
    found = run.extract_lines(survey, [method])
    (tile,) = method.tiles
    assert len(tile.points) == 400
    assert tile.points is found.read.points
    assert tile.trajectory is None
    assert found.kinds == ("guardrail", "cable")
    assert found.lines.crs == survey.crs
    assert "DHHN2016" in found.lines.crs
    assert found.lines.id[0].startswith("guardrail-")


def test_several_tiles_see_core_and_buffer_only_and_workers_change_nothing(las_file, monkeypatch):
    def halves(bounds, buffer_m):
        (whole,) = plan_tiles(bounds, buffer_m)
        middle = (bounds.west + bounds.east) / 2
        return (
            Tile("w", whole.core._replace(east=middle), buffer_m),
            Tile("e", whole.core._replace(west=middle), buffer_m),
        )

    monkeypatch.setattr(run, "plan_tiles", halves)
    results = []
    for n_workers in (1, 2):
        method = Diagonal()
        results.append(run.extract_lines(open_survey([las_file]), [method], n_workers=n_workers))
        for tile in method.tiles:
            inside = tile.core.grown(5.0)
            assert tile.points.xyz[:, 0].min() >= inside.west
            assert tile.points.xyz[:, 0].max() < inside.east
            assert 200 < len(tile.points) < 400
    np.testing.assert_array_equal(results[0].lines.xyz, results[1].lines.xyz)
    assert results[0].lines.id.tolist() == results[1].lines.id.tolist()
    assert [t.tile.tile_id for t in results[0].tiles] == ["w", "e"]


def test_a_damaged_file_among_good_ones_is_listed_and_has_its_hash(las_file, method):
    bad = las_file.with_name("b.laz")
    bad.write_bytes(las_file.read_bytes()[:-200])
    found = run.extract_lines(open_survey([las_file.parent]), [method])
    ((failed, problem),) = found.read.failures
    assert failed == bad
    assert str(bad) in problem
    assert set(found.hashes) == {las_file, bad}


def test_the_record_balances_and_hashes(las_file, tmp_path, method):
    steps = Steps()
    found = run.extract_lines(open_survey([las_file]), [method], steps=steps)
    record = outputs.publish_extraction(found, tmp_path / "lines.gpkg", {"features": []}, steps=steps)
    assert json.loads((tmp_path / "run.json").read_text()) == record
    counts = record["counts"]
    assert counts["points_in_files"] == counts["points_used"] + sum(counts["points_rejected"].values()) == 400
    assert counts["lines"] == {"guardrail": 1, "cable": 0}
    assert len(record["inputs"][0]["sha256"]) == 64
    assert set(record["timings_s"]) == {"read points", "find lines", "write lines"}
    assert len(read_lines(tmp_path / "lines.gpkg")) == 1


def test_lines_of_a_kind_not_looked_for_are_a_fault(las_file, tmp_path, method):
    found = run.extract_lines(open_survey([las_file]), [method])
    astray = dataclasses.replace(found, lines=found.lines.with_columns(kind=["fence"]))
    (tmp_path / "lines.gpkg").touch()
    with pytest.raises(RuntimeError, match=r"1 lines, but .*'guardrail': 0"):
        outputs.record_of(astray, tmp_path / "lines.gpkg", {}, Steps())


def test_the_same_input_gives_the_same_bytes(las_file, tmp_path, method):
    for name in ("one.gpkg", "two.gpkg"):
        found = run.extract_lines(open_survey([las_file]), [method])
        outputs.publish_extraction(found, tmp_path / name, {})
    assert (tmp_path / "one.gpkg").read_bytes() == (tmp_path / "two.gpkg").read_bytes()
    assert (tmp_path / "two.gpkg.run.json").exists()


def test_old_lines_and_their_record_stay_if_the_new_ones_cannot_be_written(
    las_file, tmp_path, method, monkeypatch
):
    output = tmp_path / "lines.gpkg"
    found = run.extract_lines(open_survey([las_file]), [method])
    outputs.publish_extraction(found, output, {"try": 1})
    before = output.read_bytes(), (tmp_path / "run.json").read_bytes()

    def full(*_args, **_kwargs):
        raise MachineError("disk full")

    monkeypatch.setattr(outputs, "write_lines", full)
    with pytest.raises(MachineError):
        outputs.publish_extraction(found, output, {"try": 2}, overwrite=True)
    assert (output.read_bytes(), (tmp_path / "run.json").read_bytes()) == before


def test_a_trajectory_of_another_place_is_refused(las_file, tmp_path, method):
    away = Trajectory(np.array([3.0e8, 3.0e8 + 4]), np.array([[0.0, 0, 0], [40.0, 0, 0]]))
    path = tmp_path / "trajectory.csv"
    write_trajectory(away, path)
    (las_file.parent / "survey.toml").write_text(
        f'[points]\nfiles = ["a.laz"]\n[trajectory]\nfile = "{path}"\n'
    )
    with pytest.raises(InputError, match="km apart"):
        run.extract_lines(open_survey([las_file.parent]), [method])


def test_the_lever_arm_is_taken_off(las_file, method):
    path = las_file.parent / "trajectory.csv"
    xyz = np.array([[500_000.0, 5_400_000.0, 102.0], [500_040.0, 5_400_000.0, 102.0]])
    write_trajectory(Trajectory(np.array([3.0e8, 3.0e8 + 4]), xyz), path)
    (las_file.parent / "survey.toml").write_text(
        '[points]\nfiles = ["a.laz"]\n[trajectory]\nfile = "trajectory.csv"\nlever_m = [1.0, 0.0, 2.0]\n'
    )
    run.extract_lines(open_survey([las_file.parent]), [method])
    np.testing.assert_allclose(method.tiles[0].trajectory.xyz, xyz - [1.0, 0.0, 2.0])


def test_two_files_are_one_survey(las_file, method):
    write_las(road_points(seed=2, east_m=500_040.0), las_file.with_name("b.las"), crs=CRS)
    found = run.extract_lines(open_survey([las_file.parent]), [method])
    assert len(found.read.points) == 800
    assert found.tiles[0].n_points == 800


def test_lines_without_a_source_name_the_files_about_them(las_file, method):
    beside = las_file.with_name("b.laz")
    write_las(road_points(seed=2, east_m=500_100.0), beside, crs=CRS)
    facts = run.extract_lines(open_survey([las_file.parent]), [method]).read.files
    lines = LineSet.from_lines(
        [np.array([[500_000.0 + e, 5_400_000.0, 0], [500_000.0 + e + dx, 5_400_001.0, 0]])
         for e, dx in ((10.0, 5.0), (110.0, 5.0), (10.0, 100.0), (60.0, 5.0), (10.0, 5.0))],
        source=["", "", "", "", "own"],
    )  # fmt: skip
    named = with_sources(lines, facts, "survey")
    assert named.source.tolist() == ["a.laz", "b.laz", "a.laz, b.laz", "survey", "own"]
    assert with_sources(named, facts, "survey") is named


def test_every_extracted_line_has_a_source(las_file, method):
    class Silent(Diagonal):
        def extract(self, tile):
            return super().extract(tile).with_columns(source=[""])

    assert run.extract_lines(open_survey([las_file]), [Silent()]).lines.source.tolist() == ["a.laz"]
    assert run.extract_lines(open_survey([las_file]), [method]).lines.source.tolist() == ["a"]
