"""The Radon transform equals its definition: strip integrals of an image of rectangles."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage.transform import radon as skimage_radon
from tests.scenes.effort import examples

from linework.errors import InputError
from linework.kernels.radon import transform as kernels
from linework.methods.radon.transform import (
    evenly_spaced_angles,
    radon_of_cells,
    radon_transform,
    rho_bins,
)
from linework.model.grid import Grid, Image


def strip_areas(polygon, weight, angle, rho_m, step, long=1000.0):
    """The obvious twin: clip a cell's polygon by each strip and measure what is left."""
    normal = np.array([math.cos(angle), math.sin(angle)])
    along = np.array([-normal[1], normal[0]])
    out = np.zeros(len(rho_m))
    for k, rho in enumerate(rho_m):
        a, b = (rho - 0.5 * step) * normal, (rho + 0.5 * step) * normal
        strip = shapely.Polygon([a - long * along, b - long * along, b + long * along, a + long * along])
        out[k] = weight * shapely.area(shapely.intersection(polygon, strip)) / step
    return out


def twin(image, angles, rho_m, step, centre):
    grid = image.grid
    out = np.zeros((len(angles), len(rho_m)))
    for row, col in np.argwhere(np.nan_to_num(image.values) != 0):
        corners = grid.to_world(
            np.array([row, row, row + 1, row + 1]), np.array([col, col + 1, col + 1, col])
        )
        polygon = shapely.Polygon(corners - centre)
        for i, angle in enumerate(angles):
            out[i] += strip_areas(polygon, float(image.values[row, col]), angle, rho_m, step)
    return out


@st.composite
def images(draw):
    n_rows, n_cols = draw(st.integers(1, 6)), draw(st.integers(1, 6))
    values = np.zeros((n_rows, n_cols))
    for _ in range(draw(st.integers(0, 4))):
        cell = draw(st.integers(0, n_rows - 1)), draw(st.integers(0, n_cols - 1))
        values[cell] = draw(st.floats(-2.0, 5.0))
    grid = Grid(
        draw(st.floats(-50.0, 50.0)), draw(st.floats(-50.0, 50.0)),
        draw(st.floats(0.05, 0.6)), draw(st.floats(0.05, 0.6)), n_rows, n_cols,
        draw(st.sampled_from([0.0, 90.0, -45.0]) | st.floats(-90.0, 90.0)),
    )  # fmt: skip
    return Image(values, grid)


ANGLES = st.lists(
    st.sampled_from([0.0, math.pi / 2, math.pi / 4, 0.75 * math.pi]) | st.floats(0.0, 3.1415),
    min_size=1, max_size=3,
)  # fmt: skip


@settings(max_examples=examples(60), deadline=None)
@given(images(), ANGLES, st.floats(0.08, 1.0))
def test_equals_clipped_polygons(image, angles, step):
    radon = radon_transform(image, angles, step)
    expected = twin(image, radon.angles_rad, radon.rho_m, step, radon.centre_xy)
    np.testing.assert_allclose(radon.values, expected, atol=1e-6)


@settings(max_examples=examples(60), deadline=None)
@given(images(), ANGLES, st.floats(0.08, 1.0))
def test_sum_over_rho_is_the_same_at_every_angle(image, angles, step):
    radon = radon_transform(image, angles, step)
    total = image.values.sum() * image.grid.cell_width_m * image.grid.cell_height_m
    np.testing.assert_allclose(radon.values.sum(axis=1) * step, total, atol=1e-9)


@settings(max_examples=examples(30), deadline=None)
@given(images(), st.floats(0.0, 3.1), st.floats(0.1, 1.0))
def test_half_a_turn_reverses_rho(image, angle, step):
    rows, cols = np.nonzero(image.values)
    arguments = {
        "cell_width_m": image.grid.cell_width_m, "cell_height_m": image.grid.cell_height_m,
        "rho_step_m": step, "rho_max_m": 6.0,
    }  # fmt: skip
    x, y = cols * image.grid.cell_width_m - 1.0, 1.0 - rows * image.grid.cell_height_m
    weights = image.values[rows, cols]
    here = radon_of_cells(x, y, weights, angles_rad=np.array([angle]), **arguments)
    there = radon_of_cells(x, y, weights, angles_rad=np.array([angle + math.pi]), **arguments)
    np.testing.assert_allclose(here[0], there[0, ::-1], atol=1e-9)


