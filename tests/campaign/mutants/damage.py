"""Damage of any file: of its bytes, of its text, of its SQLite pages. A seed decides all of it."""

from __future__ import annotations

import re
import sqlite3
import tempfile
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path

import numpy as np
from tests.campaign.mutants.laser_damage import BYTE_CHANGES

#: What stands where a number or a word should.
WORDS = (
    b"nan", b"inf", b"-inf", b"1e999", b"-1e308", b"1e-320", b"0", b"-1", b"9" * 40, b"9" * 5000, b"", b" ", b"x", b"\0",
    b"\xff\xfe", b'"', b"'", b",", b";", b"null", b"true", b"{}", b"[]", b"[[[[", b"\x1b[31m", b"\r", b"\n", b"../../etc/passwd",
    b"file:///etc/passwd", b"http://127.0.0.1:9/", "\u202eé😀".encode(), b"<a>", b"&lt;", b"%s%n", b"1_000", b"0x1f", b"1,5",
)  # fmt: skip
#: Damage that doubles lines or nests brackets stops here. [bytes]
MOST_BYTES = 3_000_000
#: SQL that somebody may have put into a GeoPackage.
HOSTILE_SQL = (
    "CREATE VIEW w AS WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT x FROM c",
    "CREATE TRIGGER t AFTER INSERT ON gpkg_contents BEGIN DELETE FROM gpkg_geometry_columns; END",
    "UPDATE gpkg_contents SET table_name = 'no such table'",
    "UPDATE gpkg_contents SET min_x = 1e308, max_x = -1e308",
    "UPDATE gpkg_contents SET srs_id = 99999",
    "UPDATE gpkg_geometry_columns SET column_name = 'x\"; DROP TABLE gpkg_contents; --'",
    "UPDATE gpkg_geometry_columns SET geometry_type_name = 'CURVEPOLYGON'",
    "DELETE FROM gpkg_spatial_ref_sys",
    "DELETE FROM gpkg_contents",
    "DELETE FROM gpkg_geometry_columns",
    "DROP TABLE gpkg_extensions",
    "DROP TABLE gpkg_spatial_ref_sys",
    "PRAGMA application_id = 0",
    "PRAGMA user_version = 2000000000",
    "PRAGMA journal_mode = WAL",
    "CREATE TABLE [a]]b\"c'd;e](x)",
)
_TOKEN = re.compile(rb"[^\s,;:=\[\]{}()\"'<>]+")


def damaged_bytes(rng: np.random.Generator, data: bytes) -> tuple[str, bytes]:
    """Return (what was done, bytes) of a file whose bytes are changed in one to three ways."""
    changed, done = bytearray(data), []
    for _ in range(1 + int(rng.integers(3)) * int(rng.random() < 0.3)):
        change = BYTE_CHANGES[int(rng.integers(len(BYTE_CHANGES)))]
        done.append(f"{change.__name__.strip('_')} {change(rng, changed)}")
    return ", ".join(done), bytes(changed)


def damaged_text(rng: np.random.Generator, data: bytes) -> tuple[str, bytes]:
    """Return (what was done, bytes) of a text with other words, lines that are gone, doubled or endless; or as bytes."""
    if rng.random() < 0.3:
        return damaged_bytes(rng, data)
    done = []
    for _ in range(1 + int(rng.integers(4)) * int(rng.random() < 0.4)):
        change = _TEXT_CHANGES[int(rng.integers(len(_TEXT_CHANGES)))]
        note, data = change(rng, data)
        done.append(note)
        data = data[:MOST_BYTES]
    return ", ".join(done), data


def _words(rng: np.random.Generator, data: bytes) -> tuple[str, bytes]:
    found = list(_TOKEN.finditer(data))
    if not found:
        return "nothing", data
    for _ in range(1 + int(rng.integers(3))):
        token = found[int(rng.integers(len(found)))]
        word = WORDS[int(rng.integers(len(WORDS)))]
        data = data[: token.start()] + word + data[token.end() :]
    return f"{word[:12]!r} at {token.start()}", data


