"""Heights between known cells, against planes that are known exactly."""

import numpy as np
import pytest

from linework.kernels.cells import planes

RADII = np.array([2, 4, 8, 16], np.int64)


def filled(height, known, wanted, halo=16, base=0, most_sigma=0.15):
    height, known = np.pad(height, halo, constant_values=np.nan), np.pad(known, halo)
    table = planes.summed_moments(height.astype(np.float32), known, base)
    return planes.interpolated(table, wanted, RADII, 2, most_sigma, halo, base)


def plane(n=60):
    rows, cols = np.mgrid[:n, :n]
    return (0.1 * cols - 0.04 * rows + 3.0).astype(np.float32)


def test_a_plane_with_holes_comes_back():
    height = plane()
    known = np.random.default_rng(1).random(height.shape) < 0.5
    known[20:26, 20:26] = False
    value, sigma = filled(height, known, ~known)
    inner = np.zeros_like(known)
    inner[5:-5, 5:-5] = True
    wanted = ~known & inner
    assert value[wanted] == pytest.approx(height[wanted], abs=2e-3)
    assert sigma[wanted].max() < 1e-3
    assert np.isnan(value[known]).all()


def test_beside_the_known_cells_nothing_is_known():
    height = plane()
    known = np.zeros_like(height, dtype=bool)
    known[:, :30] = True
    value, _ = filled(height, known, ~known)
    assert np.isnan(value[:, 31:]).all()


def test_across_a_wall_nothing_is_sure():
    height = np.where(np.arange(60) < 30, 0.0, 2.0) + np.zeros((60, 1))
    known = np.ones((60, 60), dtype=bool)
    known[:, 28:32] = False
    value, _ = filled(height, known, ~known)
    assert np.isnan(value).all()


def test_neither_base_nor_window_changes_a_bit():
    rng = np.random.default_rng(2)
    height = (rng.normal(0, 0.02, (80, 80)) + plane(80)).astype(np.float32)
    known = rng.random(height.shape) < 0.3
    expected = filled(height, known, ~known)
    for base in (-700, 3, 412):
        for one, other in zip(filled(height, known, ~known, base=base), expected, strict=True):
            assert np.array_equal(one, other, equal_nan=True)
    for one, other in zip(filled(height, known, ~known, halo=33), expected, strict=True):
        assert np.array_equal(one, other, equal_nan=True)
