"""`linework clean`: remove the work folder of a survey."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


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
