"""Laws of the surface: how the survey is split, ordered and shared out does not change road and ground."""

import tempfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.scenes.effort import examples
from tests.scenes.surface_scenes import CONFIG, along, on_lattice, store_of, surface_of, winding_road

from linework.model.points import Points
from linework.processes.pool import Processes
from linework.runs.opened.surface import SurfaceTiling
from linework.simulation.roads.draw import USUAL_ROADS
from linework.simulation.simulate import simulate_survey
from linework.surface.road import find_ground

few = settings(max_examples=examples(5), deadline=None, derandomize=True)
PLANES = ("road_m", "ground_m", "is_road", "is_ground")


def assert_same(one, other):
    """Equal to the last bit, cell by cell."""
    assert one.grid == other.grid
    assert one.z0_m == other.z0_m
    for plane in PLANES:
        np.testing.assert_array_equal(getattr(one, plane), getattr(other, plane), err_msg=plane)


@pytest.fixture(scope="module")
def folder():
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


@pytest.fixture(scope="module")
def store(folder):
    return store_of(folder / "store", winding_road(1))


@pytest.fixture(scope="module", params=[True, False], ids=["with path", "without path"])
def reference(request, store, folder):
    """The path or None, and the surface in one tile."""
    path = along() if request.param else None
    surface = surface_of(store, path, folder / f"one-{request.param}", layout=SurfaceTiling(512, (-3, -200)))
    assert len(surface.known) > 1
    return path, surface.over(store.bounds.grown(90.0))


@few
@given(st.integers(48, 300), st.integers(-300, 300), st.integers(-300, 300))
def test_the_size_and_the_place_of_the_tiles_do_not_matter(store, reference, n_cells, east, north):
    path, expected = reference
    with tempfile.TemporaryDirectory() as name:
        split = surface_of(store, path, Path(name), layout=SurfaceTiling(n_cells, (east, north)))
        assert not split.failures
        assert_same(split.over(store.bounds.grown(90.0)), expected)


@few
@given(st.integers(0, 1000), st.integers(500, 30_000))
def test_the_order_of_the_points_and_their_batches_do_not_matter(store, reference, seed, batch):
    path, expected = reference
    xyz = winding_road(1)
    with tempfile.TemporaryDirectory() as name:
        order = np.random.default_rng(seed).permutation(len(xyz))
        other = store_of(Path(name) / "store", xyz, order=order, batch=batch)
        split = surface_of(other, path, Path(name) / "surface", layout=SurfaceTiling(128))
        assert_same(split.over(store.bounds.grown(90.0)), expected)


def test_two_processes_find_what_one_finds(store, reference, tmp_path):
    path, expected = reference
    with Processes(2, modules=("linework.runs.opened.surface",)) as executor:
        shared = surface_of(store, path, tmp_path, executor=executor)
    assert not shared.failures
    assert_same(shared.over(store.bounds.grown(90.0)), expected)


@few
@given(st.floats(-60, 160), st.floats(-60, 60), st.floats(0.2, 80), st.floats(0.2, 80))
def test_a_place_has_the_same_surface_wherever_it_is_asked_from(store, folder, east, north, width, height):
    surface = surface_of(store, along(), folder / "asked", key="once")
    whole = surface.over(store.bounds.grown(150.0))
    bounds = store.bounds._replace(
        west=store.bounds.west + east, south=store.bounds.south + north,
        east=store.bounds.west + east + width, north=store.bounds.south + north + height,
    )  # fmt: skip
    part = surface.over(bounds)
    cell = CONFIG.cell_m
    row = round((whole.grid.north_m - part.grid.north_m) / cell)
    col = round((part.grid.east_m - whole.grid.east_m) / cell)
    place = slice(row, row + part.grid.n_rows), slice(col, col + part.grid.n_cols)
    for plane in PLANES:
        np.testing.assert_array_equal(getattr(part, plane), getattr(whole, plane)[place])


@cache
def simulated(kind):
    survey = simulate_survey(kind, 5, 90.0, points_per_m=1500)
    return on_lattice(survey.points.xyz), survey.trajectory


@pytest.mark.parametrize("kind", USUAL_ROADS)
@pytest.mark.parametrize("with_path", [True, False])
def test_a_split_survey_has_the_surface_of_the_whole(kind, with_path, tmp_path):
    xyz, trajectory = simulated(kind)
    path = trajectory if with_path else None
    store = store_of(tmp_path / "store", xyz)
    whole = find_ground(Points(xyz), path, CONFIG)
    split = surface_of(store, path, tmp_path / "surface").over(store.bounds)
    assert split.grid == whole.grid
    assert np.array_equal(split.is_road, whole.is_road)
    assert np.array_equal(split.is_ground, whole.is_ground)
    # The height origins may differ: float32 rounds elsewhere
    for plane in ("road_m", "ground_m"):
        apart = (getattr(split, plane) + split.z0_m) - (getattr(whole, plane) + whole.z0_m)
        assert np.abs(apart).max() < 1e-4, plane
    assert whole.is_road.sum() > 1000
