"""`linework publish`: lines into a PostGIS database.

Separate from the other commands, as every command has its own file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from linework.cli.options import AllowOutside, AllowRemote, AsJson, Crs, Quiet, WorkFolder
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
    points: Annotated[
        list[Path] | None,
        typer.Option(
            "--points",
            metavar="SURVEY",
            help="Points of the lines: what is left of the paint. Can be repeated.",
        ),
    ] = None,
    as_json: AsJson = False,
    crs: Crs = None,
    allow_outside: AllowOutside = False,
    allow_remote: AllowRemote = False,
    work: WorkFolder = None,
    quiet: Quiet = False,
) -> None:
    """Publish LINES to PostGIS, in one transaction.

    Lines of the same survey that were published before are replaced, those of other surveys stay. Lines that somebody
    has reviewed in the database stay, too. Passwords come from PGPASSWORD, PGPASSFILE or a service file.
    With --points also how much of the paint of each marking is left, every 10 m, in the table `paint`.
    """
    import dataclasses

    from linework.errors import PartialError, UsageError, check_extra
    from linework.files.vectors.fields import lines_with_heights
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
    found, flat = lines_with_heights(found)
    left_out = "; ".join(filter(None, (left_out, f"{lines}: {flat}" if flat else "")))
    name = survey or lines.stem
    paint = None
    if points:
        from linework.cli.commands.of_lines.survey_points import LinesAndPoints
        from linework.evaluation.chainage.paint_along import paint_stretches
        from linework.lines.units import in_metres

        measured = in_metres(found)
        pieces = LinesAndPoints(
            lines=measured, paths=points, options=("points",), crs=crs, allow_outside=allow_outside,
            allow_remote=allow_remote, work=work, quiet=quiet,
        )  # fmt: skip
        paint = paint_stretches(measured, pieces.paint())
    done = publish_lines(found, address, name, source=str(lines), paint=paint)
    if as_json:
        say_json(dataclasses.asdict(done))
    else:
        say(
            f"{done.written:,} lines written, {done.unchanged:,} unchanged, {done.removed:,} removed, "
            f"{done.kept:,} reviewed ones kept in {address.schema} of survey {name}"
        )
    if left_out:
        raise PartialError(left_out, advice="the other lines are published")
