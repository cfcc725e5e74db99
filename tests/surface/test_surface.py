"""Road, ground and height above road on small scenes whose surfaces are known exactly."""

import numpy as np
import pytest

from linework.errors import InputError, UsageError
from linework.kernels.cells import surface as kernels
from linework.model.points import Points
from linework.model.trajectory import Trajectory
from linework.surface.road import (
    RoadConfig,
    find_ground,
    height_above_ground,
    height_above_road,
    is_road_point,
)

ORIGIN = np.array([500_000.0, 5_800_000.0, 100.0])


def scene(grade=0.0, crossfall=0.02, kerb_m=0.12, noise_m=0.005, seed=1):
    """A road 8 m wide along x with kerbs, pavements beyond them, a wall, a bridge over it and strays."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform([0, -10], [60, 10], (120_000, 2))
    road = np.abs(xy[:, 1]) < 4.0
    z = grade * xy[:, 0] - crossfall * np.abs(xy[:, 1]) + np.where(road, 0.0, kerb_m)
    ground = np.column_stack([xy, z + rng.normal(0, noise_m, len(z))])
    wall = np.column_stack(
        [rng.uniform(0, 60, 4000), np.full(4000, 9.0), rng.uniform(0, 3, 4000)]
    ) + np.array([0, 0, kerb_m - 0.18])
    wall[:, 2] += grade * wall[:, 0]
    deck = np.column_stack([rng.uniform(25, 32, 4000), rng.uniform(-10, 10, 4000), np.full(4000, 5.5)])
    deck[:, 2] += grade * deck[:, 0]
    strays = np.column_stack([rng.uniform(0, 60, 60), rng.uniform(-10, 10, 60), rng.uniform(-8, -0.5, 60)])
    xyz = np.concatenate([ground, wall, deck, strays]) + ORIGIN
    labels = np.repeat([0, 1, 2, 3], [len(ground), len(wall), len(deck), len(strays)])
    return Points(xyz), labels, road


def path(grade=0.0):
    x = np.arange(0.0, 60.0, 1.0)
    return Trajectory(x, np.column_stack([x, np.zeros_like(x), grade * x]) + ORIGIN)


@pytest.mark.parametrize("grade", [0.0, 0.12])
@pytest.mark.parametrize("crossfall", [0.02, 0.06])
@pytest.mark.parametrize("noise_m", [0.003, 0.02])
@pytest.mark.parametrize("with_path", [True, False])
def test_the_road_is_zero_and_ends_at_the_kerb(grade, crossfall, noise_m, with_path):
    points, labels, _ = scene(grade, crossfall, noise_m=noise_m)
    surface = find_ground(points, path(grade) if with_path else None, RoadConfig())
    y = points.xyz[labels == 0][:, 1] - ORIGIN[1]
    height = height_above_road(surface, points.xyz)[labels == 0]
    inner = np.abs(y) < 3.4
    assert np.abs(np.mean(height[inner])) < 0.015
    assert np.sqrt(np.mean(height[inner] ** 2)) < noise_m + 0.02
    said = is_road_point(surface, points.xyz)[labels == 0]
    assert np.mean(said[inner]) > 0.97
    assert np.mean(said[np.abs(y) > 4.6]) < 0.05


def test_heights_beyond_the_kerb_go_on_from_the_road():
    points, labels, _ = scene(kerb_m=0.12)
    surface = find_ground(points, path(), RoadConfig())
    y = np.abs(points.xyz[labels == 0][:, 1] - ORIGIN[1])
    height = height_above_road(surface, points.xyz)[labels == 0]
    beside = (y > 4.6) & (y < 6.0)
    expected = 0.12 - 0.02 * (y[beside] - 4.0)
    assert np.abs(np.median(height[beside] - expected)) < 0.05


def test_walls_and_bridges_stand_above_the_ground_and_strays_below():
    points, labels, _ = scene()
    surface = find_ground(points, path(), RoadConfig())
    height = height_above_ground(surface, points.xyz)
    assert np.median(height[labels == 2]) == pytest.approx(5.5, abs=0.4)
    assert np.quantile(height[labels == 1], 0.99) == pytest.approx(2.9, abs=0.3)
    assert np.all(height[labels == 3] < -0.2)


def test_ground_beyond_a_hole_in_the_data_is_ground():
    points, _, _ = scene()
    x = points.xyz[:, 0] - ORIGIN[0]
    surface = find_ground(points.take((x < 20) | (x > 32)), path(), RoadConfig())
    far = np.array([[45.0, 7.0, 0.12 - 0.14]]) + ORIGIN
    assert abs(float(height_above_ground(surface, far)[0])) < 0.05


def test_no_points_have_no_ground():
    with pytest.raises(UsageError, match="no points"):
        find_ground(Points(np.zeros((0, 3))))


def test_an_extent_that_needs_too_large_a_grid_is_refused_with_its_size():
    points = Points(np.array([[0.0, 0, 0], [9e7, 9e7, 0]]))
    with pytest.raises(InputError, match=r"need 3.24e\+16 cells of 0.5 m"):
        find_ground(points, None, RoadConfig())


@pytest.mark.parametrize("n", [1, 2, 3])
def test_a_handful_of_points_has_a_surface(n):
    points = Points(np.arange(3.0 * n).reshape(n, 3))
    surface = find_ground(points, None, RoadConfig())
    assert np.all(np.isfinite(height_above_road(surface, points.xyz)))


def test_lowest_supported_passes_over_strays():
    xyz = np.array([[0.1, 0.1, z] for z in (-3.0, -1.0, 0.0, 0.01, 0.02, 2.0)])
    for function in (kernels.lowest_supported, kernels.lowest_supported.py_func):
        cells, _, low, count = function(xyz, 0, 0, 1, 1, 0.5, 0.0, 0.15)
        assert cells.tolist() == [0] * 6
        assert low[0, 0] == pytest.approx(0.0)
        assert count[0, 0] == 6


def test_height_above_is_exact_on_a_plane():
    rows, cols = np.mgrid[0:6, 0:9]
    plane = (0.1 * (cols + 0.5) - 0.2 * (rows + 0.5)).astype(np.float32)
    xyz = np.array([[3.21, -2.7, 10.0], [4.0, -4.0, 11.0]])
    expected = xyz[:, 2] - 10.0 - (0.1 * xyz[:, 0] + 0.2 * xyz[:, 1])
    for function in (kernels.height_above, kernels.height_above.py_func):
        assert function(xyz, 0.0, 0.0, 10.0, 1.0, plane) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("rough_m", [0.02, 0.03, 0.04])
def test_a_rough_track_is_road_under_the_van_whatever_the_rest_of_the_road_is(rough_m):
    rng = np.random.default_rng(9)
    xy = rng.uniform([0, -4], [360, 4], (600_000, 2))
    noise = np.where(xy[:, 0] < 260.0, 0.003, rough_m)
    xyz = np.column_stack([xy, rng.normal(0.0, noise)]) + ORIGIN
    x = np.arange(0.0, 360.0, 1.0)
    driven = Trajectory(x, np.column_stack([x, 0.0 * x, 0.0 * x]) + ORIGIN)
    surface = find_ground(Points(xyz), driven)
    east = (
        surface.grid.east_m + (np.nonzero(surface.is_road)[1] + 0.5) * surface.grid.cell_width_m - ORIGIN[0]
    )
    assert np.count_nonzero(east > 270.0) * surface.grid.cell_width_m**2 >= 0.9 * 90.0 * 8.0
