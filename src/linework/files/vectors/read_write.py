"""Read and write lines; the suffix of the file decides the format."""

from __future__ import annotations

import importlib
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from linework.crs import LOCAL, describe_crs, has_height, metric_twin, parse_crs, same_crs, same_plan
from linework.errors import CrsError, LineworkWarning, UsageError, argument, check_extra, printable
from linework.files.output.inputs import check_not_read
from linework.files.output.publish import FileBeside, check_output, publish
from linework.files.vectors.cad_codes import CadCode
from linework.files.vectors.fields import check_writable
from linework.files.vectors.gdal_input import checked_vector_file
from linework.files.vectors.lane_layer import check_lanes, lane_options
from linework.files.vectors.left_out import left_out_text
from linework.files.vectors.point_layers import PointLayer, point_layers
from linework.files.vectors.pole_points import points_last
from linework.lines.names import with_ids
from linework.lines.units import in_metres, in_units_of
from linework.model.lines import LineSet
from linework.model.logs import VanLog

_Write = Callable[..., None]
_Verify = Callable[..., None]
_Read = Callable[[Path, str, "Mapping[str, str] | None", "str | None", list[str]], LineSet]
#: Module that writes each format, imported on first use: importing all of them takes 0.35 s, GeoPackage alone a tenth
#: of that (measured). Its functions are named for the format: `write_gpkg`, `verify_gpkg`.
_WRITERS = {
    ".gpkg": ("vectors.gpkg", "gpkg"),
    ".geojson": ("vectors.geojson", "geojson"),
    ".json": ("vectors.geojson", "geojson"),
    ".dxf": ("vectors.dxf", "dxf"),
    ".kml": ("vectors.kml", "kml"),
    ".fgb": ("vectors.gdal", "flatgeobuf"),
    ".parquet": ("maps.geoparquet", "geoparquet"),
    ".landxml": ("maps.landxml", "landxml"),
    ".xml": ("maps.landxml", "landxml"),
    ".osm": ("maps.lanelet2", "lanelet2"),
    ".xodr": ("maps.opendrive", "opendrive"),
}
#: Formats that need a package of an extra.
_EXTRA_OF = {".dxf": "cad", ".parquet": "parquet"}
#: Formats that hold layers of points beside the lines.
_WITH_POINTS = (".gpkg", ".geojson", ".json")
#: How the address of a database begins; paths drop one of the slashes.
_DATABASES = ("postgresql:/", "postgres:/")
#: Formats that hold the columns of vertices.
_WITH_VERTEX_COLUMNS = (*_WITH_POINTS, ".parquet")


def check_format(path: Path) -> None:
    """Raise UsageError if the suffix of the file is not that of a format in which lines are written.

    Raises
    ------
    UsageError
        Unknown suffix; the message lists the known ones.
    MissingPackageError
        The format is written by a package that is not installed.
    """
    suffix = path.suffix.lower()
    if suffix not in _WRITERS:
        raise UsageError(f"cannot write '{suffix}' files", where=path, advice=f"use {', '.join(_WRITERS)}")
    if suffix in _EXTRA_OF:
        check_extra(_EXTRA_OF[suffix], where=path)


