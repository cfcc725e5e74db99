"""The line file: a GeoPackage that people edit, to which every change is saved at once, with its history."""

from __future__ import annotations

import os
import sqlite3
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from linework.errors import MachineError, StaleError
from linework.files.line_file.checks import LinesById, check_change, check_not_stale
from linework.files.line_file.history import (
    REDO,
    UNDO,
    HistoryEntry,
    UndoSteps,
    add_entry,
    add_key,
    add_versions,
    as_edit,
    displace_versions,
    edit_number_of_key,
    entry_of,
    line_bytes,
    place_versions,
    read_entries,
    reviewed_versions,
    stored_lines,
    undone_edits,
    utc_now,
)
from linework.files.line_file.open import LineFileState, open_line_file
from linework.files.line_file.outside_changes import OutsideChanges, find_outside_changes
from linework.files.line_file.tables import LineRow, delete_rows, insert_rows, quoted, sql_errors, transaction
from linework.files.vectors.gpkg_guard import check_schema
from linework.lines.names import with_ids
from linework.model.changes import Change, Edit
from linework.model.lines import LineSet

#: Action of the edit that holds what other programs changed.
CHANGED_OUTSIDE = "changed elsewhere"


class LineFile:
    """Lines that are edited. Made by `LineFile.opened`.

    All methods may be called from any thread; calls are carried out one after the other.

    Notes
    -----
    Every change is one SQLite transaction in the line file itself: rows of old lines are removed, rows of new ones
    appended, and both are recorded with who changed what and when (tables `edit` and `line_version`). At any moment
    the file is a GeoPackage that other programs can read. An undo is an edit too: nothing saved is ever lost.
    """

    path: Path

    def __init__(self, path: Path, db: sqlite3.Connection, opened: LineFileState) -> None:
        self.path = path
        self._db, self._crs = db, opened.lines.crs
        self._turn = threading.RLock()
        self._held = LinesById(opened.lines)
        self._versions = dict(zip(opened.lines.id.tolist(), opened.versions, strict=True))
        self._changed_by = dict(zip(opened.lines.id.tolist(), opened.edits, strict=True))
        self._steps: UndoSteps = opened.steps
        self._revision, self._next_line = opened.revision, opened.next_line
        self._seen, self._stat = self._data_version(), path.stat()

    @classmethod
    @contextmanager
    def opened(cls, path: Path, *, crs: str, is_held: bool = False) -> Iterator[LineFile]:
        """Open a line file for editing, or create it; it stays locked until the context ends.

        What other programs did to it since it was open last becomes one edit, `CHANGED_OUTSIDE`, by nobody (``who == ""``).

        Parameters
        ----------
        crs
            CRS that the lines must be in: WKT2, or "local".
        is_held
            Whether the caller already holds the lock of the output (`reserved_output`).

        Raises
        ------
        UsageError
            The name is not that of a GeoPackage.
        InputError
            Not a GeoPackage, damaged, or not made by linework.
        CrsError
            In another CRS.
        OutputExistsError
            Another workbench or run has it open.
        MachineError
            It cannot be written to.
        """
        with open_line_file(path, crs, is_held=is_held) as (db, found):
            line_file = cls(path, db, found)
            with sql_errors(path):
                line_file._take_over(found.elsewhere)
            yield line_file

    @property
    def lines(self) -> LineSet:
        """All lines, including rejected ones (``review == "rejected"``), in the order they were added."""
        with self._turn:
            return self._held.all

    @property
    def revision(self) -> int:
        """Number of the last edit, 0 before the first."""
        return self._revision

    @property
    def can_undo(self) -> bool:
        """Whether there is an edit to undo."""
        return bool(self._steps.done)

    @property
    def can_redo(self) -> bool:
        """Whether the last edit is an undo."""
        return bool(self._steps.undone)

    def commit(self, change: Change, *, who: str, based_on: int | None = None, key: str = "") -> Edit:
        """Save a change; it is on the disk when this returns.

        Parameters
        ----------
        change
            Its `before` holds the lines as they are now.
        based_on
            Revision that the person was looking at.
        key
            Key chosen by the sender, "" for none. An edit already saved under it is returned, and nothing is saved.

        Raises
        ------
        StaleError
            A line of `before` has changed since, or no longer exists. Nothing was saved.
        UsageError
            Lines that cannot be saved, see `check_change`.
        OutputExistsError, MachineError
            Another program is writing the file, or the disk failed. Nothing was saved.
        """
        with self._turn, sql_errors(self.path):
            self._look_elsewhere()
            done = self.saved_as(key)
            if done is not None:
                return done
            gone = change.before.id.tolist()
            if based_on is not None and based_on > self._revision:
                raise StaleError(
                    f"{based_on - self._revision} edits are missing: the file was replaced by an older one",
                    where=self.path, advice="reload the page",
                )  # fmt: skip
            seen = None if based_on is None else {n for n, by in self._changed_by.items() if by <= based_on}
            check_not_stale(change.before, self._held, seen, self.path)
            check_change(change, self._held, self._crs, self.path)
            after = with_ids(change.after.with_columns(crs=self._crs), self._held)
            return self._save(gone, after, who, change.action, key=key)

    def saved_as(self, key: str) -> Edit | None:
        """Return the edit saved under a key, even before the file was opened; None where there is none."""
        with self._turn, sql_errors(self.path):
            number = edit_number_of_key(self._db, key) if key else 0
            return as_edit(self._db, entry_of(self._db, number), self._crs) if number else None

    def undo(self, *, who: str) -> Edit | None:
        """Undo the last edit that is not undone yet; None where there is none."""
        with self._turn, sql_errors(self.path):
            self._look_elsewhere()
            return self._back(self._steps.done[-1:], who, UNDO)

    def redo(self, *, who: str) -> Edit | None:
        """Undo the last undo, if nothing else was done since; else None."""
        with self._turn, sql_errors(self.path):
            self._look_elsewhere()
            return self._back(self._steps.undone[-1:], who, REDO)

    def history(self, most: int = 100) -> list[Edit]:
        """Return the last edits, newest first, with their lines."""
        with self._turn, sql_errors(self.path):
            return [as_edit(self._db, entry, self._crs) for entry in read_entries(self._db, most=most)]

    def entries(self, most: int = 100) -> list[HistoryEntry]:
        """Return the last edits, newest first, with only the ids of their lines."""
        with self._turn, sql_errors(self.path):
            return read_entries(self._db, most=most)

    @property
    def judged(self) -> LineSet:
        """Lines as they were before people changed or deleted them (see `linework.editing.queue.carried_over.carry_over_reviews`)."""
        with self._turn, sql_errors(self.path):
            return stored_lines(self._db, reviewed_versions(self._db, self._steps), self._crs)

    @property
    def undone(self) -> frozenset[int]:
        """Numbers of the edits that are currently undone."""
        with self._turn, sql_errors(self.path):
            return undone_edits(self._db)

    def since(self, revision: int) -> tuple[LineSet, tuple[str, ...]]:
        """Return the lines added or changed after a revision, and the ids of those removed; after 0: all lines."""
        with self._turn, sql_errors(self.path):
            if revision <= 0:
                return self._held.all, ()
            touched = dict.fromkeys(
                n for e in reversed(read_entries(self._db, after=revision)) for n in e.ids
            )
            there = [name for name in touched if name in self._held]
            return self._held.of(there), tuple(name for name in touched if name not in self._held)

    def _back(self, numbers: Sequence[int], who: str, action: str) -> Edit | None:
        """Save the reverse of an edit: its lines become what they were before."""
        if not numbers:
            return None
        entry = entry_of(self._db, numbers[0])
        came = stored_lines(self._db, entry.came, self._crs)
        lines = stored_lines(self._db, entry.gone, self._crs)
        return self._save(came.id.tolist(), lines, who, action, undoes=entry.number, versions=entry.gone)

    def _look_elsewhere(self) -> None:
        """Save as an edit what another program has written since the last check."""
        if not self.path.exists() or not os.path.samestat(self.path.stat(), self._stat):
            raise MachineError(
                "was removed or replaced while it was open", where=self.path, advice="open it again"
            )
        now, seen = self._data_version(), self._seen
        if now == seen:
            return
        check_schema(self._db, self.path, to_edit=True)
        ids = list(self._held)
        rows = [self._row(self._versions[name]) for name in ids]
        found = find_outside_changes(self._db, self._held.of(ids), rows, self.path)
        self._seen = now
        try:
            self._take_over(found)
        except BaseException:
            self._seen = seen
            raise

    def _take_over(self, elsewhere: OutsideChanges) -> None:
        if elsewhere:
            lines = with_ids(elsewhere.came, {*self._held})
            self._save(elsewhere.gone, lines, "", CHANGED_OUTSIDE, features=elsewhere.features)

    def _row(self, version: int) -> LineRow:
        found = self._db.execute("SELECT layer, fid, line FROM line_version WHERE version = ?", (version,))
        return LineRow(*found.fetchone())

    def _data_version(self) -> int:
        """Return a number that changes when another connection writes."""
        return int(self._db.execute("PRAGMA data_version").fetchone()[0])

    def _save(
        self, gone: Sequence[str], after: LineSet, who: str, action: str, *,
        undoes: int = 0, versions: Sequence[int] = (), features: Sequence[tuple[str, int]] = (), key: str = "",
    ) -> Edit:  # fmt: skip
        """Replace lines in one transaction, then in memory.

        Parameters
        ----------
        versions
            Numbers of the versions, where the lines were stored before.
        features
            Layers and features that other programs added, which are removed as well.
        """
        number, ids = self._revision + 1, after.id.tolist()
        before = self._held.of(gone)
        with transaction(self._db):
            if self._data_version() != self._seen:
                raise StaleError(
                    "another program has just changed it",
                    where=self.path,
                    advice="reload, then repeat the change",
                )
            old = [self._versions[name] for name in gone]
            delete_rows(self._db, displace_versions(self._db, old))
            for layer, fid in features:
                self._db.execute(f"DELETE FROM {quoted(layer)} WHERE fid = ?", (fid,))
            rows = insert_rows(self._db, after, self._next_line)
            new = list(versions) or add_versions(self._db, ids, line_bytes(after))
            place_versions(self._db, new, rows, number)
            touched = tuple(dict.fromkeys([*gone, *ids]))
            entry = HistoryEntry(number, utc_now(), who, action, undoes, touched, tuple(old), tuple(new))
            add_entry(self._db, entry)
            if key:
                add_key(self._db, key, number)
        self._held.replace(gone, after)
        for name in gone:
            del self._versions[name], self._changed_by[name]
        self._versions |= dict(zip(ids, new, strict=True))
        self._changed_by |= dict.fromkeys(ids, number)
        self._revision, self._next_line = number, self._next_line + len(after)
        self._steps = self._steps.after(number, action, undoes)
        return Edit(number, entry.time_utc, who, Change(action, before, after), undoes)
