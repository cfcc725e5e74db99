"""`linework publish`: lines into a PostGIS database.

Separate from the other commands, as every command has its own file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from linework.cli.options import AsJson, Crs
from linework.cli.said import say, say_json


def publish_command(
    lines: Annotated[Path, typer.Argument(metavar="LINES", help="Extracted lines.")],
    database: Annotated[
        str, typer.Argument(metavar="DATABASE", help="postgresql://HOST/DATABASE, without a password.")
    ],
    schema: Annotated[str, typer.Option("--schema", help="Schema of the tables.")] = "linework",
    survey: Annotated[
        str, typer.Option("--survey", help="Name of the survey; default: that of the file.")
    ] = "",
    as_json: AsJson = False,
    crs: Crs = None,
) -> None:
    """Publish LINES to PostGIS, in one transaction.

    Lines of the same survey that were published before are replaced, those of other surveys stay. Lines that somebody
    has reviewed in the database stay, too. Passwords come from PGPASSWORD, PGPASSFILE or a service file.
    """
    import dataclasses

    from linework.errors import PartialError, UsageError, check_extra
    from linework.files.vectors.read_write import read_usable_lines

    check_extra("postgis", where="DATABASE")
    from linework.files.postgis.address import database_address, is_database
    from linework.files.postgis.write import publish_lines

    if not is_database(database):
        raise UsageError(
            f"'{database[:40]}' is not a database",
            where="DATABASE",
            advice="use postgresql://HOST/DATABASE",
        )
    address = database_address(database, schema=schema)
    found, left_out = read_usable_lines(lines, crs=crs)
    name = survey or lines.stem
    done = publish_lines(found, address, name, source=str(lines))
    if as_json:
        say_json(dataclasses.asdict(done))
    else:
        say(
            f"{done.written:,} lines written, {done.unchanged:,} unchanged, {done.removed:,} removed, "
            f"{done.kept:,} reviewed ones kept in {address.schema} of survey {name}"
        )
    if left_out:
        raise PartialError(left_out, advice="the other lines are published")
