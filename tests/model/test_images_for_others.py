"""Image as an array, in matplotlib and in xarray."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from linework.model.grid import Grid, Image

PLAIN = Grid(500_000.0, 5_400_010.0, 0.5, 2.0, 4, 6)
TURNED = Grid(500_000.0, 5_400_010.0, 0.5, 2.0, 4, 6, rotation_deg=30.0)


def image(grid=PLAIN, dtype=np.float64) -> Image:
    values = np.arange(24.0).reshape(4, 6)
    values[1, 2] = np.nan
    return Image(values.astype(dtype) if dtype != np.bool_ else np.isfinite(values), grid)


def test_numpy_takes_an_image_as_its_values():
    one = image()
    assert np.shares_memory(np.asarray(one), one.values)
    assert not np.shares_memory(np.array(one), one.values)
    assert np.nanmax(one) == 23
    np.testing.assert_array_equal(np.asarray(one, dtype=np.float32), one.values.astype(np.float32))
    assert np.shares_memory(np.array(one, copy=None), one.values)
    np.testing.assert_array_equal(np.array(one, dtype=np.float32, copy=True), one.values.astype(np.float32))
    assert np.shares_memory(one.__array__(np.float64, copy=False), one.values)
    with pytest.raises(ValueError, match="must be copied"):
        one.__array__(np.float32, copy=False)


def test_equal_images_have_equal_values_on_equal_grids():
    assert image() == image()
    assert image() != image(TURNED)
    assert image() != Image(np.nan_to_num(image().values), PLAIN)
    assert image(dtype=np.bool_) == image(dtype=np.bool_) != image()
    assert image() != 3


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.bool_])
@pytest.mark.parametrize("grid", [PLAIN, TURNED])
def test_an_image_is_described_in_one_line(grid, dtype):
    text = repr(image(grid, dtype))
    assert "\n" not in text
    assert len(text) < 170
    assert "4 x 6 cells of 0.5 x 2 m" in text
    assert "95.8 %" in text
    assert ("turned by 30 degrees" in text) == (grid is TURNED)
    assert repr(Image(np.full((4, 6), np.nan), grid)).count("0.0 % measured") == 1


def test_extent_is_that_of_imshow():
    assert image().extent == (500_000.0, 500_003.0, 5_400_002.0, 5_400_010.0)
    with pytest.raises(ValueError, match="turned by 30 degrees"):
        image(TURNED).extent  # noqa: B018


@pytest.mark.parametrize("grid", [PLAIN, TURNED])
def test_xarray_has_the_centres_of_the_cells(grid):
    one = image(grid)
    array = one.to_xarray()
    assert array.dims == (("y", "x") if grid is PLAIN else ("row", "col"))
    np.testing.assert_array_equal(array.values, one.values)
    for row, col in ((0, 0), (3, 5), (1, 2)):
        cell = array[row, col]
        np.testing.assert_allclose([cell.x, cell.y], grid.to_world(row + 0.5, col + 0.5), rtol=0, atol=1e-9)
    assert array.x.attrs["units"] == "m"
    if grid is PLAIN:
        assert array.sel(x=500_002.6, y=5_400_003.2, method="nearest") == one.values[3, 5]


@pytest.mark.parametrize("grid", [PLAIN, TURNED])
def test_a_plot_shows_each_cell_where_it_is(grid):
    ax = image(grid).plot(Figure().subplots(), cmap="magma")
    drawn = ax.images[0]
    assert drawn.get_cmap().name == "magma"
    # Through the picture's own transform: the middle of a cell is where the grid has it
    to_data = drawn.get_transform() - ax.transData
    for row, col in ((0, 0), (3, 5)):
        found = to_data.transform((col + 0.5, row + 0.5))
        np.testing.assert_allclose(found, grid.to_world(row + 0.5, col + 0.5), rtol=0, atol=1e-5)
    corners = grid.to_world(np.array([0, 0, 4, 4]), np.array([0, 6, 0, 6]))
    assert ax.get_xlim() == pytest.approx((corners[:, 0].min(), corners[:, 0].max()))
    assert ax.get_ylim() == pytest.approx((corners[:, 1].min(), corners[:, 1].max()))
