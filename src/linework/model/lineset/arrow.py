"""Lines as an Arrow table with a GeoArrow geometry, and back.

Separate from `linework.model.lineset.for_others`: each library has a module of its own.

References
----------
The Arrow PyCapsule interface; GeoArrow 0.2: type linestring with separated coordinates, CRS in the metadata of the
field. The table is made with arro3-core (11 MB; pyarrow has 176 MB), and read by pyarrow, polars, DuckDB and GeoPandas.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import shapely

from linework.arrays import AnyArray, IntArray, offsets_of
from linework.crs import LOCAL, parse_crs
from linework.errors import InputError, argument, needed
from linework.model.columns import column_types
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet
from linework.model.lineset.frames import warn_of_left_out
from linework.model.lineset.geometries import column_values, lines_of_shapes

GEOMETRY = "geometry"
_EXTENSION, _METADATA = "ARROW:extension:name", "ARROW:extension:metadata"
#: First words of WKT2; those of WKT1 have "CS" at the end.
_WKT2 = re.compile(r"[A-Z]+CRS\[")
_LINESTRING, _WKB = "geoarrow.linestring", ("geoarrow.wkb", "ogc.wkb")


def table_of(lines: LineSet) -> Any:
    """Return the lines as an `arro3.core.Table`: a row per line, lists for the columns of vertices."""
    core = needed("arro3.core", "tables", where="__arrow_c_stream__()")
    if lines.offsets[-1] > np.iinfo(np.int32).max:
        raise InputError(
            f"{int(lines.offsets[-1]):,} vertices, an Arrow list holds 2,147,483,647", where="lines"
        )
    offsets = core.Array.from_numpy(lines.offsets.astype(np.int32))
    axes = [core.Array.from_numpy(np.ascontiguousarray(lines.xyz[:, axis])) for axis in range(3)]
    fields = [core.Field(name, core.DataType.float64(), nullable=False) for name in "xyz"]
    shapes = core.list_array(offsets, core.struct_array(axes, fields=fields))
    columns = {GEOMETRY: shapes}
    for name in LINE_COLUMNS:
        columns[name] = _array(core, getattr(lines, name))
    for name in VERTEX_COLUMNS:
        columns[name] = core.list_array(offsets, _array(core, getattr(lines, name)))
    metadata = {_EXTENSION: _LINESTRING, _METADATA: _crs_metadata(lines.crs)}
    schema = [core.Field(GEOMETRY, shapes.type, nullable=False, metadata=metadata)]
    schema += [core.Field(name, columns[name].type, nullable=False) for name in LINE_COLUMNS + VERTEX_COLUMNS]
    return core.Table.from_arrays(list(columns.values()), schema=core.Schema(schema))


def _array(core: Any, values: AnyArray) -> Any:
    if values.dtype.kind == "U":
        return core.Array(values.tolist(), core.DataType.utf8())
    return core.Array.from_numpy(values)


def _crs_metadata(crs: str) -> str:
    """Return the CRS as GeoArrow states it.

    As WKT2 and not as PROJJSON, which would need PROJ: DuckDB asks for the stream in a thread of its own, where PROJ
    crashes (pyproj 3.7.2, DuckDB 2.0.0).
    """
    if crs == LOCAL:
        return "{}"
    return json.dumps({"crs": crs} | ({"crs_type": "wkt2:2019"} if _WKT2.match(crs) else {}))


def lines_of_table(table: Any, crs: object, columns: Mapping[str, Any]) -> LineSet:
    """Return the lines of an Arrow table: the work of `LineSet.from_arrow`."""
    core = needed("arro3.core", "tables", where="from_arrow()")
    if not hasattr(table, "__arrow_c_stream__"):
        raise TypeError(f"from_arrow() takes an Arrow table or stream, not {type(table).__name__}")
    read = core.Table.from_arrow(table)
    fields = {field.name: field for field in (read.schema.field(i) for i in range(len(read.schema)))}
    name = _geometry_field(fields)
    stated = _stated_crs(fields[name])
    found_crs = parse_crs(stated or crs, where="from_arrow()" if stated else argument("crs"))
    given: dict[str, Any] = {}
    for column in LINE_COLUMNS:
        if column in fields and column not in columns:
            given[column] = column_values(column, read[column].to_pylist())
    if read.num_rows == 0:
        return LineSet.empty(found_crs)
    shapes = read[name].combine_chunks()
    is_wkb = "Binary" in str(shapes.type)
    if is_wkb:
        parsed = shapely.from_wkb(shapes.to_pylist())
        offsets = offsets_of(shapely.get_num_coordinates(parsed))
    else:
        xyz, offsets = _coordinates(core, shapes, name)
    for column in VERTEX_COLUMNS:
        if column in fields and column not in columns and "List" in str(fields[column].type):
            given[column] = _vertex_column(core, read[column], column, offsets)
    given |= columns
    warn_of_left_out([field for field in fields if field != name], given)
    if is_wkb:
        return lines_of_shapes(parsed, found_crs, given)
    return LineSet(xyz=xyz, offsets=offsets, crs=found_crs, **given)


def _geometry_field(fields: Mapping[str, Any]) -> str:
    """Return the column of the geometry: the one that says so, or the one that is named so."""
    stated = [
        name for name, field in fields.items() if _metadata_of(field, _EXTENSION) in (_LINESTRING, *_WKB)
    ]
    named = [name for name in (GEOMETRY, "geom") if name in fields]
    if not stated + named:
        raise InputError(
            f"no column of lines among {', '.join(fields) or 'no columns'}", where=argument("table"),
            advice="name it geometry",
        )  # fmt: skip
    return (stated + named)[0]


def _metadata_of(field: Any, key: str) -> str:
    found = dict(field.metadata_str or {}).get(key, "")
    return str(found)


def _stated_crs(field: Any) -> str:
    """Return the CRS that GeoArrow's metadata state, as WKT2; "" without one."""
    text = _metadata_of(field, _METADATA)
    stated = json.loads(text).get("crs") if text else None
    if not stated:
        return ""
    import pyproj

    return str(pyproj.CRS.from_user_input(stated).to_wkt("WKT2_2019"))


