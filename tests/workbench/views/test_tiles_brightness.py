"""Asphalt is equally bright at any distance from the van once intensities are normalised."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from linework.model.grid import Bounds
from linework.workbench.views.patches import ASPHALT, AsphaltLevel, _fitted


def falling(distance_m):
    return 20_000.0 / np.hypot(distance_m, 2.2)


def test_asphalt_is_level_and_paint_stands_out():
    way = cKDTree(np.column_stack([np.zeros(200), np.linspace(-20.0, 84.0, 200)]))
    level = AsphaltLevel(way, falling(np.arange(80) * 0.5 + 0.25))
    rng = np.random.default_rng(0)
    x, y = rng.uniform(1.0, 30.0, (2, 4000)).astype(np.float32)
    paint = rng.random(4000) < 0.1
    recorded = (falling(x) * np.where(paint, 3.0, 1.0)).astype(np.uint16)
    normal = level.normalised(x, y, recorded, Bounds(0.0, 0.0, 64.0, 64.0)) / ASPHALT
    assert np.abs(normal[~paint] - 1.0).max() < 0.05
    assert np.abs(normal[paint] - 3.0).max() < 0.15


def test_grass_beside_the_road_does_not_pass_for_asphalt():
    rng = np.random.default_rng(1)
    values = [rng.normal(falling(0.5 * k + 0.25), 50.0, 500) for k in range(12)]
    values += [rng.normal(9000.0, 50.0, 500) for _ in range(8)] + [np.zeros(0)] * 60
    fitted = _fitted(cKDTree(np.zeros((1, 2))), values)
    assert (np.diff(fitted.level) <= 0.0).all()
    assert np.abs(fitted.level[2:10] / falling(np.arange(2, 10) * 0.5 + 0.25) - 1.0).max() < 0.2
    assert fitted.level[15] < 4000.0
    assert _fitted(cKDTree(np.zeros((1, 2))), [np.zeros(0)] * 80) is None
