"""Undulations of the geoid from PROJ's grid files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyproj
from pyproj.exceptions import ProjError

from linework.arrays import FloatArray
from linework.errors import ConfigError
from linework.files.las_header import regular_file_bytes


def undulations(
    longitude_deg: FloatArray, latitude_deg: FloatArray, path: Path, *, where: object = None
) -> FloatArray:
    """Return how high the geoid of a grid file is above the ellipsoid at places, (n,) in metres.

    Parameters
    ----------
    path
        A grid that PROJ reads: .gtx, or GeoTIFF.
    where
        The file that the places come from.

    Raises
    ------
    InputError
        No such file.
    ConfigError
        No grid, or one that does not cover all places.
    """
    regular_file_bytes(path)
    if any(c in str(path.resolve()) for c in ',"'):
        raise ConfigError("PROJ cannot read a grid whose path holds a comma or a quotation mark", where=path,
                          advice="rename it")  # fmt: skip
    try:
        shift = pyproj.Transformer.from_pipeline(
            f"+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad"
            f' +step +proj=vgridshift +grids="{path.resolve()}" +multiplier=1'
        )
        shifted = shift.transform(longitude_deg, latitude_deg, np.zeros(len(longitude_deg)), errcheck=False)
    except ProjError as error:
        raise ConfigError("is no grid of undulations that PROJ can read", where=path,
                          advice="give the grid as .gtx or .tif") from error  # fmt: skip
    undulation = np.asarray(shifted[2], dtype=np.float64)
    if not np.isfinite(undulation).all():
        raise ConfigError(
            f"{int(np.count_nonzero(~np.isfinite(undulation)))} of {len(undulation)} places of {where} are outside"
            " of this grid", where=path, advice="give the grid of that country",
        )  # fmt: skip
    return undulation
