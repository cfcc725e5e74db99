"""Points to raster images: counts, heights, edges, order, size."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.scenes.effort import examples

from linework.errors import InputError
from linework.imaging.raster import (
    MAX_CELLS,
    cell_indices,
    grid_for,
    in_height_band,
    main_direction_grid,
    main_direction_rad,
    placement,
    rasterise,
)
from linework.imaging.scan_lines import scan_line_spacing_m
from linework.kernels.cells import rasterise as kernels
from linework.model.grid import Bounds, Grid
from linework.model.points import Points
from linework.model.trajectory import Trajectory


def cloud(n=500, seed=0, origin=(664_000.0, 5_080_000.0, 180.0), size=8.0):
    rng = np.random.default_rng(seed)
    xyz = np.asarray(origin) + rng.uniform(0, 1, (n, 3)) * (size, size, 3.0)
    return Points(xyz.round(3), intensity=rng.integers(0, 65536, n).astype(np.float32))


def twin(points, grid, height, origin):
    """The obvious way: one list of points per cell."""
    cells = cell_indices(points, grid)
    empty = np.full(grid.shape, np.nan)
    out = {name: empty.copy() for name in ("density", "maximum", "minimum", "mean", "intensity")}
    for cell in range(grid.n_rows * grid.n_cols):
        inside = np.flatnonzero(cells == cell)
        at = divmod(cell, grid.n_cols)
        out["density"][at] = len(inside)
        if len(inside):
            h = (height[inside] - origin).astype(np.float32)
            out["maximum"][at], out["minimum"][at], out["mean"][at] = h.max(), h.min(), h.mean(dtype=float)
            out["intensity"][at] = points.intensity[inside].mean(dtype=float)
    return out


@pytest.mark.parametrize("rotation_deg", [0.0, 33.0])
def test_images_equal_their_slow_twin(rotation_deg):
    points = cloud()
    grid = Grid(664_000.0, 5_080_006.0, 0.5, 0.8, 9, 13, rotation_deg)
    images = rasterise(points, grid)
    expected = twin(points, grid, points.xyz[:, 2], images.height_origin_m)
    assert images.density.values.dtype == np.uint32
    np.testing.assert_array_equal(images.density.values, expected["density"])
    np.testing.assert_array_equal(images.maximum.values, expected["maximum"])
    np.testing.assert_array_equal(images.minimum.values, expected["minimum"])
    np.testing.assert_allclose(images.mean.values, expected["mean"], atol=2e-6)
    np.testing.assert_allclose(images.intensity.values, expected["intensity"], rtol=1e-6)


def test_compiled_and_plain_python_agree(monkeypatch):
    points, grid = cloud(200), Grid(664_000.0, 5_080_006.0, 0.5, 0.8, 9, 13, 20.0)
    where = [placement(grid), *grid.shape]
    arguments = [points.xyz, points.xyz[:, 2], 180.0, points.intensity, *where]
    compiled = kernels.rasterise_points(*arguments)
    counted = kernels.count_in_band(points.xyz, points.xyz[:, 2], 181.0, 182.0, *where)
    monkeypatch.setattr(kernels, "cell_of", kernels.cell_of.py_func)
    for a, b in zip(compiled, kernels.rasterise_points.py_func(*arguments), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-6)
    plain = kernels.count_in_band.py_func(points.xyz, points.xyz[:, 2], 181.0, 182.0, *where)
    np.testing.assert_array_equal(counted, plain)
    np.testing.assert_array_equal(
        kernels.cells_of_coordinates.py_func(points.xyz, *where),
        kernels.cells_of_coordinates(points.xyz, *where),
    )


@settings(max_examples=examples(30), deadline=None)
@given(st.integers(0, 10_000))
def test_order_of_points_does_not_matter_to_the_last_bit(seed):
    points = cloud(300, seed=1, size=2.0)
    shuffled = points.take(np.random.default_rng(seed).permutation(len(points)))
    grid = grid_for(points, 0.5)
    a, b = rasterise(points, grid), rasterise(shuffled, grid)
    for name in ("density", "maximum", "minimum", "mean", "intensity"):
        assert getattr(a, name).values.tobytes() == getattr(b, name).values.tobytes(), name


@settings(max_examples=examples(60), deadline=None)
@given(st.integers(-40, 40), st.integers(-40, 40), st.integers(0, 1000), st.sampled_from([0.2, 0.25, 0.1]))
def test_a_point_on_an_edge_is_in_the_same_cell_of_every_grid(col0, row0, seed, cell_m):
    # coordinates to the centimetre lie on cell edges all the time
    rng = np.random.default_rng(seed)
    xy = np.array([664_000.0, 5_080_000.0]) + 0.01 * rng.integers(-300, 300, (50, 2))
    points = Points(np.column_stack([xy, np.zeros(50)]))
    whole = Grid.covering(Bounds(663_985.0, 5_079_985.0, 664_015.0, 5_080_015.0), cell_m)
    part = Grid.covering(
        Bounds(664_000 + col0 * cell_m, 5_080_000 + row0 * cell_m, 664_004.0, 5_080_004.0)
        if col0 < 15 and row0 < 15
        else points.bounds,
        cell_m,
    )
    in_whole, in_part = cell_indices(points, whole), cell_indices(points, part)
    seen = in_part >= 0
    row, col = np.divmod(in_part[seen], part.n_cols)
    shift_col = round((part.east_m - whole.east_m) / cell_m)
    shift_row = round((whole.north_m - part.north_m) / cell_m)
    np.testing.assert_array_equal((row + shift_row) * whole.n_cols + col + shift_col, in_whole[seen])


def test_a_grid_made_for_points_holds_every_one_of_them():
    for cell_m in (0.1, 0.2, 0.3):
        corner = np.array([664_000.0, 5_080_000.0])
        xy = corner + np.array([[0.0, 0.0], [0.6, 0.6], [1.2, 0.3], [0.3, 1.2]])
        points = Points(np.column_stack([xy, np.zeros(4)]))
        assert np.all(cell_indices(points, grid_for(points, cell_m)) >= 0)
        assert np.all(cell_indices(points, main_direction_grid(points, cell_m, 2 * cell_m)) >= 0)


def test_west_and_north_edges_are_inside():
    points = Points(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]))
    for grid in (Grid(0.0, 1.0, 1.0, 1.0, 1, 1), Grid(0.0, 1.0, 0.5, 0.25, 4, 2)):
        assert (cell_indices(points, grid) >= 0).tolist() == [False, False, True, False]


def test_points_outside_and_without_height_are_left_out():
    points = Points(np.array([[0.5, 0.5, 1.0], [9.0, 0.5, 1.0], [0.5, 0.5, 2.0], [-9e9, 0.5, 1.0]]))
    grid = Grid(0.0, 1.0, 1.0, 1.0, 1, 1)
    height = np.array([0.25, 1.0, np.nan, 1.0], dtype=np.float32)
    images = rasterise(points, grid, height_m=height)
    assert images.height_origin_m == 0.0
    assert images.intensity is None
    assert images.density.values.tolist() == [[1]]
    assert images.mean.values.tolist() == [[0.25]]


def test_no_points_give_empty_images():
    images = rasterise(Points(np.zeros((0, 3))), Grid(0.0, 1.0, 1.0, 1.0, 1, 2))
    assert images.density.values.sum() == 0
    assert np.isnan(images.maximum.values).all()


def test_binary_image_holds_the_band_with_both_ends():
    xyz = np.array([[0.5, 0.5, 0.0], [1.5, 0.5, 0.0], [2.5, 0.5, 0.0], [2.6, 0.5, 0.0], [3.5, 0.5, 0.0]])
    height = np.array([0.25, 1.25, 1.0, 0.5, 5.0])
    grid = Grid(0.0, 1.0, 1.0, 1.0, 1, 4)
    band = in_height_band(xyz, height, grid, 0.25, 1.25)
    assert band.values.dtype == np.bool_
    assert band.values.tolist() == [[True, True, True, False]]
    assert in_height_band(xyz, height, grid, 0.25, 1.25, min_points=2).values.tolist() == [
        [False, False, True, False]
    ]
    assert in_height_band(xyz, height, grid, 4.0, math.inf).values.tolist() == [[False, False, False, True]]


def test_a_grid_too_large_is_refused_before_it_is_made():
    stray = Points(np.array([[0.0, 0.0, 0.0], [2e9, 2e9, 0.0]]))
    for refused in (
        lambda: grid_for(stray, 0.2),
        lambda: main_direction_grid(stray, 0.2, 0.2),
        lambda: rasterise(stray, Grid(0.0, 0.0, 0.2, 0.2, 100_000, 100_000)),
        lambda: in_height_band(stray.xyz, np.zeros(2), Grid(0.0, 0.0, 0.2, 0.2, 100_000, 100_000), 0, 1),
    ):
        with pytest.raises(InputError, match=f"cells = .*limit is {MAX_CELLS:,}.*larger cell"):
            refused()


def test_no_points_have_no_grid():
    for refused in (grid_for, lambda p, c: main_direction_grid(p, c, c)):
        with pytest.raises(InputError, match="no points"):
            refused(Points(np.zeros((0, 3))), 0.2)


@pytest.mark.parametrize("direction_deg", [-80.0, -30.0, 0.0, 45.0, 90.0])
def test_the_turned_grid_follows_the_road(direction_deg):
    rng = np.random.default_rng(5)
    along, across = rng.uniform(0, 300, 2000), rng.uniform(-6, 6, 2000)
    angle = math.radians(direction_deg)
    east = 664_000 + along * math.cos(angle) - across * math.sin(angle)
    north = 5_080_000 + along * math.sin(angle) + across * math.cos(angle)
    points = Points(np.column_stack([east, north, 0 * east]))
    path = np.column_stack([along, 0 * along]) @ [
        [math.cos(angle), math.sin(angle)],
        [-math.sin(angle), math.cos(angle)],
    ]
    trajectory = Trajectory(
        np.arange(2000.0), np.column_stack([path + np.array([664_000.0, 5_080_000.0]), 0 * along])
    )
    for grid, exact in (
        (main_direction_grid(points, 0.5, 0.25), False),
        (main_direction_grid(points, 0.5, 0.25, trajectory=trajectory), True),
    ):
        turn = (grid.rotation_deg - direction_deg + 90.0) % 180.0 - 90.0
        assert abs(turn) < (1e-6 if exact else 0.5)
        assert -90.0 < grid.rotation_deg <= 90.0
        assert grid.cell_width_m == 0.5
        assert grid.cell_height_m == 0.25
        assert np.all(cell_indices(points, grid) >= 0)
        assert grid.n_cols < 615
        assert grid.n_rows < 70


def test_main_direction_of_one_place_is_east():
    assert main_direction_rad(np.zeros((1, 2))) == 0.0


def profile_survey(spacing_m=0.08, rate_hz=100.0, n_lines=300, n_points=600, second=False, seed=2):
    """A van with a profile scanner: road below, walls beside, a bridge above, in the order of time."""
    rng = np.random.default_rng(seed)
    turns = np.arange(n_lines * n_points) / n_points
    time_s = 1000.0 + turns / rate_hz
    angle = 2 * math.pi * (turns % 1.0) - math.pi / 2  # starts straight down
    reach = np.minimum(
        2.0 / np.maximum(-np.sin(angle), 1e-9),
        np.minimum(10.0 / np.maximum(np.abs(np.cos(angle)), 1e-9), 5.0 / np.maximum(np.sin(angle), 1e-9)),
    )
    x = spacing_m * rate_hz * (time_s - 1000.0)
    y, z = reach * np.cos(angle), 2.0 + reach * np.sin(angle)
    kept = rng.random(len(x)) < 0.8
    points = Points(np.column_stack([x, y, z])[kept], time_s=time_s[kept])
    end = n_lines / rate_hz
    trajectory = Trajectory(
        np.array([999.0, 1001.0 + end]),
        np.array([[-spacing_m * rate_hz, 0, 0], [spacing_m * rate_hz * (end + 1.0), 0, 0]]),
    )
    if second:
        later = 0.4 / rate_hz
        xyz = points.xyz + np.array([spacing_m * rate_hz * later, 0.0, 0.0])
        points = Points(
            np.concatenate([points.xyz, xyz]), time_s=np.concatenate([points.time_s, points.time_s + later])
        )
    return points, trajectory


@pytest.mark.parametrize("spacing_m", [0.04, 0.12, 0.25])
def test_scan_line_spacing_is_measured(spacing_m):
    points, trajectory = profile_survey(spacing_m)
    mixed = points.take(np.random.default_rng(0).permutation(len(points)))
    assert scan_line_spacing_m(mixed, trajectory) == pytest.approx(spacing_m, rel=0.02)


def test_two_scanners_have_the_spacing_to_the_next_line_of_either():
    points, trajectory = profile_survey(0.1, second=True)
    assert scan_line_spacing_m(points, trajectory) == pytest.approx(0.05, rel=0.05)


def test_scan_line_spacing_says_why_it_cannot_be_measured():
    points, trajectory = profile_survey()
    rng = np.random.default_rng(0)
    spinning = Points(points.xyz, time_s=rng.uniform(1000.0, 1002.9, len(points)))
    standing = Trajectory(trajectory.time_s, np.array([[0.0, 0, 0], [1e-6, 0, 0]]))
    still = Points(points.xyz * [0, 1, 1], time_s=points.time_s)
    for survey, path, message in (
        (Points(points.xyz), trajectory, "needs times"),
        (points, None, "needs times"),
        (Points(points.xyz, time_s=points.time_s + 1e6), trajectory, "only 0 points"),
        (spinning, trajectory, "no separate scan lines"),
        (still, standing, "does not move"),
    ):
        with pytest.raises(InputError, match=message):
            scan_line_spacing_m(survey, path)
