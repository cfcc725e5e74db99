"""The steps of the radon paper on images whose lines are known."""

from __future__ import annotations

import numpy as np
import pytest

from linework.methods.radon.transform import radon_transform
from linework.model.grid import Bounds, Grid, Image, holds
from linework.published.radon_2002 import (
    Radon2002Config,
    binary_image,
    corrected_centres,
    dilated,
    fitted_locally,
    height_images,
    image_corners,
    radon_image,
    radon_peaks,
    segments,
)

CELL_M = 0.2


def with_line(theta_deg: float, rho_m: float, n_cells: int = 120) -> np.ndarray:
    """An image of the cells within half a cell of a line about its middle."""
    row, col = np.mgrid[:n_cells, :n_cells]
    x, y = (col + 0.5 - n_cells / 2) * CELL_M, (row + 0.5 - n_cells / 2) * CELL_M
    theta = np.radians(theta_deg)
    return np.abs(x * np.cos(theta) + y * np.sin(theta) - rho_m) <= CELL_M / 2


def test_images_of_three_points():
    xyh = np.array([[0.1, 0.1, 0.4], [0.1, 0.15, 0.8], [0.5, 0.3, 3.0], [9.0, 0.0, 1.0]])
    images = height_images(xyh, np.zeros(2), 3, CELL_M)
    assert images.density.tolist() == [[2, 0, 0], [0, 0, 1], [0, 0, 0]]
    assert (images.maximum[0, 0], images.minimum[0, 0]) == (0.8, 0.4)
    assert images.average[0, 0] == pytest.approx(0.6)
    assert np.isnan(images.maximum[2, 2])


def test_a_house_is_not_in_the_binary_image_although_it_has_points_in_the_band():
    wall = np.array([[0.1, 0.1, h] for h in (0.5, 1.0, 5.0)])
    images = height_images(wall, np.zeros(2), 2, CELL_M)
    assert not binary_image(images.maximum, 0.2, 1.2).any()
    assert binary_image(images.minimum, 0.2, 1.2)[0, 0]


@pytest.mark.parametrize(("theta_deg", "rho_m"), [(0.0, 3.1), (37.0, -4.2), (90.0, 0.1), (151.25, 6.0)])
def test_the_peak_is_the_line(theta_deg, rho_m):
    config = Radon2002Config()
    radon, theta, x = radon_image(with_line(theta_deg, rho_m), CELL_M, config.step_deg)
    found = radon_peaks(radon, theta, x, config)
    assert len(found.theta_rad) >= 1
    off = (np.degrees(found.theta_rad[0]) - theta_deg + 90.0) % 180.0 - 90.0
    assert abs(off) <= 0.6
    # At the other end of the angles the sign of the distance turns
    turned = -1.0 if abs(np.degrees(found.theta_rad[0]) - theta_deg) > 90.0 else 1.0
    assert turned * found.rho_m[0] == pytest.approx(rho_m, abs=0.11)


@pytest.mark.parametrize("theta_deg", [0.0, 20.0, 90.0])
def test_only_one_peak_of_a_line_counts_and_it_is_as_strong_as_the_line_is_long(theta_deg):
    image = with_line(theta_deg, 1.1)
    radon, theta, x = radon_image(image, CELL_M, 0.25)
    strong = radon_peaks(radon, theta, x, Radon2002Config(threshold_m=0.5 * float(radon.max())))
    assert len(strong.theta_rad) == 1
    # A line one cell wide: one bin holds it where it runs along rows or columns, most of it elsewhere
    assert strong.strength_m[0] == pytest.approx(
        CELL_M * np.count_nonzero(image), rel=0.35 if theta_deg == 20.0 else 0.02
    )


def test_dilation_goes_on_beyond_the_last_angle():
    radon = np.zeros((180, 41))
    radon[0, 10] = 5.0  # theta 0; at 180 degrees it is mirrored
    around = dilated(radon, 8, 2)
    assert around[177, 30] == 5.0
    assert around[177, 10] == 0.0
    assert around[3, 11] == 5.0
    assert around[6, 10] == 0.0


