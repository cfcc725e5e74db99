"""The rows of lines in a drawing's layers and in its table of vertices: taken out, and put in at the end."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray
from linework.files.drawing_tables import add_layer, columns_of, line_layers, quoted, srs_of
from linework.files.geopackage import geometry_blobs, shape_bounds, sql_values
from linework.files.line_fields import field_values, geometries, layer_names
from linework.files.vectors_gpkg import VERTEX_TABLE, storable
from linework.model.lines import VERTEX_COLUMNS, LineSet

_NOW = "strftime('%Y-%m-%dT%H:%M:%fZ', 'now')"


@dataclass(frozen=True, slots=True)
class Row:
    """Where a line stands: its layer and feature, and its number in the table of vertices."""

    layer: str
    fid: int
    line: int


def put_rows(db: sqlite3.Connection, lines: LineSet, first_line: int) -> list[Row]:
    """Append lines to their layers, and their vertices, within a transaction; return where they are.

    Parameters
    ----------
    first_line
        Number in `vertex` of the first of them: higher than any before, so that the order of the rows stays that of
        the numbers.

    Notes
    -----
    The extents of the layers grow only, as the standard allows; reading all lines of a layer would take longer than
    the rest of the work.
    """
    layers, shapes, values = layer_names(lines), geometries(lines), field_values(lines)
    there = set(line_layers(db))
    fids = np.zeros(len(lines), dtype=np.int64)
    for layer in dict.fromkeys(layers.tolist()):
        if layer not in there:
            add_layer(db, layer)
        chosen = np.flatnonzero(layers == layer)
        names = [name for name in columns_of(db, layer) if name in values]
        columns: list[Sequence[object]] = [geometry_blobs(shapes[chosen], srs_of(db))]
        columns += [sql_values(storable(values[name][chosen])) for name in names]
        fids[chosen] = _insert_each(db, layer, ["geom", *names], columns)
        _touch(db, layer, shapes[chosen])
    rows = [
        Row(str(layer), int(fid), first_line + i)
        for i, (layer, fid) in enumerate(zip(layers, fids, strict=True))
    ]
    _put_vertices(db, lines, rows)
    return rows


def _insert_each(
    db: sqlite3.Connection, layer: str, names: Sequence[str], columns: Sequence[Sequence[object]]
) -> list[int]:
    """Insert rows and return their numbers."""
    fields, places = ", ".join(f'"{name}"' for name in names), ", ".join("?" * len(names))
    statement = f"INSERT INTO {quoted(layer)} ({fields}) VALUES ({places})"
    return [int(db.execute(statement, row).lastrowid or 0) for row in zip(*columns, strict=True)]


def _put_vertices(db: sqlite3.Connection, lines: LineSet, rows: Sequence[Row]) -> None:
    owner = lines.line_of_vertex
    there = columns_of(db, VERTEX_TABLE)
    columns: dict[str, AnyArray] = {
        "line": np.array([row.line for row in rows], dtype=np.int64)[owner],
        "layer": np.array([row.layer for row in rows], dtype=object)[owner],
        "line_fid": np.array([row.fid for row in rows], dtype=np.int64)[owner],
        "line_id": storable(lines.id)[owner],
        "vertex": np.arange(len(owner), dtype=np.int64) - lines.offsets[owner],
    }
    columns |= {name: getattr(lines, name) for name in VERTEX_COLUMNS if name in there}
    fields, places = ", ".join(f'"{name}"' for name in columns), ", ".join("?" * len(columns))
    values = zip(*(sql_values(column) for column in columns.values()), strict=True)
    db.executemany(f"INSERT INTO {VERTEX_TABLE} ({fields}) VALUES ({places})", values)


def remove_rows(db: sqlite3.Connection, rows: Iterable[Row]) -> None:
    """Take lines out of their layers, and their vertices, within a transaction."""
    layers = set()
    for row in rows:
        db.execute(f"DELETE FROM {quoted(row.layer)} WHERE fid = ?", (row.fid,))
        db.execute(f"DELETE FROM {VERTEX_TABLE} WHERE line = ?", (row.line,))
        layers.add(row.layer)
    for layer in sorted(layers):
        _touch(db, layer)


def _touch(db: sqlite3.Connection, layer: str, shapes: AnyArray | None = None) -> None:
    """Note that a layer has changed, and that it holds these shapes."""
    if shapes is None or len(shapes) == 0:
        db.execute(f"UPDATE gpkg_contents SET last_change = {_NOW} WHERE table_name = ?", (layer,))
        return
    bounds = shape_bounds(shapes)
    west, south = bounds[:, [0, 2]].min(axis=0).tolist()
    east, north = bounds[:, [1, 3]].max(axis=0).tolist()
    db.execute(
        f"UPDATE gpkg_contents SET last_change = {_NOW}, min_x = min(coalesce(min_x, ?1), ?1),"
        " min_y = min(coalesce(min_y, ?2), ?2), max_x = max(coalesce(max_x, ?3), ?3),"
        " max_y = max(coalesce(max_y, ?4), ?4) WHERE table_name = ?5",
        (west, south, east, north, layer),
    )
