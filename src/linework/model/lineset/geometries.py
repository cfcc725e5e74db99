"""Lines as shapely geometries and as GeoJSON-like features, and back."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import shapely

from linework.arrays import AnyArray, IntArray, offsets_of
from linework.crs import LOCAL, parse_crs
from linework.errors import InputError, argument
from linework.model.columns import column_types
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet


def geometries(lines: LineSet) -> AnyArray:
    """Return the lines as (m,) shapely LineString Z; lines without vertices are empty ones.

    Raises
    ------
    InputError
        A line of a single vertex, of which there is no LineString.
    """
    counts = np.diff(lines.offsets)
    single = np.flatnonzero(counts == 1)
    if len(single):
        raise InputError(f"line {int(single[0])} has 1 vertex, a LineString has two or more", where="lines",
                         advice="leave such lines out")  # fmt: skip
    found = np.full(len(lines), None, dtype=object)
    drawn = np.flatnonzero(counts > 0)
    if len(drawn) < len(lines):
        found[:] = shapely.from_wkt("LINESTRING Z EMPTY")
    if len(drawn):
        place = np.cumsum(counts > 0) - 1
        found[drawn] = shapely.linestrings(lines.xyz, indices=place[lines.line_of_vertex])
    return found


def lines_of_shapes(shapes: Any, crs: object, columns: Mapping[str, Any]) -> LineSet:
    """Return a set of the lines in shapely geometries: the work of `LineSet.from_shapely`."""
    given = np.full(len(shapes), None, dtype=object)
    given[:] = list(shapes)
    wrong = [i for i, shape in enumerate(given) if shape is None or not _is_linear(shape)]
    if wrong:
        what = "nothing" if given[wrong[0]] is None else f"a {given[wrong[0]].geom_type}"
        raise InputError(f"geometry {wrong[0]} is {what}, expected lines", where=argument("shapes"),
                         advice="leave such geometries out")  # fmt: skip
    parts, feature = linear_parts(given, empty=True)
    xyz, owner = shapely.get_coordinates(parts, include_z=True, return_index=True)
    offsets = offsets_of(np.bincount(owner, minlength=len(parts)))
    own = {name: values for name, values in columns.items() if name in VERTEX_COLUMNS}
    for name, values in columns.items():
        if name in LINE_COLUMNS:
            own[name] = values if np.ndim(values) == 0 else column_values(name, values)[feature]
    unknown = sorted(set(columns) - set(own))
    if unknown:
        raise TypeError(f"from_shapely() has no column {unknown[0]!r}")
    return LineSet(xyz=xyz, offsets=offsets, crs=parse_crs(crs, where=argument("crs")), **own)


def _is_linear(shape: Any) -> bool:
    """Return whether a geometry consists of lines, or of polygons, whose rings are lines."""
    if isinstance(shape, shapely.GeometryCollection):
        return all(_is_linear(part) for part in shape.geoms)
    return "Point" not in str(shape.geom_type)


def linear_parts(shapes: AnyArray, *, empty: bool = False) -> tuple[AnyArray, IntArray]:
    """Return the LineStrings and rings in any geometries, and the index of the geometry each comes from.

    Parameters
    ----------
    empty
        Also return empty LineStrings.
    """
    kept = np.array(
        [s is not None and (not shapely.is_empty(s) or (empty and s.geom_type == "LineString")) for s in shapes],
        dtype=bool,
    )  # fmt: skip
    feature = np.flatnonzero(kept)
    parts, index = shapely.get_parts(np.asarray(shapes, dtype=object)[kept], return_index=True)
    feature = feature[index]
    # Collections may hold collections; two levels occur in real files
    parts, index = shapely.get_parts(parts, return_index=True)
    feature = feature[index]
    is_polygon = shapely.get_type_id(parts) == shapely.GeometryType.POLYGON
    rings, ring_owner = shapely.get_rings(parts[is_polygon], return_index=True)
    is_line = np.isin(
        shapely.get_type_id(parts), [shapely.GeometryType.LINESTRING, shapely.GeometryType.LINEARRING]
    )
    found = np.concatenate([parts[is_line], rings])
    owner = np.concatenate([np.flatnonzero(is_line), np.flatnonzero(is_polygon)[ring_owner]]).astype(np.int64)
    order = np.argsort(owner, kind="stable")
    return found[order], feature[owner[order]].astype(np.int64)


def column_values(name: str, values: Iterable[Any]) -> AnyArray:
    """Return a LineSet column from the values in a file; missing or invalid ones become "", False or NaN."""
    dtype = column_types(LineSet)[name].dtype
    if dtype is np.str_:
        return np.array(
            [v if isinstance(v, str) else "" if v is None else str(v) for v in values], dtype=np.str_
        )
    if dtype is np.bool_:
        return np.array([v in (1, "1", "true") for v in values], dtype=np.bool_)
    return np.array([_number(v) for v in values], dtype=np.float64)


def _number(value: Any) -> float:
    try:
        return math.nan if value is None else float(value)
    except (TypeError, ValueError):
        return math.nan


def feature_collection(lines: LineSet) -> dict[str, Any]:
    """Return the lines as a GeoJSON-like FeatureCollection: the value of `LineSet.__geo_interface__`.

    Numbers that are not known are None, columns of vertices are lists. Coordinates are those of the CRS, which
    stands beside the features in the member "crs" of the first GeoJSON (as an OGC name, or WKT2), unless "local".
    """
    values = {name: _plain(getattr(lines, name)) for name in LINE_COLUMNS + VERTEX_COLUMNS}
    features = []
    for i in range(len(lines)):
        first, last = int(lines.offsets[i]), int(lines.offsets[i + 1])
        properties = {name: values[name][i] for name in LINE_COLUMNS}
        properties |= {name: values[name][first:last] for name in VERTEX_COLUMNS}
        coordinates = tuple(map(tuple, lines.xyz[first:last].tolist()))
        geometry = {"type": "LineString", "coordinates": coordinates}
        named = {"id": str(lines.id[i])} if lines.id[i] else {}
        features.append({"type": "Feature", **named, "properties": properties, "geometry": geometry})
    collection: dict[str, Any] = {"type": "FeatureCollection", "features": features}
    if lines.crs != LOCAL:
        collection["crs"] = {"type": "name", "properties": {"name": lines.crs}}
    if len(lines.xyz) and np.isfinite(lines.xyz).all():
        collection["bbox"] = (*lines.xyz.min(axis=0).tolist(), *lines.xyz.max(axis=0).tolist())
    return collection


def _plain(values: AnyArray) -> Sequence[Any]:
    """Return a column as Python values, NaN as None."""
    if values.dtype.kind != "f":
        return list(values.tolist())
    return [None if math.isnan(v) else v for v in values.tolist()]
