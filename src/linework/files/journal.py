"""The journal of a run: which tiles are done, which failed; kept so that a killed run goes on where it was."""

from __future__ import annotations

import contextlib
import json
import sqlite3
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from linework.errors import MachineError


@dataclass(frozen=True, slots=True)
class Entry:
    """A tile that is done: the SHA-256 of its result file, and its receipt."""

    tile_id: str
    sha256: str
    receipt: Mapping[str, Any]


class Journal:
    """A journal on disk; what has been entered stays, also when the power goes.

    Parameters
    ----------
    path
        Made when it is not there.

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

    def enter(self, entry: Entry) -> None:
        """Enter a tile as done; the last entry of a tile counts."""
        text = json.dumps(dict(entry.receipt), allow_nan=False)
        self._write("INSERT OR REPLACE INTO done VALUES (?, ?, ?)", (entry.tile_id, entry.sha256, text))

    def done(self) -> dict[str, Entry]:
        """Return the tiles that are done, by name."""
        with _machine_errors(self._path):
            rows = self._connection.execute("SELECT tile_id, sha256, receipt FROM done").fetchall()
        return {row[0]: Entry(row[0], row[1], json.loads(row[2])) for row in rows}

    def note_output(self, name: str, sha256: str) -> None:
        """Note the bytes that are about to be put in an output's place."""
        self._write("INSERT OR REPLACE INTO published VALUES (?, ?)", (name, sha256))

    def noted_output(self, name: str) -> str:
        """Return the SHA-256 of what was about to be put in an output's place, "" where none was."""
        with _machine_errors(self._path):
            row = self._connection.execute("SELECT sha256 FROM published WHERE name = ?", (name,)).fetchone()
        return str(row[0]) if row else ""

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    def _write(self, statement: str, values: tuple[str, ...]) -> None:
        with _machine_errors(self._path):
            self._connection.execute(statement, values)


@contextlib.contextmanager
def _machine_errors(path: Path) -> Iterator[None]:
    """Turn what SQLite says of a full or broken disk into ours; a damaged file is another matter."""
    try:
        yield
    except sqlite3.OperationalError as error:
        raise MachineError(
            f"cannot be written: {error}",
            where=path,
            advice="free some space there, or give --work another folder",
        ) from error
