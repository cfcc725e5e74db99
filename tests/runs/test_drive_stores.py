"""Stores of the points of single drives: some at a time from one reading, each whole or not there."""

import numpy as np
import pytest

from linework.files.store.from_points import store_points
from linework.files.store.read import PointStore
from linework.model.points import Points
from linework.runs.drives import stores
from linework.runs.drives.stores import make_missing_stores
from linework.runs.steps import RunSteps


@pytest.fixture
def survey(tmp_path):
    """Return a store of points of six drives, a minute each."""
    rng = np.random.default_rng(1)
    time_s = 3e8 + np.sort(rng.uniform(0.0, 360.0, 3000))
    places = rng.uniform(0.0, 400.0, (2, 3000))
    xyz = np.column_stack([500_000.0 + places[0], 5_800_000.0 + places[1], np.full(3000, 40.0)])
    (tmp_path / "all").mkdir()
    points = Points(xyz, intensity=rng.integers(1, 4000, 3000), time_s=time_s, crs="EPSG:25832")
    store_points(points, tmp_path / "all", name="a")
    return PointStore.open(tmp_path / "all")


def own(number, points):
    return points.take((points.time_s - 3e8) // 60.0 == number)


def changes_of(folder, chosen=own):
    return {folder / f"{k}" / "store": lambda points, k=k: chosen(k, points) for k in range(6)}


def points_of(folder):
    return [PointStore.open(path).points() for path in changes_of(folder)]


def test_each_store_has_the_points_of_its_drive(survey, tmp_path, monkeypatch):
    make_missing_stores(survey, changes_of(tmp_path), RunSteps(), "separate drives")
    monkeypatch.setattr(stores, "_MOST_STORES", 1)
    make_missing_stores(survey, changes_of(tmp_path / "alone"), RunSteps(), "separate drives")
    for k, (found, alone) in enumerate(zip(points_of(tmp_path), points_of(tmp_path / "alone"), strict=True)):
        assert found == alone
        assert sorted(found.time_s) == sorted(own(k, survey.points()).time_s)


def test_what_fails_leaves_no_part_of_a_store_and_goes_on(survey, tmp_path):
    def failing(number, points):
        if number == 5:
            raise OSError("the disk is full")
        return own(number, points)

    with pytest.raises(OSError, match="full"):
        make_missing_stores(survey, changes_of(tmp_path, failing), RunSteps(), "separate drives")
    # Those of the first reading are whole; of the second there is nothing
    there = [path.is_dir() for path in changes_of(tmp_path)]
    assert there == [True] * stores._MOST_STORES + [False] * (6 - stores._MOST_STORES)
    assert not [path for path in tmp_path.rglob("*.part*") if "all" not in path.parts]

    asked = []

    def noted(number, points):
        asked.append(number)
        return own(number, points)

    make_missing_stores(survey, changes_of(tmp_path, noted), RunSteps(), "separate drives")
    assert set(asked) == {4, 5}
    assert sum(len(points) for points in points_of(tmp_path)) == survey.n_points
