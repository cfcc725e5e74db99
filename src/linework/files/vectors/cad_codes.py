"""Feature codes for CAD: the layer, code and colour that a firm or a road authority has for each kind of line.

Separate from `dxf`, which applies them: a table can be read and checked without ezdxf.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from linework.errors import InputError
from linework.files.input import read_input_text
from linework.files.logs.tables import read_text_table
from linework.model.lines import LineSet

#: Columns by which a row is chosen, and columns that it gives; only kind and layer must be there.
CHOOSING, GIVING = ("kind", "pattern", "role", "form"), ("layer", "code", "color", "linetype")
#: Characters that DXF does not allow in the name of a layer, and its greatest length.
_NOT_IN_NAMES, _LONGEST_NAME = '<>/\\":;?*|=,`', 255
#: Largest table [bytes]: thousands of rows.
_MAX_BYTES = 1 << 20
LINETYPES = ("", "continuous", "dashed")


class CadCode(NamedTuple):
    """A row of a table of feature codes: "" in a choosing column fits any line.

    Parameters
    ----------
    kind, pattern, role, form
        The lines to which it applies.
    layer, code
        Name of the layer, and the code that each line has in its extended data.
    color
        (red, green, blue), or None for that of the kind.
    linetype
        "continuous", "dashed", or "" for that of the pattern.
    """

    kind: str
    pattern: str
    role: str
    form: str
    layer: str
    code: str
    color: tuple[int, int, int] | None
    linetype: str


def read_cad_codes(path: Path) -> tuple[CadCode, ...]:
    """Return the rows of a table of feature codes, in their order: CSV with a header; other columns are ignored.

    Raises
    ------
    InputError
        The file cannot be read, is not UTF-8, a column is missing, or a row is wrong; the message names its line.
    """
    # Read loosely, letters of another encoding would become other letters in names of layers
    read_input_text(path, max_bytes=_MAX_BYTES, advice="keep one row for each kind of line")
    needed = ("kind", "layer")
    others = [name for name in CHOOSING + GIVING if name not in needed]
    table = read_text_table(path, needed, others)
    if table.bad_lines:
        raise InputError(
            f"line {table.bad_lines[0]} has other cells than the header",
            where=path,
            advice="correct the line",
        )
    rows = zip(*table.columns.values(), strict=True)
    codes = [
        _code(dict(zip(table.columns, row, strict=True)), number, path)
        for number, row in zip(table.line_numbers, rows, strict=True)
    ]
    if not codes:
        raise InputError("has no rows", where=path, advice="add a row for each kind of line")
    return tuple(codes)


def _code(row: dict[str, str], number: int, path: Path) -> CadCode:
    layer, linetype = row["layer"], row.get("linetype", "").lower()
    if (
        not layer
        or len(layer) > _LONGEST_NAME
        or any(c in _NOT_IN_NAMES or not c.isprintable() for c in layer)
    ):
        raise InputError(
            f"line {number}: '{layer[:60]}' is not a name of a layer", where=path,
            advice=f"1 to {_LONGEST_NAME} characters without {' '.join(_NOT_IN_NAMES)}",
        )  # fmt: skip
    if linetype not in LINETYPES:
        raise InputError(
            f"line {number}: unknown linetype '{linetype}'", where=path, advice="use continuous or dashed"
        )
    color = row.get("color", "")
    if color and not re.fullmatch(r"#[0-9a-fA-F]{6}", color):
        raise InputError(
            f"line {number}: '{color}' is not a color", where=path, advice="use #rrggbb, such as #ffcc00"
        )
    rgb = (int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)) if color else None
    kind, pattern, role, form = (row.get(name, "") for name in CHOOSING)
    return CadCode(kind, pattern, role, form, layer, row.get("code", ""), rgb, linetype)


def codes_of_lines(lines: LineSet, codes: Sequence[CadCode]) -> list[CadCode | None]:
    """Return the first row that fits each line, None where none does.

    >>> codes = [CadCode("lane_marking", "dashed", "", "", "V-DASH", "", None, ""),
    ...          CadCode("lane_marking", "", "", "", "V-LINE", "", None, "")]
    >>> lines = LineSet.from_lines([[[0, 0, 0], [9, 0, 0]]] * 3, kind=["lane_marking", "lane_marking", "cable"],
    ...                            pattern=["dashed", "solid", ""])
    >>> [code and code.layer for code in codes_of_lines(lines, codes)]
    ['V-DASH', 'V-LINE', None]
    """
    columns = zip(*(getattr(lines, name).tolist() for name in CHOOSING), strict=True)
    found: dict[tuple[str, ...], CadCode | None] = {}
    rows = []
    for values in columns:
        if values not in found:
            fits = (
                one
                for one in codes
                if all(c in ("", v) for c, v in zip(one[: len(CHOOSING)], values, strict=True))
            )
            found[values] = next(fits, None)
        rows.append(found[values])
    return rows
