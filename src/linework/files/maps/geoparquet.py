"""Lines as GeoParquet 1.1: a row per line, lists for the columns of vertices.

References
----------
OGC GeoParquet 1.1.0: WKB, PROJJSON, a covering box per row. Rows are in spatial order (Morton), in row groups, so that
a reader of a part of the file can skip the rest; the column `line` keeps the order of the set.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import shapely

from linework.arrays import AnyArray, FloatArray, IntArray, offsets_of
from linework.crs import LOCAL, parse_crs, stated_crs
from linework.errors import InputError, MachineError, extra_needed
from linework.files.input import open_input
from linework.files.vectors.fields import OPTIONAL_FIELDS, field_values, vertex_columns
from linework.files.vectors.gdal import foreign_lines
from linework.files.vectors.gpkg import null_if_empty
from linework.files.vectors.pole_points import feature_shapes, is_point, upright
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet
from linework.model.lineset.geometries import column_values

with extra_needed("parquet"):
    import pyarrow
    import pyarrow.parquet

_GEOMETRY, _BBOX, _LINE = "geometry", "bbox", "line"
#: Rows of a group: a box of 10 km with 10,000 lines is read in three groups, and a group is 1 to 5 MB.
_GROUP_ROWS = 4096
#: Bits of each axis in the order of the rows: cells of a millimetre over 60 km.
_MORTON_BITS = 26
#: Our columns of vertices are told from those of lines by a word before the name.
_PREFIX = "vertex_"
#: A covering has exactly these, and none for heights.
_SIDES = ("xmin", "ymin", "xmax", "ymax")


def write_geoparquet(lines: LineSet, part: Path, kinds: Sequence[str] = ()) -> None:  # noqa: ARG001
    """Write GeoParquet (called through `publish`); all kinds are in one table."""
    order = _spatial_order(lines)
    values = field_values(lines)
    columns: dict[str, Any] = {_LINE: pyarrow.array(order)}
    for name, column in values.items():
        columns[name] = _arrow_column(column[order])
    runs = [np.arange(lines.offsets[i], lines.offsets[i + 1]) for i in order]
    vertices = np.concatenate(runs) if runs else np.zeros(0, dtype=np.int64)
    offsets = pyarrow.array(offsets_of(np.diff(lines.offsets)[order]).astype(np.int32))
    for name in vertex_columns(lines):
        inner = _arrow_column(getattr(lines, name)[vertices])
        columns[_PREFIX + name] = pyarrow.ListArray.from_arrays(offsets, inner)
    boxes = _boxes(lines)[order][:, [0, 1, 3, 4]]
    columns[_BBOX] = pyarrow.StructArray.from_arrays(
        [pyarrow.array(boxes[:, i]) for i in range(len(_SIDES))], names=list(_SIDES)
    )
    shapes = shapely.to_wkb(feature_shapes(lines)[order], flavor="iso")
    columns[_GEOMETRY] = pyarrow.array(shapes.tolist(), type=pyarrow.binary())
    table = pyarrow.table(columns).replace_schema_metadata({"geo": json.dumps(_metadata(lines))})
    pyarrow.parquet.write_table(table, part, compression="zstd", row_group_size=_GROUP_ROWS, version="2.6")


def _arrow_column(values: AnyArray) -> Any:
    if values.dtype.kind == "U":
        return pyarrow.array(null_if_empty(values), type=pyarrow.string())
    if values.dtype.kind == "f":
        return pyarrow.array(values, type=pyarrow.float64(), from_pandas=True)
    return pyarrow.array(values)


def _boxes(lines: LineSet) -> FloatArray:
    """Return (m, 6) float64: the lowest and the highest coordinates of each line."""
    if not len(lines):
        return np.zeros((0, 6))
    starts = lines.offsets[:-1]
    return np.hstack([np.minimum.reduceat(lines.xyz, starts), np.maximum.reduceat(lines.xyz, starts)])


def _spatial_order(lines: LineSet) -> IntArray:
    """Return (m,) int64: the lines by the Morton number of the middle of their boxes."""
    if not len(lines):
        return np.zeros(0, dtype=np.int64)
    boxes = _boxes(lines)
    middle = (boxes[:, :2] + boxes[:, 3:5]) / 2
    low = middle.min(axis=0)
    size = max(float(np.ptp(middle, axis=0).max()), 1e-3)
    cells = np.minimum((middle - low) / size * (1 << _MORTON_BITS), (1 << _MORTON_BITS) - 1).astype(np.int64)
    number = np.zeros(len(lines), dtype=np.int64)
    for bit in range(_MORTON_BITS):
        number |= ((cells[:, 0] >> bit) & 1) << (2 * bit)
        number |= ((cells[:, 1] >> bit) & 1) << (2 * bit + 1)
    return np.argsort(number, kind="stable").astype(np.int64)


def _metadata(lines: LineSet) -> dict[str, Any]:
    column: dict[str, Any] = {
        "encoding": "WKB",
        "geometry_types": _geometry_types(lines),
        # Without a CRS readers take degrees; null says that it is not known
        "crs": None if lines.crs == LOCAL else json.loads(pyproj.CRS.from_wkt(lines.crs).to_json()),
        "edges": "planar",
        "covering": {"bbox": {side: [_BBOX, side] for side in _SIDES}},
    }
    if len(lines.xyz):
        column["bbox"] = [*lines.xyz.min(axis=0).tolist(), *lines.xyz.max(axis=0).tolist()]
    return {"version": "1.1.0", "primary_column": _GEOMETRY, "columns": {_GEOMETRY: column}}


def _geometry_types(lines: LineSet) -> list[str]:
    points = is_point(lines)
    return (["LineString Z"] if not points.all() else []) + (["Point Z"] if points.any() else [])


def verify_geoparquet(part: Path, lines: LineSet, path: Path) -> None:
    """Read the file back and compare every coordinate.

    Raises
    ------
    MachineError
        Not the lines that were written.
    """
    back = read_geoparquet(part, "kind", None, None, [])
    is_same = back.crs == lines.crs or (
        # Its JSON has names of its own for units and meridians
        LOCAL not in (back.crs, lines.crs)
        and pyproj.CRS.from_wkt(back.crs).equals(pyproj.CRS.from_wkt(lines.crs))
    )
    if not is_same or len(back) != len(lines) or not np.array_equal(back.xyz, lines.xyz):
        raise MachineError(
            "written file does not read back the same", where=path, advice="check for free space"
        )


def read_geoparquet(
    path: Path, kind_field: str, kinds: Mapping[str, str] | None, crs: str | None, left_out: list[str]
) -> LineSet:
    """Read the lines of a GeoParquet file, our own exactly.

    Features whose geometry cannot be read are added to `left_out`.

    Raises
    ------
    InputError
        Not GeoParquet, or geometries in another encoding than WKB.
    CrsError
        Coordinates in degrees, or an unknown CRS.
    """
    table, metadata = _read_table(path)
    name = str(metadata.get("primary_column", _GEOMETRY))
    column = metadata.get("columns", {}).get(name) if isinstance(metadata.get("columns"), dict) else None
    if not isinstance(column, dict) or name not in table.column_names:
        raise InputError(f"is Parquet, but has no column of geometries named {name[:40]}", where=path,
                         advice="check what this file is")  # fmt: skip
    if column.get("encoding") != "WKB":
        raise InputError(
            f"geometries encoded as {str(column.get('encoding'))[:40]}, expected WKB", where=path,
            advice="write it with the encoding WKB",
        )  # fmt: skip
    own_crs = _crs_of(column, crs, path)
    shapes = _shapes(table.column(name).to_pylist(), left_out)
    columns = {c: table.column(c).to_pylist() for c in table.column_names if c not in (name, _BBOX)}
    nothing = [None] * len(shapes)
    shapes = upright(shapes, columns.get("kind", nothing), columns.get("height_m", nothing))
    if kinds is None and kind_field == "kind" and not left_out:
        own = _own_lines(shapes, columns, own_crs)
        if own is not None:
            return own
    values = columns.get(kind_field, [path.stem] * len(shapes))
    names = [f"row {i + 1}" for i in range(len(shapes))]
    return foreign_lines(shapes, values, columns, kinds, own_crs, path, left_out, names)


def _read_table(path: Path) -> tuple[Any, dict[str, Any]]:
    try:
        with open_input(path) as file:
            parquet = pyarrow.parquet.ParquetFile(file)
            stated = (parquet.metadata.metadata or {}).get(b"geo")
            metadata = json.loads(stated) if stated else None
            if not isinstance(metadata, dict):
                raise InputError("is Parquet, but not GeoParquet (no key geo in its metadata)", where=path,
                                 advice="check what this file is")  # fmt: skip
            return parquet.read(), metadata
    except (pyarrow.ArrowException, OSError, ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"cannot be read as Parquet ({str(error)[:100]})", where=path,
                         advice="copy the file again") from error  # fmt: skip


def _crs_of(column: Mapping[str, Any], given: str | None, path: Path) -> str:
    """Return the CRS that the metadata state: absent is degrees, null is unknown."""
    if "crs" not in column:
        return stated_crs("EPSG:4326", given, where=path)
    if column["crs"] is None:
        return given or LOCAL
    try:
        stated = pyproj.CRS.from_json(json.dumps(column["crs"]))
    except pyproj.exceptions.CRSError:
        return stated_crs(json.dumps(column["crs"])[:60], given, where=path)
    return stated_crs(stated, given, where=path)


def _shapes(stored: Sequence[Any], left_out: list[str]) -> AnyArray:
    """Return shapely geometries; those that cannot be read are None and added to `left_out`."""
    found = np.full(len(stored), None, dtype=object)
    for i, wkb in enumerate(stored):
        if wkb is None:
            continue
        try:
            found[i] = shapely.from_wkb(wkb)
        except (shapely.errors.ShapelyError, TypeError, ValueError) as error:
            left_out.append(f"row {i + 1}: its geometry is damaged ({str(error)[:60]})")
    return found


def _own_lines(shapes: AnyArray, columns: Mapping[str, list[Any]], crs: str) -> LineSet | None:
    """Return our own lines in the order of the set; None where the file is not ours or was changed since."""
    optional = {*OPTIONAL_FIELDS, _PREFIX + "observed"}
    wanted = {_LINE, *LINE_COLUMNS, *(_PREFIX + name for name in VERTEX_COLUMNS)} - optional
    if not wanted <= set(columns):
        return None
    if not len(shapes):
        return LineSet.empty(crs)
    order = columns[_LINE]
    if sorted(order) != list(range(len(shapes))) or not (shapely.get_type_id(shapes) == 1).all():
        return None
    at = np.argsort(order)
    counts = shapely.get_num_coordinates(shapes)[at]
    given: dict[str, Any] = {}
    for name in VERTEX_COLUMNS:
        if _PREFIX + name in columns:
            lists = [columns[_PREFIX + name][i] for i in at]
            if [len(v) if isinstance(v, list) else -1 for v in lists] != counts.tolist():
                return None
            given[name] = column_values(name, [v for values in lists for v in values])
    for name in LINE_COLUMNS:
        values = columns.get(name, [None] * len(shapes))
        given[name] = column_values(name, [values[i] for i in at])
    xyz = shapely.get_coordinates(shapes[at], include_z=True)
    return LineSet(xyz=xyz, offsets=offsets_of(counts), crs=parse_crs(crs), **given)
