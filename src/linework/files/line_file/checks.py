"""Checks of changes before they are saved, and the lines of a line file in memory."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from linework.errors import StaleError, UsageError
from linework.files.line_file.history import line_bytes
from linework.files.vectors.fields import check_writable
from linework.model.changes import Change
from linework.model.lines import LINE_COLUMNS, LineSet

#: Longest note (a few sentences) and longest other text (a word or a file name). [characters] A column of texts takes
#: as much memory for every line as for the longest.
LONGEST_STORED_NOTE, LONGEST_TEXT = 1000, 300


def check_change(change: Change, held: Container[str], crs: str, path: Path) -> None:
    """Refuse a change that cannot be saved.

    Raises
    ------
    UsageError
        Another CRS, two lines with one id, or coordinates or texts that cannot be stored.
    """
    after = change.after
    if len(after) and after.crs != crs:
        raise UsageError(
            "lines are in another CRS than the line file", where=path, advice="convert them first"
        )
    check_writable(after, path)
    check_texts(after, path)
    gone = set(change.before.id.tolist())
    for name, n in Counter(after.id.tolist()).items():
        if name and (n > 1 or (name in held and name not in gone)):
            raise UsageError(
                f"two lines have the id '{name[:60]}'", where=path, advice="leave the id of new lines empty"
            )


def check_not_stale(before: LineSet, held: LinesById, seen: Container[str] | None, path: Path) -> None:
    """Refuse a change of lines that have changed since the person looked at them.

    Parameters
    ----------
    seen
        Ids of lines unchanged since then; None: not known, the lines themselves are compared.

    Raises
    ------
    StaleError
        With the id of the first such line.
    """
    ids = before.id.tolist()
    missing = [name for name in ids if name not in held]
    changed = [name for name in ids if seen is not None and name not in seen]
    if not missing and not changed and line_bytes(held.of(ids)) != line_bytes(before):
        changed = ids
    if missing or changed:
        what = "no longer exists" if missing else "has changed since"
        raise StaleError(
            f"line {(missing or changed)[0][:60]} {what}", where=path, advice="reload, then repeat the change"
        )


def check_texts(lines: LineSet, path: Path) -> None:
    """Refuse texts that are too long or cannot be stored (NUL, lone surrogates).

    Raises
    ------
    UsageError
        With the column, and the length of the text.
    """
    for name in LINE_COLUMNS:
        values = getattr(lines, name)
        if values.dtype.kind != "U":
            continue
        most = LONGEST_STORED_NOTE if name == "note" else LONGEST_TEXT
        longest = int(np.char.str_len(values).max(initial=0))
        if longest > most:
            raise UsageError(f"{name} of {longest:,} characters, at most {most:,} are kept", where=path,
                             advice="shorten it")  # fmt: skip
        for text in set(values.tolist()):
            if "\0" in text or any("\ud800" <= c <= "\udfff" for c in text):
                raise UsageError(f"{name} has characters that cannot be stored", where=path,
                                 advice="type it again")  # fmt: skip


class LinesById:
    """The lines of a line file in memory, by id; the cost of a change does not grow with the number of lines.

    Notes
    -----
    A line is held as (set, index). Every change adds a set; they are joined when all lines are requested.
    """

    def __init__(self, lines: LineSet) -> None:
        self._crs = lines.crs
        self._all: LineSet | None = None
        self._hold(lines)

    def _hold(self, lines: LineSet) -> None:
        self._all = lines
        self._sets = [lines]
        self._places = {name: (0, i) for i, name in enumerate(lines.id.tolist())}

    def __contains__(self, name: object) -> bool:
        return name in self._places

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    @property
    def all(self) -> LineSet:
        """All lines, in the order they were added."""
        if self._all is None:
            self._hold(self.of(self._places))
        assert self._all is not None
        return self._all

    def of(self, ids: Iterable[str]) -> LineSet:
        """Return the lines of these ids, in this order."""
        places = [self._places[name] for name in ids]
        parts: list[LineSet] = []
        begun = 0
        for end in range(1, len(places) + 1):
            if end == len(places) or places[end][0] != places[begun][0]:
                parts.append(self._sets[places[begun][0]].take([i for _, i in places[begun:end]]))
                begun = end
        return LineSet.concatenate(parts) if parts else LineSet.empty(self._crs)

    def replace(self, gone: Sequence[str], came: LineSet) -> None:
        """Remove lines and append others."""
        for name in gone:
            del self._places[name]
        self._sets.append(came)
        number = len(self._sets) - 1
        self._places |= {name: (number, i) for i, name in enumerate(came.id.tolist())}
        self._all = None
