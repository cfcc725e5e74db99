"""CSV tables of texts: named columns, lines that are cut off counted with their line numbers."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from linework.errors import InputError
from linework.files.las_header import regular_file_bytes

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
