"""The one reader of text lines: block by block, any line ends, no line too long, unusable lines counted."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.files.input import open_input

#: Longer lines are not a log's: a binary file, or one without line ends.
MAX_LINE_CHARS = 10_000
#: Read at a time: small enough that reading a block with an irregular line again, line by line, costs little.
_BLOCK_BYTES = 1 << 20
#: Share of unusable lines that is tolerated: logs are cut off and garbled here and there; more than that has
#: another cause (decimal commas, other units).
_MAX_BAD_SHARE = 0.01
#: Most rows held in memory as texts: a drive of 28 hours at 10 Hz.
MAX_ROWS = 1_000_000
#: Most lines of a file: a day of 24 hours at 100 Hz. Seven columns of them take 0.5 GB.
MAX_LINES = 24 * 3600 * 100
#: Most unusable lines that are counted before a file is given up: more than are tolerated in the longest one.
MAX_BAD = 1 + MAX_LINES // 100
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


@dataclass(frozen=True, slots=True)
class TextBlock:
    r"""Whole lines of a file.

    Parameters
    ----------
    text
        The lines, each ended by ``\n`` (the last of a file may lack it).
    first_line
        Number of the first of them, from 1.
    """

    text: bytes
    first_line: int

    @property
    def n_lines(self) -> int:
        """Number of lines."""
        return self.text.count(b"\n") + (not self.text.endswith(b"\n") and bool(self.text))

    def lines(self) -> Iterator[tuple[int, str]]:
        """Yield the number and the text of each line, without its end."""
        text = self.text.decode("utf-8", errors="replace").removesuffix("\n")
        yield from enumerate(text.split("\n") if self.text else (), start=self.first_line)

    def without_first_line(self) -> tuple[str, TextBlock]:
        """Return the first line, and the block of the others."""
        line, _, rest = self.text.partition(b"\n")
        return line.decode("utf-8", errors="replace"), TextBlock(rest, self.first_line + 1)

    def halves(self) -> tuple[TextBlock, TextBlock]:
        """Return about the first half of the lines, and the rest; the block has at least two lines."""
        half = len(self.text) // 2
        middle = (self.text.rfind(b"\n", 0, half) + 1) or (self.text.find(b"\n", half) + 1)
        first = TextBlock(self.text[:middle], self.first_line)
        return first, TextBlock(self.text[middle:], self.first_line + first.n_lines)

    def all_lines_have(self, separator: str, n: int) -> bool:
        """Return whether every line holds `separator` exactly `n` times, and there is a line."""
        bytes_ = np.frombuffer(self.text, dtype=np.uint8)
        marks = bytes_[(bytes_ == ord(separator)) | (bytes_ == 10)]
        if len(marks) == 0 or marks[-1] != 10:
            marks = np.append(marks, np.uint8(10))
        n_lines = len(marks) // (n + 1)
        if self.text == b"" or len(marks) != n_lines * (n + 1):
            return False
        is_end = marks.reshape(n_lines, n + 1) == 10
        return bool(is_end[:, -1].all() and not is_end[:, :-1].any())


def text_blocks(path: Path) -> Iterator[TextBlock]:
    r"""Yield the lines of a file in blocks; ``\r\n`` and ``\r`` end a line too, a byte order mark is skipped.

    Raises
    ------
    InputError
        Not a regular file, empty, a line longer than 10,000 characters (with its number), or more lines than a day of
        100 Hz has.
    """
    number, left = 1, b""
    with open_input(path) as file:
        if file.read(3) != _BYTE_ORDER_MARK:
            file.seek(0)
        while read := file.read(_BLOCK_BYTES):
            if read.endswith(b"\r"):  # its \n may come with the next block
                read += file.read(1)
            if b"\r" in read:
                read = read.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
            whole, end, left = (left + read).rpartition(b"\n")
            block = TextBlock(whole + end, number)
            _check_lengths(path, block, left)
            number += block.n_lines
            if number - 1 > MAX_LINES + 1:
                raise InputError(f"more than {MAX_LINES:,} lines (a day at 100 Hz)", where=path,
                                 advice="split it, or write fewer lines a second")  # fmt: skip
            if whole or end:
                yield block
    if left:
        yield TextBlock(left, number)


def _check_lengths(path: Path, block: TextBlock, left: bytes) -> None:
    """Refuse lines that are too long, also the unfinished one at a block's end."""
    ends = np.flatnonzero(np.frombuffer(block.text, dtype=np.uint8) == 10)
    long = np.flatnonzero(np.diff(ends, prepend=-1) > MAX_LINE_CHARS)
    if len(long) or len(left) > MAX_LINE_CHARS:
        at = int(long[0]) if len(long) else len(ends)
        raise InputError(f"line {block.first_line + at} is longer than {MAX_LINE_CHARS:,} characters", where=path,
                         advice="check what this file is")  # fmt: skip


