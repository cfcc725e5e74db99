"""The steps of the obb paper on roads whose kerbs and markings are known, and each of its failures by its name."""

from __future__ import annotations

import numpy as np
import pytest

from linework.errors import ConfigError
from linework.published.intensity_histogram import intensity_histogram
from linework.published.methods import discs_of
from linework.published.obb_2023 import (
    NoBoxError,
    Obb2023Config,
    box_at,
    floor_plane,
    follow,
    groups_of_neighbours,
    normal_vectors,
    with_range,
)

NOISE_M, KERB_M = 0.005, 0.12
CONFIG = Obb2023Config()


def street(*, length_m=20.0, noise_m=NOISE_M, seed=1):
    """A road below a kerb along x at y = 0, with a marking 0.15 m wide at y = -1.5; intensities 40 and 180."""
    rng = np.random.default_rng(seed)
    n = int(length_m * 4 * 1500)
    x, y = rng.uniform(0.0, length_m, n), rng.uniform(-3.0, 1.0, n)
    z = np.where(y > 0.0, KERB_M, 0.0) + rng.normal(0.0, noise_m, n)
    face = np.column_stack(
        [rng.uniform(0.0, length_m, 2000), rng.normal(0.0, noise_m, 2000), rng.uniform(0, KERB_M, 2000)]
    )
    paint = np.abs(y + 1.5) < 0.075
    intensity = np.concatenate([np.where(paint, 180.0, 40.0) + rng.normal(0.0, 8.0, n), np.full(2000, 60.0)])
    return np.concatenate([np.column_stack([x, y, z]), face]), intensity.astype(np.float32)


@pytest.fixture(scope="module")
def about():
    return discs_of(*street(), CONFIG.radius_m)


def test_normals_are_those_of_the_plane():
    rng = np.random.default_rng(2)
    xy = rng.uniform(-0.5, 0.5, (300, 2))
    normals = normal_vectors(np.column_stack([xy, 0.2 * xy[:, 0]]), 6)
    expected = np.array([-0.2, 0.0, 1.0]) / np.hypot(0.2, 1.0)
    assert np.abs(normals - expected).max() < 1e-9


def test_the_floor_is_the_lower_of_two_planes(about):
    xyz, _ = about(np.array([10.0, 0.05]))
    is_floor = floor_plane(xyz, CONFIG)
    assert xyz[is_floor, 2].max() < 0.05
    on_road = xyz[:, 1] < -0.02
    assert is_floor[on_road].mean() > 0.95


def test_two_planes_are_two_groups():
    rng = np.random.default_rng(9)
    xy = rng.uniform(-0.5, 0.5, (400, 2))
    planes = np.column_stack([xy, np.where(xy[:, 1] > 0.0, KERB_M, 0.0)])
    group = groups_of_neighbours(planes, 6, 0.02)
    large = np.flatnonzero(np.bincount(group) > 100)
    assert len(large) == 2
    assert sorted(float(planes[group == one, 2].mean()) for one in large) == pytest.approx([0.0, KERB_M])


def test_a_wall_between_the_planes_has_no_part_in_the_floor():
    with pytest.raises(NoBoxError, match="normals of more than 85 degrees"):
        wall = np.random.default_rng(1).uniform([-0.5, 0.0, 0.0], [0.5, 0.001, 2.0], (300, 3))
        floor_plane(wall, CONFIG)


def test_the_box_of_a_kerb_lies_along_it(about):
    box = box_at(about, np.array([10.0, 0.1]), "road_boundary", CONFIG)
    assert abs(box.centre[1]) < 0.05
    assert abs(box.u[0]) > np.cos(np.radians(5.0))
    assert box.half_m[1] == 0.25
    assert 0.7 < 2.0 * box.half_m[0] <= 1.0


def test_the_box_of_a_marking_is_its_centre_line(about):
    box = box_at(about, np.array([10.0, -1.35]), "lane_marking", CONFIG)
    assert box.centre[1] == pytest.approx(-1.5, abs=0.02)
    assert abs(box.u[0]) > np.cos(np.radians(4.0))
    assert box.half_m[1] == 0.1


def test_lines_are_followed_to_both_ends_of_the_data(about):
    for kind, y in (("lane_marking", -1.5), ("road_boundary", 0.0)):
        first = box_at(about, np.array([10.0, y]), kind, CONFIG)
        found = follow(about, first, kind, CONFIG)
        assert np.ptp(found.xyz[:, 0]) > 18.0
        inner = (found.xyz[:, 0] > 1.0) & (found.xyz[:, 0] < 19.0)
        assert np.sqrt(np.mean((found.xyz[inner, 1] - y) ** 2)) < 0.04