def test_compiled_and_plain_python_agree(monkeypatch):
    rng = np.random.default_rng(3)
    x, y, w = rng.uniform(-3, 3, 40), rng.uniform(-3, 3, 40), rng.uniform(0, 2, 40)
    angles = evenly_spaced_angles(7.5)
    # n_half = 10 bins of 0.17 m reach 1.8 m: many cells project partly or wholly beyond the bins
    arguments = (x, y, w, (0.2, 0.35, 0.3), angles, 0.17, 10)
    compiled = kernels.radon(*arguments)
    for name in ("below", "project", "add_cell"):
        monkeypatch.setattr(kernels, name, getattr(kernels, name).py_func)
    np.testing.assert_allclose(kernels.radon.py_func(*arguments), compiled, atol=1e-12)
    full = kernels.radon(x, y, w, (0.2, 0.35, 0.3), angles, 0.17, 40)
    np.testing.assert_allclose(compiled, full[:, 30:-30], atol=1e-12)


def smooth_image(n_rows, n_cols):
    row, col = np.mgrid[:n_rows, :n_cols]
    image = np.zeros((n_rows, n_cols))
    for r, c, size, height in [(0.3, 0.4, 6.0, 1.0), (0.6, 0.7, 9.0, 0.6), (0.7, 0.25, 4.0, 1.4)]:
        image += height * np.exp(-((row - r * n_rows) ** 2 + (col - c * n_cols) ** 2) / (2 * size**2))
    return image


@pytest.mark.parametrize("shape", [(101, 101), (90, 130)])
def test_agrees_with_scikit_image_on_smooth_images(shape):
    image = smooth_image(*shape)
    degrees = np.arange(0.0, 180.0, 7.5)
    theirs = skimage_radon(image, degrees, circle=False).T
    ours = radon_transform(
        Image(image, Grid(0.0, 0.0, 1.0, 1.0, *shape)), np.radians(degrees), rho_step_m=1.0
    )
    # Theirs is padded to n columns whose middle is column n // 2, and so is the image's row or column
    # n // 2: half a cell off our centre along an axis with an even number of cells.
    off_x, off_y = (0.0 if shape[1] % 2 else 0.5), (0.0 if shape[0] % 2 else -0.5)
    rho = np.arange(theirs.shape[1]) - theirs.shape[1] // 2
    for i, angle in enumerate(ours.angles_rad):
        shift = off_x * math.cos(angle) + off_y * math.sin(angle)
        resampled = np.interp(rho + shift, ours.rho_m, ours.values[i])
        assert np.linalg.norm(resampled - theirs[i]) < 0.02 * np.linalg.norm(theirs[i]), degrees[i]


def test_rho_zero_is_the_middle_of_the_grid_in_the_world():
    grid = Grid(500_000.0, 5_000_000.0, 0.5, 0.25, 4, 8, rotation_deg=30.0)
    values = np.zeros(grid.shape)
    values[1, 6] = 1.0
    radon = radon_transform(Image(values, grid), np.radians([0.0, 90.0]), 0.01)
    east, north = grid.to_world(np.array(1.5), np.array(6.5)) - radon.centre_xy
    peaks = radon.rho_m @ radon.values.T / radon.values.sum(axis=1)
    np.testing.assert_allclose(peaks, [east, north], atol=1e-9)


def test_nan_cells_count_nothing():
    values = np.array([[np.nan, 2.0]])
    radon = radon_transform(Image(values, Grid(0.0, 1.0, 1.0, 1.0, 1, 2)), [0.0])
    assert radon.values.sum() == pytest.approx(2.0)


@pytest.mark.parametrize("angle", [-0.1, math.pi, math.nan])
def test_refuses_angles_outside_half_a_turn(angle):
    with pytest.raises(ValueError, match="theta < pi"):
        radon_transform(Image(np.ones((1, 1)), Grid(0.0, 0.0, 1.0, 1.0, 1, 1)), [angle])


def test_refuses_a_radon_image_that_would_not_fit():
    image = Image(np.zeros((1, 1), dtype=bool), Grid(0.0, 0.0, 1.0, 1.0, 1, 1))
    with pytest.raises(InputError, match="fewer angles"):
        radon_transform(image, np.linspace(0, 3, 1000), rho_step_m=1e-6)


def test_bins_cover_and_are_symmetric():
    for rho_max in (0.0, 0.1, 0.3, 0.31, 7.07):
        rho = rho_bins(rho_max, 0.2)
        np.testing.assert_array_equal(rho, -rho[::-1])
        assert rho[-1] + 0.1 >= rho_max
        assert rho[-1] - 0.1 <= rho_max + 1e-6