def text_lines(path: Path) -> list[tuple[int, str]]:
    """Return the lines of a text file that are not blank, with their numbers from 1.

    Raises
    ------
    InputError
        Empty, not text, a line longer than 10,000 characters, more than a million lines.
    """
    found = []
    for block in text_blocks(path):
        if b"\0" in block.text:
            raise InputError("is not a table of text (it holds NUL bytes)", where=path,
                             advice="check what this file is")  # fmt: skip
        if block.first_line + block.n_lines > MAX_ROWS + 2:
            raise InputError(f"more than {MAX_ROWS:,} lines", where=path, advice="split the survey")
        found += [(number, line) for number, line in block.lines() if line.strip()]
    return found


def bad_lines_warning(
    path: Path, bad: Sequence[int], n_good: int, expected: str, *, advice: str, unit: str = "line"
) -> tuple[str, ...]:
    """Return the warning about lines left out.

    Parameters
    ----------
    bad
        Numbers of the lines that cannot be used, ascending.
    n_good
        Number of usable lines.
    expected
        What a line should hold, for the message.
    advice
        What to do if no line is usable.
    unit
        What is counted, where not lines.

    Raises
    ------
    InputError
        No line is usable, or more than 1 % are unusable.
    """
    n_all = n_good + len(bad)
    if n_good == 0:
        problem = (
            f"no usable rows ({len(bad)} {unit}s cannot be read, the first is {unit} {bad[0]})"
            if bad
            else "no rows"
        )
        raise InputError(problem, where=path, advice=advice)
    if not bad:
        return ()
    # One line more than the share: a log may end in the middle of a line
    if len(bad) > 1 + _MAX_BAD_SHARE * n_all:
        raise InputError(
            f"{unit} {bad[0]} and {len(bad) - 1} other of {n_all} {unit}s are not {expected}", where=path,
            advice=f"correct or remove these {unit}s",
        )  # fmt: skip
    return (f"{len(bad)} of {n_all} {unit}s left out, the first is {unit} {bad[0]}",)


@dataclass(frozen=True, slots=True)
class NumberRows:
    """Rows of numbers, the line each came from, and a warning for lines left out.

    Parameters
    ----------
    values
        (n, k) float64, finite.
    line_numbers
        (n,) float64, from 1.
    rows
        (n,) float64: number of each row, from 0, comments and blank lines not counted.
    """

    values: FloatArray
    line_numbers: FloatArray
    rows: FloatArray
    warnings: tuple[str, ...] = ()


def read_number_rows(path: Path, n_cells: int) -> NumberRows:
    """Read rows of `n_cells` finite numbers; lines that begin with # are comments.

    Raises
    ------
    InputError
        No rows, or more than 1 % of the lines unusable (the first is named).
    """
    values, numbers, rows, bad = [], [], [], []
    n_rows = 0
    for block in text_blocks(path):
        for number, line in block.lines():
            cells = line.replace(",", " ").split()
            if not cells or cells[0].startswith("#"):
                continue
            row = _finite(cells) if len(cells) == n_cells else None
            if row is None:
                bad.append(number)
            else:
                values.append(row)
                numbers.append(number)
                rows.append(n_rows)
            n_rows += 1
    warnings = bad_lines_warning(
        path, bad, len(values), f"{n_cells} finite numbers", advice=f"each line holds {n_cells} numbers"
    )
    return NumberRows(
        np.array(values, dtype=np.float64), np.array(numbers, dtype=np.float64), np.array(rows, dtype=np.float64),
        warnings,
    )  # fmt: skip


def _finite(cells: list[str]) -> list[float] | None:
    try:
        row = [float(cell) for cell in cells]
    except ValueError:
        return None
    return row if all(map(math.isfinite, row)) else None
