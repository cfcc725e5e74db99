"""Least-squares matching of profiles, their sampling, and the smoother, against slow obvious twins."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from linework.kernels.images.line_matching import (
    CORRELATION,
    GAIN,
    MATCH_SIGMA,
    OFFSET,
    SHIFT,
    blurred,
    grey_profile_across,
    integral_of,
    match_profile,
)
from linework.kernels.tracking.smooth import smooth_beside

STEP_M, PIXEL_M = 0.005, 0.02


def template() -> np.ndarray:
    """A stripe 0.12 m wide over a step of the road's own grey value."""
    s = STEP_M * np.arange(-160, 161)
    return np.where(np.abs(s) < 0.06, 150.0, np.where(s > 0.0, 80.0, 70.0))


@pytest.mark.parametrize("shift", [-0.043, 0.0, 0.0311])
def test_a_shifted_profile_is_found_whatever_its_gain_and_offset(shift: float) -> None:
    total = integral_of(template())
    s = PIXEL_M * np.arange(-25, 26)
    seen = 40.0 + 0.6 * np.array([blurred(total, STEP_M, x - shift, PIXEL_M)[0] for x in s])
    found = match_profile(seen, PIXEL_M, total, STEP_M, 0.2, (0.0, 0.1), 0.1)
    assert found[SHIFT] == pytest.approx(shift, abs=1e-4)
    assert found[CORRELATION] == pytest.approx(1.0, abs=1e-6)
    assert (found[GAIN], found[OFFSET]) == pytest.approx((0.6, 40.0), abs=1e-3)


def test_sigma_says_how_far_shifts_are_off() -> None:
    total, rng = integral_of(template()), np.random.default_rng(1)
    s = PIXEL_M * np.arange(-25, 26)
    clean = np.array([blurred(total, STEP_M, x - 0.013, PIXEL_M)[0] for x in s])
    found = [
        match_profile(clean + rng.normal(0.0, 6.0, len(s)), PIXEL_M, total, STEP_M, 0.2, (0.0, 0.06), 0.1)
        for _ in range(200)
    ]
    ratio = [(f[SHIFT] - 0.013) / f[MATCH_SIGMA] for f in found]
    assert 0.7 < np.sqrt(np.mean(np.square(ratio))) < 1.3


def test_a_flat_profile_is_no_match() -> None:
    total = integral_of(template())
    assert match_profile(np.full(51, 90.0), PIXEL_M, total, STEP_M, 0.2, (0.0, 0.1), 0.1)[CORRELATION] == 0.0


def test_blurred_is_the_mean_over_a_pixel() -> None:
    values = np.random.default_rng(2).uniform(0.0, 200.0, 321)
    total = integral_of(values)
    for place, n in ((0.0, 5), (0.1, 9), (-0.35, 3)):
        middle = 160 + round(place / STEP_M)
        mean = values[middle - n // 2 : middle + n // 2 + 1].mean()
        assert blurred(total, STEP_M, place, n * STEP_M)[0] == pytest.approx(mean)


def test_profiles_are_bilinear_samples_where_places_project() -> None:
    image = np.random.default_rng(3).integers(0, 255, (60, 80)).astype(np.uint8)
    to_pixel = np.array([[50.0, 0.0, 40.0, 0.0], [0.0, 50.0, 30.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    frame = np.array([[0.1, 0.2, 2.0], [0.0, 0.6, 0.8], [1.0, 0.0, 0.0]])
    seen = grey_profile_across(image, to_pixel, frame, 0.0, (0.3, 3), 0.05, 6)
    along = 0.3 * ((np.arange(3) + 0.5) / 3 - 0.5)
    places = frame[0] + along[:, None, None] * frame[1] + (0.05 * np.arange(-6, 7))[:, None] * frame[2]
    col, row = 50.0 * places[..., 0] / places[..., 2] + 40.0, 50.0 * places[..., 1] / places[..., 2] + 30.0
    twin = map_coordinates(image.astype(float), [row, col], order=1).mean(axis=0)
    np.testing.assert_allclose(seen, twin, atol=1e-9)


def test_outside_of_the_image_is_not_a_number() -> None:
    image = np.full((20, 20), 100, dtype=np.uint8)
    to_pixel = np.array([[10.0, 0.0, 10.0, 0.0], [0.0, 10.0, 10.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    seen = grey_profile_across(
        image, to_pixel, np.array([[0.0, 0, 1], [0, 1, 0], [1, 0, 0]]), 0.0, (0.0, 1), 0.5, 4
    )
    s = 0.5 * np.arange(-4, 5)
    np.testing.assert_array_equal(np.isnan(seen), (s < -1.0) | (s > 0.9))


def test_across_and_height_come_out_of_two_images_that_each_know_one_sum() -> None:
    n, spacing = 60, 0.25
    t = spacing * np.arange(n)
    across, up = 0.02 * np.sin(t / 5.0), 0.01 * t / 15.0
    information, right = np.zeros((n, 2, 2)), np.zeros((n, 2))
    for lift in (-1.2, -1.6):
        h = np.array([1.0, lift])
        information += np.outer(h, h) / 0.001**2
        right += h * ((across + lift * up) / 0.001**2)[:, None]
    moved, covariance = smooth_beside(information, right, spacing, 5e-6, 3e-5)
    np.testing.assert_allclose(moved[5:-5], np.column_stack([across, up])[5:-5], atol=0.003)
    assert (covariance[:, 0, 0] > 0.0).all() and covariance[30, 0, 0] < covariance[0, 0, 0]
