"""Heights from the points around a place: the ground, a kerb's top, a rail, a cable; and how sure they are."""

from __future__ import annotations

import numpy as np
import pytest

from linework.workbench.views.height_at import (
    edge_height,
    ground_height,
    hanging_height,
    kerb_top_height,
    standing_height,
)


def scene(rng, n, height, noise=0.004, reach=0.3):
    """Return points around a place: height(x, y) and noise; the road is level, at 0."""
    xy = rng.uniform(-reach, reach, (n, 2))
    z = height(*xy.T) + rng.normal(0.0, noise, n)
    return np.column_stack([xy, z, z])


def test_ground_on_a_slope_with_honest_sigma():
    rng = np.random.default_rng(0)
    errors = []
    for _ in range(300):
        points = scene(rng, 40, lambda x, y: 0.03 * x + 0.06 * y)
        height, sigma = ground_height(points)
        errors.append((height, sigma))
    height, sigma = np.array(errors).T
    assert np.sqrt(np.mean(height**2)) < 0.002
    # Sigma holds what scans do not share besides, which is not in this scene
    assert 0.1 < np.sqrt(np.mean((height / sigma) ** 2)) < 1.2


def test_a_wheel_over_the_ground_does_not_lift_it():
    rng = np.random.default_rng(1)
    ground = scene(rng, 30, lambda x, y: 0.0 * x)
    wheel = scene(rng, 60, lambda x, y: 0.2 + x)
    assert ground_height(np.concatenate([ground, wheel]))[0] == pytest.approx(0.0, abs=0.01)


def kerb(rng):
    """Return a road and a footway 12 cm above it; the face stands at the place."""
    face = np.column_stack(
        [rng.uniform(0.0, 0.01, 30), rng.uniform(-0.3, 0.3, 30), rng.uniform(0.0, 0.12, 30)]
    )
    plan = scene(rng, 300, lambda x, y: np.where(x < 0.0, 0.0, 0.12))
    return np.concatenate([plan, np.column_stack([face, face[:, 2]])])


def test_foot_and_top_of_a_kerb():
    points = kerb(np.random.default_rng(2))
    assert edge_height(points)[0] == pytest.approx(0.0, abs=0.006)
    assert kerb_top_height(points)[0] == pytest.approx(0.12, abs=0.008)


def test_a_hedge_or_a_car_bounds_no_carriageway():
    rng = np.random.default_rng(7)
    roof = scene(rng, 400, lambda x, y: 1.0 + 0.0 * x)
    assert edge_height(roof) is None
    assert edge_height(np.concatenate([roof, kerb(rng)]))[0] == pytest.approx(0.0, abs=0.006)


def test_where_no_kerb_is_its_top_is_the_ground():
    points = scene(np.random.default_rng(3), 100, lambda x, y: 0.0 * x)
    assert kerb_top_height(points)[0] == pytest.approx(0.0, abs=0.003)


def test_what_is_higher_than_a_kerb_is_no_top_of_one():
    rng = np.random.default_rng(8)
    roof = scene(rng, 400, lambda x, y: 1.0 + 0.0 * x)
    assert kerb_top_height(roof) is None
    assert kerb_top_height(np.concatenate([roof, kerb(rng)]))[0] == pytest.approx(0.12, abs=0.008)


def test_top_of_a_rail_is_no_stray_point():
    rng = np.random.default_rng(4)
    rail = np.column_stack([np.zeros(60), rng.uniform(-0.3, 0.3, 60), rng.uniform(0.45, 0.75, 60)])
    stray = np.array([[0.1, 0.1, 1.05]])
    up = np.concatenate([rail, stray])
    points = np.concatenate([scene(rng, 50, lambda x, y: 0.0 * x), np.column_stack([up, up[:, 2]])])
    height, _ = standing_height(points, 1.3, np.nan)
    assert height == pytest.approx(0.75, abs=0.03)
    assert standing_height(scene(rng, 50, lambda x, y: 0.0 * x), 1.3, np.nan) is None


def test_of_two_cables_the_one_that_was_there():
    rng = np.random.default_rng(5)
    z = np.concatenate([rng.normal(6.0, 0.02, 8), rng.normal(7.5, 0.02, 8)])
    points = np.column_stack([rng.uniform(-0.1, 0.1, (16, 2)), z, z])
    assert hanging_height(points, np.nan)[0] == pytest.approx(6.0, abs=0.03)
    assert hanging_height(points, 7.4)[0] == pytest.approx(7.5, abs=0.03)


def test_of_too_few_points_nothing_is_said():
    few = scene(np.random.default_rng(6), 3, lambda x, y: 0.0 * x)
    assert ground_height(few) is None
    assert edge_height(few) is None
    assert kerb_top_height(few) is None
    assert standing_height(few, 1.3, np.nan) is None
    assert hanging_height(few, np.nan) is None


def test_a_single_scan_line_gives_a_height():
    x = np.linspace(-0.3, 0.3, 20)
    points = np.column_stack([x, np.zeros(20), 0.02 * x, 0.02 * x])
    assert ground_height(points)[0] == pytest.approx(0.0, abs=0.002)
