"""Smooth ground beside roads that was not taken for road: measured, and said where it is much."""

import json

import numpy as np
import pytest

from linework.surface.aside import RoadAside, smooth_aside

CELL_M = 0.5


def scene(width_m, gap_m, length_m=100.0):
    """A road of 8 m, and another strip of a width at a distance from it, both with 4 points per cell."""
    shape = 120, round(length_m / CELL_M)
    road, other = np.zeros(shape, bool), np.zeros(shape, bool)
    road[20:36] = True
    first = 36 + round(gap_m / CELL_M)
    other[first : first + round(width_m / CELL_M)] = True
    return road, other, 4 * (road | other).astype(np.int32)


def aside(width_m, gap_m):
    road, other, count = scene(width_m, gap_m)
    return smooth_aside(road, road | other, count, (slice(None), slice(None)), CELL_M)


def test_a_second_carriageway_is_measured():
    found = aside(7.0, 4.0)
    assert found.road_m2 == 800.0
    assert found.aside_m2 == pytest.approx(700.0)
    assert found.aside_m == pytest.approx(100.0, rel=0.1)
    assert found.aside_points == 4 * 700 / CELL_M**2
    assert found.near_points == 4 * 1500 / CELL_M**2
    assert "47 % of the points within 15 m of a road" in found.warning
    assert "(700 m2, " in found.warning


@pytest.mark.parametrize(("width_m", "gap_m"), [(2.0, 2.0), (7.0, 20.0)])
def test_footways_and_far_ground_are_not_missed_roads(width_m, gap_m):
    found = aside(width_m, gap_m)
    assert (found.aside_m2, found.aside_points, found.warning) == (0.0, 0, "")


def test_without_a_road_nothing_lies_beside_it():
    nothing = np.zeros((40, 40), bool)
    whole = slice(None), slice(None)
    assert smooth_aside(nothing, ~nothing, np.ones((40, 40), np.int32), whole, CELL_M) == RoadAside()


def test_windows_add_up():
    road, other, count = scene(7.0, 4.0)
    halves = [
        smooth_aside(road, road | other, count, (slice(None), part), CELL_M)
        for part in (slice(0, 100), slice(100, None))
    ]
    whole = smooth_aside(road, road | other, count, (slice(None), slice(None)), CELL_M)
    assert RoadAside.added(halves).aside_points == whole.aside_points
    assert RoadAside.added(halves).aside_m2 == whole.aside_m2


def test_the_record_of_a_run_has_it(linework, tmp_path):
    simulated = ("--road", "straight", "--length-m", "40", "--points-per-m", "800", "--no-images", "--quiet")
    assert linework("simulate", "-o", tmp_path / "s", *simulated).code == 0
    assert linework("extract", tmp_path / "s", "-o", tmp_path / "a.gpkg", "--quiet").code == 0
    counts = json.loads((tmp_path / "run.json").read_text())["counts"]
    assert counts["road_m2"] > 200.0
    assert 0.0 <= counts["not_road_share"] <= 1.0
    assert counts["not_road_m2"] >= 0.0 and counts["not_road_m"] >= 0.0


@pytest.mark.parametrize("inner", [(slice(None), slice(None)), (slice(30, 90), slice(0, 120))])
def test_empty_cells_around_change_nothing(inner):
    road, other, count = scene(7.0, 4.0)
    found = smooth_aside(road, road | other, count, inner, CELL_M)
    north, west = 40, 25
    wide = ((north, 60), (west, 90))
    there = tuple(
        slice((s.start or 0) + shift, (n if s.stop is None else s.stop) + shift)
        for s, shift, n in zip(inner, (north, west), road.shape, strict=True)
    )
    padded = smooth_aside(np.pad(road, wide), np.pad(road | other, wide), np.pad(count, wide), there, CELL_M)
    assert padded == found
    assert found.aside_m2 > 0.0