def test_integrals_are_those_of_the_exact_transform_within_the_width_of_a_bin():
    rng = np.random.default_rng(3)
    image = rng.random((40, 40)) < 0.2
    values, theta, x = radon_image(image, CELL_M, 5.0)
    # Row 0 is the southernmost here, the northernmost there
    exact = radon_transform(Image(image[::-1], Grid(0.0, 8.0, CELL_M, CELL_M, 40, 40)), theta)
    assert values.sum(axis=1) == pytest.approx(exact.values.sum(axis=1))
    smooth = np.ones(5) / 5.0
    ours = np.array([np.convolve(v, smooth, "same") for v in values])
    theirs = np.array([np.interp(x, exact.rho_m, np.convolve(v, smooth, "same")) for v in exact.values])
    assert np.corrcoef(ours.ravel(), theirs.ravel())[0, 1] > 0.99


def test_a_seed_line_is_parted_at_gaps():
    image = np.zeros((120, 120), dtype=bool)
    image[60, 10:50] = image[60, 70:100] = True
    parts = segments(image, np.pi / 2, 0.1, Radon2002Config())
    assert [round(high - low) for low, high, _ in parts] == [6, 8]  # against the columns: theta is 90 degrees
    assert all(share > 0.95 for *_, share in parts)


def test_circles_settle_on_a_beam_beside_the_seed_line():
    rng = np.random.default_rng(4)
    along = np.linspace(0.0, 20.0, 800)
    beam = np.column_stack([along, 0.05 + 0.002 * along, rng.choice([0.5, 0.6, 0.75], 800)])
    start, end = np.zeros(2), np.array([20.0, 0.0])
    config = Radon2002Config()
    # A hedge 0.4 m beside it: a circle as large as it may be would take it in
    hedge = np.column_stack([along, beam[:, 1] + 0.4, np.full(800, 0.5)])
    centres = corrected_centres(np.concatenate([beam, hedge]), start, end, config)
    assert centres[:, 2].max() == pytest.approx(0.75)
    line = fitted_locally(centres, start, end, config.fit_m)
    inner = (line[:, 0] > 1.0) & (line[:, 0] < 19.0)
    assert np.abs(line[inner, 1] - (0.05 + 0.002 * line[inner, 0])).max() < 0.03


def test_each_image_with_points_belongs_to_one_tile():
    """Also those whose middle is in no tile that has points: the data end at 191 m north."""
    rng = np.random.default_rng(8)
    xy = rng.uniform([0.0, 0.0], [300.0, 191.0], (4000, 2))
    whole = image_corners(xy, Bounds(0.0, 0.0, 300.0, 191.0), 60.0, is_whole=True)
    tiles = []
    for west in np.arange(0.0, 300.0, 64.0):
        for south in np.arange(0.0, 191.0, 64.0):
            core = Bounds(west, south, west + 64.0, south + 64.0)
            near = holds(core.grown(60.0), xy)
            tiles += image_corners(xy[near], core, 60.0)
    assert sorted(map(tuple, tiles)) == sorted(map(tuple, whole))
    assert len(whole) == 5 * 4
    assert image_corners(np.zeros((0, 2)), Bounds(0.0, 0.0, 1.0, 1.0), 60.0) == []


def test_sparse_points_give_no_vertex_twice():
    along = np.arange(0.0, 20.0, 0.9)
    posts = np.column_stack([along, np.zeros(len(along)), np.full(len(along), 0.7)])
    config = Radon2002Config()
    line = fitted_locally(
        corrected_centres(posts, np.zeros(2), np.array([20.0, 0.0]), config),
        np.zeros(2),
        np.array([20.0, 0.0]),
        config.fit_m,
    )
    assert len(line) > 10
    assert np.diff(line[:, 0]).min() >= 0.2
