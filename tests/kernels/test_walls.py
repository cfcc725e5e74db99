"""Points of walls are told from the ground, from kerbs and from plants, and left out of it."""

from __future__ import annotations

import numpy as np
import pytest

from linework.kernels.boundaries.profiles import FloorCells, gather_at
from linework.kernels.boundaries.walls import gather_ground, gather_ground_area, has_wall, points_of_walls
from linework.kernels.cells import floor

SIDE_M = 6.0
PER_M2 = 800.0


def cells_of(xyz):
    """The points in fine cells, and which of them are of walls."""
    col, row = (np.floor(xyz[:, k] / floor.FINE_M).astype(np.int64) for k in range(2))
    n = round(SIDE_M / floor.FINE_M)
    span = np.array([0, 0, n, n])
    points, _, starts = floor.sort_by_cell(
        xyz, np.zeros(len(xyz), dtype=np.float32), np.zeros(3), col, row, span
    )
    sums = floor.cell_sums(points, starts, span)
    is_wall, on_ground = points_of_walls(points, starts, span)
    facets = floor.facets_of(sums, starts, span)
    return FloorCells(
        points, starts, span, sums, facets, np.zeros(len(facets), dtype=np.bool_), is_wall, on_ground
    )


def ground(rng, height=lambda x, y: 0.02 * x):
    x, y = rng.uniform(0.0, SIDE_M, (2, int(PER_M2 * SIDE_M**2)))
    return np.column_stack([x, y, height(x, y) + rng.normal(0.0, 0.005, len(x))])


def wall(rng, angle=0.2, height_m=0.6):
    """An upright face through (3, 4), turned by an angle; six times as many points a metre and 5 cm as the ground has."""
    n = int(PER_M2 * 0.05 * 6.0 * 6.0)
    t = rng.uniform(-3.5, 3.5, n)
    x, y = 3.0 + t * np.cos(angle), 4.0 + t * np.sin(angle)
    xyz = np.column_stack([x, y, 0.02 * x + rng.uniform(0.0, height_m, n)])
    xyz[:, :2] += rng.normal(0.0, 0.005, (n, 2))
    return xyz[((xyz[:, :2] > 0.01) & (xyz[:, :2] < SIDE_M - 0.01)).all(axis=1)]


@pytest.mark.parametrize("angle", [0.0, 0.2, 0.8, 1.5])
def test_a_wall_and_what_lies_at_its_foot_is_left_out(angle):
    rng = np.random.default_rng(1)
    data = cells_of(np.concatenate([ground(rng), wall(rng, angle)]))
    xy = data.points[:, :2] - [3.0, 4.0]
    off = np.abs(xy[:, 1] * np.cos(angle) - xy[:, 0] * np.sin(angle))
    high = data.points[:, 2] - 0.02 * data.points[:, 0] > 0.05
    assert data.is_wall[high].mean() > 0.9
    assert not data.is_wall[off > 0.15].any()
    assert data.is_wall[off < 0.04].mean() > 0.9
    assert data.on_ground[-1] == np.count_nonzero(~data.is_wall)


def scene(name, rng):
    if name == "kerb of 15 cm":
        return ground(rng, lambda x, y: 0.02 * x + 0.15 * (y > 3.0))
    if name == "bank":
        return ground(rng, lambda x, y: 0.02 * x + 1.5 * np.maximum(y - 3.0, 0.0))
    points = ground(rng)
    verge = points[:, 1] > 3.0
    tall_m = 0.30 if name == "grass" else 0.60
    points[verge, 2] += rng.uniform(0.0, tall_m, np.count_nonzero(verge))
    return points


@pytest.mark.parametrize("name", ["kerb of 15 cm", "bank", "grass", "tall grass"])
def test_what_is_no_wall(name):
    # But for a few parts of plants that hold many points by chance
    data = cells_of(scene(name, np.random.default_rng(2)))
    assert data.is_wall.mean() < 0.01


def test_without_walls_the_points_are_the_same():
    data = cells_of(ground(np.random.default_rng(3)))
    place, plane, work = (3.1, 2.9), np.array([0.062, 0.02, 0.0]), np.empty((2, 402, 4))
    n = gather_at(data.points, data.starts, data.span, place, 0.8, plane, 400, work[0])
    assert 200 < n == gather_ground(data, place, 0.8, plane, 400, work[1])
    np.testing.assert_array_equal(work[0, :n], work[1, :n])


def test_beside_a_wall_as_many_points_of_the_ground_are_used_as_elsewhere():
    rng = np.random.default_rng(4)
    data = cells_of(np.concatenate([ground(rng), np.repeat(wall(rng, 0.0), 10, axis=0)]))
    place, plane, work = (3.0, 3.6), np.array([0.06, 0.02, 0.0]), np.empty((302, 4))
    n, _ = gather_ground_area(data, place, plane, work, 150, 300)
    assert n > 150 and np.abs(work[:n, 2]).max() < 0.05
    n = gather_at(data.points, data.starts, data.span, place, 0.75, plane, 300, work)
    assert np.count_nonzero(np.abs(work[:n, 2]) < 0.05) < 100, "too few without"


def test_where_a_wall_is_near():
    rng = np.random.default_rng(5)
    data = cells_of(np.concatenate([ground(rng), wall(rng, 0.0)]))
    assert has_wall(data, (3.0, 3.9), 0.05) and has_wall(data, (3.0, 3.2), 0.9)
    assert not has_wall(data, (3.0, 3.8), 0.05) and not has_wall(data, (3.0, 2.0), 0.9)


def test_sums_without_walls_are_those_of_the_other_points():
    rng = np.random.default_rng(3)
    data = cells_of(np.concatenate([ground(rng), wall(rng)]))
    assert data.is_wall.any()
    # A cell of walls alone, too
    left_out = data.is_wall.copy()
    cell = int(np.flatnonzero(np.diff(data.starts) > 0)[5])
    left_out[data.starts[cell] : data.starts[cell + 1]] = True
    before = np.concatenate([[0], np.cumsum(~left_out)])[data.starts]
    found = floor.sums_without(data.sums, data.points, data.starts, data.span, left_out, before)
    kept = data.points[~left_out]
    np.testing.assert_array_equal(found, floor.cell_sums(kept, before, data.span))
    assert found[cell, floor.SUM_N] == 0.0
