"""Open a line file: lock it, check it, and add the tables for editing.

Separate from `file`, which saves and undoes edits: this locks and checks the file once, before the first edit.
"""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.crs import LOCAL, describe_crs, parse_crs, same_crs
from linework.errors import CrsError, InputError, OutputExistsError, UsageError
from linework.files.line_file.checks import check_texts
from linework.files.line_file.history import (
    UndoSteps,
    add_versions,
    line_bytes,
    place_versions,
    steps_of,
    unpack_lines,
)
from linework.files.line_file.outside_changes import (
    OutsideChanges,
    find_outside_changes,
    read_layer_lines,
    with_vertex_rows,
)
from linework.files.line_file.tables import (
    LineRow,
    add_line_file_tables,
    columns_of,
    connect_database,
    insert_rows,
    line_layers,
    quoted,
    sql_errors,
    srs_of,
    transaction,
)
from linework.files.output.locks import hold_lock, lock_path
from linework.files.output.publish import check_output
from linework.files.vectors.gdal_input import checked_vector_file
from linework.files.vectors.gpkg import VERTEX_TABLE
from linework.files.vectors.gpkg_guard import check_schema
from linework.files.vectors.read_write import write_lines
from linework.lines.names import with_ids
from linework.model.lines import KINDS, LineSet

_MADE = "linework extract and linework convert make such files"


@dataclass(frozen=True, slots=True, kw_only=True)
class LineFileState:
    """A line file as it was last saved.

    Parameters
    ----------
    lines, versions, edits
        m lines, the version number of each, and the edit that put it there.
    elsewhere
        What other programs changed since.
    """

    lines: LineSet
    versions: tuple[int, ...]
    edits: tuple[int, ...]
    revision: int
    next_line: int
    steps: UndoSteps
    elsewhere: OutsideChanges


@contextmanager
def open_line_file(
    path: Path, crs: str, *, is_held: bool = False
) -> Iterator[tuple[sqlite3.Connection, LineFileState]]:
    """Open a line file and yield its connection and state (see `LineFile.opened`)."""
    if path.is_dir():
        raise UsageError("is a folder", where=path, advice="name a GeoPackage in it")
    if path.suffix.lower() != ".gpkg":
        raise UsageError(
            f"cannot edit '{path.suffix}' files", where=path, advice="linework convert makes a .gpkg"
        )
    if not is_held:
        check_output(path, overwrite=True)
    busy = OutputExistsError("another workbench or run has it open", where=path, advice="close that first")
    with contextlib.nullcontext() if is_held else hold_lock(lock_path(path), busy):
        if not path.exists():
            write_lines(LineSet.empty(crs), path, kinds=KINDS)
        checked_vector_file(path)
        with sql_errors(path), contextlib.closing(connect_database(path)) as db:
            check_schema(db, path, to_edit=True)
            _check(db, crs, path)
            with transaction(db):
                check_schema(db, path, to_edit=True)  # another program may have changed it until now
                add_line_file_tables(db)
                if db.execute("SELECT count(*) FROM line_version").fetchone()[0] == 0:
                    _take_in(db, crs, path)
            try:
                yield db, _saved(db, crs, path)
            finally:
                # Removes the journal beside it, unless another program has the file open
                with contextlib.suppress(sqlite3.Error):
                    db.execute("PRAGMA journal_mode = DELETE")


def _check(db: sqlite3.Connection, crs: str, path: Path) -> None:
    """Refuse a file that is damaged, not ours, or in another CRS; a killed process's journal is rolled back by now."""
    found = db.execute("PRAGMA quick_check(1)").fetchone()[0]
    if found != "ok":
        raise InputError(f"damaged ({found})", where=path, advice="restore a copy")
    wanted = {"line", "layer", "line_fid", "vertex", "sigma_xy_m", "sigma_z_m", "bridged"}
    is_ours = wanted <= set(columns_of(db, VERTEX_TABLE)) and columns_of(db, "gpkg_geometry_columns")
    if not is_ours or not line_layers(db):
        raise InputError("not a line file made by linework", where=path, advice=_MADE)
    own = _crs_of(db, path)
    if not same_crs(own, crs):
        raise CrsError(
            f"lines in {describe_crs(own)}, the survey is in {describe_crs(crs)}", where=path,
            advice="choose another line file",
        )  # fmt: skip
    with contextlib.suppress(sqlite3.OperationalError):
        # Another program (QGIS) may hold the file in another journal mode, in which a commit is as safe. Removing the
        # journal after each commit instead of emptying it takes 10 ms more
        db.execute("PRAGMA journal_mode = TRUNCATE")
    # A file that cannot be written to is refused now, not at the first change
    db.execute("BEGIN IMMEDIATE")
    db.execute("ROLLBACK")


