"""The one CSV reader and writer: named columns of numbers or of texts, bad lines counted with their line numbers."""

from __future__ import annotations

import csv
import difflib
import io
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.files.logs.text import MAX_BAD, TextBlock, bad_lines_warning, text_blocks, text_lines

#: A block with an irregular line is halved down to this size, then read line by line. [bytes]
_SMALL_BYTES = 1 << 14


@dataclass(frozen=True, slots=True)
class NumberTable:
    """Columns of finite numbers by name, the line each row came from, and a warning for lines left out.

    Parameters
    ----------
    columns
        (n,) float64 each.
    line_numbers
        (n,) float64: line of each row; the header is line 1.
    """

    columns: dict[str, FloatArray]
    line_numbers: FloatArray
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Layout:
    """Layout of the lines of a file: separator, number of cells, numbers of the wanted cells."""

    separator: str
    n_cells: int
    places: tuple[int, ...]


def read_table(
    path: Path, required: Sequence[str], groups: Sequence[Sequence[str]] = (), *, one_of: bool = False
) -> NumberTable:
    """Read columns of numbers from a CSV file with a header row; UTF-8, any line ends, with or without BOM.

    Cells are separated by commas, or by semicolons or tabs where the header has more of those; decimals may then
    be commas.

    Parameters
    ----------
    required
        Columns that must be there.
    groups
        Columns that come together or not at all.
    one_of
        Whether one of the groups must be present; of several the first is read.

    Raises
    ------
    InputError
        Missing columns (all are named), no rows, or more than 1 % of the lines unusable (the first is named).
    """
    blocks = text_blocks(path)
    header, rest = next(blocks, TextBlock(b"", 1)).without_first_line()
    if "\0" in header:
        raise InputError(
            "is not a table of text (it holds NUL bytes)", where=path, advice="check what this file is"
        )
    separator, there = header_cells(header)
    names = column_names(path, there, required, groups, one_of=one_of)
    layout = _Layout(separator, len(there), tuple(there.index(name) for name in names))
    values, numbers, bad = _read_rows(rest, blocks, layout)
    warnings = bad_lines_warning(
        path, bad, len(values), "finite numbers in all columns",
        advice="columns are separated by commas, decimals by points",
    )  # fmt: skip
    columns = {name: np.ascontiguousarray(values[:, i]) for i, name in enumerate(names)}
    return NumberTable(columns, numbers, warnings)


def write_table(path: Path, names: Sequence[str], rows: FloatArray) -> None:
    """Write rows (n, k) of numbers below a header row of their k names; every number reads back exactly."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(rows.tolist())


def _read_rows(
    first: TextBlock, others: Iterator[TextBlock], layout: _Layout
) -> tuple[FloatArray, FloatArray, list[int]]:
    """Return the wanted values (n, k), their line numbers (n,), and the numbers of unusable lines."""
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
            if len(bad) > MAX_BAD:
                break
            good = [(number, row) for number, row in rows if row is not None]
            values.append(
                np.array([row for _, row in good], dtype=np.float64).reshape(-1, len(layout.places))
            )
            numbers.append(np.array([number for number, _ in good], dtype=np.float64))
    return np.concatenate(values), np.concatenate(numbers), bad


def _values_at_once(block: TextBlock, layout: _Layout) -> FloatArray | None:
    """Return the wanted values (n, k) of a block of regular lines, else None.

    An hour at 100 Hz with 13 columns takes 1.0 s of one core this way, 2.3 s line by line.
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
    # loadtxt skips blank lines
    return wanted if len(wanted) == block.n_lines and np.isfinite(wanted).all() else None


def _values_of_line(line: str, layout: _Layout) -> list[float] | None:
    """Return the wanted numbers of a line, or None where it is cut off, garbled or not finite."""
    cells = line.split(layout.separator)
    if len(cells) != layout.n_cells and '"' in line:
        cells = split_cells(line, layout.separator)
    if len(cells) != layout.n_cells:
        return None
    wanted = [cells[i] for i in layout.places]
    if layout.separator != ",":
        wanted = [cell.replace(",", ".") for cell in wanted]
    try:
        values = [float(cell) for cell in wanted]
    except ValueError:
        return None
    # v - v is 0 only for finite numbers
    return values if all(v - v == 0.0 for v in values) else None


