"""Positions in degrees, for formats that hold no others, and back.

Separate from `lanelet2` and from `linework.files.geodetic`, which brings what receivers recorded into the frame of a survey: here lines of a
known CRS go to latitude and longitude and must come back to the millimetre.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import pyproj
from pyproj.exceptions import ProjError

from linework.arrays import FloatArray
from linework.crs import LOCAL, describe_crs, horizontal_part
from linework.errors import CrsError, argument

#: Heights as they are in the CRS, or above the ellipsoid.
Heights = Literal["crs", "ellipsoid"]


def in_degrees(xyz: FloatArray, crs: str, *, heights: Heights = "crs", where: object = None) -> FloatArray:
    """Return (n, 3) latitude, longitude [deg, WGS 84], height [m].

    Raises
    ------
    CrsError
        The lines are local, or PROJ knows no exact transformation.
    """
    if crs == LOCAL:
        raise CrsError("positions in degrees need georeferenced lines, these are local", where=where,
                       advice="write .gpkg, .geojson or .dxf")  # fmt: skip
    found = _transformed(xyz, crs, heights, where, inverse=False)
    return np.column_stack([found[:, 1], found[:, 0], found[:, 2]])


def from_degrees(
    degrees: FloatArray, crs: str, *, heights: Heights = "crs", where: object = None
) -> FloatArray:
    """Return (n, 3) east, north, up [m] in a CRS of positions (n, 3) latitude, longitude [deg, WGS 84], height [m].

    Raises
    ------
    CrsError
        PROJ knows no exact transformation.
    """
    turned = np.column_stack([degrees[:, 1], degrees[:, 0], degrees[:, 2]])
    return _transformed(turned, crs, heights, where, inverse=True)


def _transformed(xyz: FloatArray, crs: str, heights: Heights, where: object, *, inverse: bool) -> FloatArray:
    whole = pyproj.CRS.from_wkt(crs)
    plan = horizontal_part(whole)
    own, other = (whole, "EPSG:4979") if heights == "ellipsoid" else (plan, "EPSG:4326")
    source, target = (other, own) if inverse else (own, other)
    try:
        transformer = pyproj.Transformer.from_crs(
            source, target, always_xy=True, allow_ballpark=False, only_best=True
        )
        if heights == "ellipsoid":
            x, y, z = xyz.T
            found = np.stack(transformer.transform(x, y, z, errcheck=True), axis=1)
        else:
            east, north = transformer.transform(xyz[:, 0], xyz[:, 1], errcheck=True)
            found = np.column_stack([east, north, xyz[:, 2]])
    except ProjError as error:
        what = "with heights above the ellipsoid" if heights == "ellipsoid" else "to degrees"
        advice = (
            f"leave {argument('heights')} at crs"
            if heights == "ellipsoid"
            else "write .gpkg, .geojson or .dxf"
        )
        raise CrsError(
            f"PROJ knows no exact transformation of {describe_crs(crs)} {what}", where=where, advice=advice
        ) from error
    return np.asarray(found, dtype=np.float64)
