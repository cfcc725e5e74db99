"""Pictures: bounded, thin lines kept, close-ups on the road, candidate lines where the rails are."""

import io
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.image import imread
from tests.scenes.effort import examples

from linework.imaging.overview import close_ups, reduced
from linework.imaging.picture import OverlaidLines, Style, draw_map, draw_radon, nice_length_m
from linework.methods.radon.figures import (
    FigureConfig,
    classified,
    find_candidate_lines,
    line_ends,
    radon_as_image,
    raster_figures,
    with_lines,
)
from linework.methods.radon.peaks import Peaks, ridges
from linework.methods.radon.transform import evenly_spaced_angles, radon_transform
from linework.model.grid import Grid, Image
from linework.model.points import Points


def pixels(png):
    return imread(io.BytesIO(png), format="png")


@settings(max_examples=examples(60), deadline=None)
@given(st.integers(1, 40), st.integers(1, 40), st.integers(1, 12), st.integers(0, 99), st.booleans())
def test_reduced_equals_its_slow_twin(n_rows, n_cols, n_max, seed, largest):
    rng = np.random.default_rng(seed)
    values = rng.random((n_rows, n_cols))
    values[rng.random(values.shape) < 0.5] = np.nan
    small, factor = reduced(values, n_max, "largest" if largest else "smallest")
    assert max(small.shape) <= n_max
    for i in range(small.shape[0]):
        for j in range(small.shape[1]):
            block = values[i * factor : (i + 1) * factor, j * factor : (j + 1) * factor]
            known = block[~np.isnan(block)]
            expected = (known.max() if largest else known.min()) if known.size else np.nan
            np.testing.assert_equal(small[i, j], np.float32(expected))


def test_a_picture_is_bounded_however_large_the_image():
    grid = Grid(664_000.0, 5_080_800.0, 0.2, 0.2, 4000, 300)
    density = np.zeros(grid.shape, dtype=np.uint32)
    density[:, 150] = 3
    for image in (Image(density, grid), Image(density.T.copy(), Grid(0.0, 60.0, 0.2, 0.2, 300, 4000))):
        picture = pixels(draw_map(image, Style(logarithmic=True), title="Density", crs_name="local"))
        assert max(picture.shape[:2]) <= 2000
        assert min(picture.shape[:2]) >= 300


@pytest.mark.parametrize("rotation_deg", [0.0, 60.0])
def test_lines_and_classes_are_drawn_in_their_colours(rotation_deg):
    grid = Grid(664_000.0, 5_080_020.0, 0.2, 0.2, 100, 150, rotation_deg)
    classes = np.ones(grid.shape, dtype=np.uint8)
    classes[:50] = 2
    ends = grid.to_world(np.array([65.0, 90.0]), np.array([0.0, 150.0]))[None]
    style = Style(classes=((1, "#00ff00", "road"), (2, "#0000ff", "non-road")))
    lines = OverlaidLines(ends, ["1"], "candidate")
    picture = pixels(
        draw_map(Image(classes, grid), style, title="Classes", crs_name="EPSG:32632", lines=lines)
    )
    image = (picture[..., :3] * 255).round().astype(int)
    green, blue = ((image == c).all(axis=-1) for c in ((0, 255, 0), (0, 0, 255)))
    red, others = image[..., 0], image[..., 1:].max(axis=-1)
    reddish = red > others + 60
    assert green.sum() > 50_000
    assert blue.sum() > 50_000
    rows = [np.median(np.nonzero(mask)[0]) for mask in (blue, reddish, green)]
    # the line is in the lower, green half, whatever the grid's turn: pictures are drawn along the grid
    assert rows[0] < rows[1]
    assert reddish.sum() > 500


def test_images_without_any_value_are_drawn():
    grid = Grid(0.0, 2.0, 0.2, 0.2, 10, 10)
    empty = Image(np.full(grid.shape, np.nan, dtype=np.float32), grid)
    assert pixels(draw_map(empty, Style(unit="m"), title="Nothing", crs_name="local")).size
    none = np.zeros((4, 5))
    assert pixels(draw_radon(none, evenly_spaced_angles(45.0), np.arange(-2.0, 3.0), title="Nothing")).size


def test_close_ups_stand_on_the_road_in_a_bend():
    grid = Grid(0.0, 200.0, 0.2, 0.2, 1000, 1000)
    angle = np.linspace(0.01, math.pi / 2, 4000)
    road = grid.to_cell(np.column_stack([190.0 * np.cos(angle), 190.0 * np.sin(angle)]))
    values = np.zeros(grid.shape, dtype=np.uint32)
    values[np.floor(road[0]).astype(int), np.floor(road[1]).astype(int)] = 1
    windows = close_ups(Image(values, grid), 60.0, 45.0)
    assert len(windows) == 2  # 160 m along, 60 m each
    for row0, row1, col0, col1 in windows:
        assert (row1 - row0, col1 - col0) == (225, 300)
        assert values[row0 + 50 : row1 - 50, col0 + 50 : col1 - 50].sum() > 100
    assert close_ups(Image(0 * values, grid), 60.0, 45.0) == ()