def csv_line(cells: Sequence[str]) -> str:
    r"""Return one line of a CSV file, with its end; cells that hold separators are quoted.

    >>> csv_line(["1.5", "sign, broken", ""])
    '1.5,"sign, broken",\n'
    """
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow([" ".join(cell.splitlines()) for cell in cells])
    return text.getvalue()


def header_cells(line: str) -> tuple[str, list[str]]:
    """Return the separator of a header row, and the names of its columns in lower case."""
    separator = max(",;\t", key=line.count)
    return separator, [cell.strip().lower() for cell in split_cells(line, separator)]


def split_cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line, quotation marks resolved; none where it is not CSV."""
    try:
        return next(csv.reader([line], delimiter=separator), [])
    except csv.Error:
        return []


def column_names(
    path: Path,
    there: Sequence[str],
    required: Sequence[str],
    groups: Sequence[Sequence[str]],
    *,
    one_of: bool,
) -> list[str]:
    """Return the columns to read; raise an error that names those missing."""
    names, missing = list(required), [name for name in required if name not in there]
    begun = [group for group in groups if any(name in there for name in group)]
    if one_of:
        whole = [group for group in groups if all(name in there for name in group)]
        begun = (whole or begun)[:1]
    for group in begun:
        names += group
        missing += [name for name in group if name not in there]
    instead = [" or ".join(", ".join(group) for group in groups)] if one_of and not begun else []
    _refuse_missing(path, missing + instead, there, several=bool(instead))
    return names


def _refuse_missing(
    path: Path, missing: Sequence[str], there: Sequence[str], *, several: bool = False
) -> None:
    if missing:
        plural = "s" if several or len(missing) > 1 else ""
        # Of a file that is no log, nothing is shown that does not resemble a name of ours
        near = [name for one in missing for name in difflib.get_close_matches(one, there, 1)]
        named = f"the nearest is {', '.join(dict.fromkeys(near))}" if near else "none has a name like that"
        raise InputError(
            f"missing column{plural} {', '.join(missing)} (of the {len(there)} there, {named})",
            where=path,
            advice="the first line must name the columns",
        )


@dataclass(frozen=True, slots=True)
class TextTable:
    """Texts of the wanted columns by name, the line each row came from, and the lines that are not rows.

    Parameters
    ----------
    columns
        Texts without surrounding blanks; an optional column that is missing has no entry.
    line_numbers
        Line of each row; the header is line 1.
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
        Whether the surplus cells of a line belong to its last column: a text that holds separators.

    Raises
    ------
    InputError
        Missing columns (all are named), not text, a line or a file that is too long.
    """
    lines = text_lines(path)
    separator, cells = header_cells(lines[0][1] if lines else "")
    _refuse_missing(path, [name for name in required if name not in cells], cells)
    wanted = {name: cells.index(name) for name in (*required, *optional) if name in cells}
    rows, numbers, bad = [], [], []
    for number, line in lines[1:]:
        values = split_cells(line, separator)
        if rest_in_last and len(values) > len(cells):
            values = [*values[: len(cells) - 1], separator.join(values[len(cells) - 1 :])]
        if len(values) == len(cells):
            rows.append([values[i].strip() for i in wanted.values()])
            numbers.append(number)
        else:
            bad.append(number)
    columns = dict(zip(wanted, zip(*rows, strict=True) if rows else ((),) * len(wanted), strict=True))
    return TextTable(columns, tuple(numbers), tuple(bad))


def finite_number(text: str) -> float | None:
    """Return the finite number that a text stands for, else None.

    >>> finite_number(" 1.5 "), finite_number("nan"), finite_number("1,5")
    (1.5, None, None)
    """
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
