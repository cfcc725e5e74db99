"""Edges of a pavement above its verge: what is seen from above hides the ground behind the edge."""

import numpy as np
import pytest

from linework import Points, Trajectory, extract
from linework.kernels.boundaries.hidden_faces import END_SIGMA, LEAST_LAST, last_points

#: Height of the scanner, its distance from the edge, and where the edge is. [m]
SCANNER_M, AWAY_M, EDGE_Y = 2.2, 6.0, 8.0


def road_above_verge(drop_m, verge_noise_m, per_m2=150, seed=1):
    """Points of a road of 60 m from y = 0, which ends `drop_m` above its verge, as a scanner at its far side sees it."""
    rng = np.random.default_rng(seed)
    n = 60 * 11 * per_m2
    x, y = rng.uniform(0.0, 60.0, n), rng.uniform(0.0, 11.0, n)
    is_road = y < EDGE_Y
    seen = is_road | (y > EDGE_Y + drop_m * AWAY_M / SCANNER_M)
    z = np.where(is_road, rng.normal(0.0, 0.004, n), -drop_m + rng.normal(0.0, verge_noise_m, n))
    intensity = np.where(is_road, 40.0, 80.0) + rng.normal(0.0, 4.0, n)
    xyz = np.column_stack([x, y, z])[seen]
    return Points(xyz, intensity=np.rint(100.0 * intensity[seen]).astype(np.uint16))


@pytest.mark.parametrize("verge_noise_m", [0.004, 0.02], ids=["smooth verge", "rough verge"])
def test_a_pavement_above_its_verge_ends_where_its_points_end(verge_noise_m):
    path = np.column_stack([np.linspace(0.0, 60.0, 61), np.full(61, EDGE_Y - AWAY_M), np.full(61, SCANNER_M)])
    points = road_above_verge(0.10, verge_noise_m)
    found = extract(points, kinds=("road_boundary",), trajectory=Trajectory(np.linspace(0.0, 6.0, 61), path))
    places = found.xyz[np.abs(found.xyz[:, 1] - EDGE_Y) < 0.5]
    assert np.ptp(places[:, 0]) > 50.0, "it is found"
    # The shadow is 27 cm wide: its middle lies 14 cm off
    assert abs(np.median(places[:, 1]) - EDGE_Y) < 0.02
    assert np.percentile(np.abs(places[:, 1] - EDGE_Y), 90) < 0.04


@pytest.mark.parametrize("slope", [-0.2, 0.0, 0.15])
def test_the_end_of_a_surface_is_that_of_its_last_points(slope):
    ends, turns = [], []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        u = rng.uniform(-0.5, 0.5, 60)
        end, turn, spacing = last_points(np.column_stack([u, 0.07 + slope * u + rng.uniform(0.0, 0.3, 60)]))
        ends.append((end - 0.07) / spacing)
        turns.append(turn - slope)
    assert abs(np.mean(ends)) < 0.5, "no nearer and no farther"
    assert np.std(ends) < 1.3 * END_SIGMA
    assert np.std(turns) < 0.08


def test_a_stray_before_the_end_of_a_surface_does_no_harm():
    rng = np.random.default_rng(3)
    points = rng.uniform((-0.5, 0.0), (0.5, 0.3), (80, 2))
    stray = np.concatenate([points, [[0.1, -0.2]]])
    assert abs(last_points(stray)[0] - last_points(points)[0]) < 0.02
    assert np.isinf(last_points(points[: LEAST_LAST - 1])[0])