def _crs_of(db: sqlite3.Connection, path: Path) -> str:
    number = srs_of(db)
    if number == -1:
        return LOCAL
    row = db.execute(
        "SELECT definition_12_063, definition FROM gpkg_spatial_ref_sys WHERE srs_id = ?", (number,)
    ).fetchone()
    return parse_crs(next(text for text in row if text and text != "undefined"), where=path)


def _take_in(db: sqlite3.Connection, crs: str, path: Path) -> None:
    """Begin the history with the lines that are there.

    Lines whose vertices do not fit their rows (moved or split by others) and lines without an id of their own are
    appended anew; all others stay as they are.
    """
    found = read_layer_lines(db, crs, path)
    lines, fitting = with_vertex_rows(db, found)
    check_texts(lines, path)
    _, first = np.unique(lines.id, return_index=True)
    own = {int(i) for i in first if lines.id[i] != ""}
    stay = [i for i in range(len(lines)) if i in fitting and i in own]
    rest = [i for i in range(len(lines)) if not (i in fitting and i in own)]
    kept = lines.take(stay)
    rows = [fitting[i] for i in stay]
    _remove_others(db, rows)
    versions = add_versions(db, kept.id.tolist(), line_bytes(kept))
    place_versions(db, versions, rows, 0)
    if rest:
        no_id = np.array([lines.id[i] if i in own else "" for i in rest], dtype=np.str_)
        others = with_ids(lines.take(rest).with_columns(id=no_id), set(kept.id.tolist()))
        rows = insert_rows(db, others, _next_line(db))
        versions = add_versions(db, others.id.tolist(), line_bytes(others))
        place_versions(db, versions, rows, 0)


def _remove_others(db: sqlite3.Connection, rows: list[LineRow]) -> None:
    """Remove all features and vertices of our layers but those of these lines."""
    for layer in line_layers(db):
        kept = {row.fid for row in rows if row.layer == layer}
        there = [fid for (fid,) in db.execute(f"SELECT fid FROM {quoted(layer)}")]
        gone = [(fid,) for fid in there if fid not in kept]
        db.executemany(f"DELETE FROM {quoted(layer)} WHERE fid = ?", gone)
    numbers = {row.line for row in rows}
    there = [line for (line,) in db.execute(f"SELECT DISTINCT line FROM {VERTEX_TABLE}")]
    db.executemany(f"DELETE FROM {VERTEX_TABLE} WHERE line = ?", [(n,) for n in there if n not in numbers])


def _next_line(db: sqlite3.Connection) -> int:
    row = db.execute(
        f"SELECT max(coalesce((SELECT max(line) FROM {VERTEX_TABLE}), -1),"
        " coalesce((SELECT max(line) FROM line_version), -1))"
    ).fetchone()
    return int(row[0]) + 1


def _saved(db: sqlite3.Connection, crs: str, path: Path) -> LineFileState:
    """Return the lines according to the history, and what the layers hold differently."""
    stored = db.execute(
        "SELECT version, layer, fid, line, edit, content FROM line_version WHERE layer IS NOT NULL ORDER BY line"
    ).fetchall()
    lines = unpack_lines([row[5] for row in stored], crs)
    rows = [LineRow(*row[1:4]) for row in stored]
    (revision,) = db.execute("SELECT coalesce(max(number), 0) FROM edit").fetchone()
    elsewhere = find_outside_changes(db, lines, rows, path)
    check_texts(elsewhere.came, path)
    return LineFileState(
        lines=lines,
        versions=tuple(row[0] for row in stored),
        edits=tuple(row[4] for row in stored),
        revision=revision,
        next_line=_next_line(db),
        steps=steps_of(db),
        elsewhere=elsewhere,
    )
