"""Carry the edit history over when an extraction rewrites a line file."""

from __future__ import annotations

import contextlib
import sqlite3
import zlib
from collections.abc import Callable
from pathlib import Path

from linework.errors import LineworkError
from linework.files.line_file.history import (
    EXTRACT,
    HistoryEntry,
    add_entry,
    add_versions,
    line_bytes,
    place_versions,
    utc_now,
)
from linework.files.line_file.tables import (
    ALL_FIELDS,
    LineRow,
    add_line_file_tables,
    columns_of,
    connect_database,
    line_layers,
    quoted,
    sql_errors,
    transaction,
)
from linework.files.vectors.fields import REJECTED_LAYER, REVIEWED, TABLES, layer_names
from linework.files.vectors.gdal_input import checked_vector_file
from linework.files.vectors.gpkg import VERTEX_TABLE, roll_back
from linework.files.vectors.gpkg_guard import ForeignSchemaError, check_geopackage
from linework.files.vectors.pole_points import is_point
from linework.model.lines import POLE, LineSet


def added_by_others(path: Path) -> list[str]:
    """Return the layers, tables and columns that another program added to a file of lines, by name.

    Nothing for anything but a GeoPackage of lines.
    """
    try:
        checked_vector_file(path)
        roll_back(path)
        check_geopackage(path)
        with contextlib.closing(connect_database(path)) as db:
            if not columns_of(db, VERTEX_TABLE):
                return []
            own = {*TABLES, REJECTED_LAYER, "edit_key", "photolog", "event", POLE, *line_layers(db)}
            tables = [
                str(name) for (name,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
            ]
            found = [
                name
                for name in tables
                if name not in own and not name.startswith(("gpkg_", "rtree_", "sqlite_"))
            ]
            for layer in line_layers(db):
                known = {"fid", "geom", *ALL_FIELDS}
                found += [f"{layer}.{name}" for name in columns_of(db, layer) if name not in known]
            return sorted(found)
    except (sqlite3.DatabaseError, LineworkError):
        return []


def has_reviews(path: Path) -> bool:
    """Return whether a file holds edits, or review decisions entered in another program.

    False for anything but a GeoPackage of lines.

    Raises
    ------
    ForeignSchemaError
        Opening it would execute what is in it: whether there are decisions cannot be known.
    """
    try:
        checked_vector_file(path)
        roll_back(path)
        check_geopackage(path)
        with contextlib.closing(connect_database(path)) as db:
            if not columns_of(db, VERTEX_TABLE):
                return False
            if columns_of(db, "edit") and db.execute("SELECT 1 FROM edit LIMIT 1").fetchone():
                return True
            return any(_is_said(db, layer) for layer in line_layers(db))
    except ForeignSchemaError:
        raise
    except (sqlite3.DatabaseError, LineworkError):
        return False


def _is_said(db: sqlite3.Connection, layer: str) -> bool:
    there = set(columns_of(db, layer))
    asked = " OR ".join(f"coalesce(\"{name}\", '') != ''" for name in REVIEWED if name in there)
    return (
        bool(asked)
        and db.execute(f"SELECT 1 FROM {quoted(layer)} WHERE {asked} LIMIT 1").fetchone() is not None
    )


def with_history(old: Path, lines: LineSet) -> Callable[[bytes], bytes]:
    """Return a function that adds the history of the line file `old` to the bytes of one with `lines`.

    Lines that are in both, to the bit, continue; all others become one edit, `EXTRACT`. Poles, which are points in the
    file and no lines that people edit, have no history.
    """
    edited = lines.take(~is_point(lines))

    def finish(content: bytes) -> bytes:
        with sql_errors(old), contextlib.closing(connect_database(Path(":memory:"))) as db:
            db.deserialize(content)
            db.execute("ATTACH ? AS old", (str(old),))
            with transaction(db):
                add_line_file_tables(db)
                _carry(db, edited)
            db.execute("DETACH old")
            return db.serialize()

    return finish


def _carry(db: sqlite3.Connection, lines: LineSet) -> None:
    stood = {
        str(name): (int(version), int(edit), content)
        for version, name, edit, content in db.execute(
            "SELECT version, id, edit, content FROM old.line_version WHERE layer IS NOT NULL AND layer <> ?",
            (POLE,),
        )
    }
    db.execute("INSERT INTO edit SELECT * FROM old.edit")
    db.execute(
        "INSERT INTO line_version SELECT version, id, NULL, NULL, NULL, edit, content FROM old.line_version"
    )
    (last,) = db.execute("SELECT coalesce(max(number), 0) FROM edit").fetchone()
    came: list[int] = []
    for name, content, row in zip(lines.id.tolist(), line_bytes(lines), rows_as_written(lines), strict=True):
        version, edit, before = stood.get(name, (0, 0, b""))
        if before and zlib.decompress(before) == content:
            del stood[name]
            place_versions(db, [version], [row], edit)
        else:
            came += add_versions(db, [name], [content])
            place_versions(db, came[-1:], [row], last + 1)
    if came or stood:
        names = {
            str(n) for v in came for (n,) in db.execute("SELECT id FROM line_version WHERE version = ?", (v,))
        }
        gone = tuple(version for version, _, _ in stood.values())
        ids = tuple(sorted(names | set(stood)))
        add_entry(db, HistoryEntry(last + 1, utc_now(), "", EXTRACT, 0, ids, gone, tuple(came)))


def rows_as_written(lines: LineSet) -> list[LineRow]:
    """Return the places of lines written by `write_gpkg`: lines count from 0, features from 1 in each layer."""
    n: dict[str, int] = {}
    rows = []
    for i, layer in enumerate(layer_names(lines).tolist()):
        n[layer] = n.get(layer, 0) + 1
        rows.append(LineRow(layer, n[layer], i))
    return rows
