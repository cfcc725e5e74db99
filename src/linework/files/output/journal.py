"""The journal of a run: tasks that are done, so that a killed run can be resumed."""

from __future__ import annotations

import contextlib
import json
import os
import sqlite3
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from linework.errors import MachineError, argument


def open_journal(path: Path) -> Journal:
    """Open a journal; a damaged one is replaced, and all tasks are done again."""
    try:
        journal = Journal(path)
        journal.done()
    except (sqlite3.DatabaseError, ValueError):
        for ending in ("", "-journal", "-wal", "-shm"):
            path.with_name(path.name + ending).unlink(missing_ok=True)
        return Journal(path)
    return journal


def noted_output_in(path: Path, name: str) -> str | None:
    """Return the SHA-256 that a journal notes for an output, "" if it notes none; None for a damaged journal."""
    with contextlib.suppress(sqlite3.DatabaseError):
        journal = Journal(path)
        try:
            return journal.noted_output(name)
        finally:
            journal.close()
    return None


@dataclass(frozen=True, slots=True)
class JournalEntry:
    """A task that is done: its name, the SHA-256 of its result file, and its receipt."""

    tile_id: str
    sha256: str
    receipt: Mapping[str, Any]


class Journal:
    """Journal in an SQLite file; entries survive a loss of power.

    Parameters
    ----------
    path
        Created if it does not exist.

    Raises
    ------
    MachineError
        It cannot be written.
    sqlite3.DatabaseError
        The file is damaged.
    """

    def __init__(self, path: Path) -> None:
        with _machine_errors(path):
            self._path = path
            # One statement, one transaction, on the disk before it returns
            self._connection = sqlite3.connect(path, isolation_level=None)
            self._connection.execute("PRAGMA synchronous = FULL")
            self._connection.execute(
                "CREATE TABLE IF NOT EXISTS done (tile_id TEXT PRIMARY KEY, sha256 TEXT, receipt TEXT)"
            )
            self._connection.execute(
                "CREATE TABLE IF NOT EXISTS published (name TEXT PRIMARY KEY, sha256 TEXT)"
            )

    def enter(self, entry: JournalEntry) -> None:
        """Enter a task as done; the last entry of a task counts."""
        text = json.dumps(dict(entry.receipt), allow_nan=False)
        self._write("INSERT OR REPLACE INTO done VALUES (?, ?, ?)", (entry.tile_id, entry.sha256, text))

    def done(self) -> dict[str, JournalEntry]:
        """Return the entries of tasks that are done, by the name of the task."""
        with _machine_errors(self._path):
            rows = self._connection.execute("SELECT tile_id, sha256, receipt FROM done").fetchall()
        return {row[0]: JournalEntry(row[0], row[1], json.loads(row[2])) for row in rows}

    def note_output(self, name: str, sha256: str) -> None:
        """Note the SHA-256 of an output just before it replaces the file of that name."""
        self._write("INSERT OR REPLACE INTO published VALUES (?, ?)", (_as_utf8(name), sha256))

    def noted_output(self, name: str) -> str:
        """Return the SHA-256 that was noted for an output, "" if none was."""
        with _machine_errors(self._path):
            row = self._connection.execute(
                "SELECT sha256 FROM published WHERE name = ?", (_as_utf8(name),)
            ).fetchone()
        return str(row[0]) if row else ""

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    def _write(self, statement: str, values: tuple[str, ...]) -> None:
        with _machine_errors(self._path):
            self._connection.execute(statement, values)


def _as_utf8(name: str) -> str:
    """Return the name of a file as SQLite takes it: bytes that are not UTF-8 are escaped."""
    return os.fsencode(name).decode("utf-8", errors="backslashreplace")


@contextlib.contextmanager
def _machine_errors(path: Path) -> Iterator[None]:
    """Turn SQLite's errors of a full or broken disk into `MachineError`; those of a damaged file pass."""
    try:
        yield
    except sqlite3.OperationalError as error:
        raise MachineError(
            f"cannot be written: {error}",
            where=path,
            advice=f"free some space there, or name another folder with {argument('work')}",
        ) from error
