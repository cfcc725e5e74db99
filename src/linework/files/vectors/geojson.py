"""Lines as GeoJSON: all kinds in one collection, vertex columns as array properties, the CRS in a `crs` member.

Separate from `read_write`, which chooses a format by suffix and imports it only then: here is all that is particular to
GeoJSON.

Coordinates are projected metres, as in the survey: not allowed by RFC 7946, which has degrees only, but read by
QGIS and GDAL. The full CRS is repeated as WKT2 in the member `crs_wkt`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import shapely.geometry

from linework.arrays import AnyArray, offsets_of
from linework.crs import LOCAL, epsg_text, same_crs, stated_crs
from linework.errors import CrsError, InputError, MachineError, argument
from linework.files.documents import read_json
from linework.files.input import regular_file_bytes
from linework.files.vectors.fields import (
    LANE_LAYER,
    OPTIONAL_FIELDS,
    field_values,
    fields_of_kind,
    vertex_columns,
)
from linework.files.vectors.gdal import foreign_lines, no_lines_error
from linework.files.vectors.lane_layer import lane_fields
from linework.files.vectors.left_out import bad_position
from linework.files.vectors.point_layers import PointLayer
from linework.files.vectors.pole_points import is_point, upright
from linework.lines.lanes import Lanes
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet
from linework.model.lineset.geometries import column_values

#: Properties with one value per vertex.
_VERTEX_PROPERTIES = {name: f"vertex_{name}" for name in VERTEX_COLUMNS}
#: CRS of local coordinates in metres.
_LOCAL_WKT = (
    'ENGCRS["local",EDATUM["unknown"],CS[Cartesian,2],AXIS["x",east],AXIS["y",north],LENGTHUNIT["metre",1]]'
)
#: Largest file [bytes]: it is read whole, into ten times its size in memory.
_MAX_BYTES = 1 << 29


def write_geojson(
    lines: LineSet,
    part: Path,
    kinds: Sequence[str] = (),  # noqa: ARG001
    points: Sequence[PointLayer] = (),
    lanes: Lanes | None = None,
) -> None:
    """Write lines, then points and lanes, as one FeatureCollection, a feature per line of text (called through `publish`).

    The points of a layer have its name as their `kind`; lanes have the kind "lane".
    """
    head = {"type": "FeatureCollection", "name": "lines", "crs": _crs_member(lines.crs), "crs_wkt": lines.crs}
    with part.open("w", encoding="utf-8", newline="\n") as file:
        file.write(_text(head)[:-1] + ',"features":[')
        for i, feature in enumerate(
            chain(_line_features(lines), _point_features(points), _lane_features(lanes))
        ):
            file.write(("\n" if i == 0 else ",\n") + _text(feature))
        file.write("\n]}\n")


def _line_features(lines: LineSet) -> Iterator[dict[str, Any]]:
    values = {name: _plain(column) for name, column in field_values(lines).items()}
    vertex = {name: _plain(getattr(lines, name)) for name in vertex_columns(lines)}
    points = is_point(lines)
    for i in range(len(lines)):
        start, end = int(lines.offsets[i]), int(lines.offsets[i + 1])
        properties = {name: values[name][i] for name in fields_of_kind(str(lines.kind[i]), values)}
        properties |= {_VERTEX_PROPERTIES[name]: column[start:end] for name, column in vertex.items()}
        xyz = lines[i].xyz.tolist()
        yield _feature(properties, *(("Point", xyz[0]) if points[i] else ("LineString", xyz)))


def _point_features(points: Sequence[PointLayer]) -> Iterator[dict[str, Any]]:
    for layer in points:
        values = {name: _plain(column) for name, column in layer.fields.items()}
        for i, place in enumerate(layer.xyz.tolist()):
            properties = {"kind": layer.name} | {name: column[i] for name, column in values.items()}
            yield _feature(properties, "Point", place)


def _lane_features(lanes: Lanes | None) -> Iterator[dict[str, Any]]:
    if lanes is not None:
        values = {name: _plain(column) for name, column in lane_fields(lanes).items()}
        for i in range(len(lanes)):
            properties = {"kind": LANE_LAYER} | {name: column[i] for name, column in values.items()}
            yield _feature(properties, "LineString", lanes.centre[i].xyz.tolist())


def _feature(properties: dict[str, Any], kind: str, coordinates: Any) -> dict[str, Any]:
    return {
        "type": "Feature",
        "properties": properties,
        "geometry": {"type": kind, "coordinates": coordinates},
    }


def _text(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def _plain(column: AnyArray) -> list[Any]:
    """Return a column as JSON values: NaN and "" as null."""
    if column.dtype.kind == "f":
        return [None if math.isnan(v) else v for v in column.tolist()]
    if column.dtype.kind == "U":
        return [v or None for v in column.tolist()]
    return list(column.tolist())


def _crs_member(crs: str) -> dict[str, Any]:
    """Return the `crs` member that GDAL and QGIS read: codes, else WKT; without it they assume degrees."""
    codes = epsg_text(crs).removeprefix("EPSG:").split("+")
    name = "urn:ogc:def:crs:EPSG::" + codes[0]
    if codes == [""]:
        name = _LOCAL_WKT if crs == LOCAL else crs
    elif len(codes) == 2:
        name = f"urn:ogc:def:crs,crs:EPSG::{codes[0]},crs:EPSG::{codes[1]}"
    return {"type": "name", "properties": {"name": name}}


def verify_geojson(
    part: Path, lines: LineSet, path: Path, points: Sequence[PointLayer] = (), lanes: Lanes | None = None
) -> None:
    """Read the file back and compare every coordinate of the lines, and the number of points.

    Raises
    ------
    MachineError
        Not the lines that were written.
    """
    back = read_geojson(part, "kind", None, None, [])
    n_features = len(lines) + sum(len(layer.xyz) for layer in points) + len(lanes or ())
    same = same_crs(back.crs, lines.crs) and np.array_equal(back.xyz, lines.xyz) and len(back) == len(lines)
    if not same or len(_load(part)["features"]) != n_features:
        raise MachineError(
            "written file does not read back the same", where=path, advice="check for free space"
        )


def read_geojson(
    path: Path, kind_field: str, kinds: Mapping[str, str] | None, crs: str | None, left_out: list[str]
) -> LineSet:
    """Read the lines of a GeoJSON file, our own exactly; points that are no poles, and our lanes, are skipped.

    Features whose geometry cannot be read are added to `left_out`.

    Raises
    ------
    InputError
        Not GeoJSON.
    CrsError
        Coordinates in degrees, or an unknown CRS.
    """
    document = _load(path)
    features = [f for f in document.get("features", [document]) if isinstance(f, dict)]
    if "crs_wkt" in document:
        features = [f for f in features if not _is_lane(f.get("properties"))]
    read = [_shape(feature, i, left_out) for i, feature in enumerate(features)]
    shapes = np.array([*read, None], dtype=object)[:-1]
    own_crs = _crs_of(document, shapes, crs, path)
    tables = [p if isinstance(p := f.get("properties"), dict) else {} for f in features]
    shapes = upright(shapes, [t.get("kind") for t in tables], [t.get("height_m") for t in tables])
    chosen = np.flatnonzero(shapely.get_type_id(shapes) != shapely.GeometryType.POINT)
    features, shapes = [features[i] for i in chosen], shapes[chosen]
    tables = [f.get("properties") or {} for f in features]
    names = {name for table in tables for name in table}
    columns = {name: [table.get(name) for table in tables] for name in names}
    if "crs_wkt" in document and kinds is None and kind_field == "kind" and not left_out:
        own = _own_lines(shapes, columns, own_crs)
        if own is not None:
            return own
    values = columns.get(kind_field, [path.stem] * len(features))
    numbered = [f"feature {i + 1}" for i in chosen]
    found = foreign_lines(shapes, values, columns, kinds, own_crs, path, left_out, numbered)
    if kinds is None and not left_out and not len(found) and read and "crs_wkt" not in document:
        raise no_lines_error(np.array([*read, None], dtype=object)[:-1], path)
    return found


def _is_lane(properties: Any) -> bool:
    return isinstance(properties, dict) and properties.get("kind") == LANE_LAYER and "left_id" in properties


def _load(path: Path) -> dict[str, Any]:
    n_bytes = regular_file_bytes(path)
    if n_bytes == 0:
        raise InputError("empty file (0 bytes)", where=path, advice="copy the file again")
    if n_bytes > _MAX_BYTES:
        raise InputError(f"{n_bytes:,} bytes of GeoJSON, at most {_MAX_BYTES:,}", where=path,
                         advice="convert it to .gpkg")  # fmt: skip
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"is not JSON: not UTF-8 (byte {error.start:,})", where=path,
                         advice="save it as UTF-8") from error  # fmt: skip
    document = read_json(text, path)
    if not isinstance(document, dict) or "type" not in document:
        raise InputError("is JSON, but not GeoJSON (no type)", where=path, advice="check what this file is")
    if not isinstance(document.get("features", []), list):
        raise InputError(
            "is not GeoJSON: features is not a list", where=path, advice="check what this file is"
        )
    return document


def _shape(feature: dict[str, Any], i: int, left_out: list[str]) -> Any:
    """Return the geometry of a feature; None without one, or where it is left out."""
    geometry = feature.get("geometry", feature if "coordinates" in feature else None)
    if geometry is None:
        return None
    problem = ""
    if isinstance(geometry, dict) and "coordinates" in geometry and geometry["coordinates"] != []:
        problem = bad_position(geometry["coordinates"])
    if problem:
        left_out.append(f"feature {i + 1}: {problem}")
        return None
    try:
        return shapely.geometry.shape(geometry)
    except (
        ValueError,
        TypeError,
        KeyError,
        AttributeError,
        RecursionError,
        shapely.errors.ShapelyError,
    ) as error:
        left_out.append(f"feature {i + 1}: an invalid geometry ({str(error)[:80]})")
        return None


def _crs_of(document: dict[str, Any], shapes: AnyArray, given: str | None, path: Path) -> str:
    """Return the CRS; without a `crs` member the range of the coordinates tells degrees (RFC 7946) from metres."""
    wkt, member = document.get("crs_wkt"), document.get("crs")
    properties = member.get("properties") if isinstance(member, dict) else None
    name = _epsg_of(str(properties.get("name", "")) if isinstance(properties, dict) else "")
    if isinstance(wkt, str):
        own = stated_crs(wkt, given, where=path)
        codes = epsg_text(own)
        # Our own files name the same CRS twice
        if codes and name.startswith("EPSG:") and not (codes + "+").startswith(name + "+"):
            raise CrsError(
                f"names two CRSs: crs is {name}, crs_wkt is {codes}", where=path,
                advice="remove the member that is wrong",
            )  # fmt: skip
        return own
    if isinstance(member, dict):
        return stated_crs(name, given, where=path)
    if given is not None:
        return given
    bounds = shapely.total_bounds(shapes)
    in_degrees = np.all(np.abs(bounds[[0, 2]]) <= 180.0) and np.all(np.abs(bounds[[1, 3]]) <= 90.0)
    if "crs" not in document and in_degrees:
        raise CrsError(
            "no CRS and coordinates within 180, 90: degrees (RFC 7946), lengths need metres", where=path,
            advice=f"transform it to a projected CRS, or give {argument('crs', 'local')} if these are metres",
        )  # fmt: skip
    return LOCAL


def _epsg_of(name: str) -> str:
    """Return "EPSG:n+m" for the forms of a `crs` member's name, or the name itself (WKT).

    >>> _epsg_of("urn:ogc:def:crs:EPSG::25832"), _epsg_of("urn:ogc:def:crs,crs:EPSG::25832,crs:EPSG::7837")
    ('EPSG:25832', 'EPSG:25832+7837')
    >>> _epsg_of("urn:ogc:def:crs:OGC:1.3:CRS84")
    'EPSG:4326'
    """
    if "CRS84" in name:
        return "EPSG:4326"
    if "[" in name:
        return name
    codes = [piece.split(":")[-1] for piece in name.split(",") if "EPSG" in piece.upper()]
    return "EPSG:" + "+".join(codes) if codes else name


def _own_lines(shapes: AnyArray, columns: Mapping[str, list[Any]], crs: str) -> LineSet | None:
    """Return our own lines with their vertex columns; None where the geometry was changed since."""
    optional = {*OPTIONAL_FIELDS, _VERTEX_PROPERTIES["observed"]}
    wanted = {*LINE_COLUMNS, *_VERTEX_PROPERTIES.values()} - optional
    if not len(shapes):
        return LineSet.empty(crs)
    if not wanted <= set(columns) or not (shapely.get_type_id(shapes) == 1).all():
        return None
    counts = shapely.get_num_coordinates(shapes)
    vertex: dict[str, Any] = {}
    for name, label in _VERTEX_PROPERTIES.items():
        if label in optional and label not in columns:
            continue
        lists = columns[label]
        if [len(v) if isinstance(v, list) else -1 for v in lists] != counts.tolist():
            return None
        vertex[name] = column_values(name, [v for values in lists for v in values])
    own: dict[str, Any] = {
        name: column_values(name, columns.get(name, [None] * len(shapes))) for name in LINE_COLUMNS
    }
    offsets = offsets_of(counts)
    xyz = shapely.get_coordinates(shapes, include_z=True)
    return LineSet(xyz=xyz, offsets=offsets, crs=crs, **vertex, **own)
