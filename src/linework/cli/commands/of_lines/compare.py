"""`linework compare`: what has changed between two surveys of a road.

Separate from the other commands, as every command has its own file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from linework.cli.options import AllowOutside, AllowRemote, Crs, Overwrite, Quiet, WorkFolder
from linework.cli.said import say


def compare_command(
    old: Annotated[Path, typer.Argument(metavar="OLD", help="Lines of the earlier survey.")],
    new: Annotated[Path, typer.Argument(metavar="NEW", help="Lines of the later survey.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="Output file: .gpkg, .csv or .xlsx.")
    ],
    report: Annotated[
        Path | None,
        typer.Option(
            "--report", metavar="FILE", help="Also write a page with a map, figures and a table: .html."
        ),
    ] = None,
    old_survey: Annotated[
        list[Path] | None,
        typer.Option(
            "--old-survey",
            metavar="SURVEY",
            help="Points of OLD: what it saw, and worn paint. Can be repeated.",
        ),
    ] = None,
    new_survey: Annotated[
        list[Path] | None,
        typer.Option(
            "--new-survey",
            metavar="SURVEY",
            help="Points of NEW: what it saw, and worn paint. Can be repeated.",
        ),
    ] = None,
    overwrite: Overwrite = False,
    crs: Crs = None,
    allow_outside: AllowOutside = False,
    allow_remote: AllowRemote = False,
    work: WorkFolder = None,
    quiet: Quiet = False,
) -> None:
    """Find what has changed from OLD to NEW: new, gone, moved and changed lines.

    The two are registered by their own lines first, so that slow errors of navigation are no changes. Where NEW could not
    see a line of OLD, that is reported as not visible; what one survey has probably missed, as unsure. With the points of
    both surveys, stretches with less or more paint than before are changes too, a line is new or gone only where the other
    survey saw the ground, and what that looks like there says whether the line was missed.
    """
    import contextlib
    import math
    from collections import Counter

    from linework.cli.commands.of_lines.survey_points import LinesAndPoints, points_of_both
    from linework.cli.failures import warn
    from linework.errors import UsageError, argument, check_extra
    from linework.evaluation.changes.epochs import check_same_crs, compare_epochs
    from linework.files.maps.row_tables import write_rows
    from linework.files.output.locks import reserve_output
    from linework.files.vectors.read_write import read_usable_lines
    from linework.lines.units import in_metres

    suffix = output.suffix.lower()
    if suffix not in (".gpkg", ".csv", ".xlsx"):
        raise UsageError(
            f"cannot write changes as '{suffix}'", where=output, advice="use .gpkg, .csv or .xlsx"
        )
    if report is not None and report.suffix.lower() not in (".html", ".htm"):
        raise UsageError(f"cannot write reports as '{report.suffix}'", where=report, advice="use .html")
    if bool(old_survey) != bool(new_survey):
        missing = "new_survey" if old_survey else "old_survey"
        raise UsageError("the points of both surveys are compared", advice=f"give {argument(missing)} too")
    if suffix == ".xlsx" or report is not None:
        check_extra("reports", where=report or output)
    with contextlib.ExitStack() as held:
        for path in (output, report) if report else (output,):
            held.enter_context(reserve_output(path, overwrite=overwrite, inputs=[old, new]))
        before, after = (read_usable_lines(path, crs=crs) for path in (old, new))
        for left_out in filter(None, (before[1], after[1])):
            warn(left_out)
        before, after = ((in_metres(found), left_out) for found, left_out in (before, after))
        check_same_crs(before[0], after[0])
        paint, known_m, looks = None, 0.0, None
        if old_survey and new_survey:
            surveys = [
                LinesAndPoints(
                    lines=found[0], paths=paths, options=("old_survey", "new_survey"), crs=crs, allow_outside=allow_outside,
                    allow_remote=allow_remote, work=work, quiet=quiet,
                )
                for found, paths in ((before, old_survey), (after, new_survey))
            ]  # fmt: skip
            paint, known_m, looks = points_of_both(surveys[0], surveys[1], (old, new))
        changes, registration = compare_epochs(before[0], after[0], paint, looks)
        names = (
            "status", "kind", "line", "length_m", "across_m", "up_m", "sigma_across_m", "sigma_up_m", "what", "from_m", "to_m",
            "probability",
        )  # fmt: skip
        rows = [
            [
                change.status, str(change.line.kind[0]), str(change.line.id[0]), change.length_m,
                *(None if math.isnan(v) else v for v in
                  (change.across_m, change.up_m, change.sigma_across_m, change.sigma_up_m)), change.what,
                change.from_m, change.to_m, None if math.isnan(change.probability) else change.probability,
            ]
            for change in changes
        ]  # fmt: skip
        pieces = [change.line.xyz for change in changes]
        write_rows(
            names, rows, pieces, before[0].crs, output, layer="change", by="status", overwrite=overwrite
        )
        if report is not None:
            from linework.crs import describe_crs
            from linework.evaluation.changes.changes_page import changes_page
            from linework.files.output.publish import write_page

            facts = {"old": str(old), "new": str(new), "CRS": describe_crs(before[0].crs)}
            page = changes_page(
                changes,
                registration,
                before[0],
                after[0],
                facts,
                title=f"Changes from {old.name} to {new.name}",
            )
            write_page(page, report, overwrite=overwrite)
    counts = Counter((change.status, str(change.line.kind[0])) for change in changes)
    for (status, kind), n in sorted(counts.items()):
        length_m = sum(c.length_m for c in changes if (c.status, str(c.line.kind[0])) == (status, kind))
        say(f"{status:12} {kind:18} {n:6,} stretches {length_m:12,.1f} m")
    if len(registration.cells):
        across, up = registration.sigma_m.mean(axis=0)
        say(
            f"registered in {len(registration.cells):,} cells of 25 m, sigma {across:.3f} m across, {up:.3f} m up"
        )
    if paint is not None:
        say(f"paint compared on at most {known_m:,.0f} m of markings")
    n_unsure = sum(change.status in ("unsure", "not visible") for change in changes)
    say(f"{len(changes) - n_unsure:,} changes, {n_unsure:,} stretches unsure or not visible in {output}")
