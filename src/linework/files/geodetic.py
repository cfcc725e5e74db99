"""Convert latitude, longitude and ellipsoidal height to the survey's CRS, and true headings to grid headings."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyproj
from pyproj.exceptions import ProjError
from pyproj.network import set_network_enabled  # type: ignore[attr-defined]
from pyproj.transformer import TransformerGroup

from linework.arrays import FloatArray
from linework.crs import LOCAL, describe_crs, has_height, horizontal_part
from linework.errors import ConfigError, CrsError, InputError
from linework.files.input import regular_file_bytes
from linework.model.survey import Survey

#: Tolerance around a CRS's area of use [deg]: zones are used a little beyond their edges.
_NEAR_DEG = 3.0
_GEOID_ADVICE = 'give [heights] geoid = "receiver", metres, or a PROJ grid file'


@dataclass(frozen=True, slots=True, kw_only=True)
class EarthFrame:
    """Target of geographic positions: the survey's CRS, and the source of the geoid undulation.

    Parameters
    ----------
    crs
        WKT2 of a projected CRS, or "local": east, north, up in the plane that touches the ellipsoid at the
        first place.
    geoid
        None: from the CRS; "receiver": the log's own undulation; a number: that undulation [m]; another text: a PROJ
        geoid grid file.
    root
        Folder for a relative path of the grid file.
    base_deg
        Position of the base station that baselines of a log start from: latitude, longitude [deg], height above the
        ellipsoid [m]; None: as the log states it.
    origin_deg
        The same of the origin of a "local" frame; None: the first place.
    """

    crs: str
    geoid: str | float | None = None
    root: Path = Path()
    base_deg: tuple[float, float, float] | None = None
    origin_deg: tuple[float, float, float] | None = None

    @classmethod
    def of(cls, survey: Survey) -> EarthFrame:
        """Return the frame of a survey, from its CRS and the table [heights] of its survey.toml."""
        geoid = survey.settings.get("heights", {}).get("geoid")
        base = survey.settings.get("gnss", {}).get("base_deg")
        base_deg = None if base is None else (float(base[0]), float(base[1]), float(base[2]))
        return cls(crs=survey.crs, geoid=geoid, root=survey.root, base_deg=base_deg)


@dataclass(frozen=True, slots=True)
class ProjectedPlaces:
    """Positions in the survey's frame.

    Parameters
    ----------
    xyz
        (n, 3) float64 [m, world].
    warnings
        One line each.
    """

    xyz: FloatArray
    warnings: tuple[str, ...] = ()


def project_places(
    geographic: FloatArray,
    frame: EarthFrame,
    *,
    undulation_m: FloatArray | None = None,
    where: object = None,
) -> ProjectedPlaces:
    """Convert geographic positions to the survey's frame.

    Parameters
    ----------
    geographic
        (n, 3): latitude, longitude [deg], height above the ellipsoid [m], WGS 84.
    undulation_m
        (n,) height of the geoid above the ellipsoid [m] from the log, for ``geoid = "receiver"``.

    Raises
    ------
    InputError
        Impossible positions, or outside the CRS.
    CrsError
        No transformation: a height grid is missing on this machine.
    ConfigError
        [heights] geoid names something that is missing.
    """
    latitude_deg, longitude_deg, height_m = geographic.T
    wrong = (np.abs(latitude_deg) > 90.0) | (np.abs(longitude_deg) > 360.0)
    if wrong.any():
        first = int(np.argmax(wrong))
        raise InputError(
            f"latitude {latitude_deg[first]:g}, longitude {longitude_deg[first]:g} is not a place on earth"
            f" ({int(wrong.sum())} of {len(wrong)})",
            where=where, advice="latitude and longitude are degrees",
        )  # fmt: skip
    if frame.crs == LOCAL:
        return _local_places(latitude_deg, longitude_deg, height_m, frame.origin_deg)
    if frame.geoid is None and has_height(frame.crs):
        xyz, remarks = _transformed(longitude_deg, latitude_deg, height_m, frame.crs, where)
    else:
        xyz, remarks = _transformed(longitude_deg, latitude_deg, None, _plan_of(frame.crs), where)
        xyz[:, 2] = height_m - _zero_m(longitude_deg, latitude_deg, frame, undulation_m, where)
    _check_finite(xyz, frame.crs, where)
    return ProjectedPlaces(xyz, (*remarks, *_outside_of_use(latitude_deg, longitude_deg, frame.crs, where)))


def _plan_of(crs: str) -> str:
    return horizontal_part(pyproj.CRS.from_user_input(crs)).to_wkt()


def _transformed(
    longitude_deg: FloatArray, latitude_deg: FloatArray, height_m: FloatArray | None, crs: str, where: object
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return (n, 3) east, north and height (0 where none is given), and a warning where PROJ lacks the best one."""
    source = "EPSG:4326" if height_m is None else "EPSG:4979"
    set_network_enabled(active=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # reported below, in one line
        ways = TransformerGroup(source, crs, always_xy=True, allow_ballpark=False)
        missing = [g.short_name for way in ways.unavailable_operations for g in way.grids if not g.available]
        if not ways.transformers:
            raise CrsError(
                f"ellipsoidal heights cannot be converted to those of {describe_crs(crs)}: PROJ has no grid"
                f" {missing[0] if missing else 'for it'}" if height_m is not None
                else f"PROJ knows no transformation from WGS 84 to {describe_crs(crs)}",
                where=where, advice=_GEOID_ADVICE if height_m is not None else "give another CRS",
            )  # fmt: skip
        transformer = pyproj.Transformer.from_crs(source, crs, always_xy=True, allow_ballpark=False)
    remarks: tuple[str, ...] = ()
    if not ways.best_available and missing:
        best = ways.transformers[0].accuracy
        good_to = f", good to {best:g} m" if best >= 0 else ""
        remarks = (
            f"PROJ has no grid {missing[0]} for {describe_crs(crs)}: another transformation is used{good_to}",
        )
    try:
        height = np.zeros(len(longitude_deg)) if height_m is None else height_m
        columns = transformer.transform(longitude_deg, latitude_deg, height, errcheck=False)
    except ProjError as error:
        raise CrsError(f"places cannot be transformed to {describe_crs(crs)}: {error}", where=where,
                       advice="check the CRS") from error  # fmt: skip
    return np.stack(columns, axis=1).astype(np.float64), remarks


def _zero_m(
    longitude_deg: FloatArray,
    latitude_deg: FloatArray,
    frame: EarthFrame,
    undulation_m: FloatArray | None,
    where: object,
) -> FloatArray | float:
    """Return the height of the zero of the survey's heights above the ellipsoid, (n,) or one number [m]."""
    if frame.geoid is None:
        return 0.0
    if isinstance(frame.geoid, int | float):
        return float(frame.geoid)
    if frame.geoid != "receiver":
        return undulations(longitude_deg, latitude_deg, frame.root / frame.geoid, where=where)
    if undulation_m is None:
        raise ConfigError('heights.geoid is "receiver", but this file holds no geoid undulation', where=where,
                          advice="give metres or a PROJ grid file")  # fmt: skip
    return undulation_m


def _check_finite(xyz: FloatArray, crs: str, where: object) -> None:
    outside = ~np.isfinite(xyz).all(axis=1)
    if outside.any():
        raise InputError(
            f"{int(outside.sum())} of {len(xyz)} places have no coordinates in {describe_crs(crs)}",
            where=where, advice="check the CRS of the survey",
        )  # fmt: skip


def _outside_of_use(
    latitude_deg: FloatArray, longitude_deg: FloatArray, crs: str, where: object
) -> tuple[str, ...]:
    """Return a warning where the positions are far from the area of use of the CRS.

    Raises
    ------
    InputError
        They are far, but not with latitude and longitude exchanged.
    """
    area = pyproj.CRS.from_user_input(crs).area_of_use
    middle = float(np.median(latitude_deg)), float(np.median(longitude_deg))
    if area is None or _is_near(area.bounds, *middle):
        return ()
    text = f"latitude {middle[0]:.4f}, longitude {middle[1]:.4f} is far from the area of use of {describe_crs(crs)}"
    if _is_near(area.bounds, middle[1], middle[0]):
        raise InputError(f"{text}; exchanged, they are within it", where=where,
                         advice="exchange latitude and longitude")  # fmt: skip
    return (f"{text} ({area.name})",)


def _is_near(bounds: tuple[float, float, float, float], latitude_deg: float, longitude_deg: float) -> bool:
    west, south, east, north = bounds
    # Areas over the antimeridian have their west edge east of their east edge
    width = (east - west) % 360.0 or 360.0
    beyond_west = (longitude_deg - west + _NEAR_DEG) % 360.0
    return south - _NEAR_DEG <= latitude_deg <= north + _NEAR_DEG and beyond_west <= width + 2 * _NEAR_DEG


def convergence_deg(latitude_deg: FloatArray, longitude_deg: FloatArray, frame: EarthFrame) -> FloatArray:
    """Return the meridian convergence, (n,) [deg]: grid heading = true heading - convergence.

    Notes
    -----
    The direction of a few metres of the meridian through each position is measured on the grid, which works for every
    projection.
    """
    if frame.crs == LOCAL:
        # Meridians converge towards the pole
        return np.asarray((longitude_deg - longitude_deg[0]) * np.sin(np.radians(latitude_deg[0])))
    transformer = pyproj.Transformer.from_crs(
        "EPSG:4326", _plan_of(frame.crs), always_xy=True, allow_ballpark=False
    )
    step = np.where(latitude_deg > 0.0, -1e-4, 1e-4)  # not over the pole
    east_0, north_0 = transformer.transform(longitude_deg, latitude_deg, errcheck=False)
    east_1, north_1 = transformer.transform(longitude_deg, latitude_deg + step, errcheck=False)
    sign = np.sign(step)
    # The meridian's direction on the grid, clockwise from grid north, is minus the convergence
    return np.asarray(-np.degrees(np.arctan2(sign * (east_1 - east_0), sign * (north_1 - north_0))))


def _local_places(
    latitude_deg: FloatArray,
    longitude_deg: FloatArray,
    height_m: FloatArray,
    origin_deg: tuple[float, float, float] | None,
) -> ProjectedPlaces:
    """Return positions in the tangent frame at an origin, the first of them where none is given."""
    first = float(latitude_deg[0]), float(longitude_deg[0]), float(height_m[0])
    lat_0, lon_0, h_0 = origin_deg or first
    tangent = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84"
        f" +step +proj=topocentric +ellps=WGS84 +lon_0={lon_0!r} +lat_0={lat_0!r} +h_0={h_0!r}"
    )
    xyz = np.stack(tangent.transform(longitude_deg, latitude_deg, height_m), axis=1)
    remarks = f"coordinates are metres east, north and up of latitude {lat_0:.7f}, longitude {lon_0:.7f}"
    return ProjectedPlaces(xyz, (f"{remarks}, height {h_0:.2f} m",))


def undulations(
    longitude_deg: FloatArray, latitude_deg: FloatArray, path: Path, *, where: object = None
) -> FloatArray:
    """Return the height of the geoid above the ellipsoid from a grid file, (n,) [m].

    Parameters
    ----------
    path
        A grid that PROJ reads: .gtx, or GeoTIFF.
    where
        File of the positions, for messages.

    Raises
    ------
    InputError
        The grid file is missing.
    ConfigError
        Not a geoid grid, or one that does not cover all positions.
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
        raise ConfigError("is not a geoid grid that PROJ can read", where=path,
                          advice="give the grid as .gtx or .tif") from error  # fmt: skip
    undulation = np.asarray(shifted[2], dtype=np.float64)
    if not np.isfinite(undulation).all():
        raise ConfigError(
            f"{int(np.count_nonzero(~np.isfinite(undulation)))} of {len(undulation)} places of {where} are outside"
            " of this grid", where=path, advice="give the grid of that country",
        )  # fmt: skip
    return undulation
