"""Edit history of a line file: versions of lines, the edits that replaced them, and what can be undone."""

from __future__ import annotations

import json
import math
import sqlite3
import struct
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.errors import InputError
from linework.files.line_file.tables import LineRow
from linework.model.changes import Change, Edit
from linework.model.columns import column_types
from linework.model.lines import LINE_COLUMNS, LineSet

UNDO, REDO = "undo", "redo"
#: Action of edits made by an extraction, not by a person: their lines may be found again.
EXTRACT = "extract"


@dataclass(frozen=True, slots=True)
class HistoryEntry:
    """A row of the table `edit`; `gone` and `came` are the version numbers of removed and added lines."""

    number: int
    time_utc: str
    who: str
    action: str
    undoes: int
    ids: tuple[str, ...]
    gone: tuple[int, ...]
    came: tuple[int, ...]


def add_versions(db: sqlite3.Connection, ids: Sequence[str], contents: Iterable[bytes]) -> list[int]:
    """Store lines and return their version numbers; they are in no layer yet (see `place_versions`)."""
    statement = "INSERT INTO line_version (id, edit, content) VALUES (?, 0, ?)"
    rows = zip(ids, contents, strict=True)
    return [int(db.execute(statement, (name, pack_line(line))).lastrowid or 0) for name, line in rows]


def place_versions(
    db: sqlite3.Connection, versions: Sequence[int], rows: Sequence[LineRow], edit: int
) -> None:
    """Record the layer and feature of versions, and the edit that put them there."""
    values = [(r.layer, r.fid, r.line, edit, v) for v, r in zip(versions, rows, strict=True)]
    db.executemany("UPDATE line_version SET layer = ?, fid = ?, line = ?, edit = ? WHERE version = ?", values)


def displace_versions(db: sqlite3.Connection, versions: Sequence[int]) -> list[LineRow]:
    """Record that versions are no longer in a layer; return where they were."""
    found = []
    for version in versions:
        row = db.execute("SELECT layer, fid, line FROM line_version WHERE version = ?", (version,)).fetchone()
        found.append(LineRow(str(row[0]), int(row[1]), int(row[2])))
        db.execute("UPDATE line_version SET layer = NULL, fid = NULL WHERE version = ?", (version,))
    return found


def add_entry(db: sqlite3.Connection, entry: HistoryEntry) -> None:
    """Append an edit."""
    values = (entry.number, entry.time_utc, entry.who, entry.action, entry.undoes)
    lists = [json.dumps(part, ensure_ascii=False) for part in (entry.ids, entry.gone, entry.came)]
    db.execute("INSERT INTO edit VALUES (?, ?, ?, ?, ?, ?, ?, ?)", (*values, *lists))


def read_entries(db: sqlite3.Connection, *, after: int = 0, most: int = -1) -> list[HistoryEntry]:
    """Return edits after a number, newest first; at most `most` (-1: all)."""
    rows = db.execute("SELECT * FROM edit WHERE number > ? ORDER BY number DESC LIMIT ?", (after, most))
    return [HistoryEntry(*row[:5], *(tuple(json.loads(part)) for part in row[5:])) for row in rows]


def add_key(db: sqlite3.Connection, key: str, number: int) -> None:
    """Record the key under which an edit was sent."""
    db.execute("INSERT INTO edit_key VALUES (?, ?)", (key, number))


def edit_number_of_key(db: sqlite3.Connection, key: str) -> int:
    """Return the edit that was sent under a key, 0: none."""
    row = db.execute("SELECT number FROM edit_key WHERE key = ?", (key,)).fetchone()
    return 0 if row is None else int(row[0])


def entry_of(db: sqlite3.Connection, number: int) -> HistoryEntry:
    """Return an edit."""
    return read_entries(db, after=number - 1, most=-1)[-1]


def stored_lines(db: sqlite3.Connection, versions: Sequence[int], crs: str) -> LineSet:
    """Return the lines of these versions, in this order."""
    statement = "SELECT content FROM line_version WHERE version = ?"
    return unpack_lines([db.execute(statement, (v,)).fetchone()[0] for v in versions], crs)


def as_edit(db: sqlite3.Connection, entry: HistoryEntry, crs: str) -> Edit:
    """Return an edit with its lines."""
    before, after = (stored_lines(db, part, crs) for part in (entry.gone, entry.came))
    return Edit(entry.number, entry.time_utc, entry.who, Change(entry.action, before, after), entry.undoes)


def reviewed_versions(db: sqlite3.Connection, steps: UndoSteps) -> list[int]:
    """Return the versions of lines that people's edits replaced or removed; undone edits do not count."""
    known = {entry.number: entry for entry in read_entries(db)}
    found: dict[int, None] = {}
    for number in steps.done:
        origin = known[number]
        # A redone edit counts as the one that it repeats
        while origin.undoes:
            origin = known[origin.undoes]
        if origin.action != EXTRACT:
            found |= dict.fromkeys(known[number].gone)
    return list(found)


def undone_edits(db: sqlite3.Connection) -> frozenset[int]:
    """Return the numbers of the edits that are currently undone."""
    found: set[int] = set()
    rows = db.execute("SELECT number, undoes FROM edit WHERE undoes != 0 ORDER BY number DESC")
    for number, undoes in rows:
        if number not in found:
            found.add(int(undoes))
    return frozenset(found)


