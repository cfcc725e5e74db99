"""Splitting does not change the answer: batches, files, order of points, workers; tiles' size and origin."""

import dataclasses
import itertools

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.scenes.effort import examples
from tests.scenes.opened import of_points

from linework.files.las.decoder import DecoderLimits
from linework.files.las.write import write_las
from linework.files.survey.open import open_survey
from linework.files.trajectories.read import write_trajectory
from linework.methods.choose import choose_methods
from linework.methods.kinds import ALL_KINDS
from linework.model.lines import LineSet
from linework.processes.pool import Processes
from linework.runs.find import find_lines
from linework.runs.opened.points import opened_survey
from linework.runs.opened.work_folder import work_folder
from linework.runs.resume import run_folder
from linework.runs.settings import RunSettings, TilingConfig
from linework.simulation.simulate import simulate_survey

#: Several tiles, whatever the survey.
SMALL = {"core_m": 64.0, "high_core_m": 100.0, "max_points": 10_000}
_number = itertools.count()


@pytest.fixture(scope="module")
def simulated():
    return simulate_survey("bends", 611, 120.0, points_per_m=1500)


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    """Return a function that gives a new empty folder."""
    base = tmp_path_factory.mktemp("splitting")
    return lambda: base / f"{next(_number)}"


@pytest.fixture(scope="module")
def workers():
    with Processes(2, modules=("linework.runs.tasks",)) as processes:
        yield processes


def write_survey(simulated, folder, order=None, n_files=1):
    """Write the points in an order, spread over files."""
    points = simulated.points if order is None else simulated.points.take(order)
    for i, part in enumerate(np.array_split(np.arange(len(points)), n_files)):
        write_las(points.take(part), folder / f"p{i}.laz", crs=simulated.crs)
    write_trajectory(simulated.trajectory, folder / "trajectory.csv")
    (folder / "survey.toml").write_text(
        'name = "s"\n[points]\nfiles = ["*.laz"]\n[trajectory]\nfile = "trajectory.csv"\n'
    )
    return folder


def extracted(folder, work, executor=None, batch_points=500_000, **tiling):
    survey, work = open_survey([folder]), work_folder(folder, work)
    limits = dataclasses.replace(DecoderLimits(), batch_points=batch_points)
    with (
        opened_survey(survey, work, limits=limits) as opened,
        run_folder(work, work / "lines", {}) as run,
    ):
        methods = choose_methods("auto", ALL_KINDS)
        config = TilingConfig(**(SMALL | tiling))
        found = find_lines(
            of_points(opened), methods, run, settings=RunSettings(tiling=config), executor=executor
        )
    assert len(found.tiles) > 1 or not SMALL.keys() <= tiling.keys()
    assert not found.failures
    return found.lines


def everything(lines):
    """Return all columns but the names of the files."""
    return {f.name: getattr(lines, f.name) for f in dataclasses.fields(LineSet) if f.name != "source"}


def assert_same(one, two):
    assert len(one) > 2
    for name, values in everything(one).items():
        np.testing.assert_array_equal(values, everything(two)[name], err_msg=name)


@pytest.fixture(scope="module")
def reference(simulated, places):
    folder = write_survey(simulated, places())
    return folder, extracted(folder, places())


@settings(max_examples=examples(4), deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(
    seed=st.integers(0, 2**32), n_files=st.integers(1, 4), batch_points=st.sampled_from([997, 20_011, 10**6])
)
def test_batches_files_and_order_change_not_a_byte(simulated, places, reference, seed, n_files, batch_points):
    order = np.random.default_rng(seed).permutation(len(simulated.points))
    folder = write_survey(simulated, places(), order, n_files)
    assert_same(reference[1], extracted(folder, places(), batch_points=batch_points))


def test_workers_change_not_a_byte(places, reference, workers):
    assert_same(reference[1], extracted(reference[0], places(), executor=workers))


@settings(max_examples=examples(5), deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(
    core_m=st.sampled_from([64.0, 100.0, 150.0, 4096.0]),
    east=st.floats(-200.0, 200.0),
    north=st.floats(-200.0, 200.0),
)
def test_tiles_change_no_line_by_a_millimetre(places, reference, core_m, east, north):
    folder, one = reference
    two = extracted(
        folder, places(), core_m=core_m, shift_east_m=east, shift_north_m=north,
        high_core_m=1.5 * core_m, max_points=10_000 if core_m < 4096.0 else 10**9,
    )  # fmt: skip
    assert sorted(one.kind) == sorted(two.kind)
    assert sorted(one.id) == sorted(two.id)
    for i, name in enumerate(one.id):
        a, b = one[i].xyz, two[two.id.tolist().index(name)].xyz
        ends = [np.linalg.norm(a[[0, -1]] - other[[0, -1]], axis=1).max() for other in (b, b[::-1])]
        assert min(ends) <= 0.001, name
        assert shapely.hausdorff_distance(shapely.LineString(a), shapely.LineString(b), densify=0.05) <= 0.001
        b = b if ends[0] <= ends[1] else b[::-1]
        z = np.interp(_along(a), _along(b), b[:, 2])
        assert np.abs(z - a[:, 2]).max() <= 0.002, name


def _along(xyz):
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(xyz, axis=0), axis=1))])
    return along / along[-1]