def _lines(rng: np.random.Generator, data: bytes) -> tuple[str, bytes]:
    lines = data.split(b"\n")
    at, other = (int(i) for i in rng.integers(0, len(lines), 2))
    what = int(rng.integers(6))
    if what == 0:
        del lines[at]
    elif what == 1:
        lines.insert(other, lines[at])
    elif what == 2:
        lines[at], lines[other] = lines[other], lines[at]
    elif what == 3:
        lines[at] = lines[at][:1000] * int(rng.integers(2, 2_000))
    elif what == 4:
        lines = (
            lines[:1] + [lines[i] for i in rng.permutation(np.arange(1, len(lines)))]
            if len(lines) > 1
            else lines
        )
    else:
        lines = [lines[0]] * int(rng.integers(2, 50)) + lines
    return f"lines {what} at {at}", b"\n".join(lines)


def _encoding(rng: np.random.Generator, data: bytes) -> tuple[str, bytes]:
    what = int(rng.integers(5))
    if what == 0:
        return "BOM", b"\xef\xbb\xbf" + data
    if what == 1:
        return "UTF-16", data.decode("utf-8", "replace").encode("utf-16")
    if what == 2:
        return "CRLF", data.replace(b"\n", b"\r\n")
    if what == 3:
        return "CR", data.replace(b"\n", b"\r")
    return "a byte that is not UTF-8", data[: len(data) // 2] + b"\xff" + data[len(data) // 2 :]


def _nesting(rng: np.random.Generator, data: bytes) -> tuple[str, bytes]:
    depth = int(rng.choice([10, 1000, 100_000]))
    opening = (b"[", b'{"a":', b"a.")[int(rng.integers(3))]
    places = [m.start() for m in _TOKEN.finditer(data)]
    at = places[int(rng.integers(len(places)))] if places else 0
    return f"{depth} of {opening!r} at {at}", data[:at] + opening * depth + data[at:]


_TEXT_CHANGES = (_words, _words, _words, _lines, _lines, _encoding, _nesting)


def damaged_geopackage(rng: np.random.Generator, data: bytes) -> tuple[str, bytes]:
    """Return (what was done, bytes) of a GeoPackage with other rows, hostile objects, changed pages or bytes."""
    what = rng.random()
    if what < 0.35:
        return damaged_bytes(rng, data)
    if what < 0.5:
        changed = bytearray(data)
        page = int(rng.integers(1, max(len(data) // 4096, 2))) * 4096
        changed[page : page + 4096] = rng.bytes(4096) if rng.random() < 0.5 else bytes(4096)
        return f"page at {page}", bytes(changed)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.gpkg"
        path.write_bytes(data)
        note = "nothing"
        with closing(sqlite3.connect(path)) as db, suppress(sqlite3.Error):
            if what < 0.75:
                note = HOSTILE_SQL[int(rng.integers(len(HOSTILE_SQL)))]
                db.execute(note)
            else:
                note = _odd_cell(rng, db)
            db.commit()
        return note[:80], path.read_bytes()


def _odd_cell(rng: np.random.Generator, db: sqlite3.Connection) -> str:
    """Put something odd into a column of a table, all rows or one."""
    tables = [
        r[0]
        for r in db.execute("SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'rtree%'")
    ]
    table = tables[int(rng.integers(len(tables)))]
    columns = [r[1] for r in db.execute(f'PRAGMA table_info("{table}")')]
    column = columns[int(rng.integers(len(columns)))]
    odd: list[object] = [
        None, "", "x" * 100_000, -1, 2**63 - 1, float("inf"), float("nan"), 1e308, b"", b"GP", b"GP\0\1\0\0\0\0",
        b"GP\0\3" + bytes(36), "'; DROP TABLE x; --", "\x1b[31m", "LINESTRING(0 0)", 0,
        b"GP\0\1\0\0\0\0\1\2\0\0\0\xff\xff\xff\xff", b"GP\0\1\0\0\0\0\1\xea\x03\0\0\1\0\0\0" + bytes(24),
    ]  # fmt: skip
    value = odd[int(rng.integers(len(odd)))]
    where = "" if rng.random() < 0.3 else " WHERE rowid = (SELECT max(rowid) FROM " + f'"{table}")'
    db.execute(f'UPDATE "{table}" SET "{column}" = ?{where}', (value,))
    return f"{table}.{column} = {value!r}"


Damage = Callable[[np.random.Generator, bytes], tuple[str, bytes]]
