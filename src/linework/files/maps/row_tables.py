"""Tables of rows as files: CSV, spreadsheet, and GeoPackage with the stretch of line of each row.

Beside `linework.evaluation`, which makes the rows: only this room writes files.
"""

from __future__ import annotations

import dataclasses
import io
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from linework.arrays import AnyArray, FloatArray
from linework.errors import needed
from linework.files.output.publish import write_bytes
from linework.files.vectors.gpkg_schema import LayerTable, geopackage_bytes

#: Decimals of numbers in tables: a tenth of a millimetre, and as much of a per cent.
_DECIMALS = 4
#: Stored in place of the time of writing, so that the same rows give the same bytes.
_DATE = datetime(2000, 1, 1)


def write_rows(
    names: Sequence[str], rows: Sequence[Sequence[Any]], pieces: Sequence[FloatArray], crs: str, path: Path, *,
    layer: str, by: str, overwrite: bool = False,
) -> None:  # fmt: skip
    """Write rows as .csv, .xlsx or .gpkg.

    Parameters
    ----------
    names, rows
        Names of the columns, and the values; None: not known.
    pieces
        (k, 3) vertices of each row's line, for .gpkg. [m, world]
    layer
        Name of the layer of a .gpkg.
    by
        The column whose values are the sheets of an .xlsx.

    Raises
    ------
    OutputExistsError, MachineError
        As for `publish`.
    """
    rounded = [[round(v, _DECIMALS) if isinstance(v, float) else v for v in row] for row in rows]
    suffix = path.suffix.lower()
    if suffix == ".csv":
        content = _csv(names, rounded)
    elif suffix == ".xlsx":
        content = _xlsx(names, rounded, names.index(by))
    else:
        content = _gpkg(names, rounded, pieces, crs, layer)
    write_bytes(content, path, overwrite=overwrite)


def _csv(names: Sequence[str], rows: Sequence[Sequence[Any]]) -> bytes:
    lines = [",".join(names), *(",".join(_cell(value) for value in row) for row in rows)]
    return ("\n".join(lines) + "\n").encode()


def _cell(value: Any) -> str:
    """Return a value as a cell (RFC 4180).

    >>> _cell(None), _cell(0.5), _cell("a, b"), _cell("=1+1")
    ('', '0.5', '"a, b"', "'=1+1")
    """
    text = "" if value is None else str(value)
    # A spreadsheet would take these for a formula
    if isinstance(value, str) and text[:1] in tuple("=+-@\t"):
        text = "'" + text
    return '"' + text.replace('"', '""') + '"' if set(text) & set(',"\n\r') else text


def _xlsx(names: Sequence[str], rows: Sequence[Sequence[Any]], by: int) -> bytes:
    """Return a spreadsheet with a sheet per value of one column."""
    xlsxwriter = needed("xlsxwriter", "reports", where=".xlsx")
    buffer = io.BytesIO()
    book = xlsxwriter.Workbook(
        buffer, {"in_memory": True, "strings_to_formulas": False, "strings_to_urls": False}
    )
    book.set_properties({"created": _DATE})
    verdict = names.index("verdict") if "verdict" in names else None
    bold = book.add_format({"bold": True})
    colours = {
        name: book.add_format({"bg_color": colour})
        for name, colour in (("below", "#f4b6a6"), ("above", "#f4b6a6"), ("unknown", "#dddddd"))
    }
    for name in dict.fromkeys(row[by] for row in rows) or ("report",):
        sheet = book.add_worksheet(name)
        sheet.write_row(0, 0, names, bold)
        sheet.freeze_panes(1, 0)
        own = [row for row in rows if row[by] == name]
        for at, row in enumerate(own, start=1):
            sheet.write_row(at, 0, row, colours.get(row[verdict]) if verdict is not None else None)
        sheet.autofilter(0, 0, max(len(own), 1), len(names) - 1)
        sheet.set_column(0, len(names) - 1, 13)
    book.close()
    return buffer.getvalue()


def _gpkg(
    names: Sequence[str], rows: Sequence[Sequence[Any]], pieces: Sequence[FloatArray], crs: str, layer: str
) -> bytes:
    columns: dict[str, AnyArray] = {}
    for i, name in enumerate(names):
        values = [row[i] for row in rows]
        if all(v is None or isinstance(v, int | float) for v in values):
            columns[name] = np.array([np.nan if v is None else v for v in values], dtype=np.float64)
        else:
            columns[name] = np.array([v or None for v in values], dtype=object)
    shapes = np.array([*(shapely.linestrings(piece) for piece in pieces), None], dtype=object)[:-1]
    return geopackage_bytes([LayerTable(layer, columns, shapes)], crs)


def values_of(row: Any) -> list[Any]:
    """Return the fields of a row in order."""
    return [getattr(row, field.name) for field in dataclasses.fields(row)]
