"""GeoTIFF: what is written reads back, cloud optimised, with its CRS and rotation."""

import numpy as np
import pytest
import rasterio

from linework.errors import OutputExistsError, UsageError
from linework.files.images.geotiff import write_geotiff
from linework.model.grid import Grid, Image

UTM = "EPSG:25832+7837"


def image(dtype="float32", rotation_deg=0.0, shape=(700, 600)):
    values = (np.random.default_rng(1).random(shape) * 200).astype(dtype)
    if values.dtype.kind == "f":
        values[:5] = np.nan
    return Image(values, Grid(500_000.0, 5_600_000.0, 0.2, 0.3, *shape, rotation_deg))


@pytest.mark.parametrize("rotation_deg", [0.0, 33.0])
@pytest.mark.parametrize("dtype", ["float32", "float64", "uint8", "uint32", "bool"])
def test_round_trip(tmp_path, dtype, rotation_deg):
    own = image(dtype, rotation_deg)
    write_geotiff(own, tmp_path / "a.tif", crs=UTM)
    with rasterio.open(tmp_path / "a.tif") as dataset:
        values = dataset.read(1)
        np.testing.assert_array_equal(values, own.values.astype(values.dtype))
        np.testing.assert_allclose(dataset.transform[:6], own.grid.affine, rtol=1e-12)
        assert dataset.crs.to_wkt().startswith('COMPD_CS["ETRS89 / UTM zone 32N + DHHN2016 height"')
        assert (dataset.nodata is None) == (values.dtype.kind != "f")
        if rotation_deg == 0.0:
            assert dataset.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
            assert dataset.overviews(1) == [2]
        assert dataset.block_shapes == [(512, 512)]
    assert [p.name for p in tmp_path.iterdir()] == ["a.tif"]


def test_local_has_no_crs(tmp_path):
    write_geotiff(image(), tmp_path / "a.tif", crs="local")
    with rasterio.open(tmp_path / "a.tif") as dataset:
        assert dataset.crs is None


def test_equal_images_give_equal_bytes(tmp_path):
    for name in ("a.tif", "b.tif"):
        write_geotiff(image(), tmp_path / name, crs=UTM)
    assert (tmp_path / "a.tif").read_bytes() == (tmp_path / "b.tif").read_bytes()


def test_refusals(tmp_path):
    write_geotiff(image(), tmp_path / "a.tif", crs=UTM)
    with pytest.raises(OutputExistsError):
        write_geotiff(image(), tmp_path / "a.tif", crs=UTM)
    with pytest.raises(UsageError, match="dtype int64"):
        write_geotiff(image("int64"), tmp_path / "b.tif", crs=UTM)
