"""Read the headers of PLY and PCD files: texts that say which values each point has, and in which form.

References
----------
G. Turk, "The PLY Polygon File Format" (1994). Point Cloud Library, "The PCD (Point Cloud Data) file format", version 0.7.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import BinaryIO

from linework.errors import InputError
from linework.files.clouds.table import (
    DAMAGED_ADVICE,
    MOST_HEADER_BYTES,
    CloudTable,
    Encoding,
    check_rows_fit,
    cloud_table,
)
from linework.files.input import open_input

_PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_PLY_ORDERS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
_PCD_TYPES = {"F": {4: "<f4", 8: "<f8"}, "I": {1: "i1", 2: "<i2", 4: "<i4", 8: "<i8"},
              "U": {1: "u1", 2: "<u2", 4: "<u4", 8: "<u8"}}  # fmt: skip
_PCD_ENCODINGS: dict[str, Encoding] = {"ascii": "text", "binary": "rows", "binary_compressed": "columns"}
_MOST_POINTS = 1 << 40
_MOST_DIGITS = 13


def read_cloud_table(path: Path) -> tuple[CloudTable, int]:
    """Return where the points of a PLY or PCD file are, and their number.

    Raises
    ------
    InputError
        Not such a file, cut off, or a header that cannot be true.
    """
    with open_input(path) as file:
        n_bytes = os.fstat(file.fileno()).st_size
        if n_bytes == 0:
            raise InputError("empty file (0 bytes)", where=path, advice="copy the file again")
        table, n_points = _ply(path, file) if path.suffix.lower() == ".ply" else _pcd(path, file)
        check_rows_fit(path, table, n_points, n_bytes)
        return table, n_points


def _lines(path: Path, file: BinaryIO, last: str) -> list[list[str]]:
    """Return the words of the header's lines, up to the one that begins with `last`."""
    found: list[list[str]] = []
    n_bytes = 0
    while not (found and found[-1][:1] == [last]):
        line = file.readline(MOST_HEADER_BYTES)
        n_bytes += len(line)
        if not line.endswith(b"\n") or n_bytes > MOST_HEADER_BYTES:
            raise InputError(f"cut off inside the header (no line {last})", where=path, advice=DAMAGED_ADVICE)
        words = line.decode("latin-1").split()
        if words and not words[0].startswith("#"):
            found.append(words)
    return found


def _number(path: Path, text: str, what: str) -> int:
    if not (len(text) <= _MOST_DIGITS and text.isascii() and text.isdecimal() and int(text) < _MOST_POINTS):
        raise InputError(
            f"{what} is '{text[:20]}', expected a whole number", where=path, advice=DAMAGED_ADVICE
        )
    return int(text)


def _ply(path: Path, file: BinaryIO) -> tuple[CloudTable, int]:
    if file.readline(8).strip() != b"ply":
        raise InputError(
            "not a PLY file (it does not begin with ply)", where=path, advice="check what this file is"
        )
    order, encoding = "", ""
    elements: list[tuple[str, int, list[tuple[str, str]]]] = []
    for words in _lines(path, file, "end_header"):
        if words[0] == "format":
            encoding = words[1] if len(words) > 1 else ""
            if encoding not in _PLY_ORDERS:
                raise InputError(f"PLY format '{encoding[:30]}', expected {', '.join(_PLY_ORDERS)}", where=path,
                                 advice="write it as binary_little_endian")  # fmt: skip
            order = _PLY_ORDERS[encoding]
        elif words[0] == "element" and len(words) == 3:
            elements.append((words[1], _number(path, words[2], f"the number of {words[1][:20]}"), []))
        elif words[0] == "property" and elements and len(words) >= 3:
            elements[-1][2].append(_property(path, words, order))
        elif words[0] not in ("comment", "obj_info", "end_header"):
            raise InputError(
                f"a header line that begins with '{words[0][:20]}'", where=path, advice=DAMAGED_ADVICE
            )
    if not encoding:
        raise InputError("a header without the line format", where=path, advice=DAMAGED_ADVICE)
    if not elements or elements[0][0] != "vertex":
        there = elements[0][0][:20] if elements else "none"
        raise InputError(f"vertices are not the first element ({there})", where=path,
                         advice="write the points first")  # fmt: skip
    _, n_points, columns = elements[0]
    if any(kind == "list" for _, kind in columns):
        raise InputError(
            "vertices with lists are not read", where=path, advice="write the points without lists"
        )
    return cloud_table(path, columns, "text" if encoding == "ascii" else "rows", file.tell()), n_points


def _property(path: Path, words: list[str], order: str) -> tuple[str, str]:
    """Return name and type of a property; the type of a list is "list"."""
    if words[1] == "list":
        return words[-1], "list"
    if words[1] not in _PLY_TYPES or len(words) != 3:
        raise InputError(f"a property of the unknown type '{' '.join(words[1:-1])[:30]}'", where=path,
                         advice=DAMAGED_ADVICE)  # fmt: skip
    return words[2], order + _PLY_TYPES[words[1]]


def _pcd(path: Path, file: BinaryIO) -> tuple[CloudTable, int]:
    lines = {words[0]: words[1:] for words in _lines(path, file, "DATA")}
    missing = [name for name in ("FIELDS", "SIZE", "TYPE", "POINTS") if not lines.get(name)]
    if missing:
        raise InputError(f"not a PCD file: no line {', '.join(missing)}", where=path,
                         advice="check what this file is")  # fmt: skip
    names, sizes, types = lines["FIELDS"], lines["SIZE"], lines["TYPE"]
    counts = lines.get("COUNT") or ["1"] * len(names)
    if not len(names) == len(sizes) == len(types) == len(counts):
        raise InputError(
            f"{len(names)} fields, but {len(sizes)} sizes, {len(types)} types and {len(counts)} counts", where=path,
            advice=DAMAGED_ADVICE,
        )  # fmt: skip
    columns = []
    for i, (name, size, kind, count) in enumerate(zip(names, sizes, types, counts, strict=True)):
        dtype = _PCD_TYPES.get(kind, {}).get(_number(path, size, f"the size of {name[:20]}"))
        if dtype is None:
            raise InputError(f"field {name[:20]} of type {kind[:5]} and {size} bytes", where=path,
                             advice=DAMAGED_ADVICE)  # fmt: skip
        n = _number(path, count, f"the count of {name[:20]}")
        if n > 1 << 10:
            raise InputError(f"field {name[:20]} of {n:,} values", where=path, advice=DAMAGED_ADVICE)
        # Names of several fields may be "_": bytes that fill up
        plain = f"_{i}" if name == "_" else name
        columns += [(plain if n == 1 else f"{plain}[{k}]", dtype) for k in range(n)]
    encoding = (lines["DATA"] or [""])[0]
    if encoding not in _PCD_ENCODINGS:
        raise InputError(f"PCD data '{encoding[:30]}', expected {', '.join(_PCD_ENCODINGS)}", where=path,
                         advice="write it as binary")  # fmt: skip
    n_points = _number(path, lines["POINTS"][0], "POINTS")
    return cloud_table(path, columns, _PCD_ENCODINGS[encoding], file.tell()), n_points