def test_a_scale_bar_has_a_round_length():
    for length in (0.13, 1.0, 7.7, 49.0, 2345.0):
        nice = nice_length_m(length)
        assert length / 2.6 < nice <= length
        assert f"{nice:.0e}"[0] in "125"


def rails(offsets_m=(-12.0, 14.0), theta=0.6):
    """A binary image of 100 x 80 m with straight rails, a thick hedge, and bushes."""
    grid = Grid(664_000.0, 5_080_080.0, 0.2, 0.2, 400, 500)
    centre = grid.to_world(np.array(200.0), np.array(250.0))
    rows, cols = np.mgrid[:400, :500] + 0.5
    xy = grid.to_world(rows, cols) - centre
    rho = xy[..., 0] * math.cos(theta) + xy[..., 1] * math.sin(theta)
    values = np.zeros(grid.shape, dtype=bool)
    for offset in offsets_m:
        values |= np.abs(rho - offset) < 0.15
    values |= np.abs(xy[..., 0] * math.cos(2.2) + xy[..., 1] * math.sin(2.2)) < 1.5
    values |= np.random.default_rng(4).random(grid.shape) < 0.01
    return Image(values, grid)


def test_candidate_lines_are_the_rails_not_the_hedge():
    found = find_candidate_lines(rails(), FigureConfig())
    assert np.all(found.peaks.strength_m[2:] < 0.2 * found.peaks.strength_m[1])
    two = Peaks(
        *(column[:2] for column in (found.peaks.theta_rad, found.peaks.rho_m, found.peaks.strength_m))
    )
    np.testing.assert_allclose(two.theta_rad, 0.6, atol=0.002)
    np.testing.assert_allclose(np.sort(two.rho_m), [-12.0, 14.0], atol=0.1)
    drawn = with_lines(rails(), line_ends(two, found.radon))
    # the two lines' cells are occupied: they lie on the rails
    assert np.mean(drawn.values[drawn.values >= 2] == 3) > 0.95
    assert np.array_equal(drawn.values % 2 == 1, rails().values)


def test_ridges_are_what_is_narrow_in_rho():
    image = rails(offsets_m=(10.0,))
    radon = radon_transform(image, evenly_spaced_angles(1.0))
    thin = ridges(radon, width_m=1.0)
    assert np.all(thin.values >= -1e-9)
    assert np.all(thin.values <= radon.values + 1e-9)
    hedge = np.argmin(abs(radon.angles_rad - 2.2)), np.argmin(abs(radon.rho_m))
    rail = np.argmin(abs(radon.angles_rad - 0.6)), np.argmin(abs(radon.rho_m - 10.0))
    assert radon.values[hedge] > radon.values[rail]
    assert thin.values[rail] > 5 * thin.values[hedge]


def test_the_radon_raster_has_theta_and_rho_as_its_axes():
    found = find_candidate_lines(rails(), FigureConfig())
    image = radon_as_image(found.radon)
    row, col = np.unravel_index(np.argmax(image.values), image.values.shape)
    theta_deg, rho = image.grid.to_world(np.array(row + 0.5), np.array(col + 0.5))
    i, j = np.unravel_index(np.argmax(found.radon.values), found.radon.values.shape)
    assert theta_deg == pytest.approx(math.degrees(found.radon.angles_rad[i]))
    assert rho == pytest.approx(found.radon.rho_m[j], abs=1e-9)


def test_classes_go_by_the_majority():
    grid = Grid(0.0, 1.0, 1.0, 1.0, 1, 3)
    points = Points(np.array([[0.5, 0.5, 0], [0.6, 0.5, 0], [0.7, 0.5, 0], [1.5, 0.5, 0], [9.0, 9.0, 0]]))
    image = classified(points, np.array([True, False, True, False, True]), grid)
    assert image.values.tolist() == [[1, 2, 0]]


def test_figures_of_the_paper_come_one_by_one():
    rng = np.random.default_rng(0)
    xyz = rng.uniform(0, 1, (3000, 3)) * (40.0, 10.0, 0.02)
    grid = Grid(0.0, 10.0, 0.5, 0.5, 20, 80)
    heights = xyz[:, 2].astype(np.float32)
    figures = raster_figures(
        Points(xyz), heights, np.ones(3000, dtype=bool), grid, FigureConfig(), crs_name="local"
    )
    first = next(figures)
    assert first.name == "classes"
    assert first.in_world
    names = [f.name for f in figures]
    assert "intensity" not in names
    assert names[-2:] == ["radon", "radon_dilated"]
