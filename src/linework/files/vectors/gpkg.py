"""Lines as GeoPackage: a layer per kind, layers of points, a table of vertices, QGIS styles."""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from linework.arrays import AnyArray, IntArray, offsets_of
from linework.crs import LOCAL, parse_crs, same_crs
from linework.errors import FREE_SPACE, LineworkError, MachineError, is_full_disk
from linework.files.vectors.fields import (
    LANE_LAYER,
    REJECTED_LAYER,
    TABLES,
    field_values,
    fields_of_kind,
    layer_name,
    layer_names,
    ordered_layers,
    qgis_style,
    vertex_columns,
)
from linework.files.vectors.gdal_input import pyogrio, reading_with_gdal
from linework.files.vectors.gpkg_schema import FIXED_DATE, LayerTable, geopackage_bytes
from linework.files.vectors.lane_layer import lane_fields
from linework.files.vectors.point_layers import PointLayer
from linework.files.vectors.pole_points import feature_shapes, is_point, upright
from linework.lines.lanes import Lanes
from linework.model.lines import LINE_COLUMNS, POLE, VERTEX_COLUMNS, LineSet
from linework.model.lineset.geometries import column_values, geometries

VERTEX_TABLE, STYLE_TABLE = "vertex", "layer_styles"
#: How long to wait for another program that is writing the file. [s]
_WAIT_S = 5.0
STYLE_TYPES = {"update_time": "DATETIME"}


def write_gpkg(
    lines: LineSet,
    part: Path,
    kinds: Sequence[str] = (),
    points: Sequence[PointLayer] = (),
    finish: Callable[[bytes], bytes] | None = None,
    lanes: Lanes | None = None,
) -> None:
    """Write lines and points to a new GeoPackage (called through `publish`).

    Layers hold the lines of one kind in the set's order; `vertex` holds for every vertex the number of its
    line in the whole set (`line`), the layer and its feature (`layer`, `line_fid`), its place in the line
    (`vertex`), its sigmas and flags (`observed` for truth only). `finish` may add to the file's bytes.
    """
    layers, shapes, values = layer_names(lines), feature_shapes(lines), field_values(lines)
    points_of_poles = is_point(lines)
    # A set without lines keeps its CRS in an empty layer
    names = ordered_layers([*layers.tolist(), *map(layer_name, kinds)]) or ["line"]
    tables = []
    for layer in names:
        chosen = np.flatnonzero(layers == layer)
        columns = {name: null_if_empty(values[name][chosen]) for name in fields_of_kind(layer, values)}
        geometry = "POINT" if len(chosen) and points_of_poles[chosen].all() else "LINESTRING"
        tables.append(LayerTable(layer, columns, shapes[chosen], geometry=geometry))
    for extra in points:
        places = np.asarray(shapely.points(extra.xyz), dtype=object)
        tables.append(LayerTable(extra.name, extra.fields, places, geometry="POINT"))
    if lanes is not None:
        tables.append(LayerTable(LANE_LAYER, lane_fields(lanes), geometries(lanes.centre)))
        names.append(LANE_LAYER)
    drawn = ~points_of_poles
    tables.append(LayerTable(VERTEX_TABLE, vertex_table(lines.take(drawn), layers[drawn])))
    tables.append(LayerTable(STYLE_TABLE, style_columns(names), key="id", sql_types=STYLE_TYPES))
    content = geopackage_bytes(tables, lines.crs)
    part.write_bytes(content if finish is None else finish(content))


def null_if_empty(values: AnyArray) -> AnyArray:
    """Return texts as objects, "" as None, which tables store as NULL."""
    if values.dtype.kind != "U":
        return values
    texts = values.astype(object)
    texts[values == ""] = None
    return texts


def vertex_table(lines: LineSet, layers: AnyArray) -> dict[str, AnyArray]:
    """Return the columns of the table of vertices."""
    owner = lines.line_of_vertex
    fid = np.zeros(len(lines), dtype=np.int64)
    for layer in set(layers.tolist()):
        chosen = layers == layer
        fid[chosen] = np.arange(1, np.count_nonzero(chosen) + 1)
    columns: dict[str, AnyArray] = {
        "line": owner,
        "layer": layers.astype(object)[owner],
        "line_fid": fid[owner],
        "line_id": null_if_empty(lines.id)[owner],
        "vertex": np.arange(len(owner), dtype=np.int64) - lines.offsets[owner],
    }
    return columns | {name: getattr(lines, name) for name in vertex_columns(lines)}


