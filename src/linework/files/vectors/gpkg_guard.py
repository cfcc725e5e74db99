"""Check what a GeoPackage of another program would execute, before it is read or edited.

A database is also a program: views and generated columns compute when they are read, virtual tables run the code of
their module, triggers run with every change. GDAL executes all of them. Only plain tables and the index of the standard
pass; for editing, also only triggers that keep this index and GDAL's count of features.

References
----------
OGC 12-128r15, GeoPackage Encoding Standard: R-tree F.3. https://www.sqlite.org/security.html
"""

from __future__ import annotations

import contextlib
import re
import sqlite3
from collections.abc import Iterator
from pathlib import Path

from linework.errors import InputError

#: Most entries (tables, indices, triggers) of a file that is read: one of GDAL has 12 per layer, and a map of a country
#: has some hundred layers.
_MOST_ENTRIES = 10_000
#: Longest text of all entries: that of a layer of 2,000 columns takes 100 kB. [characters]
_LONGEST_ENTRY = 1 << 20
#: Instructions of SQLite's machine that reading the entries may take: 11 for each (measured; 100,000 entries take SQLite 20 s).
_MOST_INSTRUCTIONS = 12 * _MOST_ENTRIES
_INSTRUCTIONS_AT_ONCE = 1000
#: Place of "hidden" in a row of PRAGMA table_xinfo: not 0 for computed columns.
_HIDDEN = 6
#: How long to wait for another program that is writing the file. [s]
_WAIT_S = 5.0

_TOKEN = re.compile(
    r"""(?P<comment>--[^\n]*|/\*.*?(?:\*/|\Z))|(?P<space>\s+)
    |(?P<name>"(?:[^"]|"")*"|`(?:[^`]|``)*`|\[[^\]]*\])|(?P<text>'(?:[^']|'')*')
    |(?P<word>[^\W\d][\w$]*)|(?P<other>\d+|!=|<>|.)""",
    re.DOTALL | re.VERBOSE,
)
#: Words of SQL in the triggers that are known; all others are names.
_WORDS = frozenset(
    [
        "CREATE",
        "TABLE",
        "UNIQUE",
        "INDEX",
        "VIRTUAL",
        "USING",
        "TRIGGER",
        "VIEW",
        "TEMP",
        "TEMPORARY",
        "IF",
        "NOT",
        "EXISTS",
        "AFTER",
        "INSERT",
        "DELETE",
        "UPDATE",
        "OF",
        "ON",
        "FOR",
        "EACH",
        "ROW",
        "WHEN",
        "BEGIN",
        "END",
        "OR",
        "REPLACE",
        "INTO",
        "VALUES",
        "SET",
        "WHERE",
        "FROM",
        "AND",
        "IN",
        "IS",
        "NULL",
        "NOTNULL",
        "ISNULL",
    ]
)
#: SQLite takes a text for a name after these.
_BEFORE_NAMES = ("TABLE", "INDEX", "VIEW", "TRIGGER", "ON")
_VALUE = r"(?:NEW|OLD) \. NAME"
_BOX = r"ST_MINX \( NEW \. NAME \) , ST_MAXX \( NEW \. NAME \) , ST_MINY \( NEW \. NAME \) , ST_MAXY \( NEW \. NAME \)"
#: What the triggers of the standard and of GDAL do; RTREE is one of the file's indices.
_ACTIONS = (
    rf"INSERT (?:OR REPLACE )?INTO RTREE VALUES \( {_VALUE} , {_BOX} \)",
    r"UPDATE RTREE SET MINX = ST_MINX \( NEW \. NAME \) , MAXX = ST_MAXX \( NEW \. NAME \) ,"
    rf" MINY = ST_MINY \( NEW \. NAME \) , MAXY = ST_MAXY \( NEW \. NAME \) WHERE ID = {_VALUE}",
    rf"DELETE FROM RTREE WHERE ID (?:= {_VALUE}|IN \( {_VALUE} , {_VALUE} \))",
    r"UPDATE GPKG_OGR_CONTENTS SET FEATURE_COUNT = FEATURE_COUNT [+-] 1"
    r" WHERE LOWER \( TABLE_NAME \) = LOWER \( TEXT \)",
)
_CONDITION = rf"(?:(?:{_VALUE}|ST_ISEMPTY|NOT|NULL|NOTNULL|ISNULL|IS|AND|OR|[()=]|!=|<>) )+"
_KNOWN_TRIGGER = re.compile(
    r"CREATE TRIGGER (?:IF NOT EXISTS )?\S+ AFTER (?:INSERT|DELETE|UPDATE|UPDATE OF \S+) ON \S+ (?:FOR EACH ROW )?"
    rf"(?:WHEN {_CONDITION})?BEGIN (?:(?:{'|'.join(_ACTIONS)}) ; )+END(?: ;)?"
)
#: Names that keep their own text when a trigger is compared; all others become NAME.
_KEPT = frozenset(
    [
        "NEW",
        "OLD",
        "ID",
        "MINX",
        "MAXX",
        "MINY",
        "MAXY",
        "ST_MINX",
        "ST_MAXX",
        "ST_MINY",
        "ST_MAXY",
        "ST_ISEMPTY",
        "LOWER",
        "TABLE_NAME",
        "FEATURE_COUNT",
        "GPKG_OGR_CONTENTS",
    ]
)
#: The table of a trigger, in its text.
_TRIGGER_TABLE = re.compile(r"CREATE TRIGGER .*? ON (?P<table>\S+) ")
#: Tables of the standard that linework writes; triggers on its other ones (of images, of metadata) never run.
_WRITTEN = ("GPKG_CONTENTS", "GPKG_GEOMETRY_COLUMNS", "GPKG_EXTENSIONS", "GPKG_OGR_CONTENTS")


