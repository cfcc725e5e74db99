"""`linework convert`: lines from one vector format to another."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def convert(
    lines: Annotated[Path, typer.Argument(metavar="LINES", help="Lines to read.")],
    output: Annotated[Path, typer.Argument(metavar="OUT", help="File to write; its suffix says the format.")],
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace OUT.")] = False,
    crs: Annotated[
        str, typer.Option("--crs", help="EPSG:... or local: the CRS where LINES does not say.")
    ] = "",
) -> None:
    """Convert LINES to another vector format; the points of the van's log go with them where it holds points."""
    from linework.cli.failures import warn
    from linework.errors import UsageError
    from linework.files.output.locks import reserve_output
    from linework.files.vectors.point_layers import read_point_layers
    from linework.files.vectors.read_write import check_format, points_left_out, read_lines, write_lines

    check_format(output)
    if output.exists() and lines.exists() and output.samefile(lines):
        raise UsageError("would replace the file it reads", where=output, advice="choose another name")
    with reserve_output(output, overwrite=overwrite):
        found = read_lines(lines, crs=crs or None)
        points = read_point_layers(lines)
        write_lines(found, output, kinds=sorted(set(found.kind)), points=points, overwrite=overwrite)
    for warning in points_left_out(output, points):
        warn(warning)
    typer.echo(f"{len(found):,} lines in {output}")


# `linework clean`: remove the work folder of a survey


def clean(
    surveys: Annotated[
        list[Path],
        typer.Argument(metavar="SURVEY...", help="Laser files, a folder of them, or a survey folder."),
    ],
    work: Annotated[
        Path | None, typer.Option("--work", help="The folder given as --work to other commands.")
    ] = None,
) -> None:
    """Remove the tile store and unfinished runs of SURVEY.

    They can be made anew; input files and outputs are not touched.
    """
    from linework.runs.opened.work_folder import clean_work_folder as cleaned
    from linework.runs.opened.work_folder import existing_work_folders, survey_root

    folders = existing_work_folders(survey_root(surveys), work)
    for folder in folders:
        n_bytes = cleaned(folder)
        typer.echo(f"{folder}: {n_bytes / 1e6:,.1f} MB freed")
    if not folders:
        typer.echo("nothing to remove")


# `linework config`: the default run file, every field with its unit and its reason


def config(
    method: Annotated[
        str, typer.Argument(metavar="[METHOD]", help="Only this method's settings; without it, all.")
    ] = "",
) -> None:
    """Print the default run file.

    It is TOML: edit it and give it to `extract --config`.
    """
    from dataclasses import fields

    from linework.errors import UsageError
    from linework.model.settings import settings_toml
    from linework.runs.settings import RunSettings

    names = [f.name for f in fields(RunSettings)]
    if method and method not in names:
        raise UsageError(
            f"method {method} is not there", where="config", advice=f"choose from {', '.join(names)}"
        )
    settings = RunSettings()
    for name in [method] if method else names:
        typer.echo(f"[{name}]\n{settings_toml(getattr(settings, name), f'{name}.')}", nl=False)
