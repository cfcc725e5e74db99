"""Addresses of lines in a database: ``postgresql://host/database?layer=guardrail``, and connections to them."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, urlencode, urlsplit, urlunsplit

from linework.errors import (
    FREE_SPACE,
    InputError,
    LineworkError,
    MachineError,
    UsageError,
    extra_needed,
    is_full_disk,
)

with extra_needed("postgis"):
    import psycopg

#: Paths drop one of the slashes of an address.
_SCHEME = re.compile(r"(?i)postgres(?:ql)?:/{1,3}(?=[^/]|$)|postgres(?:ql)?:///")
#: Names of schemas: also those that need no quotation marks.
_NAME = re.compile(r"[a-z_][a-z0-9_]{0,62}")
#: How long to wait for a server that does not answer. [s]
_CONNECT_S = 15
#: How long a server may be silent before the connection counts as lost. [ms]
_SILENT_MS = 60_000


def is_database(path: str | Path) -> bool:
    """Return whether lines are named by the address of a database.

    >>> is_database("postgresql://host/db?layer=cable"), is_database(Path("a.gpkg")), is_database("postgresql.gpkg")
    (True, False, False)
    """
    return _SCHEME.match(str(path)) is not None


@dataclass(frozen=True, slots=True)
class DatabaseAddress:
    """An address of lines.

    Parameters
    ----------
    url
        What the database library gets, without our own parameters.
    schema
        Schema of the tables.
    layer, survey
        Kind of line and survey to read, "" for all.
    """

    url: str
    schema: str
    layer: str
    survey: str

    def __str__(self) -> str:
        return self.url


def database_address(text: str | Path, *, schema: str = "") -> DatabaseAddress:
    """Return the parts of an address.

    Raises
    ------
    UsageError
        Not an address, a password in it, or a schema that is not a plain name.

    Examples
    --------
    >>> found = database_address("postgresql:/host/db?layer=cable&sslmode=require")
    >>> found.url, found.schema, found.layer
    ('postgresql://host/db?sslmode=require', 'linework', 'cable')
    """
    whole = str(text)
    if not whole.startswith(("postgresql://", "postgres://")):
        whole = _SCHEME.sub("postgresql://", whole, count=1)
    parts = urlsplit(whole)
    pairs = parse_qsl(parts.query)
    own = {key: value for key, value in pairs if key in ("layer", "survey", "schema")}
    try:
        password = parts.password
    except ValueError as error:
        raise UsageError(
            f"is not an address ({error})", where=text, advice="use postgresql://host/database"
        ) from error
    if password or any(key == "password" for key, _ in pairs):
        raise UsageError(
            "a password in an address is visible to others on this machine", where="postgresql://...",
            advice="leave it out, and set PGPASSWORD, PGPASSFILE or a service file",
        )  # fmt: skip
    name = schema or own.get("schema", "linework")
    if not _NAME.fullmatch(name):
        raise UsageError(
            f"schema '{name[:70]}' is not a plain name", where=text, advice="use small letters, digits and _"
        )
    others = urlencode([(key, value) for key, value in pairs if key not in own])
    url = urlunsplit((parts.scheme, parts.netloc, parts.path, others, ""))
    return DatabaseAddress(url, name, own.get("layer", ""), own.get("survey", ""))


@contextlib.contextmanager
def opened_database(address: DatabaseAddress) -> Iterator[Any]:
    """Yield a connection with one transaction, which is committed at the end, or rolled back; errors are one line.

    Raises
    ------
    MachineError
        No connection, or it was lost; a full disk; no permission; PostGIS is missing.
    InputError
        The database refuses what it was asked.
    """
    try:
        with psycopg.connect(
            address.url, connect_timeout=_CONNECT_S, tcp_user_timeout=_SILENT_MS, application_name="linework"
        ) as connection:
            if connection.execute("SELECT to_regtype('geometry')").fetchone() == (None,):
                raise MachineError("the database has no PostGIS", where=address,
                                   advice="let its owner run CREATE EXTENSION postgis")  # fmt: skip
            yield connection
    except psycopg.Error as error:
        raise _one_line(error, address) from error


def _one_line(error: psycopg.Error, address: DatabaseAddress) -> LineworkError:
    text = " ".join(str(error).split())[:160] or type(error).__name__
    if isinstance(error, psycopg.errors.DiskFull) or is_full_disk(error):
        return MachineError(
            f"the database's disk is full, nothing was changed ({text})", where=address, advice=FREE_SPACE
        )
    if isinstance(error, psycopg.errors.InsufficientPrivilege):
        return MachineError(f"no permission ({text})", where=address, advice="ask the owner of the database")
    if isinstance(error, psycopg.errors.UndefinedTable | psycopg.errors.InvalidSchemaName):
        return InputError(
            f"no lines of linework there ({text})", where=address, advice="linework publish writes them"
        )
    if isinstance(error, psycopg.OperationalError):
        return MachineError(f"no connection, or it was lost; nothing was changed ({text})", where=address,
                            advice="check host, name and server, and run it again")  # fmt: skip
    return InputError(f"refused by the database ({text})", where=address, advice="check the address")
