"""Tables of a line file beside those of its lines, the rows of its lines, and the connection to it."""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from linework.arrays import AnyArray
from linework.errors import (
    FREE_SPACE,
    InputError,
    LineworkError,
    MachineError,
    OutputExistsError,
    is_full_disk,
)
from linework.files.vectors.fields import (
    DISAGREEMENT,
    FIELDS,
    RAIL,
    REVIEWED,
    field_values,
    fields_of_kind,
    layer_names,
)
from linework.files.vectors.gpkg import STYLE_TABLE, VERTEX_TABLE, null_if_empty, style_columns
from linework.files.vectors.gpkg_schema import LayerTable, add_table, geometry_blobs, shape_bounds, sql_values
from linework.model.lines import VERTEX_COLUMNS, LineSet
from linework.model.lineset.geometries import geometries

#: How long to wait for another program: QGIS holds the file while it saves a layer. [s]
WAIT_S = 5.0
#: All fields a layer may have: those of a line file have all of them, also where no line uses them yet.
ALL_FIELDS = (*FIELDS, *RAIL, "clearance_m", *DISAGREEMENT, *REVIEWED)

#: `edit`: the edits; `gone` and `came` are numbers of `line_version` (JSON). `line_version`: every version of every
#: line, exactly; `layer` and `fid` are its present place (NULL: none), `line` its number in `vertex`, `edit` the edit
#: that last put it there. `edit_key`: the edit that was sent under a key.
_TABLES = (
    """CREATE TABLE IF NOT EXISTS edit (number INTEGER PRIMARY KEY NOT NULL, time_utc TEXT NOT NULL, who TEXT NOT NULL,
  action TEXT NOT NULL, undoes INTEGER NOT NULL, ids TEXT NOT NULL, gone TEXT NOT NULL, came TEXT NOT NULL)""",
    """CREATE TABLE IF NOT EXISTS line_version (version INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, id TEXT NOT NULL,
  layer TEXT, fid INTEGER, line INTEGER, edit INTEGER NOT NULL, content BLOB NOT NULL)""",
    "CREATE TABLE IF NOT EXISTS edit_key (key TEXT PRIMARY KEY NOT NULL, number INTEGER NOT NULL)",
    f'CREATE INDEX IF NOT EXISTS vertex_by_line ON "{VERTEX_TABLE}" (line)',
    """INSERT OR IGNORE INTO gpkg_contents (table_name, data_type, identifier, description)
  VALUES ('edit', 'attributes', 'edit', 'who changed which lines, and when')""",
    """INSERT INTO gpkg_extensions SELECT 'line_version', NULL, 'linework_history', 'lines as they were', 'read-write'
  WHERE NOT EXISTS (SELECT 1 FROM gpkg_extensions WHERE table_name = 'line_version')""",
    """INSERT INTO gpkg_extensions SELECT 'edit_key', NULL, 'linework_history', 'edits by key', 'read-write'
  WHERE NOT EXISTS (SELECT 1 FROM gpkg_extensions WHERE table_name = 'edit_key')""",
)


@contextlib.contextmanager
def sql_errors(path: Path) -> Iterator[None]:
    """Turn SQLite's errors into one line.

    Raises
    ------
    OutputExistsError
        Another program holds the file.
    MachineError
        Full, broken or read-only.
    InputError
        Damaged.
    """
    try:
        yield
    except LineworkError as error:
        error.where = path if error.where is None else error.where
        raise
    except sqlite3.OperationalError as error:
        text = str(error)
        if "locked" in text or "busy" in text:
            raise OutputExistsError(
                "another program is writing it", where=path, advice="finish editing there, then try again"
            ) from error
        advice = FREE_SPACE if is_full_disk(error) else "check the disk, and that you may write there"
        raise MachineError(f"cannot be written: {text}", where=path, advice=advice) from error
    except sqlite3.DatabaseError as error:
        raise InputError(f"damaged ({error})", where=path, advice="restore a copy") from error