def style_columns(layers: Sequence[str]) -> dict[str, AnyArray]:
    """Return the columns of the table from which QGIS reads the layers' styles."""
    n = len(layers)
    texts = {
        "f_table_catalog": [""] * n, "f_table_schema": [""] * n, "f_table_name": list(layers),
        "f_geometry_column": ["geom"] * n, "styleName": list(layers),
        "styleQML": [qgis_style(layer) for layer in layers], "styleSLD": [""] * n,
    }  # fmt: skip
    columns: dict[str, AnyArray] = {name: np.array(values, dtype=object) for name, values in texts.items()}
    columns["useAsDefault"] = np.ones(n, dtype=np.bool_)
    for name in ("description", "owner", "ui"):
        columns[name] = np.array([""] * n, dtype=object)
    columns["update_time"] = np.array([FIXED_DATE] * n, dtype=object)
    return columns


def verify_gpkg(
    part: Path, lines: LineSet, path: Path, points: Sequence[PointLayer] = (), lanes: Lanes | None = None
) -> None:
    """Check a written GeoPackage with SQLite, then read the lines back with GDAL, which did not write it.

    Raises
    ------
    MachineError
        Damaged, rows or index entries missing, journal left, or other lines than were written.
    """
    try:
        n_features = len(lines) + sum(len(layer.xyz) for layer in points) + len(lanes or ())
        problem = _gpkg_problem(part, n_features)
        if not problem:
            back = read_own_gpkg(part, rejected=True)
            same = back is not None and same_crs(back.crs, lines.crs) and np.array_equal(back.xyz, lines.xyz)
            problem = "" if same else "other lines than were written"
    except (sqlite3.Error, LineworkError) as error:
        problem = str(error)
    if problem:
        raise MachineError(
            f"written file does not verify: {problem}", where=path, advice="check for free space"
        )


def _gpkg_problem(part: Path, n_features: int) -> str:
    for ending in ("-journal", "-wal"):
        if part.with_name(part.name + ending).exists():
            return f"{ending[1:]} left beside it"
    with contextlib.closing(sqlite3.connect(f"file:{_uri(part)}?mode=ro&immutable=1", uri=True)) as db:
        found = db.execute("PRAGMA integrity_check").fetchone()[0]
        if found != "ok":
            return str(found)
        total = 0
        for layer, low in db.execute(
            "SELECT table_name, min_x FROM gpkg_contents WHERE data_type = 'features'"
        ):
            n = db.execute(f'SELECT count(*) FROM "{layer}"').fetchone()[0]
            n_indexed = db.execute(f'SELECT count(*) FROM "rtree_{layer}_geom"').fetchone()[0]
            if n != n_indexed:
                return f"layer {layer} has {n} features, {n_indexed} in its index"
            if n and low is None:
                return f"layer {layer} has no extent"
            total += n
        return "" if total == n_features else f"{total} features, expected {n_features}"


def _uri(path: Path) -> str:
    """Return a path as the file part of an SQLite URI."""
    return path.absolute().as_uri().removeprefix("file://")


def roll_back(path: Path) -> None:
    """Roll back the change that a killed process left half written, if its journal is beside the file.

    Readers that open a file read-only cannot do this: they would read half of the change, or nothing.

    Raises
    ------
    MachineError
        The file cannot be written to.
    """
    if not any(path.with_name(path.name + ending).exists() for ending in ("-journal", "-wal")):
        return
    try:
        with contextlib.closing(sqlite3.connect(path, timeout=_WAIT_S)) as db:
            db.execute("SELECT count(*) FROM sqlite_master").fetchone()
    except sqlite3.OperationalError as error:
        raise MachineError(
            f"an interrupted change cannot be rolled back ({error})", where=path,
            advice=FREE_SPACE if is_full_disk(error) else "check that you may write there",
        ) from error  # fmt: skip
    except sqlite3.DatabaseError:
        # Reported by the reader that follows
        return


def read_own_gpkg(path: Path, *, rejected: bool = False) -> LineSet | None:
    """Read back a GeoPackage that `write_gpkg` made, exactly; None where it is not one, or was edited since.

    Parameters
    ----------
    rejected
        Also return lines that a person rejected.

    Raises
    ------
    InputError
        Not readable.
    """
    with reading_with_gdal(path) as source:
        found = _own_lines(source)
    if found is None or rejected or REJECTED_LAYER not in found.review:
        return found
    return found.take(found.review != REJECTED_LAYER)


def geometry_layers(path: Path) -> set[str]:
    """Return the layers with geometry of a GeoPackage, empty ones included, except that of rejected lines.

    Raises
    ------
    InputError
        Not readable.
    """
    with reading_with_gdal(path) as source:
        layers = pyogrio.list_layers(source)
    return {str(name) for name, geometry in layers if geometry and name not in (REJECTED_LAYER, LANE_LAYER)}