class ForeignSchemaError(InputError):
    """A GeoPackage would execute what its maker put into it."""


def check_geopackage(path: Path) -> None:
    """Refuse a GeoPackage that holds more than tables and their indices, before GDAL opens it; executes none of it.

    Raises
    ------
    InputError
        Not a database.
    ForeignSchemaError
        A view, a virtual table, a generated column, or too many entries.
    """
    beside = any(path.with_name(path.name + ending).exists() for ending in ("-journal", "-wal"))
    # Without a journal nobody else is writing, and nothing is to be created beside the file
    mode = "mode=ro" if beside else "mode=ro&immutable=1"
    try:
        uri = f"{path.absolute().as_uri()}?{mode}"
        with contextlib.closing(sqlite3.connect(uri, uri=True, timeout=_WAIT_S)) as db:
            db.execute("PRAGMA trusted_schema = OFF")
            db.set_authorizer(_reads_schema_only)
            check_schema(db, path)
            db.set_authorizer(None)
            _check_pages(db, path)
    except sqlite3.Error as error:
        raise InputError(f"cannot be read ({error})", where=path, advice="copy the file again") from error


def _check_pages(db: sqlite3.Connection, path: Path) -> None:
    """Refuse a database with damaged pages: GDAL reads on at the next sound one, and says nothing."""
    (found, *_), *_ = db.execute("PRAGMA quick_check(1)").fetchall()
    if found != "ok":
        raise InputError(
            f"is damaged ({str(found).splitlines()[-1][:120]})", where=path, advice="copy the file again"
        )


def check_schema(db: sqlite3.Connection, path: Path, *, to_edit: bool = False) -> None:
    """Refuse an open GeoPackage that would execute what its maker put into it.

    Parameters
    ----------
    to_edit
        Also refuse triggers, but those of the standard's index and of GDAL's counts.

    Raises
    ------
    ForeignSchemaError
        See `check_geopackage`.
    sqlite3.Error
        Not a database, or damaged.
    """
    with _bounded(db, path):
        try:
            rows = db.execute("SELECT sql FROM sqlite_master WHERE sql IS NOT NULL").fetchall()
        except UnicodeDecodeError as error:
            raise sqlite3.DatabaseError("its schema is not text") from error
    entries = [_tokens(str(sql)) for (sql,) in rows]
    indices = {_name(entry[3]) for entry in entries if _opens(entry, "CREATE VIRTUAL TABLE")}
    for entry in entries:
        if _opens(entry, "CREATE TRIGGER"):
            if to_edit and not _is_known_trigger(entry, indices):
                raise _refusal("a trigger", entry[2], "would change the file with every edit", path)
        elif _opens(entry, "CREATE VIRTUAL TABLE"):
            if [token.upper().strip('"') for token in entry[4:7]] != ["USING", "RTREE", "("]:
                raise _refusal("a virtual table", entry[3], "runs code when it is read", path)
        elif _opens(entry, "CREATE TABLE"):
            columns = db.execute(f"PRAGMA table_xinfo({entry[2]})").fetchall()
            if any(column[_HIDDEN] for column in columns):
                raise _refusal("a table with computed columns", entry[2], "computes when it is read", path)
        elif not (_opens(entry, "CREATE INDEX") or _opens(entry, "CREATE UNIQUE INDEX")):
            what = "a view" if _opens(entry, "CREATE VIEW") else "an entry of unknown kind"
            raise _refusal(what, entry[2] if len(entry) > 2 else "", "computes when it is read", path)


