"""Markings and boundaries over a whole run: not a byte depends on tiles, order of points or workers."""

import dataclasses
import itertools

import numpy as np
import pytest
from tests.scenes.opened import of_points

from linework.files.las.write import write_las
from linework.files.survey.open import open_survey
from linework.files.trajectories.read import write_trajectory
from linework.methods.obb.method import OBB_KINDS, Obb
from linework.model.lines import LineSet
from linework.processes.pool import Processes
from linework.runs.find import find_lines
from linework.runs.opened.points import opened_survey
from linework.runs.opened.work_folder import work_folder
from linework.runs.resume import run_folder
from linework.runs.settings import RunSettings, TilingConfig
from linework.simulation.simulate import simulate_survey

SMALL = TilingConfig(core_m=64.0, max_points=10_000)


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    """Return a function that gives a new empty folder."""
    base, number = tmp_path_factory.mktemp("obb-splitting"), itertools.count()
    return lambda: base / f"{next(number)}"


@pytest.fixture(scope="module")
def simulated():
    return simulate_survey("urban", 612, 90.0, points_per_m=4000)


def write_survey(simulated, folder, order=None):
    """Write the points in an order."""
    points = simulated.points if order is None else simulated.points.take(order)
    write_las(points, folder / "p.laz", crs=simulated.crs)
    write_trajectory(simulated.trajectory, folder / "trajectory.csv")
    (folder / "survey.toml").write_text(
        'name = "s"\n[points]\nfiles = ["*.laz"]\n[trajectory]\nfile = "trajectory.csv"\n'
    )
    return folder


def extracted(folder, work, tiling=SMALL, executor=None):
    survey, work = open_survey([folder]), work_folder(folder, work)
    with opened_survey(survey, work) as opened, run_folder(work, work / "lines", {}) as run:
        settings = RunSettings(tiling=tiling)
        found = find_lines(of_points(opened), (Obb(),), run, settings=settings, executor=executor)
    assert not found.failures
    return found


def assert_same(one, two):
    for name in (f.name for f in dataclasses.fields(LineSet)):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name), err_msg=name)


@pytest.fixture(scope="module")
def reference(simulated, places):
    """The survey's folder, its work folder, and its lines from several tiles."""
    folder, work = write_survey(simulated, places()), places()
    found = extracted(folder, work)
    assert len(found.tiles) > 2
    assert {"lane_marking", "road_boundary", "kerb_top"} <= set(found.lines.kind)
    assert set(found.lines.kind) <= set(OBB_KINDS)
    return folder, work, found.lines


@pytest.mark.parametrize(
    ("core_m", "east_m", "north_m"),
    [(64.0, 13.7, -21.3), (100.0, 31.0, 0.0), (128.0, -57.77, 48.01), (4096.0, 0.0, 0.0)],
)
def test_tiles_change_not_a_byte(reference, core_m, east_m, north_m):
    folder, work, lines = reference
    most = 10_000 if core_m < 4096.0 else 10**9
    tiling = TilingConfig(core_m=core_m, shift_east_m=east_m, shift_north_m=north_m, max_points=most)
    assert_same(lines, extracted(folder, work, tiling).lines)


def test_order_of_points_changes_not_a_byte(simulated, places, reference):
    order = np.random.default_rng(3).permutation(len(simulated.points))
    folder = write_survey(simulated, places(), order)
    assert_same(reference[2], extracted(folder, places()).lines)


def test_workers_change_not_a_byte(places, reference):
    with Processes(2, modules=("linework.runs.tasks",)) as workers:
        assert_same(reference[2], extracted(reference[0], places(), executor=workers).lines)
