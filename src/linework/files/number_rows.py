"""Text files of numbers without a header: the same count on every line, blanks between them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.files.las_header import regular_file_bytes
from linework.files.text_lines import judge_bad_lines, text_blocks


@dataclass(frozen=True, slots=True)
class NumberRows:
    """Rows of numbers, the line each came from, and what was left out.

    Parameters
    ----------
    values
        (n, k) float64, finite.
    line_numbers
        (n,) float64, from 1.
    rows
        (n,) float64: the how-manieth row each is, from 0, comments and blank lines not counted.
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
    if regular_file_bytes(path) == 0:
        raise InputError("empty file (0 bytes)", where=path, advice="copy the file again")
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
    said = judge_bad_lines(
        path, bad, len(values), f"{n_cells} finite numbers", advice=f"each line holds {n_cells} numbers"
    )
    return NumberRows(
        np.array(values, dtype=np.float64), np.array(numbers, dtype=np.float64), np.array(rows, dtype=np.float64), said
    )  # fmt: skip


def _finite(cells: list[str]) -> list[float] | None:
    try:
        row = [float(cell) for cell in cells]
    except ValueError:
        return None
    return row if all(map(math.isfinite, row)) else None