def utc_now() -> str:
    """Return the current UTC time as ISO 8601."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


@dataclass(frozen=True, slots=True)
class UndoSteps:
    """Edits that can be undone, and undos that can be redone, the last of each first."""

    done: tuple[int, ...] = ()
    undone: tuple[int, ...] = ()

    def after(self, number: int, action: str, undoes: int) -> UndoSteps:
        """Return the steps after one more edit.

        >>> steps = UndoSteps().after(1, "draw", 0).after(2, "undo", 1)
        >>> steps, steps.after(3, "redo", 2), steps.after(3, "move", 0)
        (UndoSteps(done=(), undone=(2,)), UndoSteps(done=(3,), undone=()), UndoSteps(done=(3,), undone=()))
        """
        if undoes and action == UNDO:
            return UndoSteps(self.done[:-1], (*self.undone, number))
        if undoes and action == REDO:
            return UndoSteps((*self.done, number), self.undone[:-1])
        return UndoSteps((*self.done, number))


def steps_of(db: sqlite3.Connection) -> UndoSteps:
    """Return what can be undone and redone after all edits."""
    steps = UndoSteps()
    for number, action, undoes in db.execute("SELECT number, action, undoes FROM edit ORDER BY number"):
        steps = steps.after(number, action, undoes)
    return steps


_LENGTH = struct.Struct("<I")
#: zlib level: the fastest, because a commit waits for it and coordinates hardly shrink.
_LEVEL = 1
#: Largest line: six million vertices. [bytes]
MOST_LINE_BYTES = 1 << 28


def line_bytes(lines: LineSet) -> list[bytes]:
    """Return each line as bytes; equal lines give equal bytes.

    Notes
    -----
    The length of a JSON document (4 bytes, little endian), the document (columns of the line, and `n`, its
    vertices), then x, y, z, sigma_xy_m and sigma_z_m of all vertices as float64 and bridged and observed as bytes.
    """
    columns = {name: getattr(lines, name).tolist() for name in LINE_COLUMNS}
    found = []
    for i, (first, end) in enumerate(
        zip(lines.offsets[:-1].tolist(), lines.offsets[1:].tolist(), strict=True)
    ):
        head = {"n": end - first} | {name: _plain(values[i]) for name, values in columns.items()}
        text = json.dumps(head, ensure_ascii=True, allow_nan=False).encode()
        numbers = (lines.xyz, lines.sigma_xy_m, lines.sigma_z_m)
        parts = [values[first:end].astype("<f8").tobytes() for values in numbers]
        parts += [values[first:end].astype(np.uint8).tobytes() for values in (lines.bridged, lines.observed)]
        found.append(b"".join([_LENGTH.pack(len(text)), text, *parts]))
    return found


def pack_line(line: bytes) -> bytes:
    """Return the bytes of a line, compressed for storage."""
    return zlib.compress(line, _LEVEL)


def unpack_lines(stored: Sequence[bytes], crs: str) -> LineSet:
    """Return lines from their stored bytes.

    Raises
    ------
    InputError
        It was not stored by `pack_line`, or is damaged.
    """
    try:
        return _unpacked(stored, crs)
    except (ValueError, KeyError, TypeError, struct.error, zlib.error) as error:
        raise InputError("its edit history is damaged", advice="restore a copy") from error


def _unpacked(stored: Sequence[bytes], crs: str) -> LineSet:
    heads: list[dict[str, Any]] = []
    numbers: list[FloatArray] = []
    flags: list[AnyArray] = []
    for content in stored:
        # Limited: a few compressed bytes may expand to any number of zeros
        line = zlib.decompressobj().decompress(content, MOST_LINE_BYTES)
        (length,) = _LENGTH.unpack_from(line)
        start = _LENGTH.size + length
        head = json.loads(line[_LENGTH.size : start])
        n = int(head["n"])
        heads.append(head)
        numbers.append(np.frombuffer(line, "<f8", 5 * n, start))
        flags.append(np.frombuffer(line, np.uint8, 2 * n, start + 40 * n).reshape(2, n))
    if not heads:
        return LineSet.empty(crs)
    columns: dict[str, Any] = {
        "sigma_xy_m": np.concatenate(
            [values[-2 * (len(values) // 5) : -(len(values) // 5)] for values in numbers]
        ),
        "sigma_z_m": np.concatenate([values[-(len(values) // 5) :] for values in numbers]),
        "bridged": np.concatenate([both[0] for both in flags]).astype(bool),
        "observed": np.concatenate([both[1] for both in flags]).astype(bool),
    }
    for name in LINE_COLUMNS:
        column = column_types(LineSet)[name]
        values = [head.get(name, column.fill) for head in heads]
        if column.dtype is np.float64:
            values = [math.nan if value is None else value for value in values]
        columns[name] = np.array(values, dtype=column.dtype)
    xyz = [values[: 3 * (len(values) // 5)].reshape(-1, 3) for values in numbers]
    return LineSet.from_lines(xyz, crs=crs, **columns)


def _plain(value: Any) -> Any:
    return None if value != value else value