@pytest.mark.parametrize(
    ("place", "kind", "config", "says"),
    [
        ((10.0, -2.4), "road_boundary", CONFIG, "all road, no boundary"),  # figure 4b
        ((10.0, -3.3), "road_boundary", CONFIG, "no data beyond the road"),
        ((10.0, 0.6), "road_boundary", CONFIG, "all road, no boundary|no road at the edge"),  # figure 4a
        ((10.0, 30.0), "road_boundary", CONFIG, "no points"),
        ((10.0, -2.4), "lane_marking", CONFIG, "no marking in the search area"),  # figure 8d
        ((10.0, -2.4), "lane_marking", Obb2023Config(min_intensity=120, max_intensity=250), "no marking"),
        (
            (10.0, -1.5),
            "lane_marking",
            Obb2023Config(min_intensity=300, max_intensity=400),
            "not in the range 300 to 400",
        ),  # figure 8c
    ],
)
def test_each_failure_has_its_name(about, place, kind, config, says):
    with pytest.raises(NoBoxError, match=says):
        box_at(about, np.array(place), kind, config)


def test_points_without_intensity_have_no_markings():
    xyz, _ = street(length_m=4.0)
    with pytest.raises(NoBoxError, match="no intensity"):
        box_at(discs_of(xyz, None, 0.5), np.array([2.0, -1.5]), "lane_marking", CONFIG)


def test_one_class_of_intensities_proposes_no_range():
    rng = np.random.default_rng(5)
    assert intensity_histogram(rng.normal(40.0, 8.0, 800)).proposed is None
    both = np.concatenate([rng.normal(40.0, 8.0, 800), rng.normal(180.0, 8.0, 150)])
    low, high = intensity_histogram(both).proposed
    assert 70.0 < low < 150.0
    assert high == 65535.0  # open: other paint may be brighter
    assert intensity_histogram(np.zeros(0)).proposed is None


def test_a_range_is_chosen_once_and_open_upwards():
    """Paint that gets brighter along the road, 6 a metre, is followed to its end."""
    rng = np.random.default_rng(10)
    xyz, intensity = street(seed=10)
    paint = np.abs(xyz[:, 1] + 1.5) < 0.075
    intensity = np.where(paint, 120.0 + 6.0 * xyz[:, 0] + rng.normal(0.0, 4.0, len(xyz)), intensity).astype(
        np.float32
    )
    about = discs_of(xyz, intensity, CONFIG.radius_m)
    place = np.array([2.0, -1.5])
    config = with_range(about, place, CONFIG)
    found = follow(about, box_at(about, place, "lane_marking", config), "lane_marking", config)
    assert np.ptp(found.xyz[:, 0]) > 18.0


@pytest.mark.parametrize("wrong", [{"min_intensity": 70.0}, {"min_intensity": 90.0, "max_intensity": 80.0}])
def test_half_a_range_is_refused(wrong):
    with pytest.raises(ConfigError, match="Give two rising numbers"):
        Obb2023Config(**wrong)


def bend(radius_m):
    rng = np.random.default_rng(6)
    n = 120_000
    along, aside = rng.uniform(0.0, 20.0, n), rng.uniform(-1.0, 1.0, n)
    angle, r = along / radius_m, radius_m - aside
    xyz = np.column_stack([r * np.sin(angle), radius_m - r * np.cos(angle), rng.normal(0.0, NOISE_M, n)])
    intensity = np.where(np.abs(aside) < 0.075, 180.0, 40.0) + rng.normal(0.0, 8.0, n)
    return discs_of(xyz, intensity.astype(np.float32), 0.5)


def test_long_and_narrow_fails_in_a_bend_where_long_and_wide_does_not():
    radius_m = 18.0
    about = bend(radius_m)
    place = np.array([radius_m * np.sin(10.0 / radius_m), radius_m * (1.0 - np.cos(10.0 / radius_m))])
    lengths = {}
    for width_m in (0.1, 1.0):
        config = Obb2023Config(search_length_m=3.0, search_width_m=width_m)
        found = follow(about, box_at(about, place, "lane_marking", config), "lane_marking", config)
        lengths[width_m] = np.ptp(found.xyz[:, 0])
    assert lengths[0.1] < 6.0 < 12.0 < lengths[1.0]


def test_a_closed_line_ends_where_it_began():
    rng = np.random.default_rng(7)
    n = 200_000
    angle, r = rng.uniform(0.0, 2.0 * np.pi, n), rng.uniform(7.0, 9.0, n)
    xyz = np.column_stack([r * np.cos(angle), r * np.sin(angle), rng.normal(0.0, NOISE_M, n)])
    intensity = np.where(np.abs(r - 8.0) < 0.075, 180.0, 40.0) + rng.normal(0.0, 8.0, n)
    about = discs_of(xyz, intensity.astype(np.float32), 0.5)
    first = box_at(about, np.array([8.0, 0.0]), "lane_marking", CONFIG)
    found = follow(about, first, "lane_marking", CONFIG)
    assert "returns to itself" in found.stops[0]
    assert len(found.boxes) < 60