def _refusal(what: str, name: str, does: str, path: Path) -> ForeignSchemaError:
    return ForeignSchemaError(
        f"holds {what}, {_name(name)[:60]}, which {does}", where=path,
        advice="export the layer of lines to a new file (QGIS: Export, Save Features As)",
    )  # fmt: skip


@contextlib.contextmanager
def _bounded(db: sqlite3.Connection, path: Path) -> Iterator[None]:
    """Bound the work and the texts of the statements in the context: a recursive query would not end."""
    left = _MOST_INSTRUCTIONS // _INSTRUCTIONS_AT_ONCE

    def is_too_much() -> bool:
        nonlocal left
        left -= 1
        return left < 0

    longest = db.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _LONGEST_ENTRY)
    db.set_progress_handler(is_too_much, _INSTRUCTIONS_AT_ONCE)
    try:
        yield
    except sqlite3.OperationalError as error:
        if left >= 0:
            raise
        raise ForeignSchemaError(
            f"more than {_MOST_ENTRIES:,} tables and indices", where=path, advice="check what this file is"
        ) from error
    finally:
        db.set_progress_handler(None, _INSTRUCTIONS_AT_ONCE)
        db.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, longest)


def _reads_schema_only(
    action: int, first: str | None, second: str | None, database: str | None, inside: str | None
) -> int:
    """Allow reading the list of tables and their columns, and nothing else (an authorizer of SQLite)."""
    del second, database, inside
    is_read = action == sqlite3.SQLITE_READ and first == "sqlite_master"
    is_pragma = action == sqlite3.SQLITE_PRAGMA and first == "table_xinfo"
    return (
        sqlite3.SQLITE_OK if action == sqlite3.SQLITE_SELECT or is_read or is_pragma else sqlite3.SQLITE_DENY
    )


def _tokens(sql: str) -> list[str]:
    """Return the tokens of a statement without comments: words of SQL in capitals, names in quotes."""
    found = []
    for match in _TOKEN.finditer(sql):
        text, kind = match[0], match.lastgroup
        if kind == "word":
            found.append(text.upper() if text.upper() in _WORDS else f'"{text}"')
        elif kind == "name" or (kind == "text" and found and found[-1] in _BEFORE_NAMES):
            found.append(f'"{text[1:-1]}"')
        elif kind not in ("comment", "space"):
            found.append(text)
    return found


def _name(token: str) -> str:
    return token[1:-1].replace('""', '"') if token[:1] in ("'", '"') else token


def _opens(entry: list[str], words: str) -> bool:
    """Return whether a statement begins with these words; a name follows them."""
    n = words.count(" ") + 1
    return entry[:n] == words.split() and len(entry) > n


def _is_known_trigger(entry: list[str], indices: set[str]) -> bool:
    """Return whether a trigger does only what those of the standard and of GDAL do, or can never run."""
    known = {name.upper() for name in indices}
    words = []
    for token in entry:
        name = _name(token).upper()
        if token.startswith("'"):
            words.append("TEXT")
        elif not token.startswith('"'):
            words.append(token)
        elif name in known:
            words.append("RTREE")
        else:
            is_value = words[-2:] in (["NEW", "."], ["OLD", "."])
            is_plain = name in _KEPT or name.startswith("GPKG_")
            words.append(name if is_plain and not is_value else "NAME")
    text = " ".join(words)
    if _KNOWN_TRIGGER.fullmatch(text):
        return True
    on = _TRIGGER_TABLE.match(text)
    return on is not None and on["table"].startswith("GPKG_") and on["table"] not in _WRITTEN
