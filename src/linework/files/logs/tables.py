"""CSV tables of numbers: named columns, bad lines counted with their line numbers."""

from __future__ import annotations

import csv
import io
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.files.las.header import regular_file_bytes
from linework.files.logs.text import TextBlock, bad_lines_warning, text_blocks

#: A block with an odd line is halved until the part around that line is as small as this, and read line by line.
_SMALL_BYTES = 1 << 14


@dataclass(frozen=True, slots=True)
class NumberTable:
    """Columns of finite numbers by name, the line each row came from, and what was left out."""

    columns: dict[str, FloatArray]
    line_numbers: FloatArray
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Layout:
    """How the lines of a file are laid out: separator, number of cells, which cells are wanted."""

    separator: str
    n_cells: int
    places: tuple[int, ...]


def read_table(
    path: Path, required: Sequence[str], groups: Sequence[Sequence[str]] = (), *, one_of: bool = False
) -> NumberTable:
    """Read columns of numbers from a CSV file with a header row; UTF-8, any line ends, with or without BOM.

    Cells are separated by commas; by semicolons or tabs where the header is, and decimals are then points or
    commas.

    Parameters
    ----------
    required
        Columns that must be there.
    groups
        Columns that come together or not at all.
    one_of
        Whether one of the groups must be there; where several are, the first is read.

    Raises
    ------
    InputError
        Missing columns (all are named), no rows, or more than 1 % of the lines unusable (the first is named).
    """
    if regular_file_bytes(path) == 0:
        raise InputError("empty file (0 bytes)", where=path, advice="copy the file again")
    blocks = text_blocks(path)
    header, rest = next(blocks, TextBlock(b"", 1)).without_first_line()
    if "\0" in header:
        raise InputError(
            "is not a table of text (it holds NUL bytes)", where=path, advice="check what this file is"
        )
    separator = max(",;\t", key=header.count)
    there = [cell.lower() for cell in _cells(header, separator)]
    names = _column_names(path, there, required, groups, one_of=one_of)
    layout = _Layout(separator, len(there), tuple(there.index(name) for name in names))
    values, numbers, bad = _read_rows(rest, blocks, layout)
    said = bad_lines_warning(
        path, bad, len(values), "finite numbers in all columns",
        advice="columns are separated by commas, decimals by points",
    )  # fmt: skip
    columns = {name: np.ascontiguousarray(values[:, i]) for i, name in enumerate(names)}
    return NumberTable(columns, numbers, said)


def _read_rows(
    first: TextBlock, others: Iterator[TextBlock], layout: _Layout
) -> tuple[FloatArray, FloatArray, list[int]]:
    """Return the wanted values (n, k), their lines, and the lines that are unusable."""
    values, numbers, bad = [np.zeros((0, len(layout.places)))], [np.zeros(0)], list[int]()
    waiting = [first]
    while waiting or (waiting := list(itertools.islice(others, 1))):
        block = waiting.pop()
        at_once = _values_at_once(block, layout)
        if at_once is not None:
            values.append(at_once)
            numbers.append(block.first_line + np.arange(len(at_once), dtype=np.float64))
        elif len(block.text) > _SMALL_BYTES and block.n_lines > 1:
            waiting += reversed(block.halves())
        else:
            rows = [(number, _values_of_line(line, layout)) for number, line in block.lines() if line.strip()]
            bad += [number for number, row in rows if row is None]
            good = [(number, row) for number, row in rows if row is not None]
            values.append(
                np.array([row for _, row in good], dtype=np.float64).reshape(-1, len(layout.places))
            )
            numbers.append(np.array([number for number, _ in good], dtype=np.float64))
    return np.concatenate(values), np.concatenate(numbers), bad


def _values_at_once(block: TextBlock, layout: _Layout) -> FloatArray | None:
    """Return the wanted values of a block of lines in which nothing is odd, else None.

    An hour at 100 Hz with 13 columns takes 1.0 s of one core so, line by line 2.3 s.
    """
    if layout.separator != "," or not block.all_lines_have(",", layout.n_cells - 1):
        return None
    try:
        wanted = np.loadtxt(
            io.BytesIO(block.text),
            delimiter=",",
            usecols=layout.places,
            comments=None,
            ndmin=2,
            encoding="utf-8",
        )
    except ValueError:
        return None
    # Blank lines are passed over there
    return wanted if len(wanted) == block.n_lines and np.isfinite(wanted).all() else None


def _values_of_line(line: str, layout: _Layout) -> list[float] | None:
    """Return the wanted numbers of a line, or None where it is cut off, garbled or not finite."""
    cells = line.split(layout.separator)
    if len(cells) != layout.n_cells and '"' in line:
        cells = _cells(line, layout.separator)
    if len(cells) != layout.n_cells:
        return None
    wanted = [cells[i] for i in layout.places]
    if layout.separator != ",":
        wanted = [cell.replace(",", ".") for cell in wanted]
    try:
        values = [float(cell) for cell in wanted]
    except ValueError:
        return None
    # A number less itself is 0 only if finite.
    return values if all(v - v == 0.0 for v in values) else None