def write_lines(
    lines: LineSet,
    path: str | Path,
    *,
    kinds: Sequence[str] = (),
    points: VanLog | Sequence[PointLayer] | None = None,
    overwrite: bool = False,
    beside: Mapping[Path, FileBeside] | None = None,
    finish: Callable[[bytes], bytes] | None = None,
    heights: str = "crs",
    codes: Sequence[CadCode] = (),
    lanes: bool = False,
    location: str = "",
) -> None:
    """Write lines in the format of the suffix.

    Parameters
    ----------
    path
        Ends in .gpkg, .geojson, .parquet, .dxf, .fgb, .kml, .landxml (or .xml), .osm (Lanelet2) or .xodr (OpenDRIVE). GeoPackage, GeoJSON
        and GeoParquet hold all columns; `not_expressed` says what the others leave out.
    kinds
        Kinds that get a layer even without lines (formats with layers).
    points
        Photos and events, as layers of points; left out by formats that cannot hold them (see `points_left_out`).
    beside
        Files that belong to it, as for `publish`.
    finish
        Adds tables to the bytes of a GeoPackage before they are written; ignored for other formats.
    heights
        Of a Lanelet2 map: those of the CRS, or above the ellipsoid ("ellipsoid"), which needs the grid of the geoid.
    codes
        Feature codes of a DXF file, as `linework.files.vectors.cad_codes.read_cad_codes` reads them.
    lanes
        Also write the lanes between the lines (see `linework.lines.lanes.find_lanes`): .gpkg, .geojson, .osm, .xodr.
    location
        Of the lanelets of an .osm: "urban", "nonurban" or "private".

    Raises
    ------
    UsageError
        Not a path, unknown suffix, heights, lanes or codes for a format that has none, a coordinate that is not finite, a line of fewer than two vertices, or a file of a survey that
        was opened would be replaced.
    OutputExistsError, MachineError
        As for `publish`.

    Notes
    -----
    The same lines give the same bytes.

    Examples
    --------
    >>> import numpy as np, tempfile
    >>> lines = LineSet.from_lines([np.array([[0.0, 0.0, 5.0], [9.0, 0.0, 5.0]])], kind="guardrail")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_lines(lines, f"{folder}/lines.gpkg")
    ...     read_lines(f"{folder}/lines.gpkg") == lines
    True
    """
    _check_path(path)
    path = Path(path)
    check_format(path)
    check_lanes(path, lanes=lanes, location=location)
    check_writable(lines, path)
    lines = points_last(lines)
    if lanes:
        # Lanes name their lines
        lines = with_ids(lines, ())
    write, verify = _writer(path)
    extra: dict[str, Any] = {"points": point_layers(points)} if path.suffix.lower() in _WITH_POINTS else {}
    if path.suffix.lower() == ".osm":
        extra["heights"] = heights
    elif heights != "crs":
        raise UsageError(f"{argument('heights', heights)} is for .osm files", where=path,
                         advice=f"leave {argument('heights')} out")  # fmt: skip
    if path.suffix.lower() == ".dxf":
        extra["codes"] = codes
    elif codes:
        raise UsageError(
            f"{argument('codes')} is for .dxf files", where=path, advice=f"leave {argument('codes')} out"
        )
    extra |= lane_options(lines, path, lanes=lanes, location=location)
    beside = dict(beside or {})
    prj = path.with_suffix(".prj")
    if path.suffix.lower() == ".dxf":
        from linework.files.vectors.dxf import prj_of

        beside[prj] = lambda _: prj_of(lines.crs)
    for output in (path, *beside):
        check_not_read(output)
    for output in (path, prj) if prj in beside else (path,):
        check_output(output, overwrite=overwrite)
    if path.suffix.lower() == ".gpkg" and path.is_file():
        from linework.files.vectors.gpkg import roll_back

        # A journal left beside the old file would be applied to the new one
        roll_back(path)

    added = {"finish": finish} if finish is not None and path.suffix.lower() == ".gpkg" else {}
    publish(
        path,
        lambda part: write(lines, part, kinds, **extra, **added),
        lambda part: verify(part, lines, path, **extra),
        overwrite=overwrite,
        beside=beside,
    )


def points_left_out(path: Path, points: VanLog | Sequence[PointLayer] | None) -> tuple[str, ...]:
    """Return a warning about layers of points that this file's format cannot hold, or none."""
    layers = () if path.suffix.lower() in _WITH_POINTS else point_layers(points)
    if not layers:
        return ()
    named = " and ".join(f"{layer.name} ({len(layer.xyz)} points)" for layer in layers)
    return (
        f"{path}: {named} left out, {path.suffix} files hold only lines ({', '.join(_WITH_POINTS)} hold both)",
    )


