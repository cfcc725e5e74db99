"""Peaks of a Radon image: where it equals its dilation."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.scenes.effort import examples

from linework.kernels.radon import peaks as kernels
from linework.methods.radon.peaks import dilate, find_peaks
from linework.methods.radon.transform import (
    RadonImage,
    evenly_spaced_angles,
    radon_of_cells,
    radon_transform,
    rho_bins,
)
from linework.model.grid import Grid, Image

ANGLES = evenly_spaced_angles(2.0)
RHO = rho_bins(7.0, 0.2)
WINDOWS = {"theta_window_rad": math.radians(20), "rho_window_m": 1.0}


def radon_of_line(theta, rho, low=-4.0, high=4.0):
    """Cells of 0.2 m under a line, and their Radon transform."""
    t = np.arange(low, high, 0.01)
    x = rho * math.cos(theta) - t * math.sin(theta)
    y = rho * math.sin(theta) + t * math.cos(theta)
    cells = np.unique(np.floor(np.stack([x, y], axis=1) / 0.2), axis=0)
    x, y = (0.2 * (cells + 0.5)).T.copy()
    return radon_of_cells(
        x, y, np.ones(len(x)), cell_width_m=0.2, cell_height_m=0.2,
        angles_rad=ANGLES, rho_step_m=0.2, rho_max_m=7.0,
    )  # fmt: skip


@settings(max_examples=examples(100), deadline=None)
@given(st.floats(0.0, 3.1415), st.floats(-3.5, 3.5), st.floats(-3.0, 0.0))
def test_finds_a_line_within_half_a_cell_at_its_ends(theta, rho, low):
    values = radon_of_line(theta, rho, low, low + 6.0)
    peaks = find_peaks(values, ANGLES, RHO, threshold=2.0, **WINDOWS)
    ends = np.array([low, low + 6.0])
    x = rho * math.cos(theta) - ends * math.sin(theta)
    y = rho * math.sin(theta) + ends * math.cos(theta)
    off = x * math.cos(peaks.theta_rad[0]) + y * math.sin(peaks.theta_rad[0]) - peaks.rho_m[0]
    # a line along a cell's edge is seen half a cell (0.1 m) off; the staircase turns it a little
    assert np.abs(off).max() < 0.25
    assert np.abs(off.mean()) < 0.15


def slow_dilation(values, angles, half_window, half_bins):
    """The rectangle of the two line elements, bin by bin, on an image that goes on for ever."""
    n, m = values.shape
    out = np.zeros_like(values)
    for i in range(n):
        for j in range(m):
            seen = []
            for turn in (-1, 0, 1):
                for k in range(n):
                    if abs(angles[k] + turn * math.pi - angles[i]) <= half_window * (1 + 1e-9):
                        row = values[k] if turn == 0 else values[k, ::-1]
                        seen.append(row[max(0, j - half_bins) : j + half_bins + 1].max())
            out[i, j] = max(seen)
    return out


@settings(max_examples=examples(40), deadline=None)
@given(st.integers(0, 1000), st.integers(1, 9), st.integers(0, 4), st.integers(0, 3), st.floats(0, 1.5))
def test_dilation_equals_its_slow_twin_across_the_half_turn(seed, n, n_half, half_bins, half_window):
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.choice(180, n, replace=False)) * (math.pi / 180)
    values = rng.integers(0, 9, (n, 2 * n_half + 1)).astype(float)
    expected = slow_dilation(values, angles, half_window, half_bins)
    np.testing.assert_array_equal(kernels.dilate_radon(values, angles, half_window, half_bins), expected)


@settings(max_examples=examples(25), deadline=None)
@given(st.integers(0, 1000))
def test_every_peak_equals_its_dilation_and_none_is_in_anothers_window(seed):
    rng = np.random.default_rng(seed)
    values = rng.integers(0, 5, (12, 9)).astype(float)
    angles = evenly_spaced_angles(15.0)
    half_window, half_bins = math.radians(31), 2
    dilated = slow_dilation(values, angles, half_window, half_bins)
    expected = {tuple(v) for v in np.argwhere((values == dilated) & (values > 2.0))}
    peaks = find_peaks(
        values, angles, rho_bins(0.8, 0.2), threshold=2.0,
        theta_window_rad=2 * half_window, rho_window_m=0.4 * half_bins,
    )  # fmt: skip
    assert 1 <= len(peaks) <= len(expected)
    assert set(peaks.strength_m) <= {values[p] for p in expected}
    assert np.all(np.diff(peaks.strength_m) <= 0)


def test_compiled_and_plain_python_agree(monkeypatch):
    values = radon_of_line(0.7, 1.3) + radon_of_line(3.12, -2.0)
    half_window, half_bins = math.radians(10), 2
    compiled = kernels.peaks(values, ANGLES, RHO, 2.0, half_window, half_bins)
    for name in ("wrapped_angle", "reach", "dilate_radon", "flood", "middle", "refine"):
        monkeypatch.setattr(kernels, name, getattr(kernels, name).py_func)
    plain = kernels.peaks.py_func(values, ANGLES, RHO, 2.0, half_window, half_bins)
    assert len(compiled) >= 2
    np.testing.assert_allclose(plain, compiled, atol=1e-12)


def test_a_line_across_the_half_turn_is_one_peak():
    # theta just below pi: its Radon peak lies on both ends of the angles
    peaks = find_peaks(radon_of_line(math.pi - 0.012, 2.1), ANGLES, RHO, threshold=4.0, **WINDOWS)
    assert len(peaks) == 1
    turned = peaks.theta_rad[0] > 1.0
    assert abs(peaks.theta_rad[0] - (math.pi if turned else 0.0)) < 0.03
    assert peaks.rho_m[0] == pytest.approx(2.1 if turned else -2.1, abs=0.1)


def test_a_plateau_is_one_peak_in_its_middle():
    values = np.zeros((9, 11))
    values[3:6, 2:9] = 4.0
    angles = evenly_spaced_angles(20.0)
    peaks = find_peaks(
        values, angles, rho_bins(1.0, 0.2), threshold=1.0, theta_window_rad=0.8, rho_window_m=0.4
    )
    assert len(peaks) == 1
    assert peaks.theta_rad[0] == pytest.approx(angles[4])
    assert peaks.rho_m[0] == pytest.approx(0.0)


def test_a_flat_image_is_one_peak_and_an_empty_one_none():
    angles, rho = evenly_spaced_angles(10.0), rho_bins(1.0, 0.2)
    flat = np.full((len(angles), len(rho)), 3.0)
    assert len(find_peaks(flat, angles, rho, threshold=1.0, **WINDOWS)) == 1
    assert len(find_peaks(0 * flat, angles, rho, threshold=0.0, **WINDOWS)) == 0
    assert len(find_peaks(flat, angles, rho, threshold=3.0, **WINDOWS)) == 0


def test_peaks_come_sorted_and_repeat():
    values = radon_of_line(0.4, 2.0) + radon_of_line(1.9, -1.0, -2.0, 2.0)
    first = find_peaks(values, ANGLES, RHO, threshold=2.0, **WINDOWS)
    again = find_peaks(values.copy(), ANGLES, RHO, threshold=2.0, **WINDOWS)
    assert len(first) >= 2
    assert np.all(np.diff(first.strength_m) <= 0)
    np.testing.assert_array_equal(first.theta_rad, again.theta_rad)
    np.testing.assert_array_equal(first.rho_m, again.rho_m)


def test_dilated_image_keeps_its_axes_and_covers_the_original():
    rail = np.zeros((20, 51), dtype=bool)
    rail[5] = True
    radon = radon_transform(Image(rail, Grid(0.0, 4.0, 0.2, 0.2, 20, 51)), ANGLES)
    dilated = dilate(radon, **WINDOWS)
    assert isinstance(dilated, RadonImage)
    assert np.all(dilated.values >= radon.values)
    assert dilated.values.max() == radon.values.max()
    assert len(find_peaks(radon.values, radon.angles_rad, radon.rho_m, threshold=5.0, **WINDOWS)) == 1


def test_values_are_not_changed():
    values = radon_of_line(0.4, 2.0)
    kept = values.copy()
    find_peaks(values, ANGLES, RHO, threshold=2.0, **WINDOWS)
    np.testing.assert_array_equal(values, kept)


@pytest.mark.parametrize(
    ("angles", "windows", "message"),
    [
        ([0.2, 0.1], WINDOWS, "rise"),
        ([0.0, 3.2], WINDOWS, "rise"),
        ([0.0, 0.1], {"theta_window_rad": 4.0, "rho_window_m": 1.0}, "windows"),
        ([0.0, 0.1], {"theta_window_rad": 0.1, "rho_window_m": -1.0}, "windows"),
        ([0.0], WINDOWS, "shape"),
    ],
)
def test_refuses_what_makes_no_sense(angles, windows, message):
    with pytest.raises(ValueError, match=message):
        find_peaks(np.zeros((2, 3)), np.array(angles), rho_bins(0.2, 0.2), threshold=1.0, **windows)