def _cells(line: str, separator: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]
    except csv.Error:
        return []


def _column_names(
    path: Path,
    there: Sequence[str],
    required: Sequence[str],
    groups: Sequence[Sequence[str]],
    *,
    one_of: bool,
) -> list[str]:
    """Return the columns to read, or say which are missing."""
    names, missing = list(required), [name for name in required if name not in there]
    begun = [group for group in groups if any(name in there for name in group)]
    if one_of:
        whole = [group for group in groups if all(name in there for name in group)]
        begun = (whole or begun)[:1]
    for group in begun:
        names += group
        missing += [name for name in group if name not in there]
    instead = [" or ".join(", ".join(group) for group in groups)] if one_of and not begun else []
    if missing or instead:
        raise InputError(
            f"missing column{'s' if len(missing + instead) > 1 or instead else ''} {', '.join(missing + instead)}"
            f" (there are: {', '.join(there[:12])[:120]})",
            where=path,
            advice="the first line must name the columns",
        )
    return names


# CSV tables of texts: named columns, lines that are cut off counted with their line numbers

#: Longer lines are no table (a binary file, or one without line ends).
_MAX_LINE_CHARS = 10_000
#: A drive of 28 hours at 10 Hz; more is a mistake, and has to be held in memory.
MAX_ROWS = 1_000_000


@dataclass(frozen=True, slots=True)
class TextTable:
    """Texts of the wanted columns by name, the line each row came from, and lines that are no rows.

    Parameters
    ----------
    columns
        Texts without the blanks around them; columns that may be missing and are, are not there.
    line_numbers
        Of every row, the header being line 1.
    bad_lines
        Numbers of lines with another number of cells than the header.
    """

    columns: dict[str, tuple[str, ...]]
    line_numbers: tuple[int, ...]
    bad_lines: tuple[int, ...] = ()


def read_text_table(
    path: Path, required: Sequence[str], optional: Sequence[str] = (), *, rest_in_last: bool = False
) -> TextTable:
    """Read columns of a CSV file with a header row; UTF-8, any line ends, with or without BOM.

    Parameters
    ----------
    required, optional
        Columns that must be there, and those that may.
    rest_in_last
        Whether lines with more cells than the header are texts with commas in the last column.

    Raises
    ------
    InputError
        Missing columns (all are named), no text, a line or a file that is too long.
    """
    lines = text_lines(path)
    cells = [cell.strip().lower() for cell in next(csv.reader([lines[0][1]] if lines else [""]), [])]
    missing = [name for name in required if name not in cells]
    if missing:
        shown = ", ".join(cells[:12])[:120]
        raise InputError(
            f"missing column{'s' if len(missing) > 1 else ''} {', '.join(missing)} (there are: {shown})",
            where=path, advice="the first line must name the columns",
        )  # fmt: skip
    wanted = {name: cells.index(name) for name in (*required, *optional) if name in cells}
    rows, numbers, bad = [], [], []
    for number, line in lines[1:]:
        values = next(csv.reader([line]), [])
        if rest_in_last and len(values) > len(cells):
            values = [*values[: len(cells) - 1], ",".join(values[len(cells) - 1 :])]
        if len(values) == len(cells):
            rows.append([values[i].strip() for i in wanted.values()])
            numbers.append(number)
        else:
            bad.append(number)
    columns = dict(zip(wanted, zip(*rows, strict=True) if rows else ((),) * len(wanted), strict=True))
    return TextTable(columns, tuple(numbers), tuple(bad))


def text_lines(path: Path) -> list[tuple[int, str]]:
    """Return the lines of a text file that are not blank, with their numbers from 1.

    Raises
    ------
    InputError
        Empty, no text, a line longer than 10,000 characters, more than a million lines.
    """
    if regular_file_bytes(path) == 0:
        raise InputError("empty file (0 bytes)", where=path, advice="copy the file again")
    found, number = [], 0
    with path.open(encoding="utf-8-sig", errors="replace", newline=None) as file:
        while line := file.readline(_MAX_LINE_CHARS):
            number += 1
            if "\0" in line:
                raise InputError("is not a table of text (it holds NUL bytes)", where=path,
                                 advice="check what this file is")  # fmt: skip
            if len(line) >= _MAX_LINE_CHARS:
                raise InputError(f"line {number} is longer than {_MAX_LINE_CHARS:,} characters", where=path,
                                 advice="check what this file is")  # fmt: skip
            if number > MAX_ROWS + 1:
                raise InputError(f"more than {MAX_ROWS:,} lines", where=path, advice="split the survey")
            if line.strip():
                found.append((number, line.rstrip("\n")))
    return found


def finite_number(text: str) -> float | None:
    """Return the number a text says, or None where it is none or not finite.

    >>> finite_number(" 1.5 "), finite_number("nan"), finite_number("1,5")
    (1.5, None, None)
    """
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