def not_expressed(lines: LineSet, path: Path, location: str = "") -> tuple[str, ...]:
    """Return a warning about what of the lines this file's format cannot hold, or none; of lanes, with a location."""
    suffix = path.suffix.lower()
    found: list[str] = []
    if suffix == ".osm":
        from linework.files.maps.lanelet2 import lanelet2_losses

        found += lanelet2_losses(lines, location)
    if suffix == ".xodr":
        from linework.files.maps.opendrive import opendrive_losses

        found += opendrive_losses(lines)
    if suffix not in _WITH_VERTEX_COLUMNS and len(lines):
        if np.isfinite(lines.sigma_xy_m).any() or np.isfinite(lines.sigma_z_m).any():
            found.append("the standard deviations of the vertices")
        if lines.bridged.any():
            found.append("where lines are bridged")
        if suffix == ".kml":
            found.append("all attributes")
    return (f"{path}: left out {', '.join(found)}; .gpkg holds everything",) if found else ()


def _check_path(path: object) -> None:
    """Refuse what is not a path, as `None` where a function returned nothing."""
    if not isinstance(path, str | os.PathLike):
        raise UsageError(f"{path!r:.60} is not a path", where="path", advice="name a file of lines")


def read_lines(
    path: str | Path, *, kind_field: str = "kind", kinds: Mapping[str, str] | None = None, crs: Any = None
) -> LineSet:
    """Read lines from a file written by linework or by another program.

    Parameters
    ----------
    kind_field
        Attribute that holds the kind of a feature; where there is none, the layer name is the kind.
    kinds
        Kinds by the names used in the file; features with other names are left out.
    crs
        CRS where the file does not state it, or is local: "EPSG:...", an EPSG code, a `pyproj.CRS`, WKT or "local" (the
        default).

    Returns
    -------
    LineSet
        Files written by linework are read back exactly. From other files, multi-part geometries become one line per
        part, polygons one closed line per ring, and missing heights are NaN (such lines cannot be written).

    Raises
    ------
    UsageError
        Not a path.
    InputError
        Not a readable file of lines, or none of its features can be read.
    CrsError
        The coordinates are in degrees, the layers have different CRSs, or the file states another one than `crs`.

    Warns
    -----
    LineworkWarning
        Features whose geometry cannot be read were left out: with the first of them and its vertex.
    """
    lines, left_out = read_usable_lines(path, kind_field=kind_field, kinds=kinds, crs=crs)
    if left_out:
        warnings.warn(printable(left_out), LineworkWarning, stacklevel=2)
    return lines


def read_usable_lines(
    path: str | Path, *, kind_field: str = "kind", kinds: Mapping[str, str] | None = None, crs: Any = None
) -> tuple[LineSet, str]:
    """Read lines as `read_lines` does, and return one line about the features left out, "" for none."""
    _check_path(path)
    given = None if crs is None else parse_crs(crs, where=argument("crs"))
    if str(path).startswith(_DATABASES):
        check_extra("postgis", where=argument("lines"))
        from linework.files.postgis.read import read_database

        return _in_crs(read_database(path, kind_field, kinds), given, Path(path)), ""
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in _READERS:
        raise UsageError(
            f"cannot read lines from '{suffix}' files", where=path, advice=f"use {', '.join(_READERS)}"
        )
    left_out: list[str] = []
    found = _READERS[suffix](path, kind_field, kinds, given, left_out)
    return _in_crs(found, given, path), left_out_text(left_out, len(found), path)


def _in_crs(found: LineSet, given: str | None, path: Path) -> LineSet:
    """Return lines in the CRS that their file states, or else in the given one; both must agree.

    Maps are read in metres. A given CRS in feet is that of the lines then, too; without heights, these are in the unit of
    the plan.
    """
    if given in (None, found.crs):
        return found
    if found.crs == LOCAL:
        return found.with_columns(crs=given)
    twin = metric_twin(given)
    agrees = same_plan(found.crs, given)
    if twin != given and (found.crs == twin or (not agrees and same_plan(found.crs, twin))):
        metres = in_metres(found)
        # A datum of the heights that only one of them states is that of both
        agrees = not (has_height(metres.crs) and has_height(twin)) or same_crs(metres.crs, twin)
        if agrees:
            return in_units_of(metres, given)
    if not agrees:
        raise CrsError(
            f"two different CRSs: the file says {describe_crs(found.crs)}, {argument('crs')} says {describe_crs(given)}",
            where=path, advice=f"leave {argument('crs')} out, or correct what the file states",
        )  # fmt: skip
    return found