def connect_database(path: Path) -> sqlite3.Connection:
    """Return a connection whose transactions are on the disk when they end; they are begun explicitly.

    The GeoPackage standard's triggers call ``ST_`` functions that SQLite lacks; they are added here. SQLite lets triggers
    call them in a trusted file only: check it before it is changed (`linework.files.vectors.gpkg_guard.check_schema`).
    """
    db = sqlite3.connect(path, isolation_level=None, timeout=WAIT_S, check_same_thread=False)
    db.execute("PRAGMA synchronous = FULL")
    db.execute("PRAGMA trusted_schema = ON")
    bounds: dict[str, Callable[[tuple[float, ...]], float]] = {
        "ST_MinX": lambda b: b[0], "ST_MinY": lambda b: b[1], "ST_MaxX": lambda b: b[2], "ST_MaxY": lambda b: b[3],
    }  # fmt: skip
    for name, chosen in bounds.items():
        db.create_function(
            name, 1, lambda blob, chosen=chosen: chosen(shape_of(blob).bounds), deterministic=True
        )
    db.create_function("ST_IsEmpty", 1, lambda blob: bool(shape_of(blob).is_empty), deterministic=True)
    return db


@contextlib.contextmanager
def transaction(db: sqlite3.Connection) -> Iterator[None]:
    """Carry out the body as one transaction: wholly or not at all, and on the disk when it ends."""
    db.execute("BEGIN IMMEDIATE")
    try:
        yield
        db.execute("COMMIT")
    except BaseException:
        # A failed commit may have ended the transaction already
        with contextlib.suppress(sqlite3.Error):
            db.execute("ROLLBACK")
        raise


def shape_of(blob: bytes) -> shapely.Geometry:
    """Return the geometry of a GeoPackage blob."""
    return shapely.from_wkb(wkb_of(blob))


def wkb_of(blob: bytes) -> bytes:
    """Return the WKB in a GeoPackage blob, whose flags give the length of its header."""
    if blob[:2] != b"GP" or len(blob) < 8:
        raise ValueError("not a geometry of a GeoPackage")
    envelope = (0, 32, 48, 48, 64)
    return blob[8 + envelope[min((blob[3] >> 1) & 7, 4)] :]


def add_line_file_tables(db: sqlite3.Connection) -> None:
    """Add the tables and columns that a line file has and an extraction lacks, within a transaction."""
    for statement in _TABLES:
        db.execute(statement)
    for layer in line_layers(db):
        there = columns_of(db, layer)
        for name, sql_type in _empty_columns(layer).items():
            if name not in there:
                db.execute(f'ALTER TABLE {quoted(layer)} ADD COLUMN "{name}" {sql_type}')


def _empty_columns(layer: str) -> dict[str, str]:
    sql_types = {"U": "TEXT", "b": "BOOLEAN", "f": "DOUBLE"}
    values = field_values(LineSet.empty()) | {name: np.zeros(0) for name in (*RAIL, *DISAGREEMENT)}
    values |= {name: np.zeros(0, dtype=np.str_) for name in REVIEWED}
    return {name: sql_types[values[name].dtype.kind] for name in fields_of_kind(layer, ALL_FIELDS)}


def add_layer(db: sqlite3.Connection, layer: str) -> None:
    """Add an empty layer of lines, with its style, within a transaction."""
    columns = {name: np.zeros(0, dtype=object) for name in _empty_columns(layer)}
    none = np.array([], dtype=object)
    add_table(db, LayerTable(layer, columns, none, sql_types=_empty_columns(layer)), srs_of(db))
    if columns_of(db, STYLE_TABLE):
        style = style_columns([layer])
        names = ", ".join(f'"{name}"' for name in style)
        places = ", ".join("?" * len(style))
        values = [null_if_empty(column).tolist()[0] for column in style.values()]
        db.execute(f"INSERT INTO {STYLE_TABLE} ({names}) VALUES ({places})", values)


