"""Edges of roads under scanners whose noise is larger than what the paper allows a floor: backpacks, matched scans."""

from __future__ import annotations

import numpy as np
import pytest

import linework
from linework.kernels.cells.places import MOST_MORE_POINTS, SMOOTH_FLOOR_M, points_in_noise
from linework.model.points import Points

HALF_M, LENGTH_M = 4.0, 40.0


def noisy_road(seed: int, *, kerb_m: float = 0.0, grass_m: float = 0.0, noise_m: float = 0.04) -> Points:
    """Return a road 8 m wide of 600 points per m², with a kerb and footway, or with grass, on both sides."""
    rng = np.random.default_rng(seed)
    n = int(600 * LENGTH_M * 18)
    s, o = rng.uniform(0.0, LENGTH_M, n), rng.uniform(-9.0, 9.0, n)
    beyond = np.maximum(np.abs(o) - HALF_M, 0.0)
    z = -0.025 * np.minimum(np.abs(o), HALF_M) + kerb_m * np.clip(beyond / 0.02, 0.0, 1.0)
    z = z + (beyond > 0.0) * rng.gamma(2.0, 0.5 * grass_m + 1e-9, n) + rng.normal(0.0, noise_m, n)
    brightness = np.where(beyond > 0.0, 150.0, 100.0) * rng.lognormal(0.0, 0.15, n)
    xyz = np.column_stack([s, o, z]) + np.array([500_000.0, 5_600_000.0, 100.0])
    return Points(xyz, intensity=np.round(10.0 * brightness).astype(np.float32), crs="EPSG:25832")


def found_m(points: Points) -> tuple[float, float]:
    """Return metres of boundaries within 10 cm of the edges of the road, and of others."""
    lines = linework.extract(points, kinds=("road_boundary",), adjust=False)
    ends = np.delete(np.arange(len(lines.xyz) - 1), lines.offsets[1:-1] - 1)
    middle = 0.5 * (lines.xyz[ends, 1] + lines.xyz[ends + 1, 1]) - 5_600_000.0
    length = np.hypot(*(lines.xyz[ends + 1] - lines.xyz[ends])[:, :2].T)
    is_edge = np.abs(np.abs(middle) - HALF_M) <= 0.10
    return float(length[is_edge].sum()), float(length[~is_edge].sum())


@pytest.mark.filterwarnings("ignore:.*not taken for road:linework.errors.LineworkWarning")
@pytest.mark.parametrize(
    ("kerb_m", "grass_m", "noise_m", "share"),
    [(0.12, 0.0, 0.04, 0.7), (0.0, 0.08, 0.04, 0.9), (0.04, 0.0, 0.02, 0.9)],
    ids=["kerb of 12 cm", "grass", "kerb twice as high as the noise"],
)
def test_edges_are_found_where_all_floors_are_noisy(kerb_m, grass_m, noise_m, share):
    right, wrong = found_m(noisy_road(9881, kerb_m=kerb_m, grass_m=grass_m, noise_m=noise_m))
    assert right >= share * 2.0 * LENGTH_M
    assert wrong <= 2.0


def test_a_noisy_ground_without_edges_has_none():
    rng = np.random.default_rng(9882)
    points = noisy_road(9882)
    flat = Points(
        points.xyz,
        intensity=np.round(10.0 * rng.lognormal(4.6, 0.15, len(points))).astype(np.float32),
        crs="EPSG:25832",
    )
    assert found_m(flat) == (0.0, 0.0)


def test_points_used_grow_with_the_variance_of_the_noise():
    assert points_in_noise(0.5 * SMOOTH_FLOOR_M, 300) == 300
    assert points_in_noise(2.0 * SMOOTH_FLOOR_M, 300) == 1200
    assert points_in_noise(20.0 * SMOOTH_FLOOR_M, 300) == 300 * MOST_MORE_POINTS