def _writer(path: Path) -> tuple[_Write, _Verify]:
    """Return the functions that write and verify a file of this format."""
    place, name = _WRITERS[path.suffix.lower()]
    module = importlib.import_module(f"linework.files.{place}")
    return getattr(module, f"write_{name}"), getattr(module, f"verify_{name}")


def _read_gpkg(
    path: Path, kind_field: str, kinds: Mapping[str, str] | None, crs: str | None, left_out: list[str]
) -> LineSet:
    """Read a GeoPackage: exactly if linework wrote it, else by its geometries and fields."""
    from linework.files.vectors.gdal import read_foreign
    from linework.files.vectors.gpkg import read_own_gpkg, roll_back

    checked = checked_vector_file(path)
    roll_back(checked)
    with np.errstate(invalid="ignore"):
        own = read_own_gpkg(checked) if kinds is None and kind_field == "kind" else None
    return (
        own
        if own is not None and np.isfinite(own.xyz).all()
        else read_foreign(checked, kind_field, kinds, crs, left_out)
    )


def _read_with_gdal(
    path: Path, kind_field: str, kinds: Mapping[str, str] | None, crs: str | None, left_out: list[str]
) -> LineSet:
    from linework.files.vectors.gdal import read_foreign

    return read_foreign(checked_vector_file(path), kind_field, kinds, crs, left_out)


def _read_geojson(
    path: Path, kind_field: str, kinds: Mapping[str, str] | None, crs: str | None, left_out: list[str]
) -> LineSet:
    from linework.files.vectors.geojson import read_geojson

    return read_geojson(path, kind_field, kinds, crs, left_out)


def _read_dxf(
    path: Path, kind_field: str, kinds: Mapping[str, str] | None, crs: str | None, left_out: list[str]
) -> LineSet:
    from linework.files.vectors.dxf import read_dxf

    return read_dxf(path, kind_field, kinds, crs, left_out)


def _read_geoparquet(
    path: Path, kind_field: str, kinds: Mapping[str, str] | None, crs: str | None, left_out: list[str]
) -> LineSet:
    check_extra("parquet", where=path)
    from linework.files.maps.geoparquet import read_geoparquet

    return read_geoparquet(path, kind_field, kinds, crs, left_out)


def _read_landxml(
    path: Path, kind_field: str, kinds: Mapping[str, str] | None, crs: str | None, left_out: list[str]
) -> LineSet:
    from linework.files.maps.landxml import read_landxml

    return read_landxml(path, kind_field, kinds, crs, left_out)


def _read_lanelet2(
    path: Path, kind_field: str, kinds: Mapping[str, str] | None, crs: str | None, left_out: list[str]
) -> LineSet:
    from linework.files.maps.lanelet2 import read_lanelet2

    return read_lanelet2(path, kind_field, kinds, crs, left_out)


def _read_opendrive(
    path: Path, kind_field: str, kinds: Mapping[str, str] | None, crs: str | None, left_out: list[str]
) -> LineSet:
    from linework.files.maps.opendrive_read import read_opendrive

    return read_opendrive(path, kind_field, kinds, crs, left_out)


_READERS: dict[str, _Read] = {
    ".gpkg": _read_gpkg,
    ".geojson": _read_geojson,
    ".json": _read_geojson,
    ".dxf": _read_dxf,
    ".fgb": _read_with_gdal,
    ".shp": _read_with_gdal,
    ".parquet": _read_geoparquet,
    ".landxml": _read_landxml,
    ".xml": _read_landxml,
    ".osm": _read_lanelet2,
    ".xodr": _read_opendrive,
}
