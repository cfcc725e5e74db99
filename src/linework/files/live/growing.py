"""A text file that another program appends to: its new lines, whole ones only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.arrays import FloatArray
from linework.files.logs.tables import column_names, finite_number, header_cells, split_cells

#: Most bytes that are read at once: an hour of a log at 100 Hz is 20 MB, and the pairs shall not wait for all of it.
_MOST_BYTES = 1 << 20
#: Longest line: a log that never ends one is not a table. [bytes]
_LONGEST_LINE = 1 << 16


class GrowingFile:
    """The lines that are appended to a file, each given once, when its end is there.

    Parameters
    ----------
    path
        May be missing still.

    Notes
    -----
    A line without an end may be half written, and waits. Where the file is replaced by a shorter one, it is read from
    its start again, and `n_replaced` counts that.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.n_replaced = 0
        self._at, self._rest = 0, b""

    def lines(self) -> list[str]:
        """Return the lines that ended since the last call; none where the file is missing or cannot be read now."""
        try:
            with self.path.open("rb") as file:
                if file.seek(0, 2) < self._at:
                    self._at, self._rest = 0, b""
                    self.n_replaced += 1
                file.seek(self._at)
                data = file.read(_MOST_BYTES)
        except OSError:
            return []
        self._at += len(data)
        *whole, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > _LONGEST_LINE:
            self._rest = b""
        return [line.rstrip(b"\r").decode("utf-8-sig", errors="replace") for line in whole]

    def skip(self, n_bytes: int) -> None:
        """Leave out the next bytes, which end with a line."""
        self._at += n_bytes

    def skip_to_last(self, n_bytes: int) -> None:
        """Leave out all but the last bytes of the file, and the line in whose middle they begin."""
        try:
            with self.path.open("rb") as file:
                start = file.seek(0, 2) - n_bytes
                if start > self._at:
                    file.seek(start)
                    self._at, self._rest = start + len(file.readline(_LONGEST_LINE)), b""
        except OSError:
            return


@dataclass(frozen=True, slots=True)
class NewRows:
    """Rows of a table that were appended: texts by column, and how many lines held something else.

    Parameters
    ----------
    numbers
        Number of each row in the table, from 0; lines that hold something else count too.
    """

    columns: dict[str, list[str]]
    numbers: list[int]
    n_bad: int = 0

    def __len__(self) -> int:
        return len(self.numbers)


class GrowingTable:
    """Rows that are appended to a CSV file with a header row.

    Parameters
    ----------
    path
        May be missing still.
    required, groups, one_of
        Columns, as for `linework.files.logs.tables.read_table`.

    Notes
    -----
    Separators and quotation marks are as in files that are complete.
    """

    def __init__(
        self,
        path: Path,
        required: Sequence[str],
        groups: Sequence[Sequence[str]] = (),
        *,
        one_of: bool = False,
    ) -> None:
        self.path, self._required, self._groups, self._one_of = path, required, groups, one_of
        self._file = GrowingFile(path)
        self._separator, self._n_cells, self._n_rows, self._n_replaced = "", 0, 0, 0
        self._places: dict[str, int] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """The columns that are read; none before the header is there."""
        return tuple(self._places)

    def rows(self) -> NewRows:
        """Return the rows that ended since the last call.

        Raises
        ------
        InputError
            The first line does not name the columns.
        """
        lines = self._file.lines()
        if self._file.n_replaced != self._n_replaced:
            self._n_replaced, self._places, self._n_rows = self._file.n_replaced, {}, 0
        if lines and not self._places:
            self._read_header(lines.pop(0))
        found: dict[str, list[str]] = {name: [] for name in self._places}
        numbers, n_bad = [], 0
        for line in lines:
            cells = split_cells(line, self._separator)
            if len(cells) == self._n_cells:
                for name, place in self._places.items():
                    found[name].append(cells[place].strip())
                numbers.append(self._n_rows)
            elif line.strip():
                n_bad += 1
            self._n_rows += bool(line.strip())
        return NewRows(found, numbers, n_bad)

    def numbers(self) -> tuple[dict[str, FloatArray], int]:
        """Return the new rows as numbers, (n,) float64 each, and how many lines hold something else.

        Raises
        ------
        InputError
            As for `rows`.
        """
        new = self.rows()
        if len(new) == 0:
            return {name: np.zeros(0) for name in self._places}, new.n_bad
        read = {
            name: [self._number(text) for text in texts] for name, texts in new.columns.items()
        }  # fmt: skip
        values = np.array([read[name] for name in self._places], dtype=np.float64)
        is_good = np.isfinite(values).all(axis=0)
        n_bad = new.n_bad + int(np.count_nonzero(~is_good))
        return dict(zip(self._places, values[:, is_good], strict=True)), n_bad

    def skip_to_last(self, n_bytes: int) -> None:
        """Leave out the rows before the last bytes of the file, but for its header."""
        self._begin()
        self._file.skip_to_last(n_bytes)

    def _begin(self) -> None:
        """Read the header, if the file has one already."""
        if self._places:
            return
        try:
            with self.path.open("rb") as file:
                line = file.readline(_LONGEST_LINE)
        except OSError:
            return
        if line.endswith(b"\n"):
            self._read_header(line.rstrip(b"\r\n").decode("utf-8-sig", errors="replace"))
            self._file.skip(len(line))

    def _read_header(self, line: str) -> None:
        self._separator, there = header_cells(line)
        names = column_names(self.path, there, self._required, self._groups, one_of=self._one_of)
        self._n_cells = len(there)
        self._places = {name: there.index(name) for name in names}

    def _number(self, text: str) -> float:
        value = finite_number(text if self._separator == "," else text.replace(",", "."))
        return np.nan if value is None else value
