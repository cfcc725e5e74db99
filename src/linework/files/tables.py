"""CSV tables of numbers: named columns, bad lines counted with their line numbers."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.errors import InputError
from linework.files.las_header import regular_file_bytes
from linework.model.arrays import FloatArray

#: Longer lines are no table of numbers (a binary file, or one without line ends).
_MAX_LINE_CHARS = 10_000
#: Logs are cut off and garbled here and there; beyond this share something else is wrong (decimal commas, units).
_MAX_BAD_SHARE = 0.01


@dataclass(frozen=True, slots=True)
class Table:
    """Columns of finite numbers by name, the line each row came from, and what was left out."""

    columns: dict[str, FloatArray]
    line_numbers: FloatArray
    warnings: tuple[str, ...] = ()


def read_table(path: Path, required: Sequence[str], groups: Sequence[Sequence[str]] = ()) -> Table:
    """Read columns of numbers from a CSV file with a header row; UTF-8, any line ends, with or without BOM.

    Parameters
    ----------
    required
        Columns that must be there.
    groups
        Columns that come together or not at all.

    Raises
    ------
    InputError
        Missing columns (all are named), no rows, or more than 1 % of the lines unusable (the first is named).
    """
    if regular_file_bytes(path) == 0:
        raise InputError("empty file (0 bytes)", where=path, advice="copy the file again")
    with path.open(encoding="utf-8-sig", errors="replace", newline=None) as file:
        header = file.readline(_MAX_LINE_CHARS)
        if "\0" in header:
            raise InputError(
                "is not a table of text (it holds NUL bytes)", where=path, advice="check what this file is"
            )
        names = _column_names(path, header, required, groups)
        places = _places(header)
        rows, numbers, bad = [], [], []
        n_fields = len(places)
        number = 1
        while line := file.readline(_MAX_LINE_CHARS):
            number += 1
            if len(line) >= _MAX_LINE_CHARS:
                raise InputError(f"line {number} is longer than {_MAX_LINE_CHARS:,} characters", where=path,
                                 advice="check what this file is")  # fmt: skip
            if not line.strip():
                continue
            values = _values(line, n_fields, [places[name] for name in names])
            if values is None:
                bad.append(number)
            else:
                rows.append(values)
                numbers.append(number)
    warnings = _judge_bad_lines(path, bad, len(rows))
    data = np.array(rows, dtype=np.float64).reshape(len(rows), len(names))
    columns = {name: np.ascontiguousarray(data[:, i]) for i, name in enumerate(names)}
    return Table(columns, np.array(numbers, dtype=np.float64), warnings)


def _places(header: str) -> dict[str, int]:
    cells = next(csv.reader([header]), [])
    return {name.strip().lower(): i for i, name in enumerate(cells)}


def _column_names(
    path: Path, header: str, required: Sequence[str], groups: Sequence[Sequence[str]]
) -> list[str]:
    """Return the columns to read, or say which are missing."""
    places = _places(header)
    names = list(required)
    missing = [name for name in required if name not in places]
    for group in groups:
        present = [name for name in group if name in places]
        names += present
        if present:
            missing += [name for name in group if name not in places]
    if missing:
        shown = ", ".join(list(places)[:12])
        raise InputError(
            f"missing column{'s' if len(missing) > 1 else ''} {', '.join(missing)} (there are: {shown[:120]})",
            where=path,
            advice="the first line must name the columns",
        )
    return names


def _values(line: str, n_fields: int, places: Sequence[int]) -> list[float] | None:
    """Return the wanted numbers of a line, or None where it is cut off, garbled or not finite."""
    cells = line.rstrip("\n").split(",")
    if len(cells) != n_fields and '"' in line:
        cells = next(csv.reader([line]), [])
    if len(cells) != n_fields:
        return None
    try:
        values = [float(cells[i]) for i in places]
    except ValueError:
        return None
    # A number less itself is 0 only if finite.
    return values if all(v - v == 0.0 for v in values) else None


def _judge_bad_lines(path: Path, bad: Sequence[int], n_good: int) -> tuple[str, ...]:
    if n_good == 0:
        problem = f"no usable rows ({len(bad)} lines cannot be read as numbers)" if bad else "no rows"
        raise InputError(problem, where=path, advice="columns are separated by commas, decimals by points")
    if not bad:
        return ()
    # One more than the share: a log that ends in the middle of a line is no reason to refuse it.
    if len(bad) > 1 + _MAX_BAD_SHARE * (n_good + len(bad)):
        raise InputError(
            f"line {bad[0]} and {len(bad) - 1} other of {n_good + len(bad)} lines are not finite numbers in all columns",
            where=path,
            advice="correct or remove these lines",
        )
    return (f"{len(bad)} of {n_good + len(bad)} lines left out, the first is line {bad[0]}",)