def columns_of(db: sqlite3.Connection, table: str) -> list[str]:
    """Return the columns of a table; an empty list where it does not exist."""
    return [str(row[1]) for row in db.execute(f"PRAGMA table_info({quoted(table)})")]


def line_layers(db: sqlite3.Connection) -> list[str]:
    """Return our layers of lines, in the order of the file; other layers, and those of points, are ignored."""
    rows = db.execute(
        "SELECT table_name FROM gpkg_geometry_columns WHERE column_name = 'geom' AND geometry_type_name = 'LINESTRING'"
        " ORDER BY rowid"
    )
    return [str(name) for (name,) in rows.fetchall() if {"fid", "id", "kind"} <= set(columns_of(db, name))]


def srs_of(db: sqlite3.Connection) -> int:
    """Return the srs_id of the lines."""
    (number,) = db.execute(
        "SELECT srs_id FROM gpkg_geometry_columns WHERE geometry_type_name = 'LINESTRING' ORDER BY rowid LIMIT 1"
    ).fetchone()
    return int(number)


def quoted(name: str) -> str:
    """Return a name quoted for SQL."""
    return '"' + name.replace('"', '""') + '"'


_NOW = "strftime('%Y-%m-%dT%H:%M:%fZ', 'now')"


@dataclass(frozen=True, slots=True)
class LineRow:
    """Place of a line in the file: its layer and feature, and its number in the table of vertices."""

    layer: str
    fid: int
    line: int


def insert_rows(db: sqlite3.Connection, lines: LineSet, first_line: int) -> list[LineRow]:
    """Append lines and their vertices, within a transaction, and return their places.

    Parameters
    ----------
    first_line
        Number in `vertex` of the first of them: higher than any before, so that rows stay in the order of the
        numbers.

    Notes
    -----
    The extents of layers only grow, as the standard allows: reading all lines of a layer would take longer than
    everything else.
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
        columns += [sql_values(null_if_empty(values[name][chosen])) for name in names]
        fids[chosen] = _insert_each(db, layer, ["geom", *names], columns)
        _touch(db, layer, shapes[chosen])
    rows = [
        LineRow(str(layer), int(fid), first_line + i)
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


def _put_vertices(db: sqlite3.Connection, lines: LineSet, rows: Sequence[LineRow]) -> None:
    owner = lines.line_of_vertex
    there = columns_of(db, VERTEX_TABLE)
    columns: dict[str, AnyArray] = {
        "line": np.array([row.line for row in rows], dtype=np.int64)[owner],
        "layer": np.array([row.layer for row in rows], dtype=object)[owner],
        "line_fid": np.array([row.fid for row in rows], dtype=np.int64)[owner],
        "line_id": null_if_empty(lines.id)[owner],
        "vertex": np.arange(len(owner), dtype=np.int64) - lines.offsets[owner],
    }
    columns |= {name: getattr(lines, name) for name in VERTEX_COLUMNS if name in there}
    fields, places = ", ".join(f'"{name}"' for name in columns), ", ".join("?" * len(columns))
    values = zip(*(sql_values(column) for column in columns.values()), strict=True)
    db.executemany(f"INSERT INTO {VERTEX_TABLE} ({fields}) VALUES ({places})", values)


def delete_rows(db: sqlite3.Connection, rows: Iterable[LineRow]) -> None:
    """Delete lines and their vertices, within a transaction."""
    layers = set()
    for row in rows:
        db.execute(f"DELETE FROM {quoted(row.layer)} WHERE fid = ?", (row.fid,))
        db.execute(f"DELETE FROM {VERTEX_TABLE} WHERE line = ?", (row.line,))
        layers.add(row.layer)
    for layer in sorted(layers):
        _touch(db, layer)


def _touch(db: sqlite3.Connection, layer: str, shapes: AnyArray | None = None) -> None:
    """Update the change time of a layer, and grow its extent by these shapes."""
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