def _own_lines(path: Path) -> LineSet | None:
    layers = [str(name) for name, kind in pyogrio.list_layers(path) if "Point" not in str(kind)]
    layers = [name for name in layers if name == VERTEX_TABLE or name not in TABLES]
    wanted = {"line", "layer", "line_fid", *VERTEX_COLUMNS} - {"observed"}
    if VERTEX_TABLE not in layers or not wanted <= set(pyogrio.read_info(path, layer=VERTEX_TABLE)["fields"]):
        return None
    meta, _, _, values = pyogrio.raw.read(path, layer=VERTEX_TABLE)
    vertex = dict(zip(meta["fields"], values, strict=True))
    first = np.flatnonzero(np.diff(vertex["line"], prepend=-1))
    offsets = np.concatenate([first, [len(vertex["line"])]]).astype(np.int64)
    layer_of_line, fid_of_line = vertex["layer"][first], vertex["line_fid"][first]
    xyz, columns = np.empty((offsets[-1], 3)), {name: np.full(len(first), None) for name in LINE_COLUMNS}
    crs, n_features = LOCAL, 0
    for layer in layers:
        if layer == VERTEX_TABLE:
            continue
        meta, fids, shapes, values = pyogrio.raw.read(path, layer=layer, return_fids=True)
        crs = parse_crs(meta["crs"], where=path) if meta["crs"] else LOCAL
        n_features += len(fids)
        chosen = np.flatnonzero(layer_of_line == layer)
        if not np.array_equal(fid_of_line[chosen], fids):
            return None
        vertices = _runs(offsets, chosen)
        coordinates = shapely.get_coordinates(shapely.from_wkb(shapes), include_z=True)
        if len(coordinates) != len(vertices):
            return None
        xyz[vertices] = coordinates
        for field, column in zip(meta["fields"], values, strict=True):
            if field in columns:
                columns[field][chosen] = column
    if n_features != len(first):
        return None
    own: dict[str, Any] = {name: column_values(name, column) for name, column in columns.items()}
    own |= {name: column_values(name, vertex[name]) for name in VERTEX_COLUMNS if name in vertex}
    found = LineSet(xyz=xyz, offsets=offsets, crs=crs, **own)
    poles, n_left_out = _own_poles(path)
    if n_left_out:
        return None
    if poles is None:
        return found
    return LineSet.concatenate([found if len(found) else found.with_columns(crs=poles.crs), poles])


def read_poles(path: Path) -> LineSet:
    """Return the poles of a GeoPackage that `write_gpkg` made, which line files leave as they are.

    Raises
    ------
    InputError
        Not readable.
    """
    with reading_with_gdal(path) as source:
        found, _ = _own_poles(source)
    return LineSet.empty() if found is None else found


def _own_poles(path: Path) -> tuple[LineSet | None, int]:
    """Return the poles of a GeoPackage, whose sigmas are those of both their vertices; None without their layer.

    The second is the number of those that lost their place or height to another program: they are left out.
    """
    if (POLE, "Point Z") not in [(str(name), str(kind)) for name, kind in pyogrio.list_layers(path)]:
        return None, 0
    meta, _, shapes, values = pyogrio.raw.read(path, layer=POLE)
    table = dict(zip(map(str, meta["fields"]), values, strict=True))
    heights = table.get("height_m", np.full(len(shapes), np.nan))
    lines = upright(shapely.from_wkb(shapes), [POLE] * len(shapes), heights)
    is_whole = shapely.get_type_id(lines) == shapely.GeometryType.LINESTRING
    lines, table = lines[is_whole], {name: column[is_whole] for name, column in table.items()}
    xyz, owner = shapely.get_coordinates(lines, include_z=True, return_index=True)
    columns: dict[str, Any] = {n: column_values(n, table[n]) for n in LINE_COLUMNS if n in table}
    columns |= {
        name: np.repeat(column_values(name, table[name]), 2)
        for name in ("sigma_xy_m", "sigma_z_m")
        if name in table
    }
    crs = parse_crs(meta["crs"], where=path) if meta["crs"] else LOCAL
    offsets = offsets_of(np.bincount(owner, minlength=len(lines)))
    return LineSet(xyz=xyz, offsets=offsets, crs=crs, **columns), int(np.count_nonzero(~is_whole))


def _runs(offsets: IntArray, chosen: IntArray) -> IntArray:
    """Return the vertices of the chosen lines, line after line."""
    runs = [np.arange(offsets[i], offsets[i + 1]) for i in chosen]
    return np.concatenate(runs) if runs else np.zeros(0, dtype=np.int64)
