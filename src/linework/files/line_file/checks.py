"""What a drawing takes: lines that every format can hold, with texts that a table can show."""

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

#: A note is a sentence or some, all else a word or a file's name. A column of texts takes as much memory for every
#: line as for the longest.
LONGEST_STORED_NOTE, LONGEST_TEXT = 1000, 300


def check_change(change: Change, held: Container[str], crs: str, path: Path) -> None:
    """Refuse a change that cannot be saved as it is.

    Raises
    ------
    UsageError
        Lines in another CRS or with two of one id, coordinates or texts that cannot be stored.
    """
    after = change.after
    if len(after) and after.crs != crs:
        raise UsageError("lines in another CRS than the drawing's", where=path, advice="convert them first")
    check_writable(after, path)
    check_texts(after, path)
    gone = set(change.before.id.tolist())
    for name, n in Counter(after.id.tolist()).items():
        if name and (n > 1 or (name in held and name not in gone)):
            raise UsageError(
                f"two lines of the id '{name[:60]}'", where=path, advice="leave the id of new lines empty"
            )


def check_not_stale(before: LineSet, held: LinesById, seen: Container[str] | None, path: Path) -> None:
    """Refuse a change of lines that are not as they were when somebody decided on it.

    Parameters
    ----------
    seen
        Ids of lines that are as that person saw them; None: not known, the lines themselves say.

    Raises
    ------
    StaleError
        Names the first line.
    """
    ids = before.id.tolist()
    missing = [name for name in ids if name not in held]
    changed = [name for name in ids if seen is not None and name not in seen]
    if not missing and not changed and line_bytes(held.of(ids)) != line_bytes(before):
        changed = ids
    if missing or changed:
        what = "is there no more" if missing else "has changed since"
        raise StaleError(
            f"line {(missing or changed)[0][:60]} {what}", where=path, advice="look again, then repeat it"
        )


def check_texts(lines: LineSet, path: Path) -> None:
    """Refuse texts that are too long or hold what no table can (NUL, halves of characters).

    Raises
    ------
    UsageError
        Names the column, and how long the text is.
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


# The lines of a drawing in memory, by their ids: a change costs what it changes, not what there is


class LinesById:
    """Lines by id.

    Notes
    -----
    A line is held as (set, index). A new set comes with every change; they are made one when all lines are asked for.
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
        """All lines, in the order in which they came."""
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
        """Take lines out and put others in, at the end."""
        for name in gone:
            del self._places[name]
        self._sets.append(came)
        number = len(self._sets) - 1
        self._places |= {name: (number, i) for i, name in enumerate(came.id.tolist())}
        self._all = None
