"""Write images as GeoTIFF, and read the CRS of others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from linework.crs import LOCAL, parse_crs
from linework.errors import InputError, MachineError, UsageError, extra_needed
from linework.files.input import filled_file_bytes, plainly_named
from linework.files.output.publish import publish
from linework.model.grid import Image

with extra_needed("reports"):
    import rasterio
    from rasterio.errors import RasterioError

_DTYPES = ("float32", "uint8", "uint32")
#: Edge of a tile [pixels]: GDAL's default for cloud optimised files.
_BLOCK = 512


def write_geotiff(image: Image, path: Path, *, crs: str, overwrite: bool = False) -> None:
    """Write an image as a cloud optimised GeoTIFF; a rotated grid keeps its rotation.

    Parameters
    ----------
    image
        (rows, cols) float32 (NaN: no data), float64 (written as float32), uint8, bool (written as uint8) or uint32.
    crs
        "EPSG:...", WKT, or "local" (no CRS is written then).

    Raises
    ------
    UsageError
        The values have another dtype.
    OutputExistsError, MachineError
        As for `publish`.

    Notes
    -----
    GDAL's COG driver warps rotated images to north up, so these are written as plain tiled GeoTIFF instead.
    """
    values = _storable(image, path)
    wkt = parse_crs(crs)
    a, b, c, d, e, f = image.grid.affine
    profile: dict[str, Any] = {
        "width": image.grid.n_cols, "height": image.grid.n_rows, "count": 1, "dtype": str(values.dtype),
        "crs": None if wkt == LOCAL else rasterio.crs.CRS.from_wkt(wkt),
        "transform": rasterio.Affine(a, b, c, d, e, f), "compress": "DEFLATE",
        "nodata": float("nan") if values.dtype == np.float32 else None,
    }  # fmt: skip
    if image.grid.rotation_deg == 0.0:
        profile |= {"driver": "COG", "blocksize": _BLOCK, "overviews": "AUTO"}
    else:
        profile |= {"driver": "GTiff", "tiled": True, "blockxsize": _BLOCK, "blockysize": _BLOCK}

    def write(part: Path) -> None:
        # Encoded in memory first, because GDAL does not report every failed write
        try:
            with rasterio.Env(GDAL_PAM_ENABLED="NO"), rasterio.MemoryFile() as memory:
                with memory.open(**profile) as dataset:
                    dataset.write(values, 1)
                part.write_bytes(memory.read())
        except RasterioError as error:
            raise MachineError(
                f"image cannot be encoded: {error}", where=path, advice="free some memory"
            ) from error

    def verify(part: Path) -> None:
        with plainly_named(part) as source, rasterio.open(source, driver="GTiff") as dataset:
            same = dataset.transform.almost_equals(profile["transform"], 1e-9 * max(abs(c), abs(f), 1.0))
            same &= bool(np.array_equal(dataset.read(1), values, equal_nan=values.dtype == np.float32))
            same &= (dataset.crs is None) == (wkt == LOCAL)
        if not same:
            raise MachineError(
                "written file does not read back the same", where=path, advice="check for free space"
            )

    publish(path, write, verify, overwrite=overwrite)


def _storable(image: Image, path: Path) -> Any:
    values = image.values
    if values.dtype == np.bool_:
        return values.astype(np.uint8)
    if values.dtype == np.float64:
        return values.astype(np.float32)
    if str(values.dtype) not in _DTYPES:
        raise UsageError(f"image has dtype {values.dtype}, expected {', '.join(_DTYPES)}", where=path,
                         advice="convert it first")  # fmt: skip
    return values


def geotiff_crs(path: Path) -> str:
    """Return the CRS of a GeoTIFF as WKT, `LOCAL` where it states none.

    Raises
    ------
    InputError
        The file is not there, or is not a GeoTIFF.
    """
    filled_file_bytes(path)
    try:
        with plainly_named(path) as source, rasterio.open(source, driver="GTiff") as dataset:
            return LOCAL if dataset.crs is None else str(dataset.crs.to_wkt())
    except RasterioError as error:
        raise InputError("not a GeoTIFF", where=path, advice="write it again") from error
