"""Laws of the tile store: what a place holds does not depend on how its points were written."""

import os
import shutil
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.oracles.store_twin import assert_same, file_of, made, selected, steps_of
from tests.scenes.effort import examples

from linework.files.store.layout import Limits
from linework.model.grid import Bounds
from linework.model.points import Points


@pytest.fixture(autouse=True, scope="module")
def nothing_is_made_durable():
    """Skip fsync: 5 ms a file, and no law is about power cuts."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda _: None)
        yield


STORES = settings(max_examples=examples(100), deadline=None)
#: Steps of 0.1 mm where something happens: about edges of cells and blocks, low and high, far and near.
EDGES = [0, 1, 4999, 5000, 5001, 639_999, 640_000, 2**24 - 1, 2**24, -1, -5000, -640_000, -(2**24)]
PLAN = st.sampled_from(EDGES) | st.integers(-1_000_000, 1_000_000) | st.integers(-(10**12) + 1, 10**12 - 1)
HEIGHT = st.sampled_from(EDGES) | st.integers(-2_000_000, 2_000_000) | st.integers(-(10**12) + 1, 10**12 - 1)
#: Few values, so that points that differ in time, intensity or a further column only are common.
TIME, INTENSITY = st.sampled_from([-1.5, 0.0, 0.25, 4e8, 4e8 + 1e-6]), st.sampled_from([0, 1, 255, 65_535])
FURTHER = st.tuples(st.sampled_from([-1.0, 0.0, 0.5]), st.sampled_from([-1e30, 1e-30, np.inf]))
POINTS = st.lists(st.tuples(PLAN, PLAN, HEIGHT, TIME, INTENSITY, FURTHER), max_size=40)
#: Any places, many of them on edges.
METRES = PLAN.map(lambda step: step / 10_000.0) | st.floats(-200.0, 200.0)


def columns(points):
    table = np.array([p[:4] for p in points]).reshape(-1, 4)
    # Through integers: steps beyond 2**53 / 10,000 would not be whole
    steps = np.array([p[:3] for p in points], np.int64).reshape(-1, 3)
    further = np.array([p[5] for p in points], np.float32).reshape(-1, 2)
    return steps / 10_000.0, np.array([p[4] for p in points], np.uint16), table[:, 3].copy(), further


def taken(file, index):
    return tuple(column[index] for column in file)


class Folder:
    """A folder of its own for every example."""

    def __enter__(self):
        self.path = Path(tempfile.mkdtemp(prefix="store-laws-"))
        return self.path

    def __exit__(self, *_):
        shutil.rmtree(self.path)


@STORES
@given(points=POINTS, west=METRES, south=METRES, east=METRES, north=METRES)
def test_a_place_holds_what_choosing_and_sorting_all_points_gives(points, west, south, east, north):
    file, bounds = (
        columns(points),
        Bounds(min(west, east), min(south, north), max(west, east), max(south, north)),
    )
    with Folder() as folder:
        store = made(folder / "s", [file])
        assert store.n_points == len(points)
        assert_same(store.points(), selected([file]))
        found, expected = store.points(bounds), selected([file], bounds)
        assert_same(found, expected)
        assert store.count_in(bounds) >= len(found)
        unordered = store.points(bounds, ordered=False)
        again = selected([file_of(unordered)])
        for column, other in zip(expected, again, strict=True):
            assert column.tobytes() == other.tobytes()


@STORES
@given(points=POINTS, data=st.data())
def test_order_batches_and_files_do_not_matter(points, data):
    file = columns(points)
    n = len(points)
    order = np.array(data.draw(st.permutations(range(n))), np.int64)
    cuts = sorted(data.draw(st.lists(st.integers(0, n), max_size=3)))
    batch = data.draw(st.integers(1, 50))
    files = [taken(file, part) for part in np.split(order, cuts)]
    with Folder() as folder:
        one, many = made(folder / "one", [file]), made(folder / "many", files, batch=batch)
        a, b = one.points(), many.points()
        assert a == b
        for column, other in zip(a.by_name().values(), b.by_name().values(), strict=True):
            assert column.tobytes() == other.tobytes()
        for ours, theirs in zip(one.block_counts, many.block_counts, strict=True):
            assert np.array_equal(ours, theirs)
        if n:
            assert one.bounds == many.bounds
            assert one.bounds == a.bounds


@STORES
@given(points=POINTS, edges=st.lists(st.integers(-4, 4), min_size=6, max_size=6))
def test_limits_leave_out_what_lies_outside_of_them(points, edges):
    west, east, south, north, low, high = edges
    limits = Limits(west=west, east=east, south=south, north=north, low=low, high=high)
    file = columns(points)
    number = steps_of(file[0]) // 640_000
    inside = (number[:, 0] >= west) & (number[:, 0] < east) & (number[:, 1] >= south) & (number[:, 1] < north)
    inside &= (number[:, 2] >= low) & (number[:, 2] < high)
    with Folder() as folder:
        store = made(folder / "s", [file], limits=limits)
        assert store.n_points == inside.sum() == store.block_counts[1].sum()
        expected = selected([taken(file, inside)])
        assert_same(store.points(), expected)
        if inside.any():
            assert store.bounds == store.points().bounds
        bounds = Bounds(-64.0, -64.0, 64.0, 0.0)
        assert_same(store.points(bounds), selected([taken(file, inside)], bounds))


@STORES
@given(points=POINTS, edges=st.tuples(METRES, METRES))
def test_places_side_by_side_share_no_point_and_lose_none(points, edges):
    file, (east, north) = columns(points), edges
    far = np.inf
    quarters = [
        Bounds(-far, -far, east, north), Bounds(east, -far, far, north),
        Bounds(-far, north, east, far), Bounds(east, north, far, far),
    ]  # fmt: skip
    with Folder() as folder:
        store = made(folder / "s", [file])
        parts = [store.points(bounds) for bounds in quarters]
    together = selected([file_of(Points.concatenate(parts))])
    for column, other in zip(together, selected([file]), strict=True):
        assert column.tobytes() == other.tobytes()


@pytest.mark.parametrize("spread_steps", [0, 3, 5000])
def test_a_van_that_stands_still_fills_one_cell(tmp_path, spread_steps):
    rng = np.random.default_rng(spread_steps)
    n = 50_000
    steps = np.array([5_000_000_000, 54_000_000_000, 1_000_000]) + rng.integers(0, spread_steps + 1, (n, 3))
    file = steps / 10_000.0, rng.integers(0, 2**16, n).astype(np.uint16), rng.permutation(n) / 8.0
    store = made(tmp_path / "s", [taken(file, slice(0, 20_000)), taken(file, slice(20_000, n))], batch=9_999)
    assert_same(store.points(), selected([file]))