def _coordinates(core: Any, shapes: Any, name: str) -> tuple[AnyArray, IntArray]:
    """Return (n, 3) vertices and (m + 1,) offsets of a column of lists of positions."""
    offsets = _offsets(core, shapes, name)
    positions = core.list_flatten(shapes)
    if "FixedSizeList" in str(positions.type):
        size = positions.type.list_size
        xyz = core.list_flatten(positions).to_numpy().reshape(-1, size)[:, :3].astype(np.float64)
    else:
        axes = [field.name for field in positions.type.fields or ()]
        if not {"x", "y"} <= set(axes):
            raise InputError(
                f"column {name} holds {_type_text(positions)}, expected lines", where=argument("table")
            )
        xyz = np.stack(
            [core.struct_field(positions, axes.index(axis)).to_numpy() for axis in "xyz" if axis in axes], 1
        )
    if xyz.shape[1] == 2:
        xyz = np.column_stack([xyz, np.full(len(xyz), np.nan)])
    return xyz[offsets[0] : offsets[-1]], offsets - offsets[0]


def _vertex_column(core: Any, column: Any, name: str, offsets: IntArray) -> AnyArray:
    array = column.combine_chunks()
    if not np.array_equal(np.diff(_offsets(core, array, name)), np.diff(offsets)):
        raise InputError(f"column {name} has other numbers of values than the lines have vertices", where=argument("table"),
                         advice="leave the column out, or correct it")  # fmt: skip
    dtype = column_types(LineSet)[name].dtype
    values = core.list_flatten(array)
    missing = np.nan if dtype is np.float64 else False
    return np.array([missing if v is None else v for v in values.to_pylist()], dtype=dtype)


def _offsets(core: Any, array: Any, name: str) -> IntArray:
    if "List" not in str(array.type):
        raise InputError(f"column {name} holds {_type_text(array)}, expected lists", where=argument("table"))
    if array.null_count:
        raise InputError(f"column {name} has {array.null_count} rows without a value", where=argument("table"),
                         advice="leave such rows out")  # fmt: skip
    return np.asarray(core.list_offsets(array).to_numpy(), dtype=np.int64)


def _type_text(array: Any) -> str:
    """Return the type of an array for messages."""
    return str(array.type).strip().removeprefix("arro3.core.DataType<").removesuffix(">")
